"""Plans as they are made on board: from a state alone, sum by sum, so that C gives the same bits.

A controller with `foresight_bare` plans in this way: the camera is taken to be aimed at the chief, and plans
are flown ahead only where they are made again. Here is where it would drift, what will be lit, how many
points it must see, how far it may go, what a plan fires when, and what is left of one. `pipeline.onboard`
translates these functions.
"""

from typing import NamedTuple

import numpy as np

from fis_tools.compiled.decorator import compiled
from fis_tools.compiled.three import Three, load_at
from fis_tools.compiled.vectors import load, select, store
from pipeline.array_types import Bytes, Floats
from pipeline.flight.fly.foresight import Outlook, num_periods, sample_of
from pipeline.flight.fly.prices import fired
from pipeline.flight.fly.pushes import LATEST, LATEST_OF_ENDS, PlanSearch, begin, gather
from pipeline.flight.period.look.guidance import POINTS
from pipeline.flight.period.look.optics import beam_from, lit_points, sun_after
from pipeline.flight.state.arrays import FullOptics, World
from pipeline.physics.motion import position_after, propagator_of, velocity_after
from pipeline.physics.transitions import follows_course, state_after

#: by how much plans see points beyond their horizons, and keep inside the limits besides what the rules keep:
#: for what happens between two samples, m, and for what is not known, in standard deviations of the position
MARGIN_M, SPREADS = 0.3, 1.0
#: the most by which what is left of a plan may fall short of what it must see, as priced, m/s, to be flown on
SLACK_M_S = 0.005
#: cost of a flight ahead that leaves the limits, more than any can spend
OUTSIDE_M_S = 1e4


class Confines(NamedTuple):
    """What limits the way of a deputy, m, m/s and s."""

    nearest: float  # least distance allowed
    farthest: float  # greatest distance allowed
    inside: float  # by how much the rules keep inside these
    keep_out: float  # radii that the safety layer keeps; infinite without it
    keep_in: float
    fastest: float  # along an axis, which the safety layer can stop in a control period; infinite without it
    seconds: float  # from one sample at which plans are priced to the next
    period: float  # from one plan to the next; infinite where there is but one


@compiled(error_model="numpy")
def note_products(rows: Floats, state: Floats, products: Floats) -> None:
    """Write the products of rows of six numbers, (n, m, 6), with a state, (6,)."""
    for row in range(len(products)):
        for axis in range(products.shape[1]):
            total = rows[row, axis, 0] * state[0]
            for q in range(1, 6):
                total = total + rows[row, axis, q] * state[q]
            products[row, axis] = total


@compiled(error_model="numpy")
def predict(world: World, state: Floats, force: Three, first: int, periods: int) -> None:
    """Move a state (6,), m and m/s, by control periods from the first on, over which a force, N, is held."""
    step, course, held = propagator_of(world.motion, 0), world.transitions, force
    for ahead in range(min(periods, world.num_controls)):
        position, velocity = Three(state[0], state[1], state[2]), Three(state[3], state[4], state[5])
        if follows_course(course):
            period = min(first + ahead, world.num_controls - 1)
            moved, after = state_after(course, period, position, velocity, held)
        else:
            moved, after = (
                position_after(step, position, velocity, held),
                velocity_after(step, position, velocity, held),
            )
        state[0], state[1], state[2] = moved.x, moved.y, moved.z
        state[3], state[4], state[5] = after.x, after.y, after.z
        held = Three(0.0, 0.0, 0.0)


@compiled(error_model="numpy")
def note_light(
    world: World,
    optics: FullOptics | None,
    lit_marks: Floats,
    sun_at_start: Floats,
    height_at_start: Floats,
    wanted: Floats,
    ever: Floats,
    first: int,
    step: int,
    is_lit: Bytes,
) -> int:
    """Write which of the wanted points are lit at samples `step` control periods apart, (S, P), 1 or 0.

    Parameters
    ----------
    world, optics, lit_marks
        As `lit_points` takes them.
    sun_at_start, height_at_start : (2, 1)
        Cosine and sine of the Sun's angle and elevation at the flight's start.
    wanted : (P padded,)
        1 for points to inspect.
    ever : (P padded,)
        Working space.
    first, step : int
        Control periods.
    is_lit : (S, P)
        Filled.

    Returns
    -------
    int
        How many of the wanted points are lit at any time in the flight.
    """
    sample, due, num_ever = 0, first, 0
    sun = sun_at_start[0, 0], sun_at_start[1, 0]
    height = height_at_start[0, 0], height_at_start[1, 0]
    for j in range(world.points.shape[2]):
        ever[j] = 0.0
    for k in range(world.num_controls + 1):
        sun_then, height_then = sun_after(world, sun, height, k)
        beam = beam_from(world, optics, k, sun_then, height_then)
        for j in range(0, world.points.shape[2], POINTS):
            points, before = load_at(world.points, beam.sample, 0, j, POINTS), load(ever, j, POINTS)
            lit = lit_points(world, optics, lit_marks, j, points, load(wanted, j, POINTS) > 0.0, beam)
            store(lit_marks, j, select(lit, 1.0, 0.0))
            store(ever, j, select(lit, 1.0, before))
        if k == due and sample < len(is_lit):
            for j in range(world.num_points):
                is_lit[sample, j] = 1 if lit_marks[j] > 0.0 else 0
            sample += 1
            due += step
    for j in range(world.num_points):
        num_ever += ever[j] > 0.0
    return num_ever


