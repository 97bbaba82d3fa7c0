"""Metadata is strings: what is said comes back, and nonsense is refused.

The README names every topic, and it or the schema every field, with its unit and axes.
"""

import json
import re
import zlib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from foxglove_schemas_protobuf.FrameTransform_pb2 import FrameTransform
from google.protobuf.descriptor import FieldDescriptor
from google.protobuf.descriptor_pb2 import FileDescriptorProto, FileDescriptorSet
from grpc_tools import protoc
from hypothesis import given, settings
from hypothesis import strategies as st

import telemetry
from docs.scripts.hooks import messages
from fis_tools.model.thrust import COMPONENTS, COUNTED, REASONS, UNKNOWN
from plain_files.plain_text import plain
from telemetry import RecordingError
from telemetry.file import topics
from telemetry.file.columns import DECODERS
from telemetry.file.messages import encode
from telemetry.file.metadata import EpisodeDescription, FisDescription, Rehearsal, sealed, unsealed
from telemetry.file.schema import inspection_pb2
from telemetry.file.schema.inspection_pb2 import Control, MissionStatus
from telemetry.file.topics import FIRED, FORCE_COMPONENTS, Reason

SCHEMA, PROTO = Path(inspection_pb2.__file__).parent, "inspection.proto"

words = st.text(max_size=12).map(plain)
finite = st.floats(allow_nan=False, allow_infinity=False)
triples = st.tuples(finite, finite, finite)


lists = st.lists(words, max_size=5).map(tuple)
OF_EPISODES = {"scenario_id": words, "config_hash": words, "seed": st.integers(0, 2**63 - 1)}
OF_EPISODES |= {"position_m": triples, "boresight": triples}
OF_EPISODES |= {"sun_angle_rad": finite, "max_distance_m": finite}
EPISODES = st.builds(EpisodeDescription, **{name: st.none() | kind for name, kind in OF_EPISODES.items()})
PUT = {"input_names": lists, "input_units": lists, "output_name": words, "output_unit": words, "rules": lists}


@settings(max_examples=100, deadline=None)
@given(EPISODES | st.builds(FisDescription, **PUT))
def test_a_description_comes_back(description):
    spelled = description.to_metadata()
    assert all(isinstance(value, str) for value in spelled.values())
    assert type(description).from_metadata(spelled) == description


def test_keys_of_others_are_left_alone_and_nonsense_is_refused():
    assert EpisodeDescription.from_metadata({"seed": "3", "mood": "calm"}) == EpisodeDescription(seed=3)
    with pytest.raises(RecordingError, match="metadata 'seed' is 'seven'"):
        EpisodeDescription.from_metadata({"seed": "seven"})
    with pytest.raises(RecordingError, match="lacks input_units, output_unit, rules"):
        FisDescription.from_metadata({"input_names": "[]", "output_name": "f"})
    whole = FisDescription(input_names=(), input_units=(), output_name="f", output_unit="N", rules=())
    for key, text in (("rules", "3"), ("holding", "[1]"), ("holding", "x")):
        with pytest.raises(RecordingError, match=f"'{key}' is .* expected; write it with telemetry.file"):
            FisDescription.from_metadata({**whole.to_metadata(), key: text})


def test_whole_numbers_have_64_bits():
    most = np.iinfo(np.int64).max
    for seed in (most, -most):
        assert EpisodeDescription.from_metadata({"seed": f"{seed}"}).seed == seed
    with pytest.raises(RecordingError, match=f"'seed' is '{most + 1}', but 1 finite whole numbers are"):
        EpisodeDescription.from_metadata({"seed": f"{most + 1}"})


@settings(max_examples=50, deadline=None)
@given(words, st.dictionaries(words, words, max_size=4))
def test_sealed_entries_come_back_and_changed_ones_do_not(name, entries):
    kept = {key: value for key, value in entries.items() if key != "crc32"}
    stored = sealed(name, kept)
    assert unsealed(name, stored) == kept
    assert stored["crc32"] == str(zlib.crc32(json.dumps([name, sorted(kept.items())]).encode()))
    with pytest.raises(ValueError, match="does not match its checksum"):
        unsealed(name, {**stored, "an entry of more than twelve letters": ""})


