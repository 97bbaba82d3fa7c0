"""The stage end to end: plans that fly, tables, determinism, what is kept, what is refused."""

import re
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pipeline.command_line.config import compose_experiment
from pipeline.controllers import source
from pipeline.evaluation import beside_optimum
from pipeline.evaluation.monte_carlo import fly_cases
from pipeline.flight.control.controller import open_loop
from pipeline.flight.fly.simulation import fly_all
from pipeline.optimum import solved as reference
from pipeline.optimum.bound import delta_v_bound
from pipeline.optimum.problem import problem_of
from pipeline.optimum.solved import SHIPPED_FOLDERS, IncomparableError, read_solved, solved_for
from pipeline.run import artifacts, tables, writing
from pipeline.scenarios import evaluation_scenarios, given_start
from pipeline.stages.optimum import kept_rows
from tests.pipeline.optimum.cases import composed
from tests.pipeline.stages.cases import carried_out

pytestmark = pytest.mark.slow

SMALL = ("optimum.points=60", "optimum.restarts=2", "optimum.kicks=1", "sun=random")


#: of plans for small problems
QUICK = ("optimum.points=30", "optimum.restarts=2", "optimum.kicks=0")


def solve(folder: Path, *overrides: str) -> Path:
    carried_out(composed(*overrides), folder)
    return folder


def cases_of(folder: Path) -> dict[str, np.ndarray]:
    return tables.read_parquet(folder, artifacts.OPTIMUM_CASES)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return solve(tmp_path_factory.mktemp("optimum"), *SMALL, "optimum.workers=1")


def plans_in(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in sorted((folder / artifacts.OPTIMUM_PLANS).iterdir())}


def test_plans_fly_as_the_table_says_and_their_forces_are_in_one_table(folder):
    experiment = composed(*SMALL).experiment
    cases = cases_of(folder)
    scenarios = evaluation_scenarios(experiment)
    lines = (folder / artifacts.OPTIMUM_FORCES).read_text().splitlines()
    assert lines[0] == "case,time_s,force_x_n,force_y_n,force_z_n"
    rows = np.array([[float(cell) for cell in line.split(",")] for line in lines[1:]])
    assert np.abs(rows[:, 2:]).max(axis=1).min() > 0
    assert cases["case"].tolist() == [0, 1]
    for case, scenario in enumerate(scenarios):
        path = folder / artifacts.OPTIMUM_PLANS / f"case-{case:04d}.csv"
        controller = source.load({"kind": "open_loop", "path": str(path)}, experiment.mission)
        episodes, _ = fly_cases(experiment.mission, controller, [scenario])
        assert cases["is_feasible"][case]
        assert not episodes["violated"][0]
        assert cases["inspected_count"][case] == episodes["inspected_count"][0] >= 60
        distances = (f"{kind}_distance_m" for kind in ("mean", "min", "max"))
        for name in ("delta_v_m_s", "inspection_rate_percent", *distances):
            assert cases[name][case] == pytest.approx(episodes[name][0], rel=1e-12)
        assert cases["delta_v_bound_m_s"][case] <= cases["delta_v_m_s"][case]
        spent = np.abs(rows[rows[:, 0] == case, 2:]).sum() * 10.0 / 12.0
        assert spent == pytest.approx(cases["delta_v_m_s"][case], rel=1e-12)
        plan = np.loadtxt(path, delimiter=",", skiprows=1, ndmin=2)
        np.testing.assert_array_equal(plan[:, 0], 10.0 * np.arange(len(plan)))
        assert plan[-1, 1:].any() or len(plan) == 1  # a table ends where its plan does
        np.testing.assert_array_equal(rows[rows[:, 0] == case, 1:], plan[plan[:, 1:].any(axis=1)])


def test_cases_that_are_there_are_kept_and_others_are_made_again_by_any_workers(folder, tmp_path, capsys):
    shutil.copytree(folder / "optimum", tmp_path / "optimum")
    table = (folder / artifacts.OPTIMUM_CASES).read_bytes()
    (tmp_path / artifacts.OPTIMUM_PLANS / "case-0001.csv").unlink()
    solve(tmp_path, *SMALL, "optimum.workers=2")
    assert "1 of 2 cases are there already" in capsys.readouterr().err
    assert plans_in(tmp_path) == plans_in(folder)
    assert (tmp_path / artifacts.OPTIMUM_CASES).read_bytes() == table
    # those of other starts are not, be they at other places or moving
    starts = evaluation_scenarios(composed(*SMALL).experiment)
    assert kept_rows(tmp_path, [replace(start, velocity_m_s=np.full(3, 0.01)) for start in starts]) == {}
    solve(tmp_path, *QUICK, "sun=fixed")
    assert "are there already" not in capsys.readouterr().err


