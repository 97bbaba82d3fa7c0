"""Outputs from firing strengths, compiled: sets cut or implied, aggregated, defuzzified, or numbers weighed.

`fis_tools.engines.inference` is the readable twin, in the same order.
"""

import numpy as np

from fis_tools.array_types import Floats, Integers
from fis_tools.compiled.decorator import compiled
from fis_tools.engines import codes
from fis_tools.engines.codes import combine
from fis_tools.engines.defuzzification import SMALLEST_AREA
from fis_tools.engines.program import Conclusion, Weighing

#: The smallest positive number: a cut of zero crosses where memberships become positive.
SMALLEST = float(np.nextafter(0.0, 1.0))


@compiled(error_model="numpy", nogil=True)
def conclude_by_term(conclusion: Conclusion, firing: Floats, out: Floats) -> None:
    """Compute one output whose terms are each cut once and aggregated by the maximum."""
    universe, memberships, rules, weights = conclusion[:4]
    bounds, runs, accumulation = conclusion.bounds, conclusion.runs, conclusion.accumulation
    num_terms, num_points = memberships.shape
    cuts, heights, crossings = np.empty(num_terms), np.empty(num_points), np.empty(len(runs))
    size = num_points + len(runs)
    x, y = np.empty(size), np.empty(size)
    for sample in range(len(firing)):
        for term in range(num_terms):
            first = bounds[term]
            cut = firing[sample, rules[first]] * weights[first]
            for index in range(first + 1, bounds[term + 1]):
                cut = combine(accumulation, firing[sample, rules[index]] * weights[index], cut)
            cuts[term] = cut
        count = aggregate(universe, memberships, runs, cuts, heights, crossings, x, y)
        out[sample] = defuzzify(conclusion.defuzzifier, x, y, count, conclusion.default)


@compiled(error_model="numpy", nogil=True)
def conclude_by_rule(conclusion: Conclusion, firing: Floats, out: Floats) -> None:
    """Compute one output from each rule's implied set, at the points of the universe."""
    universe, memberships, rules, weights = conclusion[:4]
    terms, implication, aggregation = conclusion.terms, conclusion.implication, conclusion.aggregation
    count = len(universe)
    heights = np.empty(count)
    for sample in range(len(firing)):
        heights[:] = 0.0
        for index in range(len(rules)):
            strength = firing[sample, rules[index]] * weights[index]
            imply(implication, aggregation, memberships[terms[index]], strength, heights)
        out[sample] = defuzzify(conclusion.defuzzifier, universe, heights, count, conclusion.default)


@compiled(error_model="numpy", forceinline=True)
def imply(implication: int, aggregation: int, sampled: Floats, strength: float, heights: Floats) -> None:
    """Aggregate what a rule implies with what those before it imply."""
    for point in range(len(heights)):
        implied = combine(implication, strength, sampled[point])
        heights[point] = combine(aggregation, heights[point], implied)


@compiled(error_model="numpy", forceinline=True)
def aggregate(
    universe: Floats,
    memberships: Floats,
    runs: Integers,
    cuts: Floats,
    heights: Floats,
    crossings: Floats,
    x: Floats,
    y: Floats,
) -> int:
    """Write the highest of the cut terms at the universe's points and at crossings; return how many.

    Heights and crossings are room to work in.
    """
    for point in range(len(universe)):
        heights[point] = 0.0
    for term in range(len(cuts)):
        cut = cuts[term]
        for point in range(len(universe)):
            height = memberships[term, point] if memberships[term, point] < cut else cut
            heights[point] = height if height > heights[point] else heights[point]
    num_crossings = _cross(universe, memberships, runs, cuts, crossings)
    return _merge(universe, memberships, heights, cuts, crossings, num_crossings, x, y)


@compiled(error_model="numpy", forceinline=True)
def _cross(universe: Floats, memberships: Floats, runs: Integers, cuts: Floats, crossings: Floats) -> int:
    """Write where terms cross their cuts between points of the universe, ascending; return how many."""
    count = 0
    for run in range(len(runs)):
        term, left, right = runs[run, 0], runs[run, 1], runs[run, 2]
        cut = cuts[term]
        threshold = cut if cut > 0.0 else SMALLEST
        begins_above = memberships[term, left] >= threshold
        if (memberships[term, right] >= threshold) == begins_above:
            continue
        while right - left > 1:
            middle = (left + right) // 2
            is_left = (memberships[term, middle] >= threshold) == begins_above
            left = middle if is_left else left
            right = right if is_left else middle
        low, rise = memberships[term, left], memberships[term, right] - memberships[term, left]
        crossing = universe[left] + (cut - low) * (universe[right] - universe[left]) / rise
        slot = count
        while slot > 0 and crossings[slot - 1] > crossing:
            crossings[slot] = crossings[slot - 1]
            slot -= 1
        crossings[slot] = crossing
        count += 1
    return count


