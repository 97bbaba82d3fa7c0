"""A simplified controller, the steps that led to it and what they may change, and their report."""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from itertools import chain
from typing import Any, Literal

import numpy as np

from fis_tools.analysis.arrays import spread_inputs
from fis_tools.array_types import Floats
from fis_tools.engines.compiler import compile
from fis_tools.model import FuzzyController, FuzzySystem
from fis_tools.words.text import amount, inferred_as
from plain_files.document import Block, Document, Heading, Paragraph, Result, Table, plain

#: Samples on which candidates are ranked; the step that is taken is measured on all.
NUM_RANKING = 4096
#: Changes below this share of a range are rounding errors.
ROUNDING_ERROR = 1e-12

FLOWN, SPREAD = "flights", "ranges"


@dataclass(frozen=True)
class Budget:
    """The largest deviation of every output from the original's, as fractions of its range.

    Parameters
    ----------
    max_change, mean_change : float
        The largest and the mean size of the change over the samples, from 0 to 1. Between samples of the
        whole ranges a change can be larger than the largest.
    flights_only : bool
        Whether the budget holds along the flights alone, if there are any, and not over the whole ranges of
        the inputs too. Outputs for inputs that were not flown may then change without limit.
    look_alike : float
        Terms of this similarity (Jaccard: shared over joint area) or more may be merged; above 0, up to 1.

    Raises
    ------
    ValueError
        If a number is out of range.
    """

    max_change: float = 0.05
    mean_change: float = 0.01
    flights_only: bool = False
    look_alike: float = 0.7

    def __post_init__(self) -> None:
        """Raise ValueError if a number is out of range."""
        for name in ("max_change", "mean_change"):
            value = getattr(self, name)
            if not 0.0 <= value <= 1.0:
                raise ValueError(f"{name} is {value:g}; give a share of the output's range from 0 to 1")
        if not 0.0 < self.look_alike <= 1.0:
            raise ValueError(f"look_alike is {self.look_alike:g}; give a likeness above 0 and up to 1")


@dataclass(frozen=True)
class OutputDeviation:
    """How far outputs deviate from the original's over some samples.

    Parameters
    ----------
    largest, mean : tuple of float
        For each output, as shares of its range in the original.
    """

    largest: tuple[float, ...]
    mean: tuple[float, ...]

    def cost(self, budget: Budget) -> float:
        """Return the share of a budget that is used up; infinite where a budget of zero is exceeded."""
        return max(_used(max(self.largest), budget.max_change), _used(max(self.mean), budget.mean_change))


def _used(change: float, allowed: float) -> float:
    """Return the share of an allowed deviation that is used up; rounding errors use nothing."""
    if change <= ROUNDING_ERROR:
        return 0.0
    return change / allowed if allowed > 0.0 else math.inf


