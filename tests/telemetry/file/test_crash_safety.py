"""What a cut at any byte and a killed process leave: every flushed sample, and never a wrong one."""

import random
from pathlib import Path

import numpy as np
import pytest

import telemetry
from telemetry import EpisodeWriter, RecordingError
from telemetry.file.reader import Recording
from telemetry.file.recover import recover
from tests.telemetry import synthetic_flight

NUM_CUTS = 200
NUM_CONTROLS = 115
#: samples that end in an event, which brings them to the file at once
EVENTS = (25, 90)
#: (bytes in the file, samples that have been flushed by then)
Flushes = list[tuple[int, int]]


@pytest.fixture(scope="module")
def flown(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Flushes]:
    """A recording, and what the disk held of it while it was written."""
    flight = synthetic_flight.fly(NUM_CONTROLS)
    path = tmp_path_factory.mktemp("flown") / "flight.mcap"
    partial = path.with_name("flight.mcap.partial")
    flushes = []
    metadata = synthetic_flight.metadata(flight)
    with EpisodeWriter(path, metadata=metadata, attachments=synthetic_flight.ATTACHMENTS) as writer:
        flushes.append((partial.stat().st_size, 0))
        for k in range(NUM_CONTROLS + 1):
            synthetic_flight.write_sample(writer, flight, k)
            if partial.stat().st_size > flushes[-1][0]:
                # the sample after the sixtieth brings those before it to the file
                flushes.append((partial.stat().st_size, k))
            if k in EVENTS:
                writer.log(float(flight.time_s[k]), "warning", f"sample {k}")
                flushes.append((partial.stat().st_size, k + 1))
    return path, flushes


def assert_is_beginning(rescued: Recording, whole: Recording) -> int:
    """Compare every value of what came back with the original; return how many whole samples it holds."""
    for name, topic in rescued.topics.items():
        original = whole[name]
        np.testing.assert_array_equal(topic.time_s, original.time_s[: len(topic)])
        for field, values in topic.columns.items():
            np.testing.assert_array_equal(values, original[field][: len(topic)], err_msg=f"{name} {field}")
    for name, entries in rescued.metadata.items():
        assert name == "recovery" or entries == whole.metadata[name]
    for name, content in rescued.attachments.items():
        assert content == whole.attachments[name]
    lengths = {name: len(topic) for name, topic in rescued.topics.items()}
    states, inferences = lengths.get("/mission", 0), lengths.get("/fis/f_z", 0)
    # the last sample of a flight has no inference
    return states if inferences == len(whole["/fis/f_z"]) else min(states, inferences)


def test_samples_reach_the_disk_every_sixty_and_with_every_event(flown: tuple[Path, Flushes]) -> None:
    _, flushes = flown
    assert [samples for _, samples in flushes] == [0, 26, 86, 91]


@pytest.mark.slow
def test_a_cut_at_any_byte_loses_no_flushed_sample_and_tells_no_wrong_one(
    flown: tuple[Path, Flushes], tmp_path: Path
) -> None:
    path, flushes = flown
    content, whole = path.read_bytes(), telemetry.read(path)
    generator = random.Random(2606)  # noqa: S311 - where to cut
    # kind, length of the record, length of its name: 13 bytes before the name of the second record
    first_record_end = content.index(b"fis.f_x") - 13
    num_whole = []
    for num_bytes in sorted(generator.sample(range(len(content)), NUM_CUTS)):
        cut = tmp_path / f"cut_{num_bytes}.mcap.partial"
        cut.write_bytes(content[:num_bytes])
        output = tmp_path / f"rescued_{num_bytes}.mcap"
        num_flushed = max((samples for size, samples in flushes if size <= num_bytes), default=0)
        if num_bytes < first_record_end:
            with pytest.raises(RecordingError, match=r"nothing in .* is intact"):
                recover(cut, output)
            continue
        recover(cut, output)
        num_whole.append(assert_is_beginning(telemetry.read(output), whole))
        assert num_whole[-1] >= num_flushed, num_bytes
    assert len(num_whole) > 0.9 * NUM_CUTS
    assert {0, 26, 86, 91} <= set(num_whole)
