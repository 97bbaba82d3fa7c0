"""Faults of a machine, really brought about: each ends in a sentence, and what was finished stands.

Killed runs end as undisturbed ones; `python -m benchmarks kills` tries more kinds, and for longer.
"""

import os
import random
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from pipeline.command_line.cli import main
from pipeline.run import artifacts, manifests
from tests.hostile import faults, kills
from tests.pipeline.command_line.cases import FLY, use_stages
from tests.places import PROJECT

pytestmark = pytest.mark.slow

mounting = pytest.mark.skipif(not faults.may_mount(), reason="only root mounts disks")


def words(folder: Path) -> list[str]:
    """What a run is started with that writes many starts."""
    many = ("telemetry.record_training=true", "starts=random", "starts.num_cases=2000")
    return [*FLY, "stages=[scenario]", *many, f"hydra.run.dir={folder}"]


@pytest.fixture
def refused(ran, monkeypatch):
    """Expect a run in a folder, perhaps with another stage, to be refused in a sentence of some words."""

    def expect(folder, *sentences, **stages):
        with monkeypatch.context() as patched:
            if stages:
                use_stages(patched, **stages)
            said = ran(*words(folder), code=2).err
        assert [part for part in sentences if part not in said] == []

    return expect


@pytest.fixture(scope="module")
def alone(tmp_path_factory):
    """A run that nothing befell."""
    folder = tmp_path_factory.mktemp("runs") / "alone"
    assert main(words(folder)) == 0
    return manifests.read(folder)["sha256"]


def goes_on(folder: Path, alone: dict[str, str]) -> None:
    """Go on with a run, or begin it anew where nothing was kept; it ends as one left alone."""
    again = [f"resume={folder}"] if folder.is_dir() and artifacts.holds_run(folder) else words(folder)
    assert main(again) == 0
    assert manifests.read(folder)["sha256"] == alone
    assert not list(folder.rglob(".*"))


@mounting
@pytest.mark.parametrize("kibibytes", [4, 8, 16, 24, 64, 120])
def test_a_full_disk(kibibytes, alone, tmp_path, refused):
    with faults.small_disk(tmp_path / "disk", kibibytes) as change:
        folder = tmp_path / "disk" / "run"
        refused(folder, "No space left on device", "make room")
        assert change("size=16m")
        goes_on(folder, alone)


@mounting
def test_a_disk_that_nobody_may_write_to(alone, tmp_path, refused):
    with faults.small_disk(tmp_path / "disk", 16384) as change:
        folder = tmp_path / "disk" / "run"
        assert change("ro")
        refused(folder, "(Read-only file system); choose one that can be written to")
        assert change("rw")
        refused(folder, "Read-only file system", scenario=lambda _experiment, _folder: change("ro"))
        assert change("rw")
        goes_on(folder, alone)


def test_a_folder_that_may_not_be_written_to(tmp_path):
    tmp_path.chmod(0o555)
    command = [*faults.without_privilege(), sys.executable, "-m", "pipeline", *words(tmp_path / "run")]
    ended = subprocess.run(command, cwd=PROJECT, capture_output=True, text=True, check=False)  # noqa: S603
    assert ended.returncode == 2
    assert "cannot be a run's folder (Permission denied)" in ended.stderr
    assert "Traceback" not in ended.stderr
    assert not list(tmp_path.iterdir())


def test_a_folder_that_is_deleted_under_a_run(alone, tmp_path, refused):
    folder = tmp_path / "run"
    sentence = f"{folder} has been deleted or moved while the run was at work"
    refused(folder, sentence, scenario=lambda _experiment, folder: shutil.rmtree(folder))
    assert not folder.exists()
    goes_on(folder, alone)


def test_more_memory_than_there_is(alone, tmp_path, refused):
    folder = tmp_path / "run"
    sentence = "there is not enough memory for this; lower monte_carlo.num_cases"
    # at once: after thousands of small grants the interpreter itself may die for want of a stack
    refused(folder, sentence, scenario=lambda _experiment, _folder: np.empty(2**50, np.uint8))
    goes_on(folder, alone)


def test_two_first_starts_at_once(alone, tmp_path):
    command, streams = (
        [sys.executable, "-m", "pipeline", *words(tmp_path / "run")],
        {"stderr": subprocess.PIPE},
    )
    both = [subprocess.Popen(command, cwd=PROJECT, text=True, **streams) for _ in range(2)]  # noqa: S603
    ends = [(process.communicate()[1], process.returncode) for process in both]
    assert all(code == 0 or (code == 2 and "is held by" in said) for said, code in ends)
    assert 0 in [code for _, code in ends]
    assert manifests.read(tmp_path / "run")["sha256"] == alone


def test_a_clock_that_is_set_back(alone, tmp_path, monkeypatch, ran):
    folder = tmp_path / "run"
    assert main(words(folder)) == 0
    # as if the run, its folder and its lock were of tomorrow
    (folder / ".lock").write_text('{"process": 1, "host": "here", "since": "2999-01-01 00:00:00 UTC"}')
    for path in (folder, *folder.rglob("*")):
        os.utime(path, (time.time() + 86400.0,) * 2)
    use_stages(monkeypatch)
    errors = ran(f"hydra.run.dir={folder}", "stages=[scenario]").err
    assert "since 2999-01-01 00:00:00 UTC, which is gone" in errors


@pytest.mark.parametrize(("kind", "is_relative", "seed"), [("search", True, 3), ("sweep", False, 14)])
def test_a_killed_run_ends_as_an_undisturbed_one(kind, is_relative, seed, tmp_path):
    """By SIGKILL of its group, or Ctrl-C, when it has half done."""
    env = kills.environment()
    seconds = kills.run_alone(kills.words_of(kind, tmp_path / "alone"), env)
    folder = Path("run") if is_relative else tmp_path / "run"
    tally = kills.Tally()
    kills.survive(kind, folder, seconds, random.Random(seed), tally, tmp_path)  # noqa: S311
    assert tally.lost == []
    assert kills.differences(tmp_path / "run", tmp_path / "alone") == []


@pytest.mark.parametrize("how", [(signal.SIGTERM, kills.PROCESS), (signal.SIGINT, kills.GROUP)])
def test_a_stopped_run_leaves_no_traceback(how, tmp_path):
    words = kills.words_of("parts", Path("run"))
    was_stopped, code, said = kills.killed_after(words, 1.0, how, kills.environment(), tmp_path)
    assert was_stopped
    assert code in (130, 143, -signal.SIGTERM, -signal.SIGINT), said
    assert "Traceback" not in said
    assert os.listdir(tmp_path) in ([], ["run"])
