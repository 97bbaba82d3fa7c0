"""What runs keep while they are at work: interrupts, lines on progress, parts of a campaign."""

import subprocess
import sys

import pytest

from pipeline.command_line.cli import main
from pipeline.run import artifacts, progress, tables
from pipeline.run.progress import Progress
from tests.places import PROJECT

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
    told = capsys.readouterr().err.splitlines()
    assert told[:2] == ["  solved 3/10, case 3, 14 s left", "  solved 9/10, case 9, 1 s left"]
    assert told[2:] == ["  solved 10/10, case 10, 0 s left"]
    # what was done before is counted from what is shown first
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


def test_a_campaign_in_parts_is_the_same_and_goes_on(tmp_path, monkeypatch):
    words = ["+experiment=evaluate", "controller=coast", "monte_carlo.num_cases=20", "stages=[evaluate]"]
    whole, parted = tmp_path / "whole", tmp_path / "parted"
    assert main([*words, f"hydra.run.dir={whole}"]) == 0
    written, room, write = [], 2, tables.write_parquet

    def write_some(path, columns):
        if len(written) == room:
            raise KeyboardInterrupt
        written.append(path)
        write(path, columns)

    monkeypatch.setattr(tables, "write_parquet", write_some)
    assert main([*words, "engine.part_cases=6", f"hydra.run.dir={parted}"]) == 130
    room = 9
    assert main([f"resume={parted}"]) == 0
    # four parts, none of them twice, and the comparison with the optimum
    assert len(set(written)) == len(written) == 5
    assert (whole / artifacts.EPISODES).read_bytes() == (parted / artifacts.EPISODES).read_bytes()
    assert not (parted / artifacts.TRAJECTORIES).exists()
    assert not (parted / artifacts.EPISODE_PARTS).exists()
