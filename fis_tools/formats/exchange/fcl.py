"""Fuzzy Control Language (IEC 61131-7) written, for programmable controllers and fuzzylite.

The language knows straight lines between points and nothing else. Triangles and trapezoids are written by
their corners; any other shape by its points on the universe, between which this program takes straight lines
too, so nothing is lost by it.
"""

from collections.abc import Iterator
from itertools import groupby, pairwise

from fis_tools.formats.exchange.dialect import Dialect, only_system, say
from fis_tools.formats.exchange.files import Written
from fis_tools.formats.exchange.foreign import concluded_words, rule_words
from fis_tools.formats.exchange.losses import losses
from fis_tools.formats.exchange.methods import AGGREGATIONS, AND, DEFUZZIFIERS, HEDGES, OR
from fis_tools.formats.own.mapping import to_mapping
from fis_tools.model import (
    Constant,
    FuzzyController,
    FuzzySystem,
    Hedged,
    Term,
    Trapezoidal,
    Triangular,
    Variable,
    parts_of,
)
from fis_tools.model.variables import sample

DIALECT = Dialect(
    title="an FCL file", is_nested=True, hedges="fcl", most_words=99, concludes_hedged=True, is_read=False
)

#: The words of IEC 61131-7 itself.
_STANDARD = {"MIN", "PROD", "BDIF", "MAX", "ASUM", "BSUM", "COG", "COGS", "COA", "LM", "RM"}


def write(controller: FuzzyController) -> Written:
    """Write a controller with one system; nothing is carried in comments, because nothing reads them back.

    Raises
    ------
    fis_tools.formats.exchange.antecedents.NotExpressible
        If the format cannot say what the system computes.
    fis_tools.model.validate.InvalidSystem
        If something is wrong with the controller.
    """
    to_mapping(controller)
    said = say(only_system(controller, DIALECT), DIALECT)
    system, original = said.system, said.source
    lines = [f"FUNCTION_BLOCK {system.name}", ""]
    for kind, variables in (("VAR_INPUT", system.inputs), ("VAR_OUTPUT", system.outputs)):
        lines += [kind, *(f"  {variable.name} : REAL;" for variable in variables), "END_VAR", ""]
    for shown, variable in zip(system.inputs, original.inputs, strict=True):
        lines += [f"FUZZIFY {shown.name}", _range(shown), *_term_lines(shown, variable), "END_FUZZIFY", ""]
    for shown, variable in zip(system.outputs, original.outputs, strict=True):
        terms = _concluded_lines(shown) if system.weighs(shown) else _term_lines(shown, variable)
        lines += [f"DEFUZZIFY {shown.name}", _range(shown), *terms]
        method = DEFUZZIFIERS[system.defuzzifier_of(shown)].fcl
        accumulation = AGGREGATIONS[shown.aggregation].fcl
        joined = [] if system.weighs(shown) else [f"  ACCU : {accumulation};"]
        lines += [f"  METHOD : {method};", *joined, f"  DEFAULT := {shown.default!r};"]
        lines += ["END_DEFUZZIFY", ""]
    place = 0
    blocks = groupby(
        system.rules, key=lambda rule: (system.and_operator_of(rule), system.or_operator_of(rule))
    )
    for number, (operators, rules) in enumerate(blocks, start=1):
        lines += [
            f"RULEBLOCK rules_{number}",
            f"  AND : {AND[operators[0]].fcl};",
            f"  OR : {OR[operators[1]].fcl};",
        ]
        lines += [f"  ACT : {AND[system.implication].fcl};"]
        for rule in rules:
            place += 1
            lines.append(f"  RULE {place} : {rule_words(rule)};")
        lines += ["END_RULEBLOCK", ""]
    lines.append("END_FUNCTION_BLOCK")
    return Written("\n".join(lines) + "\n", (*losses(controller, said, DIALECT), *_strangers(system)))


def _range(variable: Variable) -> str:
    return f"  RANGE := ({variable.minimum!r} .. {variable.maximum!r});"


def _term_lines(shown: Variable, variable: Variable) -> Iterator[str]:
    for name, term in zip(shown.terms, variable.terms, strict=True):
        points = " ".join(f"({x!r}, {y!r})" for x, y in _points(variable, term))
        yield f"  TERM {name.name} := {points};"


def _concluded_lines(output: Variable) -> Iterator[str]:
    """Say what is concluded on an output that is weighed: a number as it is, else in fuzzylite's words."""
    for term in output.terms:
        word, values = concluded_words(term.membership, "fll")
        said = [] if isinstance(term.membership, Constant) else [word]
        said += [value if isinstance(value, str) else repr(value) for value in values]
        yield f"  TERM {term.name} := {' '.join(said)};"


def _points(variable: Variable, term: Term) -> list[tuple[float, float]]:
    """Return points between which the membership function is straight, level beyond them."""
    shape = term.membership
    corners: list[tuple[float, float]] = []
    if isinstance(shape, Triangular):
        corners = [(shape.left, 0.0), (shape.peak, 1.0), (shape.right, 0.0)]
    elif isinstance(shape, Trapezoidal):
        corners = [(shape.left, 0.0), (shape.left_top, 1.0), (shape.right_top, 1.0), (shape.right, 0.0)]
    if corners:
        inside = _without_walls_at_the_ends(corners, variable)
        if all(left[0] < right[0] for left, right in pairwise(inside)):
            return [(float(x), y) for x, y in inside]
    values = sample(variable, term)
    return [(float(x), float(y)) for x, y in zip(variable.universe, values, strict=True)]


def _without_walls_at_the_ends(
    corners: list[tuple[float, float]], variable: Variable
) -> list[tuple[float, float]]:
    """Drop the foot of a flank that is a wall at an end of the range, or a plateau of no width."""
    kept = list(dict.fromkeys(corners))
    if kept[0][0] == kept[1][0] <= variable.minimum:
        kept = kept[1:]
    if kept[-1][0] == kept[-2][0] >= variable.maximum:
        kept = kept[:-1]
    return kept


def _strangers(system: FuzzySystem) -> Iterator[str]:
    """Tell what the standard does not know."""
    words = {DEFUZZIFIERS[system.defuzzifier_of(output)].fcl for output in system.outputs}
    defuzzified = [output for output in system.outputs if not system.weighs(output)]
    words |= {AGGREGATIONS[output.aggregation].fcl for output in defuzzified}
    words |= {AND[system.implication].fcl} if defuzzified else set()
    words |= {
        concluded_words(term.membership, "fll")[0]
        for output in system.weighed
        for term in output.terms
        if not isinstance(term.membership, Constant)
    }
    for rule in system.rules:
        words |= {AND[system.and_operator_of(rule)].fcl, OR[system.or_operator_of(rule)].fcl}
    parts = (part for rule in system.rules for part in parts_of(rule.antecedent))
    words |= {HEDGES[part.hedge].fcl for part in parts if isinstance(part, Hedged)}
    for word in sorted(words - _STANDARD):
        yield f"{word} is not in IEC 61131-7; fuzzylite knows it"
