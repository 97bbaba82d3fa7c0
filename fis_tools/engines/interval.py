"""Interval inference, compiled: the possible outputs of a system for all inputs in a box.

Each number of an inference becomes a lower and an upper bound: memberships over an interval, strengths of
rules, the cut of each output term. The least and the greatest centroid possible with cuts inside these bounds
follow from a switch like that of N. N. Karnik and J. M. Mendel (Information Sciences 132, 2001): the
aggregated set is as high as possible on one side of the centroid and as low on the other. Every step is
rounded outward; docs/explanation/proof.md gives the argument.

Bounds are rows of two numbers, the lower first.
"""

import numpy as np

from fis_tools.array_types import Floats
from fis_tools.compiled.decorator import advise_numba, compiled
from fis_tools.engines import codes
from fis_tools.engines.bounded_average import weigh
from fis_tools.engines.bounded_centroid import conclude
from fis_tools.engines.degrees import degree_bounds
from fis_tools.engines.intervals import bound_interval, bound_weighed
from fis_tools.engines.outward import EPSILON, INTERPOLATION_ERROR, combine_bounds
from fis_tools.engines.program import (
    MANY_RULES,
    Antecedents,
    Conclusion,
    IntervalOutput,
    Program,
    Weighing,
    assemble,
)
from fis_tools.engines.sampled_bounds import bound_sampled
from fis_tools.model import Concave, Constant, Formula, FuzzySystem, Sigmoid, Variable
from fis_tools.model.intervals import has_intervals
from fis_tools.model.validate import validate


class NotBounded(ValueError):  # noqa: N818
    """A system whose outputs cannot be bounded; the text says why."""


def pack(system: FuzzySystem) -> Program:
    """Return a system as the arrays that interval inference reads.

    Raises
    ------
    fis_tools.model.validate.InvalidSystem
        If the system is invalid.
    NotBounded
        If an output is defuzzified by the bisector, or is not the maximum of cut terms.
    """
    validate(system)
    for output in system.outputs:
        if obstacle := _obstacle(system, output):
            raise NotBounded(f"output {output.name!r} cannot be bounded: {obstacle}")
    if len(system.rules) >= MANY_RULES:
        advise_numba()
    return assemble(system)


def _obstacle(system: FuzzySystem, output: Variable) -> str:  # noqa: PLR0911 - one for each
    """Return why an output cannot be bounded, or nothing."""
    if system.defuzzifier_of(output) == "bisector" and not system.is_sampled:
        return (
            "across a gap between fired terms scikit-fuzzy's bisector is not the bisector, and may be no "
            "number; choose another defuzzifier"
        )
    if not (system.weighs(output) or system.cuts(output) or system.is_sampled):
        return (
            "bounds hold where terms are cut by min and aggregated by max, here the implication is "
            f"{system.implication} and the aggregation {output.aggregation}; choose min and max"
        )
    if system.joins_numbers(output) and output.accumulation != "unbounded_sum":
        return f"jFuzzyLogic joins rules that conclude one number by {output.accumulation}; take ACCU : SUM"
    terms = output.terms if system.weighs(output) else ()
    if has_intervals(system) and not all(isinstance(term.membership, Constant) for term in terms):
        return "bounds of interval type-2 are for sets and constants, and its rules conclude other numbers"
    for term in terms:
        shape = term.membership
        if isinstance(shape, Formula):
            words = "and bounds are for numbers linear in the inputs"
            return f"its rules conclude the formula {shape.text[:40]!r}, {words}"
        if isinstance(shape, Concave | Sigmoid):  # what they conclude diverges as the strength vanishes
            return (
                f"as the strength of a rule goes to zero, the number that it concludes by {term.name!r}, a "
                f"{shape.entry.name}, has no limit; take a ramp or an s_shape"
            )
    return ""


def bound(program: Program, low: Floats, high: Floats) -> tuple[Floats, Floats, Floats]:
    """Bound the outputs over many boxes.

    Parameters
    ----------
    program : Program
        From `pack`.
    low, high : (n, num_inputs)
        The corners of the boxes, ``low <= high``; infinite ones are replaced by the universe's ends.

    Returns
    -------
    least, greatest : (n, num_outputs)
        No output for an input inside the box lies below or above.
    variation : (n, num_inputs)
        Variation of the memberships in each input's terms over the box, summed over the terms.
    """
    strengths = np.empty((len(low), program.num_rules, 2))
    variation = np.empty(low.shape)
    _fire(program.antecedents, low, high, strengths, variation)
    limits = np.empty((len(program.conclusions), len(low), 2))
    low, high = (np.clip(end, program.limits[:, 0], program.limits[:, 1]) for end in (low, high))
    for conclusion, column in zip(program.conclusions, limits, strict=True):
        if isinstance(conclusion, IntervalOutput):
            _reduce(conclusion, strengths, column)
        elif isinstance(conclusion, Weighing):
            weigh(conclusion, low, high, strengths, column)
            variation += _steepness(conclusion, low.shape[1]) * (high - low)
        elif conclusion.sampling != codes.POLYGON:
            bound_sampled(conclusion, strengths, column)
        else:
            conclude(conclusion, strengths, column)
    return limits[:, :, 0].T, limits[:, :, 1].T, variation


