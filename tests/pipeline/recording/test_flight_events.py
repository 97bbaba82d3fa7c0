"""Events of flights made by hand, and what the log and the report say of the safety layer."""

import dataclasses
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import telemetry
from fis_tools.model.thrust import thrust_logic
from pipeline.controllers.source import named
from pipeline.flight.fly.simulation import fly_logged
from pipeline.flight.state.log import KEEP_IN, PASSIVE_SAFETY, SPEED, FlightLog
from pipeline.recording import reflight
from pipeline.recording.events import Event, events
from pipeline.report.comparisons import Without
from pipeline.run import artifacts
from plain_files.document.html import template
from telemetry import RecordingError
from tests.pipeline.flight.cases import STARTS, STEERING
from tests.pipeline.flight.guarded import EARLY, guarded
from tests.pipeline.recording import cases
from tests.pipeline.report.runs import run_of
from tests.policies import Page

SHORT = ("duration_s=100.0",)
MISSION = cases.composed(*SHORT).experiment.mission


def flight(distance_m: list[float], inspected_count: list[int]) -> FlightLog:
    """Eleven samples at distances along i, with the first of 99 points inspected."""
    return cases.flown(*SHORT)._replace(
        position_m=np.array(distance_m)[:, np.newaxis] * [1.0, 0.0, 0.0],
        is_inspected=np.arange(99) < np.array(inspected_count)[:, np.newaxis],
        is_inspectable=np.ones(99, dtype=bool),
        delta_v_m_s=0.1 * np.arange(11.0),
        force_hill_n=np.ones((10, 3)),
    )


def sentences(distance_m: list[float], near_limit_m: float = 5.0) -> list[tuple[int, str]]:
    """Samples and levels of what happens besides the end."""
    *rest, end = events(MISSION, flight(distance_m, [0] * 11), near_limit_m)
    assert end.sample == 10
    assert end.text.startswith("end:")
    return [(event.sample, event.level) for event in rest]


def test_nothing_happens_far_from_the_limits_which_are_inside_themselves():
    assert sentences([75.0] * 11) == []
    assert sentences([15.0, 200.0] * 5 + [15.0], near_limit_m=0.0) == []


def test_approach_leave_and_return():
    distances = [30.0, 21.0, 19.0, 16.0, 14.9, 12.0, 15.0, 18.0, 24.0, 40.0, 40.0]
    assert sentences(distances) == [(2, "warning"), (4, "error"), (6, "info")]
    texts = [event.text for event in events(MISSION, flight(distances, [0] * 11), 5.0)]
    assert texts[0] == "19.0 m from the chief: 4.0 m from the least distance allowed (15 m)"
    assert texts[1] == "14.9 m from the chief: beyond the least distance allowed (15 m)"
    assert texts[2] == "15.0 m from the chief: inside the limits again"
    assert texts[3].endswith("12.0 to 40.0 m from the chief, outside the limits at 2 of 10 samples")
    # no warning is repeated at the edge of nearness
    assert sentences([196.0, 194.0] * 5 + [196.0]) == [(0, "warning")]
    assert sentences([75.0, 196.0, 75.0, 197.0, *[75.0] * 7]) == [(1, "warning"), (3, "warning")]


@pytest.mark.parametrize(("distance", "limit"), [(54.0, "least"), (56.0, "greatest")])
def test_the_nearer_of_two_limits_is_named(distance, limit):
    narrow = dataclasses.replace(MISSION.deputy, min_distance_m=50.0, max_distance_m=60.0)
    mission = dataclasses.replace(MISSION, deputy=narrow)
    first, *_ = events(mission, flight([distance] * 11, [0] * 11), 5.0)
    assert f"4.0 m from the {limit} distance allowed" in first.text


@pytest.mark.parametrize(("steps", "is_refused"), [(500, False), (556, True)])
def test_an_hour_of_more_periods_than_are_flown_again_is_refused(steps, is_refused):
    asked_of = SimpleNamespace(mission=SimpleNamespace(num_controls=360, num_attitude_steps=steps))
    recording = SimpleNamespace(path=Path("a.mcap"), topics={})
    if is_refused:
        with pytest.raises(RecordingError, match="asks for 200,160 periods of attitude"):
            reflight._check_length(recording, asked_of)
    else:
        reflight._check_length(recording, asked_of)


