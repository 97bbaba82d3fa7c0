"""Tasks done by the workers of Dask, which may join, leave, be killed and be of another program at any time.

Dask's own configuration says which scheduler is joined and with which certificate; no key of ours does, so
that no run's folder can lead anywhere. Without a scheduler a cluster of this machine is started, whose
connections are encrypted with keys made for it alone.
"""

import logging
import signal
import sys
import time
from collections import deque
from collections.abc import Callable, Generator, Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, CancelledError, Future, wait
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from typing import Any, Final

from pipeline.run import certificate, maker
from pipeline.settings.checks import SettingError

#: tasks submitted for each worker: others wait, so that memory does not grow with their number
SUBMITTED_PER_WORKER: Final = 3
#: workers that may die with a task before the task is blamed
MOST_DEATHS: Final = 1000
#: between two looks at which workers there are, s
LOOK_EVERY_S: Final = 1.0
#: without a worker, until that is told, and until it is told again, s
PATIENCE_S, REMINDED_S = 10.0, 600.0
#: what Dask would log on the terminal, where its faults become our errors
LOGGERS: Final = ("distributed", "distributed.client", "tornado", "tornado.application", "asyncio")

KEPT: Final = (
    "what is done is kept: go on with resume=, with engine.kind=local to do the rest on this machine alone"
)
LOST: Final = f"the scheduler or the workers of Dask were lost ({{}}); {KEPT}"
DIFFERS: Final = "the worker {} differs from this process ({}), so that results would mix two programs"
CURE: Final = "start the workers from this environment"


class EngineError(OSError):
    """Why Dask cannot do the tasks, or can no longer."""


@dataclass
class _Submitted:
    """A task that was given to the scheduler, for some workers only or, without any, for all."""

    index: int
    workers: frozenset[str]


class Workers:
    """The workers of a scheduler: who is there, and who is refused.

    Parameters
    ----------
    client : distributed.Client
    """

    def __init__(self, client: Any) -> None:
        self._client = client
        self._threads: Mapping[str, int] = {}
        self._refused: set[str] = set()
        self._seen, self._reminded = time.monotonic(), 0.0
        self.asker = maker.present_maker()

    def look(self) -> None:
        """Ask the scheduler who is there; what was refused and is gone may come back as another."""
        try:
            self._threads = self._client.nthreads()
        except (OSError, RuntimeError) as error:
            raise EngineError(LOST.format(type(error).__name__)) from error
        self._refused &= set(self._threads)
        if self.fit:
            self._seen, self._reminded = time.monotonic(), 0.0

    @property
    def fit(self) -> frozenset[str]:
        """The addresses of those that are there and not refused."""
        return frozenset(self._threads) - self._refused

    @property
    def chosen(self) -> frozenset[str]:
        """Those to which tasks are restricted: none where nobody is refused, so that Dask chooses."""
        return self.fit if self._refused else frozenset()

    @property
    def num_free(self) -> int:
        """How many tasks to have submitted: some even before the first worker, which may start for them."""
        threads = sum(self._threads[worker] for worker in self.fit)
        return SUBMITTED_PER_WORKER * (threads if self._refused else max(1, threads))

    def unfit(self) -> dict[str, str]:
        """Ask all who they are; return why some do not fit: they cannot say it, or are of another program."""
        reasons = {}
        for worker, answer in self._client.run(maker.present_maker, on_error="return").items():
            if isinstance(answer, Exception):
                reasons[worker] = f"it lacks this program, {_first_line(answer)}"
            elif differences := maker.unfit(self.asker, answer):
                reasons[worker] = ", ".join(differences)
        return reasons

    def refuse(self, worker: str, why: str) -> None:
        """Give a worker no more tasks, and say so once."""
        if worker not in self._refused:
            self._refused.add(worker)
            sys.stderr.write(f"note: {DIFFERS.format(worker, why)}: its tasks are done elsewhere; {CURE}\n")

    def check_door(self) -> None:
        """Raise EngineError if there are workers, and all of them are refused."""
        self.look()
        reasons = self.unfit()
        if self._threads and reasons.keys() >= self._threads.keys():
            worker, why = next(iter(reasons.items()))
            others = f", and {len(reasons) - 1} more do" if len(reasons) > 1 else ""
            raise EngineError(f"{DIFFERS.format(worker, why)}{others}; {CURE}")
        for worker, why in reasons.items():
            self.refuse(worker, why)

    def remind(self, num_waiting: int) -> None:
        """Tell that tasks wait for a worker, after a while and then now and then."""
        now = time.monotonic()
        if self.fit or now < max(self._seen + PATIENCE_S, self._reminded):
            return
        self._reminded = now + REMINDED_S
        address = self._client.scheduler.address
        there = f"{len(self._refused)} refused and no other" if self._refused else "none"
        sys.stderr.write(
            f"  {num_waiting} tasks wait for a worker of {address}, which has {there}; start some from this "
            f"environment, dask worker {address}, or interrupt this command: {KEPT}\n"
        )
        sys.stderr.flush()


