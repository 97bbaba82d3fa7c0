"""Recovery of what is provably intact in a truncated or damaged recording.

A record counts if all of its bytes are there. A chunk of messages counts as a whole, if its checksum matches;
a chunk that was being written when the file was truncated has no matching one.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field
from io import BytesIO
from pathlib import Path
from typing import Final

from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, Chunk, Footer, McapRecord, Message, Metadata, Schema
from mcap.stream_reader import StreamReader, breakup_chunk
from mcap.writer import MCAP0_MAGIC, CompressionType, Writer

from fis_tools.file_access import read_bytes, replacing
from telemetry.file import RecordingError, claims, explained, topics
from telemetry.file.metadata import sealed, unsealed
from telemetry.file.partial_file import PARTIAL_SUFFIX
from telemetry.file.reader import DAMAGE, check_attachment

_KNOWN: Final = frozenset(map(int, Opcode))

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
    is_finished : bool
        Whether the source ends as a recording does.
    output : Path or None
        The new file; None if the source was intact.
    metadata, attachments, schemas, channels, chunks
        The records; schemas and channels by their numbers, messages by chunks.
    """

    num_bytes_lost: int
    num_damaged_records: int = 0
    is_finished: bool = False
    output: Path | None = None
    metadata: list[Metadata] = field(default_factory=list)
    attachments: list[Attachment] = field(default_factory=list)
    schemas: dict[int, Schema] = field(default_factory=dict)
    channels: dict[int, Channel] = field(default_factory=dict)
    chunks: list[list[Message]] = field(default_factory=list)

    def add(self, record: McapRecord) -> None:
        """Keep a record; schemas and channels appear in a chunk and again in the summary."""
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
        self.channels = {i: c for i, c in self.channels.items() if c.schema_id in self.schemas}
        self.chunks = [[m for m in chunk if m.channel_id in self.channels] for chunk in self.chunks]

    @property
    def num_messages(self) -> int:
        """Number of recovered messages."""
        return sum(map(len, self.chunks))

    @property
    def end_s(self) -> float | None:
        """Simulation time of the last one; None if there is none."""
        times = [message.log_time for chunk in self.chunks for message in chunk]
        return max(times) / topics.NANOSECONDS if times else None


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
    if not recovery.is_finished or recovery.num_damaged_records:
        if not recovery.metadata and not recovery.num_messages:
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
    room = claims.most_unpacked(len(content))
    for record_bytes in _whole_records(content):
        recovery.num_bytes_lost -= len(record_bytes)
        try:
            if record_bytes[0] == Opcode.CHUNK:
                room -= claims.check_chunk(record_bytes[claims.FRAME.size :])
                if room < 0 or recovery.num_messages > claims.most_messages(len(content)):
                    raise ValueError("more than a recording of this size holds")
            record = _parse(record_bytes)
            records = _chunk_records(record) if isinstance(record, Chunk) else [record]
        except DAMAGE:
            recovery.num_damaged_records += 1
            continue
        if isinstance(record, Chunk):
            recovery.chunks.append([])
        for part in records:
            recovery.add(part)
        recovery.is_finished = isinstance(record, Footer)
    if content[len(content) - recovery.num_bytes_lost :] == MCAP0_MAGIC:
        recovery.num_bytes_lost = 0
    else:
        recovery.is_finished = False
    recovery.drop_unexplained()
    return recovery


def _whole_records(content: bytes) -> Iterator[bytes]:
    """Yield every complete record, up to the footer, which is the last one."""
    start = len(MCAP0_MAGIC)
    while start + claims.FRAME.size <= len(content):
        opcode, length = claims.FRAME.unpack_from(content, start)
        end = start + claims.FRAME.size + length
        if end > len(content):
            return
        yield content[start:end]
        if opcode == Opcode.FOOTER:
            return
        start = end


def _parse(record_bytes: bytes) -> McapRecord:
    """Return the record that some bytes encode; raise one of `DAMAGE` if they are damaged."""
    if record_bytes[0] not in _KNOWN:  # such as each nine zeros of a disk's empty blocks
        raise ValueError("no record of the format")
    if record_bytes[0] == Opcode.MESSAGE:
        raise ValueError("message outside a chunk, without a checksum")
    if record_bytes[0] == Opcode.ATTACHMENT:
        check_attachment(record_bytes)
    record = next(StreamReader(BytesIO(record_bytes), skip_magic=True, emit_chunks=True).records)
    if isinstance(record, Metadata):
        return Metadata(record.name, unsealed(record.name, record.metadata))
    return record


def _chunk_records(chunk: Chunk) -> list[McapRecord]:
    if chunk.uncompressed_crc == 0:
        raise ValueError("chunk without a checksum")
    return breakup_chunk(chunk, validate_crc=True)


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
        schema = schemas[channel.schema_id]
        channels[channel.id] = writer.register_channel(
            channel.topic, channel.message_encoding, schema, channel.metadata
        )
    for chunk in recovery.chunks:
        for m in chunk:
            writer.add_message(channels[m.channel_id], m.log_time, m.data, m.publish_time, m.sequence)
        writer.flush()  # type: ignore[no-untyped-call]
    writer.finish()  # type: ignore[no-untyped-call]
