"""The compiled functions that run a `Program`: any fuzzy system, exactly, step by step.

`fis_tools.engines.inference` defines the computation; this is the same arithmetic in the same order for many
samples, with every operator, weight, universe, output and defuzzifier of the model.
`fis_tools.engines.kernel` is faster still and supports fewer systems.
"""

from collections.abc import Callable
from functools import partial

import numpy as np
from numpy.typing import NDArray

from fis_tools.compiled.decorator import compiled
from fis_tools.engines.program import (
    BISECTOR,
    BOUNDED_DIFFERENCE,
    BOUNDED_SUM,
    CENTROID,
    DRASTIC_PRODUCT,
    DRASTIC_SUM,
    EINSTEIN_PRODUCT,
    EINSTEIN_SUM,
    EXTREMELY,
    HAMACHER_PRODUCT,
    HAMACHER_SUM,
    INTENSELY,
    MAX,
    MEAN_OF_MAXIMUM,
    MIN,
    NILPOTENT_MAXIMUM,
    NILPOTENT_MINIMUM,
    PROBABILISTIC_SUM,
    PRODUCT,
    SELDOM,
    SMALLEST_OF_MAXIMUM,
    SOMEWHAT,
    UNBOUNDED_SUM,
    VERY,
    Conclusion,
    Program,
    Weighing,
)
from fis_tools.engines.weigher import weigh

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

#: scikit-fuzzy divides by the larger of the area and this
SMALLEST_AREA = float(np.finfo(np.float64).eps)
#: The smallest positive number: a cut of zero crosses where memberships become positive.
SMALLEST = float(np.nextafter(0.0, 1.0))

#: samples whose rules are evaluated side by side: a constant, so that the compiler vectorises
LANES = 16
#: firing strengths per block between evaluating rules and outputs: so many stay in the processor's cache
BLOCK = 65_536


def fire(program: Program, inputs: Floats) -> Floats:
    """Return the firing strengths, before weights, (n, num_rules), for inputs (n, num_inputs)."""
    firing = np.empty((len(inputs), program.num_rules))
    fire_rows(*program.antecedents, inputs, firing)
    return firing


def conclude(program: Program, firing: Floats, inputs: Floats | None = None) -> Floats:
    """Return the outputs, (n, num_outputs), for firing strengths (n, num_rules) of inputs (n, num_inputs).

    Inputs are needed only for rules that conclude numbers linear in them.

    Raises
    ------
    ValueError
        If inputs are needed and not given.
    """
    if inputs is None:
        if program.asks_for_inputs:
            raise ValueError("rules conclude numbers that depend on the inputs; pass these, (n, num_inputs)")
        inputs = np.zeros((len(firing), len(program.antecedents.inputs)))
    columns = np.empty((len(program.conclusions), len(firing)))
    for place, conclusion in enumerate(program.conclusions):
        concluding(program, conclusion, firing, inputs, columns[:place], columns[place])()
    return columns.T