def test_a_rehearsal_is_read_as_it_was_written_and_has_a_cost_for_each_name():
    rehearsal = Rehearsal(names=("up", "down"), costs_m_s=(0.25, 1e4), until_s=10.0)
    assert Rehearsal.from_metadata(rehearsal.to_metadata()) == rehearsal
    drawn = replace(rehearsal, num_tried=64, paths_m=(0.0, 1.5, -2.0, 3.0, 4.0, 5.0))
    assert Rehearsal.from_metadata(drawn.to_metadata()) == drawn
    odd = ({"paths_m": "[0, 1, 2]"}, {"paths_m": "[]"}, {"num_tried": "1.5"})
    odd += ({"costs_m_s": "[0.25]"}, {"names": "[]", "costs_m_s": "[]"}, {"costs_m_s": "1"}, {"until_s": "x"})
    for wrong in odd:
        with pytest.raises(RecordingError, match=r"expected; write it with telemetry\.file\.metadata"):
            Rehearsal.from_metadata({**rehearsal.to_metadata(), **wrong})


def test_messages_hold_a_row_of_each_column():
    """Arrays go row by row, NaN leaves an optional field out, and all else is the same in each message."""
    columns = {"reason": np.array([[1.0, 2.0, 7.0]] * 2), "coasting_missed": np.array([np.nan, 2.0])}
    encoded = encode(Control, columns, 2)
    expected = [Control(reason=[1, 2, 7]), Control(reason=[1, 2, 7], coasting_missed=2.0)]
    assert list(map(Control.FromString, encoded)) == expected
    stamps, axes = {"seconds": np.array([5, 6])}, {"x": np.array([-0.0, np.inf])}
    encoded = encode(
        FrameTransform, {"timestamp": stamps, "translation": axes, "child_frame_id": "deputy"}, 2
    )
    for message, second, x in zip(
        map(FrameTransform.FromString, encoded), (5, 6), (-0.0, np.inf), strict=True
    ):
        assert (message.timestamp.seconds, message.child_frame_id) == (second, "deputy")
        assert np.array([message.translation.x]).tobytes() == np.array([x]).tobytes()
    encoded = encode(MissionStatus, {"inspected_mask": np.array([[True, False, True]])}, 1)
    assert MissionStatus.FromString(*encoded).inspected_mask == b"\1\0\1"


#: fields in the order of their numbers; several values are marked by brackets
CONTRACT = {
    "DeputyState": "double[] position_m velocity_m_s quaternion angular_velocity_rad_s",
    "AttitudeHistory": "float[] time_offset_s quaternion angular_velocity_rad_s torque_n_m",
    "Control": "double[] force_body_n force_hill_n force_asked_n enum[] reason "
    "double coasting_missed coasting_nearest_m coasting_farthest_m "
    "double[] force_commanded_n enum[] command_reason double command_age_s",
    "Navigation": "double[] position_m velocity_m_s position_deviation_m velocity_deviation_m_s fix_m "
    "double fix_age_s double[] quaternion innovation_m double innovation_square",
    "Guidance": "uint32 num_candidates double[] target_direction double lambda_u_rad eta_u_rad",
    "FisActivation": "double[] inputs float[] firing_strengths double output_n "
    "float[] shares_single_n double[] shares_n",
    "MissionStatus": "double sun_angle_rad distance_m uint32 inspected_count "
    "double inspection_rate_percent delta_v_m_s bytes inspected_mask "
    "double sun_elevation_rad sun_hidden_share uint32 inspectable_count double mass_kg",
}
KINDS = ("double", "float", "uint32", "bytes", "enum")
TYPES = {getattr(FieldDescriptor, f"TYPE_{kind.upper()}"): kind for kind in KINDS}


def test_generated_module_and_stub_are_those_of_the_proto_file(tmp_path: Path) -> None:
    compiled = tmp_path / "inspection.desc"
    outputs = [f"--descriptor_set_out={compiled}", f"--pyi_out={tmp_path}"]
    assert protoc.main(["protoc", f"-I{SCHEMA}", *outputs, PROTO]) == 0
    stub = "inspection_pb2.pyi"
    assert (tmp_path / stub).read_text() == (SCHEMA / stub).read_text(), "generate it, see CONTRIBUTING.md"
    expected = FileDescriptorSet.FromString(compiled.read_bytes()).file[0]
    generated = FileDescriptorProto.FromString(inspection_pb2.DESCRIPTOR.serialized_pb)
    for description in (expected, generated):
        for message in description.message_type:
            for field in message.field:
                # which of the two spells it out depends on the compiler's release
                field.ClearField("json_name")
    assert generated == expected, "generate it, see CONTRIBUTING.md"


