"""Real schedulers and workers, late, foreign and killed: no result is taken on trust."""

import json
import os
import shutil
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest

from pipeline.run import certificate, cluster, maker
from pipeline.run.cluster import EngineError
from pipeline.run.engine import open_pool
from pipeline.settings.experiment import Engine

DASK = Engine(kind="dask")


class Started:
    """A scheduler and its workers, processes by themselves, each with the sources in some folder."""

    def __init__(self, folder: Path, sources: Path = maker.SOURCES, words: tuple[str, ...] = ()) -> None:
        self.folder, self.file, self.processes = folder, folder / "scheduler.json", []
        words = ("--host", "127.0.0.1", "--port", "0", *words)
        self.begin("scheduler", *words, sources=sources, ALLOWED_FAILURES="0")
        while not self.file.exists() or not self.file.read_text().endswith("}"):
            time.sleep(0.05)
        self.address = json.loads(self.file.read_text())["address"]

    def begin(self, kind: str, *words: str, sources: Path = maker.SOURCES, **settings: str) -> None:
        given = {f"DASK_DISTRIBUTED__SCHEDULER__{name}": value for name, value in settings.items()}
        command = [sys.executable, "-m", f"distributed.cli.dask_{kind}", "--scheduler-file", str(self.file)]
        env = {**os.environ, **given, "PYTHONPATH": str(sources)}
        quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
        command += [*words, "--no-dashboard"]
        self.processes.append(subprocess.Popen(command, env=env, cwd=self.folder, **quiet))  # noqa: S603

    def worker(self, sources: Path = maker.SOURCES) -> None:
        self.begin("worker", "--nthreads", "1", "--no-nanny", sources=sources)

    def end(self) -> None:
        for process in self.processes:
            process.kill()
            process.wait()


@pytest.fixture
def started(tmp_path):
    import dask  # noqa: PLC0415 - an extra

    processes = Started(tmp_path)
    with dask.config.set({"scheduler-address": processes.address}):
        yield processes
    processes.end()


