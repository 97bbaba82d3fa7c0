"""A disk that fills up: the error says what to do, and what a run has so far stands."""

import errno
import os
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import BinaryIO

import numpy as np
import pyarrow.parquet as pq
import pytest

from fis_tools.formats import serialize
from pipeline.command_line.config import Job
from pipeline.run import artifacts
from pipeline.stages import record, train
from telemetry.file import partial_file
from tests.pipeline.stages.cases import prepared

STOPPED = "No space left on device; make room"


class Disk:
    """Counts the files that `artifacts` begins, and refuses all from one of them on but the named ones."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, num_files: int, spared: tuple[str, ...] = ()):
        self.room, self.spared = num_files, spared
        self.write = artifacts.beside
        monkeypatch.setattr(artifacts, "beside", self.beside)
        monkeypatch.setattr(train, "WRITE_EVERY_S", 0.0)

    @contextmanager
    def beside(self, path: Path) -> Iterator[BinaryIO]:
        self.room -= 1
        if self.room < 0 and not f".{path.name}".startswith(self.spared):
            raise artifacts.WriteError(f"{path} cannot be written: {STOPPED}")
        with self.write(path) as stream:
            yield stream


@pytest.fixture(scope="module")
def trained(tmp_path_factory: pytest.TempPathFactory) -> tuple[Job, Path]:
    folder = tmp_path_factory.mktemp("trained")
    run = prepared(folder)
    train.run(run.experiment, folder)
    return run, folder


def genomes(folder: Path) -> np.ndarray:
    return np.array(pq.read_table(folder / artifacts.HISTORY)["genome"].to_pylist())


# a generation writes its checkpoint, its champion's flight if that is new, the logbook and the history
@pytest.mark.parametrize(("num_files", "num_generations"), [(1, 1), (7, 2), (8, 3), (9, 3)])
def test_training_stops_with_its_champion_and_goes_on_once_there_is_room(
    trained: tuple[Job, Path],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    num_files: int,
    num_generations: int,
) -> None:
    run = prepared(tmp_path).experiment
    with monkeypatch.context() as patched:
        Disk(patched, num_files, spared=(".champion",))
        with pytest.raises(artifacts.WriteError, match=STOPPED) as stopped:
            train.run(run, tmp_path)
    assert f"stopped after {num_generations} generations and its champion is kept in" in str(stopped.value)
    assert f"{artifacts.CHAMPION}. To go on: python -m pipeline resume={tmp_path}" in str(stopped.value)
    champion = serialize.load(tmp_path / artifacts.CHAMPION)
    assert dict(champion.provenance)["generations"] == str(num_generations)
    assert not list(tmp_path.rglob("*.partial")) + list(tmp_path.glob("train/.*"))
    train.run(replace(run, resume=True), tmp_path)
    np.testing.assert_array_equal(genomes(tmp_path), genomes(trained[1]))


def test_without_room_for_the_champion_the_checkpoint_keeps_it(
    trained: tuple[Job, Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    run = prepared(tmp_path).experiment
    with monkeypatch.context() as patched:
        Disk(patched, 6)
        with pytest.raises(artifacts.WriteError, match=artifacts.CHECKPOINT):
            train.run(run, tmp_path)
    assert not (tmp_path / artifacts.CHAMPION).exists()
    train.run(replace(run, resume=True), tmp_path)
    np.testing.assert_array_equal(genomes(tmp_path), genomes(trained[1]))


def test_before_the_first_generation_the_file_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    run = prepared(tmp_path).experiment
    Disk(monkeypatch, 0)
    with pytest.raises(artifacts.WriteError, match=rf"{artifacts.CHECKPOINT} cannot be written: {STOPPED}"):
        train.run(run, tmp_path)
    assert not (tmp_path / artifacts.CHAMPION).exists()


def test_a_disk_that_fills_up_while_flights_are_recorded_leaves_the_champion(
    trained: tuple[Job, Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    run, folder = trained
    before = (folder / artifacts.CHAMPION).read_bytes()
    open_stream = partial_file.open_stream

    def open_once(path: Path) -> object:
        if path.name.startswith("training-1"):
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        return open_stream(path)

    monkeypatch.setattr(partial_file, "open_stream", open_once)
    telemetry = replace(run.experiment.telemetry, record_ranked=False)
    with pytest.raises(artifacts.ArtifactError, match=r"No space left on device.*make room"):
        record.run(replace(run.experiment, telemetry=telemetry), folder)
    assert (folder / artifacts.CHAMPION).read_bytes() == before
    assert [path.name for path in (folder / artifacts.RECORDINGS).iterdir()] == ["training-0.mcap"]
