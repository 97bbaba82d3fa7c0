"""Run-time assurance, compiled: the smallest change of force that keeps the deputies safe.

docs/explanation/safety.md has the limits, their sources, and why samples never leave the spheres. A force f
held over the control period T leads to the next state ``s = Phi s(k) + Gamma f``. From there the force
``f_stop = K s``, ``K = -Gamma_v^-1 Phi_v``, stops the deputy within a period, at ``r_stop = P s``,
``P = Phi_r + Gamma_r K``. Never given up are the limits on the distance at s and at r_stop, on each axis of
f_stop, and on the speed, ``|v| <= v0 + v1 (|r| - d0)``, and that along each axis, if one is set.

Limits on the distance in free drift from s, at all samples of a horizon, act early, while a small force is
enough (passive safety: Breger and How, "Safe trajectories for autonomous rendezvous of spacecraft",
J. Guidance 31, 2008). They yield to the others. First of all yields the cone in which a camera that points
at the chief looks into the Sun: it turns with the Sun, so that a deputy at rest does not stay outside.

On a true course states are predicted along the chief's orbit. Stops there are those of the mean motion, which
the bounds on neglected accelerations cover.
"""

from math import cos, sin, sqrt

import numpy as np

from fis_tools.compiled.decorator import compiled
from fis_tools.compiled.three import (
    Three,
    dot,
    lane_of,
    length,
    load_three,
    same,
    store_three,
    three_of,
    write_lane,
    write_three,
)
from fis_tools.compiled.vectors import Mask, least, most, select, some, splat, store, width_of
from pipeline.array_types import Floats
from pipeline.flight.period.look.optics import Pair, turned_back
from pipeline.flight.state.arrays import FlightState, Moment, World
from pipeline.flight.state.lanes import clip_three, load_pair
from pipeline.flight.state.log import AXIS_SPEED, KEEP_IN, KEEP_OUT, PASSIVE_SAFETY, SAFE, SPEED, SUN
from pipeline.physics.motion import (
    drifted_position,
    drifted_velocity,
    effect_along,
    position_after,
    position_gradients,
    position_rows_of,
    propagator_of,
    pushed,
    stopping_force,
    velocity_after,
)
from pipeline.physics.transitions import (
    constants_at,
    effect_in_period,
    follows_course,
    gradients_of,
    position_at,
    pushed_in_period,
    state_after,
)

#: position (m) and velocity (m/s) of one deputy, Hill axes
Flying = tuple[Three, Three]

#: rows of `Guard.checks` whose limits are never given up: at the next sample, and stopped from there
STANDING = 2
#: rows of `Guard.stop` that give the stop's force; of those that follow, the row of the Sun's cone
NUM_BRAKING, OF_SUN = 3, 6
#: share of the depth in the Sun's cone that may be left after a control period
STAYING = 0.98
#: the Sun where its cone is given up, or there is none
NO_SUN = Three(0.0, 0.0, 0.0)
#: margin of corrections to a limit, m, and to one that acts early, so that the next sample needs none
SLACK, EARLY_SLACK = 1e-4, 0.1
#: tolerance for rounding, m
TOLERANCE = 1e-6
#: largest number of half-spaces that replace the exceeded limits
MOST_CUTS = 12
#: most sweeps of the projection onto them, and the change of force that ends them, N
MOST_SWEEPS, LEAST_CHANGE = 200, 1e-12
#: what no step of the projection comes near, N: so it stays finite whatever it is given
FAR = 1e9
#: bisection steps between the stop and an unsafe force
HALVINGS = 30


@compiled(error_model="numpy", forceinline=True)
def free_from(world: World, k: int, ahead: Flying) -> Flying:
    """Return the constants of free motion from the state ahead of sample k; that state itself on a circle."""
    if follows_course(world.transitions):
        return constants_at(world.transitions, k + 1, ahead[0], ahead[1])
    return ahead


@compiled(error_model="numpy", forceinline=True)
def checked_position(world: World, k: int, row: int, ahead: Flying, free: Flying) -> Three:
    """Return the position of a check of the state ahead of sample k, m; `free` is that of `free_from`."""
    if row >= STANDING and follows_course(world.transitions):
        return position_at(world.transitions, k + 2 + row - STANDING, free)
    return drifted_position(position_rows_of(world.guard.checks, row), ahead[0], ahead[1])


