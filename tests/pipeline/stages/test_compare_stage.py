"""Controllers side by side, in miniature: the same cases for all, rows, files, what is said."""

import csv
import json
from dataclasses import replace

import numpy as np
import pytest

from pipeline.controllers.source import load, named
from pipeline.evaluation.comparison import HEADER, concatenate, row_of
from pipeline.evaluation.contenders import label_of
from pipeline.evaluation.monte_carlo import summarise
from pipeline.flight.fly.simulation import fly_all
from pipeline.run import artifacts, tables
from pipeline.scenarios import evaluation_scenarios
from pipeline.settings.places import conf_folder
from pipeline.stages import compare
from tests.pipeline.stages.cases import composed, prepared

pytestmark = pytest.mark.slow

CONTROLLERS = ["coast", "lqr", "receding_horizon", "paper"]
SHORT = (f"compare.controllers=[{','.join(CONTROLLERS)}]", "monte_carlo.num_cases=4", "seed=7")


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    folder = tmp_path_factory.mktemp("compared")
    run = prepared(folder, *SHORT, experiment="baselines")
    compare.run(run.experiment, folder)
    return run.experiment, folder


def rows_in(folder):
    return [row_of(entry) for entry in artifacts.read_json(folder, artifacts.COMPARISON)["rows"]]


def test_a_row_for_each_controller_sun_and_layer(finished):
    _, folder = finished
    rows = rows_in(folder)
    expected = [(s, c, g) for s in ("fixed", "random") for c in CONTROLLERS for g in ("none", "filter")]
    assert [(row.sun, row.controller, row.safety) for row in rows] == expected
    assert {row.controller: row.rules for row in rows} == dict.fromkeys(CONTROLLERS) | {"paper": 75}
    # the layer is on where a row says so
    acted = {row.safety: row.summary["safety_periods"]["mean"] for row in rows}
    assert acted["none"] == 0.0
    assert all(not row.summary["violated"]["count"] for row in rows if row.safety == "filter")


def test_all_fly_the_same_cases_and_each_as_alone(finished):
    experiment, folder = finished
    episodes = tables.read_parquet(folder, artifacts.COMPARISON_EPISODES)
    assert len(episodes["case"]) == 2 * len(CONTROLLERS) * 2 * 4
    for sun in ("fixed", "random"):
        scenarios = evaluation_scenarios(replace(experiment, sun=replace(experiment.sun, mode=sun)))
        for name in CONTROLLERS:
            is_same = (
                (episodes["sun"] == sun) & (episodes["controller"] == name) & (episodes["safety"] == "none")
            )
            part = {key: column[is_same] for key, column in episodes.items()}
            np.testing.assert_array_equal(part["position_x_m"], [s.position_m[0] for s in scenarios])
            np.testing.assert_array_equal(part["sun_angle_rad"], [s.sun_angle_rad for s in scenarios])
            source = composed(f"controller={name}", experiment="evaluate").experiment.controller
            alone = fly_all(experiment.mission, load(source, experiment.mission), scenarios, 2)
            np.testing.assert_array_equal(part["delta_v_m_s"], alone.delta_v_m_s)
            np.testing.assert_array_equal(part["inspected_count"], alone.inspected_count)
            (row,) = [r for r in rows_in(folder) if (r.sun, r.controller, r.safety) == (sun, name, "none")]
            assert row.summary == json.loads(json.dumps(summarise(part, 95.0)))


def test_the_table_as_csv(finished):
    _, folder = finished
    with (folder / artifacts.COMPARISON_TABLE).open() as stream:
        lines = list(csv.DictReader(stream))
    assert tuple(lines[0]) == HEADER
    episodes = tables.read_parquet(folder, artifacts.COMPARISON_EPISODES)
    for line, row in zip(lines, rows_in(folder), strict=True):
        is_same = np.all([episodes[key] == line[key] for key in ("controller", "sun", "safety")], axis=0)
        assert row.summary["delta_v_m_s"]["mean"] == pytest.approx(
            episodes["delta_v_m_s"][is_same].mean(), abs=1e-12
        )
        assert row.summary["success"]["fraction"] == pytest.approx(episodes["success"][is_same].mean())
        assert (line["controller"], line["sun"], line["safety"]) == (row.controller, row.sun, row.safety)
        for kind in ("mean", "standard_deviation"):
            assert float(line[f"delta_v_m_s_{kind}"]) == row.summary["delta_v_m_s"][kind]
        assert float(line["success_fraction"]) == row.summary["success"]["fraction"]
    assert lines[0]["rules"] == lines[0]["times_optimum_mean"] == ""