@compiled(error_model="numpy", forceinline=True)
def _merge(
    universe: Floats,
    memberships: Floats,
    heights: Floats,
    cuts: Floats,
    crossings: Floats,
    num_crossings: int,
    x: Floats,
    y: Floats,
) -> int:
    """Write the points of the universe and the crossings in ascending order, each once; return how many."""
    num_points = len(universe)
    count, point = 0, 0
    for index in range(num_crossings):
        crossing = crossings[index]
        while point < num_points and universe[point] <= crossing:
            x[count], y[count] = universe[point], heights[point]
            point += 1
            count += 1
        if count > 0 and x[count - 1] == crossing:
            continue
        highest = 0.0
        if 0 < point < num_points:
            width, distance = universe[point] - universe[point - 1], crossing - universe[point - 1]
            for term in range(len(cuts)):
                low = memberships[term, point - 1]
                height = (memberships[term, point] - low) / width * distance + low
                height = height if height < cuts[term] else cuts[term]
                highest = height if height > highest else highest
        x[count], y[count] = crossing, highest
        count += 1
    while point < num_points:
        x[count], y[count] = universe[point], heights[point]
        point += 1
        count += 1
    return count


@compiled(error_model="numpy", forceinline=True)
def defuzzify(defuzzifier: int, x: Floats, y: Floats, count: int, default: float) -> float:
    """Defuzzify an aggregated set, given by the first `count` points; return the default if it is zero."""
    highest = _greatest(y, count)
    if highest == 0.0:
        return default
    if defuzzifier == codes.CENTROID:
        return _polygon_centroid(x, y, count)
    if defuzzifier == codes.BISECTOR:
        return _polygon_bisector(x, y, count)
    return _polygon_maximum(defuzzifier, x, y, count, highest)


@compiled(error_model="numpy", forceinline=True)
def _greatest(y: Floats, count: int) -> float:
    """Return the greatest of heights."""
    highest = 0.0
    for point in range(count):
        highest = y[point] if y[point] > highest else highest
    return highest


@compiled(error_model="numpy")
def _polygon_centroid(x: Floats, y: Floats, count: int) -> float:
    """Return the centre of area of a polygon, summed segment by segment."""
    moment, area = 0.0, 0.0
    for right in range(1, count):
        x1, x2, h1, h2 = x[right - 1], x[right], y[right - 1], y[right]
        width = x2 - x1
        if h1 == h2:
            centre, segment = 0.5 * (x1 + x2), width * h1
        elif h1 == 0.0:
            centre, segment = 2.0 / 3.0 * width + x1, 0.5 * width * h2
        elif h2 == 0.0:
            centre, segment = 1.0 / 3.0 * width + x1, 0.5 * width * h1
        else:
            centre = (2.0 / 3.0 * width * (h2 + 0.5 * h1)) / (h1 + h2) + x1
            segment = 0.5 * width * (h1 + h2)
        moment += centre * segment
        area += segment
    return moment / (area if area > SMALLEST_AREA else SMALLEST_AREA)


@compiled(error_model="numpy")
def _polygon_bisector(x: Floats, y: Floats, count: int) -> float:
    """Return the point with half of the area on either side; with a gap in the polygon another one, or NaN.

    As in scikit-fuzzy an empty segment starts the area left of it anew.
    """
    total = 0.0
    for right in range(1, count):
        total += _area_before(x, y, right)
    end, left, running = 1, 0.0, _area_before(x, y, 1)
    here = running
    while not here >= total / 2.0:
        end += 1
        left = here
        running += _area_before(x, y, end)
        here = 0.0 if y[end - 1] == 0.0 and y[end] == 0.0 else running
    rest = total / 2.0 - left
    width, h1, h2 = x[end] - x[end - 1], y[end - 1], y[end]
    middle: float
    if h1 == h2:
        middle = rest / h1 + x[end - 1]
    elif h1 == 0.0:
        middle = x[end - 1] + np.sqrt(2.0 * rest * width / h2)
    elif h2 == 0.0:
        middle = x[end] - np.sqrt(width * width - 2.0 * rest * width / h1)
    else:
        slope = (h2 - h1) / width
        middle = x[end - 1] - (h1 - np.sqrt(h1 * h1 + 2.0 * slope * rest)) / slope
    return middle


@compiled(error_model="numpy")
def _area_before(x: Floats, y: Floats, right: int) -> float:
    """Return the area between a point of a polygon and the one before it."""
    width, h1, h2 = x[right] - x[right - 1], y[right - 1], y[right]
    if h1 == h2:
        return width * h1
    return 0.5 * width * (h1 + h2)


@compiled(error_model="numpy")
def _polygon_maximum(defuzzifier: int, x: Floats, y: Floats, count: int, highest: float) -> float:
    """Return the mean, the smallest or the largest of the highest points."""
    total, num_maxima, smallest, largest = 0.0, 0, 0.0, 0.0
    for point in range(count):
        if y[point] == highest:
            smallest = x[point] if num_maxima == 0 else smallest
            largest = x[point]
            total += x[point]
            num_maxima += 1
    if defuzzifier == codes.MEAN_OF_MAXIMUM:
        return total / num_maxima
    return smallest if defuzzifier == codes.SMALLEST_OF_MAXIMUM else largest


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
    weigh_rows(weighing._replace(formulas=(), names=()), formulas, firing, values, universes, out)


