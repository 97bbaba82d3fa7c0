"""Reads a recording, or a part of it, into typed columns."""

import os
import shlex
import struct
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from fnmatch import fnmatchcase
from math import inf
from operator import itemgetter
from pathlib import Path
from typing import BinaryIO, Final

import numpy as np
import zstandard
from google.protobuf.message import DecodeError
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Channel, Chunk, McapRecord, Message, Schema
from mcap.stream_reader import MAGIC_SIZE
from mcap.writer import MCAP0_MAGIC

from plain_files.file_access import open_regular
from telemetry.file import RecordingError, claims, columns, explained, topics
from telemetry.file.layout import Layout
from telemetry.file.metadata import FisDescription, epoch_ns_of, unsealed
from telemetry.file.recording import Recording, TopicColumns
from telemetry.file.records import NO_SCHEMA, Extent, record, records_in
from telemetry.file.topics import EPISODE_METADATA

__all__ = ["Recording", "RecordingError", "read"]

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
    _check_span(start_s, end_s)
    wanted = [topics] if isinstance(topics, str) else None if topics is None else list(topics)
    recording, refusals = _read(Path(path), wanted, start_s, end_s)
    if refusals:
        raise next(iter(refusals.values()))
    return recording


def read_decoded(path: Path) -> tuple[Recording, dict[str, RecordingError]]:
    """Read a recording without the topics whose messages cannot be decoded.

    Returns
    -------
    Recording
    dict of str to RecordingError
        Why each of the topics that are left out cannot be decoded.

    Raises
    ------
    RecordingError
        If the file is missing, truncated, damaged or not an MCAP file.
    """
    return _read(path, None, None, None)


def _read(
    path: Path, wanted: list[str] | None, start_s: float | None, end_s: float | None
) -> tuple[Recording, dict[str, RecordingError]]:
    """Read a recording, or a part of it: what can be decoded, and why other topics cannot be."""
    with _opened(path) as stream, damage_explained(path):
        file = Layout.of(stream)
        metadata = {entry.name: unsealed(entry.name, entry.metadata) for entry in file.metadata()}
        attachments = {entry.name: entry.data for entry in file.attachments()}
        epoch_ns = epoch_ns_of(metadata.get(EPISODE_METADATA, {}))
        messages = _Messages(file, wanted, *_span_ns(start_s, end_s, epoch_ns))
        messages.read()
        streams, refusals = dict[str, TopicColumns](), dict[str, RecordingError]()
        for topic, schema in messages.schema_of(path).items():
            try:
                of_topic = messages.of_topic[topic]
                streams[topic] = _topic_columns(path, topic, schema, of_topic, epoch_ns, metadata)
            except RecordingError as refusal:
                refusals[topic] = refusal
        return Recording(path, streams, metadata, attachments), refusals


def _check_span(start_s: float | None, end_s: float | None) -> None:
    """Raise RecordingError unless there is time between start and end."""
    first, last = -inf if start_s is None else start_s, inf if end_s is None else end_s
    # also false if one is NaN
    if not (first <= last and first < inf and last > -inf):
        raise RecordingError(
            f"from start_s={start_s} to end_s={end_s} there is no time; "
            "give a start that is not after the end"
        )


def _span_ns(start_s: float | None, end_s: float | None, epoch_ns: int) -> tuple[int | None, int | None]:
    """Return the first and last time to read as messages have them, ns."""
    limits = (None if s is None or abs(s) == inf else round(s * topics.NANOSECONDS) for s in (start_s, end_s))
    start_ns, end_ns = (None if limit is None else limit + epoch_ns for limit in limits)
    return start_ns, end_ns


@contextmanager
def damage_explained(path: Path) -> Iterator[None]:
    """Turn the errors of the mcap library on damaged bytes into a `RecordingError`."""
    try:
        yield
    except RecordingError:
        raise
    except claims.NotReadError as error:
        raise RecordingError(f"{path} is not read: {error}; write it anew within these limits") from error
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


