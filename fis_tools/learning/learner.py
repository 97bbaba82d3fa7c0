"""Fuzzy systems from tables: the columns that matter, their terms, a rule for each combination met.

`learn` takes tables with names, `imitate` a function or a controller; `cross_validated` tells what a recipe
reaches on rows that it did not see.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import Any, Literal, NamedTuple, get_args

import numpy as np

from fis_tools.analysis.arrays import spread
from fis_tools.analysis.tables import name_and_unit
from fis_tools.array_types import Floats, Integers
from fis_tools.engines.compiler import compile
from fis_tools.errors import Mistake
from fis_tools.learning import rules
from fis_tools.learning.table import Column, Samples, TrainingTable, as_table, columns_within, samples_of
from fis_tools.model import FuzzySystem, Variable
from fis_tools.model.validate import MOST_INPUTS
from fis_tools.source import as_controller
from plain_files.plain_text import distinct

Consequents = Literal["sets", "constants", "linear"]


@dataclass(frozen=True, kw_only=True)
class Recipe:
    """What a learned system may look like.

    Parameters
    ----------
    consequents : {"constants", "linear", "sets"}
        What rules conclude: a number each (Takagi-Sugeno of order zero), a number linear in the inputs (of
        order one), or a fuzzy set (Mamdani, by Wang and Mendel).
    terms : int
        Of each input, 2 to 7.
    output_terms : int
        Of an output of sets, 2 to 7.
    max_inputs : int
        Columns that rules may ask for: those that lower the expected error most, one after the other.
    tune : bool
        Whether the terms' peaks are moved to lower it further.
    """

    consequents: Consequents = "constants"
    terms: int = 3
    output_terms: int = 5
    max_inputs: int = 3
    tune: bool = True

    def __post_init__(self) -> None:
        """Raise ValueError for a recipe that cannot be learned."""
        if self.consequents not in get_args(Consequents):
            known = ", ".join(get_args(Consequents))
            raise Mistake(f"consequents is {self.consequents!r}; use one of {known}")
        for name, least, most in (
            ("terms", min(rules.WORDS), max(rules.WORDS)),
            ("output_terms", min(rules.WORDS), max(rules.WORDS)),
            ("max_inputs", 1, MOST_INPUTS),
        ):
            value = getattr(self, name)
            if isinstance(value, bool) or not least <= value <= most or value != int(value):
                raise Mistake(f"{name} is {value!r}; give a whole number from {least} to {most}")


def _chosen_columns(samples: Samples, targets: Floats, recipe: Recipe, kind: rules.Kind) -> tuple[int, ...]:
    """Choose columns one after the other, each time the one that lowers the expected error most.

    Parameters
    ----------
    samples : Samples
    targets : (n, num_targets)
    recipe : Recipe
        Terms of each column, and how many are chosen at most.
    kind : {"constants", "linear", "shares"}
        What rules would conclude; see `fis_tools.learning.rules.fit`, whose error is taken.

    Returns
    -------
    tuple of int
        Their places, in the order of the table; one at least, even if none lowers the error.
    """
    inputs = min(recipe.max_inputs, len(samples.columns))
    if recipe.terms**inputs > MOST_RULES:
        raise Mistake(
            f"{recipe.terms} terms of {inputs} inputs are up to {recipe.terms**inputs:,} rules, more than "
            f"{MOST_RULES:,}, which nobody reads; lower terms or max_inputs"
        )
    varied = np.ptp(samples.rows, axis=0) > 0.0
    waiting: list[int] = np.flatnonzero(varied).tolist() or [0]
    chosen: list[int] = []
    lowest = np.inf
    while waiting and len(chosen) < recipe.max_inputs:
        tries = [samples.of([*chosen, column]) for column in waiting]
        scores = [
            rules.fit(_even(tried.columns, recipe.terms), tried.rows, targets, tried.counts, kind).score
            for tried in tries
        ]
        best = int(np.argmin(scores))
        if chosen and not scores[best] < lowest:
            break
        lowest = scores[best]
        chosen.append(waiting.pop(best))
    return tuple(sorted(chosen))


#: Rows that columns are chosen and terms are tuned by, spread over the table; rules are learned from all.
MOST_ROWS = 2_000
#: Rules that the terms of a table may combine to.
MOST_RULES = 1_000


class Learned(NamedTuple):
    """A learned system, and the columns that feed it.

    Attributes
    ----------
    system : FuzzySystem
    columns : tuple of int
        The places of its inputs among the columns of the table.
    """

    system: FuzzySystem
    columns: tuple[int, ...]


def learn_number(samples: Samples, target: Column, values: Floats, recipe: Recipe) -> Learned:
    """Learn a system whose output is a number; its mean where no rule fires.

    Parameters
    ----------
    samples : Samples
    target : Column
        What is to be learned.
    values : (n,)
        Its values.
    recipe : Recipe
    """
    mean = float((samples.counts * values).sum() / samples.counts.sum())
    if recipe.consequents == "sets":
        return _learn_sets(samples, target, values, mean, recipe)
    output = rules.bare_output(target.name, target.unit, (target.low, target.high), mean)
    return _learn_numbers(target.name, samples, [output], values[:, np.newaxis], recipe, recipe.consequents)


def learn_classes(
    name: str, samples: Samples, classes: Sequence[str], owners: Floats, recipe: Recipe
) -> Learned:
    """Learn a system with an output for each class: the share of it among rows of such inputs.

    Parameters
    ----------
    name : str
        What the system is called.
    samples : Samples
    classes : sequence of str
        What they are called.
    owners : (n, num_classes)
        One where a row is of a class, else zero.
    recipe : Recipe
        What it says of consequents does not count.
    """
    shares = (samples.counts[:, np.newaxis] * owners).sum(axis=0) / samples.counts.sum()
    outputs = [
        rules.bare_output(label, "", (0.0, 1.0), share)
        for label, share in zip(classes, shares.tolist(), strict=True)
    ]
    return _learn_numbers(name, samples, outputs, owners, recipe, "shares")


def _learn_numbers(
    name: str,
    samples: Samples,
    outputs: Sequence[Variable],
    targets: Floats,
    recipe: Recipe,
    kind: rules.Kind,
) -> Learned:
    """Learn a system whose rules conclude numbers."""
    chosen_rows = _spread(len(samples.rows))
    chosen = _chosen_columns(samples.at(chosen_rows), targets[chosen_rows], recipe, kind)
    fed = samples.of(chosen)
    some = fed.at(chosen_rows)
    partitions = _even(fed.columns, recipe.terms)
    if recipe.tune:
        partitions = rules.tuned(
            partitions,
            lambda trial: rules.fit(trial, some.rows, targets[chosen_rows], some.counts, kind).score,
        )
    fitted = rules.fit(partitions, fed.rows, targets, fed.counts, kind)
    names = distinct([*(column.name for column in fed.columns), *(output.name for output in outputs)])
    inputs = [p.as_input(n, c.unit) for p, n, c in zip(partitions, names, fed.columns, strict=False)]
    outputs = [replace(output, name=n) for output, n in zip(outputs, names[len(inputs) :], strict=True)]
    return Learned(rules.takagi_sugeno(name, inputs, outputs, fitted), chosen)


def _learn_sets(samples: Samples, target: Column, values: Floats, mean: float, recipe: Recipe) -> Learned:
    """Learn a Mamdani system."""
    chosen_rows = _spread(len(samples.rows))
    chosen = _chosen_columns(samples.at(chosen_rows), values[chosen_rows, np.newaxis], recipe, "constants")
    fed = samples.of(chosen)
    some = fed.at(chosen_rows)
    names = distinct([*(column.name for column in fed.columns), target.name])

    def system(partitions: rules.Partitions, among: Samples, values: Floats) -> FuzzySystem:
        *parts, last = partitions
        units = [column.unit for column in among.columns]
        inputs = [(p.as_input(n, unit), p) for p, n, unit in zip(parts, names, units, strict=False)]
        output = last.as_output(names[-1], target.unit, mean)
        return rules.wang_mendel(target.name, inputs, (output, last), among.rows, values, among.counts)

    def error(partitions: rules.Partitions) -> float:
        answers = compile(system(partitions, some, values[chosen_rows]))(some.rows)[:, 0]
        return float((some.counts * np.square(answers - values[chosen_rows])).sum())

    partitions = (*_even(fed.columns, recipe.terms), rules.even(target.low, target.high, recipe.output_terms))
    if recipe.tune:
        partitions = rules.tuned(partitions, error)
    return Learned(system(partitions, fed, values), chosen)


def _even(columns: Sequence[Column], terms: int) -> tuple[rules.Partition, ...]:
    return tuple(rules.even(column.low, column.high, terms) for column in columns)


def _spread(count: int) -> Integers:
    """Return the indices of some rows, evenly spread over a table."""
    return np.unique(np.linspace(0, count - 1, min(count, MOST_ROWS)).astype(np.int64))


#: Parts that a table is divided into: each is answered by what was learned from the others.
FOLDS = 5


class ValidationScore(NamedTuple):
    """The cross-validated error of a recipe: on rows that it did not learn from.

    Attributes
    ----------
    error : float
        The root mean squared error, in the unit of the target; of classes the share of wrong ones.
    error_of_constant : float
        The same of one answer to everything: the mean of the other rows, or the most frequent class of all.
    """

    error: float
    error_of_constant: float


def learn(content: Any, target: str, *, inputs: list[str] | None = None, **recipe: Any) -> FuzzySystem:
    """Learn a system from a table.

    Parameters
    ----------
    content : mapping, data frame or structured array
        Columns of numbers by their names, such as ``"petal length (cm)"``, whose unit is taken as such.
    target : str
        The column that is to be learned. Of words, the system has an output for each, its share.
    inputs : list of str, optional
        The columns that rules may ask for; by default all others.
    **recipe
        As `fis_tools.learning.Recipe` takes.

    Raises
    ------
    fis_tools.learning.table.UnreadableTable
        If nothing can be learned from the table; the text says why.
    """
    return learn_table(as_table(content, target, inputs), Recipe(**recipe)).system


def learn_table(table: TrainingTable, recipe: Recipe) -> Learned:
    """Learn a system, and tell which columns feed it."""
    samples = samples_of(table.rows, table.labels)
    name, unit = name_and_unit(table.target)
    if table.has_classes:
        classes, owner = np.unique(table.values, return_inverse=True)
        labels = distinct(name_and_unit(str(label))[0] for label in classes.tolist())
        return learn_classes(name, samples, labels, np.eye(len(classes))[owner], recipe)
    target = Column(name, unit, *rules.range_of(table.values))
    return learn_number(samples, target, table.values, recipe)


def cross_validated(table: TrainingTable, recipe: Recipe) -> ValidationScore | None:
    """Cross-validate a recipe in five folds; None for too few rows."""
    fold = np.arange(len(table.values)) % FOLDS
    if len(table.values) < 2 * FOLDS:
        return None
    wrong, wrong_of_constant = 0.0, 0.0
    classes, counts = np.unique(table.values, return_counts=True)
    most_frequent = classes[counts.argmax()]
    for left_out in range(FOLDS):
        kept, held_out = fold != left_out, fold == left_out
        part = TrainingTable(table.labels, table.rows[kept], table.target, table.values[kept])
        learned = learn_table(part, recipe)
        answers = compile(learned.system)(
            np.ascontiguousarray(table.rows[held_out][:, list(learned.columns)])
        )
        truth = table.values[held_out]
        if table.has_classes:
            wrong += float((np.unique(part.values)[answers.argmax(axis=1)] != truth).sum())
            wrong_of_constant += float((most_frequent != truth).sum())
        else:
            wrong += float(np.square(answers[:, 0] - truth).sum())
            wrong_of_constant += float(np.square(part.values.mean() - truth).sum())
    errors = np.array([wrong, wrong_of_constant]) / len(table.values)
    return ValidationScore(*(errors if table.has_classes else np.sqrt(errors)).tolist())


#: Samples that an imitation is judged by; none of them was learned from.
JUDGED_BY = 2_000


class Imitation(NamedTuple):
    """A system that imitates a function or a controller, and how closely it does.

    Attributes
    ----------
    system : FuzzySystem
    root_mean_square, largest : float
        How far it is from what it imitates, in the unit of the output, at samples that it did not learn from.
    """

    system: FuzzySystem
    root_mean_square: float
    largest: float


def imitate(
    what: object,
    ranges: Mapping[str, tuple[float, float]] | None = None,
    *,
    output: str = "output",
    num_samples: int = 2_000,
    **recipe: Any,
) -> Imitation:
    """Learn a system that answers as a function or a controller does.

    Parameters
    ----------
    what : callable, or FuzzySystem, controller, scikit-fuzzy control system, or path of one
        What to imitate. A function takes one array for each input, (n,), by place, and returns (n,). One
        that takes single numbers is passed as ``numpy.vectorize(function)``.
    ranges : mapping of str to (float, float)
        The inputs by name, in the function's order, and where each is imitated. Of a fuzzy system, which
        knows them, its own by default.
    output : str
        What the output of a function is called.
    num_samples : int
        How many answers to learn from, besides those in the corners: points of a Halton sequence.
    **recipe
        As `fis_tools.learning.Recipe` takes; by default rules ask for up to four inputs.

    Raises
    ------
    ValueError
        If the ranges are missing or empty, a fuzzy system has several outputs, an answer is no number, or
        there would be more rules than anybody reads.
    """
    recipe = {"max_inputs": 4, **recipe}
    if callable(what) and not isinstance(what, FuzzySystem):
        if not ranges:
            raise ValueError("a function does not say its inputs; pass ranges={'name': (low, high), ...}")
        function: Callable[..., Any] = what
    else:
        system = _one_output(what)
        names = [variable.name for variable in system.inputs]
        ranges = ranges or {v.name: (v.minimum, v.maximum) for v in system.inputs}
        if list(ranges) != names:
            raise ValueError(
                f"ranges are of {', '.join(ranges)}; pass those of {', '.join(names)}, so ordered"
            )
        output, infer = system.outputs[0].name, compile(system)
        function = lambda *columns: infer(np.stack(columns, axis=1))[:, 0]  # noqa: E731
    columns = columns_within(ranges)
    low, high = (np.array([getattr(column, end) for column in columns]) for end in ("low", "high"))
    corners = list(product(*zip(low, high, strict=True)))  # many functions are extreme there
    samples = np.concatenate([corners, spread(low, high, num_samples + JUDGED_BY)])
    answers = _answers(function, samples)
    taught = len(samples) - JUDGED_BY
    *_, name = distinct([*(column.name for column in columns), output])
    target = Column(name, "", *rules.range_of(answers[:taught]))
    sampled = Samples(columns, samples[:taught], np.ones(taught))
    learned = learn_number(sampled, target, answers[:taught], Recipe(**recipe))
    fed = samples[taught:, list(learned.columns)]
    miss = compile(learned.system)(fed)[:, 0] - answers[taught:]
    return Imitation(learned.system, float(np.sqrt(np.mean(miss**2))), float(np.abs(miss).max()))


def _one_output(what: object) -> FuzzySystem:
    """Return the only system of a controller; raise ValueError unless it has one output."""
    systems = as_controller(what).systems
    if len(systems) != 1 or len(systems[0].outputs) != 1:
        outputs = ", ".join(variable.name for system in systems for variable in system.outputs)
        raise ValueError(f"there are several outputs: {outputs}; pass a function that returns one of them")
    return systems[0]


def _answers(function: Callable[..., Any], samples: Floats) -> Floats:
    """Return a function's values, (n,).

    Raises
    ------
    ValueError
        If it returns something else than a number a sample.
    """
    answers = np.asarray(function(*samples.T), dtype=np.float64)
    if answers.shape != (len(samples),):
        raise ValueError(
            f"the function returned shape {answers.shape} for {len(samples)} samples; it takes an array for "
            "each input and returns one number a sample, so pass numpy.vectorize(function) of one for numbers"
        )
    if not np.isfinite(answers).all():
        where = samples[int(np.argmin(np.isfinite(answers)))]
        raise ValueError(f"the function returns no finite number at {where.tolist()}; narrow the ranges")
    return answers
