"""Interrupts of a process: from the keyboard, and by the signals with which systems end it.

All raise KeyboardInterrupt, so that a run says what it kept and how to go on. Those that a library loses are
remembered, and raised again after the work they end: OmegaConf, Hydra and code in C catch every exception at
some places, and with it the KeyboardInterrupt that Python raises there.
"""

import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any, Final

#: besides SIGINT, with the reason of whoever sends it: a scheduler or a user stops the process, a limit of
#: processor time is near, the time of a job is nearly over, the terminal is closed
SIGNALS: Final = ("SIGTERM", "SIGXCPU", "SIGUSR1", "SIGHUP")

_came: list[int] = []


def remember(*also: str) -> None:
    """Remember every interrupt of this process from now on, but none by a signal that it ignores or handles.

    For a process that is the program's own, or a launcher's worker: it keeps the handler and the hook to its
    end, as only they are told of exceptions in finalizers, which may come last. `main` called from a script
    or a notebook replaces neither. What a shell starts in the background ignores the keyboard, and heeds the
    other signals all the same.

    Parameters
    ----------
    *also : str
        Signals besides SIGINT, see `SIGNALS`; launchers end their workers by some of them.
    """
    keyboard = signal.getsignal(signal.SIGINT)
    if keyboard is signal.default_int_handler:
        signal.signal(signal.SIGINT, _raise)
    if keyboard in (signal.default_int_handler, signal.SIG_IGN):
        sys.unraisablehook = _print_unraisable
        for name in also:  # not all systems have all
            number = getattr(signal, name, None)
            if number is not None and signal.getsignal(number) is signal.SIG_DFL:
                signal.signal(number, _raise)


def exit_code() -> int:
    """Return the exit code of a process that was interrupted: as shells tell it, 130 from the keyboard."""
    return 128 + (_came[-1] if _came else signal.SIGINT)


def in_words() -> str:
    """Return by what signal this process was interrupted; empty for the keyboard's."""
    is_signal = bool(_came) and _came[-1] != signal.SIGINT
    return f" by {signal.Signals(_came[-1]).name}" if is_signal else ""


def _print_unraisable(unraisable: Any) -> None:
    """Print an exception that could not be raised, unless an interrupt came, which is remembered.

    Objects that it left half made fail in their finalizers.
    """
    if not _came:
        sys.__unraisablehook__(unraisable)


def _raise(number: int, _frame: FrameType | None) -> None:
    _came.append(number)
    raise KeyboardInterrupt


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
