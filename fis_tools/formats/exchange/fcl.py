"""FCL files (`.fcl`), IEC 61131-7 as jFuzzyLogic has it: read and written; fuzzylite's are read, too.

What jFuzzyLogic does, beyond the standard: `and` and `or` bind alike, from left to right; AND sets OR to its
dual and OR sets AND, so the last one counts; ACCU is SUM where a block does not say; a variable without a
RANGE has that of its terms; DEFAULT := NC keeps the last value. The grammar is in `fcl.lark`.
"""

from dataclasses import replace
from typing import Any

from lark import Tree

from fis_tools import model
from fis_tools.errors import ControllerFileError
from fis_tools.formats.exchange.antecedents import NotExpressible
from fis_tools.formats.exchange.dialect import Dialect, Expressed
from fis_tools.formats.exchange.fcl_blocks import (
    ACCUMULATIONS,
    AND,
    DUALS,
    METHODS,
    RESOLUTION,
    parse,
    read_block,
    without_comments,
)
from fis_tools.formats.exchange.foreign import require_short_words
from fis_tools.formats.exchange.writing import term_words, understand, written
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
    system = expressed.system
    if DUALS[system.and_operator] != system.or_operator:
        raise NotExpressible(
            f"rules combine by {system.and_operator} and {system.or_operator}, which are no duals, and "
            "jFuzzyLogic sets one by the other; export as fll or json"
        )
    for word, known in ((system.implication, {"min", "product"}), (system.and_operator, set(AND.values()))):
        if word not in known:
            raise NotExpressible(f"FCL has no word for the operator {word}; export as fll or json")
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
        "method": {way: word for word, way in reversed(METHODS.items())},
        "and_word": {operator: word for word, operator in reversed(AND.items())},
        "accumulation": {operator: word for word, operator in reversed(ACCUMULATIONS.items())},
    }


def _condition(expression: Expression, *, is_outermost: bool = True) -> str:
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
    if len(blocks) != 1:
        raise ControllerFileError(
            f"the file has {len(blocks)} function blocks, and one is read; give each a file of its own"
        )
    system, notes = read_block(blocks[0], semantics)
    reading = understand(system, comments, DIALECT)
    return replace(reading, assumptions=(*reading.assumptions, *notes))
