"""Rules from a table: Mamdani's by Wang and Mendel, Takagi and Sugeno's by least squares.

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
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from fis_tools.array_types import Floats
from fis_tools.learning.partition import Partition, Places, antecedent, firing, held, strongest
from fis_tools.model import Consequent, Constant, FuzzySystem, Linear, Rule, Term, Variable

Conflicts = Literal["mean", "strongest"]


def wang_mendel(
    name: str,
    inputs: Sequence[tuple[Variable, Partition]],
    output: tuple[Variable, Partition],
    rows: Floats,
    targets: Floats,
    conflicts: Conflicts = "mean",
) -> FuzzySystem:
    """Make the rules that the rows of a table ask for.

    Parameters
    ----------
    name : str
        What the system is called.
    inputs : sequence of (Variable, Partition)
        What rules ask for, and where its peaks are.
    output : (Variable, Partition)
        What they conclude.
    rows : (n, num_inputs)
    targets : (n,)
    conflicts : {"mean", "strongest"}
        What rules of the same antecedent come to: that of 2003 or that of 1992.

    Returns
    -------
    FuzzySystem
        A rule for each combination of terms that some row belongs to most, in the order of a rule table.
    """
    memberships = [partition.memberships(x) for (_, partition), x in zip(inputs, rows.T, strict=True)]
    cells, owner = np.unique(strongest(memberships), axis=0, return_inverse=True)
    owner = owner.ravel()
    degrees = np.prod([m.max(axis=1) for m in memberships], axis=0)
    concluded = output[1].memberships(targets)
    if conflicts == "strongest":
        degrees = degrees * concluded.max(axis=1)
        order = np.argsort(degrees, kind="stable")
        chosen = np.empty(len(cells), dtype=np.int64)
        chosen[owner[order]] = order  # what is assigned last stays
        words = concluded[chosen].argmax(axis=1)
    else:
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
    """Rules of numbers that fit a table.

    Parameters
    ----------
    cells : (rules, num_inputs) int
        The term that each rule asks for of each input.
    coefficients : (rules, num_targets, num_inputs + 1)
        What each concludes for each target: the factor of each input, then the constant.
    score : float
        The mean squared error that is expected of other rows, summed over targets.
    """

    cells: Places
    coefficients: Floats
    score: float


def fit(partitions: Sequence[Partition], rows: Floats, targets: Floats, kind: Kind) -> Fit:
    """Fit the rules of all combinations of terms that rows belong to.

    Parameters
    ----------
    partitions : sequence of Partition
        Of each input.
    rows : (n, num_inputs)
    targets : (n, num_targets)
    kind : {"constants", "linear", "shares"}
        Whether rules conclude a number, one that is linear in the inputs, or the share of a class.
    """
    memberships = [partition.memberships(x) for partition, x in zip(partitions, rows.T, strict=True)]
    cells = held(memberships)
    weights = firing(memberships, cells)
    weights /= weights.sum(axis=1, keepdims=True)
    spent = CHARGE * sum(partition.num_moved for partition in partitions)
    if kind == "shares":
        found, score = _shares(weights, targets, spent)
        return Fit(cells, _with_factors(found, len(partitions)), score)
    middles = np.array([0.5 * (p.low + p.high) for p in partitions])
    halves = np.array([0.5 * (p.high - p.low) for p in partitions])
    scaled = np.clip((rows - middles) / halves, -1.0, 1.0)
    terms = np.column_stack([scaled, np.ones(len(rows))]) if kind == "linear" else np.ones((len(rows), 1))
    common = np.linalg.lstsq(terms, targets, rcond=None)[0]
    design = (weights[:, :, np.newaxis] * terms[:, np.newaxis, :]).reshape(len(rows), -1)
    departures, score = _ridge(design, targets - terms @ common, spent + terms.shape[1])
    found = np.swapaxes(common + departures.reshape(len(cells), *common.shape), 1, 2)
    if kind == "constants":
        return Fit(cells, _with_factors(found[:, :, 0], len(partitions)), score)
    factors = found[:, :, :-1] / halves
    constants = found[:, :, -1:] - (factors * middles).sum(axis=2, keepdims=True)
    return Fit(cells, np.concatenate([factors, constants], axis=2), score)


def _shares(weights: Floats, targets: Floats, spent: float) -> tuple[Floats, float]:
    """Return the mean of the targets by each rule's weights, (rules, num_targets), and its score."""
    totals = weights.sum(axis=0)
    shares = (weights.T @ targets) / totals[:, np.newaxis]
    freedom = spent + float((np.square(weights) / totals).sum())
    return shares, _score(targets - weights @ shares, freedom)


def _ridge(design: Floats, targets: Floats, spent: float) -> tuple[Floats, float]:
    """Return the coefficients that cross-validation prefers, and their score.

    Parameters
    ----------
    design : (n, p)
    targets : (n, q)
    spent : float
        Degrees of freedom that are gone already.
    """
    values, vectors = np.linalg.eigh(design.T @ design)
    values = np.maximum(values, 0.0)
    along = vectors.T @ (design.T @ targets)
    best, best_score = np.zeros((design.shape[1], targets.shape[1])), _score(targets, spent)
    for ridge in RIDGES * len(design):
        coefficients = vectors @ (along / (values + ridge)[:, np.newaxis])
        freedom = spent + float((values / (values + ridge)).sum())
        score = _score(targets - design @ coefficients, freedom)
        if score < best_score:
            best, best_score = coefficients, score
    return best, best_score


def _score(residuals: Floats, freedom: float) -> float:
    """Return the error expected of other rows, for a fit of so many degrees of freedom."""
    count = len(residuals)
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
    """Make a system whose rules conclude what was fitted, rounded to a thousandth of an output's range.

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
    numbers = [_numbers(output, inputs, fit.coefficients[:, place]) for place, output in enumerate(outputs)]
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
    """Round to the power of ten that is not above a step."""
    return float(round(value, -math.floor(math.log10(step)))) + 0.0


def bare_output(name: str, unit: str, ends: tuple[float, float], default: float) -> Variable:
    """Return an output for numbers, as yet without terms."""
    low, high = ends
    step = DIGIT * (high - low)
    return Variable(name, unit, low, high, (), default=rounded(default, step), aggregation="unbounded_sum")


def _numbers(output: Variable, inputs: Sequence[Variable], coefficients: Floats) -> list[Term]:
    """Return what each rule concludes on an output, (rules, num_inputs + 1), as a term.

    Constants stay in the range of the output, which rows beside a rule may have led out of it.
    """
    step = DIGIT * (output.maximum - output.minimum)
    steps = [step / (variable.maximum - variable.minimum) for variable in inputs]
    found = []
    for rule, (*factors, constant) in enumerate(coefficients.tolist(), start=1):
        if any(factors):
            exact = tuple(rounded(factor, each) for factor, each in zip(factors, steps, strict=True))
            found.append(Term(f"line_{rule}", Linear(exact, rounded(constant, step))))
        else:
            value = rounded(min(max(constant, output.minimum), output.maximum), step)
            found.append(Term(f"{value:.12g}", Constant(value)))
    return found


def _with_terms(output: Variable, terms: Sequence[Term]) -> Variable:
    """Give an output each of its terms once, from the lowest number to the highest, lines as they come."""
    distinct = {term.name: term for term in terms}
    ordered = sorted(distinct.values(), key=lambda term: getattr(term.membership, "value", 0.0))
    return Variable(
        output.name,
        output.unit,
        output.minimum,
        output.maximum,
        tuple(ordered),
        default=output.default,
        aggregation=output.aggregation,
    )
