"""Where the tasks of a stage are done: by this process, or by the workers of Dask.

A task is a function at the top of a module with its arguments. Its result depends on nothing else, so that it
is the same wherever the task runs and however often it has to be started again.

Dask's own configuration says which scheduler is joined and with which certificate; no key of ours does, so
that no run's folder can lead anywhere. Without a scheduler a cluster of this machine is started, whose
connections are encrypted with keys made for it alone.
"""

import logging
import signal
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, CancelledError, Executor, Future, ThreadPoolExecutor, wait
from contextlib import ExitStack, contextmanager
from typing import Any, Final

from fis_tools.processors import num_processors
from pipeline.run import maker
from pipeline.settings.experiment import Engine, SettingError

#: tasks submitted for each worker: others wait, so that memory does not grow with their number
SUBMITTED_PER_WORKER: Final = 3
#: workers that may die with a task before Dask blames the task
MOST_DEATHS: Final = 1000
#: what Dask would log on the terminal, where its faults become our errors
LOGGERS: Final = ("distributed", "distributed.client", "tornado", "tornado.application", "asyncio")

LOST: Final = (
    "the scheduler or the workers of Dask were lost ({}); what is done is kept: go on with resume=, with "
    "engine.kind=local to do the rest here"
)


class EngineError(OSError):
    """Why Dask cannot do the tasks, or can no longer."""


class TaskPool:
    """Does tasks: one after the other, on threads, or on the workers of Dask.

    Parameters
    ----------
    executor : Executor, optional
        None to do tasks in the calling thread.
    count_workers : callable
        Returns how many tasks run at a time; their number may change.
    is_local : bool
        Whether tasks run in this process.
    """

    def __init__(
        self, executor: Executor | None, count_workers: Callable[[], int], *, is_local: bool = True
    ) -> None:
        self._executor, self._count_workers, self.is_local = executor, count_workers, is_local

    def threads(self, workers: int | None) -> int | None:
        """Return how many threads a task may use: as many as are set here, one on a worker of Dask."""
        return workers if self.is_local else 1

    def run(
        self, function: Callable[..., Any], tasks: Sequence[tuple[Any, ...]]
    ) -> Iterator[tuple[int, Any]]:
        """Call a function with the arguments of each task; yield index and result of each as it ends.

        Raises
        ------
        EngineError
            If Dask is lost meanwhile.
        """
        if self._executor is None:
            for index, task in enumerate(tasks):
                yield index, function(*task)
            return
        left, running = iter(enumerate(tasks)), dict[Future[Any], int]()
        try:
            while True:
                num_free = SUBMITTED_PER_WORKER * self._count_workers() - len(running)
                for _, (index, task) in zip(range(num_free), left, strict=False):
                    running[self._executor.submit(function, *task)] = index
                if not running:
                    return
                for future in wait(running, return_when=FIRST_COMPLETED).done:
                    yield running.pop(future), self._result(future)
        finally:
            for future in running:
                future.cancel()

    def map(self, function: Callable[..., Any], tasks: Sequence[tuple[Any, ...]]) -> list[Any]:
        """Return the results of `run` in the order of the tasks."""
        results = dict(self.run(function, tasks))
        return [results[index] for index in range(len(tasks))]

    def _result(self, future: Future[Any]) -> Any:
        """Return a future's result; what Dask itself raises becomes an `EngineError`."""
        if self.is_local:
            return future.result()
        from distributed import KilledWorker  # noqa: PLC0415 - an extra, loaded where the pool was opened

        try:
            return future.result()
        except (CancelledError, KilledWorker) as error:
            raise EngineError(LOST.format(type(error).__name__)) from error


#: does tasks one after the other in the calling thread
HERE: Final = TaskPool(None, lambda: 1)


@contextmanager
def open_pool(engine: Engine, workers: int | None, threads: int = 1) -> Iterator[TaskPool]:
    """Open the task pool of a stage, and close it at the end.

    Parameters
    ----------
    engine : Engine
        Its `kind` says which.
    workers : int, optional
        Workers of a cluster of this machine; one per processor unless given.
    threads : int
        Tasks that run at a time in this process.

    Raises
    ------
    SettingError
        If Dask is not installed.
    EngineError
        If its scheduler does not answer, or a worker runs another version of this program.
    """
    if engine.kind == "local" and threads == 1:
        yield HERE
        return
    with ExitStack() as stack:
        if engine.kind == "dask":
            client = stack.enter_context(_dask_client(workers or num_processors()))
            # not shut down, which would wait for the tasks of dead workers: the client cancels them
            executor = client.get_executor(pure=False)
            yield TaskPool(executor, lambda: _count_threads(client), is_local=False)
            return
        pool = ThreadPoolExecutor(threads)
        stack.callback(pool.shutdown, cancel_futures=True)
        yield TaskPool(pool, lambda: threads)


def check_engine(engine: Engine) -> None:
    """Raise SettingError if the packages of an engine are not installed.

    Raises
    ------
    SettingError
    """
    if engine.kind == "dask":
        _load_dask()


def _load_dask() -> tuple[Any, Any]:
    """Return the modules `dask` and `distributed`, whose messages are left to ours."""
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
def _dask_client(num_workers: int) -> Iterator[Any]:
    """Join the scheduler that Dask's configuration names, or start a cluster of this machine."""
    dask, distributed = _load_dask()
    address = dask.config.get("scheduler-address", None)
    with ExitStack() as stack:
        # a task is not to blame for workers that are killed
        stack.enter_context(dask.config.set({"distributed.scheduler.allowed-failures": MOST_DEATHS}))
        try:
            if address is None:
                cluster = stack.enter_context(_local_cluster(distributed, num_workers))
                client = distributed.Client(cluster, set_as_default=False)
            else:
                client = distributed.Client(address, set_as_default=False)
        except OSError as error:
            raise EngineError(
                f"no scheduler of Dask answers at {address} ({error}); start it, or correct "
                "DASK_SCHEDULER_ADDRESS, or choose engine.kind=local"
            ) from error
        stack.enter_context(client)
        _check_workers(client)
        yield client


def _count_threads(client: Any) -> int:
    """Return how many tasks the workers run at a time; 1 while there is no worker, for which tasks wait."""
    try:
        return max(1, sum(client.nthreads().values()))
    except (OSError, RuntimeError) as error:
        raise EngineError(LOST.format(type(error).__name__)) from error


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


def _product() -> Mapping[str, Any]:
    """Return versions and sources of this process, to compare workers by."""
    return maker.product()


def _check_workers(client: Any) -> None:
    """Raise EngineError if a worker has other sources or libraries than this process."""
    local = maker.product()
    for address, remote in client.run(_product).items():
        if differences := maker.unlike(local, remote):
            raise EngineError(
                f"the worker {address} differs from this process ({', '.join(differences)}), so that results "
                "would mix two programs; start the workers from this environment"
            )
