"""Messages of one sample or of many, from the columns of their fields to the bytes that protobuf writes."""

import math
from collections.abc import Iterable, Iterator, Mapping
from itertools import repeat
from typing import Any, Final

import numpy as np
from foxglove_schemas_protobuf.Log_pb2 import Log
from foxglove_schemas_protobuf.PackedElementField_pb2 import PackedElementField
from foxglove_schemas_protobuf.Pose_pb2 import Pose
from foxglove_schemas_protobuf.Quaternion_pb2 import Quaternion
from foxglove_schemas_protobuf.Vector3_pb2 import Vector3
from google.protobuf.descriptor import FieldDescriptor
from google.protobuf.message import Message
from numpy.typing import ArrayLike, NDArray

from telemetry.array_types import Floats, Integers
from telemetry.file import RecordingError, topics

#: what fields hold, by their names
Columns = dict[str, Any]
LOG_LEVELS: Final = {"debug": Log.DEBUG, "info": Log.INFO, "warning": Log.WARNING, "error": Log.ERROR}
_REAL: Final = (FieldDescriptor.CPPTYPE_DOUBLE, FieldDescriptor.CPPTYPE_FLOAT)


def encode(kind: type[Message], columns: Mapping[str, Any], count: int) -> Iterator[bytes]:
    """Yield messages as protobuf writes them.

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
        If there is no field of a name.
    """
    for fields in _fields(kind.DESCRIPTOR, columns, count):
        yield kind(**fields).SerializeToString()


def _fields(descriptor: Any, columns: Mapping[str, Any], count: int) -> Iterator[dict[str, Any]]:
    known = descriptor.fields_by_name
    values = (_values(known[name], column, count) for name, column in columns.items())
    return (dict(zip(columns, row, strict=True)) for row in zip(*values, strict=False))


def _values(field: FieldDescriptor, column: Any, count: int) -> Iterable[Any]:
    """Return a field's value in each message; None leaves it out."""
    if isinstance(column, Mapping):
        return _fields(field.message_type, column, count)
    if not isinstance(column, np.ndarray):
        return repeat(column, count)
    if field.type == FieldDescriptor.TYPE_BYTES:
        return (row.tobytes() for row in column.astype(np.uint8))
    values = (column if field.cpp_type in _REAL else column.astype(np.int64)).tolist()
    return [None if math.isnan(value) else value for value in values] if field.has_presence else values


def nanoseconds(time_s: ArrayLike) -> Integers:
    """Return a time or several, s, as whole nanoseconds, (n,)."""
    return np.rint(np.atleast_1d(np.asarray(time_s, dtype=np.float64)) * topics.NANOSECONDS).astype(np.int64)


def rows(values: ArrayLike, count: int, length: int, field: str) -> Floats:
    """Return an array as `count` rows of `length` values.

    Raises
    ------
    RecordingError
        If it does not hold as many values.
    """
    array = np.asarray(values, dtype=np.float64)
    if array.size != count * length:
        raise RecordingError(
            f"{field} has {array.size} values, but {count * length} are expected; pass all of them"
        )
    return array.reshape(count, length)


def transform(parent: str, child: str, translation_m: Floats, quaternion: Floats) -> Columns:
    """Return messages of a child frame's transforms; quaternions (scalar last) map child to parent axes."""
    return {
        "parent_frame_id": parent,
        "child_frame_id": child,
        "translation": dict(zip("xyz", translation_m.T, strict=True)),
        "rotation": dict(zip("xyzw", quaternion.T, strict=True)),
    }


def point_cloud(count: int, points_m: ArrayLike, states: ArrayLike) -> Columns:
    """Return clouds of the same points, (P, 3), chief axes, coloured by states, (count, P).

    Raises
    ------
    RecordingError
        If the shapes do not match or a state is not a `topics.PointState`.
    """
    points, state = np.asarray(points_m), np.asarray(states, dtype=np.int64)
    if points.ndim != 2 or points.shape[1] != 3 or state.size != count * len(points):
        wanted = "(P,)" if count == 1 else f"({count}, P)"
        raise RecordingError(
            f"points of shape {points.shape} come with states of shape {state.shape}, "
            f"but (P, 3) and {wanted} are expected; pass one state for each point"
        )
    if state.size and not (state.min() >= 0 and state.max() < len(topics.POINT_COLOURS_RGBA)):
        raise RecordingError(
            f"point states range from {state.min()} to {state.max()}, but 0 to "
            f"{len(topics.POINT_COLOURS_RGBA) - 1} are expected; see telemetry.file.topics.PointState"
        )
    colours = topics.POINT_COLOURS_RGBA[state.reshape(count, len(points))]
    channels = dict(zip(topics.COLOUR_CHANNELS, np.moveaxis(colours, -1, 0), strict=True))
    return cloud_of(count, points, channels)


def cloud_of(count: int, points_m: ArrayLike, columns: Mapping[str, NDArray[Any]]) -> Columns:
    """Return clouds of the same points, (P, 3), chief axes, with columns of shape (count, P) or (P,).

    Columns of bytes or booleans are written as bytes, others as doubles.
    """
    points = np.asarray(points_m, dtype=np.float32)
    kinds = {name: "u1" if values.dtype.itemsize == 1 else "<f8" for name, values in columns.items()}
    layout = np.dtype([*dict.fromkeys("xyz", "<f4").items(), *kinds.items()])
    clouds = np.empty((count, len(points)), layout)
    for name, values in (*zip("xyz", points.T, strict=True), *columns.items()):
        clouds[name] = values
    fields = [(name, *layout.fields[name][:2]) for name in layout.names or ()]  # type: ignore[index]
    number_of = PackedElementField.NumericType.Value
    return {
        "frame_id": topics.CHIEF_FRAME,
        "pose": Pose(position=Vector3(), orientation=Quaternion(w=1.0)),
        "point_stride": layout.itemsize,
        "fields": [
            PackedElementField(name=name, offset=offset, type=number_of(kind.name.upper()))
            for name, kind, offset in fields
        ],
        "data": clouds.view(np.uint8).reshape(count, -1),
    }
