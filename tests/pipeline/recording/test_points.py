"""What points add to signals sums to the signals, and is what the reference's formulas make it."""

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

import telemetry
from fis_tools.analysis.flights import read_rehearsals
from fis_tools.findings.explanation.points import rehearsed
from fis_tools.formats import serialize
from pipeline.flight.control.controller import Controller, coast, from_fuzzy
from pipeline.flight.fly.reference import reference_of
from pipeline.flight.fly.replanning import foresees
from pipeline.flight.fly.simulation import fly_logged
from pipeline.flight.fly.tours import following, tour_names
from pipeline.flight.reference.see_push import KS2, sought_looks
from pipeline.flight.reference.tour import tour_push
from pipeline.flight.reference.urgency import turned_aside, urgency, urgent_direction
from pipeline.flight.state.log import FlightLog, Scenario
from pipeline.flight.world.pack import pack_world
from pipeline.recording.foresight import decision_at
from pipeline.recording.points import parts_of_points, sensed_of_points
from pipeline.settings.experiment import Mission
from tests.fis_tools.sample_controllers import SHIPPED
from tests.pipeline.flight.cases import STARTS, controller, leaning_system, mission, touring
from tests.pipeline.recording.cases import recorded

HALF = {"attitude": {"mode": "ideal"}, "duration_s": 1800.0}
REAL = {
    "light": {"shadow": "conical"},
    "sensor": {"max_incidence_deg": 70.0},
    "navigation": {"mode": "fixes"},
}
WORLDS = {
    "the paper's": mission(**HALF),
    "tumbling": mission(**HALF, chief={"initial_angular_velocity_rad_s": (0.01, -0.02, 0.005)}),
    "low orbit": mission(**HALF, **REAL),
}
TEN_MINUTES = replace(WORLDS["the paper's"], duration_s=600.0)
#: the fuzzy controllers, and those that infer from what is made of points, not by foresight
FUZZY = {name: from_fuzzy(serialize.load(path)) for name, path in SHIPPED.items()}
PAPER = pack_world(WORLDS["the paper's"])
OF_POINTS = {
    name: flying for name, flying in FUZZY.items() if sensed_of_points(PAPER, flying) and not foresees(flying)
}
TARGETING = controller((leaning_system("force_x", 0.02, ("target_radial", "", 1.0)),), "hill")


def flown(what: Mission, flying: Controller, begin: Scenario = STARTS[0]) -> tuple[FlightLog, Controller]:
    """A flight's log, and the controller with the tours that it followed."""
    log = fly_logged(what, flying, begin)
    if len(log.tour_costs_m_s) == 0:
        return log, flying
    return log, following(flying, what, log.tour_costs_m_s.argmin(axis=1).tolist())


@cache
def parts_in(world: str, name: str) -> tuple[FlightLog, Controller, np.ndarray, dict[str, np.ndarray]]:
    log, followed = flown(WORLDS[world], TARGETING if name == "target" else OF_POINTS[name])
    samples = np.flatnonzero(log.is_decided)
    return log, followed, samples, parts_of_points(pack_world(WORLDS[world]), followed, log, samples)


def reference(world: str, name: str, k: int):
    """The reference flight, and what it knows at a sample of a flight: state, and points inspected."""
    log, followed, _, _ = parts_in(world, name)
    flight = reference_of(WORLDS[world], followed, STARTS[0])
    flight.__dict__["suns"] = list(zip(log.sun_angle_rad, log.sun_elevation_rad, strict=True))
    truth = np.hstack((log.position_m[k], log.velocity_m_s[k]))
    state = log.estimate[k] if WORLDS[world].navigation.mode == "fixes" else truth
    return flight, state, log.is_inspected[k]


def test_most_shipped_controllers_sense_what_points_make() -> None:
    assert OF_POINTS.keys() >= {"champion_27", "champion_leo", "champion_any_sun", "see_push", "aim", "tour"}


@pytest.mark.parametrize("world", WORLDS)
@pytest.mark.parametrize("name", ["target", *OF_POINTS])
def test_parts_sum_to_what_was_sensed(world: str, name: str) -> None:
    log, followed, samples, parts = parts_in(world, name)
    assert len(samples)
    assert parts
    is_told = False
    for row, system in enumerate(followed.systems):
        for column, variable in enumerate(system.inputs):
            if variable.name in parts and not variable.name.startswith("tour_push"):
                sensed, added = log.fis_input[samples, row, column], parts[variable.name].sum(axis=1)
                np.testing.assert_allclose(added, sensed, rtol=0, atol=1e-9, err_msg=variable.name)
                is_told |= bool(added.any())
    assert is_told or all(name.startswith("tour_push") for name in parts)


