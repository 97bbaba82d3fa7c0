"""Motion beside a chief on its true course, as the deputy predicts it (docs/explanation/motion.md).

To first order of the distance, by the variational equation ``d'' = G d`` with the gradient G of the
attraction at the chief (Montenbruck and Gill, Satellite Orbits, chapter 7), integrated by SciPy over one
control period after another.
"""

from functools import cached_property

import numpy as np
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from pipeline.array_types import Floats
from pipeline.flight.reference.light import SunAngles
from pipeline.flight.reference.two_body import TOLERANCES, Earth, hill_axes
from pipeline.settings.experiment import Mission

#: how far beyond a flight's end the deputy predicts, s
BEYOND_S = 3600.0
#: half the way over which the attraction's difference gives its gradient, m
HALF_WAY_M = 100.0


def gradient(earth: Earth, position: Floats) -> Floats:
    """Return the gradient of the attraction at a position, (3, 3), 1/s^2, as a quotient of differences."""
    ways = HALF_WAY_M * np.eye(3)
    pulls = [earth.attraction(position + way) - earth.attraction(position - way) for way in ways]
    return np.array(pulls).T / (2.0 * HALF_WAY_M)


def to_hill_states(axes: Floats, turning: Floats) -> Floats:
    """Return the matrix, (6, 6), from relative states in axes that do not turn to Hill states."""
    turned = np.cross(turning, np.eye(3)).T  # times r: the vector product of turning and r
    return np.block([[axes, np.zeros((3, 3))], [-axes @ turned, axes]])


class PredictedCourse:
    """A chief's orbit at samples, N of them to beyond the flight's end, and motion from one to the next."""

    def __init__(self, earth: Earth, mission: Mission) -> None:
        self._earth, self._mission, self._mass = earth, mission, mission.deputy.mass_kg
        safety = mission.safety
        drifts = [safety.passive_horizon_s, safety.keep_in_horizon_s] if safety.kind == "filter" else []
        beyond = int(np.ceil(max([BEYOND_S, *drifts]) / mission.control_period_s))
        self.last = mission.num_controls + beyond
        self._steps: dict[int, tuple[Floats, Floats]] = {}
        self._times = mission.control_period_s * np.arange(self.last + 1)

    @cached_property
    def chief(self) -> Floats:
        """The chief's position and velocity about the Earth, (N, 6)."""

        def rates(_time: float, s: Floats) -> Floats:
            return np.concatenate((s[3:], self._earth.attraction(s[:3])))

        span = (0.0, self._times[-1])
        return np.asarray(solve_ivp(rates, span, self._earth.start(), t_eval=self._times, **TOLERANCES).y.T)

    @property
    def distances(self) -> Floats:
        """The chief's distance from the Earth's centre, m, (N,)."""
        return np.asarray(np.linalg.norm(self.chief[:, :3], axis=1))

    def step(self, k: int) -> tuple[Floats, Floats]:
        """Return Phi, (6, 6), and Gamma, (6, 3), of a control period."""
        if k not in self._steps:
            self._steps[k] = self._step(k)
        return self._steps[k]

    @cached_property
    def from_start(self) -> Floats:
        """Phi from the start to each sample, (N, 6, 6)."""
        phi = [np.eye(6)]
        for k in range(self.last):
            phi.append(self.step(k)[0] @ phi[-1])
        return np.array(phi)

    def between(self, k: int, sample: int) -> Floats:
        """Return Phi from one sample to another, (6, 6)."""
        return np.asarray(self.from_start[sample] @ np.linalg.inv(self.from_start[k]))

    def suns(self, start: Floats) -> list[SunAngles]:
        """Return the Sun at each sample from its direction at the start, Hill axes."""
        pole, turns = self._mission.orbit.sun_moved(self._times)
        fixed = Rotation.from_rotvec(np.outer(turns, pole)).apply(start)
        seen = [hill_axes(self._earth, s)[0] @ sun for s, sun in zip(self.chief, fixed, strict=True)]
        return [(float(np.arctan2(y, x)), float(np.arctan2(z, np.hypot(x, y)))) for x, y, z in seen]

    def _step(self, k: int) -> tuple[Floats, Floats]:
        """Return Phi and Gamma of a control period; a force is held along Hill axes as they turn."""

        def rates(_time: float, s: Floats) -> Floats:
            positions, speeds = s[6:].reshape(2, 3, 9)
            pulls = gradient(self._earth, s[:3]) @ positions
            pulls[:, 6:] += hill_axes(self._earth, s[:6])[0].T / self._mass
            return np.concatenate((s[3:6], self._earth.attraction(s[:3]), speeds.ravel(), pulls.ravel()))

        ends = [to_hill_states(*hill_axes(self._earth, self.chief[sample])) for sample in (k, k + 1)]
        begin = np.hstack((np.linalg.inv(ends[0]), np.zeros((6, 3))))
        start = np.concatenate((self.chief[k], begin.ravel()))
        period = solve_ivp(rates, (0.0, self._mission.control_period_s), start, **TOLERANCES).y[6:, -1]
        end = ends[1] @ period.reshape(6, 9)
        return end[:, :6], end[:, 6:]
