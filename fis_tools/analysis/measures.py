"""Interpretability indices of a fuzzy system: completeness, complexity, integrity, consistency of rules.

Each index is given with the formula that is used, because papers leave cases open. Areas and crossings are
exact for memberships that are linear between the points of their universe.
"""

from dataclasses import dataclass, replace
from itertools import product
from math import prod

import numpy as np

from fis_tools import model
from fis_tools.analysis import arrays
from fis_tools.analysis.arrays import Coverage, coverage, crossings
from fis_tools.array_types import Floats
from fis_tools.engines.inference import infer
from fis_tools.model.validate import nearest
from fis_tools.model.variables import sample, sample_terms

#: A grid of more points than this is replaced by samples.
MOST_POINTS = 50_000
#: Half-width of a Gaussian at half its height, in standard deviations.
HALF_HEIGHT = float(np.sqrt(2.0 * np.log(2.0)))


@dataclass(frozen=True)
class Complexity:
    """How much there is to read in a rule base.

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
class Nauck:
    """Nauck's index of a rule base; every number lies in [0, 1], and higher is easier to read.

    Parameters
    ----------
    complexity : float
        Output terms over premises of all rules.
    coverage : float
        How nearly the memberships of an input sum to one, mean over its universe and over the inputs.
    partition : float
        1 / (terms - 1), mean over the inputs.
    """

    complexity: float
    coverage: float
    partition: float

    @property
    def index(self) -> float:
        """The product of the three."""
        return self.complexity * self.coverage * self.partition


@dataclass(frozen=True)
class Completeness:
    """Where the rules of a system cover the inputs worst: the lowest maximum firing strength, and its place.

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
class Integrity:
    """How close the terms of a variable are to those of a reference, (num_terms,); 1 is equal.

    Parameters
    ----------
    displacement : array
        1 less the way that the centre has moved, in halves of the way to the next one; 0 from there on.
    symmetry : array
        How near the ratio of the half-widths is to that of the reference.
    area : array
        How near the area is to that of the reference.
    """

    displacement: Floats
    symmetry: Floats
    area: Floats

    @property
    def gm3m(self) -> float:
        """The geometric mean of the worst of the three."""
        return float(np.cbrt(self.displacement.min() * self.symmetry.min() * self.area.min()))


@dataclass(frozen=True)
class RuleConsistency:
    """Whether the system does what each rule says, where the rule fires most strongly.

    Parameters
    ----------
    points : (num_rules, num_inputs)
        An input at which the rule fires most strongly; of several, the one where the answer suits it best.
    outputs : (num_rules, num_outputs)
        What the whole system answers there.
    alone : (num_rules, num_outputs)
        What the rule would answer there if it were the only one; NaN for an output it says nothing on.
    values : (num_rules,)
        From 0 (the answer is nothing like the consequent) to 1 (it is as much like it as the rule's own).
    """

    points: Floats
    outputs: Floats
    alone: Floats
    values: Floats

    @property
    def index(self) -> float:
        """The least of all rules."""
        return float(self.values.min())


@dataclass(frozen=True)
class Measures:
    """All indices of one system.

    Parameters
    ----------
    complexity : Complexity
    nauck : Nauck
    coverage : dict of str to Coverage
        By variable.
    completeness : Completeness
    integrity : dict of str to Integrity
        By variable; those of a single term are left out.
    reference : str
        What the terms are compared with.
    rule_consistency : RuleConsistency
    """

    complexity: Complexity
    nauck: Nauck
    coverage: dict[str, Coverage]
    completeness: Completeness
    integrity: dict[str, Integrity]
    reference: str
    rule_consistency: RuleConsistency

    @property
    def gm3m(self) -> float:
        """GM3M of the whole system: the geometric mean of the worst of the three over all its terms."""
        if not self.integrity:
            return 1.0
        parts = [(i.displacement.min(), i.symmetry.min(), i.area.min()) for i in self.integrity.values()]
        return float(np.cbrt(np.prod(np.min(parts, axis=0))))


