"""Reads a recording, or a part of it, into typed columns."""

import os
import shlex
import struct
import zlib
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from fnmatch import fnmatchcase
from math import inf
from operator import itemgetter
from pathlib import Path
from typing import BinaryIO, Final

import numpy as np
import zstandard
from google.protobuf.message import DecodeError
from mcap.exceptions import McapError
from mcap.reader import FOOTER_SIZE, SeekingReader
from mcap.records import Channel, Footer, Schema
from mcap.stream_reader import MAGIC_SIZE, StreamReader
from mcap.writer import MCAP0_MAGIC

from fis_tools.file_access import open_regular
from telemetry.file import RecordingError, claims, columns, explained, topics
from telemetry.file.metadata import FisDescription, unsealed
from telemetry.file.recording import Recording, TopicColumns

__all__ = ["Recording", "RecordingError", "read"]

CHECKSUM_SIZE: Final = 4
#: what the mcap library raises on damaged bytes
DAMAGE: Final = (
    *(McapError, DecodeError, zstandard.ZstdError, struct.error),
    *(ValueError, KeyError, OverflowError, MemoryError, OSError, RecursionError),
)


def read(
    path: Path | str,
    topics: str | Iterable[str] | None = None,
    start_s: float | None = None,
    end_s: float | None = None,
) -> Recording:
    """Read a recording, or a part of it.

    Chunks outside the requested time are not read.

    Parameters
    ----------
    path : Path or str
    topics : str or iterable of str, optional
        Topics to read, all by default; ``*`` matches any part of a name, and a pattern may match none.
    start_s, end_s : float, optional
        First and last simulation time to read, inclusive; infinity is no limit.

    Returns
    -------
    Recording

    Raises
    ------
    RecordingError
        If the file is missing, truncated, damaged or not an MCAP file, if it lacks a requested topic, or if
        the end is before the start.
    """
    path = Path(path)
    _check_span(start_s, end_s)
    wanted = [topics] if isinstance(topics, str) else None if topics is None else list(topics)
    with _opened(path) as stream, damage_explained(path):
        _check_summary(stream)
        reader = SeekingReader(stream, validate_crcs=True)
        _check_claims(reader, stream)
        chosen = _chosen_channels(path, reader, wanted)
        metadata = {record.name: unsealed(record.name, record.metadata) for record in reader.iter_metadata()}
        attachments = {record.name: record.data for record in reader.iter_attachments()}
        messages = _messages(reader, chosen.keys(), start_s, end_s, path.stat().st_size)
        streams = {
            topic: _topic_columns(topic, schema, messages[topic], metadata)
            for topic, schema in chosen.items()
        }
        return Recording(path, streams, metadata, attachments)


def _check_span(start_s: float | None, end_s: float | None) -> None:
    """Raise RecordingError unless there is time between start and end."""
    first, last = -inf if start_s is None else start_s, inf if end_s is None else end_s
    # also false if one is NaN
    if not (first <= last and first < inf and last > -inf):
        raise RecordingError(
            f"from start_s={start_s} to end_s={end_s} there is no time; "
            "give a start that is not after the end"
        )


@contextmanager
def damage_explained(path: Path) -> Iterator[None]:
    """Turn the errors of the mcap library on damaged bytes into a `RecordingError`."""
    try:
        yield
    except DAMAGE as error:
        raise RecordingError(
            f"{path} is damaged ({error or type(error).__name__}), but only intact recordings can be read; "
            f"rescue what can be read with `python -m telemetry recover {shlex.quote(str(path))}`"
        ) from error


@contextmanager
def _opened(path: Path) -> Iterator[BinaryIO]:
    """Open a recording and check that it is whole."""
    with explained(f"{path} cannot be opened", "give the path of a recording, a .mcap file"):
        stream = open_regular(path)
    with stream:
        check_is_whole(path, stream)
        yield stream


def check_is_whole(path: Path, stream: BinaryIO) -> None:
    """Check that a file begins and ends like an MCAP file.

    Raises
    ------
    RecordingError
        If it does not; the message distinguishes a truncated recording from another kind of file.
    """
    head = stream.read(MAGIC_SIZE)
    if not head or not MCAP0_MAGIC.startswith(head):
        what = "is empty" if not head else "is not an MCAP file"
        raise RecordingError(
            f"{path} {what}, but a recording is an MCAP file that telemetry.EpisodeWriter wrote; "
            "give the path of a .mcap file"
        )
    size = stream.seek(0, os.SEEK_END)
    stream.seek(max(size - MAGIC_SIZE, 0))
    tail = stream.read()
    stream.seek(0)
    if size < 2 * MAGIC_SIZE or tail != MCAP0_MAGIC:
        raise RecordingError(
            f"{path} is truncated, but only intact recordings can be read; "
            f"rescue every flushed step with `python -m telemetry recover {shlex.quote(str(path))}`"
        )


