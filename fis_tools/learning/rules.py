"""Partitions and rules on them: Mamdani's by Wang and Mendel, Takagi and Sugeno's by least squares.

Partitions that a person can read are triangles in order, each point held by its neighbours with a sum of one.
Such a partition is called strong, or Ruspini's (E. H. Ruspini, Information and Control 15, 1969). Whatever
its peaks are, some term holds each point to one half or more, and two terms share a third of their area or
less (Jaccard's measure), so readability need not be watched while the peaks move.

Peaks are moved until an error no longer falls, by compass search. They lie on hundredths of a range, in order
and a few of them apart; so the search is over whole numbers, and tries each peak to either side by ever
smaller steps (T. G. Kolda, R. M. Lewis and V. Torczon, SIAM Review 45, 2003). Nothing is drawn: the same
table gives the same system.

The combinations of terms that a table's rows belong to, its cells, become the rules.

L.-X. Wang and J. M. Mendel, *Generating fuzzy rules by learning from examples*, IEEE Transactions on Systems,
Man, and Cybernetics 22 (1992): each row of the table gives the rule whose terms it belongs to most, of the
degree that is the product of its memberships. Of rules that contradict one another the paper keeps the one of
the highest degree, which one row decides. L.-X. Wang, *The WM method completed*, IEEE Transactions on Fuzzy
Systems 11 (2003), takes the mean of the rows instead, each weighed by its degree; noise then averages out.

Numbers for numbers are fitted by linear least squares: each rule departs from one number, or one straight
line, for the whole table, and a ridge holds departures down; so a rule that few rows speak for says nearly
what all rows say. A class gets the share of it among rows, each weighed by how far the rule holds for it.

Either is linear in the targets, so generalized cross-validation tells the error on other rows (G. H. Golub,
M. Heath and G. Wahba, Technometrics 21, 1979). It also chooses the ridge. A peak that has been moved to fit
a table costs three degrees of freedom, as a knot does in J. H. Friedman's splines (Annals of Statistics 19,
1991).
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from fis_tools import model
from fis_tools.array_types import Floats, Integers
from fis_tools.model import Consequent, FuzzySystem, Rule, Term, Variable

#: What terms are called, from the lowest to the highest, by their number.
WORDS = {
    2: ("low", "high"),
    3: ("low", "medium", "high"),
    4: ("very_low", "low", "high", "very_high"),
    5: ("very_low", "low", "medium", "high", "very_high"),
    6: ("extremely_low", "very_low", "low", "high", "very_high", "extremely_high"),
    7: ("extremely_low", "very_low", "low", "medium", "high", "very_high", "extremely_high"),
}
#: Steps of a range. A peak lies on one of them, so that memberships are exact on the points of a universe.
STEPS = 100
#: Steps that peaks keep apart.
CLOSEST = 5


@dataclass(frozen=True)
class Partition:
    """A partition of a range into terms, given by the terms' peaks.

    Parameters
    ----------
    low, high : float
        The range; the first and the last peak lie at its ends.
    positions : tuple of int
        The peaks in hundredths of the range, ascending.
    """

    low: float
    high: float
    positions: tuple[int, ...]

    @property
    def peaks(self) -> Floats:
        """The peaks in the unit of the variable, shape (num_terms,)."""
        points = np.linspace(self.low, self.high, STEPS + 1)
        return points[list(self.positions)]

    @property
    def num_moved(self) -> int:
        """The number of peaks that differ from an even partition."""
        evenly = even(self.low, self.high, len(self.positions)).positions
        return sum(mine != other for mine, other in zip(self.positions, evenly, strict=True))

    def memberships(self, values: Floats) -> Floats:
        """Return how far values, (n,), belong to each term, (n, num_terms); outside as at the ends."""
        peaks = self.peaks
        return np.stack([np.interp(values, peaks, unit) for unit in np.eye(len(peaks))], axis=1)

    def moved(self, index: int, steps: int) -> "Partition | None":
        """Return the partition with an inner peak moved; None where that comes too close to another."""
        position = self.positions[index] + steps
        if position - self.positions[index - 1] < CLOSEST or self.positions[index + 1] - position < CLOSEST:
            return None
        return replace(self, positions=(*self.positions[:index], position, *self.positions[index + 1 :]))

    def as_input(self, name: str, unit: str) -> Variable:
        """Return the variable over the range."""
        peaks = self.peaks.tolist()
        around = [peaks[0], *peaks, peaks[-1]]
        return Variable(name, unit, self.low, self.high, _terms(around), STEPS + 1)

    def as_output(self, name: str, unit: str, default: float) -> Variable:
        """Return the variable for centroids: outer terms are whole, so that their centres are the ends."""
        before, after = self.positions[1], STEPS - self.positions[-2]
        num_points = before + STEPS + after + 1
        step = (self.high - self.low) / STEPS
        low, high = self.low - before * step, self.high + after * step
        points = np.linspace(low, high, num_points)
        around = points[[0, *(before + position for position in self.positions), -1]].tolist()
        return Variable(name, unit, low, high, _terms(around), num_points, default=default)


def even(low: float, high: float, num_terms: int) -> Partition:
    """Return the partition whose peaks are evenly spaced, as nearly as its points allow."""
    positions = np.round(np.linspace(0, STEPS, num_terms)).astype(int)
    return Partition(low, high, tuple(positions.tolist()))


def range_of(values: Floats) -> tuple[float, float]:
    """Return the range of values, its ends rounded outward to two digits of its width; never empty."""
    low, high = float(values.min()), float(values.max())
    if low == high:
        half = max(0.5, abs(low) * 0.5)
        return low - half, high + half
    digits = 1 - math.floor(math.log10(high - low))
    scale = 10.0**digits
    ends = math.floor(low * scale + ROUNDING) / scale, math.ceil(high * scale - ROUNDING) / scale
    return ends if all(map(math.isfinite, ends)) and ends[0] < ends[1] else (low, high)


#: Of the last digit of a range: what rounding may have added to a value.
ROUNDING = 1e-6


def _terms(points: list[float]) -> tuple[Term, ...]:
    """Return a triangle over each point between the first and the last."""
    corners = zip(points[:-2], points[1:-1], points[2:], strict=True)
    words = WORDS[len(points) - 2]
    return tuple(Term(word, model.Triangular(*three)) for word, three in zip(words, corners, strict=True))


#: By how many hundredths of a range peaks are moved, one size after the other.
STRIDES = (16, 8, 4, 2, 1)

Partitions = tuple[Partition, ...]


def tuned(partitions: Sequence[Partition], error: Callable[[Partitions], float]) -> Partitions:
    """Return partitions that no single step of one peak improves.

    Parameters
    ----------
    partitions : sequence of Partition
        Where to begin.
    error : callable
        What is to be low.
    """
    best = tuple(partitions)
    lowest = error(best)
    for stride in STRIDES:
        is_better = True
        while is_better:
            is_better = False
            for where, index in _inner_peaks(best):
                for steps in (stride, -stride):
                    moved = best[where].moved(index, steps)
                    if moved is None:
                        continue
                    candidates = (*best[:where], moved, *best[where + 1 :])
                    trial_error = error(candidates)
                    if trial_error < lowest:
                        best, lowest, is_better = candidates, trial_error, True
                        break
    return best


def _inner_peaks(partitions: Partitions) -> list[tuple[int, int]]:
    """Return every peak that can move, as the indices of its partition and itself."""
    return [
        (where, index)
        for where, partition in enumerate(partitions)
        for index in range(1, len(partition.positions) - 1)
    ]


def strongest(memberships: Sequence[Floats]) -> Integers:
    """Return the term of each input that each row belongs to most, (n, num_inputs); ties go to the lower.

    Parameters
    ----------
    memberships : sequence of (n, num_terms)
        Of each input.
    """
    return np.stack([degrees.argmax(axis=1) for degrees in memberships], axis=1)


def firing(memberships: Sequence[Floats], cells: Integers) -> Floats:
    """Return the firing strength of each combination of terms for each row, by the product: (n, rules)."""
    strengths = memberships[0][:, cells[:, 0]]
    for degrees, terms in zip(memberships[1:], cells.T[1:], strict=True):
        strengths = strengths * degrees[:, terms]
    return strengths


def antecedent(inputs: Sequence[Variable], cell: Integers) -> model.Expression:
    """Return a combination of terms as an antecedent."""
    statements = tuple(
        model.Is(v.name, v.terms[int(term)].name) for v, term in zip(inputs, cell, strict=True)
    )
    return statements[0] if len(statements) == 1 else model.And(statements)


def wang_mendel(
    name: str,
    inputs: Sequence[tuple[Variable, Partition]],
    output: tuple[Variable, Partition],
    rows: Floats,
    targets: Floats,
    counts: Floats,
) -> FuzzySystem:
    """Return the rules of Wang and Mendel's method for the rows of a table.

    Parameters
    ----------
    name : str
        What the system is called.
    inputs : sequence of (Variable, Partition)
        What rules ask for, and where its peaks are.
    output : (Variable, Partition)
        What they conclude.
    rows : (n, num_inputs)
    targets, counts : (n,)
        As how many equal rows each counts.

    Returns
    -------
    FuzzySystem
        A rule for each combination of terms that some row belongs to most, in the order of a rule table.
    """
    memberships = [partition.memberships(x) for (_, partition), x in zip(inputs, rows.T, strict=True)]
    cells, owner = np.unique(strongest(memberships), axis=0, return_inverse=True)
    owner = owner.ravel()
    degrees = counts * np.prod([m.max(axis=1) for m in memberships], axis=0)
    means = np.bincount(owner, degrees * targets) / np.bincount(owner, degrees)
    words = output[1].memberships(means).argmax(axis=1)
    variables = tuple(variable for variable, _ in inputs)
    rules = tuple(
        Rule(antecedent(variables, cell), (Consequent(output[0].name, output[0].terms[word].name),))
        for cell, word in zip(cells, words, strict=True)
    )
    return FuzzySystem(name, variables, (output[0],), rules)


Kind = Literal["constants", "linear", "shares"]

#: The strengths of the ridge that are tried, as shares of the number of rows.
RIDGES = 10.0 ** np.arange(-10.0, 2.0, 0.5)
#: Degrees of freedom that a moved peak costs.
CHARGE = 3.0


@dataclass(frozen=True)
class Fit:
    """Rules with numeric conclusions fitted to a table.

    Parameters
    ----------
    cells : (rules, num_inputs) int
        The term that each rule asks for of each input.
    coefficients : (rules, num_targets, num_inputs + 1)
        What each concludes for each target: the factor of each input, then the constant.
    score : float
        The mean squared error that is expected of other rows, summed over targets.
    """

    cells: Integers
    coefficients: Floats
    score: float


def fit(partitions: Sequence[Partition], rows: Floats, targets: Floats, counts: Floats, kind: Kind) -> Fit:
    """Fit the rules of all combinations of terms that rows belong to.

    Parameters
    ----------
    partitions : sequence of Partition
        Of each input.
    rows : (n, num_inputs)
    targets : (n, num_targets)
    counts : (n,)
        As how many equal rows each counts: scikit-learn's ``sample_weight``.
    kind : {"constants", "linear", "shares"}
        Whether rules conclude a number, one that is linear in the inputs, or the share of a class.
    """
    memberships = [partition.memberships(x) for partition, x in zip(partitions, rows.T, strict=True)]
    cells = np.unique(strongest(memberships), axis=0)
    weights = firing(memberships, cells)
    weights /= weights.sum(axis=1, keepdims=True)
    spent = CHARGE * sum(partition.num_moved for partition in partitions)
    if kind == "shares":
        solution, score = _shares(weights, targets, counts, spent)
        return Fit(cells, _with_factors(solution, len(partitions)), score)
    middles = np.array([0.5 * (p.low + p.high) for p in partitions])
    halves = np.array([0.5 * (p.high - p.low) for p in partitions])
    scaled = np.clip((rows - middles) / halves, -1.0, 1.0)
    terms = np.column_stack([scaled, np.ones(len(rows))]) if kind == "linear" else np.ones((len(rows), 1))
    roots = np.sqrt(counts)[:, np.newaxis]
    terms, targets = roots * terms, roots * targets
    common = np.linalg.lstsq(terms, targets, rcond=None)[0]
    design = (weights[:, :, np.newaxis] * terms[:, np.newaxis, :]).reshape(len(rows), -1)
    departures, score = _ridge(design, targets - terms @ common, float(counts.sum()), spent + terms.shape[1])
    solution = np.swapaxes(common + departures.reshape(len(cells), *common.shape), 1, 2)
    if kind == "constants":
        return Fit(cells, _with_factors(solution[:, :, 0], len(partitions)), score)
    factors = solution[:, :, :-1] / halves
    constants = solution[:, :, -1:] - (factors * middles).sum(axis=2, keepdims=True)
    return Fit(cells, np.concatenate([factors, constants], axis=2), score)


def _shares(weights: Floats, targets: Floats, counts: Floats, spent: float) -> tuple[Floats, float]:
    """Return the mean of the targets by each rule's weights, (rules, num_targets), and its score."""
    counts = counts[:, np.newaxis]
    totals = (counts * weights).sum(axis=0)
    shares = (weights.T @ (counts * targets)) / totals[:, np.newaxis]
    freedom = spent + float((counts * np.square(weights) / totals).sum())
    residuals = np.sqrt(counts) * (targets - weights @ shares)
    return shares, _score(residuals, float(counts.sum()), freedom)


