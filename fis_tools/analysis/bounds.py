"""Proved bounds on the outputs of a system while its inputs lie in a region.

An interval holds for every input of its box, and a question answered with no has been refuted on boxes that
cover the region: both are proofs about the numbers that `fis_tools.engines.inference` computes. What is
proved, and how, stands in docs/explanation/proof.md.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Any, Literal

import numpy as np

from fis_tools.analysis.branch_and_bound import Progress, Subdivision, broken, subdivide
from fis_tools.analysis.condition import Condition, Region, linear_bounds, read_conditions, read_region
from fis_tools.array_types import Floats
from fis_tools.engines import bounded_trees
from fis_tools.engines.interval import NotBounded
from fis_tools.model import Inferable, Variable
from fis_tools.words.text import number, quantity
from plain_files.document import Document, Paragraph, Result

#: Boxes that are bounded before giving up.
NUM_BOXES = 200_000
#: The gap allowed between proved and attained ends, as a fraction of the output's range.
RANGE_TOLERANCE = 1e-4


@dataclass(frozen=True, slots=True)
class Interval:
    """All numbers from `low` to `high`."""

    low: float
    high: float


@dataclass(frozen=True, repr=False)
class Answer(Result):
    """The answer to a question about the outputs of a system over a region of inputs.

    Parameters
    ----------
    question, region : str
        As they were asked.
    verdict : str
        ``yes`` with an example, ``no`` where it is proved, else ``undecided``.
    num_boxes : int
        How many boxes were bounded.
    example : dict, optional
        Inputs, then outputs, by name, for which the answer is yes.
    undecided : dict of Interval, optional
        The largest box about which nothing is known, by the inputs' names.
    undecided_share : float
        The fraction of the region's box about which nothing is known.
    refuted_low, refuted_high : (m, num_inputs), optional
        The boxes of inputs that prove a no: over each the interval of the outputs rules it out, and together
        they cover the region.
    conditions : tuple of Condition
        Of the region and the question; the example is written with as many digits as they take.
    notes : tuple of str
        Which inputs are asked for beyond their ranges, and what they count as.
    """

    question: str
    region: str
    verdict: Literal["yes", "no", "undecided"]
    num_boxes: int
    example: dict[str, float] | None = None
    undecided: dict[str, Interval] | None = None
    undecided_share: float = 0.0
    refuted_low: Floats | None = field(default=None, repr=False, compare=False)
    refuted_high: Floats | None = field(default=None, repr=False, compare=False)
    conditions: tuple[Condition, ...] = field(default=(), repr=False, compare=False)
    notes: tuple[str, ...] = field(default=(), repr=False, compare=False)

    @property
    def sentence(self) -> str:
        """The answer in words."""
        boxes = f"{self.num_boxes} box{'es' if self.num_boxes > 1 else ''}"
        if self.example is not None:
            outcome = f"yes, for example at {_point_words(self.example, self.conditions, 9)}"
        elif self.undecided is None:
            outcome = f"no, proved with {boxes}"
        else:
            left = " and ".join(
                f"{name} from {number(_rounded(part.low))} to {number(_rounded(part.high))}"
                for name, part in self.undecided.items()
            )
            outcome = (
                f"undecided after {boxes}; {100.0 * self.undecided_share:.3g} % of the region are left, the "
                f"largest part with {left}"
            )
        while_region = f" while {self.region}" if self.region else ""
        return "; ".join((f"{self.question}{while_region}: {outcome}", *self.notes)) + "."

    def document(self) -> Document:
        """Return the sentence as a document."""
        return Document([Paragraph(self.sentence)])


@dataclass(frozen=True, repr=False)
class Range(Result):
    """The range of an output over a region of inputs.

    Parameters
    ----------
    output : Variable
        Which output.
    outer : Interval
        Proved: no output lies outside.
    inner : Interval
        The least and the greatest output found; empty, from inf to -inf, where no input of the region was.
    least_at, greatest_at : dict
        The inputs of these two, by name; empty where there is none.
    num_boxes : int
        How many boxes were bounded.
    where : Region
        Where the inputs lie.
    num_open : int
        How many boxes were left that might have narrowed it.
    """

    output: Variable
    outer: Interval
    inner: Interval
    least_at: dict[str, float]
    greatest_at: dict[str, float]
    num_boxes: int
    where: Region = field(repr=False, compare=False)
    num_open: int = 0

    @property
    def sentence(self) -> str:
        """The range in words."""
        ends = [
            f"{quantity(self.output, value)} is attained at {_point_words(inputs, self.where.conditions, 6)}"
            for value, inputs in ((self.inner.low, self.least_at), (self.inner.high, self.greatest_at))
            if inputs
        ] or ["no input that meets all conditions was found"]
        outer = f"{number(self.outer.low)} to {quantity(self.output, self.outer.high)}"
        proved = f"{self.output.name} goes from {outer} at most, proved with {self.num_boxes} boxes"
        if self.num_open:
            proved += f" (stopped with {self.num_open} left, which might narrow it)"
        return "; ".join((proved, *ends, *self.where.notes)) + "."

    def document(self) -> Document:
        """Return the sentence as a document."""
        return Document([Paragraph(self.sentence)])


def ask(
    system: Inferable,
    question: str,
    region: str = "",
    *,
    max_boxes: int = NUM_BOXES,
    max_seconds: float = np.inf,
    progress: Progress | None = None,
) -> Answer:
    """Answer whether the outputs can meet conditions while the inputs meet others.

    Parameters
    ----------
    system : FuzzySystem or FuzzyTree
        Without problems.
    question : str
        Conditions on outputs that must all hold, such as ``force_x > 0``, ``force_x in [-0.1, 0.1]``.
    region : str
        Conditions on inputs, as ``distance > 150, velocity_body_x - 0.001 distance <= 0.1``; those on several
        inputs together are about values inside their universes.
    max_boxes : int
        How many boxes to bound before giving up.
    max_seconds : float
        How long to go on before giving up.
    progress : callable, optional
        Called now and then with the number of boxes bounded, and of those still open.

    Raises
    ------
    ValueError
        If a condition cannot be read, or no input can meet the region's.
    fis_tools.engines.interval.NotBounded
        If the system's outputs cannot be bounded.
    """
    names = [variable.name for variable in system.outputs]
    conditions = read_conditions(question, names)
    coefficients = np.array(
        [[condition.coefficients.get(name, 0.0) for name in names] for condition in conditions]
    )
    lowest, highest = (
        np.array([condition.least for condition in conditions]),
        np.array([condition.greatest for condition in conditions]),
    )
    widths = np.abs(coefficients) @ [variable.span for variable in system.outputs]

    def promise(least: Floats, greatest: Floats) -> Floats:
        """Return an upper bound on how far inside all conditions the outputs lie; negative outside."""
        low, high = linear_bounds(coefficients, least, greatest)
        return np.asarray((np.minimum(high - lowest, highest - low) / widths).min(axis=1))

    where = read_region(system, region)
    packed = bounded_trees.pack(system)
    limits: dict[str, Any] = {"max_boxes": max_boxes, "max_seconds": max_seconds, "progress": progress}
    search = subdivide(packed, where, promise, floor=0.0, goal=0.0, **limits)
    words = ", ".join(condition.text for condition in conditions)
    answer = partial(Answer, words, where.text, num_boxes=search.num_boxes)
    answer = partial(answer, conditions=(*where.conditions, *conditions), notes=where.notes)
    if search.best >= 0.0:
        inputs = np.clip(search.best_inputs, where.asked_low, where.asked_high)
        outputs = bounded_trees.evaluate(packed, inputs[np.newaxis])[0]
        return answer("yes", example=_named(system.inputs, inputs) | _named(system.outputs, outputs))
    if not len(search.open_promises):
        return answer("no", refuted_low=search.refuted_low, refuted_high=search.refuted_high)
    sides = np.where(where.high > where.low, search.open_high - search.open_low, 1.0)
    volumes = (sides / np.where(where.high > where.low, where.high - where.low, 1.0)).prod(axis=1)
    largest = int(np.argmax(volumes))
    ends = zip(system.inputs, search.open_low[largest], search.open_high[largest], strict=True)
    box = {variable.name: Interval(float(low), float(high)) for variable, low, high in ends}
    return answer("undecided", undecided=box, undecided_share=float(volumes.sum()))


def output_ranges(
    system: Inferable,
    region: str = "",
    *,
    max_boxes: int = NUM_BOXES,
    max_seconds: float = np.inf,
    tolerance: float = RANGE_TOLERANCE,
    progress: Progress | None = None,
) -> tuple[Range, ...]:
    """Find the range of each output while the inputs lie in a region.

    Parameters
    ----------
    system : FuzzySystem or FuzzyTree
        Without problems.
    region : str
        Conditions on inputs, as for `ask`; empty for all inputs.
    max_boxes : int
        How many boxes to bound, for each end of each output.
    max_seconds : float
        How long to go on, for each end of each output; what is left then is told.
    tolerance : float
        The gap allowed between proved and attained ends, as a fraction of the output's range.
    progress : callable, optional
        As for `ask`.

    Raises
    ------
    ValueError
        As `ask`.
    fis_tools.engines.interval.NotBounded
        As `ask`.
    """
    where = read_region(system, region)
    packed = bounded_trees.pack(system)
    limits: dict[str, Any] = {"max_boxes": max_boxes, "max_seconds": max_seconds, "progress": progress}
    ranges = []
    for index, output in enumerate(system.outputs):
        gap, ends = tolerance * output.span, []
        for sign in (-1.0, 1.0):

            def promise(least: Floats, greatest: Floats, index: int = index, sign: float = sign) -> Floats:
                """Return an upper bound on what is maximised: the output, or its negative."""
                return greatest[:, index] if sign > 0.0 else -least[:, index]

            search = subdivide(packed, where, promise, tolerance=gap, **limits)
            if not len(search.open_promises) and search.best == -np.inf:
                if not region:
                    cure = "give it a default, or rules that conclude on it"
                    raise NotBounded(f"{output.name} has no value anywhere; {cure}")
                raise ValueError(f"no inputs meet all conditions of {region!r}; relax one of them")
            ends.append(search)
        ranges.append(_range(system, output, where, *ends))
    return tuple(ranges)


def _range(system: Inferable, output: Variable, where: Region, low: Subdivision, high: Subdivision) -> Range:
    """Combine the searches for the minimum and the maximum of an output into its range."""
    attained = [
        (value, _named(system.inputs, np.clip(search.best_inputs, where.asked_low, where.asked_high)))
        for value, search in ((-low.best, low), (high.best, high))
        if search.best > -np.inf
    ]
    least, least_at = attained[0] if attained else (np.inf, {})
    greatest, greatest_at = attained[-1] if attained else (-np.inf, {})
    outer = Interval(-_most(low), _most(high))
    inner = Interval(least, greatest)
    if inner.low < outer.low or inner.high > outer.high:
        worst = least_at if inner.low < outer.low else greatest_at
        value = inner.low if inner.low < outer.low else inner.high
        raise NotBounded(broken(np.array(list(worst.values())), np.array([value])))
    num_open = len(low.open_promises) + len(high.open_promises)
    return Range(output, outer, inner, least_at, greatest_at, low.num_boxes + high.num_boxes, where, num_open)


def _most(search: Subdivision) -> float:
    """Return the greatest promise that is left of a search."""
    return float(max(search.closed, search.open_promises.max(initial=-np.inf)))


def _point_words(values: Mapping[str, float], conditions: Sequence[Condition], digits: int) -> str:
    """Format values of variables with few digits; with all digits if fewer would break the conditions."""
    printed, words = dict(values), []
    for name, value in values.items():
        shown = f"{_rounded(value):.{digits}g}"
        printed[name] = float(shown)
        if not all(condition.holds(printed) for condition in conditions):
            shown, printed[name] = repr(value), value
        words.append(f"{name} = {shown}")
    return ", ".join(words)


def _rounded(value: float) -> float:
    """Replace the smallest positive and negative doubles, which strict conditions produce, by zero."""
    return value if abs(value) > 1e-300 else 0.0


def _named(variables: Sequence[Variable], values: Floats) -> dict[str, float]:
    return {variable.name: float(value) for variable, value in zip(variables, values, strict=True)}
