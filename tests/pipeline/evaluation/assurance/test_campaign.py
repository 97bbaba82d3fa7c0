"""Margins of flights against their outcomes, their logs and their recordings."""

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from pipeline.evaluation.assurance import campaign
from pipeline.evaluation.assurance.campaign import Flights, judged
from pipeline.evaluation.assurance.formula import parse
from pipeline.evaluation.assurance.quantities import QUANTITIES, UNITS, of_tracks, track_of
from pipeline.evaluation.assurance.requirements import Requirement, RequirementError, read
from pipeline.flight.fly.simulation import fly_all, fly_logged, tracked
from pipeline.flight.state.arrays import TRACK_BORESIGHT, TRACK_FORCE, TRACK_TURN_RATE
from pipeline.recording.recorder import FlightRecorder
from pipeline.settings.places import requirements_path
from telemetry.file.reader import read as read_recording
from tests.pipeline.evaluation.assurance.cases import champion, experiment, scenarios

REQUIREMENTS = read(requirements_path("inspection").read_text(encoding="utf-8"), "inspection").requirements
MISSION = experiment().mission


def test_margins_are_those_of_the_outcomes():
    flown = scenarios(40)
    outcomes = fly_all(MISSION, champion(), flown)
    found = Flights(MISSION, champion()).judge(flown, REQUIREMENTS)
    assert set(found) == {"R1", "R2", "R3", "R4", "R5"}
    near = {"rtol": 0, "atol": 2e-5}  # tracks are in single precision
    np.testing.assert_allclose(found["R1"].margins, outcomes.min_distance_m - 15.0, **near)
    np.testing.assert_allclose(found["R2"].margins, 200.0 - outcomes.max_distance_m, **near)
    np.testing.assert_allclose(found["R4"].margins, 5.62 - outcomes.delta_v_m_s, **near)
    rates = 100.0 * outcomes.inspected_count / 99
    np.testing.assert_allclose(found["R3"].margins, rates - 95.0, **near)
    np.testing.assert_array_equal(found["R3"].is_met, outcomes.inspected_count >= 95)


def test_parts_do_not_matter(monkeypatch: pytest.MonkeyPatch):
    flown = scenarios(7)
    together = Flights(MISSION, champion()).judge(flown, REQUIREMENTS)
    monkeypatch.setattr(campaign, "PART", 3)
    for name, outcome in Flights(MISSION, champion(), workers=1).judge(flown, REQUIREMENTS).items():
        np.testing.assert_array_equal(outcome.margins, together[name].margins)


def test_a_recording_says_what_its_track_says(tmp_path: Path):
    """Every quantity, from the topics that `Quantity.topic` names, by another way than the track's."""
    (scenario,) = scenarios(1)
    log = fly_logged(MISSION, champion(), scenario)
    recorder = FlightRecorder(MISSION, champion(), seed=1, config={}, near_limit_m=5.0)
    recorder.record(tmp_path / "flight.mcap", scenario, log, "flight")
    recording = read_recording(tmp_path / "flight.mcap")
    track, num_points = track_of(recording)
    np.testing.assert_array_equal(track[0], tracked(MISSION, log))
    found = of_tracks(track, num_points, QUANTITIES)
    away = Rotation.from_quat(recording["/deputy/state"]["quaternion"]).apply(MISSION.sensor.boresight)
    recorded = recording["/deputy/state"]["position_m"]
    cosines = -np.sum(away * recorded, axis=1) / np.linalg.norm(recorded, axis=1)
    np.testing.assert_allclose(np.cos(np.radians(found.pop("pointing_error")[0])), cosines, atol=1e-12)
    for name in found:
        quantity = QUANTITIES[name]
        topic, field = quantity.topic.split(".")
        field, _, place = field.rstrip("]").partition("[")
        values = np.asarray(recording[topic][field], dtype=np.float64)
        if place:
            values = values[:, int(place)]
        if values.ndim == 2:
            values = np.sqrt((values**2).sum(axis=1))
        if topic == "/deputy/control":  # nothing is fired from the last sample
            values = np.append(values, 0.0)
        if quantity.unit == "deg/s":
            values = values * 180.0 / np.pi
        np.testing.assert_allclose(found[name][0], values, rtol=1e-13, atol=1e-13, err_msg=name)


def test_compiled_tracks_are_those_of_the_logs():
    flown = scenarios(3)
    tracks = Flights(MISSION, champion()).tracks(flown)
    for track, scenario in zip(tracks, flown, strict=True):
        exact = tracked(MISSION, fly_logged(MISSION, champion(), scenario))
        # directions and turn rates are computed in another order than the log's
        same = slice(0, TRACK_BORESIGHT)
        np.testing.assert_array_equal(track[:, same], exact[:, same].astype(np.float32))
        np.testing.assert_allclose(track, exact, rtol=2e-7, atol=2e-7)
        assert np.ptp(exact[:, TRACK_TURN_RATE]) > 0.0
        assert np.any(exact[:-1, TRACK_FORCE:TRACK_BORESIGHT])


def test_a_formula_about_what_is_never_flown_is_refused():
    formula = parse("always[4000:5000] distance > 15", UNITS)
    late = Requirement(*("R9", *["late"] * 6), ("cases",), "", formula, 0.9, 0.9)
    with pytest.raises(RequirementError, match="R9: its part from 4000 to 5000 s says nothing"):
        Flights(MISSION, champion()).judge(scenarios(1), [late])


def test_quantities_of_a_flight_by_hand():
    """Two samples: 3-4-0 m at 0-0-2 m/s, then a point more seen of ten and 0.5 m/s spent by 0-0.3-0.4 N.

    The camera looks along the track, then at the chief; the deputy turns by 9 degrees a second, then rests.
    """
    moved = [[3.0, 4.0, 0.0, 0.0, 0.0, 2.0, 0.0, 10.0], [6.0, 8.0, 0.0, 1.0, 0.0, 0.0, 0.5, 9.0]]
    fired, looks = [[0.0, 0.3, -0.4], [0.0, 0.0, 0.0]], [[0.0, 1.0, 0.0], [-0.6, -0.8, 0.0]]
    track = np.hstack([moved, fired, looks, [[np.pi / 20], [0.0]]])[np.newaxis]
    texts = {
        "least": "always (distance >= 4 m)",
        "rate": "eventually (inspection_rate >= 4 %)",
        "spent": "always (delta_v <= 0.7 m/s)",
        "speed": "always (speed <= 3 m/s)",
        "along": "eventually (position_along_track >= 6 m and velocity_radial >= 0.5 m/s)",
        "thrust": "always (force <= 0.6 N)",
        "push": "eventually (force_cross_track < -0.1 N)",
        "turn": "always (turn_rate <= 10 deg/s)",
        "look": "eventually (pointing_error < 5 deg)",
        "stray": "pointing_error <= 180 deg",
    }
    formulas = {name: parse(text, UNITS) for name, text in texts.items()}
    found = {name: one.margins[0] for name, one in judged(track, 10, formulas, 10.0).items()}
    assert found == pytest.approx(
        {"least": 1.0, "rate": 6.0, "spent": 0.2, "speed": 1.0, "along": 0.5}
        | {"thrust": 0.1, "push": 0.3, "turn": 1.0, "look": 5.0, "stray": np.degrees(np.arccos(0.8))}
    )