def _first_line(error: BaseException) -> str:
    return f"{type(error).__name__}: {error}".splitlines()[0]


def run_on(
    client: Any, workers: Workers, function: Callable[..., Any], tasks: Sequence[tuple[Any, ...]]
) -> Generator[tuple[int, Any], None, None]:
    """Call a function with the arguments of each task; yield index and result of each as it ends.

    A result counts if what made it fits this process; what is declined, damaged or lost with its workers is
    done again by others.
    """
    from distributed import KilledWorker  # noqa: PLC0415 - an extra, loaded where the client was opened

    waiting, deaths = deque(range(len(tasks))), dict.fromkeys(range(len(tasks)), 0)
    running: dict[Future[Any], _Submitted] = {}
    try:
        while waiting or running:
            workers.look()
            _give_up_on_lost(running, waiting, workers)
            executor = client.get_executor(pure=False, workers=sorted(workers.chosen) or None)
            while waiting and len(running) < workers.num_free:
                index = waiting.popleft()
                packed = certificate.packed_task(function, tasks[index])
                future = executor.submit(_carry_out, workers.asker, packed)
                running[future] = _Submitted(index, workers.chosen)
            if not running:
                time.sleep(LOOK_EVERY_S)
            workers.remind(len(waiting) + len(running))
            for future in wait(running, LOOK_EVERY_S, FIRST_COMPLETED).done:
                index = running.pop(future).index
                try:
                    certified = future.result()
                except KilledWorker as error:
                    deaths[index] += error.allowed_failures + 1
                    _check_deaths(deaths[index], error)
                    certified = None
                except CancelledError as error:
                    raise EngineError(LOST.format(type(error).__name__)) from error
                except Exception as error:  # noqa: BLE001 - whatever Dask makes of a worker without sources
                    _find_unfit(workers, error)
                    certified = None
                if certified is None or not _accepted(certified, workers):
                    waiting.append(index)
                    continue
                maker.collect(certified.maker)
                yield index, certified.result()
    finally:
        for future in running:
            future.cancel()


def _give_up_on_lost(running: dict[Future[Any], _Submitted], waiting: deque[int], workers: Workers) -> None:
    """Take back the tasks whose workers are all gone: the scheduler would keep them for these."""
    for future, submitted in list(running.items()):
        if submitted.workers and not submitted.workers & workers.fit and not future.done():
            del running[future]
            future.cancel()
            waiting.append(submitted.index)


def _check_deaths(number: int, error: Any) -> None:
    """Tell that workers died with a task, which is done again; raise EngineError if too many did."""
    if number > MOST_DEATHS:
        raise EngineError(
            f"{number} workers died with the same task, the last at {error.last_worker.address}; see whether "
            f"they have memory enough; {KEPT}"
        ) from error
    sys.stderr.write(
        f"note: {number} workers died with a task, last {error.last_worker.address}; it is done again\n"
    )


def _find_unfit(workers: Workers, error: Exception) -> None:
    """Refuse the workers that could not even read a task; raise EngineError if all of them can."""
    before = workers.fit
    workers.look()
    for worker, why in workers.unfit().items():
        workers.refuse(worker, why)
    if workers.fit >= before:
        raise EngineError(
            f"Dask cannot do the tasks ({_first_line(error)}); start the scheduler, too, from this "
            f"environment; {KEPT}"
        ) from error


def _accepted(certified: certificate.Certified, workers: Workers) -> bool:
    """Return whether a result counts; refuse its maker if it is of another program."""
    if differences := maker.unfit(workers.asker, certified.maker):
        workers.refuse(certified.worker, ", ".join(differences))
        return False
    if not certified.is_whole:
        sys.stderr.write(f"note: a result of the worker {certified.worker} came damaged; it is done again\n")
        return False
    return True


