"""What a review page says of a controller and its systems, in words and tables."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import count
from typing import Any

import numpy as np

from fis_tools.analysis import arrays, contribution, shapley
from fis_tools.analysis.measures import Measures
from fis_tools.array_types import Floats
from fis_tools.engines.compiler import compile
from fis_tools.model import FuzzyController, FuzzySystem, Variable
from fis_tools.review.colours import level
from fis_tools.review.flown import Samples
from fis_tools.review.ranges import range_rows
from fis_tools.words.text import number, rule_tables, sentence, shape_words, summary, with_unit


@dataclass(frozen=True)
class Cell:
    """A cell of a rule matrix: the output's term, how bright it is, and the place of its rule."""

    term: str
    level: int
    rule: int


def texts(controller: FuzzyController) -> list[tuple[str, str]]:
    """Return the attributes of a controller that are no numbers."""

    def is_number(text: str) -> bool:
        try:
            float(text)
        except ValueError:
            return False
        return True

    return [(name, text) for name, text in controller.attributes if not is_number(text)]


def facts(pairs: Sequence[tuple[str, str]]) -> list[tuple[str, str]]:
    """Return facts with their keys in words."""
    return [(key.replace("_", " "), value) for key, value in pairs]


def system_words(place: int, system: FuzzySystem, samples: Samples, measures: Measures) -> dict[str, Any]:
    """Return what the template says of one system.

    Parameters
    ----------
    place : int
        Among the controller's systems, from 1.
    system : FuzzySystem
    samples : Samples
        What its rules are counted over.
    measures : Measures
        What was measured of it.
    """
    usage = arrays.rule_usage(arrays.firing(system, samples.inputs))
    compiled = compile(system)
    importance = shapley.importance(compiled, samples.inputs).max(axis=1)
    needed = contribution.importance(compiled, samples.inputs).max(axis=1)
    system_id = f"s{place}"
    ranges, unbounded = range_rows(system)
    return {
        "id": system_id,
        "place": place,
        "name": system.name,
        "summary": summary(system),
        "num_inputs": len(system.inputs),
        "across": system.inputs[-1].name,
        "down": system.inputs[-2].name if len(system.inputs) > 1 else "",
        "output": system.outputs[0].name,
        "inputs": ", ".join(with_unit(variable) for variable in system.inputs),
        "outputs": ", ".join(with_unit(variable) for variable in system.outputs),
        "samples": samples.words,
        "leaders": _leaders(system, importance),
        "never": int((usage.fired == 0).sum()),
        "completeness": measures.completeness.least,
        "gm3m": measures.gm3m,
        "consistency": measures.rule_consistency.index,
        "variables": list(_variables(system_id, system)),
        "matrices": _matrices(system),
        "ranges": ranges,
        "unbounded": unbounded,
        "rules": list(_rules(system, usage, importance, needed, measures.rule_consistency.values)),
    }


def _leaders(system: FuzzySystem, importance: Floats, most: int = 3) -> str:
    """Say which rules matter most: ``rule 14 (4.1 %), rule 13 (2.0 %)``; empty where none does."""
    order = np.argsort(-importance, kind="stable")[:most]
    return ", ".join(
        f"rule {rule + 1} ({100 * importance[rule]:.2g} %)" for rule in order if importance[rule]
    )


def _variables(system_id: str, system: FuzzySystem) -> Iterator[dict[str, Any]]:
    for kind, variables in (("input", system.inputs), ("output", system.outputs)):
        for place, variable in enumerate(variables):
            yield {
                "id": f"{system_id}-{kind[0]}{place + 1}",
                "kind": kind,
                "place": place,
                "name": variable.name,
                "title": with_unit(variable),
                "extent": _extent(variable),
                "description": variable.description.rstrip("."),
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


def _rules(
    system: FuzzySystem, usage: arrays.RuleUsage, importance: Floats, needed: Floats, consistency: Floats
) -> Iterator[dict[str, Any]]:
    """Yield what is told of each rule, the one with the greatest share first."""
    for place in np.argsort(-importance, kind="stable").tolist():
        rule = system.rules[place]
        yield {
            "place": place,
            "words": sentence(rule),
            "label": rule.label,
            "importance": float(importance[place]),
            "needed": float(needed[place]),
            "fired": float(usage.fired[place]),
            "leading": float(usage.leading[place]),
            "strongest": float(usage.max_strength[place]),
            "consistency": float(consistency[place]),
        }
