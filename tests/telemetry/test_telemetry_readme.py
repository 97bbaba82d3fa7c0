"""The README names every topic, and it or the schema every field, with its unit and axes."""

import re
from pathlib import Path

import pytest

import telemetry
from docs.hooks import messages
from telemetry.file import topics
from telemetry.file.metadata import EpisodeDescription, FisDescription
from telemetry.file.schema import inspection_pb2

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


@pytest.mark.parametrize("message", inspection_pb2.DESCRIPTOR.message_types_by_name)
def test_every_field_of_our_messages_has_its_own_words_and_a_vector_its_axes(message):
    _, _, table = messages().partition(f" · `inspection.{message}`\n")
    told = dict(re.findall(r"^\| `(\w+)` \| [\w ]+ \| (.*) \|$", table.partition("###")[0], re.MULTILINE))
    fields = inspection_pb2.DESCRIPTOR.message_types_by_name[message].fields
    assert list(told) == [field.name for field in fields]
    assert all(told.values())
    for name, length in topics.LENGTHS.items():
        if name in told and length == 3 and "reason" not in name:
            assert re.search(r"(Hill|body|own) axes", told[name]), name
    assert "Hill to body" in told.get("quaternion", "Hill to body")


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
