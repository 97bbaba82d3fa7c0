"""The stage end to end: plans that fly, tables, determinism, what is kept, what is refused."""

from pathlib import Path

import numpy as np
import pytest

from pipeline.command_line.cli import main
from pipeline.controllers import source
from pipeline.evaluation.monte_carlo import fly_cases
from pipeline.flight.cases.starts import evaluation_scenarios, given_start
from pipeline.flight.control.controller import open_loop
from pipeline.flight.fly.simulation import fly_all
from pipeline.flight.state.log import Scenario
from pipeline.optimum.bound import delta_v_bound
from pipeline.optimum.problem import problem_of
from pipeline.optimum.solved import HARDER_FOLDERS, SHIPPED_FOLDERS, summarise
from pipeline.run import artifacts, tables
from pipeline.run.runner import run_stages
from pipeline.settings.experiment import SettingError
from tests.pipeline.optimum.cases import composed

SMALL = ("optimum.points=60", "optimum.restarts=2", "optimum.kicks=1", "sun=random")


def solved(folder: Path, *overrides: str) -> Path:
    run = composed(*overrides)
    run_stages(run.experiment, run.config, folder)
    return folder


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return solved(tmp_path_factory.mktemp("optimum"), *SMALL, "optimum.workers=1")


def plans_in(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in sorted((folder / artifacts.OPTIMUM_PLANS).iterdir())}


@pytest.mark.slow
def test_plans_fly_as_the_table_says(folder):
    experiment = composed(*SMALL).experiment
    cases = tables.read_parquet(folder, artifacts.OPTIMUM_CASES)
    scenarios = evaluation_scenarios(experiment.monte_carlo, experiment.sun, experiment.seed)
    assert cases["case"].tolist() == [0, 1]
    for case, scenario in enumerate(scenarios):
        path = folder / artifacts.OPTIMUM_PLANS / f"case-{case:04d}.csv"
        controller = source.load({"kind": "open_loop", "path": str(path)}, experiment.mission)
        episodes, _ = fly_cases(experiment.mission, controller, [scenario])
        assert episodes["success"].shape == (1,)
        assert cases["is_feasible"][case]
        assert not episodes["violated"][0]
        assert cases["inspected_count"][case] == episodes["inspected_count"][0] >= 60
        for name in (
            "delta_v_m_s",
            "inspection_rate_percent",
            "mean_distance_m",
            "min_distance_m",
            "max_distance_m",
        ):
            assert cases[name][case] == pytest.approx(episodes[name][0], rel=1e-12)
        assert cases["delta_v_bound_m_s"][case] <= cases["delta_v_m_s"][case]


@pytest.mark.slow
def test_the_forces_of_all_cases_are_in_one_table(folder):
    lines = (folder / artifacts.OPTIMUM_FORCES).read_text().splitlines()
    assert lines[0] == "case,time_s,force_x_n,force_y_n,force_z_n"
    rows = np.array([[float(cell) for cell in line.split(",")] for line in lines[1:]])
    cases = tables.read_parquet(folder, artifacts.OPTIMUM_CASES)
    for case in (0, 1):
        spent = np.abs(rows[rows[:, 0] == case, 2:]).sum() * 10.0 / 12.0
        assert spent == pytest.approx(cases["delta_v_m_s"][case], rel=1e-12)
    assert np.abs(rows[:, 2:]).max(axis=1).min() > 0


@pytest.mark.slow
def test_cases_that_are_there_are_kept_and_others_are_made_again_by_any_workers(folder, tmp_path, capsys):
    plans, table = plans_in(folder), (folder / artifacts.OPTIMUM_CASES).read_bytes()
    (tmp_path / artifacts.OPTIMUM_PLANS).mkdir(parents=True)
    (tmp_path / artifacts.OPTIMUM_CASES).write_bytes(table)
    (tmp_path / artifacts.OPTIMUM_PLANS / "case-0000.csv").write_bytes(plans["case-0000.csv"])
    solved(tmp_path, *SMALL, "optimum.workers=2")
    assert "1 of 2 cases are there already" in capsys.readouterr().err
    assert plans_in(tmp_path) == plans
    assert (tmp_path / artifacts.OPTIMUM_CASES).read_bytes() == table


@pytest.mark.slow
def test_cases_of_other_starts_are_not_kept(folder, tmp_path, capsys):
    (tmp_path / artifacts.OPTIMUM_PLANS).mkdir(parents=True)
    (tmp_path / artifacts.OPTIMUM_CASES).write_bytes((folder / artifacts.OPTIMUM_CASES).read_bytes())
    for name, content in plans_in(folder).items():
        (tmp_path / artifacts.OPTIMUM_PLANS / name).write_bytes(content)
    solved(tmp_path, *SMALL[:-1], "sun=fixed", "optimum.points=20")
    assert "are there already" not in capsys.readouterr().err