def evaluate(program: Program, inputs: Floats) -> Floats:
    """Return the outputs, (n, num_outputs), for inputs (n, num_inputs)."""
    columns = np.empty((len(program.conclusions), len(inputs)))
    size = max(LANES, min(BLOCK // program.num_rules, len(inputs)))
    firing = np.empty((size, program.num_rules))
    for first in range(0, len(inputs), size):
        rows = inputs[first : first + size]
        fire_rows(*program.antecedents, rows, firing[: len(rows)])
        part = columns[:, first : first + size]
        for place, conclusion in enumerate(program.conclusions):
            concluding(program, conclusion, firing[: len(rows)], rows, part[:place], part[place])()
    return columns.T


def concluding(
    program: Program,
    conclusion: Conclusion | Weighing,
    firing: Floats,
    inputs: Floats,
    earlier: Floats,
    out: Floats,
) -> Callable[[], None]:
    """Return a function that writes one output for firing strengths (n, num_rules) of inputs (n, num_inputs).

    The outputs before it, (num_outputs, n), must have been written.
    """
    if isinstance(conclusion, Weighing):
        return partial(weigh, conclusion, firing, inputs, program.ends, earlier, out)
    if conclusion.cuts:
        return partial(_conclude_by_term, *conclusion[:9], firing, out)
    return partial(
        _conclude_by_rule,
        conclusion.universe,
        conclusion.memberships,
        conclusion.rules,
        conclusion.weights,
        conclusion.terms,
        conclusion.implication,
        conclusion.aggregation,
        conclusion.defuzzifier,
        conclusion.default,
        firing,
        out,
    )


@compiled(error_model="numpy", forceinline=True)
def combine(operator: int, a: float, b: float) -> float:  # noqa: PLR0911, PLR0912 - one line per operator
    """Return the result of an operator on two degrees of truth, as in `fis_tools.model.operators`."""
    if operator == MIN:
        return a if a < b else b
    if operator == MAX:
        return a if a > b else b
    both, either = a * b, a + b
    if operator == PRODUCT:
        return both
    if operator == PROBABILISTIC_SUM:
        return either - both
    if operator == BOUNDED_DIFFERENCE:
        return max(either - 1.0, 0.0)
    if operator == BOUNDED_SUM:
        return min(either, 1.0)
    if operator == EINSTEIN_PRODUCT:
        return both / (2.0 - (either - both))
    if operator == EINSTEIN_SUM:
        return either / (1.0 + both)
    if operator == HAMACHER_PRODUCT:
        return 0.0 if either - both == 0.0 else both / (either - both)
    if operator == HAMACHER_SUM:
        if both < 0.5:
            return min((either - 2.0 * both) / (1.0 - both), 1.0)
        return 1.0 if both == 1.0 else 1.0 - (1.0 - a) * (1.0 - b) / (1.0 - both)
    if operator == DRASTIC_PRODUCT:
        return a if b == 1.0 else b if a == 1.0 else 0.0
    if operator == DRASTIC_SUM:
        return a if b == 0.0 else b if a == 0.0 else 1.0
    if operator == NILPOTENT_MINIMUM:
        return min(a, b) if either > 1.0 else 0.0
    if operator == NILPOTENT_MAXIMUM:
        return max(a, b) if either < 1.0 else 1.0
    if operator == UNBOUNDED_SUM:
        return either
    return _changed(operator, a)


@compiled(error_model="numpy", forceinline=True)
def _changed(operator: int, a: float) -> float:
    """Return the result of a hedge on a degree of truth, or its complement."""
    if operator == VERY:
        return a * a
    if operator == SOMEWHAT:
        return float(np.sqrt(max(a, 0.0)))
    if operator == EXTREMELY:
        return a * a * a
    if operator == INTENSELY:
        return 2.0 * a * a if a <= 0.5 else 1.0 - 2.0 * (1.0 - a) * (1.0 - a)
    if operator == SELDOM:
        half = max(a if a <= 0.5 else 1.0 - a, 0.0)
        return float(np.sqrt(0.5 * half)) if a <= 0.5 else float(1.0 - np.sqrt(0.5 * half))
    return 1.0 - a


@compiled(error_model="numpy", forceinline=True)
def fuzzify_one(layout: Integers, universes: Floats, memberships: Floats, x: float, out: Floats) -> None:
    """Write a value's membership in each term of an input, linear between the points of its universe."""
    terms, points, start, row = layout[0], layout[1], layout[2], layout[3]
    low, high = universes[start], universes[start + points - 1]
    x = min(max(x, low), high)
    left = min(int((x - low) * ((points - 1) / (high - low))), points - 1)
    if x < universes[start + left] or (left < points - 1 and x >= universes[start + left + 1]):
        left = np.searchsorted(universes[start : start + points], x, side="right") - 1
    here = row + 2 * terms * left
    distance = x - universes[start + left]
    for term in range(terms):
        out[term] = memberships[here + terms + term] * distance + memberships[here + term]


@compiled(error_model="numpy", nogil=True)
def fire_rows(
    inputs: Integers,
    universes: Floats,
    memberships: Floats,
    steps: Integers,
    rule_slots: Integers,
    values: Floats,
    out: Floats,
) -> None:
    """Write the firing strengths of `Antecedents` for the values, (n, num_inputs)."""
    num_terms = inputs[:, 0].sum()
    slots = np.zeros((num_terms + len(steps)) * LANES)
    for first in range(0, len(values), LANES):
        num_lanes = min(LANES, len(values) - first)
        slot = 0
        for place in range(len(inputs)):
            for lane in range(num_lanes):
                x = values[first + lane, place]
                fuzzify_one(inputs[place], universes, memberships, x, slots[slot * LANES + lane :: LANES])
            slot += inputs[place, 0]
        for index in range(len(steps)):
            operator, a, b = steps[index, 0], steps[index, 1] * LANES, steps[index, 2] * LANES
            result = (num_terms + index) * LANES
            if operator == MIN:
                for lane in range(LANES):
                    x, y = slots[a + lane], slots[b + lane]
                    slots[result + lane] = x if x < y else y
            elif operator == PRODUCT:
                for lane in range(LANES):
                    slots[result + lane] = slots[a + lane] * slots[b + lane]
            else:
                for lane in range(LANES):
                    slots[result + lane] = combine(operator, slots[a + lane], slots[b + lane])
        for lane in range(num_lanes):
            for rule in range(len(rule_slots)):
                out[first + lane, rule] = slots[rule_slots[rule] * LANES + lane]


@compiled(error_model="numpy", nogil=True)
def _conclude_by_term(
    universe: Floats,
    memberships: Floats,
    bounds: Integers,
    rules: Integers,
    weights: Floats,
    runs: Integers,
    accumulation: int,
    defuzzifier: int,
    default: float,
    firing: Floats,
    out: Floats,
) -> None:
    """Write one output whose terms are each cut once and aggregated by the maximum."""
    num_terms, num_points = memberships.shape
    cuts, heights, crossings = np.empty(num_terms), np.empty(num_points), np.empty(len(runs))
    room = num_points + len(runs)
    x, y, areas = np.empty(room), np.empty(room), np.empty(room)
    for sample in range(len(firing)):
        heights[:] = 0.0
        for term in range(num_terms):
            first = bounds[term]
            cut = firing[sample, rules[first]] * weights[first]
            for index in range(first + 1, bounds[term + 1]):
                cut = combine(accumulation, firing[sample, rules[index]] * weights[index], cut)
            cuts[term] = cut
            for point in range(num_points):
                height = memberships[term, point]
                height = height if height < cut else cut
                heights[point] = height if height > heights[point] else heights[point]
        num_crossings = _cross(universe, memberships, runs, cuts, crossings)
        count = _merge(universe, memberships, heights, cuts, crossings, num_crossings, x, y)
        if _is_empty(y, count):
            out[sample] = default
        elif defuzzifier == CENTROID:
            out[sample] = _centroid(x, y, count)
        elif defuzzifier == BISECTOR:
            out[sample] = _bisector(x, y, count, areas)
        else:
            out[sample] = _of_maximum(defuzzifier, x, y, count, y[:count].max())


@compiled(error_model="numpy", nogil=True)
def _conclude_by_rule(
    universe: Floats,
    memberships: Floats,
    rules: Integers,
    weights: Floats,
    terms: Integers,
    implication: int,
    aggregation: int,
    defuzzifier: int,
    default: float,
    firing: Floats,
    out: Floats,
) -> None:
    """Write one output from each rule's implied set, at the points of the universe."""
    count = len(universe)
    heights, areas = np.empty(count), np.empty(count)
    for sample in range(len(firing)):
        heights[:] = 0.0
        for index in range(len(rules)):
            strength = firing[sample, rules[index]] * weights[index]
            for point in range(count):
                implied = combine(implication, strength, memberships[terms[index], point])
                heights[point] = combine(aggregation, heights[point], implied)
        if _is_empty(heights, count):
            out[sample] = default
        elif defuzzifier == CENTROID:
            out[sample] = _centroid(universe, heights, count)
        elif defuzzifier == BISECTOR:
            out[sample] = _bisector(universe, heights, count, areas)
        else:
            out[sample] = _of_maximum(defuzzifier, universe, heights, count, heights.max())


@compiled(error_model="numpy", forceinline=True)
def _cross(universe: Floats, memberships: Floats, runs: Integers, cuts: Floats, crossings: Floats) -> int:
    """Write where terms cross their cuts between points of the universe, ascending; return how many."""
    count = 0
    for run in range(len(runs)):
        term, left, right = runs[run, 0], runs[run, 1], runs[run, 2]
        cut = cuts[term]
        threshold = cut if cut > 0.0 else SMALLEST
        begins_above = memberships[term, left] >= threshold
        if begins_above == (memberships[term, right] >= threshold):
            continue
        while right - left > 1:
            middle = (left + right) // 2
            is_left = (memberships[term, middle] >= threshold) == begins_above
            left = middle if is_left else left
            right = right if is_left else middle
        low, rise = memberships[term, left], memberships[term, right] - memberships[term, left]
        crossing = universe[left] + (cut - low) * (universe[right] - universe[left]) / rise
        place = count
        while place > 0 and crossings[place - 1] > crossing:
            crossings[place] = crossings[place - 1]
            place -= 1
        crossings[place] = crossing
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
def _is_empty(y: Floats, count: int) -> bool:
    """Return whether all heights are zero: most others show after a few points."""
    point = 0
    while point < count and y[point] == 0.0:
        point += 1
    return point == count


@compiled(error_model="numpy")
def _centroid(x: Floats, y: Floats, count: int) -> float:
    """Return the centre of area of a polygon, summed segment by segment."""
    moment, area = 0.0, 0.0
    for right in range(1, count):
        x1, x2, y1, y2 = x[right - 1], x[right], y[right - 1], y[right]
        width = x2 - x1
        if y1 == y2:
            centre, segment = 0.5 * (x1 + x2), width * y1
        elif y1 == 0.0:
            centre, segment = 2.0 / 3.0 * width + x1, 0.5 * width * y2
        elif y2 == 0.0:
            centre, segment = 1.0 / 3.0 * width + x1, 0.5 * width * y1
        else:
            centre = (2.0 / 3.0 * width * (y2 + 0.5 * y1)) / (y1 + y2) + x1
            segment = 0.5 * width * (y1 + y2)
        moment += centre * segment
        area += segment
    return moment / max(area, SMALLEST_AREA)


@compiled(error_model="numpy")
def _bisector(x: Floats, y: Floats, count: int, areas: Floats) -> float:
    """Return the point with half of the area on either side; see `fis_tools.engines.inference`."""
    total = 0.0
    for right in range(1, count):
        y1, y2 = y[right - 1], y[right]
        width = x[right] - x[right - 1]
        total += width * y1 if y1 == y2 else 0.5 * width * (y1 + y2)
        areas[right] = 0.0 if y1 == 0.0 and y2 == 0.0 else total
    areas[0] = 0.0
    right = 1
    while not areas[right] >= total / 2.0:
        right += 1
    rest = total / 2.0 - areas[right - 1]
    x1, x2, y1, y2 = x[right - 1], x[right], y[right - 1], y[right]
    width = x2 - x1
    slope = (y2 - y1) / width
    middle: float
    if y1 == y2:
        middle = rest / y1 + x1
    elif y1 == 0.0:
        middle = x1 + np.sqrt(2.0 * rest * width / y2)
    elif y2 == 0.0:
        middle = x2 - np.sqrt(width * width - 2.0 * rest * width / y1)
    else:
        middle = x1 - (y1 - np.sqrt(y1 * y1 + 2.0 * slope * rest)) / slope
    return middle


@compiled(error_model="numpy")
def _of_maximum(defuzzifier: int, x: Floats, y: Floats, count: int, highest: float) -> float:
    """Return the mean, the smallest or the largest of the highest points."""
    total, found, least, greatest = 0.0, 0, 0.0, 0.0
    for point in range(count):
        if y[point] == highest:
            least = x[point] if found == 0 else least
            greatest = x[point]
            total += x[point]
            found += 1
    if defuzzifier == MEAN_OF_MAXIMUM:
        return total / found
    return least if defuzzifier == SMALLEST_OF_MAXIMUM else greatest
