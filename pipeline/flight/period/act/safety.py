"""Run-time assurance, compiled: the smallest change of force that keeps the deputies safe.

A force f held over the control period T leads to the next state ``s = Phi s(k) + Gamma f``. It is safe when

- *keep-out, keep-in*: the deputy is between the two spheres at s, and also where it comes to rest when it is
    stopped from s within one period: ``f_stop = K s``, ``K = -Gamma_v^-1 Phi_v``, leads to ``r_stop = P s``,
  ``P = Phi_r + Gamma_r K``, with no speed;
- *braking*: no axis of f_stop needs more than the force that is reserved for it;
- *speed*: ``|v| <= v0 + v1 (|r| - d0)``.

A deputy at rest can hold its place with a constant force: ``f_stop`` of ``(r_stop, 0)`` leads to itself. So
from a safe state the stop is a safe force, and the next state is safe again: samples never leave the
spheres, whatever force is commanded. The safe set is that of the explicit backup "stop" (Gurriet, Mote,
Singletary, Nilsson, Feron and Ames, "A scalable safety critical control framework for nonlinear systems",
IEEE Access 8, 2020), and the filter a control barrier function's in discrete time (Agrawal and Sreenath,
"Discrete control barrier functions for safety-critical control of discrete systems", RSS 2017; Ames, Coogan,
Egerstedt, Notomista, Sreenath and Tabuada, "Control barrier functions: theory and applications", ECC 2019).
The limits are those of Dunlap, van Wijk and Hobbs, "Run time assurance for autonomous spacecraft inspection"
(2023).

Two more limits act early, while a small force is enough. They yield to those above:

- *passive safety*: free drift from s stays outside the keep-out sphere at all samples of a horizon
  (Breger and How, "Safe trajectories for autonomous rendezvous of spacecraft", J. Guidance 31, 2008);
- free drift from s stays inside the keep-in sphere at all samples of another.
"""

from math import ceil
from typing import TYPE_CHECKING

import numpy as np

from fis_tools.compiled.decorator import compiled
from fis_tools.compiled.three import Three, dot, length, load_three, same, scaled, store_three, three_of
from fis_tools.compiled.vectors import least, most, select, some, splat, store, width_of
from pipeline.array_types import Floats
from pipeline.flight.period.act.bounds import bounds_of, spheres_of
from pipeline.flight.state.arrays import Guard, Moment, State, World
from pipeline.flight.state.log import KEEP_IN, KEEP_OUT, PASSIVE_SAFETY, SAFE, SPEED
from pipeline.physics.motion import (
    Motion,
    drift,
    drifted_place,
    joined,
    motion_over,
    place_after,
    place_of,
    push,
    slopes,
    step_of,
    stop_of,
    stopped,
    stopping_force,
    stopping_forces,
    velocity_after,
)
from pipeline.physics.quaternion import assign

if TYPE_CHECKING:  # as in `pipeline.flight.period.look.guidance`
    from pipeline.settings.experiment import Mission


#: rows of `Guard.places` whose limits are never given up: at the next sample, and stopped from there
STANDING = 2
#: margin of corrections to a limit, m, and to one that acts early, so that the next sample needs none
SLACK, EARLY_SLACK = 1e-4, 0.1
#: tolerance for rounding, m
TOLERANCE = 1e-6
#: largest number of half-spaces that replace the exceeded limits
MOST_CUTS = 12
#: most sweeps of the projection onto them, and the change of force that ends them, N
MOST_SWEEPS, LEAST_CHANGE = 200, 1e-12
#: bisection steps between the stop and an unsafe force
HALVINGS = 30