@dataclass
class _Messages:
    """The messages of the wanted topics within a time, as they are gathered from a file.

    Parameters
    ----------
    file : Layout
    wanted : list of str or None
        Topics and patterns; None for all.
    start_ns, end_ns : int or None
        The first and last time; None for no limit.
    of_topic : dict of str to list of (time, content)
    """

    file: Layout
    wanted: list[str] | None
    start_ns: int | None
    end_ns: int | None
    of_topic: dict[str, list[tuple[int, bytes]]] = field(default_factory=lambda: defaultdict(list))
    schemas: dict[int, Schema] = field(default_factory=dict)
    channels: dict[int, Channel] = field(default_factory=dict)
    _chosen: dict[int, bool] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Begin with what the summary describes."""
        self.schemas |= self.file.schemas
        self.channels |= self.file.channels

    def read(self) -> None:
        """Read what is asked for: all chunks only if that is needed to know which topics there are."""
        heads, num_messages, is_whole = self.file.chunk_heads(), 0, True
        if self.file.has_loose_messages:
            self.file.check_data()
        for frame in self.file.data:
            if frame.opcode in (Opcode.SCHEMA, Opcode.CHANNEL, Opcode.MESSAGE):
                num_messages += self._add(record(self.file.stream, frame))
            elif frame.opcode == Opcode.CHUNK:
                if not self._is_needed(frame, heads[frame.offset]):
                    is_whole = False
                    continue
                chunk = record(self.file.stream, frame)
                for entry in records_in(chunk) if isinstance(chunk, Chunk) else ():
                    num_messages += self._add(entry)
                    claims.check_total(0, num_messages, self.file.size)
        counted = None if self.file.statistics is None else self.file.statistics.message_count
        if is_whole and counted not in (None, num_messages):
            raise McapError(f"its summary counts {counted} messages; {num_messages} are there")
        for messages in self.of_topic.values():
            messages.sort(key=itemgetter(0))

    def _is_needed(self, frame: Extent, head: claims.ChunkHead) -> bool:
        """Return whether a chunk may hold what is asked for."""
        if not self.file.names_all_channels or self.file.has_loose_messages:
            return True
        is_early = self.start_ns is not None and head.end_ns < self.start_ns
        is_late = self.end_ns is not None and head.start_ns > self.end_ns
        if is_early or is_late:
            return False
        chosen = [number for number in self.channels if self._is_chosen(number)]
        return bool(chosen) and self.file.may_hold(frame.offset, chosen)

    def _add(self, entry: McapRecord) -> bool:
        """Keep what a record describes, or a message that is asked for; return whether it is a message."""
        if isinstance(entry, Schema):
            self.schemas.setdefault(entry.id, entry)
        elif isinstance(entry, Channel):
            self.channels.setdefault(entry.id, entry)
        elif isinstance(entry, Message):
            if entry.channel_id not in self.channels:
                raise McapError("it holds a message of a channel that it does not describe")
            is_early = self.start_ns is not None and entry.log_time < self.start_ns
            is_late = self.end_ns is not None and entry.log_time > self.end_ns
            if not (is_early or is_late) and self._is_chosen(entry.channel_id):
                self.of_topic[self.channels[entry.channel_id].topic].append((entry.log_time, entry.data))
            return True
        return False

    def _schema(self, number: int) -> str | None:
        """Return the name of a channel's schema; None if messages of it are not read."""
        channel = self.channels[number]
        if channel.message_encoding != "protobuf" or channel.schema_id == NO_SCHEMA:
            return None
        if channel.schema_id not in self.schemas:
            raise McapError(f"it does not describe the schema of {channel.topic}")
        name = self.schemas[channel.schema_id].name
        return name if name in columns.DECODERS else None

    def _is_chosen(self, number: int) -> bool:
        """Return whether messages of a channel are asked for, and can be decoded."""
        if number not in self._chosen:
            topic, patterns = self.channels[number].topic, ["*"] if self.wanted is None else self.wanted
            is_wanted = any(fnmatchcase(topic, pattern) for pattern in patterns)
            self._chosen[number] = is_wanted and self._schema(number) is not None
        return self._chosen[number]

    def schema_of(self, path: Path) -> dict[str, str]:
        """Return the topics that are asked for, each with the name of its schema.

        Raises
        ------
        RecordingError
            If one is not there, or has messages of two kinds.
        """
        available: dict[str, str] = {}
        for number, channel in self.channels.items():
            name = self._schema(number)
            if name is not None and available.setdefault(channel.topic, name) != name:
                raise RecordingError(
                    f"{path} has messages of two kinds on {channel.topic}, {available[channel.topic]} and "
                    f"{name}, but a table needs one; write each on a topic of its own"
                )
        for pattern in self.wanted or ():
            if "*" not in pattern and pattern not in available:
                raise RecordingError(
                    f"{path} has no topic {pattern!r}; choose from {', '.join(sorted(available)) or 'none'}"
                )
        chosen = {self.channels[number].topic for number in self.channels if self._is_chosen(number)}
        return {topic: schema for topic, schema in available.items() if topic in chosen}


def _topic_columns(
    path: Path,
    topic: str,
    schema: str,
    messages: list[tuple[int, bytes]],
    epoch_ns: int,
    metadata: Mapping[str, Mapping[str, str]],
) -> TopicColumns:
    """Decode the messages of a topic to columns with units."""
    try:
        decoded = columns.DECODERS[schema]([content for _, content in messages])
    except RecordingError as error:
        raise RecordingError(f"{path}: on {topic}, {error}") from error
    except DAMAGE as error:
        raise RecordingError(
            f"{path} has messages on {topic} that are not of its schema, {schema} "
            f"({error or type(error).__name__}), and cannot be decoded; read other topics of it"
        ) from error
    units = {field: topics.unit_of(field) for field in decoded}
    fis_metadata = metadata.get(topics.FIS_METADATA_PREFIX + topic.removeprefix(topics.FIS_PREFIX))
    if topic.startswith(topics.FIS_PREFIX) and fis_metadata is not None and "input_units" in fis_metadata:
        units["inputs"] = ", ".join(FisDescription.from_metadata(fis_metadata).input_units)
    if topic == topics.CHIEF_POINTS and "state" not in decoded:
        raise RecordingError(
            f"{path}: the points on {topic} have no colours, which tell their states; read other topics of it"
        )
    if topic == topics.CHIEF_PULLS:
        units |= metadata.get(topics.PULLS_METADATA, {})
    time_ns = np.array([time_ns - epoch_ns for time_ns, _ in messages], dtype=np.float64)
    return TopicColumns(topic, schema, time_ns / topics.NANOSECONDS, decoded, units)