def _carry_out(asker: Mapping[str, Any], packed: bytes) -> certificate.Certified:
    """Carry out a task on a worker of Dask."""
    from distributed import get_worker  # noqa: PLC0415 - as above

    return certificate.carry_out(asker, packed, get_worker().address)


def load_dask() -> tuple[Any, Any]:
    """Return the modules `dask` and `distributed`, whose messages are left to ours.

    Raises
    ------
    SettingError
        If they are not installed.
    """
    try:
        import cryptography  # noqa: F401, PLC0415 - what Dask encrypts with
        import dask  # noqa: PLC0415

        with dask.config.set({"logging": dict.fromkeys(LOGGERS, "critical")}):
            import distributed  # noqa: PLC0415
    except ModuleNotFoundError as error:
        raise SettingError(
            f"engine.kind is dask, which needs the package {error.name}; install it: python -m pip install "
            "distributed cryptography, or choose engine.kind=local"
        ) from error
    return dask, distributed


@contextmanager
def open_client(num_workers: int) -> Iterator[Any]:
    """Join the scheduler that Dask's configuration names, or start a cluster of this machine.

    Raises
    ------
    SettingError
        If Dask is not installed.
    EngineError
        If its scheduler does not answer, or Dask's own configuration leads nowhere.
    """
    dask, distributed = load_dask()
    address = dask.config.get("scheduler-address", None)
    with ExitStack() as stack:
        # a task is not to blame for workers that are killed
        stack.enter_context(dask.config.set({"distributed.scheduler.allowed-failures": MOST_DEATHS}))
        # a scheduler of ours answers no page
        stack.enter_context(dask.config.set({"distributed.scheduler.http.routes": []}))
        try:
            if address is None:
                cluster = stack.enter_context(_local_cluster(distributed, num_workers))
                client = _client(distributed, cluster)
            else:
                client = _client(distributed, address)
        except (OSError, TypeError, ValueError, RuntimeError) as error:
            raise EngineError(_no_client(address, error)) from error
        yield stack.enter_context(client)


def _client(distributed: Any, where: Any) -> Any:
    """Return a client of a scheduler or a cluster; of one that cannot connect nothing is left.

    Dask would close it when it is found as garbage. Where that happens while another client starts, in the
    same thread, the thread waits for ever for a lock that it holds itself.
    """

    class Client(distributed.Client):  # type: ignore[misc]  # known only where it is loaded
        def __init__(self, *given: Any, **named: Any) -> None:
            try:
                super().__init__(*given, **named)
            except BaseException:
                with suppress(Exception):  # the first error is the one to tell
                    self.close()
                    # where connecting failed it counts as closed, but its thread still runs
                    self._loop_runner.stop()
                raise

    return Client(where, set_as_default=False)


def _no_client(address: str | None, error: Exception) -> str:
    """Return in words why there is no client, and what to do."""
    is_of_tls = any(word in _first_line(error).lower() for word in ("ssl", "certificate"))
    if is_of_tls or isinstance(error, TypeError | ValueError | FileNotFoundError):
        return (
            f"Dask's configuration does not lead to a scheduler at {address} ({_first_line(error)}); for "
            "tls:// give the files of the scheduler's certificate under distributed.comm.tls in Dask's own "
            "configuration, or choose engine.kind=local"
        )
    return (
        f"no scheduler of Dask answers at {address} ({error}); start it, or correct DASK_SCHEDULER_ADDRESS, "
        "or choose engine.kind=local"
    )


def _local_cluster(distributed: Any, num_workers: int) -> Any:
    """Start workers on this machine, a process each, which no other user can reach."""
    return distributed.LocalCluster(
        n_workers=num_workers,
        threads_per_worker=1,
        processes=True,
        memory_limit=None,
        # its pages are left out, but not the port that they would have
        dashboard_address="127.0.0.1:0",
        scheduler_kwargs={"dashboard": False},
        silence_logs=logging.CRITICAL,
        security=distributed.Security.temporary(),
        preload=[__name__],
    )


def dask_setup(_: object) -> None:
    """Leave interrupts to the process that started this worker; Dask calls it as the worker begins."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