@compiled(error_model="numpy")
def num_needed(num_left: int, num_lit: int, missed: int) -> int:
    """Return how many points a plan must see that may miss so many of those left, of those lit in time."""
    return max(0, min(num_left - missed, num_lit))


@compiled(error_model="numpy")
def note_bounds(search: PlanSearch, num_pushes: int, reach: float, num_samples: int, is_tailed: bool) -> None:
    """Write the bounds of genes, see `price_pushes`: of components up to `reach`, N."""
    latest = max(1.0, (LATEST_OF_ENDS if is_tailed else LATEST) * (num_samples - 1))
    for gene in range(search.plans.shape[1]):
        is_force = gene < 3 * num_pushes
        search.lowest[gene] = -reach if is_force else 0.0
        search.highest[gene] = reach if is_force else latest


@compiled(error_model="numpy")
def scatter(search: PlanSearch, draws: Floats) -> None:
    """Write the first plans, from numbers from 0 to 1, (G, n)."""
    for gene in range(search.plans.shape[1]):
        drawn = draws[gene]
        for plan in range(len(search.plans)):
            across = search.highest[gene] - search.lowest[gene]
            search.plans[plan, gene] = search.lowest[gene] + across * drawn[plan]
    begin(search)


@compiled(error_model="numpy")
def scatter_near(
    search: PlanSearch, last: Floats, num_near: int, spread_n: float, spread_samples: float, draws: Floats
) -> None:
    """Write plans near what is left of the last one, and one that does nothing, in place of the first."""
    gather(search.plans, search.lowest, search.highest, last, num_near, spread_n, spread_samples, draws)
    begin(search)


@compiled(error_model="numpy")
def spread_of(rows: Floats, covariance: Floats) -> float:
    """Return at least how far a position may be off in any direction, m, a standard deviation.

    `rows`, (3, 6), lead to it from a state whose covariance is given, (6, 6) one after the other. The norm of
    its own is at least its greatest eigenvalue.
    """
    square = 0.0
    for i in range(3):
        for j in range(3):
            entry = 0.0
            for p in range(6):
                for q in range(6):
                    entry = entry + rows[i, p] * covariance[6 * p + q] * rows[j, q]
            square = square + entry * entry
    return np.sqrt(np.sqrt(square))


@compiled(error_model="numpy")
def note_constants(turns: Floats, rests: Floats, state: Floats, constants: Floats) -> None:
    """Write the constants of free motion, (6,), from a state where it begins.

    `turns`, (n, 6, 6), lead to them from states less `rests`, (n, 6); those of the first row do.
    """
    for row in range(6):
        total = turns[0, row, 0] * (state[0] - rests[0, 0])
        for q in range(1, 6):
            total = total + turns[0, row, q] * (state[q] - rests[0, q])
        constants[row] = total


@compiled(error_model="numpy")
def turn_covariance(turns: Floats, covariance: Floats, half: Floats, turned: Floats) -> None:
    """Write the covariance of constants of free motion from that of a state, (6, 6) one after the other.

    `turns` are those of `note_constants`; `half` is working space.
    """
    for p in range(6):
        for q in range(6):
            total = 0.0
            for r in range(6):
                total = total + turns[0, p, r] * covariance[6 * r + q]
            half[6 * p + q] = total
    for p in range(6):
        for q in range(6):
            total = 0.0
            for r in range(6):
                total = total + half[6 * p + r] * turns[0, q, r]
            turned[6 * p + q] = total


