"""Recovery of what is intact in a truncated or damaged recording.

A record counts if all of its bytes are there. A chunk of messages counts as a whole, if its checksum matches;
a chunk that was being written when the file was truncated has no matching one. Where the writer gave no
checksums, as the format allows, whatever can be read counts, and is told as unchecked. A message outside
chunks counts in a file whose chunks have checksums only if the data as a whole have one that matches:
otherwise a damaged record may look like it.
"""

import zlib
from dataclasses import dataclass, field
from io import BytesIO
from pathlib import Path
from typing import Final

from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, Chunk, DataEnd, McapRecord, Message, Metadata, Schema
from mcap.writer import MCAP0_MAGIC, CompressionType, Writer

from plain_files.file_access import read_bytes, replacing
from telemetry.file import RecordingError, claims, explained, topics
from telemetry.file.claims import ChunkHead
from telemetry.file.metadata import epoch_ns_of, sealed, unsealed
from telemetry.file.partial_file import PARTIAL_SUFFIX
from telemetry.file.reader import DAMAGE
from telemetry.file.records import FRAME, KNOWN, NO_SCHEMA, Extent, frames, record, records_in

#: kinds of records from here on are for everybody's own use
FIRST_PRIVATE: Final = 0x80
#: of a recording that is rescued, which is read at once; an hour's flight takes some MB
MOST_BYTES = 256 * 1024**2


@dataclass
class Recovery:
    """The intact part of a recording, in file order, and where it was written.

    Parameters
    ----------
    num_bytes_lost : int
        Bytes of the source outside complete records.
    num_damaged_records : int
        Complete records with wrong bytes.
    num_unchecked : int
        Messages that no checksum covers.
    has_checksums : bool
        Whether the chunks of the source have any.
    refused : str
        Why some records are not read, though they may be intact; empty if all are.
    is_finished : bool
        Whether the source ends as a recording does.
    output : Path or None
        The new file; None if the source was intact.
    metadata, attachments, schemas, channels, chunks
        The records; schemas and channels by their numbers, messages by chunks.
    """

    num_bytes_lost: int
    num_damaged_records: int = 0
    num_unchecked: int = 0
    has_checksums: bool = False
    refused: str = ""
    is_finished: bool = False
    output: Path | None = None
    metadata: list[Metadata] = field(default_factory=list)
    attachments: list[Attachment] = field(default_factory=list)
    schemas: dict[int, Schema] = field(default_factory=dict)
    channels: dict[int, Channel] = field(default_factory=dict)
    chunks: list[list[Message]] = field(default_factory=list)

    def add(self, record: McapRecord) -> None:
        """Keep a record; schemas and channels appear before messages and again in the summary."""
        if isinstance(record, Metadata):
            self.metadata.append(record)
        elif isinstance(record, Attachment):
            self.attachments.append(record)
        elif isinstance(record, Schema):
            self.schemas.setdefault(record.id, record)
        elif isinstance(record, Channel):
            self.channels.setdefault(record.id, record)
        elif isinstance(record, Message):
            self.chunks[-1].append(record)

    def drop_unexplained(self) -> None:
        """Drop messages of channels that no intact record describes: they cannot be decoded."""
        known = {*self.schemas, NO_SCHEMA}
        self.channels = {i: c for i, c in self.channels.items() if c.schema_id in known}
        self.chunks = [[m for m in chunk if m.channel_id in self.channels] for chunk in self.chunks]

    @property
    def num_messages(self) -> int:
        """Number of recovered messages."""
        return sum(map(len, self.chunks))

    @property
    def end_s(self) -> float | None:
        """Simulation time of the last one; None if there is none."""
        times = [message.log_time for chunk in self.chunks for message in chunk]
        episodes = [entry.metadata for entry in self.metadata if entry.name == topics.EPISODE_METADATA]
        epoch_ns = epoch_ns_of(episodes[-1]) if episodes else 0
        return (max(times) - epoch_ns) / topics.NANOSECONDS if times else None


def recover(path: Path | str, output: Path | str | None = None) -> Recovery:
    """Write what is intact in a truncated or damaged recording to a new one.

    Parameters
    ----------
    path : Path or str
        The recording, also one still called ``.mcap.partial``.
    output : Path or str, optional
        The new file; by default ``flight.recovered.mcap`` in the folder of ``flight.mcap``.

    Returns
    -------
    Recovery

    Raises
    ------
    RecordingError
        If the source is missing or not an MCAP file, if nothing in it is intact, or if the output exists or
        cannot be written.
    """
    path = Path(path)
    name = path.name.removesuffix(PARTIAL_SUFFIX).removesuffix(".mcap")
    output = path.with_name(f"{name}.recovered.mcap") if output is None else Path(output)
    recovery = _scan(_content(path))
    if not recovery.is_finished or recovery.num_damaged_records or recovery.refused:
        if not recovery.metadata and not recovery.num_messages:
            if recovery.refused:
                raise RecordingError(
                    f"{path} is not read: {recovery.refused}; write it anew within these limits"
                )
            raise RecordingError(
                f"nothing in {path} is intact: it ends before its first flushed step; fly the episode again"
            )
        _write(path, output, recovery)
        recovery.output = output
    return recovery


