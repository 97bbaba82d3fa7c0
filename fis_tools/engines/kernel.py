"""Compiled Mamdani inference with exactly scikit-fuzzy's meaning, many samples side by side.

`fis_tools.engines.packing` turns systems into the numbers that are read here. One sample per lane of the
working space is inferred at once: every formula is written once, for vectors (`fis_tools.compiled.vectors`).

The method is division-free: the aggregated output is linear between the points on which scikit-fuzzy samples
it, so its area and moment are weighted sums over the grid, and each further point that scikit-fuzzy inserts
(where a cut crosses its own membership function) adds one triangle. Crossings of two different clipped terms
are not inserted, as in scikit-fuzzy. Lengths on the output's universe are measured
in steps of its grid.
"""

from functools import cache
from threading import local
from typing import Any

import numpy as np

from fis_tools.array_types import Floats, Integers
from fis_tools.compiled.decorator import compiled
from fis_tools.compiled.vectors import (
    ROW,
    Rows,
    Vector,
    aligned,
    gather_rows,
    higher,
    least,
    load,
    most,
    rows_of,
    select,
    some,
    splat,
    spread,
    store,
    width_of,
)
from fis_tools.engines import packing
from fis_tools.engines.defuzzification import SMALLEST_AREA
from fis_tools.engines.packing import Packed

#: samples that are inferred side by side, and where there are at most half as many; both are constants
LANES, FEW_LANES = 16, 8

#: Working space of an inference: memberships in the terms of all inputs; those at both ends of a segment of a
#: universe; the cut of each output term; where cuts cross flanks: right of which point, at which fraction of
#: a step, and at which aggregated height; the inputs, the output, and the area that it is the centroid of, in
#: steps.
SCRATCH: Rows = {
    "memberships": (packing.ANY + 1,),
    "ends": (2 * packing.MAX_TERMS,),
    "cuts": (packing.MAX_TERMS,),
    "segments": (2 * packing.MAX_TERMS,),
    "fractions": (2 * packing.MAX_TERMS,),
    "heights": (2 * packing.MAX_TERMS,),
    "lefts": (2 * packing.MAX_TERMS,),
    "rights": (2 * packing.MAX_TERMS,),
    "inputs": (packing.MAX_INPUTS,),
    "output": (),
    "area": (),
}


@compiled(error_model="numpy", forceinline=True)
def gather_terms(values: Floats, by_point: int, segment: Vector, terms: int, ends: Floats) -> None:
    """Write into `ends` the memberships in all terms at the left end of a segment, then at its right."""
    for first in range(0, 2 * terms, ROW):
        count = min(ROW, 2 * terms - first)
        gather_rows(values, by_point + first, segment * terms, count, ends[first:])


@compiled(error_model="numpy", forceinline=True)
def fuzzify(values: Floats, system: Any, work: Any) -> None:
    """Write the memberships of all `work.inputs` in their terms, linear between points of universes."""
    width = width_of(work)
    slot = 0
    for index in range(system.num_inputs):
        terms, at = system.input_terms[index], system.input_values[index]
        minimum = values[at + packing.MINIMUM]
        x = most(least(load(work.inputs, index, width), values[at + packing.MAXIMUM]), minimum)
        left = np.floor((x - minimum) * values[at + packing.STEPS_A_UNIT])
        left = least(left, system.input_points[index] - 2)
        fraction = (x - (minimum + left * values[at + packing.STEP])) * values[at + packing.STEPS_A_UNIT]
        gather_terms(values, at + packing.HEADER, left, terms, work.ends)
        for term in range(terms):
            left_value, right_value = load(work.ends, term, width), load(work.ends, terms + term, width)
            store(work.memberships, slot, left_value + fraction * (right_value - left_value))
            slot += 1


@compiled(error_model="numpy", forceinline=True)
def cut_terms(rules: Integers, system: Any, memberships: Floats, cuts: Floats) -> None:
    """Write the height at which each output term is cut: the strongest of its rules."""
    width = width_of(cuts)
    terms, inputs = system.output_terms, system.num_inputs
    bounds = system.rules + terms
    slots = bounds + terms + 1
    for term in range(terms):
        cut = splat(0.0, width)
        for rule in range(rules[bounds + term], rules[bounds + term + 1]):
            strength = load(memberships, rules[slots + inputs * rule], width)
            for index in range(1, inputs):
                strength = least(load(memberships, rules[slots + inputs * rule + index], width), strength)
            cut = higher(strength, cut)
        store(cuts, term, cut)


