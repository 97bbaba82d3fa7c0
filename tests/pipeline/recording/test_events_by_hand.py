"""Events of logs made by hand: approaches to a goal, spheres to stay out of, wheels; and paths of plans."""

import struct
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from pipeline.recording import reflight
from pipeline.recording.events import events
from pipeline.recording.foresight import recorded_decisions
from pipeline.recording.recorder import stl_of
from telemetry import RecordingError
from tests.pipeline.recording import cases
from tests.pipeline.recording.test_decisions import BEST, LATER, NONE, NOTHING, WORDS, flight

DOCKING = cases.composed("problem=docking", "duration_s=300").experiment.mission


def approach(distances, speeds):
    """A log of flights along the first axis with speeds along the second."""
    log = cases.flown("problem=docking", "duration_s=300")
    count = len(log.position_m)
    position, velocity = np.zeros((count, 3)), np.zeros((count, 3))
    position[:, 0], velocity[:, 1] = np.resize(distances, count), np.resize(speeds, count)
    spent = np.arange(float(count))
    return log._replace(position_m=position, velocity_m_s=velocity, delta_v_m_s=spent)


def sentences_of(distances, speeds):
    return [
        (event.sample, event.level, event.text) for event in events(DOCKING, approach(distances, speeds), 5.0)
    ]


def test_an_approach_tells_where_it_was_too_fast_and_how_it_ended():
    problem = DOCKING.problem
    count = len(approach([50.0], [0.0]).position_m)
    period_s = DOCKING.control_period_s
    distances = np.linspace(60.0, 20.0, count)
    limits = problem.limit_base_m_s + problem.limit_slope_per_s * (distances - problem.limit_offset_m)
    speeds = 0.5 * limits
    # the start does not count; a spell of two samples, and one of one
    speeds[[0, 3, 4, 8]] = limits[[0, 3, 4, 8]] + [0.02, 0.001, 0.003, 0.002]
    *spells, end = sentences_of(distances, speeds)
    words = "above the limit on the speed for {:g} s, by {:.3f} m/s at most"
    assert spells == [
        (3, "warning", words.format(2 * period_s, 0.003)),
        (8, "warning", words.format(period_s, 0.002)),
    ]
    last = count - 1
    where = f"20.00 m from the chief at {speeds[-1]:.3f} m/s, delta-v {last:.3f} m/s; the rest does not count"
    assert end == (last, "warning", f"end: not arrived in time, {where}")


@pytest.mark.parametrize(("part", "fault"), [(0.5, ""), (1.5, "a crash")])
def test_an_approach_ends_at_its_goal(part, fault):
    problem = DOCKING.problem
    distances = np.full(len(approach([50.0], [0.0]).position_m), 30.0)
    distances[5:] = 0.9 * problem.goal_radius_m
    speeds = np.zeros_like(distances)
    speeds[5] = part * problem.goal_speed_m_s
    *_, end = sentences_of(distances, speeds)
    assert end[:2] == (5, "warning" if fault else "info")
    assert end[2].startswith(
        f"end: {fault or 'the goal is reached'}, {distances[5]:.2f} m from the chief at "
    )
    assert "delta-v 5.000 m/s" in end[2]


def test_spheres_to_stay_out_of_are_entered_and_left():
    mission = cases.composed("duration_s=100.0").experiment.mission
    mission = replace(
        mission, chief=replace(mission.chief, keep_out_m=((40.0, 0.0, 0.0, 10.0), (0.0, 60.0, 0.0, 5.0)))
    )
    log = cases.flown("duration_s=100.0")
    position = np.tile([80.0, 0.0, 0.0], (11, 1))
    position[3:5] = [[48.0, 0.0, 0.0], [43.0, 0.0, 0.0]]
    position[7:] = [0.0, 62.0, 0.0]
    still = np.tile([0.0, 0.0, 0.0, 1.0], (11, 1))
    happened = events(mission, log._replace(position_m=position, quaternion_c_from_h=still), 5.0)
    within = [(each.sample, each.level, each.text) for each in happened if "sphere" in each.text]
    assert within == [
        (3, "error", "2.0 m inside sphere 0 of those to stay out of"),
        (5, "info", "outside again: sphere 0 of those to stay out of"),
        (7, "error", "3.0 m inside sphere 1 of those to stay out of"),
    ]
    assert "outside the limits at 6 of 10 samples" in happened[-1].text


