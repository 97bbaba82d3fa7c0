"""Bounds on what defuzzifying an aggregated set returns, over boxes of inputs, compiled.

Bounds are rows of two numbers, the lower first; every step is rounded outward (`fis_tools.engines.interval`).
"""

import numpy as np

from fis_tools.array_types import Floats
from fis_tools.compiled.decorator import compiled
from fis_tools.engines import codes
from fis_tools.engines.defuzzification import SMALLEST_AREA
from fis_tools.engines.outward import EPSILON, INTERPOLATION_ERROR, combine_bounds, widened
from fis_tools.engines.program import Conclusion

# Columns of a segment of the output's universe: area and moment of the function below all possible sets and
# of the one above, then the ends of a line below the one and of a line above the other.
AREA_LOW, MOMENT_LOW, AREA_HIGH, MOMENT_HIGH, LEFT_LOW, RIGHT_LOW, LEFT_HIGH, RIGHT_HIGH = range(8)
NUM_COLUMNS = 8
#: The width of a segment; the lower line at its left and right end; the upper one.
Lines = tuple[float, float, float, float, float]


@compiled(error_model="numpy", nogil=True)
def conclude(conclusion: Conclusion, strengths: Floats, out: Floats) -> None:
    """Bound one output for bounded firing strengths, (n, rules, 2)."""
    num_terms, num_points = conclusion.memberships.shape
    cuts = np.empty((num_terms, 2))
    heights, segments = np.empty((num_points, 2)), np.empty((num_points - 1, NUM_COLUMNS))
    sums = np.empty((num_points - 1, 2))
    for box in range(len(strengths)):
        _cut(conclusion, strengths[box], cuts)
        out[box] = _defuzzify(conclusion, cuts, heights, segments, sums)


@compiled(error_model="numpy", nogil=True)
def _cut(conclusion: Conclusion, strengths: Floats, out: Floats) -> None:
    """Bound the height at which each output term is cut."""
    for term in range(len(out)):
        first = conclusion.bounds[term]
        all_together = (0.0, 0.0)
        for index in range(first, conclusion.bounds[term + 1]):
            strength = (strengths[conclusion.rules[index], 0], strengths[conclusion.rules[index], 1])
            weight = conclusion.weights[index]
            if weight != 1.0:
                strength = widened(weight * strength[0], weight * strength[1])
            all_together = (
                strength
                if index == first
                else combine_bounds(conclusion.accumulation, strength, all_together)
            )
        out[term, 0], out[term, 1] = all_together


@compiled(error_model="numpy", nogil=True)
def _defuzzify(
    conclusion: Conclusion, cuts: Floats, heights: Floats, segments: Floats, sums: Floats
) -> tuple[float, float]:
    """Bound one output for bounded cuts."""
    x, default = conclusion.universe, conclusion.default
    highest_low, highest_high = _heights(conclusion, cuts, heights)
    if highest_high == 0.0:
        return default, default
    low, high = _support(x, heights)
    if conclusion.defuzzifier != codes.CENTROID:
        low, high = _of_maximum(conclusion, cuts, highest_low, low, high)
    else:
        rounding = 4 * EPSILON * (len(x) + 2 * len(cuts) + 16)
        centre = 0.5 * (x[0] + x[-1])
        area = _segments(conclusion, centre, cuts, heights, segments)
        error = rounding * (x[-1] - x[0])
        low = max(low, centre + _least_centroid(x, centre, 1.0, segments, sums, error))
        high = min(high, centre - _least_centroid(x, centre, -1.0, segments, sums, error))
        slack = rounding * max(abs(x[0]), abs(x[-1]))
        low, high = low - slack, high + slack
        if area < SMALLEST_AREA * (1.0 + rounding):  # divided by the smallest instead, it is nearer to 0
            low, high = min(low, 0.0), max(high, 0.0)
    if highest_low == 0.0:
        low, high = min(low, default), max(high, default)
    return low, high


