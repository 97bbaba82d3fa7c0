"""Interpretability indices of a fuzzy system: completeness, complexity, consistency of rules.

Each index is given with the formula that is used, because papers leave cases open. Areas and crossings are
exact for memberships that are linear between the points of their universe.
"""

from collections import defaultdict
from dataclasses import dataclass, replace
from itertools import product
from math import prod

import numpy as np

from fis_tools import model
from fis_tools.analysis.arrays import Coverage, coverage, crossings, evaluate, firing, spread_inputs
from fis_tools.array_types import Floats, Integers
from fis_tools.engines.interpreter import conclude
from fis_tools.engines.program import assemble
from fis_tools.model.expressions import parts_of

#: A grid of more points than this is replaced by samples.
MOST_POINTS = 50_000


@dataclass(frozen=True)
class Complexity:
    """The size of a rule base: rules, premises and terms.

    Parameters
    ----------
    rules, premises : int
        Rules, and the statements ``variable is term`` in all their antecedents.
    input_terms, output_terms : int
        Terms of all inputs, and of all outputs.
    """

    rules: int
    premises: int
    input_terms: int
    output_terms: int


@dataclass(frozen=True)
class Completeness:
    """The input at which the strongest rule is weakest, and its firing strength.

    Parameters
    ----------
    least : float
        0 if somewhere no rule fires.
    at : (num_inputs,)
        An input at which it occurs.
    is_exact : bool
        Whether `least` holds for the whole box of the universes, or is only the least of samples of it.
    """

    least: float
    at: Floats
    is_exact: bool


@dataclass(frozen=True)
class RuleConsistency:
    """How far the system's output agrees with each rule where the rule fires most strongly.

    Parameters
    ----------
    points : (num_rules, num_inputs)
        An input at which the rule fires most strongly; of several, the one where the answer suits it best.
    outputs : (num_rules, num_outputs)
        What the whole system answers there.
    alone : (num_rules, num_outputs)
        What the rule would answer there if it were the only one; NaN for an output it says nothing on.
    values : (num_rules,)
        From 0 (the answer is nothing like the consequent) to 1 (it is as much like it as the rule's own); NaN
        of a rule whose outputs have no value.
    """

    points: Floats
    outputs: Floats
    alone: Floats
    values: Floats

    @property
    def index(self) -> float:
        """The lowest value of all rules; NaN if none has one."""
        return float(np.fmin.reduce(self.values))


@dataclass(frozen=True)
class Measures:
    """All indices of one system.

    Parameters
    ----------
    complexity : Complexity
    coverage : dict of str to Coverage
        By variable.
    completeness : Completeness
    rule_consistency : RuleConsistency
    """

    complexity: Complexity
    coverage: dict[str, Coverage]
    completeness: Completeness
    rule_consistency: RuleConsistency


def measure(system: model.FuzzySystem) -> Measures:
    """Compute every index of a valid system; weighted outputs have no terms to measure."""
    variables = [v for v in system.variables if v not in system.weighed]
    covered = {variable.name: coverage(variable) for variable in variables}
    return Measures(complexity(system), covered, completeness(system), rule_consistency(system))


def complexity(system: model.FuzzySystem) -> Complexity:
    """Count rules, premises and terms."""
    premises = sum(1 for rule in system.rules for _ in model.statements_of(rule.antecedent))
    terms = [sum(len(variable.terms) for variable in side) for side in (system.inputs, system.outputs)]
    return Complexity(len(system.rules), premises, *terms)


def centre(variable: model.Variable, term: model.Term) -> float:
    """Return the centre of a term: its peak, or the middle of its core.

    Of a shape without a stated peak it is the middle between the first and the last of its highest points.
    """
    match term.membership:
        case model.Gaussian(mean, _):
            return mean
        case model.Constant(value):
            return value
        case model.Triangular(_, peak, _):
            return peak
        case model.Trapezoidal(_, left_top, right_top, _):
            return 0.5 * (left_top + right_top)
        case _:
            values = model.sample(variable, term)
            highest = np.flatnonzero(values == values.max())
            return float(0.5 * (variable.universe[highest[0]] + variable.universe[highest[-1]]))


