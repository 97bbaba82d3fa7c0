"""Who does the parts of a campaign: this process, or processes that Dask looks after.

A part's result hangs on nothing but its arguments, so that it is the same whoever does it, and however often
it has to be begun again. Dask's peers exchange pickles: only those of this machine are joined.
"""

import json
import logging
import os
import tempfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from functools import partial
from pathlib import Path
from typing import Any, Final
from urllib.parse import urlsplit

from pipeline.settings.experiment import Engine

#: of a process, how often its part is begun again before it is blamed for the end of its processes
MOST_DEATHS: Final = 1000
#: parts that are under way or wait, a process; it bounds what is kept in memory
AHEAD: Final = 3
#: does all parts, in any order: a function at module level, its arguments -> place of a part, and its result
Each = Callable[[Callable[..., Any], Sequence[tuple[Any, ...]]], Iterator[tuple[int, Any]]]
LOOPBACK: Final = ("127.0.0.1", "localhost", "::1")


class EngineError(ValueError):
    """An engine that cannot be had, or has gone; what was done stays done."""


@contextmanager
def crew(engine: Engine) -> Iterator[Each]:
    """Have whoever does parts, for as long as there are some.

    Raises
    ------
    EngineError
        If Dask is not installed, cannot be reached, or goes away.
    """
    if engine.kind == "local":
        yield _here
        return
    try:
        import distributed  # noqa: F401, PLC0415 - an extra
    except ModuleNotFoundError as error:
        raise EngineError(
            "engine=dask needs Dask; install the extra: pip install 'fuzzy-spacecraft-inspection[dask]'"
        ) from error
    with _client(engine) as client:
        yield partial(_by_dask, client)


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
    EngineError
        As `crew`.
    """
    with crew(engine) as do_all:
        yield from do_all(do, parts)


def _here(do: Callable[..., Any], parts: Sequence[tuple[Any, ...]]) -> Iterator[tuple[int, Any]]:
    for place, arguments in enumerate(parts):
        yield place, do(*arguments)


def _by_dask(
    client: Any, do: Callable[..., Any], parts: Sequence[tuple[Any, ...]]
) -> Iterator[tuple[int, Any]]:
    from distributed import CancelledError, KilledWorker, as_completed  # noqa: PLC0415 - as above

    left = iter(enumerate(parts))
    ahead = AHEAD * max(1, len(client.scheduler_info(n_workers=-1)["workers"]))
    places: dict[str, int] = {}

    def submit() -> Any:
        for place, arguments in left:
            future = client.submit(do, *arguments, pure=False)
            places[future.key] = place
            return future
        return None

    running = as_completed(future for _ in range(ahead) if (future := submit()) is not None)
    try:
        for future in running:
            result = future.result()
            future.release()
            yield places.pop(future.key), result
            if (another := submit()) is not None:
                running.add(another)
    except (OSError, CancelledError, KilledWorker) as error:
        raise EngineError(
            f"Dask's scheduler or its processes are gone ({type(error).__name__}); what was done until then "
            "is kept: go on with resume="
        ) from error


@contextmanager
def _client(engine: Engine) -> Iterator[Any]:
    """Start processes on this machine, or join the scheduler that is given."""
    import dask  # noqa: PLC0415 - as above
    from distributed import Client  # noqa: PLC0415 - as above

    for name in ("distributed", "distributed.client", "asyncio"):  # what matters is told as an error
        logging.getLogger(name).setLevel(logging.CRITICAL + 1)
    with dask.config.set({"distributed.scheduler.allowed-failures": MOST_DEATHS}), ExitStack() as stack:
        if engine.scheduler:
            yield stack.enter_context(_joined(address_of(engine.scheduler)))
            return
        scratch = stack.enter_context(tempfile.TemporaryDirectory())
        yield stack.enter_context(Client(stack.enter_context(_processes(engine, scratch))))


def _joined(address: str) -> Any:
    """Join a scheduler."""
    from distributed import Client  # noqa: PLC0415 - as above

    try:
        return Client(address, timeout=20)
    except OSError as error:
        raise EngineError(f"there is no Dask scheduler at {address} ({error}); start it") from error


def _processes(engine: Engine, scratch: str) -> Any:
    """Start processes of one thread each on this machine."""
    from distributed import LocalCluster  # noqa: PLC0415 - as above

    try:
        return LocalCluster(
            n_workers=engine.processes or os.cpu_count() or 1,
            threads_per_worker=1,
            host=LOOPBACK[0],
            dashboard_address=None,
            local_directory=scratch,
            silence_logs=50,
            memory_limit=0,
        )
    except (RuntimeError, OSError) as error:
        raise EngineError(f"Dask could not start its processes ({error}); resume= begins again") from error


def address_of(scheduler: str) -> str:
    """Return the address of a scheduler, given itself or as its file.

    Raises
    ------
    EngineError
        If the file cannot be read, or the scheduler is on another machine.
    """
    address = scheduler
    if "://" not in scheduler and Path(scheduler).suffix == ".json":
        try:
            address = str(json.loads(Path(scheduler).read_text(encoding="utf-8"))["address"])
        except (OSError, ValueError, KeyError, TypeError) as error:
            raise EngineError(
                f"{scheduler} is no file of a Dask scheduler ({error}); it is what "
                "dask scheduler --scheduler-file writes"
            ) from error
    parsed = urlsplit(address if "://" in address else f"tcp://{address}")
    if parsed.hostname not in LOOPBACK:
        raise EngineError(
            f"engine.scheduler is {address}; its peers exchange pickles, so only one on this machine is "
            f"joined: start it with --host {LOOPBACK[0]}"
        )
    return parsed.geturl()