@compiled(error_model="numpy", nogil=True)
def _heights(conclusion: Conclusion, cuts: Floats, out: Floats) -> tuple[float, float]:
    """Bound the aggregated heights at the points of the universe; return the maximum of either bound."""
    out[:] = 0.0
    highest_low = highest_high = 0.0
    for term in range(len(cuts)):
        low, high = cuts[term]
        if high > 0.0:
            for point in range(len(out)):
                mu = conclusion.memberships[term, point]
                out[point, 0] = max(out[point, 0], min(low, mu))
                out[point, 1] = max(out[point, 1], min(high, mu))
                highest_low = max(highest_low, out[point, 0])
                highest_high = max(highest_high, out[point, 1])
    return highest_low, highest_high


@compiled(error_model="numpy", nogil=True)
def _support(x: Floats, heights: Floats) -> tuple[float, float]:
    """Return the ends of the segments in which the aggregated set may be positive."""
    first, last = 0, len(x) - 1
    while heights[first, 1] == 0.0:
        first += 1
    while heights[last, 1] == 0.0:
        last -= 1
    return x[max(first - 1, 0)], x[min(last + 1, len(x) - 1)]


@compiled(error_model="numpy", nogil=True)
def _of_maximum(
    conclusion: Conclusion, cuts: Floats, highest_low: float, low: float, high: float
) -> tuple[float, float]:
    """Bound where the aggregated set is highest: where its upper bound reaches its highest lower bound."""
    x = conclusion.universe
    reached = highest_low - INTERPOLATION_ERROR
    if reached <= 0.0:
        return low, high
    left, right = x[-1], x[0]
    for term in range(len(cuts)):
        if cuts[term, 1] >= reached:
            mu = conclusion.memberships[term]
            for point in range(len(x)):
                if mu[point] >= reached:
                    left = min(left, x[point] - _way_down(x, mu, point, point - 1, reached))
                    right = max(right, x[point] + _way_down(x, mu, point, point + 1, reached))
    slack = INTERPOLATION_ERROR * max(abs(x[0]), abs(x[-1]))
    return left - slack, right + slack


@compiled(error_model="numpy", nogil=True)
def _way_down(x: Floats, mu: Floats, point: int, other: int, height: float) -> float:
    """Return the distance towards a neighbour over which a membership stays at a height or above."""
    if other < 0 or other == len(x) or mu[other] >= height:
        return 0.0
    return abs(x[other] - x[point]) * (mu[point] - height) / (mu[point] - mu[other])


@compiled(error_model="numpy", nogil=True)
def _is_crossed(conclusion: Conclusion, cuts: Floats, left: int) -> bool:
    """Return whether a cut can cross its membership function between a point of the universe and the next."""
    for term in range(len(cuts)):
        a, b = conclusion.memberships[term, left], conclusion.memberships[term, left + 1]
        if a != b and max(a, b) > cuts[term, 0] and min(a, b) < cuts[term, 1]:
            return True
    return False


