"""Outputs as sums over points, compiled, one by one: how MATLAB, fuzzylite and jFuzzyLogic defuzzify.

A result is a mean of points, or one of them, so it lies inside an output's range, however faintly rules fire.
"""

import numpy as np

from fis_tools.array_types import Floats
from fis_tools.compiled.decorator import compiled
from fis_tools.engines import codes
from fis_tools.engines.codes import combine
from fis_tools.engines.defuzzification import TIE
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
        for point in range(len(heights)):
            implied = combine(implication, strength, memberships[terms[index], point])
            heights[point] = combine(aggregation, heights[point], implied)


@compiled(error_model="numpy", nogil=True)
def defuzzify(conclusion: Conclusion | Summation, heights: Floats) -> float:
    """Return the number of aggregated heights, which it may scale; the default if all are zero."""
    x, method = conclusion.universe, conclusion.defuzzifier
    highest = heights.max()
    if highest == 0.0:
        return float(conclusion.default)
    if highest < FAINT:
        highest *= RAISE
        for point in range(len(heights)):
            heights[point] *= RAISE
    if method == codes.CENTROID:
        return _centroid(x, heights)
    if method == codes.BISECTOR:
        return _bisector(conclusion.sampling, x, heights, conclusion.default)
    return _of_maximum(conclusion.sampling, method, x, heights, highest)


@compiled(error_model="numpy", nogil=True)
def _centroid(x: Floats, heights: Floats) -> float:
    """Return the centroid of heights at points, inside their range."""
    area, moment = 0.0, 0.0
    for point in range(len(x)):
        area += heights[point]
        moment += x[point] * heights[point]
    return float(min(max(moment / area, x[0]), x[-1]))


@compiled(error_model="numpy", nogil=True)
def _bisector(sampling: int, x: Floats, heights: Floats, default: float) -> float:
    """Return the point with half of the sum on either side, as each program finds it.

    MATLAB takes the first point at which half is reached; fuzzylite the mean of those whose running share is
    nearest to a half; jFuzzyLogic walks from both ends, always on the side with the smaller sum, and finds
    nothing where all that it summed from the left is zero. Sums are compared up to rounding, so that all
    engines take the same points.
    """
    total = heights.sum()
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
        return float(min(x[0] + (x[1] - x[0]) * low, x[-1]))
    running, nearest = 0.0, np.inf
    for point in range(len(x)):
        running += heights[point]
        nearest = min(nearest, abs(running / total - 0.5))
        if sampling == codes.MATLAB and running >= total / 2.0 * (1.0 - TIE):
            return float(x[point])
    running, count, moment = 0.0, 0, 0.0
    for point in range(len(x)):
        running += heights[point]
        if abs(running / total - 0.5) <= nearest + TIE:
            count += 1
            moment += x[point]
    return float(moment / count)


@compiled(error_model="numpy", nogil=True)
def _of_maximum(sampling: int, method: int, x: Floats, heights: Floats, highest: float) -> float:
    """Return the mean, the smallest or the largest of the highest points; MATLAB's by magnitude.

    Points count as highest up to rounding, so that all engines take the same.
    """
    count, total, smallest, largest = 0, 0.0, np.nan, np.nan
    for point in range(len(x)):
        if heights[point] >= highest * (1.0 - TIE):
            value = x[point]
            size = abs(value) if sampling == codes.MATLAB else value
            if count == 0 or size < (abs(smallest) if sampling == codes.MATLAB else smallest):
                smallest = value
            if count == 0 or size > (abs(largest) if sampling == codes.MATLAB else largest):
                largest = value
            count += 1
            total += value
    if method == codes.MEAN_OF_MAXIMUM:
        return float(total / count)
    return float(smallest if method == codes.SMALLEST_OF_MAXIMUM else largest)
