"""Processes of Dask: who is listened to, and what is said when the scheduler is lost."""

import asyncio
import json
import os
import signal
import socket
import stat
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest
from distributed import Client
from distributed.comm import connect, listen
from distributed.security import Security

from pipeline.command_line.cli import main
from pipeline.run import artifacts, maker, processes, progress, tables
from pipeline.run.engine import each
from pipeline.run.processes import (
    EngineError,
    address_of,
    environment,
    in_equal_environment,
    security_of,
    write_certificate,
)
from pipeline.run.progress import Progress
from pipeline.settings.experiment import Engine
from tests.hostile.kills import command, words_of
from tests.places import PROJECT


async def heard_by(listening: Security, speaking: Security | None) -> list[object]:
    heard: list[object] = []

    async def hear(comm):
        heard.append(await comm.read())
        await comm.close()

    async with listen("tls://127.0.0.1:0", hear, **listening.get_listen_args("scheduler")) as listener:
        scheme = "tls" if speaking else "tcp"
        address = listener.contact_address.replace("tls", scheme, 1)
        arguments = speaking.get_connection_args("client") if speaking else {}
        try:
            comm = await connect(address, timeout=2, **arguments)
            await comm.write("hello")
            await comm.close()
        except OSError:
            pass
        await asyncio.sleep(0.05)
    return heard


def test_who_has_no_certificate_is_not_heard(tmp_path):
    for name in ("ours", "another"):
        write_certificate(tmp_path / name / "tls.pem")
        assert stat.S_IMODE((tmp_path / name / "tls.pem").stat().st_mode) == 0o600
    ours, another = (security_of(tmp_path / name / "tls.pem") for name in ("ours", "another"))
    # a browser of other tests may have an event loop in this thread
    with ThreadPoolExecutor(1) as elsewhere:
        heard = [elsewhere.submit(asyncio.run, heard_by(ours, one)).result() for one in (ours, another, None)]
    assert heard == [["hello"], [], []]


@pytest.mark.slow
def test_another_program_than_a_scheduler_is_refused_in_a_sentence(tmp_path):
    def serve(server):
        with suppress(OSError):
            while True:
                connection, _ = server.accept()
                connection.sendall(b"HTTP/1.1 400 Bad Request\r\n\r\n")
                connection.close()

    with socket.create_server(("127.0.0.1", 0)) as server, ThreadPoolExecutor(1) as elsewhere:
        elsewhere.submit(serve, server)
        words = [*words_of("joined", tmp_path), f"engine.scheduler=127.0.0.1:{server.getsockname()[1]}"]
        told = subprocess.run(command(words), capture_output=True, text=True, check=False)  # noqa: S603
        server.shutdown(socket.SHUT_RDWR)
    assert told.returncode == 2
    assert "no Dask scheduler of this version answers at tcp://127.0.0.1" in told.stderr
    assert "Traceback" not in told.stderr


def test_a_process_with_another_environment_runs_no_part():
    assert in_equal_environment(environment(), maker.sources_hash, ()) == maker.sources_hash()
    versions = environment()["versions"] | {"numpy": "1.0"}
    for other in (environment() | {"versions": versions}, environment() | {"sources": "0"}):
        with pytest.raises(EngineError, match=r"numpy 1\.0|other sources"):
            in_equal_environment(other, maker.sources_hash, ())


@pytest.mark.slow
def test_a_scheduler_without_this_product_is_refused_in_a_sentence(tmp_path):
    file = tmp_path / "scheduler.json"
    words = ["--host=127.0.0.1", "--port=0", "--no-dashboard", f"--scheduler-file={file}"]
    program = [sys.executable, "-m", "distributed.cli.dask_scheduler", *words]
    foreign = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    with subprocess.Popen(program, stderr=subprocess.DEVNULL, cwd=tmp_path, env=foreign) as process:  # noqa: S603
        try:
            while not file.exists():
                assert process.poll() is None
                time.sleep(0.1)
            with pytest.raises(EngineError, match="No module named"):
                list(each(Engine(kind="dask", scheduler=str(file)), maker.sources_hash, [()]))
        finally:
            process.kill()


def held_back() -> list[int]:
    return sorted(signal.pthread_sigmask(signal.SIG_BLOCK, ()))


@pytest.mark.slow
def test_processes_leave_interrupts_to_who_started_them():
    before = held_back()
    engine = Engine(kind="dask", processes=2)
    assert [held for _, held in each(engine, held_back, [()] * 4)] == [[signal.SIGINT]] * 4
    assert held_back() == before


@pytest.mark.slow
def test_an_interrupt_while_processes_start_ends_them(monkeypatch):
    started = []

    def interrupted(cluster):
        started.append(cluster)
        signal.raise_signal(signal.SIGINT)
        return Client(cluster)

    monkeypatch.setattr(processes, "Client", interrupted)
    with pytest.raises(KeyboardInterrupt):
        list(each(Engine(kind="dask", processes=1), maker.sources_hash, [()]))
    assert [cluster.status.name for cluster in started] == ["closed"]


PROGRAM = """
import os, signal
from pipeline.run import interrupts
class Lost:
    def __del__(self):
        os.kill(os.getpid(), signal.SIGINT)
        sum(range(1000))
signal.signal(signal.SIGINT, signal.default_int_handler)  # one that runs in the background ignores it
interrupts.remember()
said = "told"
class Faulty:
    def __del__(self):
        raise ValueError(said)
faulty = Faulty()
del faulty
try:
    with interrupts.heeded():
        lost = Lost()
        del lost
        print("went on")
except KeyboardInterrupt:
    print("interrupted")
said = "not told"
half_made = Faulty()
del half_made
"""


