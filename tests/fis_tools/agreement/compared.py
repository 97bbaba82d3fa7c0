"""What every form must give: the plain definition's numbers, as far as rounding decides nothing.

Forms may round memberships and strengths differently. Where the definition itself answers something else for
strengths that differ in their last digits, as at a jump, any answer between these is right.
"""

import warnings
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from fis_tools.analysis import shapley
from fis_tools.array_types import Floats
from fis_tools.engines import interval
from fis_tools.engines.compiler import compile
from fis_tools.engines.inference import Inference, infer, infer_outputs
from fis_tools.findings.explanation import flips
from fis_tools.model import FuzzySystem, Variable, shapes
from fis_tools.model.intervals import has_intervals
from tests.fis_tools.agreement.forms import FORMS, Case

#: of an output's range, or of its size
TOLERANCE = 1e-9
#: of shares, which are sums of many answers
SHARES_TOLERANCE = 1e-7
#: how many neighbours of strengths are tried, by how many units in the last place
NEIGHBOURS, UNITS = 60, 64.0


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
    if _equal(system, given, expected):
        return True
    around = np.array([expected, *neighbours(inferred)])
    for index, value in enumerate(given):
        column = around[:, index]
        if not np.isfinite(value):
            if np.isfinite(column).all():
                return False
            continue
        slack = TOLERANCE * sizes(system, expected)[index]
        known = column[np.isfinite(column)]
        if not len(known) or not known.min() - slack <= value <= known.max() + slack:
            return False
    return True


def _equal(system: FuzzySystem, given: Floats, expected: Floats) -> bool:
    with np.errstate(invalid="ignore"):
        near = np.abs(given - expected) <= TOLERANCE * sizes(system, expected)
    return bool((near | (~np.isfinite(given) & ~np.isfinite(expected))).all())


def neighbours(inferred: Inference) -> Iterator[Floats]:
    """The definition's outputs for memberships and strengths that differ in their last digits."""
    from fis_tools.engines import inference  # noqa: PLC0415

    if has_intervals(inferred.system):
        return
    generator = np.random.default_rng(7)
    for _ in range(NEIGHBOURS):
        memberships = [
            _shaken(generator, degrees, variable)
            for variable, degrees in zip(inferred.system.inputs, inferred.memberships, strict=True)
        ]
        firing = _shaken(generator, inference._fire(inferred.system, memberships))
        yield np.array([output.value for output in infer_outputs(inferred.system, firing, inferred.clipped)])


def _shaken(generator: np.random.Generator, degrees: Floats, variable: Variable | None = None) -> Floats:
    """Degrees with other last digits; those that are differences lose digits near zero."""
    units = generator.choice([-UNITS, -1.0, 0.0, 1.0, UNITS], degrees.shape)
    sizes_of = degrees.copy()
    if variable is not None:
        is_table = [isinstance(term.membership, shapes.Sampled | shapes.Polyline) for term in variable.terms]
        sizes_of[is_table] = 1.0
    return np.clip(degrees + units * np.spacing(sizes_of) * (sizes_of > 0.0), 0.0, 1.0)


