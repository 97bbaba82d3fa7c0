"""Which flights the stage records, under which names, and that they are the evaluation's own."""

import math
import shutil
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader

import telemetry
from pipeline.command_line.config import Job, compose_experiment
from pipeline.evaluation.ranks import from_worst_to_best
from pipeline.flight.cases.dispersions import mission_of_case
from pipeline.recording.reflight import fly_again
from pipeline.run import artifacts, tables, writing
from pipeline.run.artifacts import ArtifactError
from pipeline.scenarios import evaluation_scenarios, training_scenarios
from pipeline.stages import record
from tests.pipeline.command_line.cases import EVALUATE
from tests.pipeline.recording import cases
from tests.pipeline.settings.test_orbit import VANGUARD
from tests.pipeline.stages.cases import carried_out

pytestmark = pytest.mark.slow

MINIATURE = ("duration_s=200.0", "monte_carlo.num_cases=6", "sun=random", "seed=4")


def evaluated(*overrides: str) -> Job:
    return compose_experiment(["+experiment=evaluate", *MINIATURE, *overrides])


def recordings(folder: Path) -> list[str]:
    return sorted(path.name for path in (folder / "episodes").iterdir())


def table(rows: list[tuple[bool, int, float]]) -> dict[str, np.ndarray]:
    names = ("violated", "inspected_count", "delta_v_m_s")
    return dict(zip(names, map(np.array, zip(*rows, strict=True)), strict=True))


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A miniature evaluation, recorded."""
    folder = tmp_path_factory.mktemp("finished")
    carried_out(evaluated("telemetry.record_training=true"), folder, "evaluate", "record")
    return folder


def ranked(columns: dict[str, np.ndarray]) -> list[int]:
    return from_worst_to_best(lambda: [columns], range(len(columns["delta_v_m_s"])))


def test_rank_by_violation_then_points_then_delta_v():
    rows = [(False, 97, 1.0), (True, 99, 0.1), (False, 97, 2.0), (False, 60, 0.2), (True, 20, 5.0)]
    assert ranked(table(rows)) == [4, 1, 3, 2, 0]
    assert ranked(table([(False, 97, 1.0)] * 3)) == [0, 1, 2]
    # 92 of 94 points that are ever lit are more than 94 of 99
    lit = {"inspectable_rate_percent": np.array([9200 / 94, 9400 / 99])}
    assert ranked(table([(False, 92, 1.0), (False, 94, 1.0)]) | lit) == [1, 0]


def test_worst_median_and_best_of_a_table(tmp_path, finished):
    run = evaluated()
    episodes = tables.read_parquet(finished, artifacts.EPISODES)
    rows = [(False, 90, 1.0), (False, 99, 0.5), (False, 97, 1.0), (True, 99, 0.1), (False, 97, 0.9)]
    rows.append((False, 99, 0.4))
    rates = {"inspectable_rate_percent": np.array([100.0 * inspected / 99 for _, inspected, _ in rows])}
    tables.write_parquet(tmp_path / artifacts.EPISODES, episodes | table(rows) | rates)
    flights = record.flights_of(run.experiment, tmp_path)
    # worst first: 3, 0, 2, 4, 1, 5
    assert [flight.name for flight in flights] == ["worst-case-3", "median-case-4", "best-case-5"]
    assert [flight.scenario_id for flight in flights] == ["case-3", "case-4", "case-5"]
    assert flights[1].expected == (97, 0.9)
    for flight, case in zip(flights, (3, 4, 5), strict=True):
        start = [episodes[f"position_{axis}_m"][case] for axis in "xyz"]
        assert flight.scenario.position_m.tolist() == start


def test_a_single_case_is_worst_median_and_best_where_asked_for(tmp_path, capsys):
    carried_out(evaluated("monte_carlo.num_cases=1"), tmp_path, "evaluate", "record")
    assert recordings(tmp_path) == ["best-case-0.mcap", "median-case-0.mcap", "worst-case-0.mcap"]
    record.run(evaluated("telemetry.record_ranked=false").experiment, tmp_path)
    assert "nothing to record" in capsys.readouterr().err
    assert recordings(tmp_path) == []


def test_recorded_flights_repeat_the_evaluation_exactly(finished):
    episodes = tables.read_parquet(finished, artifacts.EPISODES)
    tracks = tables.read_parquet(finished, artifacts.TRAJECTORIES)
    flights = {}
    for path in (finished / "episodes").glob("*-case-*.mcap"):
        name, _, case = path.stem.partition("-case-")
        flights[name] = int(case)
        flight = telemetry.read(path)
        mission, state = flight["/mission"], flight["/deputy/state"]
        row = {column: values[int(case)] for column, values in episodes.items()}
        assert mission["delta_v_m_s"][-1] == row["delta_v_m_s"]
        assert mission["inspected_count"][-1] == row["inspected_count"]
        assert mission["sun_angle_rad"][0] == row["sun_angle_rad"]
        assert mission["distance_m"].min() == pytest.approx(row["min_distance_m"], rel=1e-14)
        assert mission["distance_m"].mean() == pytest.approx(row["mean_distance_m"], rel=1e-14)
        position = state["position_m"].astype(np.float32)
        is_case = tracks["case"] == int(case)
        for i, axis in enumerate("xyz"):
            np.testing.assert_array_equal(position[:, i], tracks[f"position_{axis}_m"][is_case])
        assert (flight.episode.scenario_id, flight.episode.seed) == (f"case-{case}", 4)
    assert set(flights) == {"worst", "median", "best"}
    counts = [episodes["inspected_count"][flights[name]] for name in ("worst", "median", "best")]
    assert counts == sorted(counts)
    assert counts[0] == episodes["inspected_count"].min()
    assert counts[2] == episodes["inspected_count"].max()


@pytest.mark.parametrize(("column", "change"), [("inspected_count", 1), ("delta_v_m_s", 1e-8)])
def test_a_flight_that_is_no_longer_the_evaluations_is_not_recorded(column, change, tmp_path, finished):
    folder, run = shutil.copytree(finished, tmp_path / "run"), evaluated()
    episodes = tables.read_parquet(folder, artifacts.EPISODES)
    tables.write_parquet(folder / artifacts.EPISODES, episodes | {column: episodes[column] + change})
    with pytest.raises(ArtifactError, match="has changed since: repeat the stage evaluate"):
        record.run(run.experiment, folder)
    # another processor rounds the last digits differently
    rounded = {"delta_v_m_s": episodes["delta_v_m_s"] * (1.0 + 1e-12)}
    tables.write_parquet(folder / artifacts.EPISODES, episodes | rounded)
    record.run(run.experiment, folder)


@pytest.mark.parametrize(("words", "index"), [((), 0), (("starts.redraw=true", "optimizer.rounds=4"), 1)])
def test_of_many_training_scenarios_the_first_eight_of_the_round_it_came_to(words, index, tmp_path):
    words = (*words, "starts=random", "telemetry.record_training=true", "telemetry.record_ranked=false")
    run = evaluated(*words).experiment
    assert run.starts.num_cases > 8
    tables.write_parquet(tmp_path / artifacts.HISTORY, {"round": np.array([0, 0, index])})
    flights = record.flights_of(run, tmp_path)
    drawn = training_scenarios(run, index)
    named = [f"training-{case}" for case in range(8)]
    assert [flight.name for flight in flights] == [flight.scenario_id for flight in flights] == named
    for flight, scenario in zip(flights, drawn, strict=False):
        np.testing.assert_array_equal(flight.scenario.position_m, scenario.position_m)
        assert flight.scenario.sun_angle_rad == scenario.sun_angle_rad


def test_the_flight_from_the_start_takes_the_place_of_earlier_recordings(tmp_path):
    (tmp_path / "episodes").mkdir()
    stale = ["worst-case-9.mcap", "training-7.mcap", "median-case-1.mcap.partial"]
    foreign = ["my-worst-case-9.mcap", "notes.txt", "worst-case-9.rrd"]
    for name in stale + foreign:
        (tmp_path / "episodes" / name).write_bytes(b"x")
    start = ("deputy.initial_position_m=[0.0,-60.0,1.0]", "deputy.initial_velocity_m_s=[0.01,0.0,-0.02]")
    flight = cases.staged(tmp_path, "duration_s=20.0", "sun.angle_deg=90", *start)
    assert recordings(tmp_path) == sorted([*foreign, "start.mcap"])
    assert flight["/deputy/state"]["position_m"][0].tolist() == [0.0, -60.0, 1.0]
    assert flight["/deputy/state"]["velocity_m_s"][0].tolist() == [0.01, 0.0, -0.02]
    assert flight["/mission"]["sun_angle_rad"][0] == math.pi / 2


def test_without_an_evaluation_of_the_controller_there_is_nothing_to_rank(tmp_path, finished):
    with pytest.raises(ArtifactError, match=r"no evaluate/episodes\.parquet; the stage evaluate writes it"):
        record.run(evaluated().experiment, tmp_path)
    writing.write_atomically(tmp_path / artifacts.EPISODES, (finished / artifacts.EPISODES).read_bytes())
    with pytest.raises(ArtifactError, match=r"says \d+ for .* m/s; .* repeat the stage evaluate"):
        carried_out(evaluated("controller=coast"), tmp_path, "record")


def test_the_given_start_has_an_angle_of_the_sun_that_is_drawn():
    def angle(*overrides: str) -> float:
        experiment = cases.composed("controller=coast", *overrides).experiment
        (flight,) = record.flights_of(experiment, Path("unused"))
        return flight.scenario.sun_angle_rad

    drawn = compose_experiment([*EVALUATE, "sun=random", "seed=5"])
    first = evaluation_scenarios(drawn.experiment)[0]
    assert angle("sun=random", "seed=5") == first.sun_angle_rad
    assert angle("sun=random", "seed=6") != first.sun_angle_rad


def test_a_case_of_the_evaluation_is_flown_alone():
    """With what it draws: here its velocity, its mass and its thrusters' errors."""
    words = (
        *("controller=coast", "sun=random", "seed=5", "actuators=real", "monte_carlo.max_speed_m_s=0.2"),
        "+dispersions.deputy.mass_kg={kind:uniform,low:10,high:14}",
        "+dispersions.actuators.scale_error={kind:normal,mean:0,std:0.1,correlation_s:60}",
    )
    alone = cases.composed("case=7", *words).experiment
    (flight,) = record.flights_of(alone, Path("unused"))
    evaluated = compose_experiment(["+experiment=evaluate", *words]).experiment
    seventh = evaluation_scenarios(evaluated)[7]
    assert (flight.name, flight.scenario_id) == ("case-7", "case-7")
    np.testing.assert_array_equal(flight.scenario.velocity_m_s, seventh.velocity_m_s)
    np.testing.assert_array_equal(flight.scenario.position_m, seventh.position_m)
    assert flight.scenario.noise == seventh.noise
    assert mission_of_case(alone.mission, flight.scenario) == mission_of_case(evaluated.mission, seventh)


