"""Many messages of one type at once: arrays in, and the bytes out that protobuf writes one by one.

Messages of a type differ in length by a few bytes only: protobuf writes integers as short as they are, and
leaves zeros out. So each has a row with room for the longest. Rows are written from left to right, a part of
all messages at a time; what of a part does not count, at its end, the next one overwrites.
"""

import math
from collections.abc import Iterable, Iterator, Mapping
from functools import cache
from typing import Any, Final, NamedTuple

import numpy as np
from google.protobuf.descriptor import FieldDescriptor
from google.protobuf.message import Message
from google.protobuf.message_factory import GetMessageClass
from numpy.typing import NDArray

#: in what size numbers of a type are written, or, for None, seven bits at a time
_SIZES: Final[Mapping[int, np.dtype[Any] | None]] = {
    FieldDescriptor.TYPE_DOUBLE: np.dtype("<f8"),
    FieldDescriptor.TYPE_FLOAT: np.dtype("<f4"),
    FieldDescriptor.TYPE_FIXED64: np.dtype("<u8"),
    FieldDescriptor.TYPE_FIXED32: np.dtype("<u4"),
    FieldDescriptor.TYPE_BYTES: np.dtype("u1"),
    FieldDescriptor.TYPE_INT64: None,
    FieldDescriptor.TYPE_INT32: None,
    FieldDescriptor.TYPE_UINT64: None,
    FieldDescriptor.TYPE_UINT32: None,
    FieldDescriptor.TYPE_BOOL: None,
    FieldDescriptor.TYPE_ENUM: None,
}
#: what a tag says of a value: seven bits at a time, a length before it, or one of these sizes
_BY_SEVENS, _BY_LENGTH, _BY_SIZE = 0, 2, {8: 1, 4: 5}


class _Part(NamedTuple):
    """A part of some messages side by side.

    Attributes
    ----------
    content : (n, width) uint8
        One row where it is the same in all messages.
    lengths : (n,) int, or int
        How many bytes of each row count.
    """

    content: NDArray[np.uint8]
    lengths: NDArray[np.int64] | int


def runs(array: NDArray[np.uint8], size: int) -> NDArray[np.void]:
    """Return all runs of so many bytes in an array, (n,), each as one value: those from each byte on."""
    return np.ndarray(array.size - size + 1, f"V{size}", array, strides=(1,))


def encode(
    kind: type[Message], columns: Mapping[str, Any], count: int
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.uint8]]:
    """Return the bytes of messages, the same as those of ``SerializeToString``.

    Parameters
    ----------
    kind : type
        Of the messages.
    columns : mapping
        What each field holds: an array of a row a message, (n,) for a number, (n, k) for repeated numbers
        and for bytes; a mapping of this kind for a message inside; or anything else that protobuf takes, the
        same in all messages. NaN leaves an optional field out.
    count : int
        How many messages.

    Returns
    -------
    begins, lengths : (n,) int
    content : (m,) uint8
        In which the bytes of each message begin there, and are so many.

    Raises
    ------
    KeyError
        If there is no field of a name, or an array comes for one of another kind.
    """
    parts = _message(kind.DESCRIPTOR, columns, count)
    width = sum(part.content.shape[1] for part in parts)
    rows = np.empty(count * width, np.uint8)
    begins = np.arange(count) * width
    ends = begins.copy()
    for part in parts:
        size = part.content.shape[1]
        runs(rows, size)[ends] = part.content.view(f"V{size}")[:, 0]
        ends += part.lengths
    return begins, ends - begins, rows


def _message(descriptor: Any, columns: Mapping[str, Any], count: int) -> list[_Part]:
    fields = sorted((descriptor.fields_by_name[name] for name in columns), key=lambda field: field.number)
    found = [part for field in fields for part in _field(field, columns[field.name], count)]
    return [part for part in found if part.content.size]


def _length(parts: Iterable[_Part]) -> NDArray[np.int64] | int:
    return sum(part.lengths for part in parts)


def _field(field: FieldDescriptor, value: Any, count: int) -> Iterator[_Part]:
    """Yield tag, length and content of a field."""
    if isinstance(value, Mapping):
        assert field.message_type is not None  # noqa: S101 - mappings are for messages inside
        inside = _message(field.message_type, value, count)
        yield from (_before(field.number, _length(inside)), *inside)
        return
    if not isinstance(value, np.ndarray):
        assert field.containing_type is not None  # noqa: S101 - it is no extension
        yield _alike(GetMessageClass(field.containing_type)(**{field.name: value}).SerializeToString())
        return
    values = value.reshape(count, math.prod(value.shape[1:]))
    dtype = _SIZES[field.type]
    contents = _by_sevens(values) if dtype is None else [_whole(np.ascontiguousarray(values, dtype))]
    if field.is_repeated or field.type == FieldDescriptor.TYPE_BYTES:
        if values.shape[1]:
            yield from (_before(field.number, _length(contents)), *contents)
        return
    if field.has_presence:
        is_set = ~np.isnan(values[:, 0])
    else:
        # bit by bit, for a negative zero is written
        is_set = (values if dtype is None else contents[0].content.view(f"u{dtype.itemsize}"))[:, 0] != 0
    way = _BY_SEVENS if dtype is None else _BY_SIZE[dtype.itemsize]
    part = _beside(_tag(field.number, way), contents[0])
    if is_set.all():
        yield part
    elif is_set.any():
        yield _Part(part.content, part.lengths * is_set)


def _before(number: int, lengths: NDArray[np.int64] | int) -> _Part:
    """Return tag and length of what has a length."""
    if isinstance(lengths, int):
        return _tag(number, _BY_LENGTH, lengths)
    return _beside(_tag(number, _BY_LENGTH), *_by_sevens(lengths[:, np.newaxis]))


@cache
def _tag(number: int, way: int, *length: int) -> _Part:
    parts = _by_sevens(np.array([[number << 3 | way, *length]]))
    return _alike(b"".join(content[0, : np.max(lengths)].tobytes() for content, lengths in parts))


def _alike(content: bytes) -> _Part:
    return _whole(np.frombuffer(content, np.uint8)[np.newaxis])


def _whole(rows: NDArray[Any]) -> _Part:
    """Return a part of which all bytes count."""
    content = rows.view(np.uint8)
    return _Part(content, content.shape[1])


def _beside(one: _Part, other: _Part) -> _Part:
    """Return a part that is the same in all messages, and another one after it, as one."""
    size = one.content.shape[1]
    content = np.empty((len(other.content), size + other.content.shape[1]), np.uint8)
    content[:, :size], content[:, size:] = one.content, other.content
    return _Part(content, one.lengths + other.lengths)


def _by_sevens(values: NDArray[Any]) -> list[_Part]:
    """Write integers, (n, k), seven bits at a time, the least first; an eighth says if more come."""
    whole = values.astype(np.int64).view(np.uint64)
    most = max(1, -(-int(whole.max(initial=0)).bit_length() // 7))
    if most == 1:
        return [_whole(whole.astype(np.uint8))]
    parts = []
    for column in whole.T:
        sevens = column[:, np.newaxis] >> np.arange(0, 7 * most, 7, dtype=np.uint64)
        is_more = sevens[:, 1:] > 0
        content = (sevens & np.uint64(0x7F)).astype(np.uint8)
        content[:, :-1] |= is_more.view(np.uint8) << 7
        parts.append(_Part(content, 1 + is_more.sum(axis=1)))
    return parts
