"""Flights towards a goal are judged as a plain loop over their samples judges them."""

import json
from dataclasses import replace
from math import log

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import telemetry
from fis_tools.analysis import flights
from fis_tools.errors import ControllerFileError
from pipeline.command_line.cli import main
from pipeline.command_line.config import compose_experiment
from pipeline.controllers.source import named
from pipeline.evaluation.monte_carlo import fly_cases
from pipeline.flight.goals import reach
from pipeline.flight.goals.flights import achieved, fly_all, fly_logged
from pipeline.flight.state.arrays import NUM_TRACKED, TRACK_SPENT
from pipeline.flight.state.log import Outcomes
from pipeline.recording.events import events
from pipeline.recording.recorder import FlightRecorder
from pipeline.scenarios import evaluation_scenarios
from telemetry.file.summary import summarize

NAMES = ("delta_v_m_s", "inspected_count", "inspectable_count", "mean_distance_m", "min_distance_m")
NAMES += ("max_distance_m", "outside_m", "safety_periods", "safety_delta_v_m_s", "ahead_delta_v_m_s")
NAMES += ("full_wheel_s",)


def docking(*overrides: str, problem: str = "docking"):
    words = ["+experiment=fly", f"problem={problem}", "controller=coast", *overrides]
    return compose_experiment(words).experiment


MISSION = docking().mission
NUMBERS = st.floats(0.01, 3.0)


def plainly(problem, track):
    """Judge one flight as `problem` says it, sample after sample: its end, whether the goal is reached.

    Also the speed there, and by how much the limit was exceeded at most.
    """
    used, over = 0.0, 0.0
    for k, row in enumerate(track):
        distance, speed = np.linalg.norm(row[:3]), np.linalg.norm(row[3:6])
        limit = problem.limit_base_m_s + problem.limit_slope_per_s * (distance - problem.limit_offset_m)
        if k > 0:
            used = used + max(speed - limit, 0.0)
            over = max(over, speed - limit)
        is_there = distance <= problem.goal_radius_m
        is_held = used <= problem.most_excess_m_s
        if is_there or not is_held or k == len(track) - 1:
            return k, bool(is_there and speed <= problem.goal_speed_m_s and is_held), speed, over
    raise AssertionError


@given(st.lists(st.tuples(NUMBERS, NUMBERS, st.floats(0.0, 0.4)), min_size=2, max_size=12), st.data())
def test_judged_as_by_a_plain_loop(samples, data):
    problem = type(MISSION.problem)(
        kind="reach",
        goal_radius_m=data.draw(st.floats(0.005, 2.0)),
        goal_speed_m_s=data.draw(st.floats(0.01, 0.4)),
        limit_base_m_s=data.draw(st.floats(0.0, 0.4)),
        limit_slope_per_s=data.draw(st.floats(0.0, 0.2)),
        limit_offset_m=data.draw(st.floats(-1.0, 1.0)),
        most_excess_m_s=data.draw(st.floats(0.0, 1.0)),
    )
    mission = replace(MISSION, problem=problem)
    tracks = np.zeros((1, len(samples), NUM_TRACKED))
    for k, (x, y, speed) in enumerate(samples):
        tracks[0, k, [0, 1, 4]] = x, y, speed
        tracks[0, k, TRACK_SPENT] = 0.1 * k
    judgement = reach.judged(mission, Outcomes(**dict.fromkeys(NAMES, np.zeros(1))), tracks)
    last, is_reached, speed, over = plainly(problem, tracks[0])
    assert judgement.end_s[0] == last * mission.control_period_s
    assert (judgement.is_success(100.0) & ~judgement.is_violated)[0] == is_reached
    assert judgement.end_speed_m_s[0] == pytest.approx(speed)
    assert judgement.excess_m_s[0] == pytest.approx(over, abs=1e-12)
    assert judgement.delta_v_m_s[0] == pytest.approx(0.1 * last)
    nearest = min(np.linalg.norm(row[:3]) for row in tracks[0, : last + 1])
    assert judgement.min_distance_m[0] == pytest.approx(nearest)
    if not is_reached:
        assert 0.0 <= judgement.inspected_count[0] < 1.0
        first = max(np.linalg.norm(tracks[0, 0, :3]), 2.0 * problem.goal_radius_m)
        way = log(max(nearest, problem.goal_radius_m) / problem.goal_radius_m)
        left = min(way / log(first / problem.goal_radius_m), 1.0)
        assert judgement.inspected_count[0] == pytest.approx(1.0 - left, abs=1e-8)


def test_what_is_flown_in_parts_logged_and_as_a_population_agrees(monkeypatch):
    experiment = docking("monte_carlo.num_cases=7", "duration_s=300")
    controller = named("steady", experiment.mission)
    starts = evaluation_scenarios(experiment)
    tracks = np.empty((7, 301, 3), dtype=np.float32)
    whole = fly_all(experiment.mission, controller, starts, 1, tracks)
    monkeypatch.setattr("pipeline.flight.goals.flights.MOST_TRACKED", 2 * 301 * NUM_TRACKED)
    parted = fly_all(experiment.mission, controller, starts, 1)
    for name, values in vars(whole).items():
        np.testing.assert_array_equal(values, vars(parted)[name], name)
    episodes, flown = fly_cases(experiment.mission, controller, starts, 1)
    np.testing.assert_array_equal(flown, tracks)
    for case, start in enumerate(starts):
        done, spent = achieved(experiment.mission, fly_logged(experiment.mission, controller, start))
        assert done == episodes["inspected_count"][case]
        assert spent == episodes["delta_v_m_s"][case]


