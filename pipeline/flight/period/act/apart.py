"""Deputies kept apart, compiled: planes between stops, beside the limits of the safety layer.

docs/explanation/fleets.md has the construction and its proof. The force ``f_stop = K s`` stops a deputy
within a control period, at ``p = P s`` (`pipeline.flight.period.act.safety`). Between two deputies lies the
plane midway between their stops p_i and p_j, across ``u = (p_i - p_j) / |p_i - p_j|``. Each keeps its next
sample and its next stop half the least distance on its own side. Both are linear in the force that is sought.

A deputy that did not hear where another stops keeps both in a cube around its own stop, so small that they
stay apart wherever the other may be by now, and whichever plane or cube it keeps.

Where states and forces are inexact, deputies tell planned stops. They choose forces that lead there by their
estimates, or, if no planned force is allowed, lead back to the last one.
"""

from math import sqrt
from typing import Annotated, NamedTuple

import numpy as np

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
from fis_tools.engines.kernel import LANES
from pipeline.array_types import Floats
from pipeline.flight.period.act.safety import (
    HALVINGS,
    MOST_CUTS,
    NO_SUN,
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
from pipeline.flight.state.arrays import Moment, World, allocated
from pipeline.flight.state.lanes import clip_three
from pipeline.flight.state.link import Link, arrives
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
    """How far apart the D deputies of fleets side by side are kept, and what each knows of the others' stops.

    Of L lanes; S = delay + 2 samples of stops are kept, the latest in place of the oldest.
    """

    deputies: int  # of a fleet
    distance: float  # m
    # half-spaces g . f >= b: two for each plane, twelve of a cube, then those of other limits
    cuts: Annotated[Floats, "N", 4]
    stops: Annotated[Floats, "S", "L", 3]  # m
    # at least so far from a lane's stop is that of each deputy of its fleet, as it knows, m
    gaps: Annotated[Floats, "L", "D"]
    # (u_x, u_y, u_z, level): beyond this plane, u . r <= level, the other has kept its stop; level inf: none
    planes: Annotated[Floats, "L", "D", 4]
    # how far a deputy is led back to its planned stop in a control period, m; 0: nothing is inexact
    back: float
    forces: Annotated[Floats, 3, 3]  # that move the next stop, N/m
    plans: Annotated[Floats, "L", 3]  # where each plans to stop after the next sample, m


def make_apart(world: World, deputies: int, distance: float, delay: int, lanes: int = LANES) -> Apart:
    """Allocate what keeps the deputies of one thread's fleets apart, by a distance between planned stops."""
    sizes = {"N": 2 * (deputies - 1) + 12 + MOST_CUTS, "S": delay + 2, "L": lanes, "D": deputies}
    forces = np.linalg.inv(world.guard.checks.transition[1, :3] @ world.motion.control[0])
    back = world.guard.step_back / float(np.linalg.norm(forces, 2))
    apart: Apart = allocated(Apart, sizes, deputies=deputies, distance=distance, back=back, forces=forces)
    return apart


@compiled(error_model="numpy")
def stop_of(world: World, known: Flying) -> Three:
    """Return where a deputy in a state would stop, m."""
    return drifted_position(position_rows_of(world.guard.checks, 1), known[0], known[1])


@compiled(error_model="numpy")
def stop_of_lane(now: Moment, apart: Apart, lane: int) -> Three:
    """Return where a deputy would stop, or plans to where anything is inexact, m."""
    if apart.back > 0.0 and now.k > 0:
        return three_of(apart.plans[lane])
    belief = now.state.belief
    return stop_of(now.world, (lane_of(belief.position, 0, lane), lane_of(belief.velocity, 0, lane)))


@compiled(error_model="numpy")
def nearer_by(gap: float, distance: float) -> float:
    """Return how near to a stop one that is at least `gap` away may be after a control period, m.

    Whether it keeps to its side of the plane between them, or to its cube.
    """
    return 0.5 * (gap + min(gap, distance))


@compiled(error_model="numpy")
def gap_heard(apart: Apart, now: Moment, lane: int, other: int, distance: float, delay: int) -> float:
    """Return how far from a lane's stop another's is at least, by where it was a delay before, m."""
    size = len(apart.stops)
    then = (now.k + size - delay) % size
    stop = three_of(apart.stops[then, lane])
    gap = length(stop - three_of(apart.stops[then, other]))
    for ago in range(delay - 1, -1, -1):
        moved = three_of(apart.stops[(now.k + size - ago) % size, lane])
        gap, stop = nearer_by(gap, distance) - length(moved - stop), moved
    return gap


@compiled(error_model="numpy")
def sense_gaps(now: Moment, apart: Apart, link: Link, distance: float) -> None:
    """Note at a sample where all stop, and how near to each the others may stop, by what it heard of them.

    All starts are known to all.
    """
    deputies, size, k = apart.deputies, len(apart.stops), now.k
    for lane in range(now.num_lanes):
        stop = stop_of_lane(now, apart, lane)
        for axis, value in enumerate((stop.x, stop.y, stop.z)):
            apart.stops[k % size, lane, axis] = value
    for lane in range(now.num_lanes):
        first, stop = lane - lane % deputies, three_of(apart.stops[k % size, lane])
        before = three_of(apart.stops[(k + size - 1) % size, lane])
        for deputy in range(deputies):
            gap, plane = apart.gaps[lane, deputy], apart.planes[lane, deputy]
            if k == 0:
                gap = length(stop - three_of(apart.stops[0, first + deputy]))
            elif plane[3] < np.inf:
                gap = dot(three_of(plane), stop) - plane[3]
            else:
                gap = nearer_by(gap, distance) - length(stop - before)
            if k > 0 and arrives(link, now, lane, deputy, deputies):
                gap = max(gap, gap_heard(apart, now, lane, first + deputy, distance, link.delay))
            apart.gaps[lane, deputy] = gap


@compiled(error_model="numpy")
def place_side(world: World, free: Flying, along: Three, level: float, cuts: Floats) -> None:
    """Write the two half-spaces of forces after which sample and stop have a component, m, at least."""
    step, rows = propagator_of(world.motion, 0), position_rows_of(world.guard.checks, 1)
    write_three(cuts[0], effect_along(step, along, Three(0.0, 0.0, 0.0)))
    cuts[0, 3] = level - dot(along, free[0])
    p, q = position_gradients(rows, along)
    write_three(cuts[1], effect_along(step, p, q))
    cuts[1, 3] = level - dot(p, free[0]) - dot(q, free[1])


@compiled(error_model="numpy")
def place_planes(now: Moment, apart: Apart, link: Link, lane: int, free: Flying) -> int:
    """Write the half-spaces of forces that keep a deputy apart from all others; return their number.

    From those it has just heard it stays on its side of planes, for all others in one cube. Two deputies
    whose stops are nearer than the least distance keep what they have.
    """
    world, cuts, num_planes, room = now.world, apart.cuts, 0, np.inf
    first, slot = lane - lane % apart.deputies, now.k % len(apart.stops)
    stop, distance = three_of(apart.stops[slot, lane]), apart.distance + 2.0 * SLACK
    for deputy in range(apart.deputies):
        other, plane = first + deputy, apart.planes[lane, deputy]
        plane[3] = np.inf
        if other == lane:
            continue
        if link.delay > 0 or not arrives(link, now, lane, deputy, apart.deputies):
            room = min(room, 0.5 * (apart.gaps[lane, deputy] - distance))
            continue
        other_stop = three_of(apart.stops[slot, other])
        between = stop - other_stop
        along = between / max(length(between), TOLERANCE)
        half = 0.5 * min(length(between), distance)
        level = 0.5 * dot(along, stop + other_stop)
        write_three(plane, along)
        plane[3] = level - half
        place_side(world, free, along, level + half, cuts[num_planes:])
        num_planes += 2
    if room < np.inf:
        for axis in range(3):
            for side in (-1.0, 1.0):
                along = Three(side * (axis == 0), side * (axis == 1), side * (axis == 2))
                level = dot(along, stop) - max(room, 0.0) / sqrt(3.0)
                place_side(world, free, along, level, cuts[num_planes:])
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
        cut(world, k, free, ahead, limit, index, NO_SUN, 0.0, cuts[num_cuts])
        force = project(requested, cuts, num_cuts + 1, most)
    return force


@compiled(error_model="numpy")
def is_allowed(world: World, k: int, free: Flying, force: Three, cuts: Floats, num_planes: int) -> bool:
    """Return whether a force keeps planes, and the limits that are never given up."""
    return keeps_planes(cuts, num_planes, force) and is_safe(world, k, free, force, TOLERANCE)


@compiled(error_model="numpy")
def nearest_allowed_force(
    world: World, k: int, free: Flying, requested: Three, cuts: Floats, num_planes: int
) -> tuple[Three, bool]:
    """Return the nearest force within all limits, or within those never given up, and whether it is one."""
    num_checks = len(world.guard.checks.transition)
    force = nearest_force(world, k, free, requested, num_checks, cuts, num_planes)
    if is_allowed(world, k, free, force, cuts, num_planes):
        return force, True
    force = nearest_force(world, k, free, requested, STANDING, cuts, num_planes)
    return force, is_allowed(world, k, free, force, cuts, num_planes)


@compiled(error_model="numpy")
def towards_stop(
    world: World, k: int, known: Flying, free: Flying, force: Three, cuts: Floats, num_planes: int
) -> Three:
    """Return a force that is not allowed as far moved towards the stop as necessary, by bisection."""
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
def leads_back(world: World, apart: Apart, plan: Three) -> bool:
    """Return whether a deputy may be led back to its planned stop: it lies between the spheres."""
    distance, guard = length(plan), world.guard
    return apart.back > 0.0 and guard.keep_out - TOLERANCE <= distance <= guard.keep_in + TOLERANCE


@compiled(error_model="numpy")
def back_to(world: World, apart: Apart, known: Flying, plan: Three) -> Three:
    """Return the force that stops a deputy, and leads it back to its planned stop."""
    away = plan - stop_of(world, known)
    away = min(1.0, apart.back / max(length(away), 1e-30)) * away
    x, y, z = three_of(apart.forces[0]), three_of(apart.forces[1]), three_of(apart.forces[2])
    push = Three(dot(x, away), dot(y, away), dot(z, away))
    return clip_three(stopping_force(world.guard.stop, known[0], known[1]) + push, world.max_force)


@compiled(error_model="numpy")
def exceeded_limit(
    world: World, k: int, free: Flying, requested: Three, cuts: Floats, num_planes: int
) -> int:
    """Return the limit that a requested force exceeds most; planes before all others."""
    if not keeps_planes(cuts, num_planes, requested):
        return APART
    ahead = next_state(world, k, free, requested)
    limit = most_exceeded(world, k, ahead, len(world.guard.checks.transition))[0]
    largest = max(abs(requested.x), abs(requested.y), abs(requested.z))
    return SPEED if limit == SAFE and largest > world.guard.planned_force else limit


@compiled(error_model="numpy")
def assure_apart(now: Moment, apart: Apart, link: Link) -> None:
    """Correct the commands that lead a deputy over a plane, or beyond what the safety layer limits."""
    world, lanes, belief, k = now.world, now.state.lanes, now.state.belief, now.k
    store(lanes.limit, 0, splat(0.0, width_of(lanes)))
    store_three(lanes.change, 0, same(0.0, width_of(lanes)))
    sense_gaps(now, apart, link, apart.distance + 2.0 * SLACK)
    for lane in range(now.num_lanes):
        known = lane_of(belief.position, 0, lane), lane_of(belief.velocity, 0, lane)
        requested, free = lane_of(lanes.commanded, 0, lane), free_state(world, k, known)
        num_planes = place_planes(now, apart, link, lane, free)
        limit = exceeded_limit(world, k, free, requested, apart.cuts, num_planes)
        plan, force, is_planned = three_of(apart.stops[k % len(apart.stops), lane]), requested, True
        if limit != SAFE:
            force, is_planned = nearest_allowed_force(world, k, free, requested, apart.cuts, num_planes)
            if not is_planned and leads_back(world, apart, plan):
                force = back_to(world, apart, known, plan)
            elif not is_planned:
                force, is_planned = towards_stop(world, k, known, free, force, apart.cuts, num_planes), True
            note_correction(now, lane, limit, force - requested)
            write_lane(lanes.commanded, 0, lane, force)
        if apart.back > 0.0:
            if is_planned:
                plan = stop_of(world, next_state(world, k, free, force))
            write_three(apart.plans[lane], plan)


@compiled(error_model="numpy")
def note_correction(now: Moment, lane: int, limit: int, change: Three) -> None:
    """Note that a command was changed for a limit."""
    lanes = now.state.lanes
    lanes.num_acted[lane] += 1.0
    lanes.limit[lane] = limit
    for axis in range(3):
        lanes.corrected[lane] += abs(change[axis]) * now.world.delta_v_per_force
    write_lane(lanes.change, 0, lane, change)
