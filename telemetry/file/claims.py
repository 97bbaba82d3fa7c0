"""Limits on what a recording claims to hold, checked before anything is allocated for it.

A chunk of a hundred bytes may unpack to gigabytes; a recording of ours unpacks to some ten times its size.
"""

import struct
from collections.abc import Iterable, Iterator
from typing import BinaryIO, Final

from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import ChunkIndex
from mcap.stream_reader import MAGIC_SIZE

#: the kind of a record and its length, before its content
FRAME: Final = struct.Struct("<BQ")
#: the times of the first and last message, the size of what it unpacks to and its checksum
_CHUNK: Final = struct.Struct("<QQQI")
_LENGTH: Final = struct.Struct("<I")
#: bytes that one chunk unpacks to
MOST_IN_CHUNK: Final = 16 * 1024 * 1024
#: bytes that all unpack to, for any file and for each of its own
MOST_UNPACKED: Final = 64 * 1024 * 1024
MOST_UNPACKED_PER_BYTE: Final = 20
#: messages, for any file and for each of its bytes
MOST_MESSAGES: Final = 200_000
MOST_MESSAGES_PER_BYTE: Final = 1 / 16
COMPRESSIONS: Final = ("", "zstd")


def most_unpacked(size: int) -> int:
    """Return the limit on the bytes that all chunks of a file may unpack to."""
    return MOST_UNPACKED + MOST_UNPACKED_PER_BYTE * size


def most_messages(size: int) -> int:
    """Return the limit on the messages of a file."""
    return MOST_MESSAGES + int(MOST_MESSAGES_PER_BYTE * size)


def check_chunk(head: bytes) -> int:
    """Check a chunk's claimed size, and return the bytes that it unpacks to.

    Parameters
    ----------
    head : bytes
        Its content, at least as far as the name of its compression.

    Raises
    ------
    McapError
        If it unpacks to too much, or by a way that is not read.
    """
    size = int(_CHUNK.unpack_from(head)[2])
    (length,) = _LENGTH.unpack_from(head, _CHUNK.size)
    compression = head[_CHUNK.size + _LENGTH.size :][:length].decode("ascii", "replace")
    if compression not in COMPRESSIONS:
        raise McapError(f"a chunk is compressed by {compression[:20]!r}; only zstd is read")
    if size > MOST_IN_CHUNK:
        raise McapError(f"a chunk unpacks to {size} bytes; at most {MOST_IN_CHUNK} are read")
    return size


def chunk_claims(stream: BinaryIO, size: int) -> Iterator[tuple[int, int]]:
    """Yield where each chunk of a file begins and what it unpacks to, bytes, without reading its messages.

    Raises
    ------
    McapError
        As `check_chunk` does, or if all together are too much.
    """
    offset, total = MAGIC_SIZE, 0
    while offset + FRAME.size <= size:
        stream.seek(offset)
        opcode, length = FRAME.unpack(stream.read(FRAME.size))
        if opcode == Opcode.CHUNK:
            claimed = check_chunk(stream.read(min(length, 64)))
            total += claimed
            if total > most_unpacked(size):
                raise McapError(
                    f"{size} bytes unpack to more than {most_unpacked(size)}, which is all that is read"
                )
            yield offset, claimed
        offset += FRAME.size + length
    stream.seek(0)


def check_index(claims: Iterable[tuple[int, int]], indexes: Iterable[ChunkIndex]) -> None:
    """Check that an index leads to each chunk at most once, and to nothing else.

    Raises
    ------
    McapError
        If it does not.
    """
    unread = dict(claims)
    for index in indexes:
        if unread.pop(index.chunk_start_offset, None) != index.uncompressed_size:
            raise McapError("its index leads to a chunk that is not there, or to one twice")