def measure(system: model.FuzzySystem, reference: tuple[str, model.FuzzySystem] | None = None) -> Measures:
    """Compute every index of a system without problems; outputs that are weighed have no terms to measure.

    Terms are compared with those of another system, called as in the reference, or with an even partition.

    Raises
    ------
    ValueError
        If the reference lacks a variable or one of its terms.
    """
    variables = [v for v in (*system.inputs, *system.outputs) if v not in system.weighed]
    words, other = reference or ("an even partition", None)
    return Measures(
        complexity=complexity(system),
        nauck=nauck(system),
        coverage={variable.name: coverage(variable) for variable in variables},
        completeness=completeness(system),
        integrity={
            v.name: integrity(v, None if other is None else _same(v, other))
            for v in variables
            if len(v.terms) > 1
        },
        reference=words,
        rule_consistency=rule_consistency(system),
    )


def complexity(system: model.FuzzySystem) -> Complexity:
    """Count rules, premises and terms."""
    return Complexity(
        rules=len(system.rules),
        premises=sum(1 for rule in system.rules for _ in model.statements_of(rule.antecedent)),
        input_terms=sum(len(variable.terms) for variable in system.inputs),
        output_terms=sum(len(variable.terms) for variable in system.outputs),
    )


def nauck(system: model.FuzzySystem) -> Nauck:
    """Return Nauck's index.

    ``complexity = m / sum_r n_r`` with m output terms (the classes of a classifier) and n_r premises of rule
    r; ``coverage = mean_i mean_x c_i(x)`` with ``c = h`` where the memberships of input i sum to ``h <= 1``,
    and ``c = (p - h) / (p - 1)`` above, for p terms; ``partition = mean_i 1 / (p_i - 1)``, 1 for one term.

    Source: D. Nauck, Measuring interpretability in rule-based classification systems, FUZZ-IEEE 2003.
    """
    counted = complexity(system)
    return Nauck(
        complexity=min(1.0, counted.output_terms / counted.premises),
        coverage=float(np.mean([_evenness(variable) for variable in system.inputs])),
        partition=float(np.mean([1.0 / max(1, len(variable.terms) - 1) for variable in system.inputs])),
    )


def _evenness(variable: model.Variable) -> float:
    x = variable.universe
    total = sample_terms(variable).sum(axis=0)
    points = np.union1d(x, crossings(x, np.stack([total, np.ones_like(total)])))
    h = np.interp(points, x, total)
    num_terms = max(2, len(variable.terms))
    covered = np.where(h <= 1.0, h, (num_terms - h) / (num_terms - 1))
    return float(np.trapezoid(covered, points) / (x[-1] - x[0]))


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
            values = sample(variable, term)
            highest = np.flatnonzero(values == values.max())
            return float(0.5 * (variable.universe[highest[0]] + variable.universe[highest[-1]]))


def half_widths(variable: model.Variable, term: model.Term) -> tuple[float, float]:
    """Return the widths of a term to either side of its centre, at half its height."""
    match term.membership:
        case model.Gaussian(_, standard_deviation):
            return HALF_HEIGHT * standard_deviation, HALF_HEIGHT * standard_deviation
        case model.Triangular(left, peak, right):
            return 0.5 * (peak - left), 0.5 * (right - peak)
        case model.Trapezoidal(left, left_top, right_top, right):
            middle = 0.5 * (left_top + right_top)
            return middle - 0.5 * (left + left_top), 0.5 * (right_top + right) - middle
        case _:
            here, x, y = centre(variable, term), variable.universe, sample(variable, term)
            return here - _falls_to_half(x[::-1], y[::-1], here), _falls_to_half(x, y, here) - here


def _falls_to_half(x: Floats, y: Floats, start: float) -> float:
    """Return where a function first falls to half its height beyond `start`, along x, or where x ends."""
    half, forwards = 0.5 * y.max(), np.sign(x[-1] - x[0])
    low = np.flatnonzero((forwards * (x - start) > 0) & (y <= half))
    if not len(low):
        return float(x[-1])
    i = low[0]
    if i == 0 or y[i - 1] <= half:
        return float(x[i])
    return float(x[i - 1] + (x[i] - x[i - 1]) * (y[i - 1] - half) / (y[i - 1] - y[i]))


