"""Deputies kept apart, compiled: planes between stops, beside the limits of the safety layer.

docs/explanation/fleets.md has the construction and its proof. The force ``f_stop = K s`` stops a deputy
within a control period, at ``p = P s`` (`pipeline.flight.period.act.safety`). Between two deputies lies the
plane midway between their stops p_i and p_j, across ``u = (p_i - p_j) / |p_i - p_j|``. Each keeps its next
sample and its next stop half the least distance on its own side. Both are linear in the force that is sought.
"""

from typing import NamedTuple

from fis_tools.compiled.decorator import compiled
from fis_tools.compiled.three import (
    Three,
    dot,
    lane_of,
    length,
    same,
    store_three,
    three_of,
    write_lane,
    write_three,
)
from fis_tools.compiled.vectors import splat, store, width_of
from pipeline.array_types import Floats
from pipeline.flight.period.act.safety import (
    HALVINGS,
    MOST_CUTS,
    SLACK,
    STANDING,
    TOLERANCE,
    Flying,
    cut,
    free_state,
    is_safe,
    most_exceeded,
    next_state,
    project,
)
from pipeline.flight.state.arrays import Moment, World
from pipeline.flight.state.lanes import clip_three
from pipeline.flight.state.log import APART, SAFE, SPEED
from pipeline.physics.motion import (
    drifted_position,
    effect_along,
    position_gradients,
    position_rows_of,
    propagator_of,
    stopping_force,
)

#: tolerance for rounding of a plane, m: all samples of a flight together lose less than a micrometre
ROUNDING = 1e-9


class Apart(NamedTuple):
    """How far apart deputies are kept."""

    deputies: int  # of a fleet
    distance: float  # m
    cuts: Floats  # (2 (deputies - 1) + MOST_CUTS, 4) half-spaces g . f >= b: the planes, then other limits


def num_half_spaces(deputies: int) -> int:
    """Return the number of half-spaces that keep a deputy of a fleet apart and inside its limits."""
    return 2 * (deputies - 1) + MOST_CUTS


@compiled(error_model="numpy")
def stop_of_lane(now: Moment, lane: int) -> Three:
    """Return where a deputy would stop, m."""
    belief = now.state.belief
    rows = position_rows_of(now.world.guard.checks, 1)
    return drifted_position(rows, lane_of(belief.position, 0, lane), lane_of(belief.velocity, 0, lane))


@compiled(error_model="numpy")
def place_planes(now: Moment, apart: Apart, lane: int, free: Flying) -> int:
    """Write the half-spaces of forces that keep a deputy on its side of each plane; return their number.

    Two deputies whose stops are nearer than the least distance keep what they have.
    """
    world, cuts, num_planes = now.world, apart.cuts, 0
    first, stop = lane - lane % apart.deputies, stop_of_lane(now, lane)
    step, rows = propagator_of(world.motion, 0), position_rows_of(world.guard.checks, 1)
    for other in range(first, first + apart.deputies):
        if other == lane:
            continue
        other_stop = stop_of_lane(now, other)
        between = stop - other_stop
        distance = length(between)
        along = between / max(distance, TOLERANCE)
        level = 0.5 * (dot(along, stop + other_stop) + min(distance, apart.distance + 2.0 * SLACK))
        write_three(cuts[num_planes], effect_along(step, along, Three(0.0, 0.0, 0.0)))
        cuts[num_planes, 3] = level - dot(along, free[0])
        p, q = position_gradients(rows, along)
        write_three(cuts[num_planes + 1], effect_along(step, p, q))
        cuts[num_planes + 1, 3] = level - dot(p, free[0]) - dot(q, free[1])
        num_planes += 2
    return num_planes


@compiled(error_model="numpy")
def keeps_planes(cuts: Floats, num_planes: int, force: Three) -> bool:
    """Return whether a force keeps all planes, except for rounding."""
    is_kept = True
    for row in range(num_planes):
        is_kept &= dot(three_of(cuts[row]), force) >= cuts[row, 3] - ROUNDING
    return is_kept


