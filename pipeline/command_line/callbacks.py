"""What Hydra calls before it makes anything: each run is checked, and its folder, or the sweep's, is locked.

Hydra turns an Exception of a callback into a warning and goes on, so that errors leave as `Refused`.
"""

import logging
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TextIO

from hydra.core.hydra_config import HydraConfig
from hydra.experimental.callback import Callback
from omegaconf import DictConfig

from pipeline.command_line import runs
from pipeline.command_line.config import (
    check_stages,
    check_working_directory,
    checked_job,
    folders_of,
    without_hydra,
)
from pipeline.command_line.invocation import invocations
from pipeline.command_line.sweeps import Sweep
from pipeline.run import interrupts
from pipeline.run.lock import held


class Refused(BaseException):
    """Carries an error through Hydra; not an Exception, for which Hydra would only warn.

    Parameters
    ----------
    error : Exception
    """

    def __init__(self, error: Exception) -> None:
        super().__init__(str(error))
        self.error = error


@contextmanager
def refusing() -> Iterator[None]:
    """Re-raise errors inside as `Refused`; at the end raise interrupts that a library swallowed."""
    try:
        with interrupts.heeded():
            yield
    except Exception as error:
        raise Refused(error) from error


class _Handler(logging.StreamHandler[TextIO]):
    """Prints messages of libraries."""


class Preflight(Callback):
    """Checks before anything is made; named in conf/hydra/default.yaml.

    Launchers send it to where jobs run, so that it holds nothing.
    """

    def on_run_start(self, config: DictConfig, **kwargs: Any) -> None:
        """Check a run, and lock its folder."""
        with refusing():
            HydraConfig.instance().set_config(config)
            words = list(config.hydra.overrides.task)
            folder, folders = Path(config.hydra.run.dir), folders_of(config.hydra)
            job = checked_job(without_hydra(config), words, folder, folders)
            check_working_directory(config.hydra, job)
            check_stages(job.config, words)
            runs.check_before(job.experiment)
            for invocation in invocations[-1:]:
                invocation.locks.enter_context(held(job.folder))
                invocation.job = job
            runs.check_vacant(job)

    def on_multirun_start(self, config: DictConfig, **kwargs: Any) -> None:
        """Check all runs of a sweep, lock its folder and write its file."""
        with refusing():
            HydraConfig.instance().set_config(config)
            for invocation in invocations[-1:]:
                sweep = Sweep.resumed(config) if invocation.resumes else Sweep.checked(config)
                invocation.locks.enter_context(held(sweep.folder))
                sweep.write()
                invocation.sweep = sweep

    def on_job_start(self, config: DictConfig, **kwargs: Any) -> None:
        """Print the messages of libraries, if ``hydra.verbose`` asks for them."""
        root = logging.getLogger()
        if config.hydra.verbose and not any(isinstance(other, _Handler) for other in root.handlers):
            handler = _Handler(sys.stderr)
            handler.setFormatter(logging.Formatter("[%(name)s] %(message)s"))
            root.addHandler(handler)
            logging.getLogger("numba").setLevel(logging.INFO)  # it tells each step of compiling
