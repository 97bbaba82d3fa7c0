"""Any fuzzy system as numbers, in flat arrays, for `fis_tools.engines.interpreter` to run."""

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from fis_tools import model
from fis_tools.array_types import Floats, Integers
from fis_tools.compiled.vectors import ROW
from fis_tools.engines.codes import (
    DEFUZZIFIERS,
    FORMULA,
    INVERTED,
    MAX,
    MIN,
    NOT,
    NUMBER,
    OPERATORS,
    POLYGON,
    SAMPLING,
)
from fis_tools.engines.degrees import Shapes, shapes_of
from fis_tools.engines.packing import ranks_of
from fis_tools.model.intervals import has_intervals, twin


class Antecedents(NamedTuple):
    """Inputs and rules up to their firing strengths.

    Attributes
    ----------
    inputs : (num_inputs, 4) int
        One row per input: number of terms, number of points, start of its points in `universes` and of its
        memberships in `memberships`.
    universes : (u,) float
        The points of each input.
    memberships : (m,) float
        For each point of each input the memberships of all its terms, then their slopes to the next point;
        at the end as many zeros as `gather_rows` may read beyond.
    steps : (num_steps, 3) int
        Operator, left slot, right slot. Slots are numbered consecutively: first the memberships
        of all inputs, then the result of each step.
    rule_slots : (num_rules,) int
        Slot of each rule's firing strength.
    limits : (num_inputs, 2) float
        The numbers to which each input is clipped.
    shapes : Shapes
        The formulas of all terms, where inputs are not clipped; otherwise without rows.
    """

    inputs: Integers
    universes: Floats
    memberships: Floats
    steps: Integers
    rule_slots: Integers
    limits: Floats
    shapes: Shapes


class Conclusion(NamedTuple):
    """One output, computed from firing strengths, with the terms that rules conclude.

    Attributes
    ----------
    universe : (num_points,) float
        Its points.
    memberships : (num_terms, num_points) float
        The sampled membership functions.
    rules : (c,) int
        The rules that conclude each term, in order.
    weights : (c,) float
        Factors of their firing strengths.
    defuzzifier : int
        Of `DEFUZZIFIERS`.
    default : float
        The output where no rule fires; NaN if none is declared.
    bounds : (num_terms + 1,) int
        Start of the rules of each term in `rules` and `weights`.
    runs : (r, 3) int
        Term, first and last point of each stretch in which a membership function is monotone,
        so that a cut crosses it there at most once.
    accumulation : int
        Of `OPERATORS`.
    terms : (c,) int
        The term that each of `rules` concludes.
    implication, aggregation : int
        Of `OPERATORS`. Unless they are MIN and MAX, each rule counts separately: then `rules`, `weights`
        and `terms` are in the order of the rules, and `bounds` and `runs` are not used.
    sampling : int
        Of `SAMPLING`: POLYGON, or how sums over the points become a number.
    """

    universe: Floats
    memberships: Floats
    rules: Integers
    weights: Floats
    defuzzifier: int
    default: float
    bounds: Integers
    runs: Integers
    accumulation: int
    terms: Integers
    implication: int
    aggregation: int
    sampling: int

    @property
    def cuts(self) -> bool:
        """Whether terms are cut and aggregated by the maximum."""
        return self.implication == MIN and self.aggregation == MAX


class Summation(NamedTuple):
    """One output that is a sum over points, for many samples side by side.

    Attributes
    ----------
    universe, memberships, rules, weights, terms, bounds
        Those of a `Conclusion`.
    defuzzifier, default, implication, aggregation, sampling
        Likewise.
    peaks : (num_terms,) float
        The greatest membership of each term.
    ranks : (num_pieces, num_terms) int
        The terms in each piece of the points, the highest first.
    ends : (num_pieces, num_terms, 2) float
        In this order, the greatest and the least membership of each there.
    """

    universe: Floats
    memberships: Floats
    rules: Integers
    weights: Floats
    terms: Integers
    bounds: Integers
    defuzzifier: int
    default: float
    implication: int
    aggregation: int
    sampling: int
    peaks: Floats
    ranks: Integers
    ends: Floats


