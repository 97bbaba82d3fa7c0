"""Validation of fuzzy systems; each error says what is wrong, what is expected and how to fix it."""

import math
from collections import Counter
from collections.abc import Iterable, Iterator
from itertools import islice, pairwise
from typing import get_args
from weakref import WeakValueDictionary

import numpy as np

from fis_tools.errors import Mistake, suggestion
from fis_tools.model import operators
from fis_tools.model.expressions import And, Expression, Hedged, Is, Not, Or
from fis_tools.model.intervals import has_intervals
from fis_tools.model.membership import MonotoneFunction
from fis_tools.model.numbers import Constant, Formula, Linear, NotAFormula, Number
from fis_tools.model.operators import HEDGES, WEIGHING
from fis_tools.model.semantics import ALL_SEMANTICS, TOOLS
from fis_tools.model.shape_problems import is_finite, sample_problems, shape_problems
from fis_tools.model.systems import FuzzyController, FuzzySystem, Rule
from fis_tools.model.trees import wire_problems
from fis_tools.model.variables import Variable

#: The terms of each variable, in order.
Vocabulary = dict[str, dict[str, None]]
#: Most problems of a system that are listed.
MOST_PROBLEMS = 200
#: Most inputs of a system, terms of a variable and rules: beyond, pages are unreadable and analyses never
#: end.
MOST_INPUTS, MOST_TERMS, MOST_RULES = 64, 20_000, 50_000
#: Letters of a name.
LONGEST_NAME = 1000
#: Most systems of a controller.
MOST_SYSTEMS = 50
#: Most memberships, of all terms at all points of a system.
MOST_MEMBERSHIPS = 4_000_000
#: of a range, below which numbers lose digits
LEAST_RANGE = 1e-290
#: Deepest nesting of and, or and not in one antecedent.
MAX_NESTING = 20


class InvalidSystem(Mistake):
    """A fuzzy system or controller that cannot be used; the message lists every problem."""


#: systems that were found valid, which cannot change
_VALID: WeakValueDictionary[int, FuzzySystem] = WeakValueDictionary()


def validate(system: FuzzySystem) -> None:
    """Raise InvalidSystem for a system with problems.

    Raises
    ------
    InvalidSystem
        With one line for each problem.
    """
    if _VALID.get(id(system)) is system:
        return
    sentences = problems(system)
    if sentences:
        raise InvalidSystem("\n".join(sentences))
    _VALID[id(system)] = system


def require_valid(controller: FuzzyController) -> None:
    """Raise InvalidSystem for a controller with problems, one line for each."""
    if sentences := controller_problems(controller):
        raise InvalidSystem("\n".join(sentences))


def controller_problems(controller: FuzzyController) -> list[str]:
    """Return the problems of a controller and its systems, one sentence each; empty if there are none."""
    sentences = list(_name_problems("a controller", controller.name))
    if not controller.systems:
        sentences.append(f"controller {controller.name!r} has no systems; give it at least one")
    sentences += _duplicates(
        f"controller {controller.name!r}", "systems", (s.name for s in controller.systems)
    )
    for kind, facts in (("attributes", controller.attributes), ("provenance", controller.provenance)):
        sentences += _duplicates(f"controller {controller.name!r}", kind, (key for key, _ in facts))
    if len(controller.systems) > MOST_SYSTEMS:
        return [
            f"controller {controller.name!r} has {len(controller.systems)} systems; at most {MOST_SYSTEMS} "
            "are read, so split it"
        ]
    for system in controller.systems:
        sentences += problems(system)
    return sentences or [*_at(f"controller {controller.name!r}: ", wire_problems(controller))]


def problems(system: FuzzySystem) -> list[str]:
    """Return the problems of a system, one sentence each; empty if there are none.

    Parameters
    ----------
    system : FuzzySystem
        Any system, valid or not.
    """
    too_large = list(_size_problems(system))
    return too_large or list(islice(_problems(system), MOST_PROBLEMS))


def _size_problems(system: FuzzySystem) -> Iterator[str]:
    """Yield the sizes of a system that are too large for further checks."""
    where = f"system {system.name!r}"
    most_terms = max((len(variable.terms) for variable in system.variables), default=0)
    memberships = sum(
        len(variable.terms) * variable.num_points
        for variable in system.variables
        if isinstance(variable.num_points, int | np.integer)
    )
    for what, count, most in (
        ("inputs", len(system.inputs), MOST_INPUTS),
        ("outputs", len(system.outputs), MOST_TERMS),
        ("terms of one variable", most_terms, MOST_TERMS),
        ("rules", len(system.rules), MOST_RULES),
        ("memberships, terms times points", memberships, MOST_MEMBERSHIPS),
    ):
        if count > most:
            yield f"{where} has {count} {what}; at most {most} are read, so make it smaller"


