"""Controllers survive their files to the last bit, and bad files are refused with a sentence."""

import json
import math
import operator
from collections.abc import Callable
from dataclasses import replace
from functools import reduce
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from fis_tools.formats import notation, serialize
from fis_tools.formats.exchange import fis, fll
from fis_tools.formats.serialize import (
    ENDINGS,
    ControllerFileError,
    dump_json,
    dump_yaml,
    from_mapping,
    load,
    loads,
)
from fis_tools.model import And, Consequent, FuzzyController, Is, Rule, Term, Variable, rule_tables, shapes
from fis_tools.model.validate import InvalidSystem
from plain_files.plain_text import plain
from tests.fis_tools.engines.random_systems import random_general_system
from tests.fis_tools.sample_controllers import FORCE_X, GENERAL, PAPER_LIKE

NAMES = st.text(st.characters(exclude_categories=["C", "Z"]), min_size=1, max_size=8)
WORDS = st.sampled_from(
    ["no", "NULL", "1e3", "0x1F", "1_0", "~", "a: b", "# x", "-", "é η", "true", "2026-01-01"]
)


def kept_texts(max_size: int) -> st.SearchStrategy[str]:
    """Free text as it is after entering, where characters that are unfit are replaced."""
    return st.text(max_size=max_size).map(plain)


@st.composite
def controllers(draw: st.DrawFn) -> FuzzyController:
    """Random systems of all kinds, with words that are easily taken for something else."""
    kinds = [f"{kind}{index}" for kind in "xyt" for index in range(5)]
    words = draw(st.lists(NAMES | WORDS, min_size=15, max_size=15, unique=True))
    generator = np.random.default_rng(draw(st.integers(0, 2**32)))
    system = random_general_system(generator, dict(zip(kinds, words, strict=True)).__getitem__)
    fields = {"unit": draw(kept_texts(3)), "description": draw(kept_texts(12))}
    system = replace(system, inputs=tuple(replace(variable, **fields) for variable in system.inputs))
    if draw(st.booleans()):
        output, inputs = system.outputs[0], system.inputs[:2]
        cells = math.prod(len(variable.terms) for variable in inputs)
        table = generator.choice([term.name for term in output.terms], cells).tolist()
        rules = rule_tables.table_rules(inputs, output, table)
        system = replace(system, inputs=inputs, outputs=(output,), rules=rules)
    elif draw(st.booleans()):
        labelled = (replace(r, label=word) for r, word in zip(system.rules, reversed(words), strict=False))
        system = replace(system, rules=tuple(labelled))
    facts = st.dictionaries(kept_texts(6) | WORDS, kept_texts(12) | WORDS, max_size=2)
    attributes, provenance = (tuple(sorted(draw(facts).items())) for _ in range(2))
    return FuzzyController(draw(NAMES), (system, replace(system, name=draw(NAMES))), attributes, provenance)


@pytest.mark.slow
@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(controllers())
def test_every_controller_survives_both_forms(controller):
    assert from_mapping(serialize.to_mapping(controller)) == controller
    assert loads(dump_json(controller), "json") == controller
    assert loads(dump_yaml(controller), "yaml") == controller


@pytest.mark.parametrize("controller", [PAPER_LIKE, GENERAL])
def test_readers_we_did_not_write_understand_the_files_too(controller):
    """The same under YAML 1.1, as other YAML libraries and Hydra read it."""
    assert yaml.safe_load(dump_yaml(controller)) == serialize.to_mapping(controller)
    assert json.loads(dump_json(controller)) == serialize.to_mapping(controller)


@pytest.mark.parametrize("number", [1 / 3, math.pi * 1e-12, 5e-324, 1.7976931348623157e308, -0.0, 1e22])
def test_numbers_survive_to_the_last_bit(number):
    controller = from_mapping(_edited(_edit(*SYSTEM, "outputs", 0, "default", to=number)))
    for text, kind in ((dump_json(controller), "json"), (dump_yaml(controller), "yaml")):
        default = loads(text, kind).systems[0].outputs[0].default
        assert default is not None
        assert default.hex() == number.hex()


def test_a_rule_table_is_written_in_rows_and_read_back_with_the_last_input_fastest():
    text = dump_yaml(PAPER_LIKE)
    assert "      PL, PS, PS, ZE, NS,  # distance far\n" in text
    assert '        "PL", "PS", "PS", "ZE", "NS",\n' in dump_json(PAPER_LIKE)
    rule = loads(text, "yaml").systems[0].rules[3 * 5 + 4]
    assert rule.antecedent == And((Is("distance", "far"), Is("velocity_body_x", "towards fast")))
    assert rule.consequents == (Consequent("force_x", "NS"),)