def formula_values(weighing: Weighing, values: Floats, universes: Floats, earlier: Floats) -> Floats:
    """Return the values of an output's formulas, (n, num_formulas); see `weigh`."""
    values_of = np.empty((len(values), len(weighing.formulas)))
    if weighing.formulas:
        clipped = np.clip(values, universes[:, 0], universes[:, 1]).T
        known = dict(
            zip(weighing.names, (*clipped, *earlier[: len(weighing.names) - len(clipped)]), strict=True)
        )
        for column, formula in enumerate(weighing.formulas):
            values_of[:, column] = formula.value(known)
    return values_of


@compiled(error_model="numpy", nogil=True)
def weigh_rows(  # noqa: PLR0912 - a branch for each kind of conclusion
    weighing: Weighing, formulas: Floats, firing: Floats, values: Floats, universes: Floats, out: Floats
) -> None:
    """Write one output, given the values of its formulas, (n, num_formulas); see `weigh`."""
    rules, weights, parameters, is_constant = weighing[:4]
    kinds, accumulation = weighing.kinds, weighing.accumulation
    num_inputs = values.shape[1]
    clipped = np.empty(num_inputs)
    size = 0 if accumulation == codes.UNBOUNDED_SUM else len(rules)
    numbers, strengths = np.empty(size), np.empty(size)
    scale = 1.0 if weighing.defuzzifier == codes.WEIGHTED_SUM else codes.RAISED_WEIGHT
    for sample in range(len(firing)):
        for column in range(num_inputs):
            clipped[column] = min(max(values[sample, column], universes[column, 0]), universes[column, 1])
        total, moment, count = 0.0, 0.0, 0
        for index in range(len(rules)):
            strength = firing[sample, rules[index]] * weights[index]
            if strength <= 0.0:  # beside its last knot a table may leave less than nothing
                continue
            if is_constant:
                number = parameters[index, num_inputs]
            elif kinds[index] == codes.NUMBER:
                number = parameters[index, num_inputs]
                for column in range(num_inputs):
                    if parameters[index, column] != 0.0:
                        number += parameters[index, column] * clipped[column]
            elif kinds[index] == codes.FORMULA:
                number = formulas[sample, int(parameters[index, 0])]
            else:
                number = invert(kinds[index], parameters[index, 0], parameters[index, 1], min(strength, 1.0))
                if np.isinf(number):
                    number = weighing.high if number > 0.0 else weighing.low
            if accumulation == codes.UNBOUNDED_SUM:
                total += strength * scale
                moment += strength * scale * number
            else:
                count = _join(accumulation, numbers, strengths, count, number, strength)
        for index in range(count):
            total += strengths[index] * scale
            moment += strengths[index] * scale * numbers[index]
        if total == 0.0:
            out[sample] = weighing.default
        else:
            out[sample] = moment if weighing.defuzzifier == codes.WEIGHTED_SUM else moment / total


@compiled(error_model="numpy")
def _join(
    accumulation: int, numbers: Floats, strengths: Floats, count: int, number: float, strength: float
) -> int:
    """Put a number among those before it, ascending, or join its strength with that of an equal one."""
    slot = count
    while slot > 0 and numbers[slot - 1] > number:
        slot -= 1
    if slot > 0 and numbers[slot - 1] == number:
        strengths[slot - 1] = combine(accumulation, strengths[slot - 1], strength)
        return count
    for later in range(count, slot, -1):
        numbers[later], strengths[later] = numbers[later - 1], strengths[later - 1]
    numbers[slot], strengths[slot] = number, strength
    return count + 1


@compiled(error_model="numpy")
def invert(kind: int, first: float, second: float, degree: float) -> float:
    """Return where one of `fis_tools.engines.codes.INVERTED` has a degree, like its own `inverse`."""
    x: float
    if kind == codes.RAMP:
        x = first + (second - first) * degree
    elif kind == codes.SIGMOID:
        # a logarithm of zero would warn when numba is disabled
        away = -np.log(1.0 / degree - 1.0) if degree < 1.0 else np.inf
        x = first + away / second
    elif kind == codes.CONCAVE:
        x = 2.0 * second - first + (first - second) / degree
    elif kind == codes.ARC:
        x = second + (first - second) * np.sqrt(1.0 - degree * degree)
    else:
        foot, top = (first, second) if kind == codes.S_SHAPE else (second, first)
        if degree <= 0.5:
            x = foot + (top - foot) * np.sqrt(degree / 2.0)
        else:
            x = top - (top - foot) * np.sqrt((1.0 - degree) / 2.0)
    return x
