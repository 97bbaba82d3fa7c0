"""Run-time assurance, written plainly: the twin that `pipeline.flight.kernel.safety` is tested against.

Here limits are rows of dense matrices, all looked at alike.
"""

from math import ceil
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fis_tools.engines.compiled import compiled
from pipeline.flight.log import KEEP_IN, KEEP_OUT, PASSIVE_SAFETY, SAFE, SPEED
from pipeline.physics.clohessy_wiltshire import input_matrix, state_transition
from pipeline.settings.experiment import Mission

Floats = NDArray[np.float64]

#: places that the limits are never given up for: at the next sample, and stopped from there
NUM_STANDING = 2
#: by how much corrections stay clear of a limit, of one on free drift, and what rounding may exceed, m
SLACK_M, DRIFT_SLACK_M, TOLERANCE_M = 1e-4, 0.1, 1e-6
#: most half-spaces, most sweeps of the projection, the change that ends them (N), halvings towards the stop
MOST_HALF_SPACES, MOST_SWEEPS, LEAST_CHANGE_N, HALVINGS = 12, 200, 1e-12, 30


class SafetyWorld(NamedTuple):
    """A mission's safety settings as numbers, SI."""

    is_on: bool
    keep_out: float
    keep_in: float
    #: (2 + J, 3, 6), from a state to positions: its own, where it is stopped, drifted for 1 ... J periods
    places: Floats
    #: (2 + J,) the spheres' radii where they count for a place, else 0 and infinity
    least: Floats
    greatest: Floats
    #: (3, 6), from a state to the force that stops it
    stop: Floats
    braking_force: float
    speed_limit: float
    speed_slope: float
    speed_distance: float
    #: what a period makes of a speed and of a force, m per m/s and m per N: they put limits on one scale
    metres_per_speed: float
    metres_per_force: float
    transition: Floats
    control: Floats
    max_force: float


def safety_world_of(mission: Mission) -> SafetyWorld:
    """Turn a mission's safety settings into numbers."""
    safety, period = mission.safety, mission.control_period_s
    n = mission.orbit.mean_motion_rad_s
    transition, control = state_transition(n, period), input_matrix(n, period, mission.deputy.mass_kg)
    stop = -np.linalg.inv(control[3:]) @ transition[3:]
    num_out = ceil(safety.passive_horizon_s / period - 1e-9)
    num_in = ceil(safety.keep_in_horizon_s / period - 1e-9)
    places = [np.eye(3, 6), (transition + control @ stop)[:3]]
    places += [state_transition(n, j * period)[:3] for j in range(1, max(num_out, num_in) + 1)]
    order = np.arange(len(places))
    return SafetyWorld(
        is_on=safety.kind == "filter",
        keep_out=mission.keep_out_m,
        keep_in=mission.keep_in_m,
        places=np.stack(places),
        least=np.where(order < NUM_STANDING + num_out, mission.keep_out_m, 0.0),
        greatest=np.where(order < NUM_STANDING + num_in, mission.keep_in_m, np.inf),
        stop=stop,
        braking_force=safety.braking_force_n,
        speed_limit=safety.speed_limit_m_s,
        speed_slope=safety.speed_slope_per_s,
        speed_distance=safety.speed_distance_m,
        metres_per_speed=period,
        metres_per_force=control[2, 2],
        transition=transition,
        control=control,
        max_force=mission.deputy.max_force_n,
    )


@compiled
def _length(vector: Floats) -> float:
    return float(np.sqrt(np.sum(vector * vector)))


@compiled
def excesses(world: SafetyWorld, state: Floats, num_places: int) -> Floats:
    """Return by how many metres a state exceeds each limit, negative where it keeps it.

    Of the first places twice, out of the inner and in the outer sphere, then speed, then three stops.
    """
    found = np.empty(2 * num_places + 4)
    for place in range(num_places):
        distance = _length(world.places[place] @ state)
        found[2 * place] = world.least[place] - distance
        found[2 * place + 1] = distance - world.greatest[place]
    fastest = world.speed_limit + world.speed_slope * (_length(state[:3]) - world.speed_distance)
    found[2 * num_places] = world.metres_per_speed * (_length(state[3:]) - fastest)
    found[2 * num_places + 1 :] = world.metres_per_force * (np.abs(world.stop @ state) - world.braking_force)
    return found


