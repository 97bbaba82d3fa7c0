"""Trainings are told of as in their logbook: read back by TensorBoard, and by MLflow from a file."""

import csv
import sys
import warnings
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pipeline.run import artifacts
from pipeline.settings.experiment import SettingError, Tracking
from pipeline.stages import train
from pipeline.training.tracking.sinks import name_of, tracked
from pipeline.training.tracking.told import Told
from tests.pipeline.stages.cases import prepared

FACTS = {"seed": "1", "config_hash": "0123abcd"}
ROWS = [{"generation": float(n), "best": 1.0 / (n + 3), "points": 90.0 + n} for n in range(5)]


def on_board(folder: Path) -> dict[str, list[tuple[int, float]]]:
    """What TensorBoard shows of a run."""
    pytest.importorskip("tensorboard")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # it says that TensorFlow is not there
        from tensorboard.backend.event_processing import event_accumulator  # noqa: PLC0415

        events = event_accumulator.EventAccumulator(str(folder))
        events.Reload()
    return {
        tag: [(event.step, event.value) for event in events.Scalars(tag)] for tag in events.Tags()["scalars"]
    }


def tell(tracking: Tracking, rows: Sequence[Mapping[str, float]], *, goes_on: bool) -> None:
    """As a training that ends after each row but the first."""
    told = Told("outputs/train/x", "train", FACTS, goes_on)
    with tracked(tracking, told) as sink:
        for count in range(1, len(rows) + 1):
            sink.tell(rows[:count])


def columns(rows: Sequence[Mapping[str, float]]) -> dict[str, list[tuple[int, float]]]:
    return {name: [(step, row[name]) for step, row in enumerate(rows)] for name in rows[0]}


def assert_close(
    found: Mapping[str, Sequence[tuple[int, float]]], rows: Sequence[Mapping[str, float]]
) -> None:
    """A board keeps single precision."""
    assert set(found) == set(rows[0])
    for name, values in columns(rows).items():
        np.testing.assert_allclose(found[name], values, rtol=1e-6)


def test_tensorboard_shows_each_generation_once_also_after_going_on(tmp_path: Path) -> None:
    pytest.importorskip("tensorboardX")
    tracking = Tracking(kind="tensorboard", place=str(tmp_path))
    tell(tracking, ROWS[:4], goes_on=False)
    tell(tracking, ROWS, goes_on=True)
    found = on_board(tmp_path / "outputs/train/x")
    assert_close(found, ROWS)


def test_a_training_is_told_of_as_in_its_logbook(tmp_path: Path) -> None:
    pytest.importorskip("tensorboardX")
    run = prepared(tmp_path / "run", "tracking=tensorboard", f"tracking.place={tmp_path / 'board'}")
    train.run(run.experiment, tmp_path / "run")
    with (tmp_path / "run" / artifacts.LOGBOOK).open(newline="", encoding="utf-8") as stream:
        rows = [{name: float(value) for name, value in row.items()} for row in csv.DictReader(stream)]
    found = on_board(tmp_path / "board" / name_of(tmp_path / "run"))
    assert_close(found, rows)


def in_store(place: str) -> Any:
    from mlflow import MlflowClient  # noqa: PLC0415

    return MlflowClient(tracking_uri=place)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")  # of MLflow's own libraries
def test_mlflow_keeps_each_generation_once_also_after_going_on(tmp_path: Path) -> None:
    pytest.importorskip("mlflow")
    place = f"sqlite:///{tmp_path}/deep/mlflow.db"
    tracking = Tracking(kind="mlflow", place=place)
    with pytest.raises(KeyboardInterrupt):
        interrupted(tracking)
    client = in_store(place)
    (group,) = [one for one in client.search_experiments() if one.name == "train"]
    (run,) = client.search_runs([group.experiment_id])
    assert run.info.status == "KILLED"
    tell(tracking, ROWS, goes_on=True)
    (run,) = client.search_runs([group.experiment_id])
    assert (run.info.run_name, run.info.status, run.data.params) == ("outputs/train/x", "FINISHED", FACTS)
    for name, values in columns(ROWS).items():
        history = client.get_metric_history(run.info.run_id, name)
        assert [(metric.step, metric.value) for metric in history] == values
    tell(tracking, ROWS[:2], goes_on=False)
    assert len(client.search_runs([group.experiment_id])) == 2


def interrupted(tracking: Tracking) -> None:
    with tracked(tracking, Told("outputs/train/x", "train", FACTS, False)) as sink:
        sink.tell(ROWS[:3])
        raise KeyboardInterrupt


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")
def test_a_store_that_cannot_be_is_refused_in_a_sentence() -> None:
    pytest.importorskip("mlflow")
    with pytest.raises(SettingError, match=r"MLflow does not write to tracking\.place, nowhere://"):
        tell(Tracking(kind="mlflow", place="nowhere://x"), ROWS, goes_on=False)


def test_what_is_missing_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(SettingError, match=r"tracking.kind is mlflow, but tracking.place is null"):
        Tracking(kind="mlflow")
    monkeypatch.setitem(sys.modules, "tensorboardX", None)
    monkeypatch.delitem(sys.modules, "pipeline.training.tracking.to_tensorboard", raising=False)
    with pytest.raises(SettingError, match=r"tracking=tensorboard needs the package tensorboardX; install"):
        tell(Tracking(kind="tensorboard", place="x"), ROWS, goes_on=False)