@compiled(error_model="numpy", forceinline=True)
def keeps_from_sun(world: World) -> bool:
    """Return whether deputies are to stay out of the Sun's cone."""
    return len(world.guard.stop) > OF_SUN


@compiled(error_model="numpy", forceinline=True)
def turned_by_period(world: World, turned: Pair) -> Pair:
    """Return cosine and sine of the Sun's angle at the next sample, as deputies predict it."""
    angle = world.mean_motion * world.control_period
    return turned_back(turned, (cos(angle), sin(angle)))


@compiled(error_model="numpy", forceinline=True)
def sun_at(turned: Pair, height: Pair) -> Three:
    """Return the direction of the Sun by cosines and sines of its angle and elevation."""
    return Three(height[0] * turned[0], height[0] * turned[1], height[1])


@compiled(error_model="numpy")
def depth_in_cone(world: World, position: Three, sun: Three) -> float:
    """Return how far inside the Sun's cone a position lies, m; negative outside.

    There, on the far side of the chief, the angle between the chief and the Sun is too small.
    """
    if not keeps_from_sun(world):
        return 0.0
    cosine, along = world.guard.stop[OF_SUN, 0], -dot(position, sun)
    across = sqrt(max(0.0, dot(position, position) - along * along))
    depth: float = along * sqrt(1.0 - cosine * cosine) - across * cosine
    return depth


@compiled(error_model="numpy")
def out_of_cone(world: World, position: Three, sun: Three) -> Three:
    """Return the normal of the Sun's cone at the line of it that is nearest to a position inside."""
    cosine, along = world.guard.stop[OF_SUN, 0], -dot(position, sun)
    across = position + along * sun
    if length(across) < TOLERANCE:  # on the axis any way out is as good
        across = Three(-sun.y, sun.x, 0.0) if abs(sun.z) < 0.9 else Three(0.0, -sun.z, sun.y)
    return cosine / length(across) * across + sqrt(1.0 - cosine * cosine) * sun


@compiled(error_model="numpy")
def look_ahead(world: World, k: int, state: FlightState) -> Mask:
    """Return the lanes whose forces, commanded at sample k, may lead to an unsafe state."""
    guard, belief = world.guard, state.belief
    width = width_of(state.lanes)
    position, velocity = load_three(belief.position, 0), load_three(belief.velocity, 0)
    force = load_three(state.lanes.commanded, 0)
    if follows_course(world.transitions):
        next_position, next_velocity = state_after(world.transitions, k, position, velocity, force)
    else:
        step = propagator_of(world.motion, 0)
        next_position, next_velocity = (
            position_after(step, position, velocity, force),
            velocity_after(step, position, velocity, force),
        )
    stop = stopping_force(guard.stop, next_position, next_velocity)
    braking = most(most(abs(stop.x), abs(stop.z)), abs(stop.y))
    closest, reach = splat(np.inf, width), splat(0.0, width)
    ahead = next_position, next_velocity
    free = free_from(world, k, ahead)
    for row in range(len(guard.checks.transition)):
        checked = checked_position(world, k, row, ahead, free)
        square = dot(checked, checked)
        if row < guard.num_kept_out:
            closest = least(square, closest)
        if row < guard.num_kept_in:
            reach = most(square, reach)
    is_unsafe = length(next_velocity) - guard.speed_at_chief - guard.speed_slope * length(next_position) > 0.0
    is_unsafe |= braking > guard.braking_force
    if len(guard.stop) > NUM_BRAKING:
        u, v, w = next_velocity
        is_unsafe |= guard.stop[3, 3] * most(most(abs(u), abs(w)), abs(v)) > guard.braking_force
    if keeps_from_sun(world):
        lanes, cosine = state.lanes, guard.stop[OF_SUN, 0]
        sun = sun_at(turned_by_period(world, load_pair(lanes.sun)), load_pair(lanes.sun_height))
        is_unsafe |= -dot(next_position, sun) - cosine * length(next_position) > 0.0
    is_unsafe |= most(most(abs(force.x), abs(force.z)), abs(force.y)) > guard.planned_force
    return is_unsafe | (closest < guard.keep_out * guard.keep_out) | (reach > guard.keep_in * guard.keep_in)


