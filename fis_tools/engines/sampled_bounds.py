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
#: Lower heights below this are counted as zero: a product on the way to them may be denormal, and has so few
#: digits that they may pass the upper ones.
UNSURE = 1e-140


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
        for point in range(len(x)):
            if low[point] < UNSURE:
                low[point], high[point] = 0.0, max(low[point], high[point])
        first = 1 if _walks(conclusion) else 0  # jFuzzyLogic's walk leaves out the first point
        if not high[first:].any():
            out[box] = default, default
            continue
        least, greatest = _bounds(conclusion, low, high)
        may_be_silent = not low[first:].any()
        if conclusion.defuzzifier == codes.CENTROID and _relate(conclusion, strengths[box], low, high):
            low *= 1.0 - rounding
            high *= 1.0 + rounding
            narrowed = _bounds(conclusion, low, high)
            least, greatest = max(least, narrowed[0]), min(greatest, narrowed[1])
        out[box] = max(least, x[0]), min(greatest, x[-1])
        if may_be_silent and not np.isnan(default):  # NaN is no output to bound
            out[box] = min(out[box, 0], default), max(out[box, 1], default)


@compiled(error_model="numpy", nogil=True)
def _walks(conclusion: Conclusion) -> bool:
    """Return whether half of the sum is found by walks from both ends."""
    return conclusion.defuzzifier == codes.BISECTOR and conclusion.sampling == codes.FCL


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
    elif _walks(conclusion):
        least, greatest = _meetings(x, low, high)
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
    at which hardly anything is added.
    """
    first, last = -1, len(x) - 1
    left_high, left_low = 0.0, 0.0
    right_lows, right_highs = _sums_from(low), _sums_from(high)
    share, tie = 4 * EPSILON * (len(x) + 4) + 4.0 * TIE, 4.0 * TIE * high.sum()
    for point in range(len(x)):
        left_high, left_low = left_high + high[point], left_low + low[point]
        right_low, right_high = right_lows[point + 1], right_highs[point + 1]
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


@compiled(error_model="numpy", nogil=True)
def _sums_from(heights: Floats) -> Floats:
    """Return sums of heights from each point on, and zero: differences would lose what is faint."""
    sums = np.zeros(len(heights) + 1)
    for point in range(len(heights) - 1, -1, -1):
        sums[point] = sums[point + 1] + heights[point]
    return sums


@compiled(error_model="numpy", nogil=True)
def _meetings(x: Floats, low: Floats, high: Floats) -> tuple[float, float]:
    """Return the first and the last point at which jFuzzyLogic's walks from both ends may meet.

    With S the sum of the heights of points, and n the last one, they meet at k only if S(1..k-1), which the
    lower walk had when it went on to k, is no more than S(k..n-1), and S(1..k), which the upper walk compared
    itself with at most when it went on, is no less than S(k+1..n-1). Both walks leave out an end. They meet
    at n only if S(1..n-1) is zero: the upper walk never went on. Else some height up to k is positive, and
    some from k on.
    """
    last = len(x) - 1
    share = 4 * EPSILON * (len(x) + 4) + 4.0 * TIE
    rests_low, rests_high = _sums_from(low[:last]), _sums_from(high[:last])
    inner_low, inner_high = rests_low[1], rests_high[1]
    before_low, to_high = 0.0, 0.0
    least, greatest = last, 0
    end = 0
    for point in range(1, last):
        end = point if high[point] > 0.0 else end
    for point in range(1, end + 1):
        to_high += high[point]
        rest_high, rest_low = rests_high[point], rests_low[point + 1]
        # of S(1..k), S(k+1..n-1); of S(1..k-1), S(k..n-1)
        if to_high > 0.0 and to_high >= rest_low * (1.0 - share) - share * inner_low:
            least = min(least, point)
        if before_low <= rest_high * (1.0 + share) + share * inner_high:
            greatest = max(greatest, point)
        before_low += low[point]
    if inner_low == 0.0 and high[last] > 0.0:
        greatest = last
    # points are added up from the first one, by steps as wide as the first
    return min(x[least], x[0] + (x[1] - x[0]) * least), max(x[greatest], x[0] + (x[1] - x[0]) * greatest)