def _content(path: Path) -> bytes:
    """Return the content of an MCAP file, which may be truncated."""
    with explained(f"{path} cannot be read", "give the path of a recording"):
        content = read_bytes(path, MOST_BYTES)
    if content[: len(MCAP0_MAGIC)] != MCAP0_MAGIC[: len(content)]:
        raise RecordingError(
            f"{path} is not an MCAP file, so there is no recording to rescue in it; give the path of a .mcap "
            "or .mcap.partial file"
        )
    return content


def _scan(content: bytes) -> Recovery:
    """Return every intact record of a damaged file."""
    recovery = Recovery(num_bytes_lost=max(0, len(content) - len(MCAP0_MAGIC)))
    source, unpacked, loose, is_in_data = BytesIO(content), 0, Recovery(0, chunks=[[]]), True
    for frame in frames(source, len(content)):
        recovery.num_bytes_lost -= FRAME.size + frame.length
        recovery.is_finished = frame.opcode == Opcode.FOOTER
        try:
            unpacked += _claimed(content, frame)
            claims.check_total(unpacked, recovery.num_messages + loose.num_messages, len(content))
            entry = _entry(source, frame)
            if isinstance(entry, Message):
                if not is_in_data:
                    raise ValueError("a message after the end of the data")
                loose.add(entry)
                continue
            _add(recovery, entry)
        except claims.NotReadError as error:
            recovery.refused = recovery.refused or str(error)
        except DAMAGE:
            recovery.num_damaged_records += 1
        else:
            if isinstance(entry, DataEnd):
                is_in_data = False
                checksum = entry.data_section_crc
                loose.is_finished = checksum != 0 and zlib.crc32(content[: frame.offset]) == checksum
    if content[len(content) - recovery.num_bytes_lost :] == MCAP0_MAGIC:
        recovery.num_bytes_lost = 0
    else:
        recovery.is_finished = False
    _add_loose(recovery, loose)
    recovery.drop_unexplained()
    return recovery


def _claimed(content: bytes, frame: Extent) -> int:
    """Return how many bytes a record unpacks to, checked; 0 if it is no chunk."""
    begin = frame.offset + FRAME.size
    return ChunkHead.of(content[begin : frame.end]).size if frame.opcode == Opcode.CHUNK else 0


def _entry(source: BytesIO, frame: Extent) -> McapRecord | None:
    """Return a record, None for one of a kind that is everybody's own; raise one of `DAMAGE` if damaged."""
    if frame.opcode >= FIRST_PRIVATE:
        return None
    if frame.opcode not in KNOWN:  # such as each nine zeros of a disk's empty blocks
        raise ValueError("no record of the format")
    entry = record(source, frame)
    if isinstance(entry, Metadata):
        return Metadata(entry.name, unsealed(entry.name, entry.metadata))
    return entry


def _add(recovery: Recovery, entry: McapRecord | None) -> None:
    """Keep a record, of a chunk all that is in it."""
    if not isinstance(entry, Chunk):
        if entry is not None:
            recovery.add(entry)
        return
    parts = records_in(entry)
    recovery.chunks.append([])
    for part in parts:
        recovery.add(part)
    recovery.num_unchecked += 0 if entry.uncompressed_crc else len(recovery.chunks[-1])
    recovery.has_checksums |= entry.uncompressed_crc != 0


def _add_loose(recovery: Recovery, loose: Recovery) -> None:
    """Keep the messages outside chunks, if a checksum covers them, or the file has none."""
    is_checked = loose.is_finished
    if recovery.has_checksums and not is_checked:
        recovery.num_damaged_records += loose.num_messages
    elif loose.num_messages:
        recovery.chunks += loose.chunks
        recovery.num_unchecked += 0 if is_checked else loose.num_messages


def _write(source: Path, output: Path, recovery: Recovery) -> None:
    """Write the recovered recording to a new file."""
    if output.exists():
        raise RecordingError(f"{output} exists; remove it or choose another name with -o")
    cure = "make room, or choose another file with -o"
    with explained(f"{output} cannot be written", cure), replacing(output) as stream:
        _copy(Writer(stream, compression=CompressionType.ZSTD), source, recovery)


def _copy(writer: Writer, source: Path, recovery: Recovery) -> None:
    """Write the recovered records as a recording."""
    writer.start(library="fuzzy-spacecraft-inspection telemetry recover")
    for metadata in recovery.metadata:
        writer.add_metadata(metadata.name, sealed(metadata.name, metadata.metadata))
    remark = {"source": source.name, "num_messages": str(recovery.num_messages)}
    if (end_s := recovery.end_s) is not None:
        remark["end_s"] = str(end_s)
    writer.add_metadata(topics.RECOVERY_METADATA, sealed(topics.RECOVERY_METADATA, remark))
    for attachment in recovery.attachments:
        writer.add_attachment(
            attachment.create_time,
            attachment.log_time,
            attachment.name,
            attachment.media_type,
            attachment.data,
        )
    schemas: dict[int, int] = {}
    channels: dict[int, int] = {}
    for kind in recovery.schemas.values():
        schemas[kind.id] = writer.register_schema(kind.name, kind.encoding, kind.data)
    for channel in recovery.channels.values():
        schema = schemas.get(channel.schema_id, NO_SCHEMA)
        channels[channel.id] = writer.register_channel(
            channel.topic, channel.message_encoding, schema, channel.metadata
        )
    for chunk in recovery.chunks:
        for m in chunk:
            writer.add_message(channels[m.channel_id], m.log_time, m.data, m.publish_time, m.sequence)
        writer.flush()  # type: ignore[no-untyped-call]
    writer.finish()  # type: ignore[no-untyped-call]