@pytest.mark.parametrize("world", WORLDS)
def test_leaning_towards_points_is_what_they_add_to_the_push_onto_the_tour(world: str) -> None:
    log, _, samples, parts = parts_in(world, "champion_leo")
    names = [f"tour_push_{axis}" for axis in ("radial", "along_track", "cross_track")]
    sensed = log.fis_input[samples, [[0], [1], [2]], 0].T
    num_checked = 0
    for row, k in enumerate(samples):
        flight, state, _ = reference(world, "champion_leo", k)
        alone = tour_push(flight, k, state, np.zeros(3))
        if np.linalg.norm(state[:3]) > flight.constants["skirt_distance_m"]:
            added = np.array([parts[name][row].sum() for name in names])
            np.testing.assert_allclose(alone + added, sensed[row], rtol=0, atol=1e-9)
            num_checked += 1
    assert num_checked > 5


@pytest.mark.parametrize(("share", "elevation"), [(1.0, 0.5), (0.3, 0.5), (0.3, -0.9), (1.0, -0.9)])
def test_near_the_chief_what_points_add_is_turned_outwards_as_the_whole_push_is(
    share: float, elevation: float
) -> None:
    """All the way within the skirt, and the Sun above the orbit: ``v - 2 s (v.r) r`` where it leads in."""
    what, skirt, shipped = WORLDS["the paper's"], 300.0, serialize.load(SHIPPED["champion_leo"])
    attributes = {**dict(shipped.attributes), "skirt_distance_m": str(skirt)}
    flying = from_fuzzy(replace(shipped, attributes=tuple(attributes.items())))
    begin = replace(STARTS[0], position_m=share * STARTS[0].position_m, sun_elevation_rad=elevation)
    log, flying = flown(what, flying, begin)
    samples = np.flatnonzero(log.is_decided)
    parts = parts_of_points(pack_world(what), flying, log, samples)
    flight = reference_of(what, flying, begin)
    flight.__dict__["suns"] = list(zip(log.sun_angle_rad, log.sun_elevation_rad, strict=True))
    num_turned = 0
    for row, k in enumerate(samples):
        state, constants = np.hstack((log.position_m[k], log.velocity_m_s[k])), flight.constants
        distance = np.linalg.norm(state[:3])
        outward = state[:3] / distance
        constants["skirt_distance_m"] = skirt
        urgent = urgent_direction(flight, k, state[:3], log.is_candidate[k])
        constants["skirt_distance_m"] = 0.0
        whole, alone = (tour_push(flight, k, state, lean) for lean in (urgent, np.zeros(3)))
        turn, nearness = np.eye(3), min(1.0, (skirt - distance) / (skirt - what.deputy.min_distance_m))
        if whole @ outward < 0.0:
            turn, num_turned = turn - 2.0 * nearness * np.outer(outward, outward), num_turned + 1
        np.testing.assert_allclose(turn @ whole, log.fis_input[k, :3, 0], rtol=0, atol=1e-9)
        added = [parts[f"tour_push_{axis}"][row].sum() for axis in ("radial", "along_track", "cross_track")]
        np.testing.assert_allclose(added, turn @ (whole - alone), rtol=0, atol=1e-9)
    assert num_turned


@pytest.mark.parametrize("world", ["the paper's", "low orbit"])
def test_each_part_is_what_the_push_loses_without_the_points_shortfall(world: str) -> None:
    """The push of all shortfalls less that of all but one, in the same equations, point by point."""
    _, _, samples, parts = parts_in(world, "see_push")
    names = [f"see_push_{axis}" for axis in ("radial", "along_track", "cross_track")]
    num_told = 0
    for row, k in enumerate(samples[::3]):
        flight, state, is_inspected = reference(world, "see_push", k)
        short, slopes = sought_looks(flight, k, state, is_inspected)
        weights = urgency(flight, k) * (short > 0.0)
        matrix = flight.constants["see_damping_ks2"] * KS2 * np.eye(3) + (weights * slopes.T) @ slopes

        def pushed(left, weights=weights, slopes=slopes, matrix=matrix, flight=flight, state=state):
            push = np.linalg.solve(matrix, slopes.T @ (weights * left))
            return turned_aside(flight, push, state[:3]), push @ state[:3] < 0.0

        whole, leads_in = pushed(short)
        for point in np.flatnonzero(short):
            without, still_leads_in = pushed(np.where(np.arange(len(short)) == point, 0.0, short))
            if leads_in == still_leads_in:
                recorded_parts = [parts[name][3 * row, point] for name in names]
                np.testing.assert_allclose(recorded_parts, whole - without, rtol=0, atol=1e-9)
                num_told += 1
        assert not any(parts[name][3 * row][short == 0.0].any() for name in names)
    assert num_told > 5


