"""Weighted outputs, compiled; `fis_tools.engines.inference` is the readable twin."""

import numpy as np

from fis_tools.array_types import Floats, Integers
from fis_tools.compiled.decorator import compiled
from fis_tools.engines.program import (
    ARC,
    CONCAVE,
    FORMULA,
    NUMBER,
    RAMP,
    S_SHAPE,
    SIGMOID,
    WEIGHTED_SUM,
    Weighing,
)


def weigh(
    weighing: Weighing, firing: Floats, values: Floats, universes: Floats, earlier: Floats, out: Floats
) -> None:
    """Write one output for firing strengths (n, num_rules) and inputs (n, num_inputs).

    Parameters
    ----------
    universes : (num_inputs, 2)
        The ends of each input, to which it is clipped.
    earlier : (num_outputs, n)
        The outputs before this one, which formulas may use.
    """
    formulas = formula_values(weighing, values, universes, earlier)
    _weigh(*weighing[:9], formulas, firing, values, universes, out)


def formula_values(weighing: Weighing, values: Floats, universes: Floats, earlier: Floats) -> Floats:
    """Return the values of an output's formulas, (n, num_formulas); see `weigh`."""
    found = np.empty((len(values), len(weighing.formulas)))
    if weighing.formulas:
        clipped = np.clip(values, universes[:, 0], universes[:, 1]).T
        known = dict(
            zip(weighing.names, (*clipped, *earlier[: len(weighing.names) - len(clipped)]), strict=True)
        )
        for place, formula in enumerate(weighing.formulas):
            found[:, place] = formula.value(known)
    return found


@compiled(error_model="numpy", nogil=True)
def _weigh(
    rules: Integers,
    weights: Floats,
    parameters: Floats,
    is_constant: bool,
    defuzzifier: int,
    default: float,
    kinds: Integers,
    low: float,
    high: float,
    formulas: Floats,
    firing: Floats,
    values: Floats,
    universes: Floats,
    out: Floats,
) -> None:
    num_inputs = values.shape[1]
    clipped = np.empty(num_inputs)
    for sample in range(len(firing)):
        for place in range(num_inputs):
            clipped[place] = min(max(values[sample, place], universes[place, 0]), universes[place, 1])
        total, moment = 0.0, 0.0
        for index in range(len(rules)):
            strength = firing[sample, rules[index]] * weights[index]
            if strength == 0.0:
                continue
            if is_constant:
                number = parameters[index, num_inputs]
            elif kinds[index] == NUMBER:
                number = parameters[index, num_inputs]
                for place in range(num_inputs):
                    number += parameters[index, place] * clipped[place]
            elif kinds[index] == FORMULA:
                number = formulas[sample, int(parameters[index, 0])]
            else:
                number = invert(kinds[index], parameters[index, 0], parameters[index, 1], min(strength, 1.0))
                if np.isinf(number):
                    number = high if number > 0.0 else low
            total += strength
            moment += strength * number
        if total == 0.0:
            out[sample] = default
        else:
            out[sample] = moment if defuzzifier == WEIGHTED_SUM else moment / total


@compiled(error_model="numpy")
def invert(kind: int, first: float, second: float, degree: float) -> float:
    """Return where one of `fis_tools.engines.program.INVERTED` has a degree, like its own `inverse`."""
    place: float
    if kind == RAMP:
        place = first + (second - first) * degree
    elif kind == SIGMOID:
        # a logarithm of zero would warn when numba is disabled
        away = -np.log(1.0 / degree - 1.0) if degree < 1.0 else np.inf
        place = first + away / second
    elif kind == CONCAVE:
        place = 2.0 * second - first + (first - second) / degree
    elif kind == ARC:
        place = second + (first - second) * np.sqrt(1.0 - degree * degree)
    else:
        foot, top = (first, second) if kind == S_SHAPE else (second, first)
        if degree <= 0.5:
            place = foot + (top - foot) * np.sqrt(degree / 2.0)
        else:
            place = top - (top - foot) * np.sqrt((1.0 - degree) / 2.0)
    return place
