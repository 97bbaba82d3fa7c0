"""A training as a recording, also while it grows."""

import os
import threading
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from telemetry import RecordingError
from telemetry.scene import runs, training, viewer
from tests.telemetry import synthetic_run
from tests.telemetry.scene.rrd_content import Content, views

SCALARS = "Scalars:scalars"


@pytest.fixture
def run(tmp_path: Path) -> Path:
    return synthetic_run.write_training(tmp_path / "trained")


def test_rounds_follow_one_another_and_champions_belong_to_their_rows(run: Path) -> None:
    read = runs.read_training(run)
    assert len(read) == 5
    assert sorted(read.tracks) == [0, 2, 3]
    np.testing.assert_array_equal(read.tracks[3], synthetic_run.champion_track(3))
    assert "genome" not in read.columns


def check_whole(path: Path) -> None:
    """Check that a recording holds all of the synthetic training."""
    content = Content(path)
    best = content.numbers("/curves/fitness/best", SCALARS)[:, 0]
    # where fitness is zero it has no logarithm
    np.testing.assert_allclose(best, [5.0, 5.0, 1.0, np.nan, np.nan], rtol=1e-12)
    assert content.generations("/curves/fitness/best", SCALARS) == [0, 1, 2, 3, 4]
    assert content.column("/curves/delta_v/delta_v_m_s", SCALARS) == [[2.5]] * 5
    assert content.column("/curves/flights/short", SCALARS) == [[3.0]] * 5
    strips = content.column("/scene/champion", "LineStrips3D:strips")
    assert content.generations("/scene/champion", "LineStrips3D:strips") == [0, 2, 3]
    for row, (strip,) in zip((0, 2, 3), strips, strict=True):
        np.testing.assert_array_equal(strip, synthetic_run.champion_track(row))
    words = [text for (text,) in content.column("/summary", "TextDocument:text")]
    assert len(words) == 5
    assert words[1].startswith("| round 1, generation 1 | fitness 100000 |")
    assert "| champion since | round 1, generation 0 |" in words[1]
    assert "| champion since | round 2, generation 0 |" in words[4]


def test_a_training_is_shown_generation_by_generation(run: Path, tmp_path: Path) -> None:
    viewer.save(training.scene(run), tmp_path / "x.rrd")
    check_whole(tmp_path / "x.rrd")
    kinds = sorted(kind for kind, _ in views(tmp_path / "x.rrd"))
    assert kinds == ["3D", "TextDocument", *["TimeSeries"] * 6]


def test_a_training_without_flights_is_shown(run: Path, tmp_path: Path) -> None:
    (run / "train/trajectories.parquet").unlink()
    viewer.save(training.scene(run), tmp_path / "x.rrd")
    content = Content(tmp_path / "x.rrd")
    assert len(content.column("/curves/fitness/best", SCALARS)) == 5
    assert "/scene/start" not in content.batches


def test_flights_that_came_after_the_history_was_read_wait(tmp_path: Path) -> None:
    """The pipeline writes a champion's flight before the generation that brought it."""
    synthetic_run.write_training(tmp_path, 5)
    flights = (tmp_path / "train/trajectories.parquet").read_bytes()
    synthetic_run.write_training(tmp_path, 2)
    (tmp_path / "train/trajectories.parquet").write_bytes(flights)
    assert sorted(runs.read_training(tmp_path).tracks) == [0]


def test_a_training_is_followed_to_its_end(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(training, "POLL_S", 0.01)
    folder, told = tmp_path / "run", []
    folder.mkdir()

    def until(condition: Callable[[], bool]) -> None:
        end = time.monotonic() + 60.0
        while not condition():
            assert time.monotonic() < end, told
            time.sleep(0.01)

    following = threading.Thread(
        target=training.follow,
        args=(folder, tmp_path / "grown.rrd"),
        kwargs={"in_browser": False, "report": told.append},
    )
    following.start()
    until(lambda: any("waiting for the first generation" in text for text in told))
    for num_rows in (1, 3, 5):
        synthetic_run.write_training(folder, num_rows)
        round_index, generation = synthetic_run.ROWS[num_rows - 1][:2]
        headline = f"round {round_index + 1}, generation {generation}: fitness "
        until(lambda headline=headline: told[-1].startswith(headline))
    assert following.is_alive()
    (folder / "champion.json").touch()
    following.join(60.0)
    assert not following.is_alive()
    check_whole(tmp_path / "grown.rrd")


def test_a_training_that_begins_anew_is_said(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    synthetic_run.write_training(tmp_path, 3)
    monkeypatch.setattr(training, "POLL_S", 0.0)

    def begin_anew(_text: str) -> None:
        synthetic_run.write_training(tmp_path, 1)

    with pytest.raises(RecordingError, match="has been restarted; follow it again"):
        training.follow(tmp_path, tmp_path / "x.rrd", in_browser=False, report=begin_anew)


def test_an_earlier_champion_does_not_end_a_training_that_goes_on(run: Path) -> None:
    champion, history = run / "champion.json", run / "train/history.parquet"
    assert not runs.is_finished(run)
    champion.touch()
    assert runs.is_finished(run)
    later = champion.stat().st_mtime_ns + 1_000_000
    os.utime(history, ns=(later, later))
    assert not runs.is_finished(run)


def test_wrong_folders_are_said(tmp_path: Path) -> None:
    with pytest.raises(
        RecordingError, match=r"has no train/history.parquet; give the folder of a run that trains"
    ):
        training.scene(tmp_path)
    with pytest.raises(RecordingError, match="is not a folder; give the folder of a run"):
        training.follow(tmp_path / "none", None, in_browser=True, report=print)


def test_a_damaged_history_is_said(run: Path) -> None:
    (run / "train/history.parquet").write_bytes(b"PAR1")
    with pytest.raises(RecordingError, match=r"history.parquet cannot be read"):
        training.scene(run)


def test_an_output_in_no_folder_is_said(run: Path, tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match=r"x.rrd cannot be written: No such file"):
        training.follow(run, tmp_path / "none" / "x.rrd", in_browser=False, report=print)