def test_what_is_said(tmp_path, capsys):
    output = compared(tmp_path, capsys, "compare.suns=[random]")
    assert "receding_horizon, Sun random, safety filter: 4 cases in" in output
    assert "not beside plans of least fuel: duration_s is 300.0 here, and 3600.0 where" in output
    table = output[output.index("\nSun random\n") :].splitlines()
    assert table[2].split()[:3] == ["controller", "rules", "delta-v"]
    assert [line.split()[0] for line in table[3:7]] == CONTROLLERS
    assert "the paper" not in output  # whose flights are longer
    assert "4 cases of seed 7; mean ± standard deviation; shares with 95 % Wilson intervals" in output
    assert "Sun fixed" not in output


def compared(folder, capsys, *words):
    """Compare in miniature, and return what is said."""
    compare.run(prepared(folder, *SHORT, *words, experiment="baselines").experiment, folder)
    return capsys.readouterr().err


def test_without_the_layer_or_with_it_alone(tmp_path, capsys):
    for layer in ("none", "filter"):
        output = compared(tmp_path, capsys, f"compare.safety=[{layer}]")
        assert ("layer: outside" in output) == (layer == "filter")
        assert {row.safety for row in rows_in(tmp_path)} == {layer}


def test_beside_the_plans_that_ship_and_the_paper(tmp_path, capsys):
    overrides = ("duration_s=3600.0", "compare.controllers=[natural_motion]", "compare.safety=[none]")
    run = prepared(tmp_path, *overrides, "monte_carlo.num_cases=2", experiment="baselines").experiment
    compare.run(run, tmp_path)
    paper, fixed, optimum, *_ = rows_in(tmp_path)
    assert (paper.controller, paper.source, paper.sun, paper.times) == ("the paper", "published", "", None)
    assert paper.summary["delta_v_m_s"] == {"mean": 5.62, "standard_deviation": 0.715}
    assert paper.summary["inspection_rate_percent"]["mean"] == 96.667
    with (tmp_path / artifacts.COMPARISON_TABLE).open() as stream:
        line = next(csv.DictReader(stream))
    assert line["success_fraction"] == line["rules"] == ""
    printed = capsys.readouterr().err
    assert all(words in printed for words in ("the paper*", "5.620 ± 0.715", "96.67 ± 3.92"))
    assert (optimum.source, optimum.num_cases) == ("plans of least fuel", 50)
    assert optimum.summary["delta_v_m_s"]["mean"] == pytest.approx(0.13102740264909443, rel=1e-12)
    assert optimum.summary["success"]["fraction"] == 1.0
    assert optimum.summary["violated"]["count"] == 0
    assert fixed.times["num_cases"] == 50
    # one burn, however well it is chosen, cannot do with less than plans of least fuel where it succeeds
    assert fixed.times["times_optimum"]["mean"] > 1.0


def test_a_column_that_few_rows_have_is_nan_in_the_others(finished):
    _, folder = finished
    row = rows_in(folder)[1]
    flown = {"delta_v_m_s": np.ones(row.num_cases)}
    together = concatenate([(row, flown), (row, flown | {"propellant_kg": np.full(row.num_cases, 0.2)})])
    assert np.isnan(together["propellant_kg"][: row.num_cases]).all()
    assert (together["propellant_kg"][row.num_cases :] == 0.2).all()


def test_two_files_of_one_name_are_told_apart():
    names = ["lqr", "a/mine.yaml", "b/mine.yaml", "c/other.csv"]
    assert [label_of(name, names) for name in names] == ["lqr", "a/mine.yaml", "b/mine.yaml", "other"]


def test_an_edited_file_is_not_called_as_the_champion_it_was(tmp_path):
    shipped, path = conf_folder() / "controller" / "champion_27.yaml", tmp_path / "champion_27.yaml"
    text = shipped.read_text(encoding="utf-8")
    path.write_text(text.replace("coast_below_points: 1.5", "coast_below_points: 2.5"), encoding="utf-8")
    names = ["champion_27", str(path)]
    words = f"compare.controllers=[{','.join(names)}]", "monte_carlo.num_cases=1", "compare.safety=[none]"
    experiment = composed(*words, experiment="baselines").experiment
    lot = compare.Lot(experiment, "", evaluation_scenarios(experiment), None)
    rows = [compare.fly_rows(lot, name, named(name, experiment.mission)) for name in names]
    assert [row.controller for ((row, _),) in rows] == ["champion_27", f"{path}, edited"]
