"""Fuzzy systems that imitate a function or a controller, and how far they are from it."""

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np

from fis_tools.analysis.arrays import spread
from fis_tools.array_types import Floats
from fis_tools.engines.compiler import compile
from fis_tools.learning.learner import Recipe, learn_number
from fis_tools.learning.partition import range_of
from fis_tools.learning.table import Column, columns_within, distinct
from fis_tools.model import FuzzySystem
from fis_tools.source import as_controller

#: Samples that an imitation is judged by; none of them was learned from.
JUDGED_BY = 2_000


class Imitation(NamedTuple):
    """A system that imitates something.

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
    samples = np.concatenate([_corners(low, high), spread(low, high, num_samples + JUDGED_BY)])
    answers = _answers(function, samples)
    taught = len(samples) - JUDGED_BY
    *_, name = distinct([*(column.name for column in columns), output])
    target = Column(name, "", *range_of(answers[:taught]))
    learned = learn_number(columns, samples[:taught], target, answers[:taught], Recipe(**recipe))
    fed = samples[taught:, list(learned.columns)]
    miss = compile(learned.system)(fed)[:, 0] - answers[taught:]
    return Imitation(learned.system, float(np.sqrt(np.mean(miss**2))), float(np.abs(miss).max()))


def _one_output(what: object) -> FuzzySystem:
    systems = as_controller(what).systems
    if len(systems) != 1 or len(systems[0].outputs) != 1:
        outputs = ", ".join(variable.name for system in systems for variable in system.outputs)
        raise ValueError(f"there are several outputs: {outputs}; pass a function that returns one of them")
    return systems[0]


def _corners(low: Floats, high: Floats) -> Floats:
    """Return the corners of a box, (2 ** num_inputs, num_inputs): there many functions are extreme."""
    ends = np.indices((2,) * len(low)).reshape(len(low), -1).T
    return np.where(ends, high, low)


def _answers(function: Callable[..., Any], samples: Floats) -> Floats:
    """Ask a function for its answers, (n,).

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
