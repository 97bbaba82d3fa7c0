"""What the fields of messages hold, of one sample or of many, and these messages as protobuf writes them."""

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

NANOSECONDS: Final = 1_000_000_000

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
    """Return what a field holds in each message; None leaves it out."""
    if isinstance(column, Mapping):
        return _fields(field.message_type, column, count)
    if not isinstance(column, np.ndarray):
        return repeat(column, count)
    if field.type == FieldDescriptor.TYPE_BYTES:
        return (row.tobytes() for row in column.astype(np.uint8))
    values = (column if field.cpp_type in _REAL else column.astype(np.int64)).tolist()
    return [None if math.isnan(value) else value for value in values] if field.has_presence else values


def nanoseconds(time_s: ArrayLike) -> Integers:
    """Return times, or one, as whole nanoseconds, (n,)."""
    return np.rint(np.atleast_1d(np.asarray(time_s, dtype=np.float64)) * NANOSECONDS).astype(np.int64)


def rows(values: ArrayLike, count: int, length: int, field: str) -> Floats:
    """Return an array as that many rows of a length.

    Raises
    ------
    RecordingError
        If it does not hold as many values.
    """
    found = np.asarray(values, dtype=np.float64)
    if found.size != count * length:
        raise RecordingError(
            f"{field} has {found.size} values, but {count * length} are expected; pass all of them"
        )
    return found.reshape(count, length)


def transform(
    time_ns: Integers, parent: str, child: str, translation_m: Floats, quaternion: Floats
) -> Columns:
    """Tell transforms of a child frame; quaternions (scalar last) turn child axes into parent axes."""
    return {
        "timestamp": _timestamp(time_ns),
        "parent_frame_id": parent,
        "child_frame_id": child,
        "translation": dict(zip("xyz", translation_m.T, strict=True)),
        "rotation": dict(zip("xyzw", quaternion.T, strict=True)),
    }


def pose_in_hill(time_ns: Integers, position_m: Floats, quaternion: Floats) -> Columns:
    """Tell poses of a body in Hill; quaternions (scalar last) turn body axes into Hill axes."""
    pose = {
        "position": dict(zip("xyz", position_m.T, strict=True)),
        "orientation": dict(zip("xyzw", quaternion.T, strict=True)),
    }
    return {"timestamp": _timestamp(time_ns), "frame_id": topics.HILL_FRAME, "pose": pose}


def point_cloud(time_ns: Integers, points_m: ArrayLike, states: ArrayLike) -> Columns:
    """Tell clouds of points, (P, 3), chief axes, coloured by their states, a row of P for each time.

    Raises
    ------
    RecordingError
        If the shapes do not match or a state is not a `topics.PointState`.
    """
    count, points, state = len(time_ns), np.asarray(points_m), np.asarray(states, dtype=np.int64)
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
    return cloud_of(time_ns, points, channels)


def cloud_of(time_ns: Integers, points_m: ArrayLike, columns: Mapping[str, NDArray[Any]]) -> Columns:
    """Tell clouds of points, (P, 3), chief axes, with columns of a row of P for each time, or one for all.

    Columns of bytes or booleans are written as bytes, others as doubles.
    """
    points = np.asarray(points_m, dtype=np.float32)
    kinds = {name: "u1" if values.dtype.itemsize == 1 else "<f8" for name, values in columns.items()}
    layout = np.dtype([*dict.fromkeys("xyz", "<f4").items(), *kinds.items()])
    clouds = np.empty((len(time_ns), len(points)), layout)
    for name, values in (*zip("xyz", points.T, strict=True), *columns.items()):
        clouds[name] = values
    packed = clouds.view(np.uint8).reshape(len(time_ns), -1)
    return {"timestamp": _timestamp(time_ns), "data": packed, **_layout(layout)}


def log(time_ns: Integers, level: str, text: str) -> Columns:
    """Tell a line of the event log.

    Raises
    ------
    RecordingError
        If `level` is not one of `LOG_LEVELS`.
    """
    if level not in LOG_LEVELS:
        raise RecordingError(f"there is no log level {level!r}; choose one of {', '.join(LOG_LEVELS)}")
    return {"timestamp": _timestamp(time_ns), "level": LOG_LEVELS[level], "message": text, "name": "episode"}


def _timestamp(time_ns: Integers) -> Columns:
    return {"seconds": time_ns // NANOSECONDS, "nanos": time_ns % NANOSECONDS}


_KINDS: Final = {
    "u1": PackedElementField.UINT8,
    "f4": PackedElementField.FLOAT32,
    "f8": PackedElementField.FLOAT64,
}


def _layout(dtype: np.dtype[Any]) -> Columns:
    """Return what all clouds of points of a type have alike."""
    fields = [(name, *dtype.fields[name][:2]) for name in dtype.names or ()]  # type: ignore[index]
    return {
        "frame_id": topics.CHIEF_FRAME,
        "pose": Pose(position=Vector3(), orientation=Quaternion(w=1.0)),
        "point_stride": dtype.itemsize,
        "fields": [
            PackedElementField(name=name, offset=offset, type=_KINDS[kind.str[1:]])
            for name, kind, offset in fields
        ],
    }
