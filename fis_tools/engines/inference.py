"""Mamdani inference in plain numpy, step by step: for reading, inspecting and drawing.

It follows scikit-fuzzy 0.5's ``ControlSystemSimulation.compute()`` in the same order and with the same
arithmetic, so results agree to the last bit. `fis_tools.engines.kernel` is the fast version for the common
case.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import reduce
from typing import Any

import numpy as np

from fis_tools import model
from fis_tools.array_types import Floats, Integers
from fis_tools.engines.codes import RAISED_WEIGHT
from fis_tools.engines.defuzzification import DEFUZZIFIERS, crossings, defuzzify_sampled
from fis_tools.engines.degrees import tabulated
from fis_tools.engines.inputs import Values, as_rows
from fis_tools.model import TOOLS, Expression, FuzzySystem, Rule, Variable, memberships_at
from fis_tools.model.intervals import has_intervals, twin
from fis_tools.model.operators import (
    ACCUMULATIONS,
    AGGREGATIONS,
    AND_OPERATORS,
    HEDGES,
    OR_OPERATORS,
    complement,
)


@dataclass(frozen=True)
class WeightedConclusions:
    """The rules' conclusions on a weighted output, in their order.

    Parameters
    ----------
    rules : (c,) int
        Indices of the rules.
    strengths : (c,)
        Its firing strength times the weight of its consequent.
    numbers : (c,)
        Concluded numbers; NaN where the strength is zero.
    """

    rules: Integers
    strengths: Floats
    numbers: Floats


@dataclass(frozen=True)
class OutputInference:
    """The steps that lead to one output.

    Parameters
    ----------
    variable : Variable
        The output.
    cuts : (num_terms,)
        The height at which each term is cut: the strongest of its rules, or as the variable accumulates them.
        NaN for a term that no rule concludes. For a weighted output, the sum of the strengths.
    universe : (m,)
        The variable's universe with the points inserted where a cut crosses its own membership function;
        empty for a weighted output, as is `aggregated`.
    aggregated : (m,)
        The aggregated conclusion at each point of `universe`: the highest of the cut terms, or by the
        system's implication and the variable's aggregation.
    value : float
        The defuzzified output, or the default.
    is_default : bool
        Whether nothing fired, or the defuzzifier found no number in what did, so that `value` is the default.
    weighing : WeightedConclusions or None
        The weighted conclusions, for a weighted output.
    """

    variable: Variable
    cuts: Floats
    universe: Floats
    aggregated: Floats
    value: float
    is_default: bool
    weighing: WeightedConclusions | None = None


@dataclass(frozen=True)
class Inference:
    """All steps of one inference.

    Parameters
    ----------
    system : FuzzySystem
        The evaluated system.
    inputs : (num_inputs,)
        As given.
    clipped : (num_inputs,)
        Inside the universes.
    memberships : tuple of (num_terms,)
        For each input, its degree of membership in each of its terms.
    firing_strengths : (num_rules,)
        Degree to which each antecedent holds, before weights.
    outputs : tuple of OutputInference
        In the order of the system's outputs.
    lower_strengths : (num_rules,) or None
        Of interval type-2 systems, of which the other fields have upper memberships, strengths and heights.
    """

    system: FuzzySystem
    inputs: Floats
    clipped: Floats
    memberships: tuple[Floats, ...]
    firing_strengths: Floats
    outputs: tuple[OutputInference, ...]
    lower_strengths: Floats | None = None

    @property
    def values(self) -> Floats:
        """The outputs, shape (num_outputs,)."""
        return np.array([output.value for output in self.outputs])


def infer(system: FuzzySystem, inputs: Any) -> Inference:
    """Evaluate a valid system for one sample, keeping every step.

    Parameters
    ----------
    system : FuzzySystem
        A valid system (see `fis_tools.model.validate`).
    inputs : (num_inputs,) array, mapping, or row of a table
        In the order of the system's inputs, or by their names; clipped to the universes.

    Raises
    ------
    ValueError
        If there are too few or too many inputs, or one is NaN.
    """
    values = as_rows(system, inputs)
    if values.ndim != 1 or len(values) != len(system.inputs):
        raise ValueError(
            f"inputs have shape {values.shape[-1:]}; system {system.name!r} has {len(system.inputs)} inputs, "
            "pass one number for each"
        )
    if np.isnan(values).any():
        raise ValueError("an input is NaN; pass numbers, those out of range are clipped")
    limits = np.array([system.limits_of(variable) for variable in system.inputs])
    clipped = np.clip(values, limits[:, 0], limits[:, 1])
    if has_intervals(system):
        return _infer_intervals(system, values, clipped)
    fuzzify = _evaluate_formulas if system.is_sampled else _fuzzify
    memberships = tuple(map(fuzzify, system.inputs, clipped))
    firing = _fire(system, memberships)
    outputs = tuple(infer_outputs(system, firing, clipped))
    return Inference(system, values, clipped, memberships, firing, outputs)


def _infer_intervals(system: FuzzySystem, values: Floats, clipped: Floats) -> Inference:
    """Infer an interval type-2 system by its type-1 twin, whose rules are all lower ones, then all upper."""
    bounds, count = twin(system), len(system.rules)
    memberships = tuple(map(_evaluate_formulas, bounds.inputs, clipped))
    firing = _fire(bounds, memberships)
    outputs = tuple(infer_outputs(system, firing, clipped))
    uppers = tuple(degrees[1::2] for degrees in memberships)
    return Inference(system, values, clipped, uppers, firing[count:], outputs, firing[:count])


def _interval_outputs(system: FuzzySystem, firing: Floats, clipped: Floats) -> list[OutputInference]:
    """Reduce the outputs of an interval type-2 system from both firing strengths of each rule."""
    bounds = twin(system)
    named = {variable.name: x for variable, x in zip(system.inputs, clipped, strict=True)}
    inferred = [_infer_output(bounds, output, firing, named) for output in bounds.outputs]
    outputs = []
    for variable, lower, upper in zip(system.outputs, inferred[::2], inferred[1::2], strict=True):
        x, low, high = upper.universe, lower.aggregated, upper.aggregated
        if upper.weighing is not None and lower.weighing is not None:
            fired = np.flatnonzero(upper.weighing.strengths)
            order = fired[np.argsort(upper.weighing.numbers[fired])]
            x = upper.weighing.numbers[order]
            low, high = lower.weighing.strengths[order], upper.weighing.strengths[order]
        value = upper.value if upper.is_default else _reduced(system, x, low, high)
        outputs.append(replace(upper, variable=variable, value=value))
    return outputs


def _reduced(system: FuzzySystem, x: Floats, low: Floats, high: Floats) -> float:
    """Return the number of ascending points whose weights lie between bounds; every switch is tried."""
    low, high = low / high.max(), high / high.max()
    if system.type_reduction == "nie-tan":
        return float((x * (low + high)).sum() / (low + high).sum())
    ends = []
    for before, after, extreme in ((high, low, np.min), (low, high, np.max)):
        area = np.append(0.0, np.cumsum(before)) + np.append(np.cumsum(after[::-1])[::-1], 0.0)
        moment = np.append(0.0, np.cumsum(before * x)) + np.append(np.cumsum((after * x)[::-1])[::-1], 0.0)
        ends.append(extreme(moment[area > 0.0] / area[area > 0.0]))
    return float(np.mean(ends))


def _fuzzify(variable: Variable, value: float) -> Floats:
    """Return the degrees of membership of a value in the terms of a variable, shape (num_terms,)."""
    functions = variable.memberships
    return np.array([np.interp(value, variable.universe, mf, left=0.0, right=0.0) for mf in functions])


def _evaluate_formulas(variable: Variable, value: float) -> Floats:
    """Return the degrees of membership of a value, which may be outside of the range, by the formulas."""
    terms = tabulated(variable).terms
    return np.array([memberships_at(variable, term, np.array([value]))[0] for term in terms])


def _fire(system: FuzzySystem, memberships: Sequence[Floats]) -> Floats:
    """Return how far each antecedent holds, shape (num_rules,)."""
    degrees: dict[tuple[str, str], Floats] = {
        (variable.name, term.name): degree
        for variable, held in zip(system.inputs, memberships, strict=True)
        for term, degree in zip(variable.terms, held, strict=True)
    }

    def degree(rule: Rule, expression: Expression) -> Floats:
        match expression:
            case model.Is(variable, term):
                return degrees[variable, term]
            case model.Not(operand):
                return complement(degree(rule, operand))
            case model.Hedged(hedge, operand):
                return HEDGES[hedge](degree(rule, operand))
            case model.And(operands):
                combine = AND_OPERATORS[system.and_operator_of(rule)]
            case model.Or(operands):
                combine = OR_OPERATORS[system.or_operator_of(rule)]
        return reduce(combine, [degree(rule, operand) for operand in operands])

    return np.array([degree(rule, rule.antecedent) for rule in system.rules])


def infer_outputs(system: FuzzySystem, firing: Floats, clipped: Floats) -> list[OutputInference]:
    """Infer the outputs of a valid system, one after the other: formulas take those before their own.

    Parameters
    ----------
    system : FuzzySystem
    firing : (num_rules,)
        Firing strengths, before weights; of interval type-2 systems (2 num_rules,), all lower ones first.
    clipped : (num_inputs,)
        Inputs, inside the universes.
    """
    if has_intervals(system):
        return _interval_outputs(system, firing, clipped)
    values = {variable.name: x for variable, x in zip(system.inputs, clipped, strict=True)}
    outputs = []
    for variable in system.outputs:
        outputs.append(_infer_output(system, variable, firing, values))
        values[variable.name] = np.float64(outputs[-1].value)
    return outputs


def _infer_output(system: FuzzySystem, variable: Variable, firing: Floats, values: Values) -> OutputInference:
    """Infer one output from the firing strengths, keeping every step."""
    if system.weighs(variable):
        return _weigh(system, variable, firing, values)
    cuts = _cut_terms(system, variable, firing)
    if system.is_sampled:
        universe = system.points_of(variable)
        aggregated = _conclude_by_rule(system, variable, firing)
    elif system.cuts(variable):
        universe, aggregated = _aggregate(variable, cuts)
    else:
        universe, aggregated = variable.universe, _conclude_by_rule(system, variable, firing)
    is_default = bool(aggregated.sum() == 0.0)
    if is_default:
        value = _default(system, variable)
    elif system.is_sampled:
        value = defuzzify_sampled(system, variable, universe, aggregated)
        if np.isnan(value):
            value, is_default = _default(system, variable), True
    else:
        value = DEFUZZIFIERS[system.defuzzifier_of(variable)](universe, aggregated)
    return OutputInference(variable, cuts, universe, aggregated, value, is_default)


def _default(system: FuzzySystem, variable: Variable) -> float:
    """Return an output where no rule fires."""
    if variable.default is None:
        return np.nan if TOOLS[system.semantics].has_outputs_without_default else 0.0
    return variable.default


def _weigh(system: FuzzySystem, variable: Variable, firing: Floats, values: Values) -> OutputInference:
    """Weight each rule's conclusion by its strength, one after the other."""
    is_sum = system.defuzzifier_of(variable) == "weighted_sum"
    conclusions, total, moment, scale = [], 0.0, 0.0, 1.0 if is_sum else RAISED_WEIGHT
    joined: dict[
        float, float
    ] = {}  # strengths by the number, where a program joins rules that conclude the same
    cuts = np.full(len(variable.terms), np.nan)
    for index, consequent in system.conclusions_on(variable):
        term = variable.term_index(consequent.term)
        strength, number = float(firing[index] * consequent.weight), np.nan
        if strength > 0.0:
            number = _concluded(system, variable, term, strength, values)
            if system.joins_numbers(variable):
                accumulate: Any = ACCUMULATIONS[variable.accumulation]
                joined[number] = accumulate(joined[number], strength) if number in joined else strength
            else:
                total, moment = total + strength * scale, moment + strength * scale * number
        conclusions.append((index, strength, number))
        cuts[term] = strength if np.isnan(cuts[term]) else cuts[term] + strength
    for number in sorted(joined):
        total, moment = total + joined[number] * scale, moment + joined[number] * scale * number
    rules, strengths, numbers = zip(*conclusions, strict=True) if conclusions else ((), (), ())
    value = _default(system, variable)
    if total > 0.0:
        value = moment if is_sum else moment / total
    weighing = WeightedConclusions(np.array(rules, dtype=np.int64), np.array(strengths), np.array(numbers))
    return OutputInference(variable, cuts, np.empty(0), np.empty(0), value, total == 0.0, weighing)


