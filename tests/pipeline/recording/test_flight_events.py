"""Events of flights made by hand."""

import dataclasses

import numpy as np
import pytest

import telemetry
from pipeline.command_line.cli import main
from pipeline.flight.state.log import FlightLog
from pipeline.recording import reflight
from pipeline.recording.events import Event, events
from pipeline.recording.reflight import fly_again
from telemetry import RecordingError
from tests.pipeline.recording import cases

SHORT = ("duration_s=100.0",)
MISSION = cases.composed(*SHORT).experiment.mission


def flight(distance_m: list[float], inspected_count: list[int]) -> FlightLog:
    """Eleven samples at distances along i, with the first of 99 points inspected."""
    inspected = np.arange(99) < np.array(inspected_count)[:, np.newaxis]
    position = np.array(distance_m)[:, np.newaxis] * [1.0, 0.0, 0.0]
    return cases.flown(*SHORT)._replace(
        position_m=position,
        is_inspected=inspected,
        is_inspectable=np.ones(99, dtype=bool),
        delta_v_m_s=0.1 * np.arange(11.0),
        force_hill_n=np.ones((10, 3)),
    )


def told(distance_m: list[float], near_limit_m: float = 5.0) -> list[tuple[int, str]]:
    """Samples and levels of what happens besides the end."""
    found = events(MISSION, flight(distance_m, [0] * 11), near_limit_m)
    assert found[-1].sample == 10
    assert found[-1].text.startswith("end:")
    return [(event.sample, event.level) for event in found[:-1]]


def test_nothing_happens_far_from_the_limits_which_are_inside_themselves():
    assert told([75.0] * 11) == []
    assert told([15.0, 200.0] * 5 + [15.0], near_limit_m=0.0) == []


def test_approach_leave_and_return():
    distances = [30.0, 21.0, 19.0, 16.0, 14.9, 12.0, 15.0, 18.0, 24.0, 40.0, 40.0]
    assert told(distances) == [(2, "warning"), (4, "error"), (6, "info")]
    texts = [event.text for event in events(MISSION, flight(distances, [0] * 11), 5.0)]
    assert texts[0] == "19.0 m from the chief: 4.0 m from the least distance allowed (15 m)"
    assert texts[1] == "14.9 m from the chief: beyond the least distance allowed (15 m)"
    assert texts[2] == "15.0 m from the chief: inside the limits again"
    assert texts[3].endswith("12.0 to 40.0 m from the chief, outside the limits at 2 of 10 samples")
    # no warning is repeated at the edge of nearness
    assert told([196.0, 194.0] * 5 + [196.0]) == [(0, "warning")]
    assert told([75.0, 196.0, 75.0, 197.0, *[75.0] * 7]) == [(1, "warning"), (3, "warning")]


def test_a_flight_that_starts_outside_says_so_and_violates_nothing():
    found = events(MISSION, flight([10.0, *[50.0] * 10], [0] * 11), 5.0)
    assert [(event.sample, event.level) for event in found[:-1]] == [(0, "error"), (1, "info")]
    assert found[-1].text.endswith("always inside the limits")


def test_the_threshold_is_95_of_99_points():
    counts = [0, 50, 94, 94, 95, 96, 99, 99, 99, 99, 99]
    reached, complete, end = events(MISSION, flight([75.0] * 11, counts), 5.0)
    assert reached == Event(4, "info", "95 % reached: 95 of 99 points inspected, delta-v 0.400 m/s")
    assert complete == Event(6, "info", "complete: all 99 points inspected")
    assert end.level == "info"
    assert end.text.startswith("end: 99 of 99 points inspected (100.00 %), delta-v 1.000 m/s")
    assert events(MISSION, flight([75.0] * 11, [94] * 11), 5.0)[-1].level == "warning"
    assert events(MISSION, flight([75.0] * 11, [95] * 11), 5.0)[-1].level == "info"


@pytest.mark.parametrize(
    ("last_force", "ending"), [(0.0, "; no force from here on"), (0.1, "points inspected")]
)
def test_complete_says_whether_the_deputy_coasts(last_force: float, ending: str):
    log = flight([75.0] * 11, [0] * 8 + [99] * 3)
    forces = np.ones((10, 3))
    forces[8:] = [[0.0, 0.0, 0.0], [0.0, last_force, 0.0]]
    complete = events(MISSION, log._replace(force_hill_n=forces), 5.0)[1]
    assert complete.text.endswith(ending)


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    folder = tmp_path_factory.mktemp("flown") / "run"
    words = ["+experiment=fly", "controller=paper_champion", "duration_s=300", f"hydra.run.dir={folder}"]
    assert main(words) == 0
    return folder


def test_a_flight_repeats_to_the_last_bit_as_verify_says(run, capsys):
    again = fly_again(run / "episodes" / "start.mcap")
    assert (again.is_equal, again.is_close, again.greatest) == (True, True, 0.0)
    assert main(["verify", str(run)]) == 0
    assert "start.mcap: flown again, equal to the last bit" in capsys.readouterr().out


@pytest.mark.parametrize(("off", "is_close"), [(1e-9, True), (1e-3, False)])
def test_a_flight_from_elsewhere_is_told_apart(run, monkeypatch, off, is_close):
    """The log is flown from a start beside the one that is recorded."""
    fly = reflight.fly_logged

    def beside(mission, controller, scenario):
        return fly(mission, controller, dataclasses.replace(scenario, position_m=scenario.position_m + off))

    monkeypatch.setattr(reflight, "fly_logged", beside)
    again = fly_again(run / "episodes" / "start.mcap")
    assert not again.is_equal
    assert again.is_close == is_close
    assert again.greatest > 0.0
    assert again.where


def test_a_recording_that_does_not_say_what_was_flown_is_refused(run, tmp_path):
    told = dict(telemetry.read(run / "episodes" / "start.mcap").metadata["episode"])
    with telemetry.EpisodeWriter(tmp_path / "bare.mcap", metadata={"episode": told}, attachments={}):
        pass
    with pytest.raises(RecordingError, match=r"has no attachment config\.yaml; it cannot be flown again"):
        fly_again(tmp_path / "bare.mcap")