@compiled(error_model="numpy")
def note_doubts(rows: Floats, covariance: Floats, factor: float, doubts: Floats) -> None:
    """Write how far along the track free motion may be off, (T,), m^2: variances, times a factor.

    `rows`, (T, 3, 6), lead there from constants whose covariance is given, (6, 6) one after the other.
    """
    for row in range(len(rows)):
        square = 0.0
        for p in range(6):
            for q in range(6):
                square = square + rows[row, 1, p] * covariance[6 * p + q] * rows[row, 1, q]
        doubts[row] = factor * square


@compiled(error_model="numpy")
def margin_of(spread: float) -> float:
    """Return how much farther away than need be plans stay, m, where the position may be so far off."""
    return MARGIN_M + SPREADS * spread


@compiled(error_model="numpy")
def limits_of(bounds: Confines, margin: float) -> Three:
    """Return least and greatest distance of plans, and their longest way from a sample to the next, m."""
    inside = bounds.inside + margin
    nearest = max(bounds.nearest + inside, bounds.keep_out + margin)
    farthest = min(bounds.farthest - inside, bounds.keep_in - margin)
    return Three(nearest, farthest, bounds.seconds * (bounds.fastest - margin / bounds.period))


@compiled(error_model="numpy")
def note_limits(
    bounds: Confines,
    rows: Floats,
    covariance: Floats,
    heights_of_points: Floats,
    sight: float,
    max_range: float,
    heights: Floats,
    limits: Floats,
) -> None:
    """Write what plans keep to: heights of points' horizons, (P,), and other limits, (5,), all m."""
    margin = margin_of(spread_of(rows, covariance))
    kept = limits_of(bounds, margin)
    for point in range(len(heights)):
        heights[point] = heights_of_points[point] + margin
    limits[0], limits[1], limits[2] = kept.x, kept.y, kept.z
    limits[3], limits[4] = sight + margin, max_range - margin


@compiled(error_model="numpy")
def is_held(genes: Floats, num_pushes: int, cost: float, delta_v_per_force: float) -> bool:
    """Return whether what is left of a plan, at its price, m/s, is still nearly good enough."""
    spent = 0.0
    for part in range(3 * num_pushes):
        spent = spent + abs(genes[part])
    return cost <= spent * delta_v_per_force + SLACK_M_S


@compiled(error_model="numpy")
def cost_ahead(spent: float, beyond: float, num_left: float, accepted: float, price: float) -> float:
    """Return the cost of a flight ahead, m/s: delta-v, and prices of points left and of leaving the limits.

    So many points may be left at no cost. See `rehearsed_costs`.
    """
    cost = spent + price * max(0.0, num_left - accepted)
    return cost + OUTSIDE_M_S if beyond > 0.0 else cost


@compiled(error_model="numpy")
def give(
    genes: Floats, num_pushes: int, outlook: Outlook, most_force: float, period: int, given: Floats
) -> None:
    """Write what a plan fires so many control periods after it begins, N, and 1 where it is over, (4,).

    Thrusters fire at most `most_force`, N, along each axis: larger pushes take several control periods.
    """
    end = 0
    for column in range(4):
        given[column] = 0.0
    for component in range(3 * num_pushes):
        part = fired(genes, component, outlook.least_force)
        if part != 0.0:
            first = outlook.step * sample_of(genes, num_pushes, component // 3, len(outlook.free))
            count = num_periods(part, most_force)
            end = max(end, first + count)
            if first <= period < first + count:
                given[component % 3] += part / count
    if period >= end:
        given[3] = 1.0


@compiled(error_model="numpy")
def note_left(
    genes: Floats,
    num_pushes: int,
    outlook: Outlook,
    most_force: float,
    num_controls: int,
    begun: int,
    given: Floats,
    left: Floats,
) -> None:
    """Write what a plan that began so many control periods ago would still fire, as a plan's genes.

    Pushes beyond one now and the next ones later are left out; those in a row are parts of one. Parts of a
    flight of `num_controls` periods that come after its end fire nothing.
    """
    push, was_fired = 0, False
    for gene in range(len(left)):
        left[gene] = 0.0
    for period in range(num_controls):
        if begun + period < num_controls:
            give(genes, num_pushes, outlook, most_force, begun + period, given)
            is_fired = given[0] != 0.0 or given[1] != 0.0 or given[2] != 0.0
            is_part = period > 0 and was_fired
            if is_fired and period > 0 and not is_part:
                push = min(push + 1, num_pushes)
            if is_fired and push < num_pushes:
                for axis in range(3):
                    left[3 * push + axis] += given[axis]
                if push > 0 and not is_part:
                    left[3 * num_pushes + push - 1] = period / outlook.step + 0.01
            was_fired = is_fired
