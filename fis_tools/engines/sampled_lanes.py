"""Outputs as sums over points, many samples side by side; see `fis_tools.engines.sampling`.

Rules that conclude one term count together where that is the same but for rounding: under the maximum the
strongest, in a sum of products their sum. The centroid of cut terms stores no heights, and leaves terms out:
in a piece of the points the highest hide the others as soon as their least height exceeds the next one's
greatest. The rest is done sample by sample: rare operators, all but the centroid, heights that are faint.
"""

from typing import NamedTuple

import numpy as np

from fis_tools.array_types import Floats, Integers
from fis_tools.compiled.decorator import compiled
from fis_tools.compiled.vectors import (
    Vector,
    aligned,
    borrowed,
    least,
    load,
    most,
    select,
    some,
    splat,
    spread,
    store,
)
from fis_tools.engines import codes
from fis_tools.engines.lanes import LANES
from fis_tools.engines.packing import PIECE
from fis_tools.engines.program import Summation
from fis_tools.engines.sampling import FAINT, aggregate, defuzzify


class Room(NamedTuple):
    """What `conclude_lanes` works in.

    Attributes
    ----------
    cuts : (num_terms * LANES,)
        Strengths of terms.
    heights : (num_points * LANES,)
    answers : (LANES,)
    strengths, cuts_of_one, heights_of_one : (num_rules,), (num_terms,), (num_points,)
        Of one sample.
    """

    cuts: Floats
    heights: Floats
    answers: Floats
    strengths: Floats
    cuts_of_one: Floats
    heights_of_one: Floats


def make_room(summation: Summation, num_rules: int) -> Room:
    """Return what `conclude_lanes` works in."""
    terms, points = summation.memberships.shape
    lanes = aligned(terms * LANES), aligned(points * LANES), aligned(LANES)
    return Room(*lanes, np.empty(num_rules), np.empty(terms), np.empty(points))


@compiled(error_model="numpy", nogil=True)
def conclude_sampled(
    summation: Summation, firing: Floats, degrees: Floats, slots: Integers, room: Room, out: Floats
) -> None:
    """Compute one output, (n,), from firing strengths (n, num_rules).

    `degrees`, (num_rules * LANES,), are filled, and `slots` are the numbers of the rules.
    """
    summed, degrees, slots, room = borrowed((summation, degrees, slots, room))
    for first in range(0, len(firing), LANES):
        for lane in range(LANES):
            sample = min(first + lane, len(firing) - 1)
            for rule in range(len(slots)):
                degrees[rule * LANES + lane] = firing[sample, rule]
        conclude_lanes(summed, degrees, slots, room, out[first : first + LANES])


@compiled(error_model="numpy")
def conclude_lanes(summation: Summation, degrees: Floats, slots: Integers, room: Room, out: Floats) -> None:
    """Compute one output of up to `LANES` samples, (n,).

    Parameters
    ----------
    summation : Summation
    degrees : (num_slots * LANES,)
        Degrees of truth; lanes without a sample repeat another one.
    slots : (num_rules,)
        Where those of each rule are.
    room : Room
    out : (n,)
    """
    is_centroid, has_heights = summation.defuzzifier == codes.CENTROID, False
    if is_centroid and summation.implication == codes.MIN and summation.aggregation == codes.MAX:
        is_done = _cut_centroids(summation, degrees, slots, room)
    else:
        has_heights = _write_heights(summation, degrees, slots, room)
        is_done = has_heights and is_centroid and _centroids(summation, room)
    for lane in range(len(out)):
        if is_done:
            out[lane] = room.answers[lane]
            continue
        if has_heights:
            for point in range(len(room.heights_of_one)):
                room.heights_of_one[point] = room.heights[point * LANES + lane]
        else:
            for rule in range(len(slots)):
                room.strengths[rule] = degrees[slots[rule] * LANES + lane]
            aggregate(summation, room.strengths, room.cuts_of_one, room.heights_of_one)
        out[lane] = defuzzify(summation, room.heights_of_one)