@compiled(error_model="numpy", nogil=True)
def _segments(conclusion: Conclusion, centre: float, cuts: Floats, heights: Floats, out: Floats) -> float:
    """Write area and moment of a function below, and of one above, all possible aggregated sets, by segment.

    Where no cut can cross its membership function the aggregated set is a straight line between the points.
    In other segments, and next to them, points are inserted, with an error. Returns the area of the function
    below.
    """
    x = conclusion.universe
    narrowest = x[1] - x[0]
    for point in range(1, len(x) - 1):
        narrowest = min(narrowest, x[point + 1] - x[point])
    relative_error = INTERPOLATION_ERROR * (1.0 + max(abs(x[0]), abs(x[-1])) / narrowest)
    area = 0.0
    was_crossed, is_crossed = False, _is_crossed(conclusion, cuts, 0)
    for left in range(len(out)):
        row, width = out[left], x[left + 1] - x[left]
        row[LEFT_LOW], row[LEFT_HIGH] = heights[left]
        row[RIGHT_LOW], row[RIGHT_HIGH] = heights[left + 1]
        will_be_crossed = left + 1 < len(out) and _is_crossed(conclusion, cuts, left + 1)
        tent_low = tent_high = at_low = at_high = 0.0
        if is_crossed:
            tent_low, at_low = _below(conclusion, cuts, left, row)
            tent_high, at_high = _above(conclusion, cuts, left, row)
        if was_crossed or is_crossed or will_be_crossed:
            error = relative_error * _steepest(conclusion, cuts, left)
            row[LEFT_LOW:LEFT_HIGH] = np.maximum(row[LEFT_LOW:LEFT_HIGH] - error, 0.0)
            row[LEFT_HIGH:] += error
            tent_low = max(0.0, tent_low - error)
        row[AREA_LOW], row[MOMENT_LOW] = _area_and_moment(
            x[left] - centre, width, row[LEFT_LOW], row[RIGHT_LOW], tent_low, at_low
        )
        row[AREA_HIGH], row[MOMENT_HIGH] = _area_and_moment(
            x[left] - centre, width, row[LEFT_HIGH], row[RIGHT_HIGH], tent_high, at_high
        )
        row[LEFT_HIGH:] += tent_high
        area += row[AREA_LOW]
        was_crossed, is_crossed = is_crossed, will_be_crossed
    return area


@compiled(error_model="numpy", nogil=True)
def _steepest(conclusion: Conclusion, cuts: Floats, left: int) -> float:
    """Return the largest membership at the ends of a segment in a term that can fire."""
    largest = 0.0
    for term in range(len(cuts)):
        if cuts[term, 1] > 0.0:
            largest = max(largest, conclusion.memberships[term, left], conclusion.memberships[term, left + 1])
    return largest


@compiled(error_model="numpy", nogil=True)
def _area_and_moment(
    x: float, width: float, left: float, right: float, tent: float, at: float
) -> tuple[float, float]:
    """Return area and moment of a line plus a tent function, `at` from 0 to 1 along the segment from `x`."""
    line, triangle = 0.5 * width * (left + right), 0.5 * width * tent
    moment = x * (line + triangle) + width * width * (left / 6.0 + right / 3.0)
    return line + triangle, moment + triangle * width * (1.0 + at) / 3.0


@compiled(error_model="numpy", nogil=True)
def _below(conclusion: Conclusion, cuts: Floats, left: int, row: Floats) -> tuple[float, float]:
    """Use the term with the largest area below its lowest cut; write its line and return its tent.

    Each cut term lies below the aggregated set, and a term at its lowest cut below the same at any other.
    """
    most, best_tent, best_at = -1.0, 0.0, 0.0
    for term in range(len(cuts)):
        if cuts[term, 1] == 0.0:
            continue
        cut, a, b = cuts[term, 0], conclusion.memberships[term, left], conclusion.memberships[term, left + 1]
        start, end = min(cut, a), min(cut, b)
        tent = at = 0.0
        if min(a, b) < cut < max(a, b):
            at = (cut - a) / (b - a)
            tent = max(0.0, cut - (start + at * (end - start)))
        if start + end + tent > most:
            most, best_tent, best_at = start + end + tent, tent, at
            row[LEFT_LOW], row[RIGHT_LOW] = start, end
    return best_tent, best_at


@compiled(error_model="numpy", nogil=True)
def _above(conclusion: Conclusion, cuts: Floats, left: int, row: Floats) -> tuple[float, float]:
    """Add a tent to the line such that it lies above every point inserted at the highest cuts.

    The terms at their highest cuts lie below the concave function with corners at the points inserted, and so
    does any polygon with corners on lower ones. If several points are inserted the line is raised instead.
    """
    count, best_tent, best_at = 0, 0.0, 0.0
    for term in range(len(cuts)):
        cut, a, b = cuts[term, 1], conclusion.memberships[term, left], conclusion.memberships[term, left + 1]
        if not min(a, b) < cut < max(a, b):
            continue
        at, height = (cut - a) / (b - a), 0.0
        for other in range(len(cuts)):
            a, b = conclusion.memberships[other, left], conclusion.memberships[other, left + 1]
            height = max(height, min(a + at * (b - a), cuts[other, 1]))
        tent = height - (row[LEFT_HIGH] + at * (row[RIGHT_HIGH] - row[LEFT_HIGH]))
        if tent > 0.0:
            count += 1
            if tent > best_tent:
                best_tent, best_at = tent, at
    if count > 1:
        row[LEFT_HIGH:] += best_tent
        return 0.0, 0.0
    return best_tent, best_at


