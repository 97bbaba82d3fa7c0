"""The arrays and words behind a replay, by hand: maps, rules, the line on top, names and letters."""

from dataclasses import replace
from pathlib import Path
from types import MappingProxyType, SimpleNamespace

import numpy as np
import pytest

import telemetry
from telemetry import EpisodeWriter
from telemetry.file import topics
from telemetry.file.metadata import FisDescription
from telemetry.file.recording import Recording
from telemetry.scene import drawing
from telemetry.scene.curves import drawable, flight_names

PILOT = topics.fis_topic("pilot")
RULES = ("if far then pull", "if near then push")


def piloted(path, output_name, **inputs):
    """Write what one system of two rules flies."""
    fields = {"input_names": tuple(inputs), "input_units": tuple(inputs.values()), "rules": RULES}
    words = FisDescription(**fields, output_name=output_name, output_unit="N")
    return EpisodeWriter(path, metadata={"fis.pilot": words.to_metadata()}, attachments={})


@pytest.fixture
def recording(tmp_path):
    """Four samples; two rules fire in turn at the first two, then nothing is inferred."""
    path = tmp_path / "tiny.mcap"
    with piloted(path, output_name="f_x", distance="m", speed="") as writer:
        writer.record(PILOT, 0.0, inputs=[80.0, 0.25], firing_strengths=[1.0, 0.0], output_n=-0.5)
        writer.record(PILOT, 10.0, inputs=[20.0, 0.5], firing_strengths=[0.25, 0.5], output_n=0.125)
        writer.record(topics.GUIDANCE, 20.0, num_candidates=0, target_direction=[0, 0, 0])
        writer.record(topics.GUIDANCE, 30.0, num_candidates=0, target_direction=[0, 0, 0])
    return telemetry.read(path)