class Weighing(NamedTuple):
    """One weighted output, computed from firing strengths.

    Attributes
    ----------
    rules : (c,) int
        The rules that conclude on it, in order.
    weights : (c,) float
        Factors of their firing strengths.
    parameters : (c, max(num_inputs + 1, 2)) float
        For a number the factor of each input, then the constant; for a shape its parameters.
    is_constant : bool
        Whether all numbers are the same for all inputs.
    defuzzifier : int
        WEIGHTED_AVERAGE or WEIGHTED_SUM.
    default : float
        The output where no rule fires; NaN if none is declared.
    kinds : (c,) int
        Kind of each conclusion: NUMBER, or the index of one of `INVERTED`.
    low, high : float
        The ends of the range.
    accumulation : int
        Of `OPERATORS`: how the strengths of rules that conclude the same number combine.
    formulas : tuple of Formula
        Those that rules conclude.
    names : tuple of str
        Names in formulas of the inputs, then of the outputs before this one.
    """

    rules: Integers
    weights: Floats
    parameters: Floats
    is_constant: bool
    defuzzifier: int
    default: float
    kinds: Integers
    low: float
    high: float
    accumulation: int
    formulas: tuple[model.Formula, ...]
    names: tuple[str, ...]


class IntervalOutput(NamedTuple):
    """One output of an interval type-2 system: what its lower and its upper rules conclude.

    Attributes
    ----------
    lower, upper : Conclusion or Weighing
        For strengths of rules of which the first half are lower ones.
    is_mean : bool
        Whether the type reduction is Nie and Tan's rather than Karnik and Mendel's.
    """

    lower: Conclusion | Weighing
    upper: Conclusion | Weighing
    is_mean: bool


@dataclass(frozen=True)
class Program:
    """A fuzzy system as numbers.

    Parameters
    ----------
    antecedents : Antecedents
    conclusions : tuple of Conclusion, Weighing or IntervalOutput
        One for each output.
    """

    antecedents: Antecedents
    conclusions: tuple[Conclusion | Weighing | IntervalOutput, ...]

    @property
    def is_sampled(self) -> bool:
        """Whether memberships are formulas of inputs that are not clipped."""
        return len(self.antecedents.shapes.kinds) > 0

    @property
    def limits(self) -> Floats:
        """The numbers to which each input is clipped, (num_inputs, 2)."""
        return self.antecedents.limits

    @cached_property
    def summations(self) -> tuple[Summation | None, ...]:
        """The outputs that are sums over points; None for others."""
        return tuple(
            summation(c) if isinstance(c, Conclusion) and c.sampling != POLYGON else None
            for c in self.conclusions
        )

    @property
    def only_summation(self) -> Summation | None:
        """The one output, if it is a sum over points."""
        return self.summations[0] if len(self.summations) == 1 else None

    @property
    def num_rules(self) -> int:
        """Number of rules."""
        return len(self.antecedents.rule_slots)

    @property
    def asks_for_inputs(self) -> bool:
        """Whether a rule concludes a number that depends on the inputs."""
        parts = (c.upper if isinstance(c, IntervalOutput) else c for c in self.conclusions)
        return any(
            bool(c.formulas)
            or bool((c.parameters[c.kinds == NUMBER, : len(self.antecedents.inputs)] != 0.0).any())
            for c in parts
            if isinstance(c, Weighing)
        )


#: From this many rules on a surface takes seconds in plain Python, and numba is advised.
MANY_RULES = 20


def assemble(system: model.FuzzySystem) -> Program:
    """Return a valid system as a program."""
    if not has_intervals(system):
        return Program(_antecedents(system), _concluded(system))
    bounds = twin(system)
    lower, upper = _concluded(bounds)[::2], _concluded(bounds)[1::2]
    is_mean = system.type_reduction == "nie-tan"
    pairs = (IntervalOutput(*pair, is_mean) for pair in zip(lower, upper, strict=True))
    return Program(_antecedents(bounds), tuple(pairs))


