"""Processes managed by Dask, on this machine or of a scheduler to join.

Dask's peers exchange pickles, so that whoever reaches one can run code as its user. Processes started here,
and all traffic off this machine, therefore use TLS, and accept only holders of their certificate.
"""

import json
import logging
import os
import signal
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from functools import cache
from itertools import product
from multiprocessing import resource_tracker
from pathlib import Path
from typing import Any, Final
from urllib.parse import urlsplit

from distributed import CancelledError, Client, KilledWorker, LocalCluster, wait
from distributed.security import Security

from pipeline.run import maker
from pipeline.settings.experiment import Engine

#: restarts of a part before it is blamed for the deaths of its processes
MOST_DEATHS: Final = 1000
#: parts running or waiting, per process; it bounds the memory used
AHEAD: Final = 3
LOOPBACK: Final = ("127.0.0.1", "localhost", "::1")
#: time without a finished part after which the processes are checked, s
LOOK_S: Final = 5.0
#: Dask's settings: restart what dies, with little monitoring
SETTINGS: Final = {
    "distributed.scheduler.allowed-failures": MOST_DEATHS,
    "distributed.scheduler.active-memory-manager.start": False,
    "distributed.worker.profile.enabled": False,
    "distributed.admin.tick.interval": "1s",
    "distributed.admin.system-monitor.interval": "10s",
}
#: where Dask must serve its state: on this machine only, on any free port
NO_DASHBOARD: Final = f"{LOOPBACK[0]}:0"
#: a certificate with its key, next to a scheduler's file
CERTIFICATE: Final = "tls.pem"

SAME_ENVIRONMENT: Final = (
    "start the scheduler and its workers from these sources, with the packages of requirements.txt"
)


class EngineError(ValueError):
    """An engine that is not available, or has disappeared; finished parts are kept."""


class Processes:
    """Runs parts in processes.

    Parameters
    ----------
    client : distributed.Client
    cluster : distributed.LocalCluster, optional
        The cluster, if we started its processes.
    """

    def __init__(self, client: Any, cluster: Any = None) -> None:
        self._client, self._cluster = client, cluster
        self._missing: set[Any] = set()

    def each(self, do: Callable[..., Any], parts: Sequence[tuple[Any, ...]]) -> Iterator[tuple[int, Any]]:
        """Run all parts, in any order; see `pipeline.run.engine.each`."""
        ahead = AHEAD * max(1, self._count())
        left, places = iter(enumerate(parts)), dict[Any, int]()
        try:
            while True:
                while len(places) < ahead and (part := next(left, None)):
                    task = in_equal_environment, environment(), do, part[1]
                    places[self._client.submit(*task, pure=False)] = part[0]
                if not places:
                    return
                for future, result in self._done(list(places)):
                    place = places.pop(future)
                    future.release()
                    yield place, result
        except (OSError, CancelledError, KilledWorker) as error:
            raise EngineError(
                f"Dask's scheduler or its processes are gone ({type(error).__name__}); what was done until "
                "then is kept: go on with resume="
            ) from error
        except (ImportError, AttributeError, RuntimeError) as error:  # what Dask could not unpickle there
            if self._cluster is not None:
                raise
            raise EngineError(
                f"Dask's scheduler or one of its processes cannot run a part ({error.__cause__ or error}); "
                f"{SAME_ENVIRONMENT}"
            ) from error

    def _done(self, running: list[Any]) -> Iterator[tuple[Any, Any]]:
        """Wait for a while; yield the finished parts, with their results."""
        try:
            done = wait(running, LOOK_S, "FIRST_COMPLETED").done
        except TimeoutError:
            self._look()
            return
        for future in done:
            try:
                result = future.result(timeout=LOOK_S)
            except TimeoutError:  # its process died before the result was fetched: it runs again
                self._look()
                continue
            yield future, result

    def _count(self) -> int:
        if self._cluster is not None:
            return len(self._cluster.worker_spec)
        return len(self._client.scheduler_info(n_workers=-1)["workers"])

    def _look(self) -> None:
        """Replace processes found dead twice: Dask does not restart those that die while starting."""
        if self._cluster is None:
            return
        dead = {name for name, nanny in self._cluster.workers.items() if not nanny.is_alive()}
        for name in dead & self._missing:
            del self._cluster.workers[name]
        if dead & self._missing:
            self._cluster.scale(len(self._cluster.worker_spec))
        self._missing = dead


@cache
def environment() -> Mapping[str, Any]:
    """Return what must be equal wherever parts run, so that their results are."""
    versions = {name: version for name, version in maker.versions().items() if name != "platform"}
    return {"versions": versions, "sources": maker.sources_hash()}


