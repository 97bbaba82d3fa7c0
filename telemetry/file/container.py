"""An MCAP file as it is written, with messages a chunk at a time.

The records are those of the library `mcap`, which packs them field by field; messages and their index, of
which there are thousands, are packed in arrays. The format: https://mcap.dev/spec.
"""

import zlib
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from functools import cache
from io import BufferedIOBase
from itertools import accumulate, pairwise
from struct import Struct
from typing import Final, NamedTuple

import numpy as np
import zstandard
from google.protobuf.message import Message
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import (
    Attachment,
    AttachmentIndex,
    Channel,
    ChunkIndex,
    DataEnd,
    Footer,
    Header,
    McapRecord,
    Metadata,
    MetadataIndex,
    Schema,
    Statistics,
    SummaryOffset,
)
from mcap.writer import MCAP0_MAGIC
from mcap_protobuf.schema import build_file_descriptor_set
from numpy.typing import NDArray

from telemetry.file.encoding import runs

#: what comes before the content of a message
_HEAD: Final = np.dtype(
    [
        ("opcode", "u1"),
        ("length", "<u8"),
        ("channel", "<u2"),
        ("sequence", "<u4"),
        ("log_time", "<u8"),
        ("publish_time", "<u8"),
    ]
)
#: the part of it that does not count as length
_OPCODE_AND_LENGTH: Final = 9
#: what comes before the messages of a chunk; all but the first two fields counts as its length
_CHUNK_HEAD: Final = Struct("<BQQQQII4sQ")
_ZSTD: Final = b"zstd"
#: what comes before the times and places of a channel's messages; the last two fields count as its length
_INDEX_HEAD: Final = Struct("<BQHI")
#: of the checksum at the end of the footer
_CRC_SIZE: Final = 4


class Messages(NamedTuple):
    """Messages in order of time; the last three are those of `telemetry.file.encoding.encode`."""

    channel: NDArray[np.int64]
    time_ns: NDArray[np.int64]
    begins: NDArray[np.int64]
    lengths: NDArray[np.int64]
    content: NDArray[np.uint8]

    def part(self, rows: slice) -> "Messages":
        """Return some of them."""
        channel, time_ns, begins, lengths, content = self
        return Messages(channel[rows], time_ns[rows], begins[rows], lengths[rows], content)


