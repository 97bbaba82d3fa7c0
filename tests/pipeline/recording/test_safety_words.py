"""What a flight's log and the report say of the safety layer."""

from pathlib import Path

import numpy as np
import pytest

from pipeline.flight.fly.simulation import fly_logged
from pipeline.flight.state.log import KEEP_IN, PASSIVE_SAFETY, SPEED
from pipeline.recording.events import Event, events
from pipeline.report.comparisons import Without, safety_words
from pipeline.run import artifacts
from tests.pipeline.flight.cases import STARTS, STEERING
from tests.pipeline.flight.guarded import EARLY, guarded, pushing, starts_at_rest
from tests.pipeline.report.runs import run_of
from tests.policies import Page

MISSION = guarded(EARLY)


def told(limits: dict[int, int], force_n: float = 0.012) -> list[Event]:
    """What is said of a flight in which the layer acts at some samples, by a force along one axis."""
    log = fly_logged(MISSION, STEERING, STARTS[0])
    limit, force = np.zeros(360, dtype=np.int64), np.zeros((360, 3))
    for sample, name in limits.items():
        limit[sample], force[sample, 1] = name, -force_n
    found = events(MISSION, log._replace(safety_limit=limit, safety_force_hill_n=force), 5.0)
    return [event for event in found if "safety layer" in event.text]


def test_it_begins_for_a_reason_and_ceases_with_an_account() -> None:
    assert told({}) == []
    # 12 mN over 10 s on 12 kg are 0.01 m/s
    begin, cease, end = told({20: PASSIVE_SAFETY, 21: PASSIVE_SAFETY, 25: KEEP_IN})
    assert begin == Event(20, "warning", "safety layer acts: passive safety")
    assert (cease.sample, cease.level) == (26, "info")
    assert "ceases to act: passive safety, keep-in; it changed the force in 3 of 6 periods, by" in cease.text
    assert cease.text.endswith(" 0.0300 m/s")
    assert end.text.endswith(", always inside the limits, safety layer acted in 3 periods (0.0300 m/s)")
    # short rests are no end and long ones are
    samples = [event.sample for event in told({100: SPEED, 106: SPEED, 113: SPEED, 359: SPEED})]
    assert samples == [100, 107, 113, 114, 359, 360, 360]


def test_a_real_flight_tells_what_its_numbers_are() -> None:
    (start,) = starts_at_rest(1, 3)
    log = fly_logged(MISSION, pushing(1.0), start)
    found = events(MISSION, log, 0.0)
    changed = np.abs(log.safety_force_hill_n).sum() * 10.0 / 12.0
    acted = np.count_nonzero(log.safety_limit)
    assert found[-1].text.endswith(f"safety layer acted in {acted} periods ({changed:.4f} m/s)")
    assert not any(event.level == "error" for event in found)
    begins = [event.sample for event in found if event.text.startswith("safety layer acts: ")]
    assert begins[0] == np.flatnonzero(log.safety_limit)[0]


def test_the_report_tells_how_often_how_long_and_what_it_cost() -> None:
    told = {
        "num_cases": 1000,
        "safety_acted": {"count": 20, "fraction": 0.02, "low": 0.013, "high": 0.031},
        "safety_periods": {"mean": 0.21},
        "safety_delta_v_m_s": {"mean": 0.0007, "maximum": 0.0912},
    }
    words = safety_words("evaluation", told, None)
    assert (
        "In the evaluation it acted in 20 of 1,000 flights (2.0 %, 1.3 to 3.1 %), in these for 10.5" in words
    )
    assert "by 0.0350 m/s in the mean; over all flights its changes come to 0.0007 m/s a flight" in words
    assert words.endswith("at most 0.0912 m/s in one.")
    log = fly_logged(MISSION, STEERING, STARTS[0])
    for count, how_many in ((0, "none"), (1, "one"), (14, "14")):
        with_more = safety_words("evaluation", told, Without(count, 3, log, log))
        assert with_more == f"{words} Without it, {how_many} of these flights would have left the limits."
    idle = told | {"safety_acted": {"count": 0, "fraction": 0.0, "low": 0.0, "high": 0.0038}}
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
