"""The arrays and words behind a replay, by hand."""

from pathlib import Path

import numpy as np
import pytest

import telemetry
from telemetry import EpisodeWriter
from telemetry.file.metadata import FisDescription
from telemetry.file.reader import Recording
from telemetry.scene import drawing

RULES = ("if far then pull", "if near then push")


@pytest.fixture
def recording(tmp_path: Path) -> Recording:
    """Four samples; two rules fire in turn at the first two, then nothing is inferred."""
    description = FisDescription(
        input_names=("distance", "speed"),
        input_units=("m", ""),
        output_name="f_x",
        output_unit="N",
        rules=RULES,
    )
    path = tmp_path / "tiny.mcap"
    with EpisodeWriter(path, metadata={"fis.pilot": description.to_metadata()}, attachments={}) as writer:
        writer.fis(0.0, "pilot", [80.0, 0.25], [1.0, 0.0], -0.5)
        writer.fis(10.0, "pilot", [20.0, 0.5], [0.25, 0.5], 0.125)
        writer.guidance(20.0, 0, [0, 0, 0], 0.0, 0.0)
        writer.guidance(30.0, 0, [0, 0, 0], 0.0, 0.0)
    return telemetry.read(path)


def test_sample_times_are_those_of_all_topics(recording: Recording) -> None:
    assert drawing.sample_times(recording).tolist() == [0.0, 10.0, 20.0, 30.0]


def test_map_has_time_to_the_right_and_rules_downwards(recording: Recording) -> None:
    picture = drawing.activation_map(recording, drawing.sample_times(recording))
    assert picture is not None
    height, width = picture.image.shape
    quarters = [width // 8 + i * width // 4 for i in range(4)]
    assert picture.image[height // 4, quarters].tolist() == [255, 64, 0, 0]
    assert picture.image[3 * height // 4, quarters].tolist() == [0, 128, 0, 0]
    assert picture.band_names == ("pilot",)


def test_cursor_walks_across_the_map(recording: Recording) -> None:
    picture = drawing.activation_map(recording, drawing.sample_times(recording))
    assert picture is not None
    height, width = picture.image.shape
    lines = picture.cursors(np.array([0.0, 15.0, 30.0, 99.0]))
    assert lines[:, :, 0].tolist() == [[x, x] for x in (0.0, width / 2, width, width)]
    assert lines[:, :, 1].tolist() == [[0.0, height]] * 4


def test_map_marks_the_strongest_rule_where_its_row_is(recording: Recording) -> None:
    picture = drawing.activation_map(recording, drawing.sample_times(recording))
    assert picture is not None
    points, labels, lengths = picture.markers(np.array([0.0, 10.0, 20.0, 30.0]))
    height, width = picture.image.shape
    assert (labels, lengths) == (["rule 1", "rule 2"], [1, 1, 0, 0])
    np.testing.assert_allclose(points, [[0.0, height / 4], [width / 3, 3 * height / 4]], rtol=1e-6)


def test_words_name_what_was_told_and_the_strongest_rules_first(recording: Recording) -> None:
    first, second, third, _ = drawing.inference_in_words(recording, drawing.sample_times(recording))
    assert first.splitlines() == [
        "- **f_x = -0.5000 N** · distance 80.000 m · speed 0.250",
        "  - rule 1 (1.00): if far then pull",
    ]
    assert second.index("rule 2 (0.50)") < second.index("rule 1 (0.25)")
    assert drawing.NO_INFERENCE in third
    assert drawing.NO_INFERENCE not in second


@pytest.mark.parametrize("boresight", [(-1.0, 0.0, 0.0), (0.0, 0.0, 2.0), (1.0, -1.0, 0.5)])
def test_view_cone_opens_by_its_half_angle(boresight: tuple[float, float, float]) -> None:
    *rays, rim = drawing.view_cone(boresight, 0.3)
    axis = np.array(boresight) / np.linalg.norm(boresight)
    np.testing.assert_allclose(rim @ axis, 1.0)
    cosines = rim @ axis / np.linalg.norm(rim, axis=1)
    np.testing.assert_allclose(np.arccos(cosines), 0.3)
    np.testing.assert_allclose(rim[0], rim[-1], atol=1e-12)
    assert all(np.array_equal(ray[0], np.zeros(3)) for ray in rays)