def _concluded(system: model.FuzzySystem) -> tuple[Conclusion | Weighing, ...]:
    """Translate every output to arrays."""
    return tuple(
        _weighing(system, output) if system.weighs(output) else _conclusion(system, output)
        for output in system.outputs
    )


def _antecedents(system: model.FuzzySystem) -> Antecedents:
    """Translate the inputs and the antecedents of all rules to arrays."""
    rows = [_memberships_with_slopes(variable) for variable in system.inputs]
    points = [variable.num_points for variable in system.inputs]
    table = [
        [len(variable.terms) for variable in system.inputs],
        points,
        np.cumsum([0, *points[:-1]]),
        np.cumsum([0, *(len(row) for row in rows[:-1])]),
    ]
    steps, rule_slots = _steps(system)
    return Antecedents(
        inputs=np.array(table, dtype=np.int64).T.copy(),
        universes=np.concatenate([variable.universe for variable in system.inputs]),
        memberships=np.concatenate([*rows, np.zeros(ROW)]),
        steps=np.array(steps, dtype=np.int64).reshape(-1, 3),
        rule_slots=np.array(rule_slots, dtype=np.int64),
        limits=np.array([system.limits_of(variable) for variable in system.inputs]),
        shapes=shapes_of(system.inputs if system.is_sampled else ()),
    )


def _memberships_with_slopes(variable: model.Variable) -> Floats:
    """Return memberships and slopes at the points of a universe, as a flat table."""
    sampled = variable.memberships
    slopes = np.zeros_like(sampled)  # constant beyond the last point
    slopes[:, :-1] = np.diff(sampled) / np.diff(variable.universe)
    return np.concatenate([sampled, slopes]).T.ravel()


def _steps(system: model.FuzzySystem) -> tuple[list[tuple[int, int, int]], list[int]]:
    """Translate the antecedents; common parts of several rules are computed once."""
    terms = [(variable.name, term.name) for variable in system.inputs for term in variable.terms]
    slots = {term: slot for slot, term in enumerate(terms)}
    steps: dict[tuple[int, int, int], int] = {}

    def slot_of(expression: model.Expression, rule: model.Rule) -> int:
        """Return the slot of a part's degrees, and add the steps that compute them."""
        match expression:
            case model.Is(variable, term):
                return slots[variable, term]
            case model.Not(operand):
                slot = slot_of(operand, rule)
                return step(NOT, slot, slot)
            case model.Hedged(hedge, operand):
                slot = slot_of(operand, rule)
                return step(OPERATORS[hedge], slot, slot)
            case model.And(operands):
                operator = OPERATORS[system.and_operator_of(rule)]
            case model.Or(operands):
                operator = OPERATORS[system.or_operator_of(rule)]
        left, *others = (slot_of(operand, rule) for operand in operands)
        for right in others:
            left = step(operator, left, right)
        return left

    def step(operator: int, left: int, right: int) -> int:
        return steps.setdefault((operator, left, right), len(slots) + len(steps))

    rule_slots = [slot_of(rule.antecedent, rule) for rule in system.rules]
    return list(steps), rule_slots


def _memberships_at(output: model.Variable, points: Floats) -> Floats:
    """Return the memberships of an output's terms at points, (num_terms, num_points)."""
    if np.array_equal(points, output.universe):
        return output.memberships
    return np.stack([model.memberships_at(output, term, points) for term in output.terms])


