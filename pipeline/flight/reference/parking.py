"""The push that parks the deputy (docs/reference/signals.md, the push that parks)."""

from collections.abc import Iterator

import numpy as np

from pipeline.array_types import Booleans, Floats
from pipeline.flight.reference.flight import ReferenceFlight
from pipeline.flight.reference.foresight import preview

#: radial parts that are tried each way; looks at a path in an orbit, for so many orbits
RADIAL_STEPS, LOOKS, ORBITS = 8, 36, 3
#: where half the way along the track to the ellipse's centre is shorter, m, its swing stays as it is
LEAST_LENGTH_M = 1.0


def park_push(flight: ReferenceFlight, k: int, state: Floats, is_inspected: Booleans) -> Floats | None:
    """Return the cheapest push after which coasting stays inside the limits and shows enough, m/s, or None.

    No push is tried, too. The last `park_before_s` of a flight any number of points is enough.
    """
    mission, constants = flight.mission, flight.constants
    is_late = flight.time(mission.num_controls - k) <= constants["park_before_s"]
    most = mission.deputy.max_force_n * mission.control_period_s / mission.deputy.mass_kg
    for push in sorted(tried(flight, state), key=lambda tried: float(np.abs(tried).sum())):
        after = state + np.concatenate([np.zeros(3), push])
        if np.abs(push).max() > most or not stays(flight, after):
            continue
        if is_late or preview(flight, k, after, is_inspected)[0].sum() < constants["park_below_points"]:
            return push
    return None


def tried(flight: ReferenceFlight, state: Floats) -> Iterator[Floats]:
    """Yield no push, and those that close the ellipse, with the swing as it is and shifted, m/s."""
    x, _, z, u, v, w = state
    n, reach = flight.mission.orbit.mean_motion_rad_s, flight.constants.get("park_reach_m_s", 0.08)
    yield np.zeros(3)
    for radial in np.linspace(-reach, reach, 2 * RADIAL_STEPS + 1):
        yield np.array([radial, -2.0 * n * x - v, 0.0])
        if abs(u + radial) >= n * LEAST_LENGTH_M:
            yield np.array([radial, -2.0 * n * x - v, -(n**2) * x * z / (u + radial) - w])


def stays(flight: ReferenceFlight, state: Floats) -> bool:
    """Return whether free motion stays inside the limits by coast_margin_m at all looks.

    The path is the ellipse of Clohessy and Wiltshire (J. Aerospace Sci. 27, 1960), by its elements.
    """
    x, y, z, u, v, w = state
    n, deputy = flight.mission.orbit.mean_motion_rad_s, flight.mission.deputy
    turns = np.arange(1, LOOKS + 1) / LOOKS + np.arange(ORBITS)[:, np.newaxis]
    cosine, sine = np.cos(2.0 * np.pi * turns), np.sin(2.0 * np.pi * turns)
    centre, high = 4.0 * x + 2.0 * v / n, -3.0 * x - 2.0 * v / n
    radial = centre + high * cosine + u / n * sine
    along = y - 2.0 * u / n - 3.0 * np.pi * centre * turns + 2.0 * (u / n * cosine - high * sine)
    distances = np.sqrt(radial**2 + along**2 + (z * cosine + w / n * sine) ** 2)
    margin = flight.constants["coast_margin_m"]
    is_inside = distances >= deputy.min_distance_m + margin
    return bool(np.all(is_inside & (distances <= deputy.max_distance_m - margin)))