def _problems(system: FuzzySystem) -> Iterator[str]:
    """Yield the problems of a system."""
    where = f"system {system.name!r}"
    yield from _name_problems("a system", system.name)
    yield from _at(f"{where}: ", _choice_problems(system))
    for kind, variables in (("inputs", system.inputs), ("outputs", system.outputs)):
        if not variables:
            yield f"{where} has no {kind}; a system needs at least one, so add a variable"
    yield from _duplicates(where, "variables", (variable.name for variable in system.variables))
    for variable in system.variables:
        yield from _at(f"{where}, ", _variable_problems(variable))
    yield from _at(f"{where}, ", _output_problems(system))
    yield from _at(f"{where}, ", _rule_base_problems(system))
    if has_intervals(system):
        yield from _at(f"{where}, ", _interval_problems(system))


_CHOICES = {
    "and_operator": get_args(operators.AndOperator),
    "or_operator": get_args(operators.OrOperator),
    "defuzzifier": get_args(operators.Defuzzifier),
    "accumulation": get_args(operators.Accumulation),
    "aggregation": get_args(operators.Aggregation),
    "implication": get_args(operators.AndOperator),
    "semantics": ALL_SEMANTICS,
    "type_reduction": get_args(operators.TypeReduction),
}


def _choice_problems(chooser: FuzzySystem | Variable | Rule) -> Iterator[str]:
    """Yield unknown operators and methods; None leaves the choice to the system."""
    for kind, allowed in _CHOICES.items():
        chosen = getattr(chooser, kind, allowed[0])
        is_left = chosen is None and not isinstance(chooser, FuzzySystem)
        if chosen not in allowed and not is_left:
            yield f"{kind} {chosen!r} is not known; use one of {', '.join(allowed)}"


def _at(where: str, problems: Iterable[str]) -> Iterator[str]:
    """Prefix problems with where they are."""
    return (f"{where}{problem}" for problem in problems)


def _name_problems(what: str, name: str) -> Iterator[str]:
    """Yield the problems of a name."""
    if len(name) > LONGEST_NAME:
        yield f"{what} has a name of {len(name)} letters, {name[:40]!r}...; at most {LONGEST_NAME} are read"
    elif not name or not name.isprintable() or name != name.strip():
        yield (
            f"{what} is called {name!r}; a name is printable text without blanks at its ends: "
            "choose another one"
        )


def _duplicates(where: str, what: str, names: Iterable[str]) -> Iterator[str]:
    for name, count in Counter(names).items():
        if count > 1:
            yield f"{where} has {count} {what} called {name!r}; names are unique, so rename all but one"


def _variable_problems(variable: Variable) -> Iterator[str]:
    """Yield the problems of a variable, its universe and its terms."""
    where = f"variable {variable.name!r}"
    yield from _name_problems("a variable", variable.name)
    universe_problems = list(_universe_problems(variable))
    yield from _at(f"{where}: ", universe_problems)
    if not variable.terms:
        yield f"{where} has no terms; give it at least one membership function"
    yield from _duplicates(where, "terms", (term.name for term in variable.terms))
    for term in variable.terms:
        yield from _at(f"{where}, ", _name_problems("a term", term.name))
        faults = list(shape_problems(term.membership, variable.num_points))
        if not faults and not universe_problems and not isinstance(term.membership, Number):
            faults = list(sample_problems(variable, term))
        yield from _at(f"{where}, term {term.name!r}: ", faults)


def _universe_problems(variable: Variable) -> Iterator[str]:
    """Yield the problems of a variable's range and of the points in it."""
    low, high = variable.minimum, variable.maximum
    if not (is_finite(low) and is_finite(high)):
        yield f"the range [{low}, {high}] is not finite; give two finite numbers"
    elif not low < high:
        yield f"the range [{low}, {high}] is empty; the first number must be below the second, so swap them"
    elif not math.isfinite(high - low):
        yield f"the range [{low}, {high}] is too wide for double precision; use another unit"
    elif high - low < LEAST_RANGE + 1000 * math.ulp(max(abs(low), abs(high))):
        yield f"the range [{low}, {high}] is too narrow for double precision; use another unit"
    if not isinstance(variable.num_points, int | np.integer) or variable.num_points < 2:
        yield f"the universe has {variable.num_points} points; it needs at least 2 (101 is usual)"
    points = variable.points
    if points is None:
        return
    if len(points) != variable.num_points:
        yield f"{len(points)} points are given but num_points is {variable.num_points}; make them equal"
    if not all(map(is_finite, points)):
        yield "a point of the universe is not finite; give finite numbers"
    elif any(left >= right for left, right in pairwise(points)):
        yield "the points of the universe do not ascend; sort them and drop repeated ones"
    elif points and (points[0], points[-1]) != (low, high):
        yield (
            f"the universe runs from {points[0]} to {points[-1]} but the range is [{low}, {high}]; "
            "make the range the first and the last point"
        )