@compiled(error_model="numpy")
def free_state(world: World, k: int, known: Flying) -> Flying:
    """Return the state after sample k without a force."""
    if follows_course(world.transitions):
        return state_after(world.transitions, k, known[0], known[1], Three(0.0, 0.0, 0.0))
    step = propagator_of(world.motion, 0)
    return drifted_position(step.position, known[0], known[1]), drifted_velocity(step, known[0], known[1])


@compiled(error_model="numpy")
def next_state(world: World, k: int, free: Flying, force: Three) -> Flying:
    """Return the state after sample k under a force, from that without it."""
    if follows_course(world.transitions):
        return pushed_in_period(world.transitions, k, free, force)
    step = propagator_of(world.motion, 0)
    return pushed(free[0], step.pushed_position, force), pushed(free[1], step.pushed_velocity, force)


@compiled(error_model="numpy")
def most_exceeded(world: World, k: int, ahead: Flying, num_checks: int) -> tuple[int, int, float]:
    """Return the limit that the state after sample k exceeds most, the index of its check, and the excess, m.

    Speeds count by the distance covered in a period, braking forces, and speeds along an axis as such, by the
    displacement in one.
    """
    guard, free = world.guard, free_from(world, k, ahead)
    limit, index, excess = SAFE, 0, 0.0
    for row in range(num_checks):
        distance = length(checked_position(world, k, row, ahead, free))
        if row < guard.num_kept_out and guard.keep_out - distance > excess:
            limit, index, excess = PASSIVE_SAFETY, row, guard.keep_out - distance
            limit = KEEP_OUT if row < STANDING else limit
        if row < guard.num_kept_in and distance - guard.keep_in > excess:
            limit, index, excess = KEEP_IN, row, distance - guard.keep_in
    fastest = guard.speed_at_chief + guard.speed_slope * length(ahead[0])
    over = world.control_period * (length(ahead[1]) - fastest)
    if over > excess:
        limit, index, excess = SPEED, 0, over
    braking = stopping_force(guard.stop, ahead[0], ahead[1])
    for axis in range(3):
        over = world.motion.control[0, 2, 2] * (abs(braking[axis]) - guard.braking_force)
        if over > excess:
            limit, index, excess = SPEED, 1 + axis, over
    for row in range(NUM_BRAKING, min(len(guard.stop), OF_SUN)):
        speed = guard.stop[row, row] * ahead[1][row - NUM_BRAKING]
        over = world.motion.control[0, 2, 2] * (abs(speed) - guard.braking_force)
        if over > excess:
            limit, index, excess = AXIS_SPEED, row, over
    return limit, index, excess


@compiled(error_model="numpy")
def cut(
    world: World,
    k: int,
    free: Flying,
    ahead: Flying,
    limit: int,
    index: int,
    sun: Three,
    most_deep: float,
    half_space: Floats,
) -> None:
    """Write the half-space ``g . f >= b`` that is tangent to a limit in the direction of a next state.

    Outside a sphere or the cone, the half-space lies in the safe set; inside a sphere, it contains that.
    """
    guard, (position, velocity) = world.guard, ahead
    # the limit, linear: p . r + q . v >= level
    if limit == SPEED and index > 0:
        axis = min(index, 3) - 1
        row = guard.stop[axis]
        sign = -1.0 if stopping_force(guard.stop, position, velocity)[axis] > 0.0 else 1.0
        p, q = sign * three_of(row), sign * three_of(row[3:])
        level = SLACK / world.motion.control[0, 2, 2] - guard.braking_force
    elif limit == AXIS_SPEED:
        row = guard.stop[min(index, len(guard.stop) - 1)]
        sign = -1.0 if dot(three_of(row[3:]), velocity) > 0.0 else 1.0
        p, q = sign * three_of(row), sign * three_of(row[3:])
        level = SLACK / world.motion.control[0, 2, 2] - guard.braking_force
    elif limit == SUN and keeps_from_sun(world):
        p, q, level = out_of_cone(world, position, sun), NO_SUN, EARLY_SLACK - most_deep
    elif limit == SPEED:
        speed, distance = max(length(velocity), TOLERANCE), max(length(position), TOLERANCE)
        p, q = guard.speed_slope * position / distance, -1.0 * velocity / speed
        level = SLACK / world.control_period - guard.speed_at_chief
    else:
        outward = checked_position(world, k, index, ahead, free_from(world, k, ahead))
        sign = -1.0 if limit == KEEP_IN else 1.0
        along = (sign / max(length(outward), TOLERANCE)) * outward
        if index >= STANDING and follows_course(world.transitions):
            p, q = gradients_of(world.transitions, k + 1, k + 2 + index - STANDING, along)
        else:
            p, q = position_gradients(position_rows_of(guard.checks, index), along)
        level = SLACK if index < STANDING else EARLY_SLACK
        level += -guard.keep_in if limit == KEEP_IN else guard.keep_out
    (x, y, z), (u, v, w) = free
    level = level - p.x * x - p.y * y - p.z * z - q.x * u - q.y * v - q.z * w
    if follows_course(world.transitions):
        write_three(half_space, effect_in_period(world.transitions, k, p, q))
    else:
        write_three(half_space, effect_along(propagator_of(world.motion, 0), p, q))
    half_space[3] = level