def _concluded(system: FuzzySystem, variable: Variable, term: int, strength: float, values: Values) -> float:
    """Return the number that a rule of positive strength concludes.

    A sigmoid never reaches one; at a strength of one its rule concludes the end of the range.
    """
    shape = variable.terms[term].membership
    if isinstance(shape, model.Formula):
        return float(shape.value(values))
    if isinstance(shape, model.Number):
        *coefficients, number = shape.row(len(system.inputs))
        for coefficient, each in zip(coefficients, system.inputs, strict=True):
            if coefficient != 0.0:  # an input that does not count may be infinite
                number += coefficient * values[each.name]
        return float(number)
    assert isinstance(shape, model.MonotoneFunction)  # noqa: S101 - others are rejected by validation
    number = float(shape.inverse(np.array(min(strength, 1.0))))
    if np.isinf(number):
        return variable.maximum if number > 0.0 else variable.minimum
    return number


def _cut_terms(system: FuzzySystem, variable: Variable, firing: Floats) -> Floats:
    """Return the height at which each term of an output is cut; NaN for terms that no rule concludes."""
    accumulate = ACCUMULATIONS[variable.accumulation]
    cuts = np.full(len(variable.terms), np.nan)
    for number, consequent in system.conclusions_on(variable):
        index = variable.term_index(consequent.term)
        activation = firing[number] * consequent.weight
        is_first = np.isnan(cuts[index])
        cuts[index] = activation if is_first else accumulate(activation, cuts[index])
    return cuts


