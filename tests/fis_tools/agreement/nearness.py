"""What every form must give: the plain definition's numbers, as far as rounding decides nothing.

Forms may round memberships and strengths differently. Where the definition itself answers something else for
strengths that differ in their last digits, as at a jump, any answer between these is right. So is any within
what scikit-fuzzy's formula of the bisector, which the definition has, itself loses to rounding.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from unittest.mock import patch

import numpy as np

from fis_tools.array_types import Floats
from fis_tools.engines import defuzzification, inference
from fis_tools.engines.inference import Inference, OutputInference
from fis_tools.model import FuzzySystem, Variable, fuzzylite_shapes, shapes
from fis_tools.model.intervals import has_intervals, twin

#: of an output's range, or of its size
TOLERANCE = 1e-9
#: heights that are no more than rounding
FAINTEST = 1e-13
#: what rounding may leave of a degree that it takes away
LEAST = 2.0**-60
#: how many neighbours of strengths are tried, by how many units in the last place
NEIGHBOURS, UNITS = 60, 64.0


#: shapes whose degrees are differences, so that near zero they err by the last digits of one
DIFFERENCES = shapes.Sampled | shapes.Polyline | shapes.SigmoidDifference | fuzzylite_shapes.Cosine
#: what counts as equal heights
TIES = tuple(defuzzification.TIE * factor for factor in (1.0, 0.5, 2.0))


@dataclass(frozen=True)
class Difference:
    """A row at which a form, or a claim about outputs, is not what the definition says."""

    form: str
    system: FuzzySystem
    row: Floats
    expected: str
    given: str

    def __str__(self) -> str:
        return f"{self.form} at {self.row.tolist()}: {self.given}, by the definition {self.expected}"


def sizes(system: FuzzySystem, values: Floats) -> Floats:
    """What differences of outputs are measured in: their ranges, or their own size."""
    spans = np.array([variable.span for variable in system.outputs])
    return np.maximum(spans, np.abs(np.where(np.isfinite(values), values, 0.0)))


def is_near(system: FuzzySystem, given: Floats, inferred: Inference) -> bool:
    """Whether a row of outputs is the definition's, or one of its neighbours'."""
    expected = inferred.values
    if is_equal(system, given, expected):
        return True
    around = np.array([expected, *_within_losses(inferred.outputs, inferred.system), *neighbours(inferred)])
    for index, value in enumerate(given):
        column = around[:, index]
        if not np.isfinite(value):
            if np.isfinite(column).all():
                return False
            continue
        if _is_nothing(inferred, index) and inferred.outputs[index].variable.minimum <= value <= (
            inferred.outputs[index].variable.maximum
        ):
            continue
        slack = TOLERANCE * sizes(system, expected)[index]
        known = column[np.isfinite(column)]
        if not len(known) or not known.min() - slack <= value <= known.max() + slack:
            return False
    return True


def _is_nothing(inferred: Inference, index: int) -> bool:
    """Whether so little of a set is left that rounding decides what it is.

    scikit-fuzzy's own rounding places its crossings; elsewhere the heights of rules that fire next to nothing
    may vanish one by one, and not their sum.
    """
    output = inferred.outputs[index]
    height = output.aggregated.max(initial=0.0)
    if inferred.system.semantics == "scikit-fuzzy":
        return len(output.aggregated) > 0 and height < FAINTEST
    rules = zip(inferred.system.rules, inferred.firing_strengths, strict=True)
    name = output.variable.name
    concluding = [firing for rule, firing in rules if any(each.variable == name for each in rule.consequents)]
    return 0.0 < max(concluding, default=0.0) < FAINTEST and height < np.finfo(np.float64).tiny


def is_equal(system: FuzzySystem, given: Floats, expected: Floats) -> bool:
    with np.errstate(invalid="ignore"):
        near = np.abs(given - expected) <= TOLERANCE * sizes(system, expected)
    return bool((near | (~np.isfinite(given) & ~np.isfinite(expected))).all())


def strengths_around(inferred: Inference) -> Iterator[Floats]:
    """The strengths of rules for memberships, and strengths, that differ in their last digits."""
    system, degrees = inferred.system, inferred.memberships
    if has_intervals(system):
        system = twin(system)
        degrees = tuple(map(inference._evaluate_formulas, system.inputs, inferred.clipped))
    generator = np.random.default_rng(7)
    strengths = inference._fire(system, degrees)
    for units in (UNITS, -UNITS):  # by chance many would seldom all be whole, or all less
        yield np.clip(strengths + units * np.spacing(strengths) * (strengths > 0.0), 0.0, 1.0)
    for _ in range(NEIGHBOURS):
        memberships = [
            _shaken(generator, held, variable, is_sampled=system.semantics == "scikit-fuzzy")
            for variable, held in zip(system.inputs, degrees, strict=True)
        ]
        yield _shaken(generator, inference._fire(system, memberships))


def neighbours(inferred: Inference) -> Iterator[Floats]:
    """The definition's outputs for memberships and strengths that differ in their last digits."""
    for number, firing in enumerate(strengths_around(inferred)):
        with patch.object(defuzzification, "TIE", TIES[number % len(TIES)]):
            outputs = inference.infer_outputs(inferred.system, firing, inferred.clipped)
        yield np.array([output.value for output in outputs])
        yield from _within_losses(outputs, inferred.system)