def integrity(variable: model.Variable, reference: model.Variable | None = None) -> Integrity:
    """Compare the terms of a variable with those of a reference, term by term in their order.

    With centre c, half-widths l and r, area A inside the universe, a hat for the reference, and s the way
    from ĉ to the next centre on the side of c: ``displacement = max(0, 1 - |c - ĉ| / (s / 2))``,
    ``symmetry = min(l r̂ / (r l̂), r l̂ / (l r̂))`` (1 for the outer terms, of which one side lies outside)
    and ``area = min(A, Â) / max(A, Â)``; GM3M is the geometric mean of the least of each. Half-widths are
    taken at half height, which any shape has; of a triangle they are to one another as its feet are. Where
    the ranges differ, places are compared in parts of the range.

    Source: M. J. Gacto, R. Alcalá, F. Herrera, IEEE Transactions on Fuzzy Systems 18 (2010) 515-531, for
    triangles. There the reference is the partition before tuning, which a tuned controller does not record;
    without it the terms are compared with `even` ones.

    Raises
    ------
    ValueError
        If the variable has a single term, which no partition has.
    """
    num_terms = len(variable.terms)
    if num_terms < 2:
        raise ValueError(f"variable {variable.name!r} has one term; compare those with two or more")
    centres, widths, areas = _placed(variable)
    meant, meant_widths, meant_areas = _placed(reference or even(variable))
    gaps = np.abs(np.diff(meant))
    room = np.where(centres < meant, np.append(gaps[0], gaps), np.append(gaps, gaps[-1])) / 2
    moved = np.abs(centres - meant)
    crossed = widths * meant_widths[:, ::-1]
    narrow, wide = crossed.min(axis=1), crossed.max(axis=1)
    symmetry = np.divide(narrow, wide, out=np.ones_like(wide), where=wide > 0)
    small, large = np.minimum(areas, meant_areas), np.maximum(areas, meant_areas)
    symmetry[[0, -1]] = 1.0
    return Integrity(
        displacement=1.0 - np.minimum(np.divide(moved, room, out=np.sign(moved), where=room > 0), 1.0),
        symmetry=np.clip(symmetry, 0.0, 1.0),
        # terms between the points of a coarse universe have no area
        area=np.divide(small, large, out=np.ones_like(large), where=large > 0),
    )


def even(variable: model.Variable) -> model.Variable:
    """Return a variable with triangles of even spacing, each falling to zero where its neighbours peak."""
    peaks = np.linspace(variable.minimum, variable.maximum, len(variable.terms))
    feet = np.concatenate([peaks[:1], peaks, peaks[-1:]]).tolist()
    shapes = (model.Triangular(*feet[place : place + 3]) for place in range(len(peaks)))
    terms = (replace(term, membership=shape) for term, shape in zip(variable.terms, shapes, strict=True))
    return replace(variable, terms=tuple(terms))


def _placed(variable: model.Variable) -> tuple[Floats, Floats, Floats]:
    """Return centres, half-widths (num_terms, 2) and areas of terms, in parts of the range."""
    span = variable.maximum - variable.minimum
    centres = np.array([centre(variable, term) for term in variable.terms])
    widths = np.array([half_widths(variable, term) for term in variable.terms])
    areas: Floats = np.asarray(np.trapezoid(sample_terms(variable), variable.universe))
    return (centres - variable.minimum) / span, widths / span, areas / span


def _same(variable: model.Variable, reference: model.FuzzySystem) -> model.Variable:
    """Return the variable of the same name in a reference, its terms in the same order."""
    others = {other.name: other for other in (*reference.inputs, *reference.outputs)}
    if variable.name not in others:
        raise ValueError(
            f"the reference {reference.name!r} has no variable {variable.name!r}; "
            f"{nearest(variable.name, others)}"
        )
    terms = {term.name: term for term in others[variable.name].terms}
    for term in variable.terms:
        if term.name not in terms:
            raise ValueError(
                f"{variable.name} has no term {term.name!r} in the reference; {nearest(term.name, terms)}"
            )
    return replace(others[variable.name], terms=tuple(terms[term.name] for term in variable.terms))


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
        grid = arrays.spread_inputs(system)
    strengths, answers = arrays.firing(system, grid), arrays.evaluate(system, grid)
    has_value = ~np.isnan(answers).any(axis=1)  # a formula may have none
    grid, strengths, answers = grid[has_value], strengths[has_value], answers[has_value]
    points, outputs, alone, values = [], [], [], []
    for number in range(len(system.rules)):
        firing = strengths[:, number]
        places = np.flatnonzero(firing >= firing.max() - 1e-9)
        own = _alone(system, number, grid[places[0]])
        meant = _meanings(system, number, answers[places], own)
        best = int(np.argmax(meant))
        points.append(grid[places[best]])
        outputs.append(answers[places[best]])
        alone.append(own)
        values.append(meant[best] if firing.max() > 0 else 0.0)
    return RuleConsistency(np.array(points), np.array(outputs), np.array(alone), np.array(values))