HAND_WRITTEN = (Path(__file__).parent / "hand_written.yaml").read_text(encoding="utf-8")


def test_a_file_written_by_hand_means_what_it_says():
    controller = loads(HAND_WRITTEN, "yaml")
    assert controller.attributes == (("force_axes", "hill"), ("generation", "12"), ("is_trained", "false"))
    (system,) = controller.systems
    assert system.inputs == (Variable("x", "m", 0.0, 10.0, (Term("no", shapes.Gaussian(0.0, 2.0)),), 101),)
    assert system.outputs[0].terms == (Term("off", shapes.Triangular(-1.0, 0.0, 1.0)),)
    assert system.rules == (Rule(Is("x", "no"), (Consequent("y", "off"),)),)
    assert isinstance(system.inputs[0].minimum, float)


def test_attributes_are_numbers_in_yaml_and_texts_elsewhere():
    texts = {"axes": "hill", "count": "4", "margin": "1.6", "period": "30.0", "small": "1e-05"}
    kept = {"hex": "0x10", "huge": "9" * 400, "many": "9" * 40, "nothing": "", "padded": "007", "short": ".5"}
    kept |= {"signed": "+1", "wide": "nan"}
    controller = replace(loads(HAND_WRITTEN, "yaml"), attributes=tuple(sorted((texts | kept).items())))
    written = dump_yaml(controller)
    assert "  margin: 1.6\n" in written
    assert "  period: 30.0\n" in written
    assert '  padded: "007"\n' in written
    assert loads(written, "yaml") == controller
    assert '"margin": "1.6"' in dump_json(controller)
    assert loads(dump_json(controller), "json") == controller


def test_a_table_with_a_rule_of_its_own_ways_is_no_table():
    first, *rest = FORCE_X.rules
    system = replace(FORCE_X, rules=(replace(first, and_operator="min"), *rest))
    controller = FuzzyController("c", (system,))
    assert loads(dump_json(controller), "json") == controller


def _edited(change: Callable[[dict[str, Any]], object]) -> dict[str, Any]:
    mapping = serialize.to_mapping(PAPER_LIKE)
    change(mapping)
    return mapping


def _within(mapping: Any, path: tuple[Any, ...]) -> Any:
    return reduce(operator.getitem, path, mapping)


def _edit(*path: Any, to: Any) -> Callable[[dict[str, Any]], None]:
    return lambda mapping: operator.setitem(_within(mapping, path[:-1]), path[-1], to)


def _drop(*path: Any) -> Callable[[dict[str, Any]], None]:
    return lambda mapping: operator.delitem(_within(mapping, path[:-1]), path[-1])


