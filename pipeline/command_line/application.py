"""The program as a Hydra application: Hydra parses, composes, sweeps and launches.

Before Hydra makes anything it calls `Preflight`, which checks each run and locks its folder, or the sweep's.
"""

import logging
import os
import sys
import threading
import traceback
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import hydra
from hydra.core.hydra_config import HydraConfig
from hydra.experimental.callback import Callback
from hydra.types import RunMode
from omegaconf import DictConfig

from pipeline.command_line import endings, runs
from pipeline.command_line.config import COMPOSED_FROM, Job, checked_job, errors_in_words, hydra_apart
from pipeline.command_line.hydra_parts import composing_once
from pipeline.command_line.overrides import first_line, parse
from pipeline.command_line.sweeps import RESUMED, Sweep, literal, new_job, recorded_command, unfinished
from pipeline.run import interrupts, sweep
from pipeline.run.lock import held
from pipeline.run.runner import Interrupted

#: of Hydra: "1" where it raises errors, instead of printing them and ending the process
FULL_ERROR = "HYDRA_FULL_ERROR"


@dataclass
class Invocation:
    """The state of a command in the process that runs it.

    Parameters
    ----------
    command : sequence of str
        The arguments with which a run is started.
    shows_tracebacks : bool
        Whether user errors are raised, too.
    locks : ExitStack
        On the run's folder, or the sweep's, until the command ends.
    job : Job, optional
        The run, checked; None in a sweep.
    sweep : Sweep, optional
    code : int
        The exit code of the run.
    error : Exception, optional
        What the run failed with.
    """

    command: Sequence[str]
    shows_tracebacks: bool
    locks: ExitStack = field(default_factory=ExitStack)
    job: Job | None = None
    sweep: Sweep | None = None
    code: int = 0
    error: Exception | None = None


#: the last is the present command: a stage may run others; launchers run jobs where there is none
invocations: list[Invocation] = []


class Refused(BaseException):
    """Carries an error, its one argument, through Hydra: it makes an Exception of a callback a warning."""


@contextmanager
def refusing(config: DictConfig) -> Iterator[None]:
    """Re-raise errors inside as `Refused`; at the end raise interrupts that a library swallowed.

    Inside, the configuration's references to Hydra's own part are resolved.
    """
    try:
        with errors_in_words(), interrupts.heeded():
            HydraConfig.instance().set_config(config)
            yield
    except Exception as error:
        raise Refused(error) from error


class Preflight(Callback):
    """Checks before anything is made; named in conf/hydra/default.yaml.

    Launchers send it to where jobs run, so that it holds nothing.
    """

    def on_run_start(self, config: DictConfig, **kwargs: Any) -> None:
        """Check a run, and lock its folder."""
        with refusing(config):
            job = new_job(config, Path(config.hydra.run.dir))
            for invocation in invocations[-1:]:
                invocation.locks.enter_context(held(job.folder))
                invocation.job = job

    def on_multirun_start(self, config: DictConfig, **kwargs: Any) -> None:
        """Check all runs of a sweep, lock its folder and write its file."""
        with refusing(config):
            for invocation in invocations[-1:]:
                checked = Sweep.checked(config)
                invocation.locks.enter_context(held(checked.folder))
                checked.write()
                invocation.sweep = checked

    def on_job_start(self, config: DictConfig, **kwargs: Any) -> None:
        """Print the messages of libraries, if ``hydra.verbose`` asks for them."""
        if config.hydra.verbose:
            logging.basicConfig(format="[%(name)s] %(message)s", force=True)
            logging.getLogger("numba").setLevel(logging.INFO)  # it tells each step of compiling


