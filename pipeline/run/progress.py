"""Shows the progress of a long step: a bar on a terminal, a line every few seconds elsewhere."""

import math
import sys
import time
from typing import Self

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeElapsedColumn, TimeRemainingColumn
from rich.progress import Progress as Bar

SECONDS_BETWEEN_LINES = 5.0


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
        console = Console(stderr=True)
        self._bar = Bar(
            TextColumn("  {task.description}"),
            BarColumn(bar_width=24),
            MofNCompleteColumn(),
            TimeElapsedColumn(),
            TextColumn("left"),
            TimeRemainingColumn(elapsed_when_finished=False),
            console=console,
            disable=not console.is_terminal,
        )
        self._task = self._bar.add_task(what, total=total, completed=done or 0)

    def __enter__(self) -> Self:
        """Start drawing."""
        self._bar.start()
        return self

    def __exit__(self, *_: object) -> None:
        """Stop drawing."""
        self._bar.stop()

    def show(self, done: int, text: str = "") -> None:
        """Show how many are done, with a text about the last."""
        if not self._bar.disable:
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
