"""A shorter start: a second process composes the configuration while this one loads what flights need.

Importing Hydra and composing takes as long as importing numba and loading compiled code. Nothing large is
imported here before the second process has started.
"""

import os
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager

from pipeline.run.second import second_process

#: starts a new run and returns the exit code; a message if it cannot be composed; None for any other command
Begin = Callable[[], int] | str | None


@contextmanager
def planning(arguments: Sequence[str]) -> Iterator[Callable[[], Begin]]:
    """Compose a new run in a second process; yield a function that waits for the result, see `Begin`."""
    is_plain = all("=" in word and word[0] not in "-~" for word in arguments)
    if not is_plain or not any(word.startswith("+experiment=") for word in arguments):
        yield lambda: None
        return
    with second_process("pipeline.command_line.experiments") as share:
        finish = share(_plan, [(arguments,)])

        def planned() -> Begin:
            _load()
            begin: Begin = finish()[0]
            return begin

        yield planned


def _plan(arguments: Sequence[str]) -> Begin:
    """Compose a new run."""
    from pipeline.command_line.arguments import read_arguments  # noqa: PLC0415 - Hydra, in the second process
    from pipeline.command_line.experiments import plan  # noqa: PLC0415 - the same
    from pipeline.command_line.runs import sentence, start_new  # noqa: PLC0415 - the same

    try:
        begin = plan(read_arguments(arguments))
    except (ValueError, OSError, MemoryError) as error:
        return None if os.environ.get("HYDRA_FULL_ERROR") == "1" else sentence(error)
    return begin if getattr(begin, "func", None) is start_new else None


def _load() -> None:
    """Load what nearly all runs need in the end."""
    import numpy as np  # noqa: PLC0415 - takes a while, as all here

    import pipeline.controllers.source  # noqa: PLC0415
    import pipeline.stages.record  # noqa: F401, PLC0415
    from pipeline.physics.quaternion import dcm_b_from_h  # noqa: PLC0415
    from pipeline.run import maker  # noqa: PLC0415

    dcm_b_from_h(np.array([0.0, 0.0, 0.0, 1.0]))  # the first call makes numba ready for all others
    maker.product()  # for the manifest