def _conclusion(system: model.FuzzySystem, output: model.Variable) -> Conclusion:
    """Translate an output whose rules conclude fuzzy sets to arrays."""
    concluded = [
        (output.term_index(consequent.term), rule, consequent.weight)
        for rule, consequent in system.conclusions_on(output)
    ]
    terms = sorted({term for term, _, _ in concluded})
    if system.cuts(output):
        concluded.sort(key=lambda each: each[0])
    rows = np.searchsorted(terms, [term for term, _, _ in concluded])
    points = system.points_of(output)
    memberships = _memberships_at(output, points)[terms]
    runs = [(term, *run) for term, sampled in enumerate(memberships) for run in _runs(sampled)]
    return Conclusion(
        universe=points,
        memberships=memberships,
        bounds=np.cumsum([0, *np.bincount(rows, minlength=len(terms))]),
        rules=np.array([index for _, index, _ in concluded], dtype=np.int64),
        weights=np.array([weight for _, _, weight in concluded], dtype=np.float64),
        runs=np.array(runs, dtype=np.int64).reshape(-1, 3),
        accumulation=OPERATORS[output.accumulation],
        defuzzifier=DEFUZZIFIERS[system.defuzzifier_of(output)],
        default=np.nan if output.default is None else output.default,
        terms=rows.astype(np.int64),
        implication=OPERATORS[system.implication],
        aggregation=OPERATORS[output.aggregation],
        sampling=SAMPLING[system.semantics],
    )


def summation(conclusion: Conclusion) -> Summation:
    """Return an output that is a sum over points, for many samples side by side."""
    ranks, ends = ranks_of(conclusion.memberships[np.newaxis])
    shared = {name: getattr(conclusion, name) for name in Summation._fields if name in conclusion._fields}
    return Summation(**shared, peaks=conclusion.memberships.max(axis=1), ranks=ranks[0], ends=ends[0])


def _weighing(system: model.FuzzySystem, output: model.Variable) -> Weighing:
    """Translate an output whose rules conclude numbers to arrays."""
    concluded = [
        (rule, consequent.weight, output.terms[output.term_index(consequent.term)].membership)
        for rule, consequent in system.conclusions_on(output)
    ]
    accumulation = output.accumulation if system.joins_numbers(output) else "unbounded_sum"
    before = system.outputs[: system.outputs.index(output)]
    parameters = np.zeros((len(concluded), max(len(system.inputs) + 1, 2)))
    kinds = np.full(len(concluded), NUMBER)
    formulas = [shape for _, _, shape in concluded if isinstance(shape, model.Formula)]
    row: tuple[float, ...]
    for index, (_, _, shape) in enumerate(concluded):
        if isinstance(shape, model.Formula):
            kinds[index], row = FORMULA, (float(formulas.index(shape)),)
        elif isinstance(shape, model.Number):
            row = shape.row(len(system.inputs))
        else:
            kinds[index] = next(code for code, kind in enumerate(INVERTED) if type(shape) is kind)
            row = tuple(getattr(shape, name) for name in shape.entry.kinds)
        parameters[index, : len(row)] = row
    return Weighing(
        rules=np.array([index for index, _, _ in concluded], dtype=np.int64),
        weights=np.array([weight for _, weight, _ in concluded], dtype=np.float64),
        kinds=kinds,
        parameters=parameters,
        is_constant=all(isinstance(shape, model.Constant) for _, _, shape in concluded),
        low=float(output.minimum),
        high=float(output.maximum),
        accumulation=OPERATORS[accumulation],
        defuzzifier=DEFUZZIFIERS[system.defuzzifier_of(output)],
        default=np.nan if output.default is None else output.default,
        formulas=tuple(formulas),
        names=tuple(v.name for v in (*system.inputs, *before)) if formulas else (),
    )


def _runs(sampled: Floats) -> list[tuple[int, int]]:
    """Split a sampled function into monotone runs; flat stretches belong to the run before them."""
    bounds, direction = [0], 0.0
    for point, step in enumerate(np.sign(np.diff(sampled))):
        if step * direction < 0.0:
            bounds.append(point)
        direction = step or direction
    bounds.append(len(sampled) - 1)
    return list(pairwise(bounds))
