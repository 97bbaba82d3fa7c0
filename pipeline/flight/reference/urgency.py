"""Urgency in the readable reference: the direction to points that will soon go dark."""

from math import exp

import numpy as np
from numpy.typing import NDArray

from fis_tools.compiled.decorator import compiled
from pipeline.flight.period.look.guidance import MIN_PROJECTION_M
from pipeline.physics.vectors import dot, norm

Floats = NDArray[np.float64]
Booleans = NDArray[np.bool_]


@compiled
def urgent_direction(
    points_h: Floats, is_wanted: Booleans, last_lit: Floats, time: float, urgency_time: float
) -> Floats:
    """Return the unit vector towards the mean of wanted points, weighted by how soon each goes dark.

    A point that is lit for the last time in T seconds weighs ``exp(-T/urgency_time)``. Zeros if no point
    is wanted, or if they cancel.

    Parameters
    ----------
    points_h : array, shape (P, 3)
        m, Hill axes.
    is_wanted : array of bool, shape (P,)
        Lit and not inspected.
    last_lit : array, shape (P,)
        Of `pipeline.flight.reference.sight.times_lit`, s.
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
    """Return a direction modified so that it does not lead into the chief from near it.

    Its part towards the chief is mirrored at the least distance, removed halfway to `skirt_distance`, kept
    beyond that, and linear between; other parts stay.

    Parameters
    ----------
    direction : array, shape (3,)
        Unit vector, Hill axes, or zeros.
    position_h : array, shape (3,)
        Of the deputy, m, Hill axes.
    skirt_distance, min_distance : float
        m; no effect unless the first is greater.

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
