"""What each rule adds to an output that is weighed: exact, and it adds up."""

import numpy as np

from fis_tools.engines import interpreter
from fis_tools.engines.program import FORMULA, INVERTED, NUMBER, WEIGHTED_SUM, Program, Weighing
from fis_tools.engines.weigher import formula_values
from fis_tools.typing import Floats


def weighed_shares(program: Program, weighing: Weighing, firing: Floats, inputs: Floats) -> Floats:
    """Part an output less its default among the rules.

    Of a weighted average a rule's share is ``w (z - default) / W``, where w is its strength, z the number
    that it concludes and W the sum of all strengths; of a weighted sum it is ``w z - w / W default``. They
    add up, and there is nothing to sample.

    Parameters
    ----------
    program, weighing : Program, Weighing
        A system, and one of its outputs.
    firing : (n, num_rules)
        How far each antecedent holds, before weights.
    inputs : (n, num_inputs)

    Returns
    -------
    (n, num_rules)
        In the unit of the output; zero where a rule is silent.
    """
    strengths = firing[:, weighing.rules] * weighing.weights
    numbers = _numbers(program, weighing, firing, strengths, inputs)
    total = strengths.sum(axis=1, keepdims=True)
    default = 0.0 if np.isnan(weighing.default) else weighing.default
    parts = np.where(strengths > 0.0, strengths, 0.0) / np.where(total > 0.0, total, 1.0)
    scale = total if weighing.defuzzifier == WEIGHTED_SUM else 1.0
    moved = parts * (scale * np.where(strengths > 0.0, numbers, 0.0) - default)
    found = np.zeros(firing.shape)
    for column, rule in enumerate(weighing.rules):
        found[:, rule] += moved[:, column]
    return found


def _numbers(
    program: Program, weighing: Weighing, firing: Floats, strengths: Floats, inputs: Floats
) -> Floats:
    """Return what each rule concludes, (n, c)."""
    low, high = program.ends.T
    clipped = np.clip(inputs, low, high)
    num_inputs = clipped.shape[1]
    found = np.empty(strengths.shape)
    outputs = interpreter.conclude(program, firing, inputs).T if weighing.formulas else np.empty((0, 0))
    formulas = formula_values(weighing, inputs, program.ends, outputs)
    for column, kind in enumerate(weighing.kinds):
        row = weighing.parameters[column]
        if kind == NUMBER:
            found[:, column] = clipped @ row[:num_inputs] + row[num_inputs]
            continue
        if kind == FORMULA:
            found[:, column] = formulas[:, int(row[0])]
            continue
        shape = INVERTED[kind](*row[:2])
        degrees = np.clip(strengths[:, column], np.finfo(np.float64).tiny, 1.0)
        found[:, column] = np.clip(shape.inverse(degrees), *_limits(weighing, shape.inverse(degrees)))
    return found


def _limits(weighing: Weighing, places: Floats) -> tuple[Floats, Floats]:
    """Return between what places lie: infinite ones at the ends of the range."""
    is_far = np.isinf(places)
    return np.where(is_far, weighing.low, -np.inf), np.where(is_far, weighing.high, np.inf)