@compiled(error_model="numpy")
def look_ahead(world: World, state: State) -> bool:
    """Mark the lanes whose forces may lead to an unsafe state; return whether there are any."""
    guard, lanes, belief, step = world.guard, state.lanes, state.belief, step_of(world.motion, 0)
    width = width_of(lanes)
    place, velocity = load_three(belief.position, 0), load_three(belief.velocity, 0)
    force = load_three(lanes.commanded, 0)
    then, moving = place_after(step, place, velocity, force), velocity_after(step, place, velocity, force)
    stop = stopping_forces(guard.stop, then, moving)
    braking = most(most(abs(stop.x), abs(stop.z)), abs(stop.y))
    closest, reach = splat(np.inf, width), splat(0.0, width)
    for row in range(len(guard.places.transition)):
        passed = drifted_place(place_of(guard.places, row), then, moving)
        square = dot(passed, passed)
        if row < guard.num_kept_out:
            closest = least(square, closest)
        if row < guard.num_kept_in:
            reach = most(square, reach)
    is_unsafe = length(moving) - guard.speed_at_chief - guard.speed_slope * length(then) > 0.0
    is_unsafe |= braking > guard.braking_force
    is_unsafe |= most(most(abs(force.x), abs(force.z)), abs(force.y)) > guard.planned_force
    is_unsafe |= (closest < guard.keep_out**2) | (reach > guard.keep_in**2)
    store(lanes.is_unsafe, 0, select(is_unsafe, 1.0, 0.0))
    return some(is_unsafe)


@compiled(error_model="numpy")
def position(places: Motion, row: int, state: Floats) -> Three:
    """Return the position that a state, shape (6,), leads to by a row of places."""
    return drifted_place(place_of(places, row), three_of(state[:3]), three_of(state[3:]))


@compiled(error_model="numpy")
def lead(world: World, free: Floats, force: Floats, ahead: Floats) -> None:
    """Write the next state under a force, from the next state without it."""
    push(world.motion, free, force, ahead)


@compiled(error_model="numpy")
def most_exceeded(world: World, ahead: Floats, num_places: int) -> tuple[int, int, float]:
    """Return the most exceeded limit of a next state among the first places, where, and by how many metres.

    Speeds count by the distance covered in a period, braking forces by the displacement in one.
    """
    guard = world.guard
    limit, place, excess = SAFE, 0, 0.0
    for row in range(num_places):
        distance = length(position(guard.places, row, ahead))
        if row < guard.num_kept_out and guard.keep_out - distance > excess:
            limit, place, excess = PASSIVE_SAFETY, row, guard.keep_out - distance
            limit = KEEP_OUT if row < STANDING else limit
        if row < guard.num_kept_in and distance - guard.keep_in > excess:
            limit, place, excess = KEEP_IN, row, distance - guard.keep_in
    fastest = guard.speed_at_chief + guard.speed_slope * length(three_of(ahead[:3]))
    over = world.control_period * (length(three_of(ahead[3:])) - fastest)
    if over > excess:
        limit, place, excess = SPEED, 0, over
    for axis in range(3):
        force = stopping_force(guard.stop, axis, ahead)
        over = world.motion.control[0, 2, 2] * (abs(force) - guard.braking_force)
        if over > excess:
            limit, place, excess = SPEED, 1 + axis, over
    return limit, place, excess


@compiled(error_model="numpy")
def cut(world: World, free: Floats, ahead: Floats, limit: int, place: int, half_space: Floats) -> None:
    """Write the half-space ``g . f >= b`` that is tangent to a limit in the direction of a next state.

    Outside a sphere, the half-space lies in the safe set; inside one, it contains the safe set.
    """
    guard = world.guard
    l = np.zeros(6)  # noqa: E741 - the limit, linear: l . s >= level
    nothing = np.zeros(6)  # leads to the constant part of a limit
    if limit == SPEED and place > 0:
        sign = -1.0 if stopping_force(guard.stop, place - 1, ahead) > 0.0 else 1.0
        for i in range(6):
            l[i] = sign * guard.stop[place - 1, i]
        level = SLACK / world.motion.control[0, 2, 2] - guard.braking_force
        level -= sign * stopping_force(guard.stop, place - 1, nothing)
    elif limit == SPEED:
        speed = length(three_of(ahead[3:]))
        distance = length(three_of(ahead[:3]))
        for i in range(3):
            l[i] = guard.speed_slope * ahead[i] / distance
            l[3 + i] = -ahead[3 + i] / speed
        level = SLACK / world.control_period - guard.speed_at_chief
    else:
        outward = position(guard.places, place, ahead)
        scale = (-1.0 if limit == KEEP_IN else 1.0) / max(length(outward), TOLERANCE)
        outward = scaled(scale, outward)
        of_position, of_velocity = slopes(place_of(guard.places, place), outward)
        l[0], l[1], l[2] = of_position
        l[3], l[4], l[5] = of_velocity
        level = SLACK if place < STANDING else EARLY_SLACK
        level += -guard.keep_in if limit == KEEP_IN else guard.keep_out
        level -= dot(position(guard.places, place, nothing), outward)
    half_space[3] = level
    for i in range(6):
        half_space[3] -= l[i] * free[i]
    for j in range(3):
        half_space[j] = 0.0
        for i in range(6):
            half_space[j] += world.motion.control[0, i, j] * l[i]