def test_full_wheels_are_told_once_with_how_long_in_all():
    mission = cases.composed("duration_s=100.0").experiment.mission
    mission = replace(mission, deputy=replace(mission.deputy, max_momentum_n_m_s=0.5))
    log = cases.flown("duration_s=100.0")
    momentum = np.zeros((10, mission.num_attitude_steps, 3))
    momentum[4, 3:, 1], momentum[6, 0, :], momentum[7, 0, 2] = 0.5, -0.5, 0.4
    happened = events(mission, log._replace(wheel_momentum_b_n_m_s=momentum), 5.0)
    (event,) = (each for each in happened if "wheel" in each.text)
    seconds = mission.attitude_period_s * (mission.num_attitude_steps - 3 + 1)
    assert (event.sample, event.level) == (4, "warning")
    assert event.text == f"a wheel is full, at 0.5 N m s; in all one is for {seconds:g} s"


def paths_of(mission, log, plan, sample):
    """Positions of a plan from a sample on, each minute, by Clohessy and Wiltshire's equations."""
    n, mass, period = mission.orbit.mean_motion_rad_s, mission.deputy.mass_kg, mission.control_period_s
    begins = [(begin * period, np.array(force)) for begin, *force in plan if begin >= 0.0]

    def rates(time, s):
        push = sum((force for begin, force in begins if 0.0 <= time - begin < period), np.zeros(3)) / mass
        pull = 3.0 * n * n * s[0] + 2.0 * n * s[4], -2.0 * n * s[3], -n * n * s[2]
        return [*s[3:], *(np.array(pull) + push)]

    first = sample * period
    times = np.arange(first, mission.duration_s + 1.0, 60.0)
    start = np.r_[log.position_m[sample], log.velocity_m_s[sample]]
    path = solve_ivp(rates, (first, times[-1]), start, "RK45", times, max_step=2.0, rtol=1e-8, atol=1e-8)
    return path.y[:3].T


@pytest.mark.parametrize("motion", [(), ("dynamics=two_body", "orbit.course=true")], ids=" ".join)
def test_paths_of_plans_begin_where_they_are_made_and_last_to_the_end(motion):
    mission, log = cases.composed(*WORDS, *motion).experiment.mission, flight()
    first, later = (
        each for name, each in recorded_decisions(mission, log).items() if name.startswith("plan")
    )
    # of a nearly circular orbit a linear motion along its course is that of Clohessy and Wiltshire
    atol = 0.4 if motion else 0.06
    for plans, plan, sample in ((first, BEST, 0), (later, LATER, 60)):
        path = np.reshape(plans.paths_m, (len(plans.names), -1, 3))[0]
        np.testing.assert_allclose(path, paths_of(mission, log, plan, sample), atol=atol)


def test_a_push_in_the_last_period_moves_what_follows_it_alone():
    mission, log = cases.composed(*WORDS).experiment.mission, flight()
    last = mission.num_controls - 1
    plans = np.array([[((float(last), 0.012, 0.0, 0.0), NONE, NONE), *[NOTHING] * 4]] * 2)
    prices = np.array([[0.01, *[np.nan] * 4]] * 2)
    pushed = recorded_decisions(mission, log._replace(foresight_plans=plans, foresight_prices_m_s=prices))
    path = np.reshape(pushed["plan of pushes"].paths_m, (-1, 3))
    plan = plans[0, 0]
    np.testing.assert_allclose(path, paths_of(mission, log, plan, 0), atol=0.06)
    free = paths_of(mission, log, [NONE], 0)
    # ten millimetres a second, for the half of a period that the push takes
    assert path[-1, 0] - free[-1, 0] == pytest.approx(0.05, abs=0.051)


@pytest.mark.parametrize(("length", "is_refused"), [(100_000, True), (100_081, False)])
def test_what_is_recorded_may_be_flown_again_at_twice_its_length(length, is_refused):
    """An hour of 360 periods of 556 steps, 200,160."""
    requested = SimpleNamespace(mission=SimpleNamespace(num_controls=360, num_attitude_steps=556))
    recording = SimpleNamespace(path="a.mcap", topics={"/x": range(length), "/y": range(7)})
    if is_refused:
        with pytest.raises(RecordingError, match="of what it holds at most 200,000 are flown again"):
            reflight._check_length(recording, requested)
    else:
        reflight._check_length(recording, requested)


def test_a_surface_as_stl_has_its_triangles():
    corners = np.arange(18.0).reshape(2, 3, 3)
    content = stl_of(corners)
    assert len(content) == 80 + 4 + 2 * 50
    assert struct.unpack("<I", content[80:84]) == (2,)
    for row in range(2):
        numbers = struct.unpack("<12fH", content[84 + 50 * row : 134 + 50 * row])
        assert numbers == (0.0, 0.0, 0.0, *corners[row].ravel().tolist(), 0)
