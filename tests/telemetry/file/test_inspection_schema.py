"""The messages: the generated module is that of the .proto, and the fields are those of the contract."""

from pathlib import Path

import pytest
from google.protobuf.descriptor import FieldDescriptor
from google.protobuf.descriptor_pb2 import FileDescriptorProto, FileDescriptorSet
from grpc_tools import protoc

from fis_tools.model.thrust import COMPONENTS, COUNTED, REASONS, UNKNOWN
from telemetry.file.schema import generate, inspection_pb2
from telemetry.file.topics import FIRED, FORCE_COMPONENTS, Reason

DOUBLE, FLOAT = FieldDescriptor.TYPE_DOUBLE, FieldDescriptor.TYPE_FLOAT
UINT32, BYTES = FieldDescriptor.TYPE_UINT32, FieldDescriptor.TYPE_BYTES
ENUM = FieldDescriptor.TYPE_ENUM

CONTRACT = {
    "DeputyState": [
        ("position_m", DOUBLE, True),
        ("velocity_m_s", DOUBLE, True),
        ("quaternion", DOUBLE, True),
        ("angular_velocity_rad_s", DOUBLE, True),
    ],
    "AttitudeHistory": [
        ("time_offset_s", FLOAT, True),
        ("quaternion", FLOAT, True),
        ("angular_velocity_rad_s", FLOAT, True),
        ("torque_n_m", FLOAT, True),
    ],
    "Control": [
        ("force_body_n", DOUBLE, True),
        ("force_hill_n", DOUBLE, True),
        ("force_asked_n", DOUBLE, True),
        ("reason", ENUM, True),
        ("coasting_missed", DOUBLE, False),
        ("coasting_nearest_m", DOUBLE, False),
        ("coasting_farthest_m", DOUBLE, False),
    ],
    "Navigation": [
        ("position_m", DOUBLE, True),
        ("velocity_m_s", DOUBLE, True),
        ("position_deviation_m", DOUBLE, True),
        ("velocity_deviation_m_s", DOUBLE, True),
        ("fix_m", DOUBLE, True),
        ("fix_age_s", DOUBLE, False),
        ("quaternion", DOUBLE, True),
    ],
    "Guidance": [
        ("num_candidates", UINT32, False),
        ("target_direction", DOUBLE, True),
        ("lambda_u_rad", DOUBLE, False),
        ("eta_u_rad", DOUBLE, False),
    ],
    "FisActivation": [
        ("inputs", DOUBLE, True),
        ("firing_strengths", FLOAT, True),
        ("output_n", DOUBLE, False),
        ("shares_n", FLOAT, True),
    ],
    "MissionStatus": [
        ("sun_angle_rad", DOUBLE, False),
        ("distance_m", DOUBLE, False),
        ("inspected_count", UINT32, False),
        ("inspection_rate_percent", DOUBLE, False),
        ("delta_v_m_s", DOUBLE, False),
        ("inspected_mask", BYTES, False),
        ("sun_elevation_rad", DOUBLE, False),
        ("sun_hidden_share", DOUBLE, False),
        ("inspectable_count", UINT32, False),
        ("mass_kg", DOUBLE, False),
    ],
}


def test_generated_module_is_that_of_the_proto_file(tmp_path: Path) -> None:
    compiled = tmp_path / "inspection.desc"
    arguments = ["protoc", f"-I{generate.SCHEMA_FOLDER}", f"--descriptor_set_out={compiled}", generate.PROTO]
    assert protoc.main(arguments) == 0
    expected = FileDescriptorSet.FromString(compiled.read_bytes()).file[0]
    generated = FileDescriptorProto.FromString(inspection_pb2.DESCRIPTOR.serialized_pb)
    for description in (expected, generated):
        for message in description.message_type:
            for field in message.field:
                field.ClearField(
                    "json_name"
                )  # which of the two spells it out depends on the compiler's release
    assert generated == expected, "run python -m telemetry.file.schema.generate"


def test_generating_gives_the_type_stub_that_is_kept(tmp_path: Path) -> None:
    generate.generate(tmp_path)
    kept = generate.SCHEMA_FOLDER / "inspection_pb2.pyi"
    assert (tmp_path / "inspection_pb2.pyi").read_text() == kept.read_text()


def test_package_holds_the_messages_of_the_contract() -> None:
    assert inspection_pb2.DESCRIPTOR.package == "inspection"
    assert set(inspection_pb2.DESCRIPTOR.message_types_by_name) == set(CONTRACT)


@pytest.mark.parametrize("message", CONTRACT)
def test_fields_are_those_of_the_contract(message: str) -> None:
    fields = inspection_pb2.DESCRIPTOR.message_types_by_name[message].fields
    assert [(field.name, field.type, field.is_repeated) for field in fields] == CONTRACT[message]
    assert [field.number for field in fields] == list(range(1, len(fields) + 1))


def test_reasons_are_those_of_the_thrust_logic() -> None:
    numbers = {value.name: value.number for value in inspection_pb2.Control.Reason.DESCRIPTOR.values}
    assert numbers == {reason.name: reason.value for reason in Reason}
    assert [reason.name.lower() for reason in Reason] == [UNKNOWN, *REASONS]
    assert set(FIRED) == {*COUNTED, UNKNOWN}
    assert FORCE_COMPONENTS == COMPONENTS
