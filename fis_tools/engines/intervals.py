"""Outputs of interval type-2 systems, compiled: two sets or strengths of rules, reduced to a number.

The least mean of points, whose weights lie between bounds, has upper weights up to some point and lower ones
beyond, so every such switch is tried. That is exact; the algorithms that search for the switch (Karnik and
Mendel's, EIASC) end there, too.
"""

import numpy as np

from fis_tools.array_types import Floats
from fis_tools.compiled.decorator import compiled
from fis_tools.engines.program import Conclusion, Weighing
from fis_tools.engines.sampling import FAINT, RAISE, aggregate

EPSILON = float(np.finfo(np.float64).eps)


@compiled(error_model="numpy", nogil=True)
def conclude_interval(
    lower: Conclusion, upper: Conclusion, is_mean: bool, firing: Floats, out: Floats
) -> None:
    """Compute one output for firing strengths (n, 2 num_rules), lower ones first."""
    x = upper.universe
    low, high = np.empty(len(x)), np.empty(len(x))
    cuts = np.empty(max(len(lower.memberships), len(upper.memberships)))
    for sample in range(len(firing)):
        aggregate(lower, firing[sample], cuts[: len(lower.memberships)], low)
        aggregate(upper, firing[sample], cuts[: len(upper.memberships)], high)
        out[sample] = upper.default if high.max() == 0.0 else reduce_interval(x, low, high, is_mean)


@compiled(error_model="numpy", nogil=True)
def weigh_interval(
    lower: Weighing,
    upper: Weighing,
    is_mean: bool,
    firing: Floats,
    values: Floats,
    limits: Floats,
    out: Floats,
) -> None:
    """Compute one output of numbers for firing strengths (n, 2 num_rules) and inputs (n, num_inputs)."""
    count, num_inputs = len(upper.rules), values.shape[1]
    x, low, high = np.empty(count), np.empty(count), np.empty(count)
    for sample in range(len(firing)):
        used = 0
        for index in range(count):
            high[used] = firing[sample, upper.rules[index]] * upper.weights[index]
            if high[used] <= 0.0:  # what it would conclude may be infinite
                continue
            low[used] = firing[sample, lower.rules[index]] * lower.weights[index]
            x[used] = upper.parameters[index, num_inputs]
            for column in range(num_inputs):
                value = min(max(values[sample, column], limits[column, 0]), limits[column, 1])
                if upper.parameters[index, column] != 0.0:
                    x[used] += upper.parameters[index, column] * value
            used += 1
        if used == 0:
            out[sample] = upper.default
        else:
            order = np.argsort(x[:used])
            out[sample] = reduce_interval(x[order], low[order], high[order], is_mean)


@compiled(error_model="numpy", nogil=True)
def reduce_interval(x: Floats, low: Floats, high: Floats, is_mean: bool) -> float:
    """Return the type-reduced number of ascending points whose weights lie between bounds."""
    if high.max() < FAINT:
        low, high = low * RAISE, high * RAISE
    if is_mean:  # Nie and Tan's type reduction
        both = low + high
        return float(min(max((x * both).sum() / both.sum(), x[0]), x[-1]))
    return 0.5 * (extreme_mean(x, low, high, 1) + extreme_mean(x, low, high, -1))


@compiled(error_model="numpy", nogil=True)
def extreme_mean(x: Floats, low: Floats, high: Floats, sign: int) -> float:
    """Return the least (1) or the greatest (-1) mean of points whose weights lie between bounds.

    Every switch from the lower to the upper bounds is tried. Faint weights have few digits, and are raised.
    Where others then leave the range of numbers, nothing but the points' range is known.
    """
    for index in range(len(x)):
        if 0.0 < high[index] < FAINT or 0.0 < low[index] < FAINT:
            low, high = low * RAISE, high * RAISE
            break
    area, moment, extreme = low.sum(), (low * x).sum(), np.inf
    for step in range(len(x)):
        point = step if sign > 0 else len(x) - 1 - step
        area += high[point] - low[point]
        moment += (high[point] - low[point]) * x[point]
        if not (np.isfinite(area) and np.isfinite(moment)):
            return float(x[0] if sign > 0 else x[-1])
        if area > 0.0:
            extreme = min(extreme, sign * (moment / area))
    # without weights any point may be the mean
    return float(sign * min(extreme, sign * (x[-1] if sign > 0 else x[0])))


