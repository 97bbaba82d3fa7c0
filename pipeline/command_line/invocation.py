"""The present command, as the parts of the application that Hydra calls know of it."""

import os
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from pipeline.command_line.config import Job
    from pipeline.command_line.sweeps import Sweep

#: of Hydra: "1" where it raises errors, instead of printing them and ending the process
FULL_ERROR: Final = "HYDRA_FULL_ERROR"


@dataclass
class Invocation:
    """The state of a command in the process that runs it.

    Parameters
    ----------
    command : sequence of str
        The arguments with which a run is started.
    resumes : bool
        Whether a sweep goes on.
    shows_tracebacks : bool
        Whether user errors are raised, too.
    job : Job, optional
        The run, checked; None in a sweep.
    sweep : Sweep, optional
    code : int
        The exit code of the run.
    error : Exception, optional
        What the run failed with.
    locks : ExitStack
        On the run's folder, or the sweep's, until the command ends.
    """

    command: Sequence[str]
    resumes: bool = False
    shows_tracebacks: bool = False
    job: "Job | None" = None
    sweep: "Sweep | None" = None
    code: int = 0
    error: Exception | None = None
    locks: ExitStack = field(default_factory=ExitStack)


#: the last is the present command: a stage may run others; launchers run jobs where there is none
invocations: list[Invocation] = []


def shows_tracebacks() -> bool:
    """Return whether the user wants tracebacks of user errors; while Hydra runs, the variable is ours."""
    return invocations[-1].shows_tracebacks if invocations else os.environ.get(FULL_ERROR) == "1"