def changed_sources(folder: Path) -> Path:
    """A copy of the program in which one line differs."""
    for name in maker.PACKAGES:
        shutil.copytree(maker.SOURCES / name, folder / name, ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copy(maker.SOURCES / "pyproject.toml", folder)
    path = folder / "pipeline" / "scenarios.py"
    path.write_text(path.read_text() + "\n# another line\n")
    return folder


def killed_once(folder: Path) -> bool:
    """Kill the worker that computes this for the first time."""
    mark = folder / "killed"
    if not mark.exists():
        mark.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return True


@pytest.mark.slow
def test_a_worker_with_other_sources_that_joins_late_makes_no_result(started, tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(cluster, "PATIENCE_S", 0.0)
    with open_pool(DASK, None) as pool, maker.collected() as makers:
        started.worker(changed_sources(tmp_path / "changed"))
        started.refused = False

        def refuse(self, worker, why, of=cluster.Workers.refuse):
            of(self, worker, why)
            if not started.refused:  # only now comes one that fits
                started.refused = True
                started.worker()

        monkeypatch.setattr(cluster.Workers, "refuse", refuse)
        results = pool.map(maker.sources_hash, [()] * 20)
    output = capsys.readouterr().err
    assert set(results) == {maker.sources_hash()}
    assert started.refused
    assert "differs from this process (other sources), so that results would mix two programs" in output
    assert f"20 tasks wait for a worker of {started.address}, which has none" in output
    assert [made["sources"] for made in makers] == [maker.sources_hash()]


@pytest.mark.slow
def test_a_worker_that_is_not_reproducible_makes_no_reproducible_result(started, monkeypatch):
    started.worker()
    reproducible = {**maker.processor(), "reproducible": True}
    monkeypatch.setattr(maker, "processor", lambda: reproducible)
    monkeypatch.setattr(cluster.Workers, "check_door", wait_for_one(cluster.Workers.check_door))
    with pytest.raises(EngineError, match="not started for reproducible=true"), open_pool(DASK, None):
        pass


def wait_for_one(check_door):
    """Begin once a worker is there."""

    def check(self):
        while not self.fit:
            self.look()
            time.sleep(0.1)
        check_door(self)

    return check


@pytest.mark.slow
def test_a_task_whose_workers_were_killed_is_done_again_by_others(started, tmp_path, capsys):
    # the scheduler itself blames a task for the first worker that dies with it
    started.worker()
    started.worker()
    with open_pool(DASK, None) as pool:
        assert pool.map(killed_once, [(tmp_path,)]) == [True]
    assert "1 workers died with a task" in capsys.readouterr().err


@pytest.mark.slow
def test_a_scheduler_without_this_program_is_told_in_a_sentence(tmp_path):
    import dask  # noqa: PLC0415 - an extra

    processes = Started(tmp_path, sources=tmp_path)
    processes.worker()
    try:
        with (
            dask.config.set({"scheduler-address": processes.address}),
            pytest.raises(EngineError, match="start the scheduler, too, from this environment"),
            open_pool(DASK, None) as pool,
        ):
            pool.map(maker.sources_hash, [()])
    finally:
        processes.end()


def certificate_in(folder: Path) -> dict[str, str]:
    """The files of a certificate made for a test, by their role."""
    from distributed import Security  # noqa: PLC0415 - an extra

    folder.mkdir()
    security = Security.temporary()
    chain, key = security.tls_client_cert, security.tls_client_key
    texts = {"ca-file": security.tls_ca_file, "cert": chain, "key": key}
    for name, text in texts.items():
        (folder / name).write_text(text)
    return {name: str(folder / name) for name in texts}


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["none", "other", "missing"])
def test_a_wrong_certificate_is_told_in_a_sentence(tmp_path, kind):
    import dask  # noqa: PLC0415 - an extra

    right, other = certificate_in(tmp_path / "right"), certificate_in(tmp_path / "other")
    words = ["--protocol", "tls", *(word for name in right for word in (f"--tls-{name}", right[name]))]
    processes = Started(tmp_path, words=tuple(words))
    given = {**other, "ca-file": str(tmp_path / "no file")} if kind == "missing" else other
    tls = {
        "distributed.comm.tls.ca-file": given["ca-file"],
        "distributed.comm.tls.client.cert": given["cert"],
        "distributed.comm.tls.client.key": given["key"],
    }
    settings = {"scheduler-address": processes.address, "distributed.comm.timeouts.connect": "5s"}
    try:
        with (
            dask.config.set(settings | (tls if kind != "none" else {})),
            pytest.raises(EngineError) as refused,
            open_pool(DASK, None),
        ):
            pass
    finally:
        processes.end()
    assert processes.address in str(refused.value)
    assert "for tls:// give the files of the scheduler's certificate" in str(refused.value)
    assert "or choose engine.kind=local" in str(refused.value)
    # nothing is left that would be closed whenever it is found as garbage, be it while another client starts
    assert "IO loop" not in [thread.name for thread in threading.enumerate()]


def test_a_result_tells_its_maker_and_whether_it_came_whole():
    present = maker.present_maker()
    done = certificate.carry_out(present, certificate.packed_task(pow, (3, 2)), "here")
    assert (done.result(), done.maker, done.is_whole) == (9, present, True)
    damaged = certificate.Certified(present, "here", done.packed[:-1], done.sha256)
    assert not damaged.is_whole
    declined = certificate.carry_out(
        {**present, "sources": "others"}, certificate.packed_task(pow, (3, 2)), "here"
    )
    assert not declined.packed
    with pytest.raises(ZeroDivisionError):
        certificate.carry_out(present, certificate.packed_task(divmod, (1, 0)), "here").result()


def test_a_reproducible_process_takes_results_of_reproducible_ones_alone():
    present = maker.present_maker()
    ordinary = {**present, "processor": {**present["processor"], "reproducible": False}}
    reproducible = {**present, "processor": {**present["processor"], "reproducible": True}}
    other_libm = {**reproducible, "processor": {**reproducible["processor"], "libm": "glibc 1.0"}}
    assert maker.unfit(reproducible, reproducible) == []
    assert "not started for reproducible=true" in maker.unfit(reproducible, ordinary)[0]
    assert "now glibc 1.0" in maker.unfit(reproducible, other_libm)[0]
    # without it processors may differ, and kernels of the operating system always
    assert (
        maker.unfit(ordinary, {**other_libm, "versions": present["versions"] | {"platform": "Linux-9"}}) == []
    )


def test_a_cluster_of_this_machine_answers_no_page():
    import urllib.error  # noqa: PLC0415
    import urllib.request  # noqa: PLC0415

    import distributed  # noqa: PLC0415

    with cluster.open_client(1) as client:
        assert client.cluster.scheduler_address.startswith("tls://127.0.0.1:")
        address = client.cluster.scheduler_address.replace("tls://", "tcp://")
        with pytest.raises(OSError):  # noqa: PT011 - whoever comes without the certificate is refused
            distributed.Client(address, timeout=2)
        port = client.cluster.scheduler.http_server.port
        for page in ("json/identity.json", "health", "info/main/workers.html"):
            with pytest.raises(urllib.error.HTTPError, match="404"):
                urllib.request.urlopen(f"http://127.0.0.1:{port}/{page}", timeout=10)