def _reduce(pair: IntervalOutput, strengths: Floats, out: Floats) -> None:
    """Bound an output of interval type-2."""
    lower, upper = pair.lower, pair.upper
    if isinstance(lower, Weighing) and isinstance(upper, Weighing):
        lower, upper = (part._replace(formulas=(), names=()) for part in (lower, upper))
        bound_weighed(lower, upper, pair.is_mean, strengths, out)
    elif isinstance(lower, Conclusion) and isinstance(upper, Conclusion):
        bound_interval(lower, upper, pair.is_mean, strengths, out)


@compiled(error_model="numpy", nogil=True)
def _fire(antecedents: Antecedents, low: Floats, high: Floats, out: Floats, variation: Floats) -> None:
    """Bound each rule's firing strength over each box, before weights."""
    num_terms = antecedents.inputs[:, 0].sum()
    slots = np.empty((num_terms + len(antecedents.steps), 2))
    for box in range(len(low)):
        slot = 0
        for index in range(len(antecedents.inputs)):
            end = slot + antecedents.inputs[index, 0]
            variation[box, index] = _memberships(
                antecedents, index, low[box, index], high[box, index], slots[slot:end]
            )
            slot = end
        for step in range(len(antecedents.steps)):
            operator, left, right = antecedents.steps[step]
            slots[num_terms + step] = combine_bounds(
                operator, (slots[left, 0], slots[left, 1]), (slots[right, 0], slots[right, 1])
            )
        for rule in range(len(antecedents.rule_slots)):
            out[box, rule] = slots[antecedents.rule_slots[rule]]


@compiled(error_model="numpy", nogil=True)
def _memberships(antecedents: Antecedents, index: int, low: float, high: float, out: Floats) -> float:
    """Bound the memberships in the terms of one input over an interval; return their variation.

    Between two points of the universe a membership lies between those at the points. The interval is widened
    by an engine's possible error in placing an input on the universe.
    """
    num_terms, num_points, start, row = antecedents.inputs[index]
    shapes, variation = antecedents.shapes, 0.0
    if len(shapes.kinds) > 0:
        first = antecedents.inputs[:index, 0].sum()
        low, high = max(low, antecedents.limits[index, 0]), min(high, antecedents.limits[index, 1])
        for term in range(num_terms):
            out[term] = degree_bounds(shapes, first + term, low, high)
            variation += out[term, 1] - out[term, 0]
        return variation
    x = antecedents.universes[start : start + num_points]
    slack = 4 * EPSILON * max(abs(x[0]), abs(x[-1]))
    low = min(max(low - slack, x[0]), x[-1])
    high = min(max(high + slack, x[0]), x[-1])
    first = min(max(np.searchsorted(x, low, side="right") - 1, 0), num_points - 2)
    last = min(max(np.searchsorted(x, high, side="left") - 1, first), num_points - 2)
    from_left = (low - x[first]) / (x[first + 1] - x[first])
    to_right = (high - x[last]) / (x[last + 1] - x[last])
    stride = 2 * num_terms
    for term in range(num_terms):
        mu = antecedents.memberships[row + term : row + stride * num_points : stride]
        left = mu[first] + from_left * (mu[first + 1] - mu[first])
        right = mu[last] + to_right * (mu[last + 1] - mu[last])
        least, greatest = min(left, right), max(left, right)
        for point in range(first + 1, last + 1):
            least, greatest = min(least, mu[point]), max(greatest, mu[point])
        variation += greatest - least
        error = 0.0
        if mu[first] != mu[first + 1] or mu[last] != mu[last + 1]:
            error = INTERPOLATION_ERROR * max(mu[first], mu[first + 1], mu[last], mu[last + 1])
        out[term, 0], out[term, 1] = max(0.0, least - error), greatest + error
    return variation


def _steepness(weighing: Weighing, num_inputs: int) -> Floats:
    """Return how steeply concluded numbers depend on each input, as shares of the output's range."""
    factors = np.abs(np.where(weighing.kinds[:, np.newaxis] == codes.NUMBER, weighing.parameters, 0.0))
    return factors[:, :num_inputs].max(axis=0, initial=0.0) / (weighing.high - weighing.low)