@compiled
def name_of(index: int, num_places: int) -> int:
    """Return which limit an entry of `excesses` is about."""
    if index >= 2 * num_places:
        return SPEED
    if index % 2 == 1:
        return KEEP_IN
    return KEEP_OUT if index < 2 * NUM_STANDING else PASSIVE_SAFETY


@compiled
def half_space(world: SafetyWorld, free: Floats, state: Floats, index: int, num_places: int) -> Floats:
    """Return ``[g, b]``, shape (4,): a limit by its entry in `excesses`, linear about a state, g . f >= b."""
    row, level = np.zeros(6), 0.0
    if index > 2 * num_places:
        stop = np.ascontiguousarray(world.stop[index - 2 * num_places - 1])
        row = -np.sign(np.sum(stop * state)) * stop
        level = -world.braking_force + SLACK_M / world.metres_per_force
    elif index == 2 * num_places:
        row[:3] = world.speed_slope * state[:3] / _length(state[:3])
        row[3:] = -state[3:] / _length(state[3:])
        level = world.speed_slope * world.speed_distance - world.speed_limit
        level += SLACK_M / world.metres_per_speed
    else:
        position = world.places[index // 2] @ state
        direction = position / max(_length(position), TOLERANCE_M)
        if index % 2 == 0:
            row, level = world.places[index // 2].T @ direction, world.keep_out
        else:
            row, level = -(world.places[index // 2].T @ direction), -world.keep_in
        level += SLACK_M if index // 2 < NUM_STANDING else DRIFT_SLACK_M
    found = np.empty(4)
    found[:3] = world.control.T @ row
    found[3] = level - np.sum(row * free)
    return found


@compiled
def nearest_force(asked: Floats, half_spaces: Floats, max_force: float) -> Floats:
    """Return the force of the box nearest to one asked for, in half-spaces, shape (n, 4); by Dykstra.

    Each set in turn is projected onto from where the last time's correction is taken back.
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
    """Return the force nearest to one asked for that keeps the limits of the first places, if it is found."""
    half_spaces = np.empty((MOST_HALF_SPACES, 4))
    force = asked
    for used in range(MOST_HALF_SPACES):
        state = free + world.control @ force
        excess = excesses(world, state, num_places)
        worst = int(np.argmax(excess))
        if excess[worst] <= 0.0:
            break
        half_spaces[used] = half_space(world, free, state, worst, num_places)
        force = nearest_force(asked, half_spaces[: used + 1], world.max_force)
    return force


@compiled
def exceeded_limit(world: SafetyWorld, state: Floats) -> int:
    """Return which limit a state exceeds most, first of those that are never given up."""
    for num_places in (NUM_STANDING, len(world.places)):
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
        Within the thrust limit.
    """
    free = world.transition @ state
    limit = exceeded_limit(world, free + world.control @ asked)
    if limit == SAFE:
        return asked, limit
    force = asked
    for num_places in (len(world.places), NUM_STANDING):
        force = corrected(world, free, asked, num_places)
        if excesses(world, free + world.control @ force, NUM_STANDING).max() <= TOLERANCE_M:
            return force, limit
    stop = np.minimum(np.maximum(world.stop @ state, -world.max_force), world.max_force)
    if excesses(world, free + world.control @ stop, NUM_STANDING).max() > 2.0 * TOLERANCE_M:
        return force, limit
    low, high = 0.0, 1.0
    for _ in range(HALVINGS):
        share = 0.5 * (low + high)
        trial = stop + share * (force - stop)
        if excesses(world, free + world.control @ trial, NUM_STANDING).max() <= TOLERANCE_M:
            low = share
        else:
            high = share
    return stop + low * (force - stop), limit