@pytest.fixture(scope="module", params=["", "deputy.initial_velocity_m_s=[0.6,0,0]"], ids=["slow", "fast"])
def docked(request):
    experiment = docking("duration_s=1500", *filter(None, [request.param]))
    controller = named("steady", experiment.mission)
    start = evaluation_scenarios(experiment, [0])[0]
    return experiment.mission, controller, start, fly_logged(experiment.mission, controller, start)


def test_events_tell_of_the_end_and_of_speeds_above_the_limit(docked):
    mission, _, _, log = docked
    happened = events(mission, log, 5.0)
    assert "the goal is reached, 0.20 m from the chief" in happened[-1].text
    assert log.is_inspected[happened[-1].sample :].all()
    assert not log.is_inspected[: happened[-1].sample].any()
    speeds = np.linalg.norm(log.velocity_m_s, axis=1)
    limits = reach.limit_at(mission.problem, np.linalg.norm(log.position_m, axis=1))
    above = int(np.sum(speeds[1:] > limits[1:]))
    assert any(f"above the limit on the speed for {above} s" in event.text for event in happened) == (
        above > 0
    )


def test_each_spell_above_the_limit_is_told_where_it_begins(docked):
    mission, _, _, log = docked
    limits = reach.limit_at(mission.problem, np.linalg.norm(log.position_m, axis=1))
    velocity = log.velocity_m_s.copy()
    for sample, excess in ((5, 0.01), (6, 0.03), (7, 0.02), (20, 0.01)):
        velocity[sample] *= (limits[sample] + excess) / np.linalg.norm(velocity[sample])
    happened = events(mission, log._replace(velocity_m_s=velocity), 5.0)
    words = {event.sample: event.text for event in happened if "above the limit" in event.text}
    assert words[5] == "above the limit on the speed for 3 s, by 0.030 m/s at most"
    assert words[20] == "above the limit on the speed for 1 s, by 0.010 m/s at most"


def test_a_recording_counts_up_to_the_end_alone(docked, tmp_path):
    """What the page, `explain` and `info` say is of the flight to the dock, not of the stay there."""
    mission, controller, start, log = docked
    judged = fly_all(mission, controller, [start], 1)
    path = tmp_path / "docked.mcap"
    recorder = FlightRecorder(replace(docking(), mission=mission), controller, {})
    recorder.record(path, start, log, "docked")
    went, summary = flights.read_outcome(path), summarize(telemetry.read(path))["outcome"]
    assert 0.0 < judged.end_s[0] < 1500.0
    assert went.end_s == summary["end_s"] == judged.end_s[0]
    assert went.is_success == judged.is_success(100.0)[0]
    assert went.came_to["delta_v_m_s"] == pytest.approx(judged.delta_v_m_s[0])
    assert went.came_to["delta_v_m_s"] < log.delta_v_m_s[-1]
    assert summary["min_distance_m"] == pytest.approx(judged.min_distance_m[0])
    assert all(flight.time_s[-1] < judged.end_s[0] for flight in flights.read_flight(path, all_periods=True))
    with pytest.raises(ControllerFileError, match="is on no control period"):
        flights.read_periods(path, judged.end_s[0] + 1.0)


def test_starts_of_a_box_lie_in_it_evenly():
    experiment = docking("monte_carlo.num_cases=2000", problem="docking_planar")
    starts = evaluation_scenarios(experiment)
    drawn = np.array([[*start.position_m, *start.velocity_m_s] for start in starts])
    low, high = np.array(experiment.monte_carlo.box)
    assert (drawn >= low).all()
    assert (drawn <= high).all()
    np.testing.assert_allclose(
        drawn.mean(axis=0), (low + high) / 2, atol=4 * (high - low).max() / 12**0.5 / 2000**0.5
    )
    np.testing.assert_allclose(drawn.std(axis=0), (high - low) / 12**0.5, rtol=0.06)


@pytest.mark.slow
def test_a_run_is_reported_and_verified(tmp_path, ran):
    words = ["+experiment=evaluate", "problem=docking", "controller=steady", "monte_carlo.num_cases=4"]
    words += ["duration_s=600", "report.dots_per_inch=40", f"hydra.run.dir={tmp_path}"]
    assert main(words) == 0
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    summary = json.loads((tmp_path / "evaluate" / "summary.json").read_text(encoding="utf-8"))
    spent = summary["delta_v_m_s"]
    assert f"{spent['mean']:.3f} ± {spent['standard_deviation']:.3f}" in page
    assert f"{100 * summary['held']['fraction']:.1f} % are never above the limit" in page
    # the player's empty panels follow; of a flight to a goal it shows others
    before, flights, _ = page.partition('<section id="flights"')
    assert flights
    assert "points" not in before
    assert ran("verify", tmp_path).out.count("equal to the last bit") == 3