@compiled(error_model="numpy", nogil=True)
def bound_interval(
    lower: Conclusion, upper: Conclusion, is_mean: bool, strengths: Floats, out: Floats
) -> None:
    """Bound one output, (n, 2), for bounded firing strengths, (n, 2 num_rules, 2)."""
    x = upper.universe
    low, high = np.empty((2, len(x))), np.empty((2, len(x)))
    cuts = np.empty(max(len(lower.memberships), len(upper.memberships)))
    rounding = 8 * EPSILON * (len(upper.rules) + 1)
    for box in range(len(strengths)):
        for end in range(2):
            aggregate(lower, strengths[box, :, end].copy(), cuts[: len(lower.memberships)], low[end])
            aggregate(upper, strengths[box, :, end].copy(), cuts[: len(upper.memberships)], high[end])
            low[end] *= 1.0 - rounding if end == 0 else 1.0 + rounding
            high[end] *= 1.0 - rounding if end == 0 else 1.0 + rounding
        _bound_box(x, low, high, is_mean, upper.default, out[box])


@compiled(error_model="numpy", nogil=True)
def bound_weighed(lower: Weighing, upper: Weighing, is_mean: bool, strengths: Floats, out: Floats) -> None:
    """Bound one output of constant numbers, like `bound_interval`."""
    order = np.argsort(upper.parameters[:, -1])
    x = upper.parameters[order, -1]
    low, high = np.empty((2, len(x))), np.empty((2, len(x)))
    for box in range(len(strengths)):
        for end in range(2):
            outward = 1.0 - 4 * EPSILON if end == 0 else 1.0 + 4 * EPSILON
            for slot in range(len(x)):
                index = order[slot]
                low[end, slot] = strengths[box, lower.rules[index], end] * lower.weights[index] * outward
                high[end, slot] = strengths[box, upper.rules[index], end] * upper.weights[index] * outward
        _bound_box(x, low, high, is_mean, upper.default, out[box])


@compiled(error_model="numpy", nogil=True)
def _bound_box(x: Floats, low: Floats, high: Floats, is_mean: bool, default: float, out: Floats) -> None:
    """Write bounds of the reduced number of points with bounded lower and upper weights, each (2, m)."""
    if not high[1].any():
        out[:] = default
        return
    slack = 8 * EPSILON * (len(x) + 4) * max(abs(x[0]), abs(x[-1]))
    if is_mean:
        weights = low[0] + high[0], low[1] + high[1]
        least, greatest = (
            extreme_mean(x, weights[0], weights[1], 1),
            extreme_mean(x, weights[0], weights[1], -1),
        )
    else:
        left = extreme_mean(x, low[0], high[1], 1)
        right = extreme_mean(x, low[0], high[1], -1)
        least = 0.5 * (left + _least_right(x, low, high, left))
        greatest = 0.5 * (right - _least_right(-x[::-1], low[:, ::-1].copy(), high[:, ::-1].copy(), -right))
    out[0], out[1] = max(least - slack, x[0]), min(greatest + slack, x[-1])
    if high[0].max() == 0.0 and not np.isnan(default):  # perhaps no rule fires
        out[0], out[1] = min(out[0], default), max(out[1], default)


@compiled(error_model="numpy", nogil=True)
def _least_right(x: Floats, low: Floats, high: Floats, worst: float) -> float:
    """Return a lower bound on the greatest mean of points, whose lower and upper weights are bounded.

    The greatest mean is no less than that of any switch, lower weights up to it and upper ones beyond; the
    switch of the lowest weights is taken, with its least mean. `worst` holds where that may be of nothing.
    """
    area, moment, greatest, switch = low[0].sum(), (low[0] * x).sum(), -np.inf, len(x)
    for point in range(len(x) - 1, -1, -1):
        area += high[0, point] - low[0, point]
        moment += (high[0, point] - low[0, point]) * x[point]
        if area > 0.0 and moment / area > greatest:
            greatest, switch = moment / area, point
    least, most = low[0].copy(), low[1].copy()
    least[switch:], most[switch:] = high[0, switch:], high[1, switch:]
    return worst if least.sum() <= 0.0 else extreme_mean(x, least, most, 1)