def test_where_time_is_too_short_the_best_there_is_is_kept_and_not_called_a_plan(tmp_path, capsys):
    short = ("duration_s=300.0", "optimum.points=95", "optimum.restarts=1", "optimum.kicks=0")
    cases = cases_of(solve(tmp_path, *short, "optimum.cases=start"))
    assert cases["position_x_m"].tolist() == [given_start(composed().experiment).position_m[0]]
    assert cases["is_feasible"].tolist() == [False]
    assert 0 < cases["inspected_count"][0] < 95
    summary = artifacts.read_json(tmp_path, artifacts.OPTIMUM_SUMMARY)
    assert summary["num_feasible"] == 0
    assert "delta_v_m_s" not in summary
    assert "case 0 has no plan" in capsys.readouterr().err
    assert (tmp_path / artifacts.OPTIMUM_PLANS / "case-0000.csv").exists()


def test_the_summary_counts_feasible_cases_alone():
    row = {"is_feasible": True, "delta_v_m_s": 0.2, "delta_v_bound_m_s": 0.1, "restarts_agreeing": 2}
    dearer = row | {"delta_v_m_s": 0.4, "restarts_agreeing": 1}
    summary = reference.summarise([row, dearer, row | {"is_feasible": False}])
    assert (summary["num_cases"], summary["num_feasible"], summary["cases_found_more_than_once"]) == (3, 2, 1)
    assert summary["delta_v_m_s"] == pytest.approx(
        {"mean": 0.3, "standard_deviation": 0.2 / 2**0.5, "median": 0.3, "max": 0.4}
    )


FOLDERS = [(folder, 95) for folder in SHIPPED_FOLDERS.values()]
for harder in reference.HARDER_FOLDERS.values():
    FOLDERS += zip(harder, (98, 99), strict=True)


@pytest.mark.parametrize(("folder", "num_points"), FOLDERS, ids=lambda value: getattr(value, "name", value))
def test_every_plan_flies_as_its_table_says(folder, num_points):
    mission = composed().experiment.mission
    solved = read_solved(folder)
    assert mission.attitude.mode == "flown"
    for row in range(50):
        plan = open_loop("plan", solved.plan(row, mission))
        outcome = fly_all(mission, plan, [solved.scenarios[row]], workers=1)
        assert outcome.delta_v_m_s[0] == pytest.approx(solved.cases["delta_v_m_s"][row], rel=1e-9)
        assert outcome.inspected_count[0] == solved.cases["inspected_count"][row] >= num_points
        assert not outcome.is_violated[0]
    assert len(solved.cases["case"]) == len(cases_of(folder)["case"]) == 50


def test_bounds_in_the_table_are_those_of_the_cases():
    solved = read_solved(SHIPPED_FOLDERS["random"])
    problem = problem_of(composed().experiment.mission, solved.scenarios[3])
    bound = delta_v_bound(problem, 95, float(solved.cases["delta_v_m_s"][3]))
    assert bound == pytest.approx(solved.cases["delta_v_bound_m_s"][3], rel=1e-9)


EVALUATE = ("+experiment=evaluate", "controller=paper_champion")
EVALUATE += ("monte_carlo.num_cases=2", "stages=[evaluate]")


def evaluation(*overrides):
    return compose_experiment([*EVALUATE, *overrides]).experiment


LEO = f"optimum.reference={SHIPPED_FOLDERS['fixed'].with_name('leo')}"


@pytest.mark.parametrize("world", [["sun=fixed"], ["sun=random"], ["world=leo", "dynamics=cw", LEO]])
def test_the_shipped_cases_are_the_first_of_the_default_seed(world):
    experiment = evaluation(*world, "monte_carlo.num_cases=50")
    solved = solved_for(experiment)
    for solved_start, expected in zip(solved.scenarios, evaluation_scenarios(experiment), strict=True):
        # to rounding: NumPy's functions differ in the last digit between processors
        np.testing.assert_allclose(solved_start.position_m, expected.position_m, rtol=1e-14)
        np.testing.assert_array_equal(solved_start.velocity_m_s, 0.0)
        for name in ("sun_angle_rad", "sun_elevation_rad"):
            np.testing.assert_allclose(getattr(solved_start, name), getattr(expected, name), rtol=1e-14)
    assert np.all(solved.cases["inspected_count"] >= solved.cases["points_asked"])
    assert np.all(solved.cases["delta_v_m_s"] >= solved.cases["delta_v_bound_m_s"])


