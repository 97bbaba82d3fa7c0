"""Rows of the leaderboard: intervals over starts for one controller, over trainings for a learner."""

import json

import numpy as np
import pytest
from scipy import stats

from benchmarks import leaderboard
from pipeline.evaluation.monte_carlo import SUCCESS


def judged(delta_v_m_s, success):
    """As `pipeline.gym.judge.judge` gives it, of a task without known plans."""
    return {
        "figures": {
            "delta_v_m_s": {"mean": delta_v_m_s, "low": delta_v_m_s - 0.1, "high": delta_v_m_s + 0.1},
            SUCCESS: {"fraction": success, "low": success / 2, "high": (1.0 + success) / 2},
        },
        "regret": {"not_compared": "there are none"},
    }


def test_an_interval_over_trainings_is_students_within_what_a_share_can_be():
    each = [leaderboard.figures_of(judged(*row)) for row in ((0.5, 0.9), (0.6, 1.0), (0.8, 0.8))]
    assert each[0][SUCCESS] == pytest.approx((90.0, 45.0, 95.0))
    assert leaderboard.cell(each[0], "delta_v_m_s") == "0.500 (0.400 to 0.600)"
    assert leaderboard.cell(each[0], "regret_m_s") == "-"
    figures = leaderboard.over_trainings(each)
    values = [0.5, 0.6, 0.8]
    low, high = stats.t.interval(0.95, 2, loc=np.mean(values), scale=stats.sem(values))
    assert figures["delta_v_m_s"] == pytest.approx((np.mean(values), low, high))
    assert figures[SUCCESS][2] == 100.0
    assert leaderboard.cell(leaderboard.over_trainings(each[:1]), "delta_v_m_s") == "0.500"


def test_without_a_learners_library_the_cure_is_told(monkeypatch, capsys):
    monkeypatch.setattr(leaderboard, "find_spec", lambda _: None)
    with pytest.raises(SystemExit):
        leaderboard.main([])
    assert "pip install stable-baselines3" in capsys.readouterr().err


def test_a_new_folder_keeps_what_was_judged(tmp_path, capsys):
    folder = tmp_path / "new" / "leaderboard"
    assert leaderboard.main(["--folder", str(folder), "--seeds", "0", "--cases", "4", "-c", "lqr"]) == 0
    table = capsys.readouterr().out
    kept = json.loads((folder / "judged.json").read_text(encoding="utf-8"))
    assert leaderboard.cell(leaderboard.figures_of(*kept), "delta_v_m_s") in table