def _ridge(design: Floats, targets: Floats, count: float, spent: float) -> tuple[Floats, float]:
    """Return the ridge coefficients that cross-validation prefers, and their score.

    Parameters
    ----------
    design : (n, p)
    targets : (n, q)
    count : float
        As how many rows they count.
    spent : float
        Degrees of freedom that are gone already.
    """
    values, vectors = np.linalg.eigh(design.T @ design)
    values = np.maximum(values, 0.0)
    along = vectors.T @ (design.T @ targets)
    best, best_score = np.zeros((design.shape[1], targets.shape[1])), _score(targets, count, spent)
    for ridge in RIDGES * count:
        coefficients = vectors @ (along / (values + ridge)[:, np.newaxis])
        freedom = spent + float((values / (values + ridge)).sum())
        score = _score(targets - design @ coefficients, count, freedom)
        if score < best_score:
            best, best_score = coefficients, score
    return best, best_score


def _score(residuals: Floats, count: float, freedom: float) -> float:
    """Return the error expected on other rows, for a fit with so many degrees of freedom."""
    if count - freedom < 1.0:
        return np.inf
    return count * float(np.square(residuals).sum()) / (count - freedom) ** 2


def _with_factors(constants: Floats, num_inputs: int) -> Floats:
    """Return constants, (rules, num_targets), with a factor of zero for each input."""
    none = np.zeros((*constants.shape, num_inputs))
    return np.concatenate([none, constants[:, :, np.newaxis]], axis=2)


