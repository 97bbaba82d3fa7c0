"""Motion about the Earth (docs/explanation/motion.md): the chief's orbit, and the deputy beside it.

Attraction of an oblate Earth: Vallado, Fundamentals of Astrodynamics and Applications, 4th edition, 8.6.1.
The difference of the two craft is integrated along with the chief, in axes that do not turn, by SciPy.
"""

from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

from pipeline.array_types import Floats
from pipeline.flight.reference.light import planet_radius, semi_major_axis, visible_share
from pipeline.settings.experiment import Mission
from pipeline.settings.mission import TwoBody

TOLERANCES: dict[str, Any] = {"method": "DOP853", "rtol": 1e-12, "atol": 1e-11}


class Earth:
    """The Earth's attraction and drag, in Hill axes of the start, held fixed."""

    def __init__(self, mission: Mission, dynamics: TwoBody) -> None:
        self.elements, self.dynamics = mission.orbit.elements, dynamics
        self.axis = semi_major_axis(mission)
        self.gravity, self.radius = mission.orbit.mean_motion_rad_s**2 * self.axis**3, planet_radius(mission)
        slope, latitude = np.radians([self.elements.inclination_deg, self.elements.latitude_argument_deg])
        self.pole = np.array(
            [np.sin(slope) * np.sin(latitude), np.sin(slope) * np.cos(latitude), np.cos(slope)]
        )

    @property
    def fastest(self) -> float:
        """The rate of a circular orbit through the perigee, rad/s."""
        return float(np.sqrt(self.gravity / (self.axis * (1.0 - self.elements.eccentricity)) ** 3))

    def attraction(self, position: Floats) -> Floats:
        """Return the attraction at a position from the Earth's centre, m, in m/s^2."""
        r, height = np.linalg.norm(position), position @ self.pole
        oblate = -1.5 * self.dynamics.j2 * self.gravity * self.radius**2 / r**5
        oblate = oblate * ((1.0 - 5.0 * height**2 / r**2) * position + 2.0 * height * self.pole)
        return np.asarray(-self.gravity / r**3 * position + oblate)

    def start(self) -> Floats:
        """Return the chief's position and velocity at the start, of Kepler's ellipse."""
        e, anomaly = self.elements.eccentricity, np.radians(self.elements.true_anomaly_deg)
        parameter = self.axis * (1.0 - e * e)
        radius, speed = parameter / (1.0 + e * np.cos(anomaly)), np.sqrt(self.gravity / parameter)
        return np.array(
            [radius, 0.0, 0.0, speed * e * np.sin(anomaly), speed * (1.0 + e * np.cos(anomaly)), 0.0]
        )

    def drag(self, chief: Floats) -> Floats:
        """Return the direction of drag on a state, of length one at the speed of a circular orbit.

        With a scale height that is at the perigee, above which the air thins (Vallado, 8.6.2).
        """
        velocity, height = chief[3:], self.dynamics.scale_height_m
        perigee = self.axis * (1.0 - self.elements.eccentricity)
        density = 1.0 if height is None else np.exp((perigee - np.linalg.norm(chief[:3])) / height)
        return np.asarray(-density * np.linalg.norm(velocity) * velocity * self.axis / self.gravity)


def hill_axes(earth: Earth, chief: Floats) -> tuple[Floats, Floats]:
    """Return rows i, j, k of a chief's state, and the rate at which they turn, both in axes that do not."""
    position, velocity = chief[:3], chief[3:]
    momentum = np.cross(position, velocity)
    i, k = position / np.linalg.norm(position), momentum / np.linalg.norm(momentum)
    pull = earth.attraction(position)
    out_of_plane = np.linalg.norm(position) * (pull @ k) / np.linalg.norm(momentum)
    return np.array([i, np.cross(k, i), k]), momentum / (position @ position) + out_of_plane * i


def chief_orbit(earth: Earth, mission: Mission) -> Floats:
    """Return the chief's state at each sample, (K+1, 6)."""
    times = mission.control_period_s * np.arange(mission.num_controls + 1)

    def rates(_time: float, s: Floats) -> Floats:
        return np.concatenate((s[3:], earth.attraction(s[:3])))

    return np.asarray(solve_ivp(rates, (0.0, times[-1]), earth.start(), t_eval=times, **TOLERANCES).y.T)


def moved(
    earth: Earth, mission: Mission, chief: Floats, sun: Floats, state: Floats, push: Floats, more_drag: float
) -> Floats:
    """Return the deputy's state after a control period.

    Parameters
    ----------
    earth : Earth
    mission : Mission
    chief : (6,)
        The chief's state at the beginning.
    sun : (3,)
        The unit vector towards the Sun in Hill axes of the start.
    state : (6,)
        The deputy's state.
    push : (3,)
        Acceleration, m/s^2, held along Hill axes as they turn.
    more_drag : float
        Beyond its constant, m/s^2; held along Hill axes of the period's middle.
    """
    dynamics, period = earth.dynamics, mission.control_period_s
    varied = np.zeros(3)

    def rates(_time: float, s: Floats) -> Floats:
        axes, _ = hill_axes(earth, s[:6])
        shine = 1.0
        if mission.light.shadow != "none":
            shine = visible_share(axes[0] @ sun, float(np.linalg.norm(s[:3])), earth.radius)
        relative = earth.attraction(s[:3] + s[6:9]) - earth.attraction(s[:3])
        relative = relative + dynamics.drag_m_s2 * earth.drag(s[:6]) + axes.T @ (push + varied)
        relative = relative - shine * dynamics.radiation_m_s2 * sun
        return np.concatenate((s[3:6], earth.attraction(s[:3]), s[9:], relative))

    if more_drag:
        half = solve_ivp(rates, (0.0, 0.5 * period), np.concatenate((chief, np.zeros(6))), **TOLERANCES)
        middle = half.y[:6, -1]
        varied = more_drag * hill_axes(earth, middle)[0] @ earth.drag(middle)
    axes, turning = hill_axes(earth, chief)
    position = axes.T @ state[:3]
    velocity = axes.T @ state[3:] + np.cross(turning, position)
    start = np.concatenate((chief, position, velocity))
    end = solve_ivp(rates, (0.0, period), start, **TOLERANCES).y[:, -1]
    axes, turning = hill_axes(earth, end[:6])
    return np.concatenate((axes @ end[6:9], axes @ (end[9:] - np.cross(turning, end[6:9]))))
