"""Messages of a topic as columns, time along the first axis, and columns as Arrow tables."""

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from itertools import chain
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from foxglove_schemas_protobuf.FrameTransform_pb2 import FrameTransform
from foxglove_schemas_protobuf.Log_pb2 import Log
from foxglove_schemas_protobuf.PackedElementField_pb2 import PackedElementField
from foxglove_schemas_protobuf.PointCloud_pb2 import PointCloud
from foxglove_schemas_protobuf.PoseInFrame_pb2 import PoseInFrame
from google.protobuf.descriptor import FieldDescriptor
from google.protobuf.message import Message
from numpy.typing import NDArray

from plain_files.plain_text import plain
from telemetry.array_types import Bytes, Floats
from telemetry.file import RecordingError, topics
from telemetry.file.schema import inspection_pb2

if TYPE_CHECKING:
    import pyarrow as pa


Columns = dict[str, NDArray[np.generic]]

#: of a column, whose texts all take the room of the longest
MOST_LETTERS: Final = 16 * 1024**2
#: state of a point whose colour is not one of `topics.POINT_COLOURS_RGBA`
UNKNOWN_STATE: Final = 255

_DTYPE_OF_FIELD: Final[Mapping[int, np.dtype[Any]]] = {
    FieldDescriptor.TYPE_DOUBLE: np.dtype(np.float64),
    FieldDescriptor.TYPE_FLOAT: np.dtype(np.float32),
    FieldDescriptor.TYPE_UINT32: np.dtype(np.int64),
}
_DTYPE_OF_POINT_FIELD: Final[Mapping[int, str]] = {
    PackedElementField.NumericType.Value(np.dtype(kind).name.upper()): kind
    for kind in ("u1", "i1", "<u2", "<i2", "<u4", "<i4", "<f4", "<f8")
}


def _own_message(kind: type[Message], payloads: Sequence[bytes]) -> Columns:
    """Decode messages of our own schemas to a column for each field."""
    messages = [kind.FromString(payload) for payload in payloads]
    return {
        field.name: _field([_value(message, field) for message in messages], field)
        for field in kind.DESCRIPTOR.fields
    }


def _value(message: Message, field: Any) -> Any:
    if field.has_presence and not message.HasField(field.name):
        return np.nan
    return getattr(message, field.name)


def _attitude_history(payloads: Sequence[bytes]) -> Columns:
    """Decode attitudes within control periods, (n, num_instants, ...)."""
    columns = _own_message(inspection_pb2.AttitudeHistory, payloads)
    num_messages, num_instants = columns["time_offset_s"].shape
    for name in columns.keys() - {"time_offset_s"}:
        columns[name] = columns[name].reshape(num_messages, num_instants, topics.LENGTHS[name])
    return columns


def _inferences(payloads: Sequence[bytes]) -> Columns:
    """Decode inferences; shares of earlier versions are single floats."""
    columns = _own_message(inspection_pb2.FisActivation, payloads)
    single = columns.pop("shares_single_n")
    if not columns["shares_n"].size:
        columns["shares_n"] = single
    return columns


def _field(values: list[Any], field: Any) -> NDArray[np.generic]:
    """Return a field's values of all messages as an array with a row for each."""
    if field.type == FieldDescriptor.TYPE_BYTES:
        return _rectangle(values, field.name, np.dtype(np.uint8)).astype(np.bool_)
    if field.enum_type is not None:
        words = np.array([value.name.lower() for value in field.enum_type.values])
        numbers = _rectangle(values, field.name, np.dtype(np.int64)).astype(np.int64)
        # the first word is "unknown"
        return words[np.where(numbers < len(words), numbers, 0)]
    dtype = _DTYPE_OF_FIELD[field.type]
    return _rectangle(values, field.name, dtype) if field.is_repeated else np.array(values, dtype=dtype)


def _rectangle(
    rows: Sequence[Sequence[float]] | Sequence[bytes], name: str, dtype: np.dtype[Any]
) -> NDArray[np.generic]:
    """Return rows of equal length as an array; raise RecordingError for unequal ones."""
    lengths = {len(row) for row in rows}
    if len(lengths) > 1:
        raise RecordingError(
            f"the field {name!r} has rows of {' and '.join(map(str, sorted(lengths)))} values, but a column "
            "needs rows of one length; read a shorter stretch with start_s and end_s"
        )
    width = lengths.pop() if lengths else 0
    flat = np.fromiter(chain.from_iterable(rows), dtype, count=len(rows) * width)
    return flat.reshape(len(rows), width)


def _words(texts: Sequence[str]) -> NDArray[np.generic]:
    """Return texts as a fixed-width column, cleaned."""
    longest = max(map(len, texts), default=0)
    if longest * len(texts) > MOST_LETTERS:
        raise RecordingError(
            f"one of {len(texts)} messages has {longest} letters, and together at most {MOST_LETTERS} are "
            "read; read a shorter stretch with start_s and end_s"
        )
    return np.array([plain(text) for text in texts], dtype=np.str_)


def _transforms(payloads: Sequence[bytes]) -> Columns:
    """Decode Foxglove transforms: frames, translations and quaternions."""
    messages = [FrameTransform.FromString(payload) for payload in payloads]
    return {
        "parent_frame": _words([m.parent_frame_id for m in messages]),
        "child_frame": _words([m.child_frame_id for m in messages]),
        "translation_m": _vectors([m.translation for m in messages]),
        "quaternion": _vectors([m.rotation for m in messages], "xyzw"),
    }