@compiled(error_model="numpy", forceinline=True)
def _write_heights(summation: Summation, degrees: Floats, slots: Integers, room: Room) -> bool:
    """Write the heights of a block of samples; return whether its operators are among those done here."""
    implication, aggregation = summation.implication, summation.aggregation
    rules, weights, terms = summation.rules, summation.weights, summation.terms
    values, points = summation.memberships.reshape(-1), len(summation.universe)
    is_product, is_sum = implication == codes.PRODUCT, aggregation == codes.UNBOUNDED_SUM
    if not is_product and implication != codes.MIN:
        return False
    joins = aggregation == codes.MAX or (is_product and is_sum)
    if not joins and not is_sum and aggregation not in (codes.BOUNDED_SUM, codes.PROBABILISTIC_SUM):
        return False
    room.heights[:] = 0.0
    if joins:
        room.cuts[:] = 0.0
        for index in range(len(rules)):
            strength = load(degrees, slots[rules[index]] * LANES, LANES) * weights[index]
            cut = load(room.cuts, terms[index] * LANES, LANES)
            store(room.cuts, terms[index] * LANES, cut + strength if is_sum else most(strength, cut))
    for index in range(len(summation.memberships) if joins else len(rules)):
        if joins:
            term, strength = index, load(room.cuts, index * LANES, LANES)
        else:
            term = terms[index]
            strength = load(degrees, slots[rules[index]] * LANES, LANES) * weights[index]
        if not some(strength > 0.0):
            continue
        for point in range(points):
            membership = spread(values, term * points + point, LANES)
            implied = strength * membership if is_product else least(strength, membership)
            height = load(room.heights, point * LANES, LANES)
            store(room.heights, point * LANES, _aggregated(aggregation, height, implied))
    return True


@compiled(error_model="numpy", forceinline=True)
def _aggregated(aggregation: int, height: Vector, implied: Vector) -> Vector:
    if aggregation == codes.MAX:
        return most(implied, height)
    either = height + implied
    if aggregation == codes.BOUNDED_SUM:
        either = least(either, 1.0)
    elif aggregation == codes.PROBABILISTIC_SUM:
        either = either - height * implied
    return either


@compiled(error_model="numpy", forceinline=True)
def _centroids(summation: Summation, room: Room) -> bool:
    """Write the centroids of heights; return whether it is possible, like `_cut_centroids`."""
    area, moment, highest = splat(0.0, LANES), splat(0.0, LANES), splat(0.0, LANES)
    for point in range(len(summation.universe)):
        height = load(room.heights, point * LANES, LANES)
        highest = most(height, highest)
        area += height
        moment += height * summation.universe[point]
    return _answered(summation, highest, area, moment, room)


@compiled(error_model="numpy", forceinline=True)
def _answered(summation: Summation, highest: Vector, area: Vector, moment: Vector, room: Room) -> bool:
    """Write centroids of sums; return whether all digits are kept: not where heights are faint."""
    x = summation.universe
    fires = highest > 0.0
    centroid = least(most(moment / select(fires, area, 1.0), x[0]), x[len(x) - 1])
    store(room.answers, 0, select(fires, centroid, summation.default))
    return not some(fires & (highest < FAINT))


@compiled(error_model="numpy", forceinline=True)
def _cut_centroids(summation: Summation, degrees: Floats, slots: Integers, room: Room) -> bool:
    """Write the centroids of cut terms; return whether all digits are kept."""
    rules, weights, bounds = summation.rules, summation.weights, summation.bounds
    highest = splat(0.0, LANES)
    for term in range(len(summation.memberships)):
        cut = splat(0.0, LANES)
        for index in range(bounds[term], bounds[term + 1]):
            cut = most(load(degrees, slots[rules[index]] * LANES, LANES) * weights[index], cut)
        store(room.cuts, term * LANES, cut)
        highest = most(least(cut, summation.peaks[term]), highest)
    area, moment = _sums(summation, room.cuts)
    return _answered(summation, highest, area, moment, room)


@compiled(error_model="numpy", forceinline=True)
def _sums(summation: Summation, cuts: Floats) -> tuple[Vector, Vector]:
    """Return the sums of the heights of cut terms, and of their products with the points."""
    x, ranks, ends = summation.universe, summation.ranks, summation.ends
    values = summation.memberships.reshape(-1)
    points, terms = len(x), len(summation.memberships)
    area, moment = splat(0.0, LANES), splat(0.0, LANES)
    for piece in range(len(ranks)):
        floor = splat(0.0, LANES)
        num_ranks = 0
        while num_ranks < terms and (num_ranks == 0 or some(floor < ends[piece, num_ranks, 0])):
            cut = load(cuts, ranks[piece, num_ranks] * LANES, LANES)
            floor = most(least(cut, ends[piece, num_ranks, 1]), floor)
            num_ranks += 1
        for point in range(PIECE * piece, min(PIECE * (piece + 1), points)):
            height = splat(0.0, LANES)
            for rank in range(num_ranks):
                term = ranks[piece, rank]
                cut = load(cuts, term * LANES, LANES)
                height = most(least(spread(values, term * points + point, LANES), cut), height)
            area += height
            moment += height * x[point]
    return area, moment
