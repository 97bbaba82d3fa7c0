"""The push onto a closed path around the chief (docs/reference/signals.md, the push onto the tour)."""

import numpy as np

from tests.readable_flight.light import share_of_sun, sun_direction
from tests.readable_flight.motion import transition
from tests.readable_flight.urgency import turned_aside


def tour_push(flight, k, state, urgent):
    """``Phi_rv^-1 (r_tour(theta - n tau) - Phi_r s)``, turned aside near the chief, m/s."""
    angle, elevation = flight.suns[k]
    n, constants = flight.mission.orbit.mean_motion_rad_s, flight.constants
    time = time_ahead(flight, angle, elevation)
    if time == 0.0:
        return np.zeros(3)
    place = tour_place(constants, angle - n * time, elevation) + constants["tour_lean_m"] * urgent
    phi, _ = transition(n, time)
    push = np.linalg.solve(phi[:3, 3:], place - phi[:3] @ state)
    return turned_aside(flight, push, state[:3])


def tour_place(constants, angle, elevation):
    """Each component a mean and two waves of the Sun's angle; the lift grows with the Sun's elevation."""
    waves = {"mean": 1.0, "cos_1": np.cos(angle), "sin_1": np.sin(angle)}
    waves |= {"cos_2": np.cos(2.0 * angle), "sin_2": np.sin(2.0 * angle)}
    x, y, z, lift = (
        sum(constants[f"tour_{part}_{wave}_m"] * value for wave, value in waves.items())
        for part in ("radial", "along_track", "cross_track", "lift")
    )
    return np.array([x, y, z + np.sin(elevation) * lift])


def time_ahead(flight, angle, elevation):
    """Seconds until the deputy is to be on the tour: zero where that is in the dark for too long."""
    n, constants = flight.mission.orbit.mean_motion_rad_s, flight.constants
    time, wait = constants["tour_time_s"], constants["tour_wait_s"]

    def is_dark(after):
        sun = sun_direction(angle - n * after, elevation)
        return share_of_sun(flight.mission, sun) < flight.mission.light.min_fraction

    if wait == 0.0 or not is_dark(time):
        return time
    # within half a turn the Sun rises from its lowest, where it is dark, to its highest
    dark = np.mod(angle - np.pi, 2.0 * np.pi) / n
    lit = dark + np.pi / n
    for _ in range(100):
        middle = 0.5 * (dark + lit)
        dark, lit = (middle, lit) if is_dark(middle) else (dark, middle)
    end = lit % (2.0 * np.pi / n)
    return end if end <= wait else 0.0
