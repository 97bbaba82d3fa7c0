"""Runs the parts of a campaign, or the islands of a training, in this process or in others.

A part's result depends only on its arguments, so that it is the same wherever it runs, and however often
it must be restarted.
"""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

from pipeline.settings.experiment import Engine

#: runs all parts, in any order: a function at module level, its arguments -> index of a part, and its result
Each = Callable[[Callable[..., Any], Sequence[tuple[Any, ...]]], Iterator[tuple[int, Any]]]


class EngineMissingError(ValueError):
    """An engine whose package is not installed."""


@contextmanager
def crew(engine: Engine) -> Iterator[Each]:
    """Yield the function that runs parts, and release its processes afterwards.

    Raises
    ------
    EngineMissingError
        If Dask is not installed.
    pipeline.run.processes.EngineError
        If Dask's scheduler cannot be reached, or disappears.
    """
    if engine.kind == "local":
        yield _here
        return
    try:
        from pipeline.run.processes import joined  # noqa: PLC0415 - an extra
    except ModuleNotFoundError as error:
        raise EngineMissingError(
            "engine=dask needs Dask; install it: python -m pip install distributed cryptography"
        ) from error
    with joined(engine) as processes:
        yield processes.each


def each(
    engine: Engine, do: Callable[..., Any], parts: Sequence[tuple[Any, ...]]
) -> Iterator[tuple[int, Any]]:
    """Run all parts, in any order, with their own processes.

    Parameters
    ----------
    engine : Engine
    do : callable
        At module level.
    parts : sequence of tuple
        Its arguments, plain data.

    Yields
    ------
    (int, result)
        Index of a part, and its result.

    Raises
    ------
    EngineMissingError, pipeline.run.processes.EngineError
        As `crew`.
    """
    with crew(engine) as do_all:
        yield from do_all(do, parts)


def _here(do: Callable[..., Any], parts: Sequence[tuple[Any, ...]]) -> Iterator[tuple[int, Any]]:
    for place, arguments in enumerate(parts):
        yield place, do(*arguments)
