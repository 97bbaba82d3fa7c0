"""Interrupts from the keyboard that a library loses: remembered, and raised again after the work they end.

OmegaConf, Hydra and code in C catch every exception at some places, and with it the KeyboardInterrupt that
Python raises there.
"""

import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any

_came: list[int] = []


def remember() -> None:
    """Remember every interrupt of this process from now on, unless it ignores interrupts.

    For a process that is the program's own, or a launcher's worker: it keeps the handler and the hook to its
    end, as only they are told of exceptions in finalizers, which may come last. `main` called from a script
    or a notebook replaces neither.
    """
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, _raise)
        sys.unraisablehook = _print_unraisable


def _print_unraisable(unraisable: Any) -> None:
    """Print an exception that could not be raised, unless an interrupt came, which is remembered.

    Objects that it left half made fail in their finalizers.
    """
    if not _came:
        sys.__unraisablehook__(unraisable)


def _raise(number: int, frame: FrameType | None) -> None:
    _came.append(number)
    signal.default_int_handler(number, frame)


@contextmanager
def heeded() -> Iterator[None]:
    """Run a block; raise KeyboardInterrupt at its end if an interrupt was lost, or became another error."""
    try:
        yield
    except Exception as error:
        if _came:
            raise KeyboardInterrupt from error
        raise
    if _came:
        raise KeyboardInterrupt
