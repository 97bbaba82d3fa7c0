"""Texts that someone made to take minutes or gigabytes: refused in a sentence, after a look."""

import json
import tracemalloc

import pytest

from fis_tools.errors import ControllerFileError
from fis_tools.formats import serialize
from fis_tools.formats.exchange import foreign
from fis_tools.formats.notation import Unreadable, read_json
from fis_tools.model import validate


def variable(name, **changes):
    terms = [{"name": "low", "mean": 0.0, "standard_deviation": 0.3}]
    return {"name": name, "unit": "", "range": [0.0, 1.0], "terms": terms, **changes}


def controller(inputs, rules, **output):
    system = {
        "name": "s",
        "inputs": inputs,
        "outputs": [variable("y", default=0.0, **output)],
        "rules": rules,
    }
    mapping = {"schema": "fuzzy-controller", "schema_version": 1, "name": "c", "systems": [system]}
    return json.dumps(mapping)


def terms(number):
    return [{"name": f"t{i}", "mean": i / number, "standard_deviation": 0.1} for i in range(number)]


def test_a_number_of_a_million_digits_with_a_letter_behind_it_takes_no_time():
    """Backtracking would take as many steps as the square of its digits, which is a day."""
    with pytest.raises(ControllerFileError, match="is not a finite number"):
        foreign.number("1" * 1_000_000 + "x", "here")


def test_the_last_of_many_keys_repeated_takes_no_time():
    text = "{" + ", ".join(f'"k{i}": 0' for i in range(200_000)) + ', "k199999": 0}'
    with pytest.raises(Unreadable, match="the key 'k199999' appears twice"):
        read_json(text)


def test_of_very_many_problems_the_first_are_told():
    rule = {"if": {"is": ["x", "high"]}, "then": [{"variable": "y", "term": "lo"}]}
    with pytest.raises(ControllerFileError, match=f"and {validate.MOST_PROBLEMS - 8} more"):
        serialize.loads(controller([variable("x")], [rule] * 40_000), "json")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (controller([variable(f"x{i}") for i in range(24)], ["low"]), "has 24 inputs; at most 12 are read"),
        (
            controller([variable("x", terms=terms(3000))], ["low"] * 3000),
            "3000 terms of one variable; at most",
        ),
        (
            controller([variable("x", terms=terms(1000), points=10_001)], ["low"] * 1000),
            "memberships, terms times points; at most",
        ),
        (controller([variable("x", range=[0, 10**400])], ["low"]), "too large a number"),
        (controller([variable("x")], ["low"], points=10**400), "is more than 4000000"),
    ],
    ids=["inputs", "terms", "memberships", "digits", "points"],
)
def test_systems_that_no_analysis_ends_for(text, message):
    tracemalloc.start()
    with pytest.raises(ControllerFileError, match=message):
        serialize.loads(text, "json")
    assert tracemalloc.get_traced_memory()[1] < 100e6
    tracemalloc.stop()


def test_yaml_that_takes_minutes_is_too_long():
    with pytest.raises(ControllerFileError, match="longer than"):
        serialize.loads("x: [" + "[]," * 700_000 + "1]", "yaml")
