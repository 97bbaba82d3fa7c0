"""Bounds of outputs that are sums over points, compiled.

The heights at an output's points rise with the strengths of rules, whatever the implication and the
aggregation, so that bounds on strengths give a lower and an upper height at each point. The least centroid
has upper heights up to some point and lower ones beyond, as N. N. Karnik and J. M. Mendel show (Information
Sciences 132, 2001): every such switch is tried. No bound leaves the output's range.
"""

import numpy as np

from fis_tools.array_types import Floats
from fis_tools.compiled.decorator import compiled
from fis_tools.engines import program as codes
from fis_tools.engines.inference import TIE
from fis_tools.engines.intervals import extreme_mean
from fis_tools.engines.program import Conclusion
from fis_tools.engines.sampling import aggregate

EPSILON = float(np.finfo(np.float64).eps)


@compiled(error_model="numpy", nogil=True)
def bound_sampled(conclusion: Conclusion, strengths: Floats, out: Floats) -> None:
    """Bound one output, (n, 2), for bounded firing strengths, (n, rules, 2)."""
    x, default = conclusion.universe, conclusion.default
    low, high = np.empty(len(x)), np.empty(len(x))
    cuts = np.empty(len(conclusion.memberships))
    rounding = 8 * EPSILON * (len(conclusion.rules) + 1)
    for box in range(len(strengths)):
        aggregate(conclusion, strengths[box, :, 0].copy(), cuts, low)
        aggregate(conclusion, strengths[box, :, 1].copy(), cuts, high)
        low *= 1.0 - rounding
        high *= 1.0 + rounding
        if high.max() == 0.0:
            out[box] = default, default
            continue
        least, greatest = _bounds(conclusion, low, high)
        out[box] = max(least, x[0]), min(greatest, x[-1])
        if low.max() == 0.0 and not np.isnan(default):  # perhaps no rule fires; NaN is no output to bound
            out[box] = min(out[box, 0], default), max(out[box, 1], default)


@compiled(error_model="numpy", nogil=True)
def _bounds(conclusion: Conclusion, low: Floats, high: Floats) -> tuple[float, float]:
    x = conclusion.universe
    if conclusion.defuzzifier == codes.CENTROID:
        slack = 4 * EPSILON * (len(x) + 4) * max(abs(x[0]), abs(x[-1]))
        return extreme_mean(x, low, high, 1) - slack, extreme_mean(x, low, high, -1) + slack
    if conclusion.defuzzifier == codes.BISECTOR:
        return _bisectors(x, low, high)
    candidates = x[high >= low.max() * (1.0 - 2.0 * TIE)]
    slack = 4 * EPSILON * len(x) * max(abs(x[0]), abs(x[-1]))
    return candidates[0] - slack, candidates[-1] + slack


@compiled(error_model="numpy", nogil=True)
def _bisectors(x: Floats, low: Floats, high: Floats) -> tuple[float, float]:
    """Return the first and the last point at which half of a sum may be reached, widened by a point."""
    first, last = -1, len(x) - 1
    left_high, left_low = 0.0, 0.0
    right_low, right_high = low.sum(), high.sum()
    share = 4 * EPSILON * (len(x) + 4)
    for point in range(len(x)):
        left_high, left_low = left_high + high[point], left_low + low[point]
        right_low, right_high = right_low - low[point], right_high - high[point]
        if first < 0 and left_high >= right_low * (1.0 - share) - share * left_high:
            first = point
        if left_low >= right_high * (1.0 + share) + share * left_low:
            last = point
            break
    return x[max(first - 1, 0)], x[min(last + 1, len(x) - 1)]