def test_what_coasting_would_miss_is_not_seen_by_coasting() -> None:
    what = WORLDS["the paper's"]
    log, _ = flown(what, OF_POINTS["champion_27"])
    decisions = np.flatnonzero(np.isfinite(log.foreseen[:, 0]))
    np.testing.assert_array_equal(log.is_missed[decisions].sum(axis=1), log.foreseen[decisions, 0])
    for k in decisions[:: max(1, len(decisions) // 4)]:
        angle = log.sun_angle_rad[k]
        state = {"position_m": log.position_m[k], "velocity_m_s": log.velocity_m_s[k]}
        start = replace(STARTS[0], **state, sun_angle_rad=angle)
        left = replace(what, duration_s=what.duration_s - k * what.control_period_s)
        seen = fly_logged(left, coast(), start).is_inspected[-1] | log.is_inspected[k]
        # on the way the camera sees a few more than at the places that are previewed
        assert not np.any(~seen & ~log.is_missed[k])
        assert np.count_nonzero(seen & log.is_missed[k]) <= 5


def test_a_recording_holds_what_rehearsals_cost(tmp_path: Path) -> None:
    flying = FUZZY["champion_27_one_push"]
    log, recording = recorded(tmp_path / "x.mcap", TEN_MINUTES, flying, STARTS[0])
    (rehearsal,) = recording.rehearsals.values()
    assert rehearsal.costs_m_s == tuple(log.push_costs_m_s.tolist())
    assert rehearsal.names[0] == "0 mm/s radially, 0 along the track, 0 across"
    assert len(rehearsal.names) == 105
    first = read_rehearsals(tmp_path / "x.mcap", 0.0)["first push"]
    assert [cost for cost, _ in first] == sorted(rehearsal.costs_m_s)
    assert read_rehearsals(tmp_path / "x.mcap", 10.0) == {}
    words = rehearsed("first push", first).blocks[1]
    assert len(words.rows) == 6
    assert words.rows[5][2].startswith("100 more, of ")


def test_a_recording_holds_the_plans_that_foresight_chose_among(tmp_path: Path) -> None:
    ideal = replace(WORLDS["the paper's"], duration_s=1800.0)
    log, recording = recorded(tmp_path / "x.mcap", ideal, FUZZY["champion_27_rehearsed"], STARTS[0])
    plan, ahead = recording.rehearsals["plan of pushes"], recording.rehearsals["flight ahead"]
    assert 1 < len(plan.names) <= 5 < plan.num_tried
    assert list(plan.costs_m_s) == sorted(plan.costs_m_s)
    paths = np.array(plan.paths_m).reshape(len(plan.names), -1, 3)
    assert np.abs(paths[1:, -1] - paths[0, -1]).max(axis=1).min() > 1.0  # they clearly differ
    (event,) = (text for text in recording["/log"]["message"] if text.startswith("planned"))
    assert plan.names[0] in event
    assert plan.names[1] in event
    assert decision_at(ideal, log, 0) == decision_at(ideal, log, 100) == event
    if min(ahead.costs_m_s) == ahead.costs_m_s[0]:  # it coasts after the plan
        np.testing.assert_allclose(paths[0], log.position_m[::6], rtol=0, atol=0.06)
        assert "coasting follows" in event
    (compared,) = (ways for what, ways in read_rehearsals(tmp_path / "x.mcap", 0.0).items() if "plan" in what)
    assert [name for _, name in compared] == list(plan.names)


def test_a_recording_holds_what_later_rehearsals_cost(tmp_path: Path) -> None:
    flying = touring(rehearsal_tours=2, rehearsal_period_s=300.0)
    log, flight = recorded(tmp_path / "x.mcap", TEN_MINUTES, flying, STARTS[0])
    first, second = "image of the tour", "image of the tour from 300 s"
    both = [read_rehearsals(tmp_path / "x.mcap", time_s) for time_s in (290.0, 300.0)]
    for rehearsal, name, costs in zip(both, (first, second), log.tour_costs_m_s, strict=True):
        assert rehearsal == {name: sorted(zip(costs.tolist(), tour_names(flying), strict=True))}
    events = flight["/log"]
    assert events.time_s[["rehearsed" in text for text in events["message"]]].tolist() == [0.0, 300.0]


def test_a_recording_holds_them_and_one_without_such_inputs_has_no_topic(tmp_path: Path) -> None:
    for name, senses in (("champion_27", True), ("paper_champion", False)):
        flying = FUZZY[name]
        _, flight = recorded(tmp_path / "x.mcap", WORLDS["the paper's"], flying, STARTS[0])
        assert ("/chief/pulls" in flight.topics) == ("pulls" in flight.metadata) == senses
        if senses:
            flat = telemetry.flat_table(flight, "/chief/pulls")["aim_radial"].to_numpy()
            np.testing.assert_array_equal(flat, flight["/chief/pulls"]["aim_radial"].ravel())
        for system in flying.systems if senses else ():
            cloud, sensed = flight["/chief/pulls"], flight[f"/fis/{system.name}"]
            rows = np.searchsorted(cloud.time_s, sensed.time_s + 1e-6) - 1
            for column, variable in enumerate(system.inputs):
                if variable.name in cloud.columns:
                    added = cloud[variable.name][rows].sum(axis=1)
                    np.testing.assert_allclose(added, sensed["inputs"][:, column], rtol=0, atol=1e-9)
                    assert cloud.units[variable.name] == variable.unit == "m/s"
