"""Builds Foxglove's messages, and the parts that all messages share, from numbers and arrays."""

from typing import Final

import numpy as np
from foxglove_schemas_protobuf.FrameTransform_pb2 import FrameTransform
from foxglove_schemas_protobuf.Log_pb2 import Log
from foxglove_schemas_protobuf.PackedElementField_pb2 import PackedElementField
from foxglove_schemas_protobuf.PointCloud_pb2 import PointCloud
from foxglove_schemas_protobuf.Pose_pb2 import Pose
from foxglove_schemas_protobuf.PoseInFrame_pb2 import PoseInFrame
from foxglove_schemas_protobuf.Quaternion_pb2 import Quaternion
from foxglove_schemas_protobuf.Vector3_pb2 import Vector3
from google.protobuf.timestamp_pb2 import Timestamp
from numpy.typing import ArrayLike, NDArray

from telemetry.file import topics
from telemetry.file.errors import RecordingError

NANOSECONDS: Final = 1_000_000_000

POINT_DTYPE: Final = np.dtype(
    [
        ("x", "<f4"),
        ("y", "<f4"),
        ("z", "<f4"),
        ("red", "u1"),
        ("green", "u1"),
        ("blue", "u1"),
        ("alpha", "u1"),
    ]
)

#: the same bytes, as they are written
_PACKED_DTYPE: Final = np.dtype([("position", "<f4", 3), ("colour", "u1", 4)])

LOG_LEVELS: Final = {"debug": Log.DEBUG, "info": Log.INFO, "warning": Log.WARNING, "error": Log.ERROR}


def row(values: ArrayLike, length: int, field: str) -> list[float]:
    """Flatten an array into the list that a repeated field takes.

    Raises
    ------
    RecordingError
        If it does not hold `length` values.
    """
    flat: list[float] = np.asarray(values, dtype=np.float64).ravel().tolist()
    if len(flat) != length:
        raise RecordingError(f"{field} has {len(flat)} values, but {length} are expected; pass all of them")
    return flat


def transform(
    time_ns: int, parent: str, child: str, translation_m: list[float], quaternion: list[float]
) -> FrameTransform:
    """Build the transform of a child frame; `quaternion` (scalar last) turns child axes into parent axes."""
    return FrameTransform(
        timestamp=_timestamp(time_ns),
        parent_frame_id=parent,
        child_frame_id=child,
        translation=_vector(translation_m),
        rotation=_quaternion(quaternion),
    )


def pose_in_hill(time_ns: int, position_m: list[float], quaternion: list[float]) -> PoseInFrame:
    """Build the pose of a body in Hill; `quaternion` (scalar last) turns body axes into Hill axes."""
    pose = Pose(position=_vector(position_m), orientation=_quaternion(quaternion))
    return PoseInFrame(timestamp=_timestamp(time_ns), frame_id=topics.HILL_FRAME, pose=pose)


def point_cloud(time_ns: int, points_m: ArrayLike, states: ArrayLike) -> PointCloud:
    """Build a point cloud from points, (P, 3), chief axes, coloured by their states, (P,).

    Raises
    ------
    RecordingError
        If the shapes do not match or a state is not a `topics.PointState`.
    """
    cloud = PointCloud(timestamp=_timestamp(time_ns), data=_packed_points(points_m, states).tobytes())
    cloud.MergeFrom(_EMPTY_CLOUD)
    return cloud


def log(time_ns: int, level: str, text: str) -> Log:
    """Build a line of the event log.

    Raises
    ------
    RecordingError
        If `level` is not one of `LOG_LEVELS`.
    """
    if level not in LOG_LEVELS:
        raise RecordingError(f"there is no log level {level!r}; choose one of {', '.join(LOG_LEVELS)}")
    return Log(timestamp=_timestamp(time_ns), level=LOG_LEVELS[level], message=text, name="episode")


def _timestamp(time_ns: int) -> Timestamp:
    seconds, nanos = divmod(time_ns, NANOSECONDS)
    return Timestamp(seconds=seconds, nanos=nanos)


def _vector(row: list[float]) -> Vector3:
    return Vector3(x=row[0], y=row[1], z=row[2])


def _quaternion(row: list[float]) -> Quaternion:
    return Quaternion(x=row[0], y=row[1], z=row[2], w=row[3])


def _packed_points(points_m: ArrayLike, states: ArrayLike) -> NDArray[np.void]:
    points = np.asarray(points_m, dtype=np.float32)
    state = np.asarray(states, dtype=np.int64)
    if points.ndim != 2 or points.shape[1] != 3 or state.shape != points.shape[:1]:
        raise RecordingError(
            f"points of shape {points.shape} come with states of shape {state.shape}, "
            "but (P, 3) and (P,) are expected; pass one state for each point"
        )
    if state.size and not (state.min() >= 0 and state.max() < len(topics.POINT_COLOURS_RGBA)):
        raise RecordingError(
            f"point states range from {state.min()} to {state.max()}, but 0 to "
            f"{len(topics.POINT_COLOURS_RGBA) - 1} are expected; see telemetry.file.topics.PointState"
        )
    cloud = np.empty(len(points), dtype=_PACKED_DTYPE)
    cloud["position"] = points
    cloud["colour"] = topics.POINT_COLOURS_RGBA[state]
    return cloud


def _point_field(name: str) -> PackedElementField:
    dtype, offset = POINT_DTYPE.fields[name][:2]  # type: ignore[index]
    kind = PackedElementField.FLOAT32 if dtype == np.float32 else PackedElementField.UINT8
    return PackedElementField(name=name, offset=offset, type=kind)


_EMPTY_CLOUD: Final = PointCloud(
    frame_id=topics.CHIEF_FRAME,
    pose=Pose(position=Vector3(), orientation=Quaternion(w=1.0)),
    point_stride=POINT_DTYPE.itemsize,
    fields=[_point_field(name) for name in POINT_DTYPE.names or ()],
)
