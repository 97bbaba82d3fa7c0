"""The records of an MCAP file: where each begins, and what it holds.

The specification (https://mcap.dev/spec) leaves chunks, their compression, checksums, and the summary with
its indexes to the writer. So records are found by going from one to the next, and not by an index. A checksum
of 0 is none.
"""

import struct
import zlib
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from io import BytesIO
from typing import BinaryIO, Final, NamedTuple

import lz4.frame
import zstandard
from mcap.exceptions import EndOfFile, McapError
from mcap.opcode import Opcode
from mcap.records import Chunk, McapRecord
from mcap.stream_reader import MAGIC_SIZE, StreamReader, breakup_chunk

#: the kind of a record and the length of its content, before that
FRAME: Final = struct.Struct("<BQ")
CHECKSUM_SIZE: Final = 4
#: of a channel without a schema
NO_SCHEMA: Final = 0
KNOWN: Final = frozenset(map(int, Opcode))


class Extent(NamedTuple):
    """A record's place: its kind, its first byte, and the length of its content."""

    opcode: int
    offset: int
    length: int

    @property
    def end(self) -> int:
        """Where the next record begins."""
        return self.offset + FRAME.size + self.length


def frames(stream: BinaryIO, size: int) -> Iterator[Extent]:
    """Yield where each complete record of a file of a size is, up to the footer, which is the last one."""
    offset = MAGIC_SIZE
    while offset + FRAME.size <= size:
        stream.seek(offset)
        opcode, length = FRAME.unpack(stream.read(FRAME.size))
        frame = Extent(opcode, offset, length)
        if frame.end > size:
            return
        yield frame
        if opcode == Opcode.FOOTER:
            return
        offset = frame.end


def record(stream: BinaryIO, frame: Extent) -> McapRecord:
    """Return a record of a known kind; chunks stay packed.

    Raises
    ------
    McapError, ValueError, struct.error
        If it is damaged.
    """
    stream.seek(frame.offset)
    content = stream.read(FRAME.size + frame.length)
    if frame.opcode == Opcode.ATTACHMENT:
        _check_attachment(content)
    return next(StreamReader(_Exact(content), skip_magic=True, emit_chunks=True).records)


class _Exact(BytesIO):
    """Bytes of which no part is read that goes beyond their end, as a wrong length of a text would."""

    def read(self, size: int | None = -1, /) -> bytes:
        content = super().read(size)
        if size is not None and 0 <= size != len(content):
            raise EndOfFile
        return content


def _check_attachment(content: bytes) -> None:
    """Check an attachment against its checksum, which the library does not do."""
    checksum = int.from_bytes(content[-CHECKSUM_SIZE:], "little")
    if checksum and zlib.crc32(content[FRAME.size : -CHECKSUM_SIZE]) != checksum:
        raise McapError("an attachment does not match its checksum")


def _of_lz4(packed: bytes, most: int) -> bytes:
    unpacked: bytes = lz4.frame.LZ4FrameDecompressor().decompress(packed, max_length=most)
    return unpacked


def _of_zstd(packed: bytes, most: int) -> bytes:
    return zstandard.ZstdDecompressor().stream_reader(packed, read_across_frames=True).read(most)


#: by the name of the compression: unpacks bytes to at most so many
_UNPACKING: Final[Mapping[str, Callable[[bytes, int], bytes]]] = {
    "": lambda packed, most: packed[:most],
    "lz4": _of_lz4,
    "zstd": _of_zstd,
}


def records_in(chunk: Chunk) -> list[McapRecord]:
    """Return the schemas, channels and messages in a chunk, in memory for what it says that it unpacks to.

    Raises
    ------
    McapError, ValueError, RuntimeError, struct.error, zstandard.ZstdError
        If it is damaged.
    """
    try:
        data = _UNPACKING[chunk.compression](chunk.data, chunk.uncompressed_size + 1)
    except RuntimeError as error:  # of lz4
        raise McapError(f"a chunk cannot be unpacked: {error}") from error
    if len(data) != chunk.uncompressed_size:
        raise McapError("a chunk unpacks to another size than it says")
    if chunk.uncompressed_crc and zlib.crc32(data) != chunk.uncompressed_crc:
        raise McapError("a chunk does not match its checksum")
    return breakup_chunk(replace(chunk, compression="", data=data, uncompressed_crc=0))
