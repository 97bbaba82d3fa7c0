"""Work shared among threads."""

from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from typing import Any, TypeVar

from fis_tools.processors import num_processors

Result = TypeVar("Result")


def in_threads(function: Callable[..., Result], *items: Iterable[Any], workers: int | None) -> list[Result]:
    """Return a function's results for some items, as `map` does, on threads, one per processor unless given.

    If one fails, those that have not begun are left out.
    """
    workers = workers or num_processors()
    if workers == 1:
        return list(map(function, *items))
    pool = ThreadPoolExecutor(workers)
    try:
        return list(pool.map(function, *items))
    finally:
        pool.shutdown(cancel_futures=True)
