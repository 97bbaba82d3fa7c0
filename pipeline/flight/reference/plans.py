"""What a plan of pushes would come to by geometry (docs/explanation/foresight.md), as it is defined."""

import numpy as np
from numpy.typing import ArrayLike

from pipeline.array_types import Booleans, Floats
from pipeline.flight.reference.camera import least_cosine
from pipeline.flight.reference.flight import ReferenceFlight
from pipeline.flight.reference.motion import transition

#: of a metre by which a point falls short of being seen, and of a metre outside the limits, m/s
PRICE_OF_HEIGHT, PRICE_OF_DISTANCE = 0.01, 0.05
#: what a metre costs more where a point is required, and of a way that is too long between two looks, m/s
PRICE_OF_REQUIRED, PRICE_OF_WAY = 0.03, 0.25
#: between the instants at which what follows a plan counts, s
TAIL_S = 60.0
#: of what is known
SURE = (np.zeros((6, 6)), 0.0, 0.0, 0.0)
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
    after: tuple[float, float] = (0.0, 0.0),
    doubts: tuple[Floats, float, float, float] = SURE,
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
    after : (float, float)
        How long limits count after the end if nothing is fired, and the least distance after a failure at any
        time after the first push, s.
    doubts : (array, float, float, float)
        Covariance of the state, (6, 6), squares of the shares of a push that thrusters may fire wrongly along
        its axes and across them, and what a metre costs by which all these may lead nearer, m/s.
    """
    mission, period, sensor = flight.mission, flight.mission.control_period_s, flight.mission.sensor
    best, outside, price_of_ways, before = np.full(len(is_left), -NEVER), 0.0, 0.0, state
    off, doubt = doubts[0], 0.0
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
        certain, doubtful = _outside_later(flight, k, begin, (state, off), pushes, limits, after)
        outside, doubt = max(outside, certain), doubt + doubtful
        phi, gamma = flight.step(k) if k < mission.num_controls else (np.eye(6), np.zeros((6, 3)))
        force = np.asarray(pushes.get(k, np.zeros(3)), dtype=np.float64)
        wrong = doubts[1] * force**2 + doubts[2] * (force @ force - force**2)
        state, off = phi @ state + gamma @ force, phi @ off @ phi.T + (gamma * wrong) @ gamma.T
    short = np.cumsum(np.r_[0.0, np.sort(np.maximum(0.0, -best))])
    seen_worse = PRICE_OF_HEIGHT * short[needed[0]] + PRICE_OF_REQUIRED * short[needed[1]]
    spent = sum(float(np.abs(force).sum()) for force in pushes.values()) * period / mission.deputy.mass_kg
    outside_worse = max(PRICE_OF_DISTANCE * outside, price_of_ways) + doubts[3] * doubt
    return float(spent + seen_worse + outside_worse)


def _outside_later(
    flight: ReferenceFlight,
    k: int,
    begin: int,
    believed: tuple[Floats, Floats],
    pushes: dict[int, ArrayLike],
    limits: tuple[float, float, float],
    after: tuple[float, float],
) -> tuple[float, float]:
    """Return by how many metres free motion from a sample of a plan leads outside, and what errors may add.

    Motion is looked at minute by minute. Along the track what is believed, a state and its covariance, may be
    off: after a push the deputy may come nearer. The state counts after each control period of a push, and at
    the end of the flight.
    """
    mission, (after_s, passive_s) = flight.mission, after
    n, period, stride = mission.orbit.mean_motion_rad_s, mission.control_period_s, flight.periods(TAIL_S)
    certain, doubtful, since, (state, off) = 0.0, 0.0, k - begin, believed

    def reach(last_row: int, way: float) -> tuple[float, float]:
        times = period * (stride * np.arange(-(-since // stride), last_row + 1) - since)
        ahead = [transition(n, time)[0] for time in times.tolist()]
        x, y, z = np.array([(phi @ state)[:3] for phi in ahead]).T
        doubt = np.sqrt([phi[1] @ off @ phi[1] for phi in ahead])
        distances = np.linalg.norm([x, np.maximum(0.0, np.abs(y) - way * doubt), z], axis=0)
        return float(distances.min()), float(distances.max())

    def num_rows(seconds: float) -> int:
        return int(np.ceil(seconds / (stride * period)))

    following = min([other for other in pushes if other >= k], default=mission.num_controls) - begin
    if passive_s > 0.0 and k - 1 in pushes:
        last_row = -(-following // stride) + num_rows(passive_s)
        certain, beyond = (max(0.0, limits[0] - reach(last_row, way)[0]) for way in (0.0, 1.0))
        doubtful = 0.0 if k in pushes else beyond - certain
    if after_s > 0.0 and k == mission.num_controls:
        near, far = reach(-(-since // stride) + num_rows(after_s), 0.0)
        certain = max(certain, limits[0] - near, far - limits[1])
    return certain, doubtful