def test_a_flight_is_beside_the_cheapest_plan_that_sees_as_much():
    solved = solved_for(evaluation("sun=random"))
    seen = np.array([98, 99, 95, *np.full(47, 60)])
    flown = {"delta_v_m_s": np.full(50, 0.5), "inspected_count": seen}
    columns = beside_optimum.beside_optimum(flown, solved.cases, solved.harder)
    plans = [solved.cases, *solved.harder]
    for row, count in enumerate(seen.tolist()):
        enough = [p["delta_v_m_s"][row] for p in plans if p["inspected_count"][row] >= count]
        assert columns["times_optimum_as_seen"][row] == pytest.approx(0.5 / min(enough), rel=1e-12)
    assert [p["points_asked"][0] for p in plans] == [95, 98, 99]


def test_an_evaluation_flies_the_solved_cases_whatever_its_own_are(tmp_path):
    carried_out(compose_experiment([*EVALUATE, "seed=7"]), tmp_path)
    columns = tables.read_parquet(tmp_path, artifacts.BESIDE_OPTIMUM)
    cases = cases_of(SHIPPED_FOLDERS["fixed"])
    np.testing.assert_array_equal(columns["case"], np.arange(50))
    for start in ("position_x_m", "position_y_m", "position_z_m", "sun_angle_rad"):
        np.testing.assert_array_equal(columns[start], cases[start])
    np.testing.assert_array_equal(columns["optimum_inspected_count"], cases["inspected_count"])
    np.testing.assert_array_equal(columns["optimum_bound_m_s"], cases["delta_v_bound_m_s"])
    times = columns["times_optimum"]
    np.testing.assert_allclose(times * cases["delta_v_m_s"], columns["delta_v_m_s"], rtol=1e-15)
    assert len(tables.read_parquet(tmp_path, artifacts.EPISODES)["case"]) == 2

    summary = artifacts.read_json(tmp_path, artifacts.SUMMARY)["optimum"]
    assert (summary["reference"], summary["points_asked"], summary["num_cases"]) == ("shipped", 95, 50)
    assert summary["times_optimum"]["mean"] == pytest.approx(times.mean(), rel=1e-12)
    assert summary["times_optimum"]["max_case"] == int(np.argmax(times))
    assert (
        4.0
        < summary["times_optimum"]["min"]
        < summary["times_optimum"]["median"]
        < summary["times_optimum"]["max"]
    )
    assert summary["num_successful"] == int(np.sum(columns["inspected_count"] >= 95)) < 50


def test_a_case_outside_the_limits_is_no_success():
    columns = {
        "case": np.array([4, 9, 2]),
        "times_optimum": np.array([2.0, 6.0, 4.0]),
        "success": np.array([True, True, False]),
        "violated": np.array([False, True, False]),
        "delta_v_m_s": np.array([0.2, 0.6, 0.4]),
        "optimum_delta_v_m_s": np.full(3, 0.1),
    }
    columns["optimum_bound_m_s"] = np.array([0.05, 0.1, 0.0])
    summary = beside_optimum.summarise_times(columns, 95.0)
    assert summary["num_successful"] == 1
    times = summary["times_optimum"]
    ends = {name: times[name] for name in ("mean", "median", "min", "max", "max_case")}
    assert ends == {"mean": 4.0, "median": 4.0, "min": 2.0, "max": 6.0, "max_case": 9}
    assert 2.0 <= times["low"] < 4.0 < times["high"] <= 6.0
    assert summary["times_optimum_of_successful"] == {"mean": 2.0, "low": None, "high": None}
    # a case without a bound has no ratio to it
    assert summary["times_bound"]["mean"] == pytest.approx((4.0 + 6.0) / 2)


