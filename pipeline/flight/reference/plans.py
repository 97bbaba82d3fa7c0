"""What a plan of pushes would come to by geometry (docs/explanation/foresight.md), as it is defined."""

import numpy as np
from numpy.typing import ArrayLike

from pipeline.array_types import Booleans, Floats
from pipeline.flight.reference.camera import least_cosine
from pipeline.flight.reference.flight import ReferenceFlight
from pipeline.flight.reference.motion import pushed

#: of a metre by which a point falls short of being seen, and of a metre outside the limits, m/s
PRICE_OF_HEIGHT, PRICE_OF_DISTANCE = 0.01, 0.05
#: what a metre costs more where a point is required, and of a way that is too long between two looks, m/s
PRICE_OF_REQUIRED, PRICE_OF_WAY = 0.03, 0.25
#: the shortfall of a point that is never lit in view of the camera, m
NEVER = 1000.0


def price(
    flight: ReferenceFlight,
    begin: int,
    state: Floats,
    is_left: Booleans,
    pushes: dict[int, ArrayLike],
    needed: tuple[int, int],
    margin: float,
    limits: tuple[float, float, float],
    step: int,
    sight: Floats,
) -> float:
    """Return the price of a plan, m/s.

    Parameters
    ----------
    flight : ReferenceFlight
    begin : int
        Sample at which the plan begins.
    state : (6,)
        Position, m, and velocity, m/s, Hill axes, as the deputy knows them there.
    is_left : (P,)
        Points that count.
    pushes : dict of int to (3,)
        Forces, N, Hill axes, held over a control period, by the sample at which they begin.
    needed : (int, int)
        Points to see, and how many of them are required.
    margin : float
        By how much more than it must a point is seen, m.
    limits : (float, float, float)
        Least and greatest distance, and greatest way along an axis between two looks, m.
    step : int
        Control periods between the samples at which the plan is looked at.
    sight : (K+1,)
        Distance from which the camera covers the chief at each sample, m.
    """
    mission, period, sensor = flight.mission, flight.mission.control_period_s, flight.mission.sensor
    best, outside, price_of_ways, before = np.full(len(is_left), -NEVER), 0.0, 0.0, state
    for k in range(begin, mission.num_controls + 1):
        if (k - begin) % step == 0:
            distance = float(np.linalg.norm(state[:3]))
            if k > begin:
                outside = max(outside, limits[0] - distance, distance - limits[1])
                too_long = float(np.abs(state[:3] - before[:3]).max()) - limits[2]
                price_of_ways = max(price_of_ways, PRICE_OF_WAY * too_long)
            before = state
            points, normals = flight.surface_at(k)
            apart = np.linalg.norm(state[:3] - points, axis=1)
            room = np.sum(normals * (state[:3] - points), axis=1) - least_cosine(sensor) * apart - margin
            if sensor.max_range_m is not None:
                room = np.minimum(room, sensor.max_range_m - margin - apart)
            room = np.minimum(room, distance - sight[k] - margin)
            best = np.where(flight.is_lit[k] & is_left, np.maximum(best, room), best)
        state = pushed(mission, state, np.asarray(pushes.get(k, np.zeros(3)), dtype=np.float64), period)
    short = np.cumsum(np.r_[0.0, np.sort(np.maximum(0.0, -best))])
    seen_worse = PRICE_OF_HEIGHT * short[needed[0]] + PRICE_OF_REQUIRED * short[needed[1]]
    spent = sum(float(np.abs(force).sum()) for force in pushes.values()) * period / mission.deputy.mass_kg
    return float(spent + seen_worse + max(PRICE_OF_DISTANCE * outside, price_of_ways))