@pytest.mark.slow
def test_where_time_is_too_short_the_best_there_is_is_kept_and_not_called_a_plan(tmp_path, capsys):
    solved(
        tmp_path,
        "duration_s=300.0",
        "optimum.points=95",
        "optimum.restarts=1",
        "optimum.kicks=0",
        "optimum.cases=start",
    )
    cases = tables.read_parquet(tmp_path, artifacts.OPTIMUM_CASES)
    start = given_start(composed().experiment.mission.deputy, composed().experiment.sun, 1)
    assert cases["position_x_m"].tolist() == [start.position_m[0]]
    assert cases["is_feasible"].tolist() == [False]
    assert 0 < cases["inspected_count"][0] < 95
    summary = artifacts.read_json(tmp_path, artifacts.OPTIMUM_SUMMARY)
    assert summary["num_feasible"] == 0
    assert "delta_v_m_s" not in summary
    assert "case 0 has no plan" in capsys.readouterr().err
    assert (tmp_path / artifacts.OPTIMUM_PLANS / "case-0000.csv").exists()


@pytest.mark.slow
def test_more_points_than_there_are_are_refused_before_a_folder_is_made(tmp_path, capsys):
    words = ["+experiment=optimum", "optimum.points=100", f"hydra.run.dir={tmp_path / 'run'}"]
    assert main(words) == 2
    assert (
        "optimum.points is 100, but the chief has 99 points; ask for at most as many"
        in capsys.readouterr().err
    )
    assert not (tmp_path / "run").exists()


def row(**changes):
    return {
        "is_feasible": True,
        "delta_v_m_s": 0.2,
        "delta_v_bound_m_s": 0.1,
        "restarts_agreeing": 2,
    } | changes


@pytest.mark.slow
def test_the_summary_counts_feasible_cases_alone():
    summary = summarise([row(), row(delta_v_m_s=0.4, restarts_agreeing=1), row(is_feasible=False)])
    assert (summary["num_cases"], summary["num_feasible"], summary["cases_found_more_than_once"]) == (3, 2, 1)
    assert summary["delta_v_m_s"] == pytest.approx(
        {"mean": 0.3, "standard_deviation": 0.2 / 2**0.5, "median": 0.3, "max": 0.4}
    )


@pytest.mark.slow
@pytest.mark.parametrize(
    ("override", "told"),
    [
        ("optimum.burns=6", "optimum.burns is 6; it must be from 2 to 5"),
        ("optimum.cases=all", "optimum.cases is 'all'; it must be one of evaluation, start"),
    ],
)
def test_what_cannot_be_asked_is_refused_in_a_sentence(override, told):
    with pytest.raises(SettingError) as refused:
        composed(override)
    assert told in str(refused.value)


FOLDERS = [(folder, 95) for folder in SHIPPED_FOLDERS.values()]
FOLDERS += [
    (folder, points)
    for harder in HARDER_FOLDERS.values()
    for folder, points in zip(harder, (98, 99), strict=True)
]


@pytest.mark.parametrize(("folder", "asked"), FOLDERS, ids=lambda value: getattr(value, "name", value))
def test_every_plan_flies_as_its_table_says(folder, asked):
    mission = composed().experiment.mission
    assert mission.attitude.mode == "flown"
    cases = tables.read_parquet(folder, artifacts.OPTIMUM_CASES)
    fired = np.genfromtxt(folder / artifacts.OPTIMUM_FORCES, delimiter=",", skip_header=1)
    for row, case in enumerate(cases["case"].tolist()):
        forces = np.zeros((mission.num_controls, 3))
        own = fired[fired[:, 0] == case]
        forces[np.rint(own[:, 1] / mission.control_period_s).astype(int)] = own[:, 2:]
        position = np.array([cases[f"position_{axis}_m"][row] for axis in "xyz"])
        start = Scenario(position, np.zeros(3), float(cases["sun_angle_rad"][row]))
        outcome = fly_all(mission, open_loop("plan", forces), [start], workers=1)
        assert outcome.delta_v_m_s[0] == pytest.approx(cases["delta_v_m_s"][row], rel=1e-9)
        assert outcome.inspected_count[0] == cases["inspected_count"][row] >= asked
        assert not outcome.is_violated[0]
    assert cases["is_feasible"].all()
    assert len(cases["case"]) == 50


def test_bounds_in_the_table_are_those_of_the_cases():
    cases = tables.read_parquet(SHIPPED_FOLDERS["random"], artifacts.OPTIMUM_CASES)
    position = np.array([cases[f"position_{axis}_m"][3] for axis in "xyz"])
    start = Scenario(position, np.zeros(3), float(cases["sun_angle_rad"][3]))
    problem = problem_of(composed().experiment.mission, start)
    bound = delta_v_bound(problem, 95, float(cases["delta_v_m_s"][3]))
    assert bound == pytest.approx(cases["delta_v_bound_m_s"][3], rel=1e-9)