def test_a_dispersed_flight_tells_its_own_settings(tmp_path):
    words = (
        *("controller=lqr", "case=7", "duration_s=600.0"),
        "+dispersions.sensor.half_angle_deg={kind:uniform,low:13,high:17}",
        "+dispersions.deputy.max_distance_m={kind:uniform,low:150,high:250}",
    )
    carried_out(cases.composed(*words), tmp_path)
    recording = telemetry.read(tmp_path / "episodes" / "case-7.mcap")
    far, angle = recording.episode.settings  # in the order of their keys
    assert recording.episode.max_distance_m == far != 200.0
    assert recording.episode.half_angle_rad == math.radians(angle) != math.radians(15.0)
    assert fly_again(recording.path).is_equal


@pytest.mark.parametrize(("speed", "sentence"), [(0.0, " m/s\n"), (-1.0, " m/s, outside the limits\n")])
def test_a_flight_that_leaves_the_limits_says_so(tmp_path, capsys, speed, sentence):
    start = "deputy.initial_position_m=[50,0,0]", f"deputy.initial_velocity_m_s=[{speed},0,0]"
    carried_out(cases.composed("controller=coast", "duration_s=60.0", *start), tmp_path)
    assert sentence in capsys.readouterr().err


@pytest.mark.parametrize(
    ("words", "time_s"),
    [
        # date -u -d 2026-11-26T11:00:00 +%s
        (["orbit=altitude", "orbit.epoch=2026-11-26T12:00:00+01:00"], 1_795_690_800.0),
        # the day 179.78495062 of the year 2000, 946684800 s being its beginning
        (
            ["dynamics=two_body", "orbit.kind=tle", f"+orbit.tle={list(VANGUARD)}"],
            946_684_800.0 + 178.78495062 * 86_400.0,
        ),
        (["duration_s=100"], 0.0),
    ],
)
def test_time_stamps_count_from_the_missions_epoch(words, time_s, tmp_path):
    flight = cases.staged(tmp_path, "duration_s=100", "controller=coast", *words)
    np.testing.assert_array_equal(flight["/mission"].time_s, np.arange(0.0, 101.0, 10.0))
    assert flight.epoch is None or flight.epoch.timestamp() == pytest.approx(time_s, abs=1e-4)
    with flight.path.open("rb") as stream:
        stamps = [message.log_time / 1e9 for _, _, message in make_reader(stream).iter_messages()]
    assert (stamps[0], stamps[-1]) == pytest.approx((time_s, time_s + 100.0), abs=1e-4)