@compiled(error_model="numpy")
def project(asked: Floats, cuts: Floats, num_cuts: int, max_force: float, force: Floats) -> None:
    """Project a force onto half-spaces ``g . f >= b`` and the box of the thruster.

    Dykstra's alternating projections, which for half-spaces are Hildreth's method for quadratic programmes
    (Boyle and Dykstra, "A method for finding projections onto the intersection of convex sets in Hilbert
    spaces", 1986; Hildreth, "A quadratic programming procedure", Naval Research Logistics Quarterly 4, 1957).
    If the sets do not intersect, the result is in the box.
    """
    multipliers = np.zeros(num_cuts)
    beyond = np.zeros(3)
    before = np.zeros(3)
    assign(force, asked)
    for _ in range(MOST_SWEEPS):
        assign(before, force)
        for c in range(num_cuts):
            gx, gy, gz = cuts[c, 0], cuts[c, 1], cuts[c, 2]
            square = max(gx * gx + gy * gy + gz * gz, 1e-30)
            short = (cuts[c, 3] - (gx * force[0] + gy * force[1] + gz * force[2])) / square
            step = max(short, -multipliers[c])
            multipliers[c] += step
            force[0] += step * gx
            force[1] += step * gy
            force[2] += step * gz
        for j in range(3):
            wished = force[j] + beyond[j]
            force[j] = min(max(wished, -max_force), max_force)
            beyond[j] = wished - force[j]
        change = 0.0
        for j in range(3):
            change = max(change, abs(force[j] - before[j]))
        if change < LEAST_CHANGE:
            break


@compiled(error_model="numpy")
def search(world: World, free: Floats, asked: Floats, num_places: int, cuts: Floats, force: Floats) -> None:
    """Write the force nearest to the commanded one that keeps the limits of the first places, if found.

    The most exceeded limit is replaced by a half-space, the force projected, and so on (Kelley, "The
    cutting-plane method for solving convex programs", J. SIAM 8, 1960).
    """
    ahead = np.zeros(6)
    for j in range(3):
        force[j] = min(max(asked[j], -world.guard.planned_force), world.guard.planned_force)
    for num_cuts in range(MOST_CUTS):
        lead(world, free, force, ahead)
        limit, place, _ = most_exceeded(world, ahead, num_places)
        if limit == SAFE:
            break
        cut(world, free, ahead, limit, place, cuts[num_cuts])
        project(asked, cuts, num_cuts + 1, world.guard.planned_force, force)


@compiled(error_model="numpy")
def is_safe(world: World, free: Floats, force: Floats, tolerance: float) -> bool:
    """Return whether a force keeps the limits that are never given up, except for rounding."""
    ahead = np.zeros(6)
    lead(world, free, force, ahead)
    return most_exceeded(world, ahead, STANDING)[2] <= tolerance


@compiled(error_model="numpy")
def store_clipped(force: Floats, first: Floats, second: Three, most_force: float) -> None:
    """Write the sum of two forces, within the thruster's box."""
    force[0] = min(max(first[0] + second.x, -most_force), most_force)
    force[1] = min(max(first[1] + second.y, -most_force), most_force)
    force[2] = min(max(first[2] + second.z, -most_force), most_force)


@compiled(error_model="numpy")
def retreat(world: World, state: Floats, free: Floats, force: Floats) -> None:
    """Move an unsafe force as far towards the stop as necessary, by bisection.

    Outside the safe set, where the stop is not safe either, the force stays: it was found to exceed least.
    With a step back it is the stop with a push towards the room between the spheres.
    """
    guard, stop, trial = world.guard, np.zeros(3), np.zeros(3)
    for j in range(3):
        force_j = stopping_force(guard.stop, j, state)
        stop[j] = min(max(force_j, -world.max_force), world.max_force)
    if not is_safe(world, free, stop, 2.0 * TOLERANCE):
        if guard.step_back > 0.0:
            rest = position(guard.places, 1, state)
            push_back = guard.step_back / max(length(rest), TOLERANCE)
            if length(rest) > 0.5 * (guard.keep_out + guard.keep_in):
                push_back = -push_back
            store_clipped(force, stop, scaled(push_back, rest), world.max_force)
        return
    low, high = 0.0, 1.0
    for _ in range(HALVINGS):
        share = 0.5 * (low + high)
        for j in range(3):
            trial[j] = stop[j] + share * (force[j] - stop[j])
        if is_safe(world, free, trial, TOLERANCE):
            low = share
        else:
            high = share
    for j in range(3):
        force[j] = stop[j] + low * (force[j] - stop[j])