@compiled(error_model="numpy", forceinline=True)
def count_ranks(values: Floats, rules: Integers, piece: int, system: Any, cuts: Floats) -> int:
    """Return how many of the highest terms determine the aggregated height in a piece of the grid.

    As soon as their minimum exceeds the maximum of the next one in it, the others are hidden.
    """
    width = width_of(cuts)
    terms = system.output_terms
    bounds, ranks = system.pieces + 2 * terms * piece, system.ranks + terms * piece
    floor = splat(0.0, width)
    rank = 0
    while rank == 0 or (rank < terms and some(floor < values[bounds + 2 * rank])):
        cut = load(cuts, rules[ranks + rank], width)
        floor = higher(least(cut, values[bounds + 2 * rank + 1]), floor)
        rank += 1
    return rank


@compiled(error_model="numpy", forceinline=True)
def grid_sums(values: Floats, rules: Integers, system: Any, cuts: Floats) -> tuple[Vector, Vector, Vector]:
    """Return the sum of the aggregated heights on the grid, and area and moment below the lines between them.

    The moment is about the centre of the universe. Terms hidden in a piece of it are skipped there.
    """
    width = width_of(cuts)
    terms, points = system.output_terms, system.output_points
    by_point = system.output_values + packing.HEADER + terms * points
    middle = 0.5 * (points - 1)
    total, moment = splat(0.0, width), splat(0.0, width)
    first, last = total, total
    for piece in range(-(-points // packing.PIECE)):
        num_ranks = count_ranks(values, rules, piece, system, cuts)
        ranks = system.ranks + terms * piece
        for point in range(packing.PIECE * piece, min(packing.PIECE * (piece + 1), points)):
            row = by_point + terms * point
            term = rules[ranks]
            height = least(spread(values, row + term, width), load(cuts, term, width))
            for rank in range(1, num_ranks):
                term = rules[ranks + rank]
                cut = load(cuts, term, width)
                height = higher(least(spread(values, row + term, width), cut), height)
            first = height if point == 0 else first
            last = height
            total += height
            moment += height * (point - middle)
    area = total - 0.5 * (first + last)
    return total, area, moment - middle * (0.5 * (last - first)) + (first - last) / 6.0


@compiled(error_model="numpy", forceinline=True)
def points_below(
    values: Floats, foot: int, direction: int, num_points: int, cut: Vector, ends: Floats
) -> Vector:
    """Return the number of points of a flank below the cut, counted from its foot in a direction.

    Whole rows first, then one by one. If the cut is above the peak of the flank, the number has no meaning.
    `ends` is overwritten.
    """
    width = width_of(ends)
    below = splat(0.0, width)
    for point in range(ROW - 1, num_points, ROW):
        below = select(spread(values, foot + direction * point, width) < cut, point + 1.0, below)
    gather_rows(values, foot if direction > 0 else foot - ROW + 1, direction * below, ROW, ends)
    is_below = below >= 0.0
    for point in range(ROW):
        is_below &= load(ends, point if direction > 0 else ROW - 1 - point, width) < cut
        below += select(is_below, 1.0, 0.0)
    return below


@compiled(error_model="numpy", forceinline=True)
def heights_in(terms: int, fraction: Vector, ends: Floats, cuts: Floats) -> tuple[Vector, Vector, Vector]:
    """Return the aggregated heights at the left end of a segment of the grid, inside it, and at the right.

    `ends` holds the memberships of `gather_terms`.
    """
    width = width_of(cuts)
    left, inside, right = splat(0.0, width), splat(0.0, width), splat(0.0, width)
    for term in range(terms):
        cut = load(cuts, term, width)
        left_value, right_value = load(ends, term, width), load(ends, terms + term, width)
        left = higher(least(left_value, cut), left)
        inside = higher(least(left_value + fraction * (right_value - left_value), cut), inside)
        right = higher(least(right_value, cut), right)
    return left, inside, right


@compiled(error_model="numpy", forceinline=True)
def neighbours(
    segment: Vector, fraction: Vector, left: Vector, right: Vector, count: int, work: Any
) -> tuple[Vector, Vector, Vector, Vector]:
    """Return the nearest points in a segment: its ends, of these heights, or points inserted closer by.

    Each as a fraction of the segment and a height, the left one first. Inserted are the first `count`
    points of `work.segments`, `fractions` and `heights`.
    """
    width = width_of(work)
    start, end = splat(0.0, width), splat(1.0, width)
    for other in range(count):
        is_here = (load(work.segments, other, width) == segment) & (segment >= 0.0)
        if some(is_here):
            x, y = load(work.fractions, other, width), load(work.heights, other, width)
            is_left = is_here & (start < x) & (x <= fraction)
            is_right = is_here & (fraction < x) & (x < end)
            start, left = select(is_left, x, start), select(is_left, y, left)
            end, right = select(is_right, x, end), select(is_right, y, right)
    return start, left, end, right


@compiled(error_model="numpy", forceinline=True)
def find_crossings(values: Floats, rules: Integers, system: Any, work: Any) -> int:
    """Return the number of flanks that some lane cuts, of the output's terms.

    Written for each of them are `work.segments`, -1 in lanes that do not cut it, and `work.cut_terms`.
    """
    width = width_of(work)
    terms, points = system.output_terms, system.output_points
    count = 0
    for term in range(terms):
        cut = load(work.cuts, term, width)
        row = system.output_values + packing.HEADER + term * points
        peak = rules[system.rules + term]
        for side, direction in enumerate((1, -1)):  # the rising flank, then the falling one
            climb = peak if side == 0 else points - 1 - peak
            if climb > 0:
                below = points_below(values, row + side * (points - 1), direction, climb, cut, work.ends)
                segment = side * (points - 2) + direction * (below - 1.0)
                crosses = (below > 0.0) & (cut <= values[row + peak])
                if some(crosses):
                    store(work.segments, count, select(crosses, segment, -1.0))
                    work.cut_terms[count] = term
                    count += 1
    return count


@compiled(error_model="numpy", forceinline=True)
def crossing_triangles(values: Floats, rules: Integers, system: Any, work: Any) -> tuple[Vector, Vector]:
    """Return the area and moment that the points inserted at cut crossings add to those of the grid.

    First, the location and the aggregated height of each inserted point are stored in `work`; then each
    adds the triangle that it makes with its nearest neighbours on its segment.
    """
    width = width_of(work)
    terms, points = system.output_terms, system.output_points
    by_point = system.output_values + packing.HEADER + terms * points
    middle = 0.5 * (points - 1)
    area, moment = splat(0.0, width), splat(0.0, width)
    count = find_crossings(values, rules, system, work)
    for flank in range(count):
        term = work.cut_terms[flank]
        segment = load(work.segments, flank, width)
        crosses = segment >= 0.0
        segment = most(segment, 0.0)
        gather_terms(values, by_point, segment, terms, work.ends)
        foot = load(work.ends, term, width)
        rise = select(crosses, load(work.ends, terms + term, width) - foot, 1.0)
        fraction = select(crosses, (load(work.cuts, term, width) - foot) / rise, 0.0)
        left, height, right = heights_in(terms, fraction, work.ends, work.cuts)
        store(work.fractions, flank, fraction)
        store(work.lefts, flank, left)
        store(work.heights, flank, height)
        store(work.rights, flank, right)
    for flank in range(count):
        segment = load(work.segments, flank, width)
        fraction = load(work.fractions, flank, width)
        height = load(work.heights, flank, width)
        left, right = load(work.lefts, flank, width), load(work.rights, flank, width)
        start, left, end, right = neighbours(segment, fraction, left, right, flank, work)
        triangle = 0.5 * ((end - start) * (height - left) - (fraction - start) * (right - left))
        area += triangle
        moment += triangle * (most(segment, 0.0) - middle + (start + fraction + end) / 3.0)
    return area, moment


@compiled(error_model="numpy", forceinline=True)
def conclude(values: Floats, rules: Integers, system: Any, work: Any) -> None:
    """Write the centroid of the output's terms cut at `work.cuts`, or the default if all cuts are zero."""
    total, area, moment = grid_sums(values, rules, system, work.cuts)
    more_area, more_moment = crossing_triangles(values, rules, system, work)
    at = system.output_values
    centre, step = values[at + packing.CENTRE], values[at + packing.WIDTH_OF_STEP]
    store(work.area, 0, area + more_area)
    area, moment = step * (area + more_area), step * step * (moment + more_moment)
    vanishes = area < SMALLEST_AREA
    output = select(vanishes, moment + centre * area, moment) / most(area, SMALLEST_AREA)
    output = select(vanishes, output, centre + output)
    store(work.output, 0, select(total == 0.0, values[at + packing.DEFAULT], output))


@compiled(error_model="numpy")
def infer(values: Floats, rules: Integers, layout: Any, index: int, scratch: Any) -> None:
    """Infer the output of one system for as many samples as the working space has lanes.

    Parameters
    ----------
    values, rules : rows of `Packed.values` and `Packed.rules`
    layout : `Packed.layout`
    index : which of the systems
    scratch : working space of `make_scratch`
        With the inputs, which must be finite and clipped to the universes. Written: the output, which is the
        centroid, or the system's default if no rule fires.
    """
    system, work = layout[index], scratch[0]
    fuzzify(values, system, work)
    cut_terms(rules, system, work.memberships, work.cuts)
    conclude(values, rules, system, work)


@compiled(nogil=True, error_model="numpy")
def infer_rows(
    values: Floats,
    rules: Integers,
    layout: Any,
    index: int,
    inputs: Floats,
    scratch: Any,
    out: Floats,
    areas: Floats,
) -> None:
    """Write the outputs of one system, (n,), and its areas, (n,), for finite inputs (n, num_inputs)."""
    work = scratch[0]
    for first in range(0, len(inputs), width_of(work)):
        num_lanes = min(width_of(work), len(inputs) - first)
        for lane in range(num_lanes):
            for column in range(inputs.shape[1]):
                work.inputs[column, lane] = inputs[first + lane, column]
        infer(values, rules, layout, index, scratch)
        for lane in range(num_lanes):
            out[first + lane] = work.output[lane]
            areas[first + lane] = work.area[lane]


def make_scratch(width: int = LANES) -> Any:
    """Allocate the working space of `infer`, for any system and `width` samples side by side."""
    scratch = aligned(1, _scratch_type(width)).view(np.recarray)
    scratch[0].memberships[packing.ANY] = 1.0
    return scratch


def _scratch() -> Any:
    """Return this thread's working space: to make one takes longer than to infer a hundred samples."""
    if not hasattr(_kept, "scratch"):
        _kept.scratch = make_scratch()
    return _kept.scratch


#: of each thread
_kept = local()


@cache
def _scratch_type(width: int) -> np.dtype[Any]:
    """Return the type of the working space: NumPy takes 15 microseconds to make it."""
    fields = [*rows_of(SCRATCH, width).descr, ("cut_terms", np.int64, 2 * packing.MAX_TERMS)]
    return np.dtype(fields, align=True)


def evaluate(packed: Packed, inputs: Floats, system: int = 0) -> Floats:
    """Return the outputs of a batch, (n,); parameters as for `evaluate_with_areas`."""
    return evaluate_with_areas(packed, inputs, system)[0]


def evaluate_with_areas(packed: Packed, inputs: Floats, system: int = 0) -> tuple[Floats, Floats]:
    """Return the outputs of a batch, and their areas.

    Parameters
    ----------
    packed : Packed
        Its first controller is evaluated.
    inputs : (n, number of inputs)
        Finite; clipped to the universes.
    system : int
        Index of the controller's system.

    Returns
    -------
    outputs : (n,)
    areas : (n,)
        Below the aggregated set, in steps of the output's universe; where one is small, hardly any digit of
        the output is right.
    """
    rows = np.ascontiguousarray(inputs, dtype=np.float64)
    outputs, areas = np.empty(len(rows)), np.empty(len(rows))
    infer_rows(packed.values[0], packed.rules[0], packed.layout, system, rows, _scratch(), outputs, areas)
    return outputs, areas
