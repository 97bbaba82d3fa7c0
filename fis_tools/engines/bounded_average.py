"""Bounds on averages and sums of the numbers that rules conclude, over boxes of inputs, compiled.

Bounds are rows of two numbers, the lower first; every step is rounded outward (`fis_tools.engines.interval`).
"""

import numpy as np

from fis_tools.array_types import Floats
from fis_tools.compiled.decorator import compiled
from fis_tools.engines import codes
from fis_tools.engines.defuzzifier import invert
from fis_tools.engines.outward import EPSILON, widened
from fis_tools.engines.program import Weighing


@compiled(error_model="numpy", nogil=True)
def weigh(weighing: Weighing, low: Floats, high: Floats, strengths: Floats, out: Floats) -> None:
    """Bound one weighted output, for bounded firing strengths, (n, rules, 2), of boxes in the universes."""
    count, is_sum = len(weighing.rules), weighing.defuzzifier == codes.WEIGHTED_SUM
    scale = 1.0 if is_sum else codes.RAISED_WEIGHT
    weights, numbers = np.empty((count, 2)), np.empty((count, 2))
    for box in range(len(strengths)):
        for index in range(count):
            least, greatest = strengths[box, weighing.rules[index]]
            weight = weighing.weights[index]
            weights[index] = widened(least * weight, greatest * weight)
            numbers[index] = _number(weighing, index, low[box], high[box], weights[index])
            weights[index] *= scale
        least_total, greatest_total = weights[:, 0].sum(), weights[:, 1].sum()
        if greatest_total == 0.0:
            out[box] = weighing.default, weighing.default
            continue
        size = np.abs(numbers).max()
        if is_sum:
            least = np.minimum(weights[:, 0] * numbers[:, 0], weights[:, 1] * numbers[:, 0]).sum()
            greatest = np.maximum(weights[:, 0] * numbers[:, 1], weights[:, 1] * numbers[:, 1]).sum()
            size *= greatest_total
        else:
            least, greatest = _least_average(weights, numbers[:, 0]), -_least_average(weights, -numbers[:, 1])
        # what products of faint strengths lose is no more, as they are raised
        slack = 4 * EPSILON * (count + 4) * size + count / codes.RAISED_WEIGHT
        least, greatest = least - slack, greatest + slack
        if least_total == 0.0 and not np.isnan(weighing.default):  # NaN is no output, which nothing bounds
            least, greatest = min(least, weighing.default), max(greatest, weighing.default)
        out[box] = least, greatest


@compiled(error_model="numpy", nogil=True)
def _least_average(weights: Floats, numbers: Floats) -> float:
    """Return the least average for bounded weights: high ones up to a switch, then low ones."""
    order = np.argsort(numbers)
    total, moment = weights[:, 0].sum(), (weights[:, 0] * numbers).sum()
    least = np.inf
    for index in order:
        total += weights[index, 1] - weights[index, 0]
        moment += (weights[index, 1] - weights[index, 0]) * numbers[index]
        if total > 0.0:
            least = min(least, moment / total)
    return least


@compiled(error_model="numpy", nogil=True)
def _number(
    weighing: Weighing, index: int, low: Floats, high: Floats, degrees: Floats
) -> tuple[float, float]:
    """Bound the number that one rule concludes."""
    row, kind = weighing.parameters[index], weighing.kinds[index]
    if kind != codes.NUMBER:
        x = invert(kind, row[0], row[1], max(degrees[0], 0.0))
        other = invert(kind, row[0], row[1], min(degrees[1], 1.0))
        slack = 8 * EPSILON * max(abs(row[0]), abs(row[1]))
        return min(x, other) - slack, max(x, other) + slack
    num_inputs = len(low)
    least = greatest = row[num_inputs]
    size = abs(least)
    for column in range(num_inputs):
        left, right = row[column] * low[column], row[column] * high[column]
        least, greatest = least + min(left, right), greatest + max(left, right)
        size += max(abs(left), abs(right))
    slack = 4 * EPSILON * (num_inputs + 1) * size
    return least - slack, greatest + slack