def rule_consistency(system: model.FuzzySystem) -> RuleConsistency:
    """Compare the system's output where each rule fires most strongly with the rule's consequent.

    A rule holds most at one or several points of a grid: the centres of each input's terms, and where the
    input is covered least, which suits rules that do not ask for it. At each such point y is what the system
    answers and y₁ what this rule alone would; ``min(1, mu(y) / mu(y₁))`` with mu the membership of its
    consequent tells how much it is meant. The least over its consequents counts, and of several points the
    one that suits it best. Dividing by ``mu(y₁)`` is for terms at the ends of a range, whose centre of area
    is not where they are highest. Where an output is weighed, 1 less the distance from y to y₁ in parts of
    its range counts instead.

    This index is our own. Its idea, to ask the whole system in the core of each antecedent and to let the
    worst rule count, is that of the rule meaning index (RMI) of M. Galende, M. J. Gacto, G. Sainz, R. Alcalá,
    Information Sciences 282 (2014) 190-213, to whose numbers these do not compare.
    """
    grid = _grid([_landmarks(variable) for variable in system.inputs])
    if grid is None:
        grid = spread_inputs(system)
    strengths, answers = firing(system, grid), evaluate(system, grid)
    is_valued = ~np.isnan(answers).all(axis=0)
    has_value = ~np.isnan(answers[:, is_valued]).any(axis=1)  # a formula may have none
    if not (is_valued.any() and has_value.any()):
        count = len(system.rules)
        no_input, no_output = (
            np.full((count, len(ends)), np.nan) for ends in (system.inputs, system.outputs)
        )
        return RuleConsistency(no_input, no_output, no_output, np.full(count, np.nan))
    grid, strengths, answers = grid[has_value], strengths[has_value], answers[has_value]
    highest = strengths.max(axis=0)
    is_highest = strengths >= highest - 1e-9
    alone = _alone(system, strengths, grid, is_highest.argmax(axis=0))
    best, values = [], []
    for number, rule_answers in enumerate(alone):
        indices = np.flatnonzero(is_highest[:, number])
        meant = _meanings(system, number, answers[indices], rule_answers)
        best.append(indices[np.argmax(meant)])
        values.append(np.fmax.reduce(meant) if highest[number] > 0 else 0.0)
    return RuleConsistency(grid[best], answers[best], alone, np.array(values))


def _landmarks(variable: model.Variable) -> Floats:
    """Return an input's landmarks: the centres of its terms, and the value that they cover least."""
    centres = [centre(variable, term) for term in variable.terms]
    return np.unique(np.clip([*centres, coverage(variable).at], variable.minimum, variable.maximum))


def _grid(axes: list[Floats]) -> Floats | None:
    """Return every combination of the values of some axes, (n, num_axes); None for too many."""
    if prod(len(axis) for axis in axes) > MOST_POINTS:
        return None
    return np.array(list(product(*axes)), dtype=np.float64)


def _alone(system: model.FuzzySystem, strengths: Floats, grid: Floats, indices: Integers) -> Floats:
    """Return each rule's outputs alone, at its point of a grid; NaN for outputs it does not conclude."""
    alone = np.full((len(system.rules), len(system.outputs)), np.nan)
    alike = defaultdict(list)
    for number, rule in enumerate(system.rules):
        alike[rule.consequents].append(number)
    for consequents, rules in alike.items():
        program = assemble(replace(system, rules=(system.rules[rules[0]],)))
        at, says = (
            indices[rules],
            np.isin([v.name for v in system.outputs], [c.variable for c in consequents]),
        )
        answers = conclude(program, strengths[at, rules][:, np.newaxis], grid[at])
        alone[rules] = np.where(says, answers, np.nan)
    return alone