def _landmarks(variable: model.Variable) -> Floats:
    """Return where its terms hold most, and where all of them together hold least."""
    centres = [centre(variable, term) for term in variable.terms]
    return np.unique(np.clip([*centres, coverage(variable).at], variable.minimum, variable.maximum))


def _grid(axes: list[Floats]) -> Floats | None:
    """Return every combination of the values of some axes, (n, num_axes); None for too many."""
    if prod(len(axis) for axis in axes) > MOST_POINTS:
        return None
    return np.array(list(product(*axes)), dtype=np.float64)


def _alone(system: model.FuzzySystem, number: int, point: Floats) -> Floats:
    rule = system.rules[number]
    concluded = [consequent.variable for consequent in rule.consequents]
    values = infer(replace(system, rules=(rule,)), point).values
    return np.where([variable.name in concluded for variable in system.outputs], values, np.nan)


def _meanings(system: model.FuzzySystem, number: int, answers: Floats, own: Floats) -> Floats:
    """Return how much answers (n, num_outputs) are like what a rule concludes, shape (n,)."""
    meant = np.ones(len(answers))
    names = [variable.name for variable in system.outputs]
    for consequent in system.rules[number].consequents:
        place = names.index(consequent.variable)
        variable = system.outputs[place]
        if system.weighs(variable):
            off = np.abs(answers[:, place] - own[place]) / (variable.maximum - variable.minimum)
            meant = np.minimum(meant, np.clip(1.0 - off, 0.0, 1.0))
            continue
        function = sample(variable, variable.terms[variable.term_index(consequent.term)])
        like, most = (np.interp(y, variable.universe, function) for y in (answers[:, place], own[place]))
        meant = np.minimum(meant, like / most if most > 0 else like)
    return meant


def completeness(system: model.FuzzySystem) -> Completeness:
    """Find the input at which the strongest rule is weakest.

    Where every combination of terms has its rule, the strongest rule joins the highest memberships of the
    inputs, and is weakest where each input is covered worst. For any rules of min, max and not it is weakest
    on the grid of the points where a membership turns or two cross (each with complements), because between
    these points the memberships of one input only rise or only fall, and keep their order. Both are exact.
    For other rules samples are taken as well, for too many points instead; what they find is exact only if it
    is 0.
    """
    if _has_every_combination(system):
        place = np.array([coverage(variable).at for variable in system.inputs])
        return Completeness(float(arrays.firing(system, place[np.newaxis]).max()), place, True)
    grid = _grid([_turning_points(variable) for variable in system.inputs])
    operators = {(system.and_operator_of(rule), system.or_operator_of(rule)) for rule in system.rules}
    is_exact = grid is not None and operators == {("min", "max")}
    tried = [] if grid is None else [grid]
    points = np.concatenate(tried if is_exact else [*tried, arrays.spread_inputs(system)])
    strongest = arrays.firing(system, points).max(axis=1)
    worst = int(np.argmin(strongest))
    least = float(strongest[worst])
    return Completeness(least, points[worst], is_exact or least == 0.0)


def _has_every_combination(system: model.FuzzySystem) -> bool:
    found = model.conjunctions(system)
    if found is None or np.any(found[0] < 0):
        return False
    return len(np.unique(found[0], axis=0)) == prod(len(variable.terms) for variable in system.inputs)


def _turning_points(variable: model.Variable) -> Floats:
    """Return the ends of a universe, and where terms or their complements turn or cross in between."""
    x = variable.universe
    terms = sample_terms(variable)
    functions = np.concatenate([terms, 1.0 - terms])
    turns = np.sign(np.diff(terms))
    found = [x[[0, -1]], x[1:-1][np.any(turns[:, 1:] != turns[:, :-1], axis=0)], crossings(x, functions)]
    for index, function in enumerate(functions):
        equal = np.pad(functions[index + 1 :] == function, ((0, 0), (1, 1)), constant_values=True)
        parting = equal[:, 1:-1] & ~(equal[:, :-2] & equal[:, 2:])
        found.append(x[np.any(parting, axis=0)])
    return np.unique(np.concatenate(found))
