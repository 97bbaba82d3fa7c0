"""FCL files (`.fcl`), IEC 61131-7 as jFuzzyLogic has it: read and written; fuzzylite's are read, too.

What jFuzzyLogic does, beyond the standard: `and` and `or` bind alike, from left to right; AND sets OR to its
dual and OR sets AND, so the last one counts; ACCU is SUM where a block does not say; a variable without a
RANGE has that of its terms; DEFAULT := NC keeps the last value. Each function block becomes a system of one
controller. The grammar is in `fcl.lark`.
"""

from dataclasses import replace
from itertools import chain
from typing import Any

from lark import Tree

from fis_tools import model
from fis_tools.formats.exchange.antecedents import NotExpressible
from fis_tools.formats.exchange.dialect import Dialect, Expressed
from fis_tools.formats.exchange.fcl_blocks import RESOLUTION, read_block
from fis_tools.formats.exchange.fcl_syntax import parse, without_comments
from fis_tools.formats.exchange.fcl_words import ACCUMULATIONS, AND, DUALS, METHODS
from fis_tools.formats.exchange.foreign import require_short_words
from fis_tools.formats.exchange.writing import term_words, understand, written
from fis_tools.formats.mapping import refuse_problems
from fis_tools.formats.serialize import Reading, Written
from fis_tools.model import Expression, Semantics

DIALECT = Dialect(
    title="an .fcl file",
    semantics="fcl",
    words="fcl",
    is_nested=True,
    output_points=RESOLUTION + 1,
    has_rule_operators=False,
)

# Writing.


def write(controller: model.FuzzyController) -> Written:
    """Write a controller with one system; see `fis_tools.formats.exchange.writing.written`."""
    return written(controller, DIALECT, "fcl.jinja", _facts)


def _facts(expressed: Expressed) -> dict[str, Any]:
    """Return what the template of FCL needs; raise NotExpressible for what FCL has no words for."""
    system = expressed.system
    if DUALS.get(system.and_operator) != system.or_operator:
        raise NotExpressible(
            f"rules combine by {system.and_operator} and {system.or_operator}, which are no duals, and "
            "jFuzzyLogic sets one by the other; export as fll or json"
        )
    if system.implication not in {"min", "product"}:
        raise NotExpressible(f"FCL has no word for the operator {system.implication}; export as fll or json")
    joins = {o.accumulation if system.weighs(o) else o.aggregation for o in system.outputs}
    if len(joins) > 1 or not joins <= set(ACCUMULATIONS.values()):
        raise NotExpressible(
            f"conclusions are joined by {', '.join(sorted(joins))}, and FCL has one word for all outputs, of "
            f"{', '.join(sorted(set(ACCUMULATIONS.values())))}; export as fll or json"
        )
    for output in system.weighed:
        if any(not isinstance(term.membership, model.Number) for term in output.terms):
            raise NotExpressible(
                f"output {output.name!r} concludes where terms have the strength of a rule (Tsukamoto), "
                "which FCL does not know; export as fll or json"
            )
        if any(isinstance(term.membership, model.Linear) for term in output.terms):
            raise NotExpressible(
                f"output {output.name!r} concludes numbers linear in the inputs, which FCL takes by names; "
                "export as fll or json"
            )
        if system.defuzzifier_of(output) == "weighted_sum":
            raise NotExpressible(f"output {output.name!r} is a weighted sum, which FCL does not know")
    return {
        "words": term_words,
        "condition": _condition,
        "method": {method: word for word, method in reversed(METHODS.items())},
        "and_word": {operator: word for word, operator in reversed(AND.items())},
        "accumulation": next(word for word, join in ACCUMULATIONS.items() if {join} == joins),
    }


def _condition(expression: Expression, *, is_outermost: bool = True) -> str:
    """Return an antecedent in the words of FCL."""
    match expression:
        case model.Is(variable, term):
            return f"{variable} IS {term}"
        case model.Not(model.Is(variable, term)):
            return f"{variable} IS NOT {term}"
        case model.Not(operand):
            return f"NOT ({_condition(operand)})"
        case model.And(operands) | model.Or(operands):
            word = f" {expression.word.upper()} "
            joined = word.join(_condition(operand, is_outermost=False) for operand in operands)
            return joined if is_outermost else f"({joined})"
    raise NotExpressible("FCL has no words for hedges; export as fll or json")


# Reading.


def read(text: str) -> Reading:
    """Read an `.fcl` file.

    Raises
    ------
    fis_tools.errors.ControllerFileError
        If it is damaged or says what a fuzzy system of ours cannot; with the line.
    """
    require_short_words(text)
    text, comments = without_comments(text.lstrip("\ufeff"))
    semantics: Semantics = "fcl"
    if any("generated with fuzzylite" in words for _, words in comments):
        semantics = "fuzzylite"
    tree = parse(text)
    blocks = [part for part in tree.children if isinstance(part, Tree)]
    readings = []
    for block in blocks:
        system, notes = read_block(block, semantics)
        reading = understand(system, comments if len(blocks) == 1 else (), DIALECT)
        readings.append(replace(reading, assumptions=(*reading.assumptions, *notes)))
    if len(readings) == 1:
        return readings[0]
    systems = tuple(reading.controller.systems[0] for reading in readings)
    controller = model.FuzzyController(systems[0].name, systems)
    refuse_problems(controller)
    assumptions, about_points = (
        tuple(chain(*(getattr(reading, field) for reading in readings)))
        for field in ("assumptions", "about_points")
    )
    return Reading(controller, assumptions, about_points)
