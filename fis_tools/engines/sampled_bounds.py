"""Bounds of outputs that are sums over points, compiled.

The heights at an output's points rise with the strengths of rules, whatever the implication and the
aggregation, so that bounds on strengths give a lower and an upper height at each point. The least centroid
has upper heights up to some point and lower ones beyond, as N. N. Karnik and J. M. Mendel show (Information
Sciences 132, 2001): every such switch is tried. No bound leaves the output's range.
"""

import numpy as np

from fis_tools.array_types import Floats
from fis_tools.compiled.decorator import compiled
from fis_tools.engines import codes
from fis_tools.engines.defuzzification import TIE
from fis_tools.engines.intervals import extreme_mean
from fis_tools.engines.program import Conclusion
from fis_tools.engines.sampling import aggregate

EPSILON = float(np.finfo(np.float64).eps)
#: The least strength that others are divided by.
FAINTEST = 1e-280


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
        may_be_silent = low.max() == 0.0
        if conclusion.defuzzifier == codes.CENTROID and _relate(conclusion, strengths[box], low, high):
            low *= 1.0 - rounding
            high *= 1.0 + rounding
            narrowed = _bounds(conclusion, low, high)
            least, greatest = max(least, narrowed[0]), min(greatest, narrowed[1])
        out[box] = max(least, x[0]), min(greatest, x[-1])
        if may_be_silent and not np.isnan(default):  # perhaps no rule fires; NaN is no output to bound
            out[box] = min(out[box, 0], default), max(out[box, 1], default)


@compiled(error_model="numpy", nogil=True)
def _relate(conclusion: Conclusion, strengths: Floats, low: Floats, high: Floats) -> bool:
    """Bound heights divided by the strength of one rule, which leaves a centroid as it is.

    Where all rules fire faintly their strengths vary by orders of magnitude, and so do heights; their ratios
    hardly do. Return whether there are such bounds: not where each rule may have the strength zero, or
    heights do not scale with strengths.
    """
    rules, weights, memberships = conclusion.rules, conclusion.weights, conclusion.memberships
    implication, aggregation = conclusion.implication, conclusion.aggregation
    if implication not in (codes.MIN, codes.PRODUCT) or aggregation not in (codes.MAX, codes.UNBOUNDED_SUM):
        return False
    surest = 0
    for index in range(1, len(rules)):
        if strengths[rules[index], 0] * weights[index] > strengths[rules[surest], 0] * weights[surest]:
            surest = index
    least, most = strengths[rules[surest], 0] * weights[surest], strengths[rules[surest], 1] * weights[surest]
    if least < FAINTEST:
        return False
    low[:] = 0.0
    high[:] = 0.0
    for index in range(len(rules)):
        ratio_low = strengths[rules[index], 0] * weights[index] / most
        ratio_high = strengths[rules[index], 1] * weights[index] / least
        if rules[index] == rules[surest]:
            ratio_low = ratio_high = weights[index] / weights[surest]
        for point in range(len(low)):
            height = memberships[conclusion.terms[index], point]
            height_low, height_high = ratio_low * height, ratio_high * height
            if implication == codes.MIN:
                height_low, height_high = min(ratio_low, height / most), min(ratio_high, height / least)
            if aggregation == codes.MAX:
                low[point], high[point] = max(low[point], height_low), max(high[point], height_high)
            else:
                low[point], high[point] = low[point] + height_low, high[point] + height_high
    return bool(high.max() > 0.0)


@compiled(error_model="numpy", nogil=True)
def _bounds(conclusion: Conclusion, low: Floats, high: Floats) -> tuple[float, float]:
    """Bound the defuzzified value for heights between a lower and an upper set."""
    x = conclusion.universe
    slack = 4 * EPSILON * (len(x) + 4) * max(abs(x[0]), abs(x[-1]))
    if conclusion.defuzzifier == codes.CENTROID:
        least, greatest = extreme_mean(x, low, high, 1), extreme_mean(x, low, high, -1)
    elif conclusion.defuzzifier == codes.BISECTOR:
        least, greatest = _bisectors(conclusion.sampling, x, low, high)
    else:
        candidates = x[high >= low.max() * (1.0 - 2.0 * TIE)]
        least, greatest = candidates[0], candidates[-1]
    return least - slack, greatest + slack


@compiled(error_model="numpy", nogil=True)
def _bisectors(sampling: int, x: Floats, low: Floats, high: Floats) -> tuple[float, float]:
    """Return the first and the last point at which half of a sum may be reached, widened by a point.

    Ties count: fuzzylite takes the mean of all points that are as near to half, also those before and behind
    at which hardly anything is added. jFuzzyLogic leaves both ends out of its sums.
    """
    if sampling == codes.FCL:
        low, high = low.copy(), high.copy()
        low[0] = low[-1] = high[0] = high[-1] = 0.0
    first, last = -1, len(x) - 1
    left_high, left_low = 0.0, 0.0
    right_low, right_high = low.sum(), high.sum()
    share, tie = 4 * EPSILON * (len(x) + 4) + 4.0 * TIE, 4.0 * TIE * high.sum()
    for point in range(len(x)):
        left_high, left_low = left_high + high[point], left_low + low[point]
        right_low, right_high = right_low - low[point], right_high - high[point]
        if first < 0 and left_high >= right_low * (1.0 - share) - share * left_high:
            first = point
        if left_low >= right_high * (1.0 + share) + share * left_low:
            last = point
            break
    first, last = max(first - 1, 0), min(last + 1, len(x) - 1)
    if sampling == codes.FUZZYLITE:
        before, behind = 0.0, 0.0
        while first > 0 and before + low[first] <= tie:
            before += low[first]
            first -= 1
        while last < len(x) - 1 and behind + low[last + 1] <= tie:
            last += 1
            behind += low[last]
    return x[first], x[last]