def _within_losses(outputs: Sequence[OutputInference], system: FuzzySystem) -> tuple[Floats, ...]:
    """Outputs at both ends of what rounding in scikit-fuzzy's formulas leaves open; empty if nothing."""
    values = np.array([output.value for output in outputs])
    losses = np.array(
        [
            _bisector_loss(output)
            if system.defuzzifier_of(output.variable) == "bisector" and not system.is_sampled
            else 0.0
            for output in outputs
        ]
    )
    return (values - losses, values + losses) if losses.any() else ()


def _bisector_loss(output: OutputInference) -> float:
    """How far ``x1 - (y1 - root) / slope`` may lie from its exact value, by the last digits of the root.

    Where heights at a segment's ends differ in their last digits, as at crossings, that is up to its width.
    """
    x, y = output.universe, output.aggregated
    widths, rises = np.diff(x), np.abs(np.diff(y))
    digits = 4.0 * np.finfo(np.float64).eps * np.maximum(y[:-1], y[1:])
    slanted = (rises > 0.0) & (np.minimum(y[:-1], y[1:]) > 0.0)
    losses = np.zeros(len(widths))
    losses[slanted] = widths[slanted] * np.minimum(digits[slanted] / rises[slanted], 1.0)
    reached = (x[:-1] - losses <= output.value) & (output.value <= x[1:] + losses)
    return float(losses[reached].max(initial=0.0))


def _shaken(
    generator: np.random.Generator,
    degrees: Floats,
    variable: Variable | None = None,
    *,
    is_sampled: bool = False,
) -> Floats:
    """Degrees with other last digits; those that are differences lose digits near zero.

    All that is sampled on a universe is interpolated, so is a difference, and may fall below zero.
    """
    units = generator.choice([-UNITS, -1.0, 0.0, 1.0, UNITS], degrees.shape)
    sizes_of = np.abs(degrees)
    if variable is not None:
        is_difference = [is_sampled or isinstance(term.membership, DIFFERENCES) for term in variable.terms]
        sizes_of[is_difference] = 1.0
    # of what rounding takes away, nothing is left or next to nothing: where a conclusion grows without end as
    # its strength goes to zero, any answer beyond is right
    least = generator.choice([0.0, LEAST], degrees.shape) * (sizes_of > 0.0)
    least = np.where(degrees > 0.0, np.minimum(degrees, least), least)
    return np.clip(degrees + units * np.spacing(sizes_of) * (sizes_of > 0.0), least, 1.0)
