"""Text from files is cleaned where it enters: no escape sequences, no turned writing, no halves of pairs."""

import json

import pytest

import telemetry
from fis_tools.formats import serialize
from fis_tools.plain_text import MISSING_SIGN, plain
from pipeline.run import configuration
from telemetry.file import metadata
from tests.fis_tools.sample_controllers import paper_like_controller

HARMFUL = ("\x1b[31mred\x1b[0m", "\x9b31m", "a\u202eb", "\u2066x", "\ud800", "\x00", "\x07", "\u2028")
HARMLESS = ("°C", "m/s²", "Größe", "速度", "two\nlines", "a\u00a0b", "e\u0301", "👩\u200d🚀")


@pytest.mark.parametrize("text", HARMFUL)
def test_harmful_letters_are_replaced(text):
    for clean in (plain(text), metadata.plain(text)):
        assert MISSING_SIGN in clean
        assert not set(clean) & set("\x1b\x9b\u202e\u2066\ud800\x00\x07\u2028")
        clean.encode()


@pytest.mark.parametrize("text", HARMLESS)
def test_other_letters_stay(text):
    assert plain(text) == metadata.plain(text) == text


@pytest.mark.parametrize("text", HARMFUL)
def test_units_descriptions_and_facts_of_a_controller(text):
    told = json.loads(serialize.dump_json(paper_like_controller()))
    variable = told["systems"][0]["inputs"][0]
    variable |= {"unit": text, "description": text}
    told |= {"attributes": {"maker": text}, "provenance": {text: "x"}}
    read = serialize.loads(json.dumps(told), "json")
    first = read.systems[0].inputs[0]
    clean = plain(text)
    assert (first.unit, first.description) == (clean, clean)
    assert (read.attributes, read.provenance) == ((("maker", clean),), ((clean, "x"),))
    serialize.dump_yaml(read).encode()


def test_what_a_recording_and_a_configuration_say(tmp_path):
    path = tmp_path / "said.mcap"
    words = {"input_names": json.dumps(["\u202ea"]), "input_units": "[]", "output_name": "\x1b[2J"}
    metadata = {"fis.x": {**words, "output_unit": "", "rules": "[]"}}
    with telemetry.EpisodeWriter(path, metadata=metadata, attachments={}):
        pass
    told = telemetry.read(path).metadata["fis.x"]
    assert told["output_name"] == f"{MISSING_SIGN}[2J"
    assert configuration.parse(b'{name: "\\e[31m", list: ["\\u202e"]}') == {
        "name": f"{MISSING_SIGN}[31m",
        "list": [MISSING_SIGN],
    }