def _aggregate(variable: Variable, cuts: Floats) -> tuple[Floats, Floats]:
    """Return the universe with the crossings of terms and cuts, and the heights of the aggregated set."""
    grid = variable.universe
    concluded = [(cut, mf) for cut, mf in zip(cuts, variable.memberships, strict=True) if not np.isnan(cut)]
    inserted = [crossings(grid, mf, cut) for cut, mf in concluded]
    universe = np.union1d(grid, np.concatenate([np.empty(0), *inserted]))
    aggregated = np.zeros(len(universe))
    for cut, mf in concluded:
        clipped = np.minimum(cut, np.interp(universe, grid, mf, left=0.0, right=0.0))
        aggregated = np.maximum(aggregated, clipped)
    return universe, aggregated


def _conclude_by_rule(system: FuzzySystem, variable: Variable, firing: Floats) -> Floats:
    """Aggregate each rule's implied set, one after the other, at the points of the universe."""
    imply, aggregate = AND_OPERATORS[system.implication], AGGREGATIONS[variable.aggregation]
    points = system.points_of(variable)
    aggregated = np.zeros(len(points))
    for index, consequent in system.conclusions_on(variable):
        term = variable.terms[variable.term_index(consequent.term)]
        shape = memberships_at(variable, term, points)
        activation = np.full(len(shape), firing[index] * consequent.weight)
        aggregated = aggregate(aggregated, imply(activation, shape))
    return aggregated
