"""Rows of the leaderboard: intervals over starts for one controller, over trainings for a learner."""

import json
from itertools import product

import numpy as np
import pytest
from scipy import stats

from benchmarks import contenders, evolved, leaderboard
from pipeline.controllers.learned import answer
from pipeline.controllers.policies import read_policy
from pipeline.evaluation.monte_carlo import SUCCESS
from pipeline.gym import InspectionEnv

#: acting in a short flight that may leave the limits
TINY = {"words": ("deputy.max_force_n=2",), "decision_period_s": 60.0, "num_starts": 2}


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
    scattered = [leaderboard.figures_of(judged(*row)) for row in ((0.1, 0.0), (0.9, 0.0))]
    assert leaderboard.over_trainings(scattered)["delta_v_m_s"][1] == 0.0  # no less can be burnt


def test_without_a_learners_library_the_cure_is_told(monkeypatch, capsys):
    monkeypatch.setattr(leaderboard, "find_spec", lambda name: None if name == "stable_baselines3" else name)
    with pytest.raises(SystemExit):
        leaderboard.main([])
    assert "pip install stable-baselines3" in capsys.readouterr().err


def test_a_new_folder_keeps_what_was_judged_and_nothing_is_judged_again(tmp_path, capsys, monkeypatch):
    folder = tmp_path / "new" / "leaderboard"
    words = ["--folder", str(folder), "--seeds", "0", "--cases", "4", "-c", "lqr"]
    assert leaderboard.main(words) == 0
    table = capsys.readouterr().out
    (kept,) = json.loads((folder / "rows.json").read_text(encoding="utf-8"))
    assert leaderboard.cell(kept["figures"], "delta_v_m_s") in table
    monkeypatch.setattr(leaderboard, "judge", None)
    assert leaderboard.main(words) == 0
    assert capsys.readouterr().out == table


@pytest.mark.slow
def test_a_training_is_kept_with_what_it_took_and_goes_on_where_it_ended(tmp_path, capsys, monkeypatch):
    """A budget is kept, of two kinds of training; what they took is in their files."""
    words = ["--folder", str(tmp_path), "--cases", "4", "-c", "lqr", "--budget", "1.5e5", "--seeds", "2"]
    words += ["-l", "cma_es", "-l", "rules", "--picture", str(tmp_path / "curves.png")]
    assert leaderboard.main(words) == 0
    table = capsys.readouterr().out
    rows = json.loads((tmp_path / "rows.json").read_text(encoding="utf-8"))
    policies = [row for row in rows if row["name"] == "cma_es"]
    assert len(policies) > 2
    for name in ("cma_es", "rules"):
        assert [row["seed"] for row in rows if row["name"] == name and row["is_last"]] == [1, 2]
    assert all(0 < row["periods"] <= 150_000 and row["processor_s"] > 0.0 for row in rows if "budget" in row)
    assert len({row["sha256"] for row in rows if row.get("is_last")}) == 4
    champion = json.loads((tmp_path / "rules-150000-1" / "training.json").read_text(encoding="utf-8"))
    assert champion["done"] == rows[-2]["periods"]
    assert "2 trainings" in table
    assert (tmp_path / "curves.png").read_bytes().startswith(b"\x89PNG")
    cut_off = [
        row for row in rows if not (row.get("seed") == 2 and row["name"] == "cma_es" and row["is_last"])
    ]
    (tmp_path / "rows.json").write_text(json.dumps(cut_off), encoding="utf-8")
    assert leaderboard.main(words) == 0
    again = json.loads((tmp_path / "rows.json").read_text(encoding="utf-8"))
    keys = ("name", "seed", "sha256", "periods")
    assert {tuple(row.get(key) for key in keys) for row in again} == {
        tuple(row.get(key) for key in keys) for row in rows
    }
    assert len(again) == len(rows)


def test_a_contender_tries_as_many_settings_as_any_other():
    assert contenders.VARIANTS.keys() == contenders.CONTENDERS.keys()
    assert len({len(tried) for tried in contenders.VARIANTS.values()}) == 1


def test_what_evolves_flies_as_the_file_that_is_written(tmp_path):
    """The forces of candidates are those that the written policy answers, with silence, at the limits too."""
    settings = evolved.Settings(hidden=4, silent=0.1, **TINY)
    training = evolved.Evolution(tmp_path, settings, seed=3, budget=30_000, words=("duration_s=300",))
    pilot = read_policy(training.run()).pilot
    rng = np.random.default_rng(1)
    weights = rng.normal(0.0, 3.0, (1, evolved.num_weights(4)))
    mean, spread = rng.normal(0.0, 1.0, (2, 19))
    flights = evolved.Flights(training.task, settings, 1, 1)
    path = training.write(weights[0], (mean, np.abs(spread)), flights, "given")
    pilot = read_policy(path).pilot
    seen, forces = rng.normal(0.0, 2.0, (40, 19)), np.empty((40, 3))
    answer(pilot.network, seen, np.zeros((2, 19)), forces)
    acts = evolved.shares(evolved.layers_of(weights, 4), ((seen - mean) / np.abs(spread))[np.newaxis], 0.1)
    most = flights.task.mission.deputy.max_force_n
    np.testing.assert_allclose(forces, acts[0] * most, atol=2e-5 * most)
    assert np.abs(acts).max() == pytest.approx(0.9)
    assert (acts == 0.0).any()


def test_what_a_flight_is_paid_is_what_the_environment_pays(tmp_path):
    """Candidates' returns are the sums of the rewards of `InspectionEnv` for the same acts, less the fuel."""
    settings = evolved.Settings(hidden=0, silent=0.0, **TINY)
    task = evolved.Evolution(tmp_path, settings, words=("duration_s=300",)).task
    flights = evolved.Flights(task, settings, 2, 3)
    weights = np.random.default_rng(2).normal(0.0, 1.0, (2, evolved.num_weights(0)))
    layers, scaling = evolved.layers_of(weights, 0), (np.zeros(19), task.scales)
    returns, _ = flights.fly(layers, scaling, seed=7, price=0.5)
    generator, periods = np.random.default_rng(7), 0
    starts = [task.draw(generator) for _ in range(3)]
    env = InspectionEnv([*TINY["words"], "duration_s=300"], task.reward, decision_period_s=60.0)
    for candidate, start in product(range(2), range(3)):
        seen, _ = env.reset(options={"scenario": starts[start]})
        total, is_over = 0.0, False
        while not is_over:
            matrix, added = layers[0][0][candidate], layers[0][1][candidate]
            act = np.clip(matrix @ (seen.astype(np.float64) / task.scales) + added, -1.0, 1.0)
            seen, reward, terminated, truncated, facts = env.step(act)
            total, is_over = total + reward, terminated or truncated
        assert returns[candidate, start] == pytest.approx(total - 0.5 * facts["delta_v_m_s"], abs=1e-5)
        periods += env.num_flown
    assert flights.num_periods == periods
    assert flights.num_flights == 6
