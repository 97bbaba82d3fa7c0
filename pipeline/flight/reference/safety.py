"""Run-time assurance, written plainly: the twin that `pipeline.flight.period.act.safety` is tested against.

Here all limits are treated alike, by how many metres a state exceeds them.
"""

from math import ceil
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fis_tools.compiled.decorator import compiled
from pipeline.flight.state.log import KEEP_IN, KEEP_OUT, PASSIVE_SAFETY, SAFE, SPEED
from pipeline.physics.motion import (
    Motion,
    Stop,
    drifted_place,
    joined,
    motion_over,
    place_of,
    propagate,
    push,
    slopes,
    stop_of,
    stopped,
    stopping_force,
)
from pipeline.physics.vectors import dot, norm
from pipeline.settings.experiment import Mission

Floats = NDArray[np.float64]

#: places where the limits are never given up: at the next sample, and stopped from there
NUM_STANDING = 2
#: margin of corrections to a limit, to one on free drift, and tolerance for rounding, m
SLACK_M, DRIFT_SLACK_M, TOLERANCE_M = 1e-4, 0.1, 1e-6
#: most half-spaces, most sweeps of the projection, the change that ends them (N), bisections towards the stop
MOST_HALF_SPACES, MOST_SWEEPS, LEAST_CHANGE_N, HALVINGS = 12, 200, 1e-12, 30


class SafetyWorld(NamedTuple):
    """A mission's safety settings as numbers, SI."""

    is_on: bool
    keep_out: float
    keep_in: float
    #: over 2 + J durations: zero, a period used to stop, free drift for 1 ... J periods
    places: Motion
    #: (2 + J,) the spheres' radii where they apply to a place, else 0 and infinity
    least: Floats
    greatest: Floats
    stop: Stop
    braking_force: float
    speed_limit: float
    speed_slope: float
    speed_distance: float
    #: effect of a speed and of a force over a period, m per m/s and m per N: they put limits on one scale
    metres_per_speed: float
    metres_per_force: float
    #: over a control period
    motion: Motion
    max_force: float


def safety_world_of(mission: Mission) -> SafetyWorld:
    """Return a mission's safety settings as numbers."""
    safety, period = mission.safety, mission.control_period_s
    motion = motion_over(mission.orbit, mission.deputy, (period,))
    stop = stop_of(motion)
    num_out = ceil(safety.passive_horizon_s / period - 1e-9)
    num_in = ceil(safety.keep_in_horizon_s / period - 1e-9)
    drifts = [j * period for j in range(1, max(num_out, num_in) + 1)]
    places = joined(
        motion_over(mission.orbit, mission.deputy, (0.0,)),
        stopped(motion, stop),
        motion_over(mission.orbit, mission.deputy, drifts),
    )
    order = np.arange(NUM_STANDING + len(drifts))
    return SafetyWorld(
        is_on=safety.kind == "filter",
        keep_out=mission.keep_out_m,
        keep_in=mission.keep_in_m,
        places=places,
        least=np.where(order < NUM_STANDING + num_out, mission.keep_out_m, 0.0),
        greatest=np.where(order < NUM_STANDING + num_in, mission.keep_in_m, np.inf),
        stop=stop,
        braking_force=safety.braking_force_n,
        speed_limit=safety.speed_limit_m_s,
        speed_slope=safety.speed_slope_per_s,
        speed_distance=safety.speed_distance_m,
        metres_per_speed=period,
        metres_per_force=motion.control[0, 2, 2],
        motion=motion,
        max_force=mission.deputy.max_force_n,
    )


@compiled
def position(world: SafetyWorld, place: int, state: Floats) -> Floats:
    """Return the position that a state leads to, m, Hill axes, shape (3,)."""
    x, y, z, u, v, w = state[0], state[1], state[2], state[3], state[4], state[5]
    return np.array(drifted_place(place_of(world.places, place), x, y, z, u, v, w))


@compiled
def stop_force(world: SafetyWorld, state: Floats) -> Floats:
    """Return the force that stops a state, N, Hill axes, shape (3,)."""
    return np.array([stopping_force(world.stop, axis, state) for axis in range(3)])


@compiled
def pushed(world: SafetyWorld, free: Floats, force: Floats) -> Floats:
    """Return the state after a held force, from the state that free motion leads to, shape (6,)."""
    after = np.empty(6)
    push(world.motion, free, force, after)
    return after


@compiled
def excesses(world: SafetyWorld, state: Floats, num_places: int) -> Floats:
    """Return by how many metres a state exceeds each limit, negative where it keeps it.

    For the first places twice, keep-out and keep-in, then speed, then three for braking.
    """
    found = np.empty(2 * num_places + 4)
    for place in range(num_places):
        distance = norm(position(world, place, state))
        found[2 * place] = world.least[place] - distance
        found[2 * place + 1] = distance - world.greatest[place]
    fastest = world.speed_limit + world.speed_slope * (norm(state[:3]) - world.speed_distance)
    found[2 * num_places] = world.metres_per_speed * (norm(state[3:]) - fastest)
    found[2 * num_places + 1 :] = world.metres_per_force * (
        np.abs(stop_force(world, state)) - world.braking_force
    )
    return found


