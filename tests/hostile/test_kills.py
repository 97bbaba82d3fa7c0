"""Killed runs end as undisturbed ones; `python -m benchmarks kills` tries more kinds, and for longer."""

import os
import random
import signal
from pathlib import Path

import pytest

from tests.hostile import kills

pytestmark = pytest.mark.slow


@pytest.mark.parametrize(("kind", "is_relative", "seed"), [("search", True, 3), ("sweep", False, 14)])
def test_a_killed_run_ends_as_an_undisturbed_one(kind, is_relative, seed, tmp_path):
    """By SIGKILL of its group, or Ctrl-C, when it has half done."""
    env = kills.environment()
    seconds = kills.run_alone(kills.words_of(kind, tmp_path / "alone"), env)
    folder = Path("run") if is_relative else tmp_path / "run"
    tally = kills.Tally()
    kills.survive(kind, folder, seconds, random.Random(seed), tally, tmp_path, is_cold=False)  # noqa: S311
    assert tally.lost == []
    assert kills.differences(tmp_path / "run", tmp_path / "alone") == []


@pytest.mark.parametrize("how", [(signal.SIGTERM, kills.PROCESS), (signal.SIGINT, kills.GROUP)])
def test_a_stopped_run_leaves_no_traceback(how, tmp_path):
    words = kills.words_of("parts", Path("run"))
    was_stopped, code, said = kills.killed_after(words, 1.0, how, kills.environment(), tmp_path)
    assert was_stopped
    assert code in (130, -signal.SIGTERM, -signal.SIGINT), said
    assert "Traceback" not in said
    assert os.listdir(tmp_path) in ([], ["run"])
