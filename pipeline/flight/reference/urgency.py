"""Where a deputy of the readable reference should look before it is too late."""

from math import exp

import numpy as np
from numpy.typing import NDArray

from fis_tools.engines.compiled import compiled
from pipeline.flight.guidance import MIN_PROJECTION_M
from pipeline.flight.reference.world import PlainWorld, turn_chief
from pipeline.physics.illumination import is_illuminated, sun_angle, sun_direction_h
from pipeline.physics.quaternion import dcm_b_from_h
from pipeline.physics.vectors import dot, norm

Floats = NDArray[np.float64]
Booleans = NDArray[np.bool_]


@compiled
def deadlines(world: PlainWorld, initial_sun_angle: float) -> Floats:
    """Return when each point is lit for the last time at a sample of the flight, s, shape (P,).

    Points that are never lit after the start have zero.

    Parameters
    ----------
    world : PlainWorld
    initial_sun_angle : float
        At k = 0, rad.
    """
    quaternion_c_from_h, chief_rate_c = np.array([0.0, 0.0, 0.0, 1.0]), world.chief_rate
    last_lit = np.zeros(len(world.points_c))
    for k in range(1, world.num_controls + 1):
        quaternion_c_from_h, chief_rate_c = turn_chief(world, quaternion_c_from_h, chief_rate_c)
        points_h = world.points_c @ dcm_b_from_h(quaternion_c_from_h)
        time = k * world.control_period
        sun_h = sun_direction_h(sun_angle(initial_sun_angle, world.mean_motion, time))
        for i in range(len(points_h)):
            if is_illuminated(points_h[i], sun_h):
                last_lit[i] = time
    return last_lit


@compiled
def urgent_direction(
    points_h: Floats, is_wanted: Booleans, last_lit: Floats, time: float, urgency_time: float
) -> Floats:
    """Return the unit vector towards the mean of wanted points, weighed by how soon each is dark.

    A point that is lit for the last time in T seconds weighs ``exp(-T/urgency_time)``. Zeros where no point
    is wanted, or where they cancel.

    Parameters
    ----------
    points_h : array, shape (P, 3)
        m, Hill axes.
    is_wanted : array of bool, shape (P,)
        Lit and not inspected.
    last_lit : array, shape (P,)
        Of `deadlines`, s.
    time, urgency_time : float
        s.

    Returns
    -------
    array, shape (3,)
        Hill axes.
    """
    total = 0.0
    mean = np.zeros(3)
    for i in range(len(points_h)):
        if is_wanted[i]:
            weight = exp(-(last_lit[i] - time) / urgency_time)
            total += weight
            mean += weight * points_h[i]
    length = norm(mean)
    return mean / length if length > MIN_PROJECTION_M * total else np.zeros(3)


@compiled
def around_the_chief(
    direction: Floats, position_h: Floats, skirt_distance: float, min_distance: float
) -> Floats:
    """Return a direction that does not lead into the chief from near it.

    Its part towards the chief is mirrored at the least distance, left out halfway to `skirt_distance`, kept
    beyond that, and linear between; other parts stay.

    Parameters
    ----------
    direction : array, shape (3,)
        Unit vector, Hill axes, or zeros.
    position_h : array, shape (3,)
        Of the deputy, m, Hill axes.
    skirt_distance, min_distance : float
        m; without effect where the first is not the greater.

    Returns
    -------
    array, shape (3,)
        Hill axes, at most 1 long.
    """
    distance = norm(position_h)
    if distance >= skirt_distance or skirt_distance <= min_distance:
        return direction
    outward = position_h / distance
    inward = max(0.0, -dot(direction, outward))
    nearness = min(1.0, (skirt_distance - distance) / (skirt_distance - min_distance))
    return direction + 2.0 * nearness * inward * outward
