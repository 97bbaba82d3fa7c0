"""The push onto a closed path around the chief (docs/reference/signals.md, the push onto the tour)."""

from collections.abc import Mapping

import numpy as np

from pipeline.array_types import Floats
from pipeline.flight.reference.flight import ReferenceFlight
from pipeline.flight.reference.light import semi_major_axis, share_of_sun, sun_direction
from pipeline.flight.reference.motion import transition
from pipeline.flight.reference.urgency import turned_aside


def tour_push(flight: ReferenceFlight, k: int, state: Floats, urgent: Floats) -> Floats:
    """Return ``Phi_rv^-1 (r_tour(theta - n tau) - Phi_r s)``, turned aside near the chief, m/s."""
    if flight.predicted is not None:
        return tour_push_on_course(flight, k, state, urgent)
    angle, elevation = flight.suns[k]
    n, constants = flight.mission.orbit.mean_motion_rad_s, flight.constants
    time = time_ahead(flight, angle, elevation)
    if time == 0.0:
        return np.zeros(3)
    goal = tour_position(constants, angle - n * time, elevation) + constants["tour_lean_m"] * urgent
    phi, _ = transition(n, time)
    push = np.linalg.solve(phi[:3, 3:], goal - phi[:3] @ state)
    return turned_aside(flight, np.asarray(push, dtype=np.float64), state[:3])


def tour_push_on_course(flight: ReferenceFlight, k: int, state: Floats, urgent: Floats) -> Floats:
    """Return the push on a true course, m/s, by the Sun and the motion that are predicted there."""
    constants, sample = flight.constants, arrival(flight, k)
    if sample == k:
        return np.zeros(3)
    goal = tour_position(constants, *flight.sun_at(k, sample)) + constants["tour_lean_m"] * urgent
    phi = flight.transition(k, sample)
    push = np.linalg.solve(phi[:3, 3:], goal - phi[:3] @ state)
    return turned_aside(flight, np.asarray(push, dtype=np.float64), state[:3])


def arrival(flight: ReferenceFlight, k: int) -> int:
    """Return the sample at which the deputy is to be on the tour; k where that is too long in the dark."""
    course, mission, constants = flight.predicted, flight.mission, flight.constants
    assert course is not None  # noqa: S101 - what asks has one
    period = mission.control_period_s
    first = min(course.last, k + max(1, int(constants["tour_time_s"] / period + 0.5)))
    latest = min(course.last, k + int(constants["tour_wait_s"] / period + 0.5))
    is_circle = mission.orbit.elements.eccentricity == 0.0
    if constants["tour_wait_s"] == 0.0:
        return first
    for sample in range(first, latest + 1):
        distance = semi_major_axis(mission) if is_circle else course.distances[sample]
        share = share_of_sun(mission, sun_direction(*flight.sun_at(k, sample)), float(distance))
        if share >= mission.light.min_fraction:
            return sample
    return k


def tour_position(constants: Mapping[str, float], angle: float, elevation: float) -> Floats:
    """Return the position on the tour, m: each component a mean and two waves of the Sun's angle.

    The lift is added to the cross-track component times the sine of the Sun's elevation.
    """
    waves = {"mean": 1.0, "cos_1": np.cos(angle), "sin_1": np.sin(angle)}
    waves |= {"cos_2": np.cos(2.0 * angle), "sin_2": np.sin(2.0 * angle)}
    x, y, z, lift = (
        sum(constants[f"tour_{part}_{wave}_m"] * value for wave, value in waves.items())
        for part in ("radial", "along_track", "cross_track", "lift")
    )
    return np.array([x, y, z + np.sin(elevation) * lift])


def time_ahead(flight: ReferenceFlight, angle: float, elevation: float) -> float:
    """Return the time until the deputy is to be on the tour, s: zero where that is too long in the dark."""
    n, constants = flight.mission.orbit.mean_motion_rad_s, flight.constants
    time, wait = constants["tour_time_s"], constants["tour_wait_s"]

    def is_dark(after: float) -> bool:
        sun = sun_direction(angle - n * after, elevation)
        share = share_of_sun(flight.mission, sun, semi_major_axis(flight.mission))
        return share < flight.mission.light.min_fraction

    if wait == 0.0 or not is_dark(time):
        return time
    # within half a turn the Sun rises from its lowest, where it is dark, to its highest
    dark = np.mod(angle - np.pi, 2.0 * np.pi) / n
    lit = dark + np.pi / n
    for _ in range(100):
        middle = 0.5 * (dark + lit)
        dark, lit = (middle, lit) if is_dark(middle) else (dark, middle)
    end = float(lit % (2.0 * np.pi / n))
    return end if end <= wait else 0.0
