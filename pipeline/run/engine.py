"""Who does the parts of a campaign, or the islands of a training: this process, or others.

A part's result hangs on nothing but its arguments, so that it is the same whoever does it, and however often
it has to be begun again.
"""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

from pipeline.settings.experiment import Engine

#: does all parts, in any order: a function at module level, its arguments -> place of a part, and its result
Each = Callable[[Callable[..., Any], Sequence[tuple[Any, ...]]], Iterator[tuple[int, Any]]]


class EngineMissingError(ValueError):
    """An engine whose package is not installed."""


@contextmanager
def crew(engine: Engine) -> Iterator[Each]:
    """Have whoever does parts, for as long as there are some.

    Raises
    ------
    EngineMissingError
        If Dask is not installed.
    pipeline.run.processes.EngineError
        If it cannot be reached, or goes away.
    """
    if engine.kind == "local":
        yield _here
        return
    try:
        from pipeline.run.processes import joined  # noqa: PLC0415 - an extra
    except ModuleNotFoundError as error:
        raise EngineMissingError(
            "engine=dask needs Dask; install the extra: pip install 'fuzzy-spacecraft-inspection[dask]'"
        ) from error
    with joined(engine) as processes:
        yield processes.each


def each(
    engine: Engine, do: Callable[..., Any], parts: Sequence[tuple[Any, ...]]
) -> Iterator[tuple[int, Any]]:
    """Do all parts, in any order, by a crew of their own.

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
        Place of a part, and what came of it.

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
