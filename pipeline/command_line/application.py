"""The program as a Hydra application: Hydra parses, composes, sweeps and launches."""

import logging
import os
import sys
import threading
import traceback
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import hydra
from hydra.core.hydra_config import HydraConfig
from hydra.types import RunMode
from omegaconf import DictConfig

from pipeline.command_line import runs
from pipeline.command_line.callbacks import Refused
from pipeline.command_line.config import CONFIG_NAME, VERSION_BASE, checked_job, folders_of, hydra_apart
from pipeline.command_line.hydra_errors import errors_in_words
from pipeline.command_line.invocation import FULL_ERROR, Invocation, invocations, shows_tracebacks
from pipeline.command_line.overrides import first_line, parse
from pipeline.command_line.sweeps import RESUMED, recorded_command
from pipeline.run import interrupts, sweep
from pipeline.run.runner import Interrupted
from pipeline.settings.places import conf_folder


def run_task(config: DictConfig) -> int:
    """Run one experiment in the folder that Hydra chose, in whatever process; return the exit code.

    Errors are not raised: that of a run alone is kept for `run_application`; in a sweep it is written into
    the run's folder, and the other runs go on.
    """
    invocation = invocations[-1] if invocations else None
    settings = HydraConfig.get()
    folder = Path(settings.runtime.output_dir)
    if settings.mode == RunMode.MULTIRUN:
        if invocation is None:
            _prepare_worker()
        return _run_of_sweep(config, folder, invocation)
    words = list(settings.overrides.task)
    if invocation is None or invocation.job is None:  # called by another program, or without our callback
        return runs.run_or_resume(checked_job(config, words, folder, folders_of(settings)), words)
    try:
        invocation.code = runs.run_new(replace(invocation.job, folder=folder), invocation.command)
    except Exception as error:  # noqa: BLE001 - raised by `run_application`, or kept
        invocation.code, invocation.error = runs.FAULT, error
    return invocation.code


#: `run_task` itself stays importable by its name, by which launchers send it to other processes
application = hydra.main(config_path=str(conf_folder()), config_name=CONFIG_NAME, version_base=VERSION_BASE)(
    run_task
)


def _run_of_sweep(config: DictConfig, folder: Path, invocation: Invocation | None) -> int:
    """Start or resume a run of a sweep, and record in its folder how it ended; return the exit code."""
    settings = HydraConfig.get()
    words = list(settings.overrides.task)
    command = recorded_command(Path(settings.sweep.dir), folder) or words
    try:
        if RESUMED in config:
            overrides = [override for override in parse(words) if override.key_or_group != RESUMED]
            ending = sweep.Ending(runs.resume(folder, overrides, command))
        else:
            job = checked_job(config, words, folder, folders_of(settings))
            ending = sweep.Ending(runs.run_or_resume(job, command))
    except (ValueError, OSError, MemoryError) as error:
        if invocation is not None and invocation.shows_tracebacks:
            raise
        sys.stderr.write(runs.error_text(error))
        ending = sweep.Ending(runs.MISTAKE, runs.error_sentence(error))
    except Exception as error:
        if invocation is not None and invocation.shows_tracebacks:
            raise
        traceback.print_exc()
        ending = sweep.Ending(runs.FAULT, f"a fault of the program: {type(error).__name__}: {error}")
    sweep.write_ending(folder, ending)
    if invocation is not None and invocation.sweep is not None:
        invocation.sweep.report(folder, ending)
    return ending.code


def _prepare_worker() -> None:
    """Set up a worker process of a launcher like a process that runs alone."""
    from threadpoolctl import threadpool_limits  # noqa: PLC0415 - only workers need them

    from fis_tools.processors import num_processors  # noqa: PLC0415

    if threading.current_thread() is threading.main_thread():
        interrupts.remember()
    # some launchers give BLAS a share of the processors, and sums depend on the number of its threads
    threadpool_limits(num_processors(), "blas")


def run_application(words: Sequence[str], command: Sequence[str], *, resumes: bool = False) -> int:
    """Run the application on a checked command line; return the exit code.

    Parameters
    ----------
    words : sequence of str
        Hydra's options, and overrides.
    command : sequence of str
        The arguments with which a run is started, as its manifest keeps them.
    resumes : bool
        Whether a sweep goes on.

    Raises
    ------
    ValueError, OSError, MemoryError
        User errors.
    Interrupted
    """
    invocation = Invocation(command, resumes=resumes, shows_tracebacks=shows_tracebacks())
    invocations.append(invocation)
    try:
        with hydra_apart(), _process_of(words), invocation.locks:
            _call(invocation)
            return invocation.sweep.end() if invocation.sweep else invocation.code
    finally:
        invocations.pop()


def _call(invocation: Invocation) -> None:
    """Call the application; raise its errors in our words."""
    try:
        with errors_in_words([conf_folder()]), interrupts.heeded():
            application()
    except Refused as refused:
        raise refused.error from None
    except SystemExit as end:  # Hydra has printed what was asked for
        if end.code:
            raise
    except KeyboardInterrupt as interrupt:
        if invocation.sweep is None:
            raise
        left = len(invocation.sweep.left)
        raise Interrupted(
            f"{interrupt or 'interrupted'}\n{left} runs of the sweep are left. To go on with all: "
            f"{invocation.sweep.cure}"
        ) from interrupt
    except Exception as error:
        if invocation.sweep is None or invocation.shows_tracebacks:
            raise
        sys.stderr.write(f"the launcher lost a run ({type(error).__name__}: {first_line(error)})\n")
    if invocation.error is not None:
        raise invocation.error


@contextmanager
def _process_of(words: Sequence[str]) -> Iterator[None]:
    """Give Hydra a process with some arguments, in which it raises errors; restore what it changes there."""
    arguments, full, root = sys.argv, os.environ.get(FULL_ERROR), logging.getLogger()
    level, handlers = root.level, list(root.handlers)
    sys.argv, os.environ[FULL_ERROR] = [*arguments[:1], *words], "1"
    try:
        yield
    finally:
        sys.argv, root.handlers = arguments, handlers
        root.setLevel(level)
        if full is None:
            del os.environ[FULL_ERROR]
        else:
            os.environ[FULL_ERROR] = full