@compiled(error_model="numpy")
def project(requested: Three, cuts: Floats, num_cuts: int, max_force: float) -> Three:
    """Project a force onto half-spaces ``g . f >= b``, rows of four numbers, and the box of the thruster.

    Dykstra's alternating projections, which for half-spaces are Hildreth's method for quadratic programmes
    (Boyle and Dykstra, "A method for finding projections onto the intersection of convex sets in Hilbert
    spaces", 1986; Hildreth, "A quadratic programming procedure", Naval Research Logistics Quarterly 4, 1957).
    If the sets do not intersect, the result is in the box.
    """
    multipliers = np.zeros(num_cuts)
    force, box_correction = requested, Three(0.0, 0.0, 0.0)
    for _ in range(MOST_SWEEPS):
        before = force
        for c in range(num_cuts):
            g = three_of(cuts[c])
            short = (cuts[c, 3] - dot(g, force)) / max(dot(g, g), 1e-30)
            step = max(short, -multipliers[c])
            multipliers[c] += step
            force = clip_three(force + step * g, FAR)
        wished = force + box_correction
        force = clip_three(wished, max_force)
        box_correction, change = clip_three(wished - force, FAR), force - before
        if max(abs(change.x), abs(change.y), abs(change.z)) < LEAST_CHANGE:
            break
    return force


@compiled(error_model="numpy")
def nearest_safe_force(
    world: World,
    k: int,
    free: Flying,
    requested: Three,
    num_checks: int,
    sun: Three,
    most_deep: float,
    cuts: Floats,
) -> Three:
    """Return the force nearest to the requested one that keeps the limits of the first checks, if any does.

    Nor does it lead deeper into the Sun's cone than `most_deep`, m, unless the Sun is `NO_SUN`.

    The most exceeded limit is replaced by a half-space, the force projected, and so on (Kelley, "The
    cutting-plane method for solving convex programs", J. SIAM 8, 1960). Forces are in N, Hill axes. `cuts`,
    (MOST_CUTS, 4), is working space, a row a half-space; if that many do not suffice, the last force is
    returned, which exceeds a limit.
    """
    force = clip_three(requested, world.guard.planned_force)
    for num_cuts in range(MOST_CUTS):
        ahead = next_state(world, k, free, force)
        limit, index, excess = most_exceeded(world, k, ahead, num_checks)
        if depth_in_cone(world, ahead[0], sun) - most_deep > excess:
            limit = SUN
        if limit == SAFE:
            break
        cut(world, k, free, ahead, limit, index, sun, most_deep, cuts[num_cuts])
        force = project(requested, cuts, num_cuts + 1, world.guard.planned_force)
    return force


@compiled(error_model="numpy")
def is_safe(world: World, k: int, free: Flying, force: Three, tolerance: float) -> bool:
    """Return whether a force keeps the limits that are never given up, except for rounding."""
    return most_exceeded(world, k, next_state(world, k, free, force), STANDING)[2] <= tolerance