def run_task(config: DictConfig) -> int:
    """Run one experiment in the folder that Hydra chose, in whatever process; return the exit code.

    Errors are not raised: that of a run alone is kept for `run_application`; in a sweep it is written into
    the run's folder, and the other runs go on.
    """
    invocation, settings = invocations[-1] if invocations else None, HydraConfig.get()
    folder, words = Path(settings.runtime.output_dir), list(settings.overrides.task)
    if settings.mode == RunMode.MULTIRUN:
        if invocation is None:
            _prepare_worker()
        return _run_of_sweep(config, folder, words, invocation)
    if invocation is None or invocation.job is None:  # called by another program, or without our callback
        return runs.run_or_resume(checked_job(config, settings, folder), words)
    try:
        invocation.code = runs.run_new(replace(invocation.job, folder=folder), invocation.command)
    except Exception as error:  # noqa: BLE001 - raised by `run_application`, or kept
        invocation.code, invocation.error = endings.FAULT, error
    return invocation.code


#: `run_task` itself stays importable by its name, by which launchers send it to other processes
application = hydra.main(*COMPOSED_FROM)(run_task)


def _run_of_sweep(config: DictConfig, folder: Path, words: list[str], invocation: Invocation | None) -> int:
    """Start or resume a run of a sweep, and record in its folder how it ended; return the exit code."""
    settings = HydraConfig.get()
    command = recorded_command(Path(settings.sweep.dir), folder) or words
    try:
        if RESUMED in config:
            overrides = [override for override in parse(words) if override.key_or_group != RESUMED]
            ending = sweep.Ending(runs.resume(folder, overrides, command))
        else:
            ending = sweep.Ending(runs.run_or_resume(checked_job(config, settings, folder), command))
    except Exception as error:
        if invocation is not None and invocation.shows_tracebacks:
            raise
        ending = sweep.Ending(endings.MISTAKE, endings.error_sentence(error))
        if isinstance(error, endings.MISTAKES):
            sys.stderr.write(endings.error_text(error))
        else:
            traceback.print_exc()
            ending = sweep.Ending(endings.FAULT, f"a fault of the program: {type(error).__name__}: {error}")
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


def shows_tracebacks() -> bool:
    """Return whether the user wants tracebacks of user errors; while Hydra runs, the variable is ours."""
    return invocations[-1].shows_tracebacks if invocations else os.environ.get(FULL_ERROR) == "1"


def run_application(words: Sequence[str], command: Sequence[str]) -> int:
    """Run the application on a checked command line; return the exit code.

    Parameters
    ----------
    words : sequence of str
        Hydra's options, and overrides.
    command : sequence of str
        The arguments with which a run is started, as its manifest keeps them.

    Raises
    ------
    ValueError, OSError, MemoryError
        User errors.
    Interrupted
    """
    literal(Path.cwd())
    invocation = Invocation(command, shows_tracebacks())
    with hydra_apart(), _process_of(invocation, words), invocation.locks:
        _call(invocation)
        return invocation.sweep.end() if invocation.sweep else invocation.code


def _call(invocation: Invocation) -> None:
    """Call the application; raise its errors in our words."""
    try:
        with errors_in_words(), interrupts.heeded(), composing_once():
            application()
    except Refused as refused:
        raise refused.args[0] from None
    except SystemExit as end:  # Hydra has printed what was asked for, or with 1 why it could not
        if end.code not in (None, 0, 1):
            raise
        invocation.code = endings.MISTAKE if end.code else endings.OK
    except KeyboardInterrupt as interrupt:
        if invocation.sweep is None:
            raise
        left = len(unfinished(invocation.sweep.folder))
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
def _process_of(invocation: Invocation, words: Sequence[str]) -> Iterator[None]:
    """Give Hydra a process of an invocation, in which it raises errors; restore what it changes there."""
    arguments, full, root = sys.argv, os.environ.get(FULL_ERROR), logging.getLogger()
    level, handlers = root.level, list(root.handlers)
    sys.argv, os.environ[FULL_ERROR] = [*arguments[:1], *words], "1"
    invocations.append(invocation)
    try:
        yield
    finally:
        invocations.pop()
        sys.argv, root.handlers = arguments, handlers
        root.setLevel(level)
        os.environ.pop(FULL_ERROR)
        os.environ.update({FULL_ERROR: full} if full is not None else {})
