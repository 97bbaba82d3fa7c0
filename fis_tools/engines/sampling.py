"""Outputs as sums over points, compiled, one by one: how MATLAB, fuzzylite and jFuzzyLogic defuzzify.

A result is a mean of points, or one of them, so it lies inside an output's range, however faintly rules fire.
"""

from fis_tools.array_types import Floats
from fis_tools.compiled.decorator import compiled
from fis_tools.engines import codes
from fis_tools.engines.defuzzification import TIE
from fis_tools.engines.defuzzifier import imply
from fis_tools.engines.program import Conclusion, Summation

#: Heights below this are raised before they are summed, as products with them would lose digits: by a power
#: of two, which adds no rounding. The reciprocal of the highest, where it is denormal, would overflow.
FAINT, RAISE = 1e-200, 2.0**600


@compiled(error_model="numpy", nogil=True)
def aggregate(conclusion: Conclusion | Summation, firing: Floats, cuts: Floats, heights: Floats) -> None:
    """Write the aggregated heights at an output's points, for the firing strengths of one sample."""
    memberships, rules, weights, terms = (
        conclusion.memberships,
        conclusion.rules,
        conclusion.weights,
        conclusion.terms,
    )
    implication, aggregation = conclusion.implication, conclusion.aggregation
    heights[:] = 0.0
    if implication == codes.MIN and aggregation == codes.MAX:  # only the strongest rule of a term counts
        cuts[:] = 0.0
        for index in range(len(rules)):
            cuts[terms[index]] = max(cuts[terms[index]], firing[rules[index]] * weights[index])
        for term in range(len(cuts)):
            cut = cuts[term]
            if cut > 0.0:
                for point in range(len(heights)):
                    height = memberships[term, point] if memberships[term, point] < cut else cut
                    heights[point] = height if height > heights[point] else heights[point]
        return
    for index in range(len(rules)):
        strength = firing[rules[index]] * weights[index]
        imply(implication, aggregation, memberships[terms[index]], strength, heights)


@compiled(error_model="numpy", nogil=True)
def defuzzify(conclusion: Conclusion | Summation, heights: Floats) -> float:
    """Return the number of aggregated heights, which it may scale; the default if all are zero."""
    x, sampling, method = conclusion.universe, conclusion.sampling, conclusion.defuzzifier
    return defuzzify_sampled(sampling, method, x, heights, conclusion.default)


@compiled(error_model="numpy", nogil=True)
def defuzzify_sampled(sampling: int, method: int, x: Floats, heights: Floats, default: float) -> float:
    """Return the number of heights at points, which it may scale; the default if all are zero."""
    highest = _raise_faint(heights)
    if highest == 0.0:
        return default
    if method == codes.CENTROID:
        return _sampled_centroid(x, heights)
    if method == codes.BISECTOR:
        return _sampled_bisector(sampling, x, heights, default)
    return _sampled_maximum(sampling, method, x, heights, highest)


@compiled(error_model="numpy", nogil=True)
def _raise_faint(heights: Floats) -> float:
    """Raise heights that are all faint; return the highest."""
    highest = 0.0
    for point in range(len(heights)):
        highest = heights[point] if heights[point] > highest else highest
    if 0.0 < highest < FAINT:
        highest *= RAISE
        for point in range(len(heights)):
            heights[point] *= RAISE
    return highest


@compiled(error_model="numpy", nogil=True)
def _sampled_centroid(x: Floats, heights: Floats) -> float:
    """Return the centroid of heights at points, inside their range."""
    area, moment = 0.0, 0.0
    for point in range(len(x)):
        area += heights[point]
        moment += x[point] * heights[point]
    return float(min(max(moment / area, x[0]), x[len(x) - 1]))


@compiled(error_model="numpy", nogil=True)
def _sampled_bisector(sampling: int, x: Floats, heights: Floats, default: float) -> float:
    """Return the point with half of the sum on either side, as each program finds it.

    MATLAB takes the first point at which half is reached; fuzzylite the mean of those whose running share is
    nearest to a half; jFuzzyLogic walks from both ends, always on the side with the smaller sum, and finds
    nothing where all that it summed from the left is zero. Sums are compared up to rounding, so that all
    engines take the same points.
    """
    if sampling == codes.FCL:
        low, high, sum_low, sum_high = 0, len(x) - 1, 0.0, 0.0
        while low < high:
            if sum_low <= sum_high * (1.0 + TIE):
                low += 1
                sum_low += heights[low]
            else:
                high -= 1
                sum_high += heights[high]
        if sum_low == 0.0:
            return default
        return float(min(x[0] + (x[1] - x[0]) * low, x[len(x) - 1]))
    total = 0.0
    for point in range(len(x)):
        total += heights[point]
    if sampling == codes.MATLAB:
        last, running = 0, heights[0]
        while last < len(x) - 1 and not running >= total / 2.0 * (1.0 - TIE):
            last += 1
            running += heights[last]
        return float(x[last])
    running, nearest = 0.0, 2.0
    for point in range(len(x)):
        running += heights[point]
        nearest = min(nearest, abs(running / total - 0.5))
    running, count, moment = 0.0, 0, 0.0
    for point in range(len(x)):
        running += heights[point]
        if abs(running / total - 0.5) <= nearest + TIE:
            count += 1
            moment += x[point]
    return float(moment / count)


@compiled(error_model="numpy", nogil=True)
def _sampled_maximum(sampling: int, method: int, x: Floats, heights: Floats, highest: float) -> float:
    """Return the mean, the smallest or the largest of the highest points; MATLAB's by magnitude.

    Points count as highest up to rounding, so that all engines take the same.
    """
    count, total, best, extreme = 0, 0.0, 0.0, 0.0
    for point in range(len(x)):
        if heights[point] >= highest * (1.0 - TIE):
            size = abs(x[point]) if sampling == codes.MATLAB else x[point]
            if method == codes.MEAN_OF_MAXIMUM:
                total += x[point]
            elif count == 0 or (size < extreme if method == codes.SMALLEST_OF_MAXIMUM else size > extreme):
                best, extreme = x[point], size
            count += 1
    return total / count if method == codes.MEAN_OF_MAXIMUM else best