@compiled(error_model="numpy")
def correct(world: World, state: Floats, asked: Floats, cuts: Floats, force: Floats) -> int:
    """Write the force that replaces an unsafe one; return the limit that caused the change.

    Tried in this order: all limits; only those that are never given up; as far from the stop as is safe.
    """
    free, ahead = np.zeros(6), np.zeros(6)
    drift(world.motion, state, free)
    lead(world, free, asked, ahead)
    limit = most_exceeded(world, ahead, STANDING)[0]
    if limit == SAFE:
        limit = most_exceeded(world, ahead, len(world.guard.places.transition))[0]
    if limit == SAFE and max(abs(asked[0]), abs(asked[1]), abs(asked[2])) > world.guard.planned_force:
        limit = SPEED
    search(world, free, asked, len(world.guard.places.transition), cuts, force)
    if is_safe(world, free, force, TOLERANCE):
        return limit
    search(world, free, asked, STANDING, cuts, force)
    if is_safe(world, free, force, TOLERANCE):
        return limit
    retreat(world, state, free, force)
    return limit


@compiled(error_model="numpy")
def assure(now: Moment) -> None:
    """Correct the commands of all lanes that are not safe; the others stay bit-identical."""
    world, lanes, belief = now.world, now.state.lanes, now.state.belief
    store(lanes.limit, 0, splat(0.0, width_of(lanes)))
    store_three(lanes.change, 0, same(0.0, width_of(lanes)))
    if not look_ahead(world, now.state):
        return
    known, asked, force = np.empty(6), np.empty(3), np.empty(3)
    per_force = world.control_period * world.acceleration_per_force
    for lane in range(now.num_lanes):
        if lanes.is_unsafe[lane] == 0.0:
            continue
        for j in range(3):
            known[j], known[3 + j] = belief.position[j, lane], belief.velocity[j, lane]
            asked[j] = lanes.commanded[j, lane]
        limit = correct(world, known, asked, now.work.cuts, force)
        if limit == SAFE:
            continue  # by rounding
        lanes.num_acted[lane] += 1.0
        lanes.limit[lane] = limit
        for j in range(3):
            lanes.change[j, lane] = force[j] - asked[j]
            lanes.corrected[lane] += abs(force[j] - asked[j]) * per_force
            lanes.commanded[j, lane] = force[j]


def guard_of(mission: "Mission") -> Guard:
    """Turn the safety settings of a mission into the numbers that `assure` reads."""
    safety = mission.safety
    period = mission.control_period_s
    motion = motion_over(mission.orbit, mission.deputy, (period,))
    stop = stop_of(motion)
    if safety.kind == "none":
        return Guard(False, 0.0, np.inf, np.inf, 0.0, np.inf, np.inf, 0.0, stop, motion, 0, 0)
    bounds = bounds_of(mission)
    keep_out, keep_in = spheres_of(mission, bounds)
    num_drifts = [ceil(time / period - 1e-9) for time in (safety.passive_horizon_s, safety.keep_in_horizon_s)]
    now = motion_over(mission.orbit, mission.deputy, (0.0,))
    drifts = [(j + 1) * period for j in range(max(num_drifts))]
    return Guard(
        is_on=True,
        keep_out=keep_out,
        keep_in=keep_in,
        speed_at_chief=safety.speed_limit_m_s - safety.speed_slope_per_s * safety.speed_distance_m,
        speed_slope=safety.speed_slope_per_s,
        braking_force=safety.braking_force_n,
        planned_force=min(bounds.planned_force_n, mission.deputy.max_force_n),
        step_back=bounds.step_back_n,
        stop=stop,
        places=joined(now, stopped(motion, stop), motion_over(mission.orbit, mission.deputy, drifts)),
        num_kept_out=STANDING + num_drifts[0],
        num_kept_in=STANDING + num_drifts[1],
    )