def test_messages_and_fields_are_those_of_the_contract() -> None:
    assert inspection_pb2.DESCRIPTOR.package == "inspection"
    kinds = inspection_pb2.DESCRIPTOR.message_types_by_name
    assert set(kinds) == set(CONTRACT)
    for message, contract in CONTRACT.items():
        fields, listed, kind = kinds[message].fields, list[str](), ""
        for field in fields:
            before, kind = kind, TYPES[field.type] + "[]" * field.is_repeated
            listed += [field.name] if kind == before else [kind, field.name]
        assert listed == contract.split()
        assert [field.number for field in fields] == list(range(1, len(fields) + 1))


def test_reasons_are_those_of_the_thrust_logic() -> None:
    numbers = {value.name: value.number for value in inspection_pb2.Control.Reason.DESCRIPTOR.values}
    assert numbers == {reason.name: reason.value for reason in Reason}
    assert [reason.name.lower() for reason in Reason] == [UNKNOWN, *REASONS]
    assert set(FIRED) == {*COUNTED, UNKNOWN}
    assert FORCE_COMPONENTS == COMPONENTS


README = (Path(telemetry.__file__).parent / "README.md").read_text(encoding="utf-8")


def section(topic: str) -> str:
    """The part of the README under a topic's heading."""
    match = re.search(rf"^### `{re.escape(topic)}` · `[\w.]+`$(.*?)(?=^##)", README, re.DOTALL | re.MULTILINE)
    assert match is not None, topic
    return match.group(0)


def test_every_topic_has_a_place():
    headings = re.findall(r"^### `(.+)` · ", README + messages(), re.MULTILINE)
    for topic in (*topics.FIXED_TOPICS, topics.NAVIGATION, "/fis/<name>"):
        assert headings.count(topic) == 1, topic


def test_a_word_of_a_later_version_is_unknown():
    values = Control.Reason.DESCRIPTOR.values
    words = [value.name.lower() for value in values]
    later = Control(reason=[*(value.number for value in values), len(values), len(values) + 40])
    decoded = DECODERS["inspection.Control"]([later.SerializeToString()])
    assert decoded["reason"].tolist() == [[*words, words[0], words[0]]]


@pytest.mark.parametrize("message", inspection_pb2.DESCRIPTOR.message_types_by_name)
def test_every_field_of_our_messages_has_its_own_words_and_a_vector_its_axes(message):
    _, _, table = messages().partition(f" · `inspection.{message}`\n")
    words = dict(re.findall(r"^\| `(\w+)` \| [\w ]+ \| (.*) \|$", table.partition("###")[0], re.MULTILINE))
    fields = inspection_pb2.DESCRIPTOR.message_types_by_name[message].fields
    assert list(words) == [field.name for field in fields]
    assert all(words.values())
    for name, length in topics.LENGTHS.items():
        if name in words and length == 3 and "reason" not in name:
            assert re.search(r"(Hill|body|own) axes", words[name]), name
    assert "Hill to body" in words.get("quaternion", "Hill to body")


def rows(topic: str) -> list[list[str]]:
    """The cells of a topic's table, without its head."""
    lines = re.findall(r"^\| (.+) \|$", section(topic), re.MULTILINE)
    return [[cell.strip() for cell in re.split(r"(?:^|(?<= ))\|(?: |$)", line)] for line in lines[1:]]


@pytest.mark.parametrize("topic", topics.FIXED_TOPICS[:3])
def test_every_column_read_of_foxgloves_messages_has_a_line_with_its_unit(topic, short_file):
    columns = telemetry.read(short_file, topic)[topic]
    assert f"`{columns.schema}`" in section(topic)
    described = {}
    for fields, read_as, unit, _ in rows(topic):
        message = re.findall(r"`([\w.]+)`", fields)
        for name in re.findall(r"`(\w+)`", read_as):
            described[name] = unit
        assert message or read_as == "`state`", fields
    assert described == columns.units


def test_every_column_of_the_log_has_a_line(short_file):
    described = {name.strip("`") for name, _ in rows(topics.LOG)}
    assert described == set(telemetry.read(short_file, topics.LOG)[topics.LOG].columns)


def test_every_colour_is_named():
    text = section(topics.CHIEF_POINTS)
    for state, colour in zip(topics.PointState, topics.POINT_COLOURS_RGBA.tolist(), strict=True):
        words = state.name.lower().replace("_", " ")
        assert re.search(rf"{int(state)} {words} \({', '.join(map(str, colour[:3]))}\)", text)


def test_every_key_of_the_metadata_is_named():
    for description in (EpisodeDescription, FisDescription):
        for key in description.__dataclass_fields__:
            assert f"`{key}`" in README, key
