"""The data that a page computes with: systems and flights as JSON without loss."""

import base64
from collections.abc import Sequence
from typing import Any

import numpy as np

from fis_tools.analysis import arrays
from fis_tools.analysis.flight_data import FlownSystem
from fis_tools.analysis.quadrature import quadrature
from fis_tools.array_types import Floats
from fis_tools.engines.degrees import tabulated
from fis_tools.engines.program import Conclusion, assemble
from fis_tools.findings.explanation.points import in_short
from fis_tools.model import (
    And,
    Expression,
    FuzzySystem,
    Hedged,
    Is,
    Not,
    Or,
    Polyline,
    Rule,
    Sampled,
    Variable,
    memberships_at,
    sample,
)
from fis_tools.review.flown import Flight
from fis_tools.words.text import sentence

#: so many inferences of a system are carried at most, shared out among the flights
MOST_SAMPLES = 4000


def system_data(system: FuzzySystem) -> dict[str, Any]:
    """Return a system as plain data: membership functions sampled, names in rules as indices."""
    return {
        "name": system.name,
        "semantics": system.semantics,
        "inputs": [_input(system, variable) for variable in system.inputs],
        "outputs": [
            _output(system, variable)
            | {"defuzzifier": system.defuzzifier_of(variable), "implication": system.implication}
            | ({"runs": conclusion.runs.tolist()} if isinstance(conclusion, Conclusion) else {})
            for variable, conclusion in zip(system.outputs, assemble(system).conclusions, strict=True)
        ],
        "rules": [_rule(rule, system) for rule in system.rules],
    }


def flight_data(flight: Flight, systems: Sequence[FuzzySystem], num_flights: int) -> dict[str, Any]:
    """Return one of several flights as plain data: what each system sensed, evenly thinned where it is long.

    How often each rule fired is counted over all of the flight, before it is thinned.

    Parameters
    ----------
    flight : Flight
    systems : sequence of FuzzySystem
        In the order in which the page has them.
    num_flights : int
        How many flights share the room.
    """
    most = max(2, MOST_SAMPLES // num_flights)
    flown = [_flown(system, flight.flown.get(system.name), most) for system in systems]
    return {"name": flight.name, "systems": flown}


def quadrature_data(systems: Sequence[FuzzySystem]) -> list[str]:
    """Return nodes and weights of the quadrature that integrates the shares of so many rules exactly."""
    nodes, weights = quadrature(max(len(system.rules) for system in systems))
    return [_doubles(nodes), _doubles(weights)]


def kept_rows(num_rows: int, most: int) -> np.ndarray[tuple[int], np.dtype[np.int64]]:
    """Return the indices of rows to keep: the first, the last, and evenly spaced ones between them."""
    return np.unique(np.linspace(0, num_rows - 1, min(num_rows, most)).round().astype(np.int64))


def _flown(system: FuzzySystem, flown: FlownSystem | None, most: int) -> dict[str, Any] | None:
    """Return what a system sensed in a flight as plain data; None if it sensed nothing."""
    if flown is None or not len(flown.time_s):
        return None
    rows = kept_rows(len(flown.time_s), most)
    usage = arrays.rule_usage(arrays.firing(system, flown.inputs))
    points = []
    if flown.points is not None:
        instants = zip(flown.time_s[rows].tolist(), flown.inputs[rows].tolist(), strict=True)
        points = [in_short(flown.points.at(time_s), system, inputs) for time_s, inputs in instants]
    return {
        "time_s": _doubles(flown.time_s[rows]),
        "inputs": _doubles(flown.inputs[rows]),
        "fired": _doubles(usage.fired),
        "num_inferences": len(flown.time_s),
        "is_timed": flown.is_timed,
        "points": points,
    }


def _variable(variable: Variable, *more: str) -> dict[str, Any]:
    """Return a variable as plain data, with more of its properties, by their names."""
    fields = {key: getattr(variable, key) for key in ("name", "unit", "minimum", "maximum", *more)}
    terms = [{"name": term.name, "values": _doubles(sample(variable, term))} for term in variable.terms]
    # evenly spaced points are counted out by the page
    universe = variable.num_points if variable.points is None else _doubles(variable.universe)
    return fields | {"universe": universe, "terms": terms}


def _input(system: FuzzySystem, variable: Variable) -> dict[str, Any]:
    """Return an input as plain data, with its formulas where it is not clipped."""
    data = _variable(variable)
    if not system.is_sampled:
        return data
    for term, carried in zip(tabulated(variable).terms, data["terms"], strict=True):
        shape = term.membership
        carried["shape"] = shape.entry.name
        carried["numbers"] = _doubles(np.array([getattr(shape, key) for key in shape.entry.kinds]))
        if isinstance(shape, Polyline):
            carried |= {"points": _doubles(np.array(shape.x)), "heights": _doubles(np.array(shape.y))}
        if isinstance(shape, Sampled):
            carried |= {"points": _doubles(variable.universe), "heights": carried["values"]}
    return data | {"clip": variable.is_clipped}


def _output(system: FuzzySystem, variable: Variable) -> dict[str, Any]:
    """Return an output as plain data, with the points that it is a sum over."""
    data = _variable(variable, "default", "accumulation", "aggregation")
    if system.is_sampled and not system.weighs(variable):
        points = system.points_of(variable)
        data["points"] = _doubles(points)
        for term, carried in zip(variable.terms, data["terms"], strict=True):
            carried["sampled"] = _doubles(memberships_at(variable, term, points))
    return data


def _rule(rule: Rule, system: FuzzySystem) -> dict[str, Any]:
    """Return a rule as plain data, with indices for variables and terms."""
    outputs = [variable.name for variable in system.outputs]
    return {
        "words": sentence(rule),
        "and_operator": system.and_operator_of(rule),
        "or_operator": system.or_operator_of(rule),
        "antecedent": _expression(rule.antecedent, system),
        "consequents": [
            [outputs.index(c.variable), system.variable(c.variable).term_index(c.term), c.weight]
            for c in rule.consequents
        ],
    }


def _expression(expression: Expression, system: FuzzySystem) -> list[Any]:
    """Return an antecedent as nested lists, with indices for variables and terms."""
    match expression:
        case Is(name, term):
            index = [variable.name for variable in system.inputs].index(name)
            return ["is", index, system.inputs[index].term_index(term)]
        case Not(operand):
            return ["not", _expression(operand, system)]
        case Hedged(hedge, operand):
            return [hedge, _expression(operand, system)]
        case And(operands) | Or(operands):
            return [expression.word, [_expression(operand, system) for operand in operands]]


def _doubles(values: Floats) -> str:
    """Return numbers without loss: base64 of little-endian doubles."""
    return base64.b64encode(np.ascontiguousarray(values, dtype="<f8").tobytes()).decode("ascii")