SYSTEM = ("systems", 0)
INPUT = (*SYSTEM, "inputs", 0)
TERM = (*INPUT, "terms", 0)
RULES = (*SYSTEM, "rules")
PREMISE = {"is": ["a", "b"]}


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (_drop("schema"), ["not a fuzzy controller", "schema: fuzzy-controller"]),
        (_edit("schema", to="mission"), ["schema is 'mission'", "'fuzzy-controller'"]),
        (_edit("schema_version", to=2), ["schema version is 2", "reads version 1", "write it again"]),
        (_edit("schema_version", to=True), ["schema version is True"]),
        (_drop("schema_version"), ["schema version is empty"]),
        (_edit("sistems", to=[]), ["unknown key 'sistems'", "did you mean 'systems'?"]),
        (_drop("name"), ["key 'name' is missing"]),
        (_edit("name", to=3), ["name is 3", "expected a word"]),
        (_edit("systems", to="all"), ["systems is 'all'", "expected a list"]),
        (_edit("systems", to={}), ["systems is a mapping", "expected a list"]),
        (_edit("systems", to=[]), ["no systems"]),
        (_edit("attributes", to=[1]), ["attributes is a list"]),
        (_edit("attributes", "a", to=None), ["attributes: a is empty"]),
        (
            _edit(*TERM, "standart_deviation", to=1.0),
            ["'standart_deviation'", "did you mean 'standard_deviation'?"],
        ),
        (_drop(*TERM, "mean"), ["systems[0].inputs[0].terms[0]", "'mean' is missing"]),
        (_edit(*TERM, "mean", to="low"), ["mean is 'low'", "expected a number"]),
        (_edit(*TERM, "mean", to=True), ["mean is True", "expected a number"]),
        (_edit(*TERM, "mean", to=10**400), ["mean is too large"]),
        (_edit(*TERM, "shape", to="gausian"), ["unknown shape 'gausian'", "did you mean 'gaussian'?"]),
        (_edit(*TERM, "shape", to="triangular"), ["unknown key 'mean'"]),
        (_edit(*TERM, "standard_deviation", to=0), ["'very near'", "not positive"]),
        (_edit(*TERM, to="near"), ["terms[0] is 'near'", "expected a mapping"]),
        (_edit(*INPUT, "range", to=[0, 1, 2]), ["3 numbers", "[lowest, highest]"]),
        (_edit(*INPUT, "points", to=101.0), ["points is 101.0", "whole number"]),
        (_edit(*INPUT, "points", to=10**9), ["points is more than 4000000"]),
        (_edit(*INPUT, "universe", to=[0, 1]), ["unknown key 'range'"]),
        (_edit(*INPUT, "default", to=1), ["unknown key 'default'"]),
        (_edit(*RULES, to=["NL"] * 24), ["25 rules", "24 consequents"]),
        (_edit(*RULES, 7, to="XL"), ["rule 8", "no term 'XL'"]),
        (_edit(*RULES, 7, to=7), ["rules[0] is 'PL'"]),
        (_edit(*RULES, to=None), ["rules is empty"]),
        (_edit(*RULES, to=[{"if": {}, "then": []}]), ["expected one of is, not, and, or"]),
        (_edit(*RULES, to=[{"if": {"xor": []}, "then": []}]), ["unknown word 'xor'"]),
        (_edit(*RULES, to=[{"if": {"is": ["distance"]}, "then": []}]), ["1 words", "[variable, term]"]),
        (_edit(*RULES, to=[{"if": PREMISE}]), ["'then' is missing"]),
        (_edit(*SYSTEM, "defuzzifier", to=None), ["defuzzifier is empty", "expected a word"]),
        (_edit(*SYSTEM, "outputs", 0, "accumulation", to=1), ["accumulation is 1", "expected a word"]),
        (_edit(*INPUT, "accumulation", to="max"), ["unknown key 'accumulation'"]),
        (_edit(*TERM, "shape", to="pi_shape"), ["unknown key 'mean'", "left_top"]),
        (_edit(*TERM, to={"name": "near", "shape": "s_shape", "foot": 1.0}), ["'top' is missing"]),
        (_edit(*RULES, to=[{"if": PREMISE, "then": [], "and_operator": 2}]), ["rules[0].and_operator is 2"]),
    ],
)
def test_wrong_content_is_refused_with_a_sentence(change, words):
    with pytest.raises(ControllerFileError) as refusal:
        from_mapping(_edited(change))
    for word in words:
        assert word in str(refusal.value)


@pytest.mark.parametrize("nonsense", [None, [], "text", 3, {}])
def test_what_is_no_mapping_is_no_controller(nonsense):
    with pytest.raises(ControllerFileError, match="not a fuzzy controller"):
        from_mapping(nonsense)


@pytest.mark.slow
def test_a_table_of_billions_of_cells_is_counted_not_built():
    mapping = serialize.to_mapping(PAPER_LIKE)
    system = mapping["systems"][1]
    for variable in system["inputs"]:
        variable["terms"] = [{"name": f"t{k}", "mean": 0.0, "standard_deviation": 1.0} for k in range(2000)]
    with pytest.raises(ControllerFileError, match="has 8000000000 rules, but 45"):
        from_mapping(mapping)
    system["rules"] = [{"if": {"is": ["eta_u", "t0"]}, "then": [{"variable": "force_z", "term": "ZE"}]}]
    controller = from_mapping(mapping)
    assert rule_tables.rule_table(controller.systems[1]) is None
    assert loads(dump_json(controller), "json") == controller


def test_what_cannot_be_read_again_is_not_written():
    broken = FuzzyController("broken", (replace(FORCE_X, rules=()),))
    with pytest.raises(InvalidSystem, match="no rules"):
        dump_json(broken)


BOMB = "a: &a [x, x]\nb: &b [*a, *a]\nc: &c [*b, *b]\n"


