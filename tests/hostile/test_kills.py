"""Killed runs end as undisturbed ones; `python -m benchmarks kills` tries more kinds, and for longer."""

import os
import random
import signal
from pathlib import Path

import pytest

from tests.hostile import kills
from tests.hostile.kills import GROUP, PROCESS, Tally, environment, killed_after, run_alone, words_of

pytestmark = pytest.mark.slow


@pytest.mark.parametrize(("kind", "is_relative"), [("search", True), ("sweep", False), ("parts", True)])
def test_a_killed_run_ends_as_an_undisturbed_one(kind, is_relative, tmp_path):
    env = environment()
    run_alone(words_of(kind, tmp_path / "alone"), env)
    seconds = run_alone(words_of(kind, tmp_path / "again"), env)
    assert kills.differences(tmp_path / "again", tmp_path / "alone") == []
    folder = Path("run") if is_relative else tmp_path / "run"
    tally = Tally()
    kills.survive(kind, folder, seconds, random.Random(5), tally, tmp_path, is_cold=False)  # noqa: S311
    assert tally.lost == []
    assert kills.differences(tmp_path / "run", tmp_path / "alone") == []


@pytest.mark.parametrize("how", [(signal.SIGTERM, PROCESS), (signal.SIGINT, GROUP)])
def test_a_stopped_run_leaves_no_traceback(how, tmp_path):
    words = words_of("parts", Path("run"))
    was_stopped, code, said = killed_after(words, 1.0, how, environment(), tmp_path)
    assert was_stopped
    assert code in (130, -signal.SIGTERM, -signal.SIGINT), said
    assert "Traceback" not in said
    assert os.listdir(tmp_path) in ([], ["run"])
