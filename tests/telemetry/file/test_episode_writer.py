"""When a file appears, what a mistake says, and what survives a crash or a full disk."""

import re
from pathlib import Path

import numpy as np
import pytest

import telemetry
from telemetry import EpisodeWriter, RecordingError
from telemetry.file import topics
from telemetry.file.recover import recover
from tests.telemetry import synthetic_flight
from tests.telemetry.full_disk import fill_disk
from tests.telemetry.synthetic_flight import SyntheticFlight


def open_writer(flight: SyntheticFlight, path: Path) -> EpisodeWriter:
    return EpisodeWriter(path, metadata=synthetic_flight.metadata(flight), attachments={})


def test_a_file_takes_the_place_of_an_earlier_one_only_once_it_is_complete(short_flight, tmp_path):
    path = tmp_path / "flight.mcap"
    path.write_bytes(b"old")
    with open_writer(short_flight, path) as writer:
        synthetic_flight.write_samples(writer, short_flight, range(131))
        assert path.read_bytes() == b"old"
    assert [p.name for p in tmp_path.iterdir()] == ["flight.mcap"]
    assert len(telemetry.read(path)["/deputy/state"]) == 131


def test_an_exception_leaves_what_was_flown_to_be_rescued(short_flight, tmp_path):
    path = tmp_path / "flight.mcap"

    def fly_until_interrupted():
        with open_writer(short_flight, path) as writer:
            synthetic_flight.write_samples(writer, short_flight, range(41))
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        fly_until_interrupted()
    assert not path.exists()
    rescued = recover(path.with_name("flight.mcap.partial"))
    assert rescued.output == tmp_path / "flight.recovered.mcap"
    state = telemetry.read(rescued.output)["/deputy/state"]
    np.testing.assert_array_equal(state["position_m"], short_flight.position_m[:41])


@pytest.mark.parametrize("room", [0, 20_000, 90_000])
def test_a_full_disk_is_said_and_leaves_nothing_half_written(short_flight, tmp_path, monkeypatch, room):
    fill_disk(monkeypatch, room)
    path = tmp_path / "flight.mcap"
    with pytest.raises(RecordingError, match=r"No space left on device.*make room or choose another"):
        synthetic_flight.record(short_flight, path)
    assert not path.exists()
    monkeypatch.undo()
    if room == 90_000:
        recover(tmp_path / "flight.mcap.partial", tmp_path / "rescued.mcap")
        state = telemetry.read(tmp_path / "rescued.mcap")["/deputy/state"]
        assert len(state) >= 60
        np.testing.assert_array_equal(state["position_m"], short_flight.position_m[: len(state)])


def test_a_missing_folder_is_said(short_flight, tmp_path):
    with pytest.raises(RecordingError, match=r"nowhere/flight\.mcap cannot be written: No such file"):
        synthetic_flight.record(short_flight, tmp_path / "nowhere" / "flight.mcap")


@pytest.mark.parametrize(
    ("mistake", "text"),
    [
        (lambda w: w.log(5.0, "info", "before what is in the file"), "are in order of time"),
        (lambda w: w.record(topics.GUIDANCE, [20.0, 15.0], num_candidates=[1, 1]), "follows one of 20.0 s"),
        (lambda w: w.record(topics.DEPUTY_CONTROL, 20.0, force_body_n=np.zeros(2)), "has 2 values, but 3"),
        (lambda w: w.record(topics.DEPUTY_STATE, 20.0, place_m=np.zeros(3)), "has no field 'place_m'"),
        (lambda w: w.record("/fis/f_w", 20.0, inputs=[0.0]), "does not describe the fuzzy system 'f_w'"),
        (lambda w: w.log(20.0, "loud", "words"), "no log level 'loud'"),
        (lambda w: w.points(20.0, np.zeros((4, 3)), np.zeros(5)), "one state for each point"),
        (lambda w: w.points(20.0, np.zeros((4, 3)), np.full(4, 4)), "from 4 to 4, but 0 to 3"),
        (
            lambda w: w.record(topics.DEPUTY_ATTITUDE, 20.0, time_offset_s=[0, 1], torque_n_m=np.zeros(3)),
            "torque_n_m has 3 values, but 6",
        ),
    ],
)
def test_a_wrong_record_is_refused(short_flight, tmp_path, mistake, text):
    def fly_and_err():
        with open_writer(short_flight, tmp_path / "flight.mcap") as writer:
            synthetic_flight.write_samples(writer, short_flight, [1])
            writer.log(10.0, "info", "everything so far is in the file")
            mistake(writer)

    with pytest.raises(RecordingError, match=re.escape(text)):
        fly_and_err()
