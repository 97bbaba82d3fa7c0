"""Messages encoded from columns against those that protobuf is given field by field: the same bytes."""

from typing import Any

import numpy as np
import pytest
from foxglove_schemas_protobuf.FrameTransform_pb2 import FrameTransform
from foxglove_schemas_protobuf.PointCloud_pb2 import PointCloud
from foxglove_schemas_protobuf.Pose_pb2 import Pose
from foxglove_schemas_protobuf.Quaternion_pb2 import Quaternion
from google.protobuf.descriptor_pb2 import EnumValueDescriptorProto, UninterpretedOption
from google.protobuf.message import Message

from telemetry.file.messages import encode
from telemetry.file.schema.inspection_pb2 import Control, FisActivation, MissionStatus, Navigation

COUNT = 40
GENERATOR = np.random.default_rng(17)


def numbers(*shape: int) -> np.ndarray:
    """Numbers of all sizes, among them zeros of either sign, infinity and NaN."""
    drawn = GENERATOR.normal(size=(COUNT, *shape)) * 10.0 ** GENERATOR.integers(-300, 300, (COUNT, *shape))
    odd = GENERATOR.choice([0.0, -0.0, np.inf, np.nan], drawn.shape)
    return np.where(GENERATOR.random(drawn.shape) < 0.4, odd, drawn)


def floats(*shape: int) -> np.ndarray:
    return GENERATOR.normal(size=(COUNT, *shape)) * (GENERATOR.random((COUNT, *shape)) < 0.6)


def integers(bits: int, *shape: int) -> np.ndarray:
    """Whole numbers of all lengths, from zero."""
    return GENERATOR.integers(0, 2**bits, (COUNT, *shape)) >> GENERATOR.integers(0, bits + 1, (COUNT, *shape))


CASES: list[tuple[type[Message], dict[str, Any]]] = [
    (
        FrameTransform,
        {
            # not in the order of their numbers
            "rotation": {axis: numbers() for axis in "wzyx"},
            "timestamp": {"seconds": integers(62), "nanos": integers(30)},
            "translation": {"x": numbers()},
            "child_frame_id": "deputy",
        },
    ),
    (
        PointCloud,
        {
            "data": GENERATOR.integers(0, 256, (COUNT, 300)).astype(np.uint8),
            "point_stride": integers(32),
            "timestamp": {"seconds": np.zeros(COUNT, np.int64)},
            "pose": {"orientation": Quaternion(w=1.0)},
        },
    ),
    (FisActivation, {"inputs": numbers(3), "firing_strengths": floats(25), "output_n": numbers()}),
    (FisActivation, {"inputs": np.empty((COUNT, 0)), "shares_n": floats(200), "output_n": np.zeros(COUNT)}),
    (Control, {"reason": integers(3, 3), "coasting_missed": numbers(), "coasting_nearest_m": numbers()}),
    (MissionStatus, {"inspected_mask": GENERATOR.random((COUNT, 7)) < 0.5, "inspected_count": integers(31)}),
    (Navigation, {"position_m": [1.0, -0.0, np.nan], "fix_age_s": 2.5}),
    # fields beyond 15, negative integers, truth and an optional integer
    (UninterpretedOption, {"negative_int_value": -integers(62), "positive_int_value": integers(62)}),
    (EnumValueDescriptorProto, {"number": integers(31) - 5, "options": {"deprecated": integers(1) > 0}}),
]


def one(kind: type[Message], columns: dict[str, Any], place: int) -> Message:
    """Build a message as protobuf wants it built."""
    message = kind()
    for name, value in columns.items():
        field = kind.DESCRIPTOR.fields_by_name[name]
        if isinstance(value, dict):
            inside = getattr(message, name)
            inside.SetInParent()
            inside.MergeFrom(one(type(inside), value, place))
            continue
        held = value[place] if isinstance(value, np.ndarray) else value
        if isinstance(held, np.ndarray):
            held = held.tobytes() if field.type == field.TYPE_BYTES else held.tolist()
        if not (isinstance(value, np.ndarray) and field.has_presence and np.isnan(held)):
            message.MergeFrom(kind(**{name: held}))
    return message


@pytest.mark.parametrize(("kind", "columns"), CASES, ids=lambda case: getattr(case, "__name__", ""))
def test_messages_have_the_bytes_that_protobuf_gives_each(
    kind: type[Message], columns: dict[str, Any]
) -> None:
    expected = [one(kind, columns, place).SerializeToString() for place in range(COUNT)]
    assert list(encode(kind, columns, COUNT)) == expected


def test_a_field_that_is_not_there_is_an_error() -> None:
    with pytest.raises(KeyError, match="colour"):
        list(encode(Pose, {"colour": np.zeros(1)}, 1))
