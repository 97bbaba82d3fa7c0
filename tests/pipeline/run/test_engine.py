"""Tasks give the same results wherever they are done, and a lost worker or scheduler loses nothing."""

import operator
import os
import signal
import subprocess
import sys
import threading
from contextlib import contextmanager, suppress
from pathlib import Path

import numpy as np
import pytest

from pipeline.command_line.cli import main
from pipeline.command_line.runs import UNIMPROVED
from pipeline.run import artifacts, cluster, maker, tables
from pipeline.run.cluster import SUBMITTED_PER_WORKER, EngineError
from pipeline.run.engine import HERE, check_engine, open_pool
from pipeline.settings.experiment import Engine, SettingError
from tests import night

LOCAL, DASK = Engine(kind="local"), Engine(kind="dask")
SQUARES = [(number, 2) for number in range(40)]


@pytest.mark.parametrize("threads", [1, 3])
def test_results_come_in_the_order_of_their_tasks_on_any_number_of_threads(threads):
    with open_pool(LOCAL, None, threads=threads) as pool:
        assert pool.is_local
        assert pool.threads(5) == 5
        assert pool.map(pow, SQUARES) == [number**2 for number in range(40)]
        assert dict(pool.run(pow, SQUARES)) == {number: number**2 for number in range(40)}
        assert pool.map(pow, []) == []


@pytest.mark.parametrize("threads", [1, 3])
def test_the_error_of_a_task_is_raised_and_what_has_not_begun_is_left_out(threads):
    begun = []

    def fail(number):
        begun.append(number)
        raise KeyError(number)

    with pytest.raises(KeyError), open_pool(LOCAL, None, threads=threads) as pool:
        list(pool.run(fail, [(number,) for number in range(1000)]))
    assert len(begun) <= SUBMITTED_PER_WORKER * threads


def test_no_more_tasks_are_submitted_than_the_workers_need():
    begun, release = [], threading.Event()

    def wait_for_release(number):
        begun.append(number)
        release.wait()
        return number

    with open_pool(LOCAL, None, threads=2) as pool:
        results = pool.run(wait_for_release, [(number,) for number in range(100)])
        release.set()
        next(results)
        assert max(begun) <= 2 * SUBMITTED_PER_WORKER
        assert sum(1 for _ in results) == 99


def test_without_dask_the_error_names_the_package_and_the_cure_before_a_folder_is_made(
    monkeypatch, tmp_path, ran
):
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(SettingError, match="needs the package distributed; install it: python -m pip"):
        check_engine(DASK)
    check_engine(LOCAL)
    words = ["+experiment=evaluate", "engine.kind=dask", f"hydra.run.dir={tmp_path / 'run'}"]
    assert "or choose engine.kind=local" in ran(*words, code=2).err
    assert not (tmp_path / "run").exists()


def killed_once(folder: Path, number: int) -> int:
    """Kill the worker that computes this for the first time."""
    mark = folder / f"{number}"
    if number % 5 == 0 and not mark.exists():
        mark.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return number**2


def address() -> str:
    from distributed import get_worker  # noqa: PLC0415 - runs on a worker

    return get_worker().address


@pytest.mark.slow
def test_killed_workers_lose_nothing_and_connections_are_encrypted(tmp_path):
    with open_pool(DASK, 2) as pool:
        assert not pool.is_local
        assert pool.threads(5) == 1
        assert pool.map(address, [()])[0].startswith("tls://127.0.0.1")
        squares = pool.map(killed_once, [(tmp_path, number) for number in range(15)])
        with pytest.raises(ZeroDivisionError):
            pool.map(operator.truediv, [(1, 0)])
    assert len(list(tmp_path.iterdir())) == 3
    assert squares == HERE.map(pow, SQUARES[:15])


@pytest.mark.slow
def test_workers_of_another_program_are_refused(monkeypatch):
    monkeypatch.setattr(maker, "product", lambda: {"versions": {}, "sources": "others"})
    with (
        pytest.raises(EngineError, match="differs from this process \\(other sources\\)"),
        open_pool(DASK, 1),
    ):
        pass


@pytest.mark.slow
def test_a_scheduler_that_does_not_answer_is_named():
    import dask  # noqa: PLC0415 - an extra

    elsewhere = {"scheduler-address": "tcp://127.0.0.1:9", "distributed.comm.timeouts.connect": "1s"}
    with (
        dask.config.set(elsewhere),
        pytest.raises(EngineError, match=r"no scheduler .* answers at tcp://127\.0\.0\.1:9"),
        open_pool(DASK, 1),
    ):
        pass


EVALUATE = [
    "+experiment=evaluate",
    "controller=paper_champion",
    "stages=[evaluate]",
    "optimum.reference=null",
]
EVALUATE += ["monte_carlo.num_cases=60", "engine.part_cases=7", "duration_s=600", "monte_carlo.workers=2"]
DISPERSED = "+dispersions.deputy.mass_kg={kind:normal,mean:12.0,std:0.5}"


def content(folder: Path, name: str = artifacts.EPISODES) -> bytes:
    return (folder / name).read_bytes()