def test_an_interrupt_lost_in_a_finalizer_ends_the_work_without_a_traceback():
    command = [sys.executable, "-c", PROGRAM]
    done = subprocess.run(command, cwd=PROJECT, capture_output=True, text=True, check=True)  # noqa: S603
    assert done.stdout.split("\n")[-2] == "interrupted"
    assert "KeyboardInterrupt" not in done.stderr
    assert "ValueError: told" in done.stderr
    assert "not told" not in done.stderr


@pytest.fixture
def clock(monkeypatch):
    """Seconds, as the test sets them."""
    now = [100.0]
    monkeypatch.setattr(progress.time, "perf_counter", lambda: now[0])
    return now


def test_lines_are_told_now_and_then_with_the_time_left(clock, capsys):
    with Progress("solved", 10, done=2) as shown:
        for done in (3, 4, 5, 9, 10):
            clock[0] += 2.0
            shown.show(done, f"case {done}")
    # eight are left at the start: one in two seconds, then three in six, all in ten
    assert capsys.readouterr().err.splitlines() == [
        "  solved 3/10, case 3, 14 s left",
        "  solved 9/10, case 9, 1 s left",
        "  solved 10/10, case 10, 0 s left",
    ]


def test_what_was_done_before_is_counted_from_what_is_shown_first(clock, capsys):
    with Progress("generation", 8) as shown:
        clock[0] += 3.0
        shown.show(5)
    assert capsys.readouterr().err == "  generation 5/8, 9 s left\n"


def test_a_terminal_shows_a_bar(monkeypatch, capsys):
    monkeypatch.setenv("FORCE_COLOR", "1")
    monkeypatch.setenv("TTY_COMPATIBLE", "1")
    with Progress("solved", 4, done=0) as shown:
        shown.show(2, "case 1")
    told = capsys.readouterr().err
    assert "case 1" in told
    assert "2/4" in told
    assert "s left\n" not in told


def draw_or_die(folder: str, number: int, dies: bool) -> float:
    """Draw a number; a part that is to die kills its process the first time."""
    mark = Path(folder, str(number))
    if dies and not mark.exists():
        mark.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return float(np.random.default_rng(number).normal())


@pytest.mark.slow
def test_parts_of_processes_that_die_are_done_again(tmp_path):
    parts = [(str(tmp_path), number, number % 5 == 0) for number in range(20)]
    expected = [draw_or_die(str(tmp_path), number, False) for _, number, _ in parts]
    engine = Engine(kind="dask", processes=2)
    assert [found for _, found in sorted(each(engine, draw_or_die, parts))] == expected
    assert len(list(tmp_path.iterdir())) == 4  # so many died
    assert [found for _, found in each(Engine(), draw_or_die, parts)] == expected


@pytest.mark.parametrize(
    ("scheduler", "address"),
    [
        ("127.0.0.1:8786", "tcp://127.0.0.1:8786"),
        ("tcp://localhost:1", "tcp://localhost:1"),
        ("file.json", "tcp://127.0.0.1:5"),
        ("by_tls/file.json", "tls://10.0.0.7:5"),
        ("tcp://10.0.0.7:8786", None),
        ("tls://10.0.0.7:8786", None),
        ("tls://127.0.0.1:8786", None),
        ("cluster:8786", None),
        ("none.json", None),
    ],
)
def test_only_schedulers_of_this_machine_or_with_a_certificate_are_joined(
    scheduler, address, tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    Path("file.json").write_text(json.dumps({"address": "tcp://127.0.0.1:5"}))
    Path("by_tls").mkdir()
    Path("by_tls/file.json").write_text(json.dumps({"address": "tls://10.0.0.7:5"}))
    Path("by_tls/tls.pem").touch()
    if address:
        assert address_of(scheduler)[0] == address
    else:
        with pytest.raises(EngineError):
            address_of(scheduler)


def test_a_campaign_in_parts_is_the_same_and_goes_on(tmp_path, monkeypatch):
    words = ["+experiment=evaluate", "controller=coast", "monte_carlo.num_cases=20", "stages=[evaluate]"]
    whole, parted = tmp_path / "whole", tmp_path / "parted"
    assert main([*words, f"hydra.run.dir={whole}"]) == 0
    written, write = [], tables.write_parquet

    def write_two(path, columns):
        if len(written) == 2:
            raise KeyboardInterrupt
        written.append(path)
        write(path, columns)

    monkeypatch.setattr(tables, "write_parquet", write_two)
    in_parts = [*words, "engine.part_cases=6", f"hydra.run.dir={parted}"]
    assert main(in_parts) == 130
    before = [path.stat().st_mtime_ns for path in written]
    monkeypatch.undo()
    kept = []
    monkeypatch.setattr(
        tables, "join_parquet",
        lambda path, parts, join=tables.join_parquet: (
            kept.extend(part.stat().st_mtime_ns for part in parts), join(path, parts),
        ),
    )  # fmt: skip
    assert main([f"resume={parted}"]) == 0
    assert kept[:2] == before
    assert len(kept) == 4
    assert (whole / artifacts.EPISODES).read_bytes() == (parted / artifacts.EPISODES).read_bytes()
    assert not (parted / artifacts.TRAJECTORIES).exists()
    assert not (parted / artifacts.EPISODE_PARTS).exists()
