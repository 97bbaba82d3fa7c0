"""Free motion beside a chief as SciPy integrates it, without any rate of Hill axes, table or transition."""

from typing import NamedTuple

import numpy as np
from scipy.integrate import solve_ivp

from pipeline.array_types import Floats

GRAVITY, EARTH = 3.986004418e14, 6_378_137.0
TIGHT = {"method": "DOP853", "rtol": 1e-11, "atol": 1e-7}


class Orbit(NamedTuple):
    """A circular orbit about the Earth, and what moves the deputy beside its attraction."""

    axis: float  # semi-major axis, m
    slope: float  # inclination, rad
    along: float = 0.0  # angle from the ascending node at the start, rad
    j2: float = 0.0
    drag: float = 0.0  # of the deputy more than of the chief, m/s^2

    @property
    def rate(self) -> float:
        """The mean motion, rad/s."""
        return float(np.sqrt(GRAVITY / self.axis**3))


def linear(rate: float, state: Floats, times: Floats) -> Floats:
    """Return distances by Clohessy and Wiltshire's equations, m, from a Hill state on."""

    def rates(_: float, s: Floats) -> list[float]:
        return [*s[3:], 3.0 * rate**2 * s[0] + 2.0 * rate * s[4], -2.0 * rate * s[3], -(rate**2) * s[2]]

    exact = TIGHT | {"atol": 1e-9}
    path = solve_ivp(rates, (0.0, times[-1]), state, t_eval=times, **exact).y
    return np.asarray(np.linalg.norm(path[:3], axis=0))


def about_the_earth(orbit: Orbit, state: Floats, times: Floats, began: float) -> Floats:
    """Return distances beside a chief about an oblate Earth, with drag, m; the state is that at `began`."""
    size, rate = orbit.axis, orbit.rate
    pole = np.array([0.0, np.sin(orbit.slope), np.cos(orbit.slope)])  # axes of the orbit at its node
    cos, sin = np.cos(orbit.along), np.sin(orbit.along)
    chief = size * np.array([cos, sin, 0.0, -rate * sin, rate * cos, 0.0])

    def pull(position: Floats) -> Floats:
        r, height = np.linalg.norm(position), position @ pole
        oblate = -1.5 * orbit.j2 * GRAVITY * EARTH**2 / r**5
        oblate = oblate * ((1.0 - 5.0 * height**2 / r**2) * position + 2.0 * height * pole)
        return np.asarray(-GRAVITY / r**3 * position + oblate)

    def alone(_: float, s: Floats) -> Floats:
        return np.concatenate((s[3:], pull(s[:3])))

    def both(_: float, s: Floats) -> Floats:
        slowed = -orbit.drag * np.linalg.norm(s[3:6]) * s[3:6] * size / GRAVITY
        pulls = pull(s[:3])
        return np.concatenate((s[3:6], pulls, s[9:], pull(s[:3] + s[6:9]) - pulls + slowed))

    if began > 0.0:
        chief = solve_ivp(alone, (0.0, began), chief, **TIGHT).y[:, -1]
    position, velocity, momentum = chief[:3], chief[3:], np.cross(chief[:3], chief[3:])
    i, k = position / np.linalg.norm(position), momentum / np.linalg.norm(momentum)
    axes, r = np.array([i, np.cross(k, i), k]), np.linalg.norm(position)
    turning = momentum / r**2 + r * (pull(position) @ k) / np.linalg.norm(momentum) * i
    apart = axes.T @ state[:3]
    start = np.concatenate((position, velocity, apart, axes.T @ state[3:] + np.cross(turning, apart)))
    path = solve_ivp(both, (0.0, times[-1]), start, t_eval=times, **TIGHT).y
    return np.asarray(np.linalg.norm(path[6:9], axis=0))
