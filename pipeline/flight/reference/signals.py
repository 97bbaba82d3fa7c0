"""Signals: what a controller senses, each by its formula (docs/reference/signals.md)."""

from collections.abc import Collection

import numpy as np

from pipeline.array_types import Floats
from pipeline.flight.reference.flight import ReferenceFlight
from pipeline.flight.reference.foresight import foreseen
from pipeline.flight.reference.guidance import SHORTEST_M, relative_angle
from pipeline.flight.reference.motion import closest_approach
from pipeline.flight.reference.parking import park_push
from pipeline.flight.reference.see_push import see_push
from pipeline.flight.reference.state import Look
from pipeline.flight.reference.tour import tour_push
from pipeline.flight.reference.urgency import urgent_direction

AXES = ("radial", "along_track", "cross_track")
URGENT = ("urgent", "aim", "tour_push")


def signals(flight: ReferenceFlight, k: int, look: Look, names: Collection[str]) -> dict[str, float]:
    """Return the signals of these names at a sample, by name; others are left out if they take time."""
    state, constants = look.known, flight.constants
    position, velocity = state[:3], state[3:]

    def senses(*groups: str) -> bool:
        return any(name.startswith(groups) for name in names)

    values = {
        "distance": float(np.linalg.norm(position)),
        "lambda_u": relative_angle(look.target[[0, 1]], position[[0, 1]]),
        "eta_u": relative_angle(look.target[[0, 2]], position[[0, 2]]),
    }
    values |= {f"velocity_body_{a}": v for a, v in zip("xyz", look.sensed.inv().apply(velocity), strict=True)}
    values |= along("position", position) | along("velocity", velocity)
    values |= natural_motion(flight, k, position, velocity)
    values |= towards(flight.suns[k][0], position, look.target)
    if senses("closest_approach"):
        values["closest_approach"] = closest_approach(flight.mission, state)
    if senses("missed", "coasting"):
        preview = foreseen(flight, k, state, look.is_inspected)
        values |= dict(zip(("missed", "coasting_nearest", "coasting_farthest"), preview, strict=True))
    urgent, push = np.zeros(3), np.zeros(3)
    if senses(*URGENT):
        urgent = urgent_direction(flight, k, position, look.is_lit & ~look.is_inspected)
    if senses("see_push", "aim"):
        push = see_push(flight, k, state, look.is_inspected)
    if senses("park_push"):
        parking = park_push(flight, k, state, look.is_inspected)
        values |= along("park_push", np.zeros(3) if parking is None else parking)
    if senses("tour_push"):
        values |= along("tour_push", tour_push(flight, k, state, urgent))
    values |= along("urgent", urgent) | along("see_push", push)
    return values | along("aim", push + constants["aim_urgent_m_s"] * urgent)


def along(name: str, vector: Floats) -> dict[str, float]:
    """Return the components of a vector by name."""
    return {f"{name}_{axis}": value for axis, value in zip(AXES, vector, strict=True)}


def natural_motion(flight: ReferenceFlight, k: int, position: Floats, velocity: Floats) -> dict[str, float]:
    """Return the ellipse of free motion: its centre, where that drifts, and the deputy's error on the ring.

    On a true course it is the ellipse of a circle at the rate at which Hill axes turn now.
    """
    n, constants, angle = float(flight.hill_rates[k][2]), flight.constants, flight.suns[k][0]
    centre = np.array([4.0 * position[0] + 2.0 * velocity[1] / n, position[1] - 2.0 * velocity[0] / n])
    drift = -1.5 * n * centre[0] * constants["prediction_time_s"]
    bearing = angle - constants["ring_lead_rad"]
    ring = constants["ring_size_m"] * np.array([np.cos(bearing), np.sin(bearing)])
    # (x - x_c, (y - y_c)/2) of the ellipse is (-3 x - 2 y'/n, x'/n)
    error = np.array([-3.0 * position[0] - 2.0 * velocity[1] / n, velocity[0] / n]) - ring
    return {
        "centre_radial": centre[0],
        "centre_along_track": centre[1],
        "predicted_centre_along_track": centre[1] + drift,
        "ring_error_radial": error[0],
        "ring_error_along_track": error[1],
    }


def towards(angle: float, position: Floats, target: Floats) -> dict[str, float]:
    """Return the directions of the target and of the Sun, at an angle in rad, as seen from the deputy."""
    sun, reach = np.array([np.cos(angle), np.sin(angle)]), np.hypot(position[0], position[1])
    flat = position[:2] / reach if reach >= SHORTEST_M else np.zeros(2)
    length = np.linalg.norm(target)
    unit = target / length if length >= SHORTEST_M else np.zeros(3)
    return along("target", unit) | {
        "sun_alignment": flat @ sun,
        "sun_ahead": flat[0] * sun[1] - flat[1] * sun[0],
        "target_setting": unit[1] * sun[0] - unit[0] * sun[1],
    }
