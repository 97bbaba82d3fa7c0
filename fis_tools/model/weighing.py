"""Validation of how outputs become numbers: fuzzy sets where numbers are required, and the reverse."""

from collections.abc import Iterable, Iterator, Sequence

from fis_tools.model.numbers import Formula, Linear, NotAFormula, Number
from fis_tools.model.operators import WEIGHING
from fis_tools.model.shape import MonotoneFunction
from fis_tools.model.systems import FuzzySystem
from fis_tools.model.variables import Variable


class NotMamdani(ValueError):  # noqa: N818 - the sentence is the message
    """Raised where Mamdani outputs are required."""


def require_mamdani(systems: Iterable[FuzzySystem], what: str) -> None:
    """Raise NotMamdani for systems with weighted outputs.

    Parameters
    ----------
    systems : iterable of FuzzySystem
    what : str
        What requires fuzzy sets, as the beginning of a sentence.

    Raises
    ------
    NotMamdani
        If there is such an output.
    """
    for system in systems:
        for output in system.weighed:
            way = system.defuzzifier_of(output).replace("_", " ")
            raise NotMamdani(
                f"{what} is for Mamdani systems, whose rules conclude fuzzy sets, but output "
                f"{output.name!r} of {system.name!r} is a {way} of numbers; show, audit, explain, review, "
                "bounds, surface, plot, diff and export take it"
            )


def output_problems(system: FuzzySystem, output: Variable) -> Iterator[str]:
    """Yield the conflicts between the terms of an output and its defuzzifier."""
    where = f"output {output.name!r}"
    numbers = [term.name for term in output.terms if isinstance(term.membership, Number)]
    if not system.weighs(output):
        if numbers:
            yield (
                f"{where}, term {numbers[0]!r} is a number, and the defuzzifier "
                f"{system.defuzzifier_of(output)} needs fuzzy sets; choose {' or '.join(WEIGHING)}"
            )
        return
    way = system.defuzzifier_of(output)
    if output.aggregation != "unbounded_sum":
        yield (
            f"{where} is a {way}, to which every rule counts by itself, but it has the aggregation "
            f"{output.aggregation}; set aggregation to unbounded_sum"
        )
    if numbers and len(numbers) < len(output.terms):
        yield f"{where} has numbers and fuzzy sets among its terms; make all of them one or the other"
    for term in output.terms:
        match term.membership:
            case Linear(coefficients, _) if len(coefficients) != len(system.inputs):
                yield (
                    f"{where}, term {term.name!r} has {len(coefficients)} coefficients for "
                    f"{len(system.inputs)} inputs; give one for each input, and the constant"
                )
            case Formula() as formula:
                yield from (
                    f"{where}, term {term.name!r}: {fault}" for fault in _faults(system, output, formula)
                )
            case Number() | MonotoneFunction():
                pass
            case shape:
                yield (
                    f"{where}, term {term.name!r} is {shape.entry.name}, but a {way} needs numbers (constant "
                    "or linear) or shapes that only rise or fall (ramp, sigmoid, s_shape, z_shape, concave "
                    "or arc)"
                )


def _faults(system: FuzzySystem, output: Variable, formula: Formula) -> Iterator[str]:
    """Yield the problems of a formula: it may use inputs, and outputs before its own."""
    try:
        names = dict.fromkeys(formula.parsed.names())
    except NotAFormula as error:
        yield f"{error}; correct it"
        return
    before = system.outputs[: system.outputs.index(output)]
    known = [variable.name for variable in (*system.inputs, *before)]
    for name in names:
        if name not in known:
            yield (
                f"the formula {formula.text[:40]!r} speaks of {name!r}, no input and no output before "
                f"this one; choose of {', '.join(known)}"
            )


def has_sets(variable: Variable) -> bool:
    """Return whether the terms of a variable are fuzzy sets rather than numbers."""
    return not any(isinstance(term.membership, Number) for term in variable.terms)


def number_problems(variable: Variable) -> Iterator[str]:
    """Yield the terms of an input that are numbers."""
    for term in variable.terms:
        if isinstance(term.membership, Number):
            yield (
                f"input {variable.name!r}, term {term.name!r} is a number; terms of inputs are fuzzy sets, "
                "so give it a shape"
            )


def reach(output: Variable, inputs: Sequence[Variable]) -> tuple[float, float]:
    """Return the least and the greatest value of an output's terms over the ranges of the inputs.

    If they are equal, a range of width one centred on them.
    """
    low, high = [], []
    for term in output.terms:
        if isinstance(term.membership, Number) and not isinstance(term.membership, Formula):
            *coefficients, constant = term.membership.row(len(inputs))
            ends = [sorted((c * v.minimum, c * v.maximum)) for c, v in zip(coefficients, inputs, strict=True)]
            low.append(constant + sum(least for least, _ in ends))
            high.append(constant + sum(greatest for _, greatest in ends))
    least, greatest = min(low, default=output.minimum), max(high, default=output.maximum)
    return (least, greatest) if least < greatest else (least - 0.5, greatest + 0.5)
