"""Limits on what a recording claims to hold, checked before anything is allocated for it.

A chunk of a hundred bytes may unpack to gigabytes; a recording of ours unpacks to some ten times its size.
"""

import struct
from dataclasses import dataclass
from typing import Final

from mcap.exceptions import McapError

#: the times of the first and last message, the size of what it unpacks to and its checksum
_CHUNK: Final = struct.Struct("<QQQI")
_LENGTH: Final = struct.Struct("<I")
#: bytes from which `ChunkHead.of` reads
HEAD_SIZE: Final = 64
#: bytes that one chunk unpacks to
MOST_IN_CHUNK: Final = 16 * 1024 * 1024
#: bytes that all unpack to, for any file and for each of its own
MOST_UNPACKED: Final = 64 * 1024 * 1024
MOST_UNPACKED_PER_BYTE: Final = 20
#: messages, for any file and for each of its bytes
MOST_MESSAGES: Final = 200_000
MOST_MESSAGES_PER_BYTE: Final = 1 / 16
#: those of the specification, the first being none
COMPRESSIONS: Final = ("", "lz4", "zstd")


class NotReadError(McapError):
    """What the format allows, but is not read here; the message says what."""


def most_unpacked(size: int) -> int:
    """Return the limit on the bytes that all chunks of a file may unpack to."""
    return MOST_UNPACKED + MOST_UNPACKED_PER_BYTE * size


def most_messages(size: int) -> int:
    """Return the limit on the messages of a file."""
    return MOST_MESSAGES + int(MOST_MESSAGES_PER_BYTE * size)


def check_total(unpacked: int, num_messages: int, size: int) -> None:
    """Check what a file of a size holds in all: bytes that its chunks unpack to, and messages.

    Raises
    ------
    NotReadError
        If it is too much.
    """
    if unpacked > most_unpacked(size):
        raise NotReadError(
            f"{size} bytes unpack to more than {most_unpacked(size)}, which is all that is read"
        )
    if num_messages > most_messages(size):
        raise NotReadError(
            f"it holds more than {most_messages(size)} messages, which is all that is read of {size} bytes"
        )


@dataclass(frozen=True)
class ChunkHead:
    """What a chunk says of itself.

    Parameters
    ----------
    start_ns, end_ns : int
        Times of its first and last message.
    size : int
        Bytes that it unpacks to.
    """

    start_ns: int
    end_ns: int
    size: int

    @classmethod
    def of(cls, content: bytes) -> "ChunkHead":
        """Return what a chunk says, having checked it.

        Parameters
        ----------
        content : bytes
            Its content, at least `HEAD_SIZE` bytes of it.

        Raises
        ------
        NotReadError
            If it unpacks to too much, or by a way that is not read.
        """
        start_ns, end_ns, size, _ = map(int, _CHUNK.unpack_from(content))
        (length,) = _LENGTH.unpack_from(content, _CHUNK.size)
        compression = content[_CHUNK.size + _LENGTH.size :][:length].decode("ascii", "replace")
        if compression not in COMPRESSIONS:
            known = " and ".join(filter(None, COMPRESSIONS))
            raise NotReadError(f"a chunk is compressed by {compression[:20]!r}; {known} are read, and none")
        if size > MOST_IN_CHUNK:
            raise NotReadError(f"a chunk unpacks to {size} bytes; at most {MOST_IN_CHUNK} are read")
        return cls(start_ns, end_ns, size)