@compiled
def name_of(index: int, num_places: int) -> int:
    """Return the limit that an entry of `excesses` belongs to."""
    if index >= 2 * num_places:
        return SPEED
    if index % 2 == 1:
        return KEEP_IN
    return KEEP_OUT if index < 2 * NUM_STANDING else PASSIVE_SAFETY


@compiled
def half_space(world: SafetyWorld, free: Floats, state: Floats, index: int, num_places: int) -> Floats:
    """Return ``[g, b]``, shape (4,): a limit by its entry in `excesses`, linear about a state, g . f >= b."""
    row, level, nothing = np.zeros(6), 0.0, np.zeros(6)
    if index > 2 * num_places:
        axis = index - 2 * num_places - 1
        sign = -np.sign(stopping_force(world.stop, axis, state))
        row = sign * world.stop.gain[axis]
        level = -world.braking_force + SLACK_M / world.metres_per_force
        level -= sign * stopping_force(world.stop, axis, nothing)
    elif index == 2 * num_places:
        row[:3] = world.speed_slope * state[:3] / norm(state[:3])
        row[3:] = -state[3:] / norm(state[3:])
        level = world.speed_slope * world.speed_distance - world.speed_limit
        level += SLACK_M / world.metres_per_speed
    else:
        place = index // 2
        towards = position(world, place, state)
        towards = towards / max(norm(towards), TOLERANCE_M)
        level = world.keep_out
        if index % 2 == 1:
            towards, level = -towards, -world.keep_in
        row[:] = np.array(slopes(place_of(world.places, place), towards[0], towards[1], towards[2]))
        level += SLACK_M if place < NUM_STANDING else DRIFT_SLACK_M
        level -= dot(towards, position(world, place, nothing))
    found = np.empty(4)
    found[:3] = world.motion.control[0].T @ row
    found[3] = level - np.sum(row * free)
    return found


@compiled
def nearest_force(asked: Floats, half_spaces: Floats, max_force: float) -> Floats:
    """Return the force in the box and half-spaces, shape (n, 4), nearest to the commanded one, by Dykstra.

    Each set is projected onto in turn, after undoing its previous correction.
    """
    force = asked.copy()
    corrections = np.zeros((len(half_spaces) + 1, 3))
    for _ in range(MOST_SWEEPS):
        before = force
        for i in range(len(half_spaces)):
            wished = force + corrections[i]
            g, b = half_spaces[i, :3], half_spaces[i, 3]
            square = np.sum(g * g)
            short = max(0.0, b - np.sum(g * wished))
            force = wished + short / max(square, 1e-30) * g
            corrections[i] = wished - force
        wished = force + corrections[-1]
        force = np.minimum(np.maximum(wished, -max_force), max_force)
        corrections[-1] = wished - force
        if np.abs(force - before).max() < LEAST_CHANGE_N:
            break
    return force


@compiled
def corrected(world: SafetyWorld, free: Floats, asked: Floats, num_places: int) -> Floats:
    """Return the force nearest to the commanded one that keeps the limits of the first places, if found."""
    half_spaces = np.empty((MOST_HALF_SPACES, 4))
    force = asked
    for used in range(MOST_HALF_SPACES):
        state = pushed(world, free, force)
        excess = excesses(world, state, num_places)
        worst = int(np.argmax(excess))
        if excess[worst] <= 0.0:
            break
        half_spaces[used] = half_space(world, free, state, worst, num_places)
        force = nearest_force(asked, half_spaces[: used + 1], world.max_force)
    return force


@compiled
def exceeded_limit(world: SafetyWorld, state: Floats) -> int:
    """Return the most exceeded limit of a state, starting with those that are never given up."""
    for num_places in (NUM_STANDING, len(world.least)):
        excess = excesses(world, state, num_places)
        worst = int(np.argmax(excess))
        if excess[worst] > 0.0:
            return name_of(worst, num_places)
    return SAFE


@compiled
def assured(world: SafetyWorld, state: Floats, asked: Floats) -> tuple[Floats, int]:
    """Return the force that is applied, N, Hill axes, shape (3,), and the limit it was changed for.

    Parameters
    ----------
    world : SafetyWorld
    state : array, shape (6,)
        At the sample, m and m/s, Hill axes.
    asked : array, shape (3,)
        Commanded, within the thrust limit.
    """
    free = propagate(world.motion, state, np.zeros(3))
    limit = exceeded_limit(world, pushed(world, free, asked))
    if limit == SAFE:
        return asked, limit
    force = asked
    for num_places in (len(world.least), NUM_STANDING):
        force = corrected(world, free, asked, num_places)
        if excesses(world, pushed(world, free, force), NUM_STANDING).max() <= TOLERANCE_M:
            return force, limit
    stop = np.minimum(np.maximum(stop_force(world, state), -world.max_force), world.max_force)
    if excesses(world, pushed(world, free, stop), NUM_STANDING).max() > 2.0 * TOLERANCE_M:
        return force, limit
    low, high = 0.0, 1.0
    for _ in range(HALVINGS):
        share = 0.5 * (low + high)
        trial = stop + share * (force - stop)
        if excesses(world, pushed(world, free, trial), NUM_STANDING).max() <= TOLERANCE_M:
            low = share
        else:
            high = share
    return stop + low * (force - stop), limit
