"""The layout of an intact MCAP file: its records before any message is unpacked."""

import os
import zlib
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import BinaryIO, Final

from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import (
    Attachment,
    AttachmentIndex,
    Channel,
    ChunkIndex,
    DataEnd,
    Footer,
    McapRecord,
    Metadata,
    MetadataIndex,
    Schema,
    Statistics,
)
from mcap.stream_reader import MAGIC_SIZE

from telemetry.file import claims
from telemetry.file.claims import ChunkHead
from telemetry.file.records import CHECKSUM_SIZE, FRAME, NO_SCHEMA, Extent, frames, record

#: kinds of records in the summary that are read
_OF_SUMMARY: Final = (
    *(Opcode.SCHEMA, Opcode.CHANNEL, Opcode.STATISTICS),
    *(Opcode.CHUNK_INDEX, Opcode.ATTACHMENT_INDEX, Opcode.METADATA_INDEX),
)


@dataclass
class Layout:
    """Where the records of a file are, and what its summary says.

    Parameters
    ----------
    stream : binary file
    size : int
        Of the file, bytes.
    data : sequence of Extent
        The records before the summary.
    end_of_data : Extent
    schemas, channels : dict
        By their numbers: those of the summary.
    indexes : dict of int to ChunkIndex
        By where the chunk begins; none need be there.
    statistics : Statistics or None
        How many records of each kind there are; None if nothing says so.
    """

    stream: BinaryIO
    size: int
    data: Sequence[Extent]
    end_of_data: Extent
    schemas: dict[int, Schema] = field(default_factory=dict)
    channels: dict[int, Channel] = field(default_factory=dict)
    indexes: dict[int, ChunkIndex] = field(default_factory=dict)
    statistics: Statistics | None = None

    @classmethod
    def of(cls, stream: BinaryIO) -> "Layout":
        """Go through the records of a file, without unpacking any.

        Raises
        ------
        McapError, ValueError, struct.error
            If it is damaged, or claims to hold more than is read.
        """
        size = stream.seek(0, os.SEEK_END)
        every = list(_checked_frames(stream, size))
        ends = [index for index, frame in enumerate(every) if frame.opcode == Opcode.DATA_END]
        if len(ends) != 1:
            raise McapError("it has no end of its data" if not ends else "its data end twice")
        layout = cls(stream, size, every[: ends[0]], every[ends[0]])
        layout._check_summary(every[-1])
        kinds = {frame.offset: frame.opcode for frame in layout.data}
        for frame in every[ends[0] + 1 : -1]:
            if frame.opcode in _OF_SUMMARY:
                layout._add(record(stream, frame), kinds)
        layout._check_counts(Counter(kinds.values()))
        return layout

    def _add(self, of_summary: McapRecord, kinds: Mapping[int, int]) -> None:
        """Keep a record of the summary, and check that an index leads to a record of its kind."""
        if isinstance(of_summary, Schema):
            self.schemas[of_summary.id] = of_summary
        elif isinstance(of_summary, Channel):
            self.channels[of_summary.id] = of_summary
        elif isinstance(of_summary, Statistics):
            self.statistics = of_summary
        elif isinstance(of_summary, ChunkIndex):
            offset, kind = of_summary.chunk_start_offset, Opcode.CHUNK
            if offset in self.indexes or kinds.get(offset) != kind:
                raise McapError("its index leads to a chunk that is not there, or to one twice")
            self.indexes[offset] = of_summary
        elif isinstance(of_summary, AttachmentIndex | MetadataIndex):
            is_file = isinstance(of_summary, AttachmentIndex)
            if kinds.get(of_summary.offset) != (Opcode.ATTACHMENT if is_file else Opcode.METADATA):
                raise McapError(f"its index leads to {of_summary.name!r}, which is not there")

    def _check_counts(self, counts: Mapping[int, int]) -> None:
        """Check how many records of each kind there are, as far as the summary says so."""
        said = self.statistics
        if said is None:
            return
        expected = {
            Opcode.CHUNK: said.chunk_count,
            Opcode.ATTACHMENT: said.attachment_count,
            Opcode.METADATA: said.metadata_count,
        }
        for kind, count in expected.items():
            if counts.get(kind, 0) != count:
                name = kind.name.lower()
                raise McapError(
                    f"its summary counts {count} of the kind {name}; {counts.get(kind, 0)} are there"
                )

    def _check_summary(self, footer_frame: Extent) -> None:
        """Check the summary against its checksum, which the library does not do."""
        footer = record(self.stream, footer_frame)
        if not isinstance(footer, Footer):
            raise McapError("it has no footer")
        if not footer.summary_crc:
            return
        self.stream.seek(footer.summary_start or footer_frame.offset)
        end = footer_frame.end - CHECKSUM_SIZE
        if zlib.crc32(self.stream.read(max(0, end - self.stream.tell()))) != footer.summary_crc:
            raise McapError("its index does not match its checksum")

    def check_data(self) -> None:
        """Check all records before the summary against their checksum, if the file has one.

        Raises
        ------
        McapError
            If they do not match.
        """
        end = record(self.stream, self.end_of_data)
        self.stream.seek(0)
        if not isinstance(end, DataEnd) or (
            end.data_section_crc
            and zlib.crc32(self.stream.read(self.end_of_data.offset)) != end.data_section_crc
        ):
            raise McapError("its data do not match their checksum")

    @property
    def names_all_channels(self) -> bool:
        """Whether the summary has every channel and schema: no chunk is unpacked only to look for them."""
        if self.statistics is None or self.statistics.channel_count != len(self.channels):
            return False
        return {channel.schema_id for channel in self.channels.values()} <= {NO_SCHEMA, *self.schemas}

    @property
    def has_loose_messages(self) -> bool:
        """Whether there are messages outside chunks."""
        return any(frame.opcode == Opcode.MESSAGE for frame in self.data)

    def metadata(self) -> Iterator[Metadata]:
        """Yield the metadata, in the order of the file."""
        entries = self._of_kind(Opcode.METADATA)
        return (entry for entry in entries if isinstance(entry, Metadata))

    def attachments(self) -> Iterator[Attachment]:
        """Yield the attachments, in the order of the file."""
        entries = self._of_kind(Opcode.ATTACHMENT)
        return (entry for entry in entries if isinstance(entry, Attachment))

    def _of_kind(self, kind: Opcode) -> Iterator[McapRecord]:
        return (record(self.stream, frame) for frame in self.data if frame.opcode == kind)

    def chunk_heads(self) -> dict[int, ChunkHead]:
        """Return what each chunk says of itself, by where it begins, checked against the index.

        Raises
        ------
        McapError
            If the index leads elsewhere, or the chunks claim too much.
        """
        heads, unpacked = {}, 0
        for frame in self.data:
            if frame.opcode != Opcode.CHUNK:
                continue
            self.stream.seek(frame.offset + FRAME.size)
            head = ChunkHead.of(self.stream.read(min(frame.length, claims.HEAD_SIZE)))
            unpacked += head.size
            claims.check_total(unpacked, 0, self.size)
            heads[frame.offset] = head
        for offset, index in self.indexes.items():
            said = ChunkHead(index.message_start_time, index.message_end_time, index.uncompressed_size)
            if heads[offset] != said:
                raise McapError("its index does not say of a chunk what that says of itself")
        return heads

    def may_hold(self, offset: int, channels: Iterable[int]) -> bool:
        """Return whether a chunk may hold messages of some channels, by the index if there is one."""
        index = self.indexes.get(offset)
        if index is None or not index.message_index_offsets:
            return True
        return not index.message_index_offsets.keys().isdisjoint(channels)


def _checked_frames(stream: BinaryIO, size: int) -> Iterator[Extent]:
    """Yield the records of a file that ends with its footer; raise McapError for another."""
    last, num_loose = None, 0
    for last in frames(stream, size):
        num_loose += last.opcode == Opcode.MESSAGE
        claims.check_total(0, num_loose, size)
        yield last
    if last is None or last.opcode != Opcode.FOOTER or last.end != size - MAGIC_SIZE:
        raise McapError("it has no footer")