@pytest.mark.parametrize(
    ("kind", "text", "words"),
    [
        ("json", "", "end"),
        ("json", '{"a": 1', "cut short"),
        ("json", '{"a": "b', "line 1"),
        ("json", '{"a": 1}}', "line 1, column 9"),
        ("json", '{"a": 1, "a": 2}', "'a' appears twice"),
        ("json", '{"a": NaN}', "contains NaN"),
        ("json", '{"a": -Infinity}', "contains -Infinity"),
        ("json", '{"a": 1e999}', "not a fuzzy controller"),
        ("json", "[" * 200_000, "deep"),
        ("json", '{"a": ' + "1" * 5000 + "}", "too long"),
        ("json", "\x00", "JSON"),
        ("yaml", "", "not a fuzzy controller"),
        ("yaml", BOMB, "line 1 uses an anchor or alias"),
        ("yaml", "a: *b\n", "anchor or alias"),
        ("yaml", "<<: {a: 1}\n", "not a fuzzy controller"),
        ("yaml", "!!python/object/apply:os.system ['false']\n", "has the tag"),
        ("yaml", "a: !!python/name:os.system\n", "has the tag"),
        ("yaml", "a: !thing x\n", "has the tag '!thing'"),
        ("yaml", "a: 1\na: 2\n", "line 2 repeats the key 'a'"),
        ("yaml", "? [a]\n: 1\n", "list or mapping as a key"),
        ("yaml", "[" * 10_000, "deep"),
        ("yaml", "- " * 5_000, "deep"),
        ("yaml", "a: [1, 2\n", "not YAML"),
        ("yaml", "a: 'b\n", "not YAML"),
        ("yaml", "a: b: c\n", "line 1, column 5"),
        ("yaml", "a: \x00\n", "not YAML"),
        ("yaml", "a: \ud800\n", "not YAML"),
        ("yaml", "a: 1\n---\nb: 2\n", "not YAML"),
        ("yaml", "a: " + "1" * 5000, "too long"),
        ("yaml", "a: .nan\n", "not a fuzzy controller"),
        ("yaml", "#" * 3_000_000, "longer than"),
        ("yaml", "---\na: 1\n", "does not close with '...'"),
        *(
            ("yaml", HAND_WRITTEN.replace("default: 0", f"default: {number}"), "finite")
            for number in (".nan", ".inf", "-.Inf", "1e999")
        ),
    ],
)
def test_bad_files_are_refused_with_a_sentence(kind, text, words):
    with pytest.raises(ControllerFileError) as refusal:
        loads(text, kind)
    assert words in str(refusal.value)


def test_without_libyaml_the_same_is_read(monkeypatch):
    monkeypatch.setattr(yaml, "__with_libyaml__", False)
    spec = spec_from_file_location("without_libyaml", notation.__file__)
    assert spec is not None
    assert spec.loader is not None
    slow = module_from_spec(spec)
    spec.loader.exec_module(slow)
    assert not issubclass(slow._Loader, yaml.CSafeLoader)
    assert issubclass(notation._Loader, yaml.CSafeLoader)
    for text in (HAND_WRITTEN, dump_yaml(GENERAL)):
        assert slow.read_yaml(text) == notation.read_yaml(text)
    with pytest.raises(ControllerFileError, match="line 1 uses an anchor"):
        slow.read_yaml(BOMB)


def test_a_file_cut_anywhere_is_refused_with_a_sentence():
    for text, kind, step in ((dump_json(PAPER_LIKE), "json", 7), (dump_yaml(PAPER_LIKE), "yaml", 97)):
        whole = len(text.rstrip())
        for length in [*range(0, whole, step), whole - 4, whole - 3, whole - 2, whole - 1]:
            with pytest.raises(ControllerFileError):
                loads(text[:length], kind)
        assert loads(text[:whole], kind) == PAPER_LIKE


@pytest.mark.parametrize("name", ["c.json", "c.yaml", "c.yml", "c.YAML", "c.fis", "c.FLL"])
def test_files_are_read_by_their_ending(tmp_path, name):
    controller = FuzzyController("c", (FORCE_X,))
    write = {
        ".json": dump_json,
        ".fis": lambda controller: fis.write(controller).text,
        ".fll": lambda controller: fll.write(controller).text,
    }
    path = tmp_path / name
    path.write_text(write.get(path.suffix.lower(), dump_yaml)(controller), encoding="utf-8")
    assert load(path) == controller


def test_files_that_cannot_be_read_are_named(tmp_path):
    for name, content, words in (
        ("c.txt", b"", f"ends in {', '.join(ENDINGS[:-1])} or {ENDINGS[-1]}"),
        ("latin.json", b'{"a": "\xe9"}', "not UTF-8"),
        ("large.yaml", b" " * (10 * 1024 * 1024 + 1), "larger than"),
        ("cut.json", b'{"schema": "fuzzy-', "line 1"),
    ):
        path = tmp_path / name
        path.write_bytes(content)
        with pytest.raises(ControllerFileError, match=words) as refusal:
            load(path)
        assert name in str(refusal.value)
    with pytest.raises(ControllerFileError, match="no such file"):
        load(tmp_path / "missing.json")
    (tmp_path / "folder.json").mkdir()
    with pytest.raises(ControllerFileError, match="a folder"):
        load(tmp_path / "folder.json")
