"""Trainings are logged as in their logbook, as TensorBoard reads it back."""

import csv
import sys
import warnings
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import pytest

from pipeline.run import artifacts
from pipeline.settings.experiment import Logger, SettingError
from pipeline.stages import train
from pipeline.training.progress import logged, name_of
from tests.pipeline.stages.cases import prepared

ROWS = [{"generation": float(n), "best": 1.0 / (n + 3), "points": 90.0 + n} for n in range(5)]


def log_each(logger: Logger, rows: Sequence[Mapping[str, float]]) -> None:
    """As a training does, row after row."""
    with logged(logger, "outputs/train/x") as log:
        for count in range(1, len(rows) + 1):
            log(rows[:count])


def assert_on_board(folder: Path, rows: Sequence[Mapping[str, float]]) -> None:
    """A board keeps single precision."""
    pytest.importorskip("tensorboard")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # it says that TensorFlow is not there
        from tensorboard.backend.event_processing import event_accumulator  # noqa: PLC0415

        events = event_accumulator.EventAccumulator(str(folder))
        events.Reload()
    assert set(events.Tags()["scalars"]) == set(rows[0])
    for name in rows[0]:
        found = [(event.step, event.value) for event in events.Scalars(name)]
        np.testing.assert_allclose(found, [(step, row[name]) for step, row in enumerate(rows)], rtol=1e-6)


def test_tensorboard_shows_each_generation_once_also_after_going_on(tmp_path: Path) -> None:
    pytest.importorskip("tensorboardX")
    logger = Logger(kind="tensorboard", place=str(tmp_path))
    log_each(logger, ROWS[:4])
    log_each(logger, ROWS)
    assert_on_board(tmp_path / "outputs/train/x", ROWS)


def test_a_training_is_logged_as_in_its_logbook(tmp_path: Path) -> None:
    pytest.importorskip("tensorboardX")
    run = prepared(tmp_path / "run", "logger=tensorboard", f"logger.place={tmp_path / 'board'}")
    train.run(run.experiment, tmp_path / "run")
    with (tmp_path / "run" / artifacts.LOGBOOK).open(newline="", encoding="utf-8") as stream:
        rows = [{name: float(value) for name, value in row.items()} for row in csv.DictReader(stream)]
    assert_on_board(tmp_path / "board" / name_of(tmp_path / "run"), rows)


def test_a_missing_package_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "tensorboardX", None)
    with pytest.raises(SettingError, match=r"logger=tensorboard needs the package tensorboardX; install"):
        log_each(Logger(kind="tensorboard", place="x"), ROWS)
