"""The push that would still show what sets for good (docs/reference/signals.md)."""

import numpy as np

from pipeline.array_types import Booleans, Floats
from pipeline.flight.reference.camera import aimed, least_cosine, seen_points
from pipeline.flight.reference.flight import ReferenceFlight
from pipeline.flight.reference.light import SunAngles
from pipeline.flight.reference.urgency import turned_aside, urgency

#: seconds between looks; see_near_m and see_short_m where a controller does not set them
LOOK_PERIOD_S, NEAR_M, LEAST_SHORT_M = 60.0, 30.0, 1.0
#: the square of a thousand seconds
KS2 = 1e6


def see_push(flight: ReferenceFlight, k: int, state: Floats, is_inspected: Booleans) -> Floats:
    """Return the push, m/s, that would show most of what is soon dark and coasting would miss.

    ``(rho I + sum w g g') dv = sum w s g``, turned aside near the chief.
    """
    constants = flight.constants
    shortfalls, slopes = sought_looks(flight, k, state, is_inspected)
    weights = urgency(flight, k) * (shortfalls > 0.0)
    matrix = constants["see_damping_ks2"] * KS2 * np.eye(3) + (weights * slopes.T) @ slopes
    push = np.linalg.solve(matrix, slopes.T @ (weights * shortfalls))
    return turned_aside(flight, np.asarray(push, dtype=np.float64), state[:3])


def sought_looks(
    flight: ReferenceFlight, k: int, state: Floats, is_inspected: Booleans
) -> tuple[Floats, Floats]:
    """Return the cheapest looks at unseen points whose last light is at most see_horizon_s away."""
    now, horizon = flight.time(k), flight.constants["see_horizon_s"]
    is_sought = flight.is_counted & ~is_inspected
    is_sought &= (flight.last_lit > now) & (flight.last_lit <= now + horizon)
    return cheapest_looks(flight, k, state, is_sought, horizon)


def cheapest_looks(
    flight: ReferenceFlight, k: int, state: Floats, is_sought: Booleans, horizon: float
) -> tuple[Floats, Floats]:
    """Return the shortfall s, m, and slopes g of the look at each point with the least s^2/|g|^2.

    Shapes are (P,) and (P, 3); zeros where no look is needed or possible within a horizon, s.
    """
    mission, period = flight.mission, flight.mission.control_period_s
    stride = max(1, round(LOOK_PERIOD_S / period))
    looks = int(horizon / (period * stride) + 1e-9)
    is_shown, cheapest = ~is_sought, np.full(len(is_sought), np.inf)
    shortfalls, slopes = np.zeros(len(is_sought)), np.zeros((len(is_sought), 3))
    for sample in range(k + stride, min(mission.num_controls, k + looks * stride) + 1, stride):
        phi, sun = flight.transition(k, sample), flight.sun_at(k, sample)
        position = (phi @ state)[:3]
        is_lit = flight.lit_at(sample, sun)
        short, towards, shows = shortfall(flight, sample, position, sun)
        is_shown |= is_lit & shows
        slope = towards @ phi[:3, 3:]
        cost = short**2 / np.sum(slope**2, axis=1)
        is_better = is_lit & ~is_shown & (cost < cheapest)
        cheapest[is_better], shortfalls[is_better] = cost[is_better], short[is_better]
        slopes[is_better] = slope[is_better]
    return np.where(is_shown, 0.0, shortfalls), np.where(is_shown[:, np.newaxis], 0.0, slopes)


def shortfall(
    flight: ReferenceFlight, sample: int, position: Floats, sun: SunAngles
) -> tuple[Floats, Floats, Booleans]:
    """Return by how much looks from a position fall short, m, the directions that help, and which succeed.

    In the paper's world it is height above the horizon. In others it is the larger of the height that the
    incidence limit needs and the excess of range; what shows a point is the camera itself.
    """
    points, normals = flight.surface_at(sample)
    least = flight.constants.get("see_short_m", LEAST_SHORT_M)
    if flight.is_papers and flight.orbit is None:
        short = flight.mission.chief.inspection_radius_m - normals @ position
        if np.linalg.norm(position) < flight.constants.get("see_near_m", NEAR_M):
            short = np.maximum(short, least)
        return short, normals, np.asarray(short <= 0.0)
    sensor, apart = flight.mission.sensor, position - points
    distance = np.linalg.norm(apart, axis=1)
    sight = apart / distance[:, np.newaxis]
    cosine = least_cosine(sensor)
    low = cosine * distance - np.sum(normals * apart, axis=1)
    far = distance - (np.inf if sensor.max_range_m is None else sensor.max_range_m)
    towards = np.where((far > low)[:, np.newaxis], -sight, normals - cosine * sight)
    is_seen = seen_points(flight, sample, position, aimed(flight.mission, position), sun)
    return np.maximum(np.maximum(low, far), least), towards, is_seen