def in_equal_environment(
    expected: Mapping[str, Any], do: Callable[..., Any], arguments: tuple[Any, ...]
) -> Any:
    """Run a part, unless versions or sources differ here.

    Raises
    ------
    EngineError
        If they do.
    """
    if differences := maker.unlike(expected, environment()):
        raise EngineError(
            f"a process of Dask's is unlike this one ({', '.join(differences)}); {SAME_ENVIRONMENT}"
        )
    return do(*arguments)


@contextmanager
def joined(engine: Engine) -> Iterator[Processes]:
    """Start processes on this machine, or join the scheduler that is given.

    Raises
    ------
    EngineError
        If they cannot be started or joined.
    """
    import dask  # noqa: PLC0415 - installed with distributed

    for name in ("distributed", "distributed.client", "asyncio"):  # what matters is raised as an error
        logging.getLogger(name).setLevel(logging.CRITICAL + 1)
    with dask.config.set(SETTINGS), ExitStack() as stack:
        if engine.scheduler:
            address, certificate = address_of(engine.scheduler)
            yield Processes(stack.enter_context(_joined(address, certificate)))
            return
        scratch = stack.enter_context(tempfile.TemporaryDirectory())
        with _interrupts_held_back():
            cluster = stack.enter_context(_started(engine, scratch))
            client = stack.enter_context(Client(cluster))
        yield Processes(client, cluster)


@contextmanager
def _interrupts_held_back() -> Iterator[None]:
    """Raise an interrupt of this block at its end; threads and processes that it starts never see one.

    A terminal interrupts all processes of a command: those of Dask are closed by this one, and do not end by
    themselves with a traceback each.
    """
    resource_tracker.ensure_running()  # its start would let interrupts through again
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _joined(address: str, certificate: Path | None) -> Any:
    """Join a scheduler."""
    try:
        return Client(address, timeout=20, security=certificate and security_of(certificate))
    except OSError as error:
        raise EngineError(f"there is no Dask scheduler at {address} ({error}); start it") from error
    except Exception as error:  # of another version, or another program
        raise EngineError(
            f"no Dask scheduler of this version answers at {address} ({error}); {SAME_ENVIRONMENT}"
        ) from error


def _started(engine: Engine, scratch: str) -> Any:
    """Start processes of one thread each on this machine, which trust only one another."""
    try:
        cluster = LocalCluster(
            n_workers=0,
            threads_per_worker=1,
            host=LOOPBACK[0],
            protocol="tls://",
            security=Security.temporary(),
            dashboard_address=NO_DASHBOARD,
            scheduler_kwargs={"dashboard": False},
            local_directory=scratch,
            silence_logs=50,
            memory_limit=0,
        )
        # not at once: one that died while it started would take the cluster with it
        cluster.scale(engine.processes or os.cpu_count() or 1)
        return cluster
    except (RuntimeError, OSError, ImportError) as error:
        raise EngineError(f"Dask could not start its processes ({error}); resume= begins again") from error


def security_of(certificate: Path) -> Security:
    """Return the settings with which Dask speaks only to holders of a certificate and its key."""
    name = str(certificate)
    roles = product(("client", "scheduler", "worker"), ("cert", "key"))
    files = {f"tls_{role}_{part}": name for role, part in roles}
    return Security(tls_ca_file=name, require_encryption=True, **files)


def write_certificate(path: Path) -> None:
    """Write a new certificate with its key, readable only by its owner."""
    made = Security.temporary()
    path.parent.mkdir(parents=True, exist_ok=True)
    path.unlink(missing_ok=True)
    descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
    with os.fdopen(descriptor, "w", encoding="ascii") as stream:
        stream.write(made.tls_scheduler_key + made.tls_scheduler_cert)


def address_of(scheduler: str) -> tuple[str, Path | None]:
    """Return the address of a scheduler, given itself or by its file, and the certificate next to that.

    Raises
    ------
    EngineError
        If the file cannot be read, or the scheduler is on another machine and does not speak TLS.
    """
    address, certificate = scheduler, None
    if "://" not in scheduler and Path(scheduler).suffix == ".json":
        try:
            address = str(json.loads(Path(scheduler).read_text(encoding="utf-8"))["address"])
        except (OSError, ValueError, KeyError, TypeError) as error:
            raise EngineError(
                f"{scheduler} is no file of a Dask scheduler ({error}); it is what "
                "python -m pipeline cluster scheduler writes"
            ) from error
        certificate = Path(scheduler).parent / CERTIFICATE
    parsed = urlsplit(address if "://" in address else f"tcp://{address}")
    if parsed.scheme == "tls" and certificate is not None and certificate.exists():
        return parsed.geturl(), certificate
    if parsed.hostname not in LOOPBACK or parsed.scheme == "tls":
        raise EngineError(
            f"engine.scheduler is {scheduler}, at {address}, and there is no certificate for it; Dask's "
            "peers exchange pickles, so one is joined on this machine, or by TLS: start it with "
            "python -m pipeline cluster scheduler FOLDER, and give engine.scheduler=FOLDER/scheduler.json"
        )
    return parsed.geturl(), None