def _check_summary(stream: BinaryIO) -> None:
    """Check the index against its checksum, which the library does not do."""
    stream.seek(-(FOOTER_SIZE + MAGIC_SIZE), os.SEEK_END)
    footer = next(StreamReader(stream, skip_magic=True).records)
    if not isinstance(footer, Footer):
        raise McapError("it has no footer")
    end = stream.seek(-(MAGIC_SIZE + CHECKSUM_SIZE), os.SEEK_END)
    stream.seek(footer.summary_start)
    if zlib.crc32(stream.read(end - footer.summary_start)) != footer.summary_crc:
        raise McapError("its index does not match its checksum")
    stream.seek(0)


def _check_claims(reader: SeekingReader, stream: BinaryIO) -> None:
    """Check the unpacked size of chunks before any is unpacked, and the attachments."""
    size, summary = stream.seek(0, os.SEEK_END), reader.get_summary()
    claims.check_index(claims.chunk_claims(stream, size), summary.chunk_indexes if summary else ())
    for index in summary.attachment_indexes if summary else ():
        stream.seek(index.offset)
        check_attachment(stream.read(index.length))


def check_attachment(record_bytes: bytes) -> None:
    """Check an attachment against its checksum, which the library does not do.

    Raises
    ------
    McapError
        If it does not match.
    """
    checksum = int.from_bytes(record_bytes[-CHECKSUM_SIZE:], "little")
    if zlib.crc32(record_bytes[claims.FRAME.size : -CHECKSUM_SIZE]) != checksum:
        raise McapError("an attachment does not match its checksum")


def _chosen_channels(path: Path, reader: SeekingReader, wanted: list[str] | None) -> dict[str, str]:
    """Return the wanted topics of a file, each with the name of its schema."""
    summary = reader.get_summary()
    if summary is None:
        raise McapError("it has no summary")
    schemas: dict[int, Schema] = summary.schemas
    channels: Iterable[Channel] = summary.channels.values()
    available = {
        channel.topic: schemas[channel.schema_id].name
        for channel in channels
        if channel.message_encoding == "protobuf" and schemas[channel.schema_id].name in columns.DECODERS
    }
    if wanted is None:
        return available
    for pattern in wanted:
        if "*" not in pattern and pattern not in available:
            raise RecordingError(
                f"{path} has no topic {pattern!r}; choose from {', '.join(sorted(available)) or 'none'}"
            )
    return {
        topic: schema
        for topic, schema in available.items()
        if any(fnmatchcase(topic, pattern) for pattern in wanted)
    }


def _messages(
    reader: SeekingReader, chosen: Iterable[str], start_s: float | None, end_s: float | None, size: int
) -> dict[str, list[tuple[int, bytes]]]:
    """Return the times (ns) and contents of the messages of each topic, in order of time."""
    messages: dict[str, list[tuple[int, bytes]]] = defaultdict(list)
    most = claims.most_messages(size)
    decoded = reader.iter_messages(
        topics=list(chosen),
        starting_at=None if start_s is None or start_s == -inf else round(start_s * topics.NANOSECONDS),
        ending_before=None if end_s is None or end_s == inf else round(end_s * topics.NANOSECONDS) + 1,
        # a queue that orders the messages of all topics takes as long as all the rest
        log_time_order=False,
    )
    for count, (_schema, channel, message) in enumerate(decoded, start=1):
        if count > most:
            raise McapError(f"it holds more than {most} messages, which is all that is read of {size} bytes")
        messages[channel.topic].append((message.log_time, message.data))
    for of_topic in messages.values():
        of_topic.sort(key=itemgetter(0))
    return messages


def _topic_columns(
    topic: str, schema: str, messages: list[tuple[int, bytes]], metadata: Mapping[str, Mapping[str, str]]
) -> TopicColumns:
    """Decode the messages of a topic to columns with units."""
    decoded = columns.DECODERS[schema]([content for _, content in messages])
    units = {field: topics.unit_of(field) for field in decoded}
    fis_metadata = metadata.get(topics.FIS_METADATA_PREFIX + topic.removeprefix(topics.FIS_PREFIX))
    if topic.startswith(topics.FIS_PREFIX) and fis_metadata is not None and "input_units" in fis_metadata:
        units["inputs"] = ", ".join(FisDescription.from_metadata(fis_metadata).input_units)
    if topic == topics.CHIEF_POINTS and "state" not in decoded:
        raise ValueError(f"the points on {topic} have no colours")
    if topic == topics.CHIEF_PULLS:
        units |= metadata.get(topics.PULLS_METADATA, {})
    time_s = np.array([time_ns for time_ns, _ in messages], dtype=np.float64) / topics.NANOSECONDS
    return TopicColumns(topic, schema, time_s, decoded, units)