class Container:
    """Writes an MCAP file to a stream: first metadata, attachments and channels, then chunks, then the end.

    Parameters
    ----------
    stream : BufferedIOBase
    library : str
        The name of the program that writes.
    """

    def __init__(self, stream: BufferedIOBase, library: str):
        self._stream = stream
        self._schemas: dict[type[Message], bytes] = {}
        self._channels: list[bytes] = []
        #: schemas and channels, each schema before the first of its channels
        self._announced = b""
        self._chunks: list[ChunkIndex] = []
        self._attachments: list[AttachmentIndex] = []
        self._metadata: list[MetadataIndex] = []
        self._counts: Counter[int] = Counter()
        self._compressor = zstandard.ZstdCompressor()
        stream.write(MCAP0_MAGIC)
        self._write([Header("", library)])

    def add_metadata(self, name: str, entries: Mapping[str, str]) -> None:
        """Write metadata."""
        offset, length = self._write([Metadata(name, dict(entries))])
        self._metadata.append(MetadataIndex(offset, length, name))

    def add_attachment(self, name: str, media_type: str, content: bytes) -> None:
        """Write an attachment, of no time."""
        record = Attachment(create_time=0, log_time=0, name=name, media_type=media_type, data=content)
        offset, length = self._write([record])
        self._attachments.append(
            AttachmentIndex(
                offset=offset,
                length=length,
                log_time=0,
                create_time=0,
                data_size=len(content),
                name=name,
                media_type=media_type,
            )
        )

    def add_channel(self, topic: str, kind: type[Message]) -> int:
        """Announce protobuf messages of one kind on a topic; return the channel's number."""
        if kind not in self._schemas:
            record = _schema(kind, len(self._schemas) + 1)  # type: ignore[arg-type] # classes can be hashed
            self._schemas[kind] = record
            self._announced += record
        number, schema = len(self._channels) + 1, [*self._schemas].index(kind) + 1
        record = _packed([Channel(number, topic, "protobuf", {}, schema)])
        self._channels.append(record)
        self._announced += record
        return number

    def add_chunks(
        self, batches: Sequence[Messages], order: NDArray[np.int64], starts: Sequence[int]
    ) -> None:
        """Write messages in chunks, and bring everything so far to the file.

        Parameters
        ----------
        batches : sequence of Messages
        order : (n,) int
            In which all their messages, counted from batch to batch, are written.
        starts : sequence of int
            Where in this order chunks begin, the first at 0.
        """
        columns = ((batch.channel, batch.time_ns, batch.lengths) for batch in batches)
        channel, time_ns, lengths = (np.concatenate(each)[order] for each in zip(*columns, strict=True))
        announced = b"" if self._chunks else self._announced
        sizes = _HEAD.itemsize + lengths
        ends = len(announced) + np.cumsum(sizes)
        content, begins = np.empty(ends[-1], np.uint8), ends - sizes
        content[: len(announced)] = np.frombuffer(announced, np.uint8)
        runs(content, _HEAD.itemsize)[begins] = self._heads(channel, time_ns, lengths)
        places = np.empty_like(begins)
        places[order] = begins + _HEAD.itemsize
        _place(batches, places, content)
        entries, first = np.stack([time_ns, begins], axis=1), 0
        for start, end in pairwise([*starts, len(order)]):
            last = int(ends[end - 1])
            self._add_chunk(content[first:last].data, channel[start:end], entries[start:end] - [0, first])
            first = last

    def _add_chunk(self, content: memoryview, channel: NDArray[np.int64], entries: NDArray[np.int64]) -> None:
        """Write a chunk of messages of these channels, (n,), at these times and places in it, (n, 2)."""
        index = {each: _index(each, entries[channel == each]) for each in dict.fromkeys(channel.tolist())}
        data = self._compressor.compress(content)
        (start_ns, _), (end_ns, _) = entries[0].tolist(), entries[-1].tolist()
        told = start_ns, end_ns, len(content), zlib.crc32(content), len(_ZSTD), _ZSTD, len(data)
        length = _CHUNK_HEAD.size + len(data)
        head = _CHUNK_HEAD.pack(Opcode.CHUNK, length - _OPCODE_AND_LENGTH, *told)
        offset = self._stream.tell()
        starts = [*accumulate(map(len, index.values()), initial=offset + length)]
        self._stream.write(b"".join([head, data, *index.values()]))
        self._chunks.append(
            ChunkIndex(
                chunk_length=length,
                chunk_start_offset=offset,
                compression=_ZSTD.decode(),
                compressed_size=len(data),
                message_end_time=end_ns,
                message_index_length=starts[-1] - starts[0],
                message_index_offsets=dict(zip(index, starts, strict=False)),
                message_start_time=start_ns,
                uncompressed_size=len(content),
            )
        )
        self._stream.flush()

    def finish(self) -> None:
        """Write the end of the file, with what is needed to find a record in it."""
        self._write([DataEnd(0)])
        at = self._stream.tell()
        statistics = Statistics(
            attachment_count=len(self._attachments),
            channel_count=len(self._channels),
            channel_message_counts=self._counts,
            chunk_count=len(self._chunks),
            message_count=self._counts.total(),
            message_end_time=max((chunk.message_end_time for chunk in self._chunks), default=0),
            message_start_time=min((chunk.message_start_time for chunk in self._chunks), default=0),
            metadata_count=len(self._metadata),
            schema_count=len(self._schemas),
        )
        packed = {
            Opcode.SCHEMA: b"".join(self._schemas.values()),
            Opcode.CHANNEL: b"".join(self._channels),
            Opcode.STATISTICS: _packed([statistics]),
            Opcode.CHUNK_INDEX: _packed(self._chunks),
            Opcode.ATTACHMENT_INDEX: _packed(self._attachments),
            Opcode.METADATA_INDEX: _packed(self._metadata),
        }
        starts = [*accumulate(map(len, packed.values()), initial=at)]
        offsets = [
            SummaryOffset(group_length=len(group), group_opcode=opcode, group_start=start)
            for (opcode, group), start in zip(packed.items(), starts, strict=False)
        ]
        summary = b"".join(packed.values()) + _packed(offsets)
        footer = Footer(summary_start=at, summary_offset_start=starts[-1], summary_crc=0)
        footer.summary_crc = zlib.crc32(summary + _packed([footer])[:-_CRC_SIZE])
        self._stream.write(summary + _packed([footer]) + MCAP0_MAGIC)

    def _write(self, records: Sequence[McapRecord]) -> tuple[int, int]:
        """Write records; return where they begin, and how long they are."""
        offset, content = self._stream.tell(), _packed(records)
        self._stream.write(content)
        return offset, len(content)

    def _heads(
        self, channel: NDArray[np.int64], time_ns: NDArray[np.int64], lengths: NDArray[np.int64]
    ) -> NDArray[np.void]:
        """Return what comes before each message, and count those of each channel."""
        heads = np.empty(len(channel), _HEAD)
        heads["opcode"] = Opcode.MESSAGE
        heads["length"] = _HEAD.itemsize - _OPCODE_AND_LENGTH + lengths
        heads["channel"], heads["log_time"], heads["publish_time"] = channel, time_ns, time_ns
        for each in dict.fromkeys(channel.tolist()):
            rows = np.flatnonzero(channel == each)
            heads["sequence"][rows] = self._counts[each] + np.arange(len(rows))
            self._counts[each] += len(rows)
        return heads.view(f"V{_HEAD.itemsize}")


@cache
def _schema(kind: type[Message], number: int) -> bytes:
    """Return the record of what a reader needs to know of a kind of messages."""
    described = build_file_descriptor_set(kind).SerializeToString()
    return _packed([Schema(id=number, data=described, encoding="protobuf", name=kind.DESCRIPTOR.full_name)])


def _place(batches: Iterable[Messages], places: NDArray[np.int64], content: NDArray[np.uint8]) -> None:
    """Copy all messages to their places, (n,): those of a batch that are equally long at once."""
    done = 0
    for batch in batches:
        own = places[done : done + len(batch.lengths)]
        for length in set(batch.lengths.tolist()) - {0}:
            rows = batch.lengths == length
            runs(content, length)[own[rows]] = runs(batch.content, length)[batch.begins[rows]]
        done += len(own)


def _index(channel: int, entries: NDArray[np.int64]) -> bytes:
    """Return the record of when a channel's messages are and where in the chunk, (n, 2)."""
    content = entries.astype("<u8").tobytes()
    return _INDEX_HEAD.pack(Opcode.MESSAGE_INDEX, 6 + len(content), channel, len(content)) + content


def _packed(records: Iterable[McapRecord]) -> bytes:
    builder = RecordBuilder()
    for record in records:
        record.write(builder)
    content: bytes = builder.end()  # type: ignore[no-untyped-call]
    return content