def test_map_has_time_to_the_right_and_rules_downwards(recording):
    assert drawing.sample_times(recording).tolist() == [0.0, 10.0, 20.0, 30.0]
    image, middles = drawing.activation_map(recording, drawing.sample_times(recording))
    height, width = image.shape
    quarters = [width // 8 + i * width // 4 for i in range(4)]
    assert image[height // 4, quarters].tolist() == [255, 64, 0, 0]
    assert image[3 * height // 4, quarters].tolist() == [0, 128, 0, 0]
    assert middles == [("pilot", height / 2)]
    lines = drawing.map_cursors(np.array([0.0, 15.0, 30.0]))
    assert lines[:, :, 0].tolist() == [[x, x] for x in (0.0, width / 2, width)]
    assert lines[:, :, 1].tolist() == [[0.0, height]] * 3


def test_words_name_what_was_told_and_the_strongest_rules_first(recording):
    first, second, third, _ = drawing.inference_in_words(recording, drawing.sample_times(recording))
    line = "- **f_x = -0.5000 N** · distance 80.000 m · speed 0.250"
    assert first.splitlines() == [line, "  - rule 1 (1.00): if far then pull"]
    assert second.index("rule 2 (0.50)") < second.index("rule 1 (0.25)")
    assert drawing.NO_INFERENCE in third
    assert drawing.NO_INFERENCE not in second


@pytest.mark.parametrize("boresight", [(-1.0, 0.0, 0.0), (0.0, 0.0, 2.0), (1.0, -1.0, 0.5)])
def test_view_cone_opens_by_its_half_angle(boresight):
    *rays, rim = drawing.view_cone(boresight, 0.3)
    axis = np.array(boresight) / np.linalg.norm(boresight)
    np.testing.assert_allclose(rim @ axis, 1.0)
    cosines = rim @ axis / np.linalg.norm(rim, axis=1)
    np.testing.assert_allclose(np.arccos(cosines), 0.3)
    np.testing.assert_allclose(rim[0], rim[-1], atol=1e-12)
    assert all(np.array_equal(ray[0], np.zeros(3)) for ray in rays)


INSPECTED = (1, 1, 2, 3)


@pytest.fixture
def flown(tmp_path):
    """Of three points: a burn by two rules, a force that is not fired, coasting, all inspected, the end."""
    path = tmp_path / "tiny.mcap"
    with piloted(path, output_name="f_y", distance="m") as writer:
        for index, count in enumerate((*INSPECTED, 3)):
            time = 10.0 * index
            mask = [index < count for index in range(3)]
            writer.record(topics.MISSION, time, inspected_count=count, inspected_mask=mask)
            if index < len(INSPECTED):
                force = [0.0, -0.04 * (index == 0), 0.03 * (index == 0)]
                writer.record(topics.DEPUTY_CONTROL, time, force_hill_n=force)
            if index < 2:
                fields = {"inputs": [80.0], "firing_strengths": [0.9, 0.25], "output_n": -0.04}
                writer.record(PILOT, time, **fields, shares_n=[0.01, -0.05] if index == 0 else [0.0, 0.0])
    return telemetry.read(path)


def test_what_is_done_follows_from_what_is_recorded(flown):
    assert drawing.now_in_words(flown, drawing.sample_times(flown)) == [
        "Firing 50 mN backwards and along the orbit normal, mostly by rule 2 of pilot: 2 points left",
        "No burn: 2 points left",
        "Coasting: 1 point left",
        "Coasting: every point is inspected",
        "The flight is over: 0 points left",
    ]


@pytest.mark.parametrize(
    ("index", "reasons", "missed", "expected"),
    [
        (1, ["dead_band"] * 3, np.nan, "No burn: what the rules ask for is below the dead band"),
        (1, ["waiting"] * 3, np.nan, "No burn until the next decision: 2 points left"),
        (1, ["coasting"] * 3, 0.0, "Coasting: 2 points left, all foreseen"),
        (1, ["coasting"] * 3, 1.0, "Coasting: 2 points left, 1 of them foreseen"),
        (1, ["complete"] * 3, np.nan, "Coasting: every point is inspected"),
        (0, ["fired", "clipped", "safety"], np.nan, "at the thruster's limit, changed by the safety layer: "),
    ],
)
def test_a_recorded_reason_is_taken(flown, index, reasons, missed, expected):
    (line,) = drawing.now_in_words(with_reasons(flown, index, reasons, missed), np.array([10.0 * index]))
    assert expected in line


def with_reasons(flown: Recording, index: int, reasons: list[str], missed: float) -> Recording:
    """The same flown, with reasons for one control period."""
    control = flown[topics.DEPUTY_CONTROL]
    words = np.full((len(control), 3), "fired", dtype="U9")
    words[index] = reasons
    columns = {**control.columns, "reason": words, "coasting_missed": np.full(len(control), missed)}
    return replace(flown, topics={**flown.topics, topics.DEPUTY_CONTROL: replace(control, columns=columns)})


def test_rules_are_ranked_by_their_shares(flown):
    first, second, *_ = drawing.inference_in_words(flown, drawing.sample_times(flown))
    far, near = "rule 1 (0.90): if far then pull", "rule 2 (0.25): if near then push"
    assert first.splitlines()[1:] == [f"  - `-0.0500 N` {near}", f"  - `+0.0100 N` {far}"]
    assert second.splitlines()[1:] == [f"  - {far}", f"  - {near}"]


def recordings(*paths: str) -> list[Recording]:
    empty = MappingProxyType({})
    return [Recording(path=Path(path), topics=empty, metadata=empty, attachments=empty) for path in paths]


@pytest.mark.parametrize(
    ("paths", "names"),
    [
        (["/a/x.mcap"], ["x"]),
        (["/a/x.mcap", "/a/y.mcap"], ["x", "y"]),
        (["/a/x.mcap", "/b/x.mcap"], ["a/x", "b/x"]),
        # the folder in common tells nothing
        (["/a/episodes/x.mcap", "/b/episodes/x.mcap", "/b/episodes/y.mcap"], ["a/x", "b/x", "y"]),
        (["/a/x.mcap", "/a/x.mcap"], ["x 1", "x 2"]),
    ],
)
def test_names_are_short_and_differ(paths, names):
    assert flight_names(recordings(*paths)) == names


@pytest.mark.parametrize(
    ("text", "drawn"),
    [
        ("Flug über Köln, полёт, πτήση, +0.5", "Flug über Köln, полёт, πτήση, +0.5"),
        ("Flug u\u0308ber", "Flug über"),
        ("飛行 🚀", "□□ □"),
        ("a\tb\x00c\nd", "a□b□c\nd"),
    ],
)
def test_signs_without_a_glyph_become_boxes(text, drawn):
    assert drawable(text) == drawn


def test_the_words_of_a_rule_say_whether_it_holds_back():
    description = SimpleNamespace(holding=(2,), output_unit="N", rules=("push", "coast", "pull"))
    strengths, shares = np.array([0.25, 0.5, 1.0]), np.array([0.125, -0.25, 0.0])
    words = [drawing._rule_words(description, rule, strengths, shares) for rule in range(3)]
    assert words == [
        "`+0.1250 N` rule 1 (0.25): push",
        "`-0.2500 N` holds back, rule 2 (0.50): coast",
        "`+0.0000 N` rule 3 (1.00): pull",
    ]
    assert drawing._rule_words(description, 1, strengths, np.zeros(3)) == "holds back, rule 2 (0.50): coast"
