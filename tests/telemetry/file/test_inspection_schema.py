"""The messages: the generated module is that of the .proto, and the fields are those of the contract."""

from pathlib import Path

import pytest
from google.protobuf.descriptor import FieldDescriptor
from google.protobuf.descriptor_pb2 import FileDescriptorProto, FileDescriptorSet
from grpc_tools import protoc

from fis_tools.model.thrust import COMPONENTS, COUNTED, REASONS, UNKNOWN
from telemetry.file.schema import generate, inspection_pb2
from telemetry.file.topics import FIRED, FORCE_COMPONENTS, Reason

#: fields in the order of their numbers; several values are marked by brackets
CONTRACT = {
    "DeputyState": "double[] position_m velocity_m_s quaternion angular_velocity_rad_s",
    "AttitudeHistory": "float[] time_offset_s quaternion angular_velocity_rad_s torque_n_m",
    "Control": "double[] force_body_n force_hill_n force_asked_n enum[] reason "
    "double coasting_missed coasting_nearest_m coasting_farthest_m "
    "double[] force_commanded_n enum[] command_reason double command_age_s",
    "Navigation": "double[] position_m velocity_m_s position_deviation_m velocity_deviation_m_s fix_m "
    "double fix_age_s double[] quaternion",
    "Guidance": "uint32 num_candidates double[] target_direction double lambda_u_rad eta_u_rad",
    "FisActivation": "double[] inputs float[] firing_strengths double output_n "
    "float[] shares_single_n double[] shares_n",
    "MissionStatus": "double sun_angle_rad distance_m uint32 inspected_count "
    "double inspection_rate_percent delta_v_m_s bytes inspected_mask "
    "double sun_elevation_rad sun_hidden_share uint32 inspectable_count double mass_kg",
}
TYPES = {
    FieldDescriptor.TYPE_DOUBLE: "double",
    FieldDescriptor.TYPE_FLOAT: "float",
    FieldDescriptor.TYPE_UINT32: "uint32",
    FieldDescriptor.TYPE_BYTES: "bytes",
    FieldDescriptor.TYPE_ENUM: "enum",
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
    told, kind = list[str](), ""
    for field in fields:
        before, kind = kind, TYPES[field.type] + "[]" * field.is_repeated
        told += [field.name] if kind == before else [kind, field.name]
    assert told == CONTRACT[message].split()
    assert [field.number for field in fields] == list(range(1, len(fields) + 1))


def test_reasons_are_those_of_the_thrust_logic() -> None:
    numbers = {value.name: value.number for value in inspection_pb2.Control.Reason.DESCRIPTOR.values}
    assert numbers == {reason.name: reason.value for reason in Reason}
    assert [reason.name.lower() for reason in Reason] == [UNKNOWN, *REASONS]
    assert set(FIRED) == {*COUNTED, UNKNOWN}
    assert FORCE_COMPONENTS == COMPONENTS
