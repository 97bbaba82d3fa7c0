"""A spinner with words and seconds on one terminal line while something runs."""

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from typing import Any


@contextmanager
def waiting(words: str) -> Iterator[Callable[[str], None]]:
    """Show words and seconds on standard error until the block ends; yield a function that sets the words."""
    if sys.stderr is None or not sys.stderr.isatty():
        yield lambda words: None
        return
    shown = _spinners()
    task = shown.add_task(words, total=None)
    shown.start()
    try:
        yield lambda words: shown.update(task, description=words)
    finally:
        if shown.task_ids == [task]:
            shown.stop()
        shown.remove_task(task)


@cache
def _spinners() -> Any:
    """Return the process's only spinner display."""
    from rich.console import Console  # noqa: PLC0415 - takes long to import, and is seldom needed
    from rich.progress import Progress, SpinnerColumn, TextColumn, TimeElapsedColumn  # noqa: PLC0415

    columns = (SpinnerColumn(), TextColumn("{task.description}"), TimeElapsedColumn())
    console = Console(stderr=True)
    return Progress(*columns, console=console, transient=True, redirect_stdout=False, redirect_stderr=False)