def _meanings(system: model.FuzzySystem, number: int, answers: Floats, rule_answers: Floats) -> Floats:
    """Return how far outputs, (n, num_outputs), agree with a rule's consequents, from 0 to 1, (n,).

    NaN where none of these outputs has a value.
    """
    meant = np.full(len(answers), np.nan)
    names = [variable.name for variable in system.outputs]
    for consequent in system.rules[number].consequents:
        index = names.index(consequent.variable)
        variable = system.outputs[index]
        if system.weighs(variable):
            with np.errstate(invalid="ignore"):  # equal, though infinite, is no deviation
                deviation = np.abs(answers[:, index] - rule_answers[index]) / variable.span
            deviation[answers[:, index] == rule_answers[index]] = 0.0
            meant = np.fmin(meant, np.clip(1.0 - deviation, 0.0, 1.0))
            continue
        function = variable.memberships[variable.term_index(consequent.term)]
        like, most = (
            np.interp(y, variable.universe, function) for y in (answers[:, index], rule_answers[index])
        )
        meant = np.fmin(meant, np.minimum(like / most if most > 0 else like, 1.0))
    return meant


def completeness(system: model.FuzzySystem) -> Completeness:
    """Find the input at which the strongest rule is weakest.

    Where every combination of terms has its rule, the strongest rule joins the highest memberships of the
    inputs, and is weakest where each input is covered worst. For any rules of min, max and not it is weakest
    on the grid of the points where a membership turns or two cross (each with complements), because between
    these points the memberships of one input only rise or only fall, and keep their order. Both are exact
    where memberships are straight between the points of a universe. For other rules, hedged ones among them,
    and where memberships are formulas, samples are taken as well, for too many points instead; what they find
    is exact only if it is 0.
    """
    is_straight = not system.is_sampled
    if is_straight and _has_every_combination(system):
        point = np.array([coverage(variable).at for variable in system.inputs])
        return Completeness(float(firing(system, point[np.newaxis]).max()), point, True)
    grid = _grid([_turning_points(variable) for variable in system.inputs])
    operators = {(system.and_operator_of(rule), system.or_operator_of(rule)) for rule in system.rules}
    parts = (part for rule in system.rules for part in parts_of(rule.antecedent))
    is_hedged = any(isinstance(part, model.Hedged) for part in parts)
    is_exact = grid is not None and is_straight and operators == {("min", "max")} and not is_hedged
    tried = [] if grid is None else [grid]
    points = np.concatenate(tried if is_exact else [*tried, spread_inputs(system)])
    strongest = firing(system, points).max(axis=1)
    worst = int(np.argmin(strongest))
    least = float(strongest[worst])
    return Completeness(least, points[worst], is_exact or least == 0.0)


def _has_every_combination(system: model.FuzzySystem) -> bool:
    """Return whether every combination of the inputs' terms has a rule."""
    table = model.conjunctions(system)
    if table is None or np.any(table[0] < 0):
        return False
    return len(np.unique(table[0], axis=0)) == prod(len(variable.terms) for variable in system.inputs)


def _turning_points(variable: model.Variable) -> Floats:
    """Return the ends of a universe, and where terms or their complements turn or cross in between."""
    x = variable.universe
    terms = variable.memberships
    functions = np.concatenate([terms, 1.0 - terms])
    turns = np.sign(np.diff(terms))
    candidates = [x[[0, -1]], x[1:-1][np.any(turns[:, 1:] != turns[:, :-1], axis=0)], crossings(x, functions)]
    for index, function in enumerate(functions):
        # where a function begins or ceases to equal another
        equal = np.pad(functions[index + 1 :] == function, ((0, 0), (1, 1)), constant_values=True)
        parting = equal[:, 1:-1] & ~(equal[:, :-2] & equal[:, 2:])
        candidates.append(x[np.any(parting, axis=0)])
    return np.unique(np.concatenate(candidates))