def test_a_flight_that_starts_outside_says_so_and_violates_nothing():
    distances = [10.0, *[50.0] * 10]
    assert sentences(distances) == [(0, "error"), (1, "info")]
    assert events(MISSION, flight(distances, [0] * 11), 5.0)[-1].text.endswith("always inside the limits")


def test_the_threshold_is_95_of_99_points():
    counts = [0, 50, 94, 94, 95, 96, 99, 99, 99, 99, 99]
    reached, complete, end = events(MISSION, flight([75.0] * 11, counts), 5.0)
    assert reached == Event(4, "info", "95 % reached: 95 of 99 points inspected, delta-v 0.400 m/s")
    assert complete == Event(6, "info", "complete: all 99 points inspected")
    assert end.level == "info"
    assert end.text.startswith("end: 99 of 99 points inspected (100.00 %), delta-v 1.000 m/s")
    assert events(MISSION, flight([75.0] * 11, [94] * 11), 5.0)[-1].level == "warning"
    assert events(MISSION, flight([75.0] * 11, [95] * 11), 5.0)[-1].level == "info"


@pytest.mark.parametrize(("last_force", "ending"), [(0.0, "no force from here on"), (0.1, "inspected")])
def test_complete_says_whether_the_deputy_coasts(last_force: float, ending: str):
    log = flight([75.0] * 11, [0] * 8 + [99] * 3)
    forces = np.ones((10, 3))
    forces[8:] = [[0.0, 0.0, 0.0], [0.0, last_force, 0.0]]
    assert events(MISSION, log._replace(force_hill_n=forces), 5.0)[1].text.endswith(ending)


@pytest.mark.parametrize(
    ("missed", "inside_m", "beyond_m", "why"),
    [
        (1.0, 2.0, -9.0, "come to {nearest:.1f} m from the chief, nearer than {low:.1f} m"),
        (1.0, -9.0, 2.0, "lead {farthest:.1f} m from the chief, farther than {high:.1f} m"),
        # points that would be missed are the reason, wherever coasting leads
        (5.0, 2.0, -9.0, "leave 5 of 99 points unseen"),
        (5.0, -9.0, 2.0, "leave 5 of 99 points unseen"),
        (5.0, -9.0, -9.0, "leave 5 of 99 points unseen"),
    ],
)
def test_coasting_ends_for_what_it_would_come_to(missed: float, inside_m: float, beyond_m: float, why: str):
    controller, log = named("champion_27", MISSION), flight([75.0] * 11, [0] * 11)
    assert controller.fuzzy is not None
    logic = thrust_logic(controller.fuzzy)
    low = MISSION.deputy.min_distance_m + logic.coast_margin_m
    high = MISSION.deputy.max_distance_m - logic.coast_margin_m
    assert 1.0 < logic.coast_below_points <= 5.0
    nearest, farthest = low - inside_m, high + beyond_m
    foreseen, is_decided = np.full_like(log.foreseen, np.nan), np.ones_like(log.is_decided)
    foreseen[2], is_decided[2] = [1.0, low + 9.0, high - 9.0], False
    foreseen[5] = missed, nearest, farthest
    none = np.zeros_like(log.command_reason)
    happened = events(
        MISSION, log._replace(foreseen=foreseen, is_decided=is_decided, command_reason=none), 5.0, controller
    )
    begins, ends = (event for event in happened if event.text.startswith("coasting"))
    assert (begins.sample, ends.sample) == (2, 5)
    words = why.format(nearest=nearest, farthest=farthest, low=low, high=high)
    assert ends.text == f"coasting ends: it would now {words}"


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    return cases.staged(tmp_path_factory.mktemp("run"), "controller=paper_champion", "duration_s=300")


@pytest.mark.parametrize(("off", "is_close"), [(1e-9, True), (1e-3, False)])
def test_a_flight_from_elsewhere_is_told_apart(recording, monkeypatch, off, is_close):
    """The log is flown from a start beside the one that is recorded."""
    fly = reflight.fly_logged

    def beside(mission, controller, scenario):
        return fly(mission, controller, dataclasses.replace(scenario, position_m=scenario.position_m + off))

    monkeypatch.setattr(reflight, "fly_logged", beside)
    again = reflight.fly_again(recording.path)
    assert not again.is_equal
    assert again.is_close == is_close
    assert again.greatest > 0.0
    assert again.where