@pytest.mark.parametrize(
    ("overrides", "reason"),
    [
        (["duration_s=300"], "duration_s is 300.0 here, and 3600.0 where the plans were made"),
        (["deputy.max_distance_m=150"], "deputy.max_distance_m is 150.0 here, and 200.0 where"),
        (["orbit.mean_motion_rad_s=0.001"], "orbit.mean_motion_rad_s is 0.001 here"),
        (["attitude=ideal"], "attitude.mode is ideal here, and flown where"),
        (["sun=mixed"], "sun.mode is mixed; plans ship for sun=fixed and sun=random"),
        (["sun.angle_deg=10"], "sun.angle_deg is 10 here, and another in the plans' cases"),
        (["optimum.reference=null"], "optimum.reference is null"),
        (["inspection_threshold_percent=99"], "inspection_threshold_percent is 99 here, and the plans"),
        (["optimum.points=98"], "optimum.points is 98 here, and the plans inspect another number"),
        (["world=leo", LEO], "dynamics.model"),
    ],
)
def test_another_mission_is_not_compared(overrides, reason):
    with pytest.raises(IncomparableError, match=re.escape(reason)):
        solved_for(evaluation(*overrides))


def test_plans_that_stay_are_compared_with_flights_that_must_alone(tmp_path):
    carried_out(composed("duration_s=900", "after_s=600", *QUICK, "optimum.workers=1"), tmp_path)
    words = ("duration_s=900", "optimum.points=30", f"optimum.reference={tmp_path}")
    assert len(solved_for(evaluation(*words, "after_s=600")).cases["case"])
    with pytest.raises(IncomparableError, match=r"after_s is 0\.0 here, and 600\.0 where"):
        solved_for(evaluation(*words))
    # those that ship need not stay, and are a mark for flights that must
    assert len(solved_for(evaluation("after_s=600")).cases["case"]) == 50


def test_what_no_plan_depends_on_does_not_matter():
    others = ("guidance.kind=clusters", "coast_when_complete=false", "inspection_threshold_percent=95.9")
    experiment = evaluation(*others, "deputy.initial_position_m=[60,0,0]", "seed=5")
    assert len(solved_for(experiment).cases["case"]) == 50


def test_the_reason_is_kept_and_an_older_table_goes(tmp_path):
    stale = tmp_path / artifacts.BESIDE_OPTIMUM
    writing.write_atomically(stale, b"older")
    carried_out(compose_experiment([*EVALUATE, "duration_s=300"]), tmp_path)
    summary = artifacts.read_json(tmp_path, artifacts.SUMMARY)["optimum"]
    assert summary == {"not_compared": "duration_s is 300.0 here, and 3600.0 where the plans were made"}
    assert not stale.exists()


def test_plans_of_ones_own_measure_another_mission(tmp_path):
    run = carried_out(composed("duration_s=900", *QUICK, "optimum.workers=1"), tmp_path)
    solved = solved_for(evaluation("duration_s=900", "optimum.points=30", f"optimum.reference={tmp_path}"))
    assert solved.cases["case"].tolist() == [0, 1]
    assert solved.plan(1, run.experiment.mission).shape == (90, 3)
    with pytest.raises(IncomparableError, match=r"duration_s is 3600\.0 here, and 900\.0"):
        solved_for(evaluation(f"optimum.reference={tmp_path}"))
    with pytest.raises(IncomparableError, match=r"sun\.mode is random here, and fixed in the plans' cases"):
        solved_for(evaluation("duration_s=900", "sun=random", f"optimum.reference={tmp_path}"))


def test_plans_under_alternating_elevations_measure_their_own_mission(tmp_path):
    mission = ("duration_s=900", "sun=mixed", "sun.elevation_range_deg=[10,40]")
    points = "optimum.points=45"
    solve(tmp_path, *mission, *QUICK, points, "optimum.workers=1")
    solved = solved_for(evaluation(*mission, points, f"optimum.reference={tmp_path}"))
    fixed, drawn = solved.cases["sun_elevation_rad"]
    assert fixed == 0.0
    assert 10.0 < np.degrees(drawn) < 40.0
    with pytest.raises(IncomparableError, match="the Sun has other elevations here"):
        solved_for(evaluation(*mission[:2], f"optimum.reference={tmp_path}"))


def test_a_damaged_table_of_forces_is_told(tmp_path):
    shutil.copytree(SHIPPED_FOLDERS["fixed"], tmp_path, dirs_exist_ok=True)
    (tmp_path / artifacts.OPTIMUM_FORCES).write_text("case,time_s\n0,zero\n")
    with pytest.raises(artifacts.ArtifactError, match="no readable plans of least fuel"):
        read_solved(tmp_path)