@pytest.mark.slow
# Dask leaves a connection that ends while it is made to the garbage collector
@pytest.mark.filterwarnings(
    "ignore:Exception ignored in. <ssl.SSLSocket:pytest.PytestUnraisableExceptionWarning"
)
def test_an_evaluation_has_the_same_bytes_and_goes_on_with_another_engine(tmp_path, monkeypatch):
    words = [*EVALUATE, DISPERSED]
    local, whole, stopped = (tmp_path / name for name in ("local", "whole", "stopped"))
    assert main([*words, f"hydra.run.dir={local}"]) == 0
    assert main([*words, "engine.kind=dask", f"hydra.run.dir={whole}"]) == 0
    assert content(whole) == content(local)
    assert content(whole, artifacts.SUMMARY) == content(local, artifacts.SUMMARY)
    write, written = tables.write_parquet, []

    def write_some(path, columns, *notes):
        if len(written) == 4:
            raise KeyboardInterrupt
        written.append(path)
        write(path, columns, *notes)

    with monkeypatch.context() as patch:
        patch.setattr(tables, "write_parquet", write_some)
        assert main([*words, "engine.kind=dask", f"hydra.run.dir={stopped}"]) == 130
    kept = {path: path.stat().st_mtime_ns for path in (stopped / artifacts.EPISODE_PARTS).rglob("*.parquet")}
    assert set(kept) == set(written)
    assert main([f"resume={stopped}", "engine.kind=local"]) == 0
    assert content(stopped) == content(local)


@contextmanager
def started(folder: Path):
    """A scheduler and a worker as somebody starts them, in processes of their own."""
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    path = folder / "scheduler.json"

    def start(kind: str, *words: str) -> subprocess.Popen[bytes]:
        command = [sys.executable, "-m", f"distributed.cli.dask_{kind}", *words, "--no-dashboard"]
        return subprocess.Popen(command, env=environment, stderr=subprocess.DEVNULL)  # noqa: S603

    scheduler = start("scheduler", "--scheduler-file", str(path), "--host", "127.0.0.1", "--port", "0")
    worker = start("worker", "--scheduler-file", str(path), "--nthreads", "1", "--no-nanny")
    try:
        yield scheduler, path
    finally:
        for process in (worker, scheduler):
            process.kill()
            process.wait()


@pytest.mark.slow
def test_a_lost_scheduler_is_told_and_what_is_done_is_kept(tmp_path, monkeypatch, ran):
    import json  # noqa: PLC0415
    import time  # noqa: PLC0415

    import dask  # noqa: PLC0415 - an extra

    local, lost = tmp_path / "local", tmp_path / "lost"
    assert main([*EVALUATE, f"hydra.run.dir={local}"]) == 0
    with started(tmp_path) as (scheduler, path):
        while not path.exists():
            time.sleep(0.05)
        with suppress(json.JSONDecodeError):
            scheduler_address = json.loads(path.read_text())["address"]
        write = tables.write_parquet

        def write_and_kill(path, columns, *notes):
            write(path, columns, *notes)
            scheduler.kill()

        with dask.config.set({"scheduler-address": scheduler_address}), monkeypatch.context() as patch:
            patch.setattr(tables, "write_parquet", write_and_kill)
            output = ran(*EVALUATE, "engine.kind=dask", f"hydra.run.dir={lost}", code=2).err
    assert "of Dask were lost" in output
    assert "go on with resume=" in output
    parts = list((lost / artifacts.EPISODE_PARTS).rglob("*.parquet"))
    assert 1 <= len(parts) < 9
    assert main([f"resume={lost}", "engine.kind=local"]) == 0
    assert content(lost) == content(local)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("words", "names"),
    night.by_day(
        [
            (
                """+experiment=optimum monte_carlo.num_cases=3 optimum.points=30 optimum.restarts=2
            optimum.kicks=0 duration_s=600 optimum.workers=2""",
                [artifacts.OPTIMUM_CASES, artifacts.OPTIMUM_FORCES],
            ),
            (
                """+experiment=baselines compare.controllers=[coast,lqr] monte_carlo.num_cases=4
            duration_s=300
            stages=[compare] monte_carlo.workers=2""",
                [artifacts.COMPARISON_EPISODES, artifacts.COMPARISON_TABLE],
            ),
            (
                """+experiment=assure controller=paper_champion assurance.num_cases=20 assurance.searches=3
            assurance.search_starts=8 assurance.search_population=6 assurance.search_generations=2
            assurance.domain_cases=8 assurance.workers=2 engine.part_cases=6""",
                [artifacts.ASSURED_CASES, artifacts.SEARCHED],
            ),
            (
                """+experiment=train_readable optimizer=tour controller=champion_27_one_push
            optimizer.generations=2 optimizer.population_size=6 optimizer.rounds=1 starts.num_cases=4
            starts.num_hard=0 optimizer.validation_cases=4 duration_s=600 stages=[train]
            optimizer.workers=2""",
                [artifacts.LOGBOOK, artifacts.HISTORY],
            ),
        ],
        2,
    ),
    ids=night.by_day(["optimum", "compare", "assure", "train"], 2),
)
def test_other_stages_write_the_same_tables(words, names, tmp_path):
    codes = [
        main([*words.split(), f"engine.kind={kind}", f"hydra.run.dir={tmp_path / kind}"])
        for kind in ("local", "dask")
    ]
    # so short a training need not improve on the controller that it was given
    assert codes in ([0, 0], [UNIMPROVED, UNIMPROVED])
    for name in names:
        assert content(tmp_path / "dask", name) == content(tmp_path / "local", name)


@pytest.mark.slow
def test_one_part_is_flown_here_and_says_so(tmp_path, ran):
    words = [*EVALUATE, "engine.kind=dask", "engine.part_cases=60", f"hydra.run.dir={tmp_path / 'run'}"]
    assert "60 cases are one part, which is flown here" in ran(*words).err
    assert np.all(tables.read_parquet(tmp_path / "run", artifacts.EPISODES)["case"] == np.arange(60))


def test_only_the_loggers_of_dask_are_silenced():
    assert all(name.split(".")[0] in ("distributed", "tornado", "asyncio") for name in cluster.LOGGERS)
