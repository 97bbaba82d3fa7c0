"""Recorded flights are flown again from nothing but their files."""

import dataclasses
import shutil

import numpy as np
import pytest

import telemetry
from pipeline.command_line.cli import main
from pipeline.recording import reflight
from pipeline.recording.reflight import fly_again
from telemetry import RecordingError


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    folder = tmp_path_factory.mktemp("flown") / "run"
    words = ["+experiment=fly", "controller=paper_champion", "duration_s=300", f"hydra.run.dir={folder}"]
    assert main(words) == 0
    return folder


def test_a_flight_repeats_to_the_last_bit(run):
    again = fly_again(run / "episodes" / "start.mcap")
    assert (again.is_equal, again.is_close, again.greatest) == (True, True, 0.0)


def test_verify_flies_what_is_recorded(run, capsys):
    assert main(["verify", str(run)]) == 0
    assert "start.mcap: flown again, equal to the last bit" in capsys.readouterr().out


@pytest.mark.parametrize(("off", "is_close"), [(1e-9, True), (1e-3, False)])
def test_a_flight_from_elsewhere_is_told_apart(run, monkeypatch, off, is_close):
    """The log is flown from a start beside the one that is recorded."""
    fly = reflight.fly_logged

    def beside(mission, controller, scenario):
        return fly(mission, controller, dataclasses.replace(scenario, position_m=scenario.position_m + off))

    monkeypatch.setattr(reflight, "fly_logged", beside)
    again = fly_again(run / "episodes" / "start.mcap")
    assert not again.is_equal
    assert again.is_close == is_close
    assert again.greatest > 0.0
    assert again.where


def test_a_recording_that_does_not_say_what_was_flown_is_refused(run, tmp_path):
    path = tmp_path / "bare.mcap"
    recording = telemetry.read(run / "episodes" / "start.mcap")
    with telemetry.EpisodeWriter(
        path, metadata={"episode": dict(recording.metadata["episode"])}, attachments={}
    ):
        pass
    with pytest.raises(RecordingError, match=r"has no attachment config\.yaml; it cannot be flown again"):
        fly_again(path)
    assert np.isfinite(recording.episode.position_m).all()
    shutil.rmtree(tmp_path)
