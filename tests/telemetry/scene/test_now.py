"""The line on top of a replay, for recordings that tell reasons and for those that do not."""

from pathlib import Path

import numpy as np
import pytest

import telemetry
from telemetry import EpisodeWriter
from telemetry.file import topics
from telemetry.file.metadata import FisDescription
from telemetry.file.reader import Recording
from telemetry.scene import drawing

INSPECTED = (1, 1, 2, 3)


@pytest.fixture
def recording(tmp_path: Path) -> Recording:
    """Of three points: a burn by two rules, a force that is not fired, coasting, all inspected, the end."""
    rules = ("if far then pull", "if near then push")
    words = FisDescription(
        input_names=("distance",), input_units=("m",), output_name="f_y", output_unit="N", rules=rules
    )
    path = tmp_path / "tiny.mcap"
    with EpisodeWriter(path, metadata={"fis.pilot": words.to_metadata()}, attachments={}) as writer:
        for place, count in enumerate((*INSPECTED, 3)):
            time = 10.0 * place
            mask = [index < count for index in range(3)]
            writer.mission(time, sun_angle_rad=0.0, distance_m=50.0, inspected_mask=mask, delta_v_m_s=0.0)
            if place < len(INSPECTED):
                force = [0.0, -0.04 * (place == 0), 0.03 * (place == 0)]
                writer.control(time, [0.0] * 3, force, [0.0] * 3, [topics.Reason.UNKNOWN] * 3)
            if place < 2:
                shares = [0.01, -0.05] if place == 0 else [0.0, 0.0]
                writer.fis(time, "pilot", [80.0], [0.9, 0.25], -0.04, shares)
    return telemetry.read(path)


def test_what_is_done_follows_from_what_is_recorded(recording: Recording) -> None:
    assert drawing.now_in_words(recording, drawing.sample_times(recording)) == [
        "Firing 50 mN backwards and along the orbit normal, mostly by rule 2 of pilot: 2 points left",
        "No burn: 2 points left",
        "Coasting: 1 point left",
        "Coasting: every point is inspected",
        "The flight is over: 0 points left",
    ]


@pytest.mark.parametrize(
    ("reasons", "missed", "expected"),
    [
        (["dead_band"] * 3, np.nan, "No burn: what the rules ask for is below the dead band: 2 points left"),
        (["waiting"] * 3, np.nan, "No burn until the next decision: 2 points left"),
        (["coasting"] * 3, 0.0, "Coasting: 2 points left, all foreseen"),
        (["coasting"] * 3, 1.0, "Coasting: 2 points left, 1 of them foreseen"),
        (["complete"] * 3, np.nan, "Coasting: every point is inspected"),
    ],
)
def test_a_recorded_reason_is_taken(
    recording: Recording, reasons: list[str], missed: float, expected: str
) -> None:
    assert drawing.now_in_words(told(recording, 1, reasons, missed), np.array([10.0])) == [expected]


def test_what_the_thruster_or_the_safety_layer_changed_is_told(recording: Recording) -> None:
    (line,) = drawing.now_in_words(
        told(recording, 0, ["fired", "clipped", "safety"], np.nan), np.array([0.0])
    )
    assert line.endswith("of pilot, at the thruster's limit, changed by the safety layer: 2 points left")


def told(recording: Recording, place: int, reasons: list[str], missed: float) -> Recording:
    """The same recording, with reasons for one control period."""
    control = recording[topics.DEPUTY_CONTROL]
    words = np.full((len(control), 3), "fired", dtype="U9")
    words[place] = reasons
    columns = {**control.columns, "reason": words, "coasting_missed": np.full(len(control), missed)}
    told_control = telemetry.file.reader.TopicColumns(
        control.topic, control.schema, control.time_s, columns, control.units
    )
    return Recording(
        recording.path,
        {**recording.topics, topics.DEPUTY_CONTROL: told_control},
        recording.metadata,
        recording.attachments,
    )


def test_rules_are_ranked_by_their_shares(recording: Recording) -> None:
    first, second, *_ = drawing.inference_in_words(recording, drawing.sample_times(recording))
    assert first.splitlines()[1:] == [
        "  - `-0.0500 N` rule 2 (0.25): if near then push",
        "  - `+0.0100 N` rule 1 (0.90): if far then pull",
    ]
    assert second.splitlines()[1:] == [
        "  - rule 1 (0.90): if far then pull",
        "  - rule 2 (0.25): if near then push",
    ]