def _interval_problems(system: FuzzySystem) -> Iterator[str]:
    """Yield the parts of a system that interval type-2 sets do not go with."""
    if system.semantics != "matlab":
        yield (
            "interval type-2 sets are inferred at evenly spaced points as MATLAB does, and the semantics are "
            f"{system.semantics}; set semantics to matlab"
        )
    for output in system.outputs:
        method = system.defuzzifier_of(output)
        if method not in {"centroid", "weighted_average"}:
            yield f"output {output.name!r} of interval type-2 is {method}; take centroid or weighted_average"
        if method == "weighted_average" and not all(
            isinstance(term.membership, Constant | Linear) for term in output.terms
        ):
            yield f"output {output.name!r} of interval type-2 concludes no number; take constant or linear"


def _output_problems(system: FuzzySystem) -> Iterator[str]:
    """Yield the problems of outputs, and what inputs have that belongs to outputs only."""
    for variable in system.outputs:
        if variable.default is None and not TOOLS[system.semantics].has_outputs_without_default:
            yield (
                f"output {variable.name!r} has no default; declare default: the output when no rule fires "
                "(0 is usual for a force)"
            )
        elif variable.default is not None and not is_finite(variable.default):
            yield f"output {variable.name!r}: default {variable.default} must be a finite number"
        yield from _at(f"output {variable.name!r}: ", _choice_problems(variable))
        yield from _kind_problems(system, variable)
        yield from _accumulation_problems(system, variable)
        if system.is_sampled and variable.points is not None:
            yield (
                f"output {variable.name!r} lists the points of its universe, but "
                f"{TOOLS[system.semantics].title} takes evenly spaced ones; give their number"
            )
    for variable in system.inputs:
        for term in variable.terms:
            if isinstance(term.membership, Number):
                yield (
                    f"input {variable.name!r}, term {term.name!r} is a number; terms of inputs are fuzzy "
                    "sets, so give it a shape"
                )
        if variable.is_clipped and not system.is_sampled:
            yield f"input {variable.name!r} says clip, but all inputs are clipped here; drop it"
        usual = {"default": None, "defuzzifier": None, "accumulation": "max", "aggregation": "max"}
        for key, unset in usual.items():
            if getattr(variable, key) != unset:
                article = "an" if key[0] == "a" else "a"
                yield f"input {variable.name!r} has {article} {key}; only outputs have one, so drop it"


def _accumulation_problems(system: FuzzySystem, output: Variable) -> Iterator[str]:
    """Yield the conflicts between an output's accumulation and how it is inferred."""
    where = f"output {output.name!r} has the accumulation {output.accumulation}"
    if output.accumulation == "max" or system.joins_numbers(output):
        return
    if system.is_sampled:
        yield f"{where}, which {TOOLS[system.semantics].title} does not know; drop it"
    elif not system.cuts(output):
        yield (
            f"{where}, which is for terms cut by min and aggregated by max; drop it, or the other "
            "implication and aggregation"
        )
    elif output.accumulation == "unbounded_sum":
        yield f"{where}, which is for numbers of jFuzzyLogic; take bounded_sum"