def test_a_recording_that_does_not_say_what_was_flown_is_refused(recording, tmp_path):
    with telemetry.EpisodeWriter(tmp_path / "bare.mcap", metadata=recording.metadata, attachments={}):
        pass
    with pytest.raises(RecordingError, match=r"has no attachment config\.yaml; it cannot .* record the"):
        reflight.fly_again(tmp_path / "bare.mcap")


GUARDED = guarded(EARLY)


def layer_sentences(limits: dict[int, int]) -> list[Event]:
    """What is said of a flight in which the layer acts at some samples, by 12 mN along one axis."""
    log = fly_logged(GUARDED, STEERING, STARTS[0])
    limit, force = np.zeros(360, dtype=np.int64), np.zeros((360, 3))
    for sample, name in limits.items():
        limit[sample], force[sample, 1] = name, -0.012
    happened = events(GUARDED, log._replace(safety_limit=limit, safety_force_hill_n=force), 5.0)
    return [event for event in happened if "safety layer" in event.text]


def test_it_begins_for_a_reason_and_ceases_with_an_account() -> None:
    assert layer_sentences({}) == []
    # 12 mN over 10 s on 12 kg are 0.01 m/s
    begin, cease, end = layer_sentences({20: PASSIVE_SAFETY, 21: PASSIVE_SAFETY, 25: KEEP_IN})
    assert begin == Event(20, "warning", "safety layer acts: passive safety")
    assert (cease.sample, cease.level) == (26, "info")
    assert "ceases to act: passive safety, keep-in; it changed the force in 3 of 6 periods, by" in cease.text
    assert cease.text.endswith(" 0.0300 m/s")
    assert end.text.endswith(", always inside the limits, safety layer acted in 3 periods (0.0300 m/s)")
    # short rests are no end and long ones are
    samples = [event.sample for event in layer_sentences({100: SPEED, 106: SPEED, 113: SPEED, 359: SPEED})]
    assert samples == [100, 107, 113, 114, 359, 360, 360]


def safety_words(flights: str, summary: object, without: object) -> str:
    """Return what the report says of the safety layer of one deputy."""
    words = template("pipeline.report", "templates", "words.html").module
    return words.safety(flights, summary, None, without).strip()


def test_the_report_tells_how_often_how_long_and_what_it_cost() -> None:
    summary = {
        "num_cases": 1000,
        "safety_acted": {"count": 20, "fraction": 0.02, "low": 0.013, "high": 0.031},
        "safety_periods": {"mean": 0.21},
        "safety_delta_v_m_s": {"mean": 0.0007, "maximum": 0.0912},
    }
    words = safety_words("evaluation", summary, None)
    assert "In the evaluation it acted in 20 of 1,000 flights (2.0 %, 1.3 to 3.1 %)" in words
    assert "%), in these for 10.5" in words
    assert "by 0.0350 m/s on average; over all flights its changes come to 0.0007 m/s a flight" in words
    assert words.endswith("at most 0.0912 m/s in one.")
    log = fly_logged(GUARDED, STEERING, STARTS[0])
    for count, how_many in ((0, "none"), (1, "one"), (14, "14")):
        with_more = safety_words("evaluation", summary, Without(count, 3, 0, log, log))
        assert with_more == f"{words} Without it, {how_many} of these flights would have left the limits."
    idle = summary | {"safety_acted": {"count": 0, "fraction": 0.0, "low": 0.0, "high": 0.0038}}
    assert safety_words("training", idle, None).endswith("in 0 of 1,000 flights (0.0 %, 0.0 to 0.4 %).")
    assert safety_words("training", {"num_cases": 1000}, None) == ""


@pytest.mark.slow
def test_a_report_of_guarded_flights_has_their_paragraph_and_picture(tmp_path: Path) -> None:
    push = tmp_path / "push.csv"
    push.write_text("time_s,force_x_n,force_y_n,force_z_n\n0,0.9,0,0\n")
    words = ("+experiment=evaluate", "safety=filter", "controller=open_loop", f"controller.path={push}")
    run_of(tmp_path, ("evaluate", "report"), *words)
    page = Page((tmp_path / artifacts.REPORT).read_text(encoding="utf-8"))
    assert "it acted in 30 of 30 flights" in page.text["summary"]
    assert "would have left the limits" in page.text["summary"]
    assert "figure-safety" in {figure["id"] for figure in page.all("figure")}
    assert (tmp_path / artifacts.FIGURES / "safety.png").exists()