#: Of an output's range, the share that rounding may change a conclusion by: half of it.
DIGIT = 1e-3


def takagi_sugeno(
    name: str, inputs: Sequence[Variable], outputs: Sequence[Variable], fit: Fit
) -> FuzzySystem:
    """Build a system from fitted rules, its numbers rounded to a thousandth of an output's range.

    Parameters
    ----------
    name : str
        What the system is called.
    inputs : sequence of Variable
    outputs : sequence of Variable
        Without terms; a number becomes a term that is called by it, so that rules say it.
    fit : Fit
        For these inputs, and these outputs as targets.
    """
    numbers = [_numbers(output, inputs, fit.coefficients[:, column]) for column, output in enumerate(outputs)]
    rules = tuple(
        Rule(
            antecedent(inputs, cell),
            tuple(Consequent(v.name, t.name) for v, t in zip(outputs, terms, strict=True)),
        )
        for cell, *terms in zip(fit.cells, *numbers, strict=True)
    )
    concluded = tuple(_with_terms(v, terms) for v, terms in zip(outputs, numbers, strict=True))
    return FuzzySystem(
        name, tuple(inputs), concluded, rules, and_operator="product", defuzzifier="weighted_average"
    )


def rounded(value: float, step: float) -> float:
    """Round to the largest power of ten that is not above a step."""
    return float(round(value, -math.floor(math.log10(step)))) + 0.0