@compiled(error_model="numpy")
def nearest_force(
    world: World, k: int, free: Flying, requested: Three, num_checks: int, cuts: Floats, num_planes: int
) -> Three:
    """Return the force nearest to the requested one that keeps planes and the limits of the first checks.

    As `pipeline.flight.period.act.safety.nearest_safe_force`, with the planes among the cuts from the start.
    """
    most = world.guard.planned_force
    force = project(requested, cuts, num_planes, most)
    for num_cuts in range(num_planes, len(cuts)):
        ahead = next_state(world, k, free, force)
        limit, index, _ = most_exceeded(world, k, ahead, num_checks)
        if limit == SAFE:
            break
        cut(world, k, free, ahead, limit, index, cuts[num_cuts])
        force = project(requested, cuts, num_cuts + 1, most)
    return force


@compiled(error_model="numpy")
def is_allowed(world: World, k: int, free: Flying, force: Three, cuts: Floats, num_planes: int) -> bool:
    """Return whether a force keeps planes, and the limits that are never given up."""
    return keeps_planes(cuts, num_planes, force) and is_safe(world, k, free, force, TOLERANCE)


@compiled(error_model="numpy")
def corrected(
    world: World, k: int, known: Flying, free: Flying, requested: Three, cuts: Floats, num_planes: int
) -> Three:
    """Return the force that replaces one that exceeds a limit.

    Tried in this order: all limits; only those that are never given up; as far from the stop as they allow.
    """
    num_checks = len(world.guard.checks.transition)
    force = nearest_force(world, k, free, requested, num_checks, cuts, num_planes)
    if is_allowed(world, k, free, force, cuts, num_planes):
        return force
    force = nearest_force(world, k, free, requested, STANDING, cuts, num_planes)
    if is_allowed(world, k, free, force, cuts, num_planes):
        return force
    stop = clip_three(stopping_force(world.guard.stop, known[0], known[1]), world.max_force)
    if not is_safe(world, k, free, stop, 2.0 * TOLERANCE):
        return force  # outside the safe set
    low, high = 0.0, 1.0
    for _ in range(HALVINGS):
        share = 0.5 * (low + high)
        if is_allowed(world, k, free, stop + share * (force - stop), cuts, num_planes):
            low = share
        else:
            high = share
    return clip_three(stop + low * (force - stop), world.max_force)


@compiled(error_model="numpy")
def assure_apart(now: Moment, apart: Apart) -> None:
    """Correct the commands that lead a deputy over a plane, or beyond what the safety layer limits."""
    world, lanes, belief, k = now.world, now.state.lanes, now.state.belief, now.k
    store(lanes.limit, 0, splat(0.0, width_of(lanes)))
    store_three(lanes.change, 0, same(0.0, width_of(lanes)))
    num_checks, most = len(world.guard.checks.transition), world.guard.planned_force
    for lane in range(now.num_lanes):
        known = lane_of(belief.position, 0, lane), lane_of(belief.velocity, 0, lane)
        requested, free = lane_of(lanes.commanded, 0, lane), free_state(world, k, known)
        num_planes = place_planes(now, apart, lane, free)
        limit = most_exceeded(world, k, next_state(world, k, free, requested), num_checks)[0]
        if limit == SAFE and max(abs(requested.x), abs(requested.y), abs(requested.z)) > most:
            limit = SPEED
        if not keeps_planes(apart.cuts, num_planes, requested):
            limit = APART
        if limit == SAFE:
            continue
        force = corrected(world, k, known, free, requested, apart.cuts, num_planes)
        lanes.num_acted[lane] += 1.0
        lanes.limit[lane] = limit
        change = force - requested
        for axis in range(3):
            lanes.corrected[lane] += abs(change[axis]) * world.delta_v_per_force
        write_lane(lanes.change, 0, lane, change)
        write_lane(lanes.commanded, 0, lane, force)
