"""Many messages of one type at once: arrays in, and the bytes out that protobuf writes one by one.

Messages of a type differ in length by a few bytes only: protobuf writes integers as short as they are, and
leaves zeros out. So all are laid side by side at full length, a row each, with a note of which bytes count.
"""

import math
from collections.abc import Iterator, Mapping
from functools import cache
from itertools import pairwise
from typing import Any, Final, NamedTuple, Self

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
#: every byte of every row
_ALL: Final = np.ones((1, 1), np.bool_)


class _Rows(NamedTuple):
    """Bytes of some messages side by side; one row for all, or one column for all, where these are alike.

    Attributes
    ----------
    content : (n, width) uint8
    is_written : (n, width) bool
    lengths : (n,) int
        How many bytes of each row are written.
    """

    content: NDArray[np.uint8]
    is_written: NDArray[np.bool_]
    lengths: NDArray[np.int64]

    def only(self, is_set: NDArray[np.bool_]) -> Self:
        """Return the same with nothing where a field, (n,), is not set."""
        if is_set.all():
            return self
        is_written = self.is_written & is_set[:, np.newaxis]
        return self._replace(is_written=is_written, lengths=self.lengths * is_set)


def encode(kind: type[Message], columns: Mapping[str, Any], count: int) -> list[bytes]:
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

    Raises
    ------
    KeyError
        If there is no field of a name, or an array comes for one of another kind.
    """
    parts = _message(kind.DESCRIPTOR, columns, count)
    width = sum(part.content.shape[1] for part in parts)
    content, is_written = np.empty((count, width), np.uint8), np.empty((count, width), np.bool_)
    at = 0
    for part in parts:
        here = slice(at, at + part.content.shape[1])
        content[:, here], is_written[:, here] = part.content, part.is_written
        at = here.stop
    written = content[is_written].tobytes()
    ends = np.cumsum(np.broadcast_to(_length(parts), count)).tolist()
    return [written[start:end] for start, end in pairwise([0, *ends])]


def _message(descriptor: Any, columns: Mapping[str, Any], count: int) -> list[_Rows]:
    fields = sorted((descriptor.fields_by_name[name] for name in columns), key=lambda field: field.number)
    return [part for field in fields for part in _field(field, columns[field.name], count)]


def _length(parts: list[_Rows]) -> NDArray[np.int64]:
    return sum((part.lengths for part in parts), start=np.zeros(1, np.int64))


def _field(field: FieldDescriptor, value: Any, count: int) -> Iterator[_Rows]:
    """Yield tag, length and content of a field."""
    if isinstance(value, Mapping):
        assert field.message_type is not None  # noqa: S101 - mappings are for messages inside
        inside = _message(field.message_type, value, count)
        yield from (*_before(field.number, _length(inside)), *inside)
        return
    if not isinstance(value, np.ndarray):
        assert field.containing_type is not None  # noqa: S101 - it is no extension
        yield _alike(GetMessageClass(field.containing_type)(**{field.name: value}).SerializeToString())
        return
    values = value.reshape(count, math.prod(value.shape[1:]))
    dtype = _SIZES[field.type]
    content = _by_sevens(values) if dtype is None else _of_size(values, dtype)
    if field.is_repeated or field.type == FieldDescriptor.TYPE_BYTES:
        if content.lengths.any():
            yield from (*_before(field.number, content.lengths), content)
        return
    if field.has_presence:
        is_set = ~np.isnan(values[:, 0])
    else:
        # bit by bit, for a negative zero is written
        is_set = (values if dtype is None else content.content.view(f"u{dtype.itemsize}"))[:, 0] != 0
    tag = _tag(field.number, _BY_SEVENS if dtype is None else _BY_SIZE[dtype.itemsize])
    yield from (tag.only(is_set), content.only(is_set))


def _before(number: int, lengths: NDArray[np.int64]) -> Iterator[_Rows]:
    """Yield tag and length of what has a length."""
    if len(lengths) == 1:
        yield _tag(number, _BY_LENGTH, int(lengths[0]))
    else:
        yield from (_tag(number, _BY_LENGTH), _by_sevens(lengths))


@cache
def _tag(number: int, way: int, *length: int) -> _Rows:
    return _by_sevens(np.array([[number << 3 | way, *length]]))


def _alike(content: bytes) -> _Rows:
    return _Rows(np.frombuffer(content, np.uint8)[np.newaxis], _ALL, np.array([len(content)]))


def _of_size(values: NDArray[Any], dtype: np.dtype[Any]) -> _Rows:
    """Write numbers, (n, k), of a fixed size."""
    content = np.ascontiguousarray(values, dtype).view(np.uint8)
    return _Rows(content, _ALL, np.array([content.shape[1]]))


def _by_sevens(values: NDArray[Any]) -> _Rows:
    """Write integers, (n,) or (n, k), seven bits at a time, the least first; an eighth says if more come."""
    whole = values.astype(np.int64).reshape(len(values), -1, 1).view(np.uint64)
    most = max(1, -(-int(whole.max(initial=0)).bit_length() // 7))
    if most == 1:
        return _Rows(whole[:, :, 0].astype(np.uint8), _ALL, np.array([whole.shape[1]]))
    sevens = whole >> np.arange(0, 7 * most, 7, dtype=np.uint64)
    is_written = sevens > 0
    is_written[:, :, 0] = True
    content = (sevens & np.uint64(0x7F)).astype(np.uint8)
    content[:, :, :-1] |= is_written[:, :, 1:].view(np.uint8) << 7
    is_written = is_written.reshape(len(values), -1)
    return _Rows(content.reshape(is_written.shape), is_written, is_written.sum(axis=1))