@compiled(error_model="numpy", nogil=True)
def _least_centroid(
    x: Floats, centre: float, sign: float, segments: Floats, sums: Floats, relative_error: float
) -> float:
    """Return a lower bound on the centroid of every function between the lower and the upper one.

    With ``sign`` -1 the axis is reversed, so that the result is below the negated centroid. The number t
    is below if the integral of (x - t) times the function that is high up to t and low beyond is positive,
    by more than the error of the sums.
    """
    count = len(x) - 1
    area = moment = 0.0
    for position in range(count - 1, -1, -1):
        sums[position, 0], sums[position, 1] = area, moment
        row = segments[position if sign > 0.0 else count - 1 - position]
        area += row[AREA_LOW]
        moment += sign * row[MOMENT_LOW]
    best: float = sign * ((x[0] if sign > 0.0 else x[count]) - centre)
    area = moment = 0.0
    for position in range(count):
        index = position if sign > 0.0 else count - 1 - position
        row, width = segments[index], x[index + 1] - x[index]
        start = sign * ((x[index] if sign > 0.0 else x[index + 1]) - centre)
        if sign > 0.0:
            low_left, low_right, high_left, high_right = row[LEFT_LOW:]
        else:
            low_right, low_left, high_right, high_left = row[LEFT_LOW:]
        lines = (width, low_left, low_right, high_left, high_right)
        all_area, all_moment = area + sums[position, 0], moment + sums[position, 1]
        error = relative_error * (all_area + row[AREA_HIGH])
        distance = _zero_crossing(all_area, all_moment - start * all_area - error, lines)
        if distance < 0.0:
            break
        best = max(best, start + distance)
        if distance < width:
            break
        area += row[AREA_HIGH]
        moment += sign * row[MOMENT_HIGH]
    return best


@compiled(error_model="numpy", nogil=True)
def _balance(at: float, area: float, moment: float, lines: Lines) -> tuple[float, float]:
    """Return the integral of (x - t) times the extremal function, and its slope, for t in one segment.

    `area` and `moment`, about the segment's start, are those of the other segments; `at` is t's distance from
    there.
    """
    width, low_left, low_right, high_left, high_right = lines
    rest = width - at
    rise_low, rise_high = (low_right - low_left) / width, (high_right - high_left) / width
    here = low_left + rise_low * at
    value = moment - at * area - at * at * (high_left / 2.0 + rise_high * at / 6.0)
    value += rest * rest * (here / 2.0 + rise_low * rest / 3.0)
    slope = area + at * (high_left + 0.5 * rise_high * at) + rest * (here + 0.5 * rise_low * rest)
    return value, -slope


@compiled(error_model="numpy", nogil=True)
def _zero_crossing(area: float, moment: float, lines: Lines) -> float:
    """Return the largest distance at which `_balance` is not negative, or less; -1 if there is none.

    The balance falls with increasing steepness, so that Newton's steps come from above and secants from
    below, except for rounding, which `moment` makes up for.
    """
    left, right = 0.0, lines[0]
    value, _ = _balance(left, area, moment, lines)
    if value < 0.0:
        return -1.0
    beyond, slope = _balance(right, area, moment, lines)
    if beyond >= 0.0:
        return right
    for _ in range(5):
        secant = left + (right - left) * value / (value - beyond)
        newton = right - beyond / slope
        left = secant
        value, _ = _balance(left, area, moment, lines)
        if value <= 0.0 or newton <= left:
            break
        beyond, slope = _balance(newton, area, moment, lines)
        right = newton
        if beyond >= 0.0:
            break
    return left