def _poses(payloads: Sequence[bytes]) -> Columns:
    """Decode Foxglove poses: frame, position and quaternion."""
    messages = [PoseInFrame.FromString(payload) for payload in payloads]
    return {
        "frame": _words([m.frame_id for m in messages]),
        "position_m": _vectors([m.pose.position for m in messages]),
        "quaternion": _vectors([m.pose.orientation for m in messages], "xyzw"),
    }


def _logs(payloads: Sequence[bytes]) -> Columns:
    """Decode log messages: level and text."""
    messages = [Log.FromString(payload) for payload in payloads]
    return {
        "level": np.array([Log.Level.Name(m.level).lower() for m in messages], dtype=np.str_),
        "message": _words([m.message for m in messages]),
    }


def _point_clouds(payloads: Sequence[bytes]) -> Columns:
    """Decode Foxglove point clouds to positions, (n, P, 3), and colours or other columns."""
    messages = [PointCloud.FromString(payload) for payload in payloads]
    if not messages:
        empty = np.empty((0, 0, 4), dtype=np.uint8)
        return _cloud_columns(np.empty((0, 0, 3), dtype=np.float32), empty)
    fields = messages[0].fields
    layout = np.dtype(
        {
            "names": [field.name for field in fields],
            "formats": [_DTYPE_OF_POINT_FIELD[field.type] for field in fields],
            "offsets": [field.offset for field in fields],
            "itemsize": messages[0].point_stride,
        }
    )
    raw = _rectangle([m.data for m in messages], "data", np.dtype(np.uint8))
    points = raw.view(layout).reshape(len(messages), -1)
    positions = np.stack([points[axis] for axis in ("x", "y", "z")], axis=-1)
    names = layout.names or ()
    channels = topics.COLOUR_CHANNELS
    if not set(channels) & set(names):
        return {"position_m": positions, **{plain(name): points[name] for name in names if name not in "xyz"}}
    return _cloud_columns(positions, np.stack([points[channel] for channel in channels], axis=-1))


def _cloud_columns(positions: NDArray[np.float32], colours: Bytes) -> Columns:
    """Return positions, colours, and the states that the colours stand for."""
    states = np.full(colours.shape[:-1], UNKNOWN_STATE, dtype=np.uint8)
    for state, colour in zip(topics.PointState, topics.POINT_COLOURS_RGBA, strict=True):
        states[(colours == colour).all(axis=-1)] = state
    return {"position_m": positions, "colour_rgba": colours, "state": states}


def _vectors(vectors: Sequence[Message], axes: str = "xyz") -> Floats:
    rows = [[getattr(vector, axis) for axis in axes] for vector in vectors]
    return np.array(rows, dtype=np.float64).reshape(-1, len(axes))


#: by the full protobuf name of a schema: decodes the messages of a topic, which are bytes in order of time,
#: into columns whose first axis is the message; a RecordingError tells of messages that differ in shape
DECODERS: Final[Mapping[str, Callable[[Sequence[bytes]], Columns]]] = {
    "foxglove.FrameTransform": _transforms,
    "foxglove.PoseInFrame": _poses,
    "foxglove.PointCloud": _point_clouds,
    "foxglove.Log": _logs,
    **{
        kind.full_name: partial(_own_message, getattr(inspection_pb2, name))
        for name, kind in inspection_pb2.DESCRIPTOR.message_types_by_name.items()
    },
    "inspection.AttitudeHistory": _attitude_history,
    "inspection.FisActivation": _inferences,
}


#: key of the unit in a field's metadata
UNIT: Final = "unit"


def arrow_table(
    columns: Mapping[str, NDArray[np.generic]], units: Mapping[str, str], description: Mapping[str, str]
) -> "pa.Table":
    """Build an Arrow table.

    Parameters
    ----------
    columns : mapping of str to array
        Arrays of equal length; further axes become lists of fixed size.
    units : mapping of str to str
        Of the columns that have one; stored in the field's metadata as ``unit``.
    description : mapping of str to str
        Metadata of the table.
    """
    # pyarrow takes a tenth of a second to import; only tables need it
    import pyarrow as pa  # noqa: PLC0415

    arrays = {name: _array(values) for name, values in columns.items()}
    fields = []
    for name, array in arrays.items():
        unit = units.get(name, "")
        fields.append(pa.field(name, array.type, metadata={UNIT: unit} if unit else None))
    return pa.table(list(arrays.values()), schema=pa.schema(fields, metadata=dict(description)))


def _array(values: NDArray[np.generic]) -> "pa.Array":
    """Return an array as an Arrow array; further axes become lists of fixed size."""
    import pyarrow as pa  # noqa: PLC0415

    flat = values.ravel()
    array = pa.array(flat.tolist(), pa.string()) if values.dtype.kind == "U" else pa.array(flat)
    for size in reversed(values.shape[1:]):
        if values.size:
            array = pa.FixedSizeListArray.from_arrays(array, size)
        else:
            array = pa.array([[]] * len(values), pa.list_(array.type, size))
    return array
