"""Shows the progress of a long step: a bar on a terminal, a line every few seconds elsewhere."""

import math
import os
import sys
import time
from typing import Any, Self

SECONDS_BETWEEN_LINES = 5.0
#: by which rich may take a stream for a terminal although it is none
FORCED = ("FORCE_COLOR", "TTY_COMPATIBLE")


class Progress:
    """Progress and time left, on standard error.

    Parameters
    ----------
    what : str
        What is counted, such as ``generation``.
    total : int
    done : int, optional
        Number done before, for the bar. Lines count the time from what is shown first on: before, code is
        compiled.
    """

    def __init__(self, what: str, total: int, done: int | None = None) -> None:
        self._what, self._total, self._last_line = what, total, -math.inf
        self._first: tuple[float, int] | None = None
        self._bar = _bar()
        if self._bar:
            self._task = self._bar.add_task(what, total=total, completed=done or 0)

    def __enter__(self) -> Self:
        """Start drawing."""
        if self._bar:
            self._bar.start()
        return self

    def __exit__(self, *_: object) -> None:
        """Stop drawing."""
        if self._bar:
            self._bar.stop()

    def show(self, done: int, text: str = "") -> None:
        """Show how many are done, with a text about the last."""
        if self._bar:
            self._bar.update(self._task, completed=done, description=text or self._what)
            return
        now = time.perf_counter()
        self._first = self._first or (now, done)
        if now - self._last_line >= SECONDS_BETWEEN_LINES or done == self._total:
            self._last_line = now
            line = ", ".join(
                filter(None, (f"  {self._what} {done}/{self._total}", text, self._left(now, done)))
            )
            sys.stderr.write(f"{line}\n")
            sys.stderr.flush()

    def _left(self, now: float, done: int) -> str:
        """Return the time left in words; nothing before two are known."""
        assert self._first is not None  # noqa: S101 - as something is shown
        started, first = self._first
        if done == first and done < self._total:
            return ""
        return f"{(now - started) / max(1, done - first) * (self._total - done):.0f} s left"


def _bar() -> Any:
    """Return a bar without tasks; None where there is no terminal."""
    if not (sys.stderr.isatty() or any(os.environ.get(name) for name in FORCED)):
        return None
    from rich import progress  # noqa: PLC0415 - takes long to import, and serves terminals alone
    from rich.console import Console  # noqa: PLC0415

    console = Console(stderr=True)
    columns = (
        progress.TextColumn("  {task.description}"),
        progress.BarColumn(bar_width=24),
        progress.MofNCompleteColumn(),
        progress.TimeElapsedColumn(),
        progress.TextColumn("left"),
        progress.TimeRemainingColumn(elapsed_when_finished=False),
    )
    return progress.Progress(*columns, console=console) if console.is_terminal else None
