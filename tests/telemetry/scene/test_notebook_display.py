"""Flights and runs in a notebook: what is sent to the viewer there."""

from collections.abc import Callable
from pathlib import Path

import pytest
import rerun_notebook

import telemetry
from telemetry import RecordingError
from tests.telemetry import synthetic_run
from tests.telemetry.scene.rrd_content import Content


@pytest.fixture
def shown(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Callable[..., Content]:
    """Show something and return the content of what a notebook's page receives."""
    received: list[bytes] = []
    monkeypatch.setattr(rerun_notebook.Viewer, "send_rrd", lambda _, chunk: received.append(bytes(chunk)))

    def show(*paths: str | Path) -> Content:
        widget = telemetry.show(*paths)
        assert hasattr(widget, "_ipython_display_")
        for number, chunk in enumerate(received):
            (tmp_path / f"{number}.rrd").write_bytes(chunk)
        return Content(*(tmp_path / f"{number}.rrd" for number in range(len(received))))

    return show


def test_flights_are_shown(shown: Callable[..., Content], flight_file: Path, short_file: Path) -> None:
    content = shown(str(flight_file), short_file)
    assert len(content.column("/rules/words", "TextDocument:text")) == 361
    assert "/scene/flights/1/trail" in content.batches


def test_an_evaluation_is_shown(shown: Callable[..., Content], tmp_path: Path) -> None:
    run = synthetic_run.write_training(synthetic_run.write_evaluation(tmp_path / "run"))
    assert "/scene/paths/outside" in shown(run).batches


def test_a_training_is_shown(shown: Callable[..., Content], tmp_path: Path) -> None:
    assert "/scene/champion" in shown(synthetic_run.write_training(tmp_path / "run")).batches


def test_nothing_to_show_is_said(tmp_path: Path) -> None:
    with pytest.raises(
        RecordingError, match=r"nothing to show; give flights \(.mcap\), or the folder of a run"
    ):
        telemetry.show()
    with pytest.raises(RecordingError, match=r"has no train/history\.parquet"):
        telemetry.show(tmp_path)


def test_a_missing_notebook_part_is_said(short_file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("rerun.notebook.HAS_NOTEBOOK", False)
    with pytest.raises(RecordingError, match=r"pip install 'rerun-sdk\[notebook\]'"):
        telemetry.show(short_file)