@compiled(error_model="numpy")
def retreat(world: World, k: int, known: Flying, free: Flying, force: Three) -> Three:
    """Return an unsafe force as far moved towards the stop as necessary, by bisection.

    Outside the safe set, where the stop is not safe either, the force stays: it was found to exceed least.
    With a step back it is the stop with a push towards the room between the spheres.
    """
    guard = world.guard
    stop = clip_three(stopping_force(guard.stop, known[0], known[1]), world.max_force)
    if not is_safe(world, k, free, stop, 2.0 * TOLERANCE):
        if guard.step_back > 0.0:
            stopped_position = drifted_position(position_rows_of(guard.checks, 1), known[0], known[1])
            push_back = guard.step_back / max(length(stopped_position), TOLERANCE)
            if length(stopped_position) > 0.5 * (guard.keep_out + guard.keep_in):
                push_back = -push_back
            force = clip_three(stop + push_back * stopped_position, world.max_force)
        return force
    correction, low, high = force - stop, 0.0, 1.0
    for _ in range(HALVINGS):
        share = 0.5 * (low + high)
        if is_safe(world, k, free, stop + share * correction, TOLERANCE):
            low = share
        else:
            high = share
    return clip_three(stop + low * correction, world.max_force)


@compiled(error_model="numpy")
def corrected_force(
    world: World, k: int, known: Flying, requested: Three, suns: tuple[Three, Three], cuts: Floats
) -> tuple[Three, int]:
    """Return the force that replaces an unsafe one at sample k, and the limit that caused the change.

    Tried in this order: all limits; all but the Sun's cone; only those that are never given up; as far from
    the stop as is safe. The Sun is given as it is now, and at the next sample.
    """
    num_checks = len(world.guard.checks.transition)
    free = free_state(world, k, known)
    ahead = next_state(world, k, free, requested)
    limit = most_exceeded(world, k, ahead, STANDING)[0]
    if limit == SAFE:
        limit = most_exceeded(world, k, ahead, num_checks)[0]
    if (
        limit == SAFE
        and max(abs(requested.x), abs(requested.y), abs(requested.z)) > world.guard.planned_force
    ):
        limit = SPEED
    if keeps_from_sun(world):
        # from inside it leads out, by and by
        most_deep, sun = STAYING * max(0.0, depth_in_cone(world, known[0], suns[0])), suns[1]
        if limit == SAFE and depth_in_cone(world, ahead[0], sun) <= most_deep:
            return requested, SAFE
        force = nearest_safe_force(world, k, free, requested, num_checks, sun, most_deep, cuts)
        reached = next_state(world, k, free, force)
        excess = depth_in_cone(world, reached[0], sun) - most_deep
        excess = max(excess, most_exceeded(world, k, reached, num_checks)[2])
        if excess <= TOLERANCE:
            return force, SUN if limit == SAFE else limit
    force = nearest_safe_force(world, k, free, requested, num_checks, NO_SUN, 0.0, cuts)
    if not is_safe(world, k, free, force, TOLERANCE):
        force = nearest_safe_force(world, k, free, requested, STANDING, NO_SUN, 0.0, cuts)
        if not is_safe(world, k, free, force, TOLERANCE):
            force = retreat(world, k, known, free, force)
    return force, limit


@compiled(error_model="numpy")
def assure(now: Moment, cuts: Floats) -> None:
    """Correct the commands of all lanes that are not safe; the others stay bit-identical."""
    world, lanes, belief = now.world, now.state.lanes, now.state.belief
    store(lanes.limit, 0, splat(0.0, width_of(lanes)))
    store_three(lanes.change, 0, same(0.0, width_of(lanes)))
    is_unsafe = look_ahead(world, now.k, now.state)
    if not some(is_unsafe):
        return
    store(lanes.is_unsafe, 0, select(is_unsafe, 1.0, 0.0))  # to be read lane by lane
    for lane in range(now.num_lanes):
        if lanes.is_unsafe[lane] == 0.0:
            continue
        known = lane_of(belief.position, 0, lane), lane_of(belief.velocity, 0, lane)
        requested = lane_of(lanes.commanded, 0, lane)
        suns = NO_SUN, NO_SUN
        if keeps_from_sun(world):
            turned = lanes.sun[0, lane], lanes.sun[1, lane]
            height = lanes.sun_height[0, lane], lanes.sun_height[1, lane]
            suns = sun_at(turned, height), sun_at(turned_by_period(world, turned), height)
        force, limit = corrected_force(world, now.k, known, requested, suns, cuts)
        if limit == SAFE:
            continue  # it exceeds a limit by rounding alone, or no safe force leads out of the Sun's cone
        lanes.num_acted[lane] += 1.0
        lanes.limit[lane] = limit
        change = force - requested
        for axis in range(3):
            lanes.corrected[lane] += abs(change[axis]) * world.delta_v_per_force
        write_lane(lanes.change, 0, lane, change)
        write_lane(lanes.commanded, 0, lane, force)