def _kind_problems(system: FuzzySystem, output: Variable) -> Iterator[str]:
    """Yield the conflicts between the terms of an output and its defuzzifier."""
    where = f"output {output.name!r}"
    numbers = [term.name for term in output.terms if isinstance(term.membership, Number)]
    if not system.weighs(output):
        if numbers:
            yield (
                f"{where}, term {numbers[0]!r} is a number, and the defuzzifier "
                f"{system.defuzzifier_of(output)} needs fuzzy sets; choose {' or '.join(WEIGHING)}"
            )
        return
    method = system.defuzzifier_of(output)
    if output.aggregation != "unbounded_sum":
        yield (
            f"{where} is a {method}, to which every rule counts by itself, but it has the aggregation "
            f"{output.aggregation}; set aggregation to unbounded_sum"
        )
    if numbers and len(numbers) < len(output.terms):
        yield f"{where} has numbers and fuzzy sets among its terms; make all of them one or the other"
    for term in output.terms:
        match term.membership:
            case Linear(coefficients, _) if len(coefficients) != len(system.inputs):
                yield (
                    f"{where}, term {term.name!r} has {len(coefficients)} coefficients for "
                    f"{len(system.inputs)} inputs; give one for each input, and the constant"
                )
            case Formula() as formula:
                yield from _at(f"{where}, term {term.name!r}: ", _formula_problems(system, output, formula))
            case Number() | MonotoneFunction():
                pass
            case shape:
                yield (
                    f"{where}, term {term.name!r} is {shape.entry.name}, but a {method} needs numbers "
                    "(constant or linear) or shapes that only rise or fall (ramp, sigmoid, s_shape, "
                    "z_shape, concave or arc)"
                )


def _formula_problems(system: FuzzySystem, output: Variable, formula: Formula) -> Iterator[str]:
    """Yield the problems of a formula: it may use inputs, and outputs before its own."""
    try:
        names = dict.fromkeys(formula.parsed.names())
    except NotAFormula as error:
        yield f"{error}; correct it"
        return
    before = system.outputs[: system.outputs.index(output)]
    known = [variable.name for variable in (*system.inputs, *before)]
    for name in names:
        if name not in known:
            yield (
                f"the formula {formula.text[:40]!r} speaks of {name!r}, no input and no output before "
                f"this one; choose of {', '.join(known)}"
            )


def _rule_base_problems(system: FuzzySystem) -> Iterator[str]:
    """Yield the problems of the rules."""
    if not system.rules:
        yield "no rules; give at least one"
    labels = (rule.label for rule in system.rules if rule.label)
    yield from _duplicates("the rule base", "rules", labels)
    inputs, outputs = _vocabulary(system.inputs), _vocabulary(system.outputs)
    for number, rule in enumerate(system.rules, start=1):
        where = f"rule {number}"
        if rule.label and not rule.label.isprintable():
            yield f"{where}: the label {rule.label!r} is not printable; drop the control characters"
        yield from _at(f"{where}: ", _choice_problems(rule))
        yield from _at(f"{where}: ", _expression_problems(inputs, rule.antecedent, 0))
        if not rule.consequents:
            yield f"{where} concludes nothing; give it at least one consequent"
        for consequent in rule.consequents:
            sentences = _reference_problems(outputs, "output", consequent.variable, consequent.term)
            yield from _at(f"{where}: ", sentences)
            if not (is_finite(consequent.weight) and 0.0 <= consequent.weight <= 1.0):
                yield f"{where}: weight {consequent.weight} lies outside [0, 1]; choose one inside"


def _vocabulary(variables: tuple[Variable, ...]) -> Vocabulary:
    return {variable.name: {term.name: None for term in variable.terms} for variable in variables}


def _expression_problems(inputs: Vocabulary, expression: Expression, depth: int) -> Iterator[str]:
    """Yield the problems of an antecedent."""
    if depth > MAX_NESTING:
        yield f"and, or and not are nested more than {MAX_NESTING} deep; split the rule"
        return
    match expression:
        case Is(variable, term):
            yield from _reference_problems(inputs, "input", variable, term)
        case Not(operand):
            yield from _expression_problems(inputs, operand, depth + 1)
        case Hedged(hedge, operand):
            if hedge not in HEDGES:
                yield f"the hedge {hedge!r} is not known; {suggestion(str(hedge), HEDGES)}"
            yield from _expression_problems(inputs, operand, depth + 1)
        case And(operands) | Or(operands):
            if not operands:
                yield f"an {expression.word!r} joins no statements; give it at least one"
            for operand in operands:
                yield from _expression_problems(inputs, operand, depth + 1)
        case _:
            yield f"{expression!r} is not a statement; use Is, Not, Hedged, And or Or"


def _reference_problems(known: Vocabulary, kind: str, variable: str, term: str) -> Iterator[str]:
    """Yield a problem if a variable, or its term, does not exist."""
    if variable not in known:
        yield f"{kind} {variable!r} does not exist; {suggestion(variable, known)}"
    elif term not in known[variable]:
        yield f"{kind} {variable!r} has no term {term!r}; {suggestion(term, known[variable])}"