def bare_output(name: str, unit: str, ends: tuple[float, float], default: float) -> Variable:
    """Return a weighted output without terms."""
    low, high = ends
    step = DIGIT * (high - low)
    return Variable(name, unit, low, high, (), default=rounded(default, step), aggregation="unbounded_sum")


def _numbers(output: Variable, inputs: Sequence[Variable], coefficients: Floats) -> list[Term]:
    """Return each rule's coefficients, (rules, num_inputs + 1), as a term of an output.

    Constants stay in the range of the output, which rows beside a rule may have led out of it.
    """
    step = DIGIT * output.span
    steps = [step / variable.span for variable in inputs]
    formulas = []
    for rule, (*factors, constant) in enumerate(coefficients.tolist(), start=1):
        if any(factors):
            exact = tuple(rounded(factor, each) for factor, each in zip(factors, steps, strict=True))
            formulas.append(Term(f"line_{rule}", model.Linear(exact, rounded(constant, step))))
        else:
            value = rounded(min(max(constant, output.minimum), output.maximum), step)
            formulas.append(Term(f"{value:.12g}", model.Constant(value)))
    return formulas


def _with_terms(output: Variable, terms: Sequence[Term]) -> Variable:
    """Return an output with each of its terms once, ascending, linear ones in their order."""
    distinct = {term.name: term for term in terms}
    ordered = sorted(distinct.values(), key=lambda term: getattr(term.membership, "value", 0.0))
    return replace(output, terms=tuple(ordered))
