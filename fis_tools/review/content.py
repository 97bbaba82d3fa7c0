"""What a review page says in words and tables."""

import hashlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import count
from typing import Any

from fis_tools import serialize
from fis_tools.analysis import RuleUsage
from fis_tools.formats.text import (
    number,
    rule_tables,
    sentence,
    shape_words,
    summary,
    with_unit,
)
from fis_tools.model import FuzzyController, FuzzySystem, Variable
from fis_tools.review.colours import level


@dataclass(frozen=True)
class Cell:
    """A cell of a rule matrix: the output's term, how bright it is, and the place of its rule."""

    term: str
    level: int
    rule: int


def fingerprint(controller: FuzzyController) -> str:
    """Return the SHA-256 of a controller's JSON: what a signature under the page refers to.

    The same as of the file that ``python -m fis_tools export CONTROLLER --format json`` writes.
    """
    return hashlib.sha256(serialize.dump_json(controller).encode()).hexdigest()


def system_words(index: int, system: FuzzySystem, usage: RuleUsage) -> dict[str, Any]:
    """Return what the template says of one system.

    Parameters
    ----------
    index : int
        From 1; ids on the page begin with it.
    system : FuzzySystem
    usage : RuleUsage
        How its rules fire over the samples of the review.
    """
    return {
        "id": f"s{index}",
        "name": system.name,
        "summary": summary(system),
        "num_inputs": len(system.inputs),
        "num_rules": len(system.rules),
        "across": system.inputs[-1].name,
        "down": system.inputs[-2].name if len(system.inputs) > 1 else "",
        "output": system.outputs[0].name,
        "inputs": ", ".join(with_unit(variable) for variable in system.inputs),
        "outputs": ", ".join(with_unit(variable) for variable in system.outputs),
        "defuzzifier": system.defuzzifier,
        "num_terms": sum(len(variable.terms) for variable in (*system.inputs, *system.outputs)),
        "variables": list(_variables(index, system)),
        "matrices": _matrices(system),
        "rules": list(_rules(system, usage)),
        "never": int((usage.fired == 0).sum()),
    }


def _variables(index: int, system: FuzzySystem) -> Iterator[dict[str, Any]]:
    for kind, variables in (("input", system.inputs), ("output", system.outputs)):
        for place, variable in enumerate(variables):
            yield {
                "id": f"s{index}-{kind[0]}{place + 1}",
                "kind": kind,
                "place": place,
                "name": variable.name,
                "title": with_unit(variable),
                "extent": _extent(variable),
                "description": variable.description,
                "terms": [(term.name, shape_words(term)) for term in variable.terms],
            }


def _extent(variable: Variable) -> str:
    extent = f"{number(variable.minimum)} to {number(variable.maximum)} {variable.unit}".rstrip()
    default = "" if variable.default is None else f"; {number(variable.default)} when no rule fires"
    return f"{extent}, {variable.num_points} points{default}".replace("-", "−")


def _matrices(system: FuzzySystem) -> list[tuple[str, list[str], list[tuple[str, list[Cell]]]]]:
    """Return a full rule table as title, head and rows of cells, for each combination of outer terms."""
    terms = system.outputs[0].terms
    levels = {term.name: level(place, len(terms)) for place, term in enumerate(terms)}
    rules = count()
    return [
        (
            title,
            head[1:],
            [(row[0], [Cell(term, levels[term], next(rules)) for term in row[1:]]) for row in rows],
        )
        for title, (head, *rows) in rule_tables(system) or ()
    ]


def _rules(system: FuzzySystem, usage: RuleUsage) -> Iterator[dict[str, Any]]:
    for place, rule in enumerate(system.rules):
        yield {
            "words": sentence(rule),
            "label": rule.label,
            "fired": float(usage.fired[place]),
            "leading": float(usage.leading[place]),
            "strongest": float(usage.max_strength[place]),
        }


def facts(pairs: Mapping[str, str] | tuple[tuple[str, str], ...]) -> list[tuple[str, str]]:
    """Return facts with their keys in words."""
    items = pairs.items() if isinstance(pairs, Mapping) else pairs
    return [(key.replace("_", " "), value) for key, value in items]