def differences(cases: Sequence[Case], folder: Path, forms: Sequence[str] = tuple(FORMS)) -> list[Difference]:
    """Compare all forms with the definition, and what is claimed about outputs with the outputs."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)
        inferred = [[infer(system, row) for row in rows] for system, rows in cases]
        differing = []
        for form in forms:
            if form in FORMS:
                answers = _answers(form, cases, folder)
                for (system, rows), steps, given in zip(cases, inferred, answers, strict=True):
                    if isinstance(given, Exception):
                        differing.append(Difference(form, system, rows[0], "an answer", repr(given)))
                    elif given is not None:
                        differing += _of_form(form, system, rows, steps, given)
        for claim, check in CLAIMS.items():
            if claim in forms or forms == tuple(FORMS):
                for (system, rows), steps in zip(cases, inferred, strict=True):
                    try:
                        differing += check(claim, system, rows, steps)
                    except Exception as error:  # noqa: BLE001 - as above
                        differing.append(Difference(claim, system, rows[0], "an answer", repr(error)))
    return differing


def _answers(form: str, cases: Sequence[Case], folder: Path) -> list[Floats | Exception | None]:
    """Ask a form for all systems together; where that ends in an error, for each by itself."""
    try:
        return [*FORMS[form](cases, folder)]
    except Exception as error:  # noqa: BLE001 - it is a finding, whatever it is
        if len(cases) == 1:
            return [error]
        return [answer for case in cases for answer in _answers(form, [case], folder)]


def _of_form(
    form: str, system: FuzzySystem, rows: Floats, steps: list[Inference], given: Floats
) -> Iterator[Difference]:
    for row, step, answer in zip(rows, steps, given, strict=True):
        if not is_near(system, answer, step):
            yield Difference(form, system, row, str(step.values.tolist()), str(answer.tolist()))


def _bounds(claim: str, system: FuzzySystem, rows: Floats, steps: list[Inference]) -> Iterator[Difference]:
    """Each output lies inside the bounds of boxes around its inputs: points, small and large ones."""
    try:
        program = interval.pack(system)
    except interval.NotBounded:
        return
    generator = np.random.default_rng(11)
    limits = np.array([system.limits_of(variable) for variable in system.inputs])
    spans = np.array([variable.span for variable in system.inputs])
    held = np.clip(rows, limits[:, 0], limits[:, 1])
    is_finite = np.isfinite(held).all(axis=1)
    for width in (0.0, 1e-12, 1e-3, 0.3):
        down, up = generator.random((2, *rows.shape)) * width * spans
        least, greatest, _ = interval.bound(program, held - down, held + up)
        for index in np.flatnonzero(is_finite):
            values = steps[index].values
            slack = 1e-12 * sizes(system, values)
            below, above = least[index] - slack > values, greatest[index] + slack < values
            if (below | above | (np.isnan(least[index]) & ~np.isnan(values))).any():
                box = (
                    f"{[*zip(least[index].tolist(), greatest[index].tolist(), strict=True)]} of width {width}"
                )
                yield Difference(claim, system, rows[index], str(values.tolist()), box)


def _explain(claim: str, system: FuzzySystem, rows: Floats, steps: list[Inference]) -> Iterator[Difference]:
    """Shares add up to the way from the default, at each input that inference takes."""
    compiled = compile(system)
    shared = shapley.shares(compiled, rows).values.sum(axis=1)
    given = compiled(rows)
    for row, total, step, answer in zip(rows, shared, steps, given, strict=True):
        for index, variable in enumerate(system.outputs):
            silent, value = variable.default or 0.0, answer[index]
            if not np.isfinite(value) or (step.outputs[index].is_default and total[index] == 0.0):
                continue
            scale = max(variable.span, abs(value), abs(silent))
            summed = step.values.copy()
            summed[index] = silent + total[index]
            if not abs(summed[index] - value) <= SHARES_TOLERANCE * scale and not is_near(
                system, summed, step
            ):
                yield Difference(claim, system, row, str(value), f"shares add up to {silent + total[index]}")


def _flips(claim: str, system: FuzzySystem, rows: Floats, steps: list[Inference]) -> Iterator[Difference]:
    """What an input is changed to takes the output across the value."""
    for row, step in zip(rows[:1], steps, strict=False):
        if not np.isfinite(step.values).all():
            continue
        for flip in flips(system, row, 0.1):
            if flip.first is None:
                continue
            changed = step.clipped.copy()
            changed[system.inputs.index(flip.input)] = flip.first
            value = infer(system, changed).values[system.outputs.index(flip.output)]
            if np.sign(value - 0.1) == flip.side:
                words = f"{flip.input.name} = {flip.first} crosses 0.1"
                yield Difference(claim, system, row, f"{flip.output.name} = {value}", words)


CLAIMS = {"bounds": _bounds, "explain": _explain, "flips": _flips}
