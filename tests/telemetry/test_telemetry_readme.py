"""The README names every topic and every field, with its unit."""

import re
from pathlib import Path

import pytest

import telemetry
from telemetry.file import topics
from telemetry.file.metadata import EpisodeDescription, FisDescription
from telemetry.file.schema import inspection_pb2

README = (Path(telemetry.__file__).parent / "README.md").read_text(encoding="utf-8")

MESSAGE_OF_TOPIC = {
    topics.DEPUTY_STATE: "DeputyState",
    topics.DEPUTY_ATTITUDE: "AttitudeHistory",
    topics.DEPUTY_CONTROL: "Control",
    topics.GUIDANCE: "Guidance",
    topics.NAVIGATION: "Navigation",
    "/fis/<name>": "FisActivation",
    topics.MISSION: "MissionStatus",
}


def section(topic: str) -> str:
    """The part of the README under a topic's heading."""
    match = re.search(rf"^### `{re.escape(topic)}` · `[\w.]+`$(.*?)(?=^##)", README, re.DOTALL | re.MULTILINE)
    assert match is not None, topic
    return match.group(0)


@pytest.mark.parametrize("topic", [*topics.FIXED_TOPICS, "/fis/<name>"])
def test_every_topic_has_a_section(topic):
    assert "| field |" in section(topic)


def test_every_message_of_ours_has_a_topic():
    assert set(MESSAGE_OF_TOPIC.values()) == set(inspection_pb2.DESCRIPTOR.message_types_by_name)


@pytest.mark.parametrize("topic", MESSAGE_OF_TOPIC)
def test_every_field_has_a_line_with_its_unit(topic):
    text = section(topic)
    message = MESSAGE_OF_TOPIC[topic]
    assert f"`inspection.{message}`" in text
    for field in inspection_pb2.DESCRIPTOR.message_types_by_name[message].fields:
        line = re.search(rf"^\| `{field.name}` \| ([^|]*)\|", text, re.MULTILINE)
        assert line is not None, field.name
        expected = "metadata" if field.name == "inputs" else topics.unit_of(field.name)
        assert line.group(1).strip() == expected, field.name


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


def test_every_vector_names_its_axes():
    num_vectors = 0
    for topic in [*topics.FIXED_TOPICS, "/fis/<name>"]:
        for cells in rows(topic):
            if re.search(
                r"(3 doubles|3 floats|`translation`|`pose.position`|`x`, `y`, `z`)", " ".join(cells)
            ):
                assert re.search(r"(Hill|body|chief|parent) axes", cells[-1]), cells
                num_vectors += 1
            if "quaternion" in " ".join(cells):
                assert re.search(r"(Hill to body|turns (body|child) axes into)", cells[-1]), cells
    assert num_vectors == 3 + 3 + 2 + 4 + 1


def test_every_colour_is_named():
    text = section(topics.CHIEF_POINTS)
    for state, colour in zip(topics.PointState, topics.POINT_COLOURS_RGBA.tolist(), strict=True):
        words = state.name.lower().replace("_", " ")
        assert re.search(rf"{int(state)} {words} \({', '.join(map(str, colour[:3]))}\)", text)


def test_every_key_of_the_metadata_is_named():
    for description in (EpisodeDescription, FisDescription):
        for key in description.__dataclass_fields__:
            assert f"`{key}`" in README, key
