"""Takagi-Sugeno systems from fitted numbers, rounded so that they can be read."""

import math
from collections.abc import Sequence

from fis_tools.learning.cells import antecedent
from fis_tools.learning.consequents import Fit
from fis_tools.model import Consequent, Constant, FuzzySystem, Linear, Rule, Term, Variable
from fis_tools.typing import Floats

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
