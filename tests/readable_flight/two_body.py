"""Motion about the Earth (docs/explanation/motion.md): the chief's orbit, and the deputy beside it.

Attraction of an oblate Earth: Vallado, Fundamentals of Astrodynamics and Applications, 4th edition, 8.6.1.
The difference of the two craft is integrated along with the chief, in axes that do not turn, by SciPy.
"""

import numpy as np
from scipy.integrate import solve_ivp

from tests.readable_flight.light import EARTH_RADIUS_M, orbit_radius, sun_direction, visible_share

TOLERANCES = {"method": "DOP853", "rtol": 1e-12, "atol": 1e-11}


class Earth:
    """The Earth's attraction in Hill axes of the start, held fixed."""

    def __init__(self, mission):
        orbit, self.dynamics = mission.orbit, mission.dynamics
        self.axis = orbit_radius(mission)
        self.gravity = orbit.mean_motion_rad_s**2 * self.axis**3
        slope, latitude = np.radians([self.dynamics.inclination_deg, self.dynamics.latitude_argument_deg])
        self.pole = np.array(
            [np.sin(slope) * np.sin(latitude), np.sin(slope) * np.cos(latitude), np.cos(slope)]
        )

    @property
    def fastest(self):
        """The rate of a circular orbit through the perigee, rad/s."""
        return np.sqrt(self.gravity / (self.axis * (1.0 - self.dynamics.eccentricity)) ** 3)

    def attraction(self, place):
        """m/s^2 at a place from its centre, m."""
        r, height = np.linalg.norm(place), place @ self.pole
        oblate = -1.5 * self.dynamics.j2 * self.gravity * EARTH_RADIUS_M**2 / r**5
        oblate = oblate * ((1.0 - 5.0 * height**2 / r**2) * place + 2.0 * height * self.pole)
        return -self.gravity / r**3 * place + oblate

    def start(self):
        """The chief's place and velocity at the start, of Kepler's ellipse."""
        e, anomaly = self.dynamics.eccentricity, np.radians(self.dynamics.true_anomaly_deg)
        parameter = self.axis * (1.0 - e * e)
        place = np.array([parameter / (1.0 + e * np.cos(anomaly)), 0.0, 0.0])
        speed = np.sqrt(self.gravity / parameter)
        return np.array([*place, speed * e * np.sin(anomaly), speed * (1.0 + e * np.cos(anomaly)), 0.0])

    def drag(self, velocity):
        """Direction and share of the drag's acceleration; one against the speed of a circular orbit."""
        return -np.linalg.norm(velocity) * velocity * self.axis / self.gravity


def hill_axes(earth, chief):
    """Rows i, j, k of a chief's state, and the rate at which they turn, both in axes that do not."""
    place, velocity = chief[:3], chief[3:]
    momentum = np.cross(place, velocity)
    i, k = place / np.linalg.norm(place), momentum / np.linalg.norm(momentum)
    pull = earth.attraction(place)
    turning = momentum / (place @ place) + np.linalg.norm(place) * (pull @ k) / np.linalg.norm(momentum) * i
    return np.array([i, np.cross(k, i), k]), turning


def chief_orbit(earth, mission):
    """The chief's state at each sample, (K+1, 6)."""
    times = mission.control_period_s * np.arange(mission.num_controls + 1)

    def rates(_time, s):
        return np.concatenate((s[3:], earth.attraction(s[:3])))

    return solve_ivp(rates, (0.0, times[-1]), earth.start(), t_eval=times, **TOLERANCES).y.T


def moved(flight, k, state, push, more_drag):
    """The deputy's state after a control period: `push`, m/s^2, is held along Hill axes, as they turn.

    `more_drag` is what drag has in this period beyond its constant, m/s^2; it is held along Hill axes of
    the period's middle.
    """
    mission, chief, period = flight.mission, flight.orbit[k], flight.mission.control_period_s
    earth, dynamics = flight.earth, mission.dynamics
    sun = sun_direction(flight.scenario.sun_angle_rad, flight.scenario.sun_elevation_rad)

    def rates(_time, s):
        axes, _ = hill_axes(earth, s[:6])
        shine = visible_share(axes[0] @ sun, np.linalg.norm(s[:3])) if mission.light.shadow != "none" else 1.0
        own = earth.attraction(s[:3] + s[6:9]) - earth.attraction(s[:3])
        own = own + dynamics.drag_m_s2 * earth.drag(s[3:6]) + axes.T @ (push + varied)
        own = own - shine * dynamics.radiation_m_s2 * sun
        return np.concatenate((s[3:6], earth.attraction(s[:3]), s[9:], own))

    varied = np.zeros(3)
    if more_drag:
        half = solve_ivp(rates, (0.0, 0.5 * period), np.concatenate((chief, np.zeros(6))), **TOLERANCES)
        middle = half.y[:6, -1]
        varied = more_drag * hill_axes(earth, middle)[0] @ earth.drag(middle[3:])
    axes, turning = hill_axes(earth, chief)
    place = axes.T @ state[:3]
    velocity = axes.T @ state[3:] + np.cross(turning, place)
    end = solve_ivp(rates, (0.0, period), np.concatenate((chief, place, velocity)), **TOLERANCES).y[:, -1]
    axes, turning = hill_axes(earth, end[:6])
    return np.concatenate((axes @ end[6:9], axes @ (end[9:] - np.cross(turning, end[6:9]))))