@dataclass(frozen=True, eq=False)
class Bench:
    """The original system's outputs at the samples on which each step is measured.

    Parameters
    ----------
    budget : Budget
    samples : dict of str to (n, num_inputs)
        The inputs, by `FLOWN` (if there are any) and `SPREAD`.
    outputs : dict of str to (n, num_outputs)
        The outputs of the original.
    spans : (num_outputs,)
        Widths of the outputs' ranges.
    """

    budget: Budget
    samples: Mapping[str, Floats]
    outputs: Mapping[str, Floats]
    spans: Floats

    @property
    def governing(self) -> tuple[str, ...]:
        """The samples on which the budget holds."""
        if FLOWN not in self.samples:
            return (SPREAD,)
        return (FLOWN,) if self.budget.flights_only else (FLOWN, SPREAD)

    def measure(self, system: FuzzySystem) -> dict[str, OutputDeviation]:
        """Measure how far a system deviates from the original."""
        compiled = compile(system)
        return {name: self.change(name, compiled(rows)) for name, rows in self.samples.items()}

    def change(self, name: str, outputs: Floats) -> OutputDeviation:
        """Measure how far outputs, (n, num_outputs), deviate from the original's on some samples.

        To have no value where the original has none is no deviation; to have one where it has none, or none
        where it has one, is beyond any budget.
        """
        before = self.outputs[name]
        with np.errstate(invalid="ignore"):
            departures = np.abs(outputs - before) / self.spans
        is_same = (outputs == before) | (np.isnan(outputs) & np.isnan(before))
        departures = np.where(is_same, 0.0, np.where(np.isnan(departures), np.inf, departures))
        return OutputDeviation(
            tuple(departures.max(axis=0).tolist()), tuple(departures.mean(axis=0).tolist())
        )

    def cost(self, changes: Mapping[str, OutputDeviation]) -> float:
        """Return the share of the budget that deviations use up."""
        return max(changes[name].cost(self.budget) for name in self.governing)

    def without_input(self, index: int) -> "Bench":
        """Return the same samples without one input, with the original's outputs."""
        fewer = {name: np.delete(rows, index, axis=1) for name, rows in self.samples.items()}
        return replace(self, samples=fewer)

    def thinned(self) -> "Bench":
        """Return a bench of fewer samples, evenly picked, of those that the budget holds on."""
        steps = {name: -(-len(self.samples[name]) // NUM_RANKING) for name in self.governing}
        both = (self.samples, self.outputs)
        samples, outputs = ({name: rows[name][::step] for name, step in steps.items()} for rows in both)
        return replace(self, samples=samples, outputs=outputs)


def bench_for(system: FuzzySystem, flown: Floats | None, budget: Budget) -> Bench:
    """Evaluate a system along its flights, if there are any, and over the whole ranges of its inputs."""
    samples = {FLOWN: flown} if flown is not None and len(flown) else {}
    samples[SPREAD] = spread_inputs(system)
    compiled = compile(system)
    outputs = {name: compiled(rows) for name, rows in samples.items()}
    return Bench(budget, samples, outputs, np.array([variable.span for variable in system.outputs]))


Kind = Literal["input", "drop", "merge", "terms", "round"]


@dataclass(frozen=True)
class SimplificationStep:
    """One simplification step.

    Parameters
    ----------
    kind : str
        ``input`` left out, ``drop`` of rules, ``merge`` of two terms, ``terms`` that no rule uses, or
        ``round`` of numbers.
    sentence : str
        The step in words.
    rules : tuple of int
        The numbers, in the original, of the removed rules.
    num_rules, num_terms : int
        How many there are afterwards.
    changes : dict of str to OutputDeviation
        How far outputs then deviate from the original's, along ``flights`` and over the ``ranges``.
    """

    kind: Kind
    sentence: str
    rules: tuple[int, ...]
    num_rules: int
    num_terms: int
    changes: Mapping[str, OutputDeviation]


@dataclass(frozen=True)
class SimplifiedSystem:
    """A system before and after.

    Parameters
    ----------
    original, simplified : FuzzySystem
    num_flown, num_spread : int
        Inferences on flights, and points over the ranges of the inputs, that were looked at.
    steps : tuple of SimplificationStep
    changes : dict of str to OutputDeviation
        How far the simplified system deviates from the original.
    """

    original: FuzzySystem
    simplified: FuzzySystem
    num_flown: int
    num_spread: int
    steps: tuple[SimplificationStep, ...]
    changes: Mapping[str, OutputDeviation]


@dataclass(frozen=True, repr=False)
class Simplification(Result):
    """The result of simplifying a controller.

    Parameters
    ----------
    original, controller : FuzzyController
        Before, and after: an ordinary controller.
    budget : Budget
    systems : tuple of SimplifiedSystem
    """

    original: FuzzyController
    controller: FuzzyController
    budget: Budget
    systems: tuple[SimplifiedSystem, ...]

    @property
    def summary(self) -> str:
        """The result in a sentence."""
        rules = [sum(len(s.rules) for s in c.systems) for c in (self.original, self.controller)]
        terms = [sum(map(num_terms, c.systems)) for c in (self.original, self.controller)]
        return (
            f"{self.original.name}: {rules[0]} rules to {rules[1]}, {terms[0]} terms to {terms[1]}, at "
            f"{budget_words(self.budget, flown=any(system.num_flown for system in self.systems))}"
            + inferred_as(*(system.semantics for system in self.original.systems))
        )

    def document(self) -> Document:
        """List the steps, in one table per system."""
        return Document([Heading(self.summary), *chain(*map(_blocks, self.systems))])

    def plain(self) -> dict[str, Any]:
        """Return the steps as plain JSON data.

        Keys are ``controller`` (its name), ``budget`` and ``systems``; of each its ``name``, how many
        ``rules`` and ``terms`` it had and has, its ``changes``, and its ``steps`` as in
        `SimplificationStep`. ``changes`` hold, along ``flights`` and over ``ranges``, the ``largest`` and
        the ``mean`` for each output, as shares of its range.
        """
        return {
            "controller": self.original.name,
            "budget": plain(self.budget),
            "systems": [
                {
                    "name": system.original.name,
                    "rules": [len(system.original.rules), len(system.simplified.rules)],
                    "terms": [num_terms(system.original), num_terms(system.simplified)],
                    "changes": plain(system.changes),
                    "steps": plain(system.steps),
                }
                for system in self.systems
            ],
        }


def num_terms(system: FuzzySystem) -> int:
    """Count the terms of all variables."""
    return sum(len(variable.terms) for variable in system.variables)


def budget_words(budget: Budget, *, flown: bool) -> str:
    """Return a budget in words."""
    where = "along the logs" if flown else "at points over the ranges of the inputs"
    if flown and not budget.flights_only:
        where += " and at points over the ranges of the inputs"
    return (
        f"a change of {100.0 * budget.max_change:g} % of an output's range at most and "
        f"{100.0 * budget.mean_change:g} % on average, {where}"
    )


_SETS = {FLOWN: "along the logs", SPREAD: "at {:,} points over the ranges"}


def _blocks(system: SimplifiedSystem) -> Iterator[Block]:
    """Report the deviations in the units of the outputs, then list the steps."""
    name, sets = system.original.name, list(system.changes)
    if not system.steps:
        yield Paragraph(f"{name}: nothing can be made simpler within the budget")
        return
    for index, output in enumerate(system.original.outputs):
        departs = []
        for where, change in system.changes.items():
            most, mean = (amount(output, part[index] * output.span) for part in (change.largest, change.mean))
            departs.append(f"{most} at most and {mean} on average {_SETS[where].format(system.num_spread)}")
        yield Paragraph(f"{name}: {output.name} departs by {'; by '.join(departs)}")
    heads = [f"{word} {_SETS[where].split()[-1]}" for where in sets for word in ("max,", "mean,")]
    original = [str(len(system.original.rules)), str(num_terms(system.original))]
    rows = [[*original, *[""] * len(heads), "the original"]]
    for step in system.steps:
        most_and_mean = (
            max(part) for name in sets for part in (step.changes[name].largest, step.changes[name].mean)
        )
        changes = [f"{100.0 * value:.2f} %" for value in most_and_mean]
        rows.append([str(step.num_rules), str(step.num_terms), *changes, step.sentence])
    yield Table(["rules", "terms", *heads, "step"], rows, numbers=range(2 + len(heads)))
