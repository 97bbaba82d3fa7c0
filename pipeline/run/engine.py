"""Where the tasks of a stage are done: by this process, or by the workers of Dask.

A task is a function at the top of a module with its arguments. Its result depends on nothing else, so that it
is the same wherever the task runs and however often it has to be started again.
"""

from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Executor, Future, ThreadPoolExecutor, wait
from contextlib import ExitStack, contextmanager
from typing import Any, Final

from fis_tools.processors import num_processors
from pipeline.run import cluster
from pipeline.run.cluster import SUBMITTED_PER_WORKER
from pipeline.settings.experiment import Engine


class TaskPool:
    """Does tasks one after the other, or on threads of this process.

    Parameters
    ----------
    executor : Executor, optional
        None to do tasks in the calling thread.
    threads : int
        How many tasks run at a time.
    """

    is_local = True

    def __init__(self, executor: Executor | None, threads: int = 1) -> None:
        self._executor, self._threads = executor, threads

    def threads(self, workers: int | None) -> int | None:
        """Return how many threads a task may use: as many as are set here, one on a worker of Dask."""
        return workers if self.is_local else 1

    def run(
        self, function: Callable[..., Any], tasks: Sequence[tuple[Any, ...]]
    ) -> Generator[tuple[int, Any], None, None]:
        """Call a function with the arguments of each task; yield index and result of each as it ends.

        Raises
        ------
        pipeline.run.cluster.EngineError
            If Dask is lost meanwhile.
        """
        if self._executor is None:
            for index, task in enumerate(tasks):
                yield index, function(*task)
            return
        left, running = iter(enumerate(tasks)), dict[Future[Any], int]()
        try:
            while True:
                num_free = SUBMITTED_PER_WORKER * self._threads - len(running)
                for _, (index, task) in zip(range(num_free), left, strict=False):
                    running[self._executor.submit(function, *task)] = index
                if not running:
                    return
                for future in wait(running, return_when=FIRST_COMPLETED).done:
                    yield running.pop(future), future.result()
        finally:
            for future in running:
                future.cancel()

    def map(self, function: Callable[..., Any], tasks: Sequence[tuple[Any, ...]]) -> list[Any]:
        """Return the results of `run` in the order of the tasks."""
        results = dict(self.run(function, tasks))
        return [results[index] for index in range(len(tasks))]


class ClusterPool(TaskPool):
    """Does tasks on the workers of Dask.

    Parameters
    ----------
    client : distributed.Client

    Raises
    ------
    pipeline.run.cluster.EngineError
        If no worker that is there runs this program.
    """

    is_local = False

    def __init__(self, client: Any) -> None:
        super().__init__(None)
        self._client, self._workers = client, cluster.Workers(client)
        self._workers.check_door()

    def run(
        self, function: Callable[..., Any], tasks: Sequence[tuple[Any, ...]]
    ) -> Generator[tuple[int, Any], None, None]:
        """Do tasks on the workers; see `pipeline.run.cluster.run_on`."""
        return cluster.run_on(self._client, self._workers, function, tasks)


#: does tasks one after the other in the calling thread
HERE: Final = TaskPool(None)


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
    pipeline.run.cluster.EngineError
        If its scheduler does not answer, or its workers run another version of this program.
    """
    if engine.kind == "local" and threads == 1:
        yield HERE
        return
    with ExitStack() as stack:
        if engine.kind == "dask":
            # not shut down, which would wait for the tasks of dead workers: the pool cancels them
            yield ClusterPool(stack.enter_context(cluster.open_client(workers or num_processors())))
            return
        pool = ThreadPoolExecutor(threads)
        stack.callback(pool.shutdown, cancel_futures=True)
        yield TaskPool(pool, threads)


def check_engine(engine: Engine) -> None:
    """Raise SettingError if the packages of an engine are not installed.

    Raises
    ------
    SettingError
    """
    if engine.kind == "dask":
        cluster.load_dask()
