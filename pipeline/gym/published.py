"""Observations as AFRL's environments give them, so that what was trained there flies here."""

from math import ceil, cos, pi, sin
from typing import Any, Final

import gymnasium
import numpy as np
from gymnasium.spaces import Box
from numpy.typing import NDArray

from fis_tools.compiled.decorator import plainly
from pipeline.array_types import Floats
from pipeline.flight.reference.guidance import clustered
from pipeline.flight.world.chief import chief_attitudes
from pipeline.flight.world.pack import optics_of
from pipeline.flight.world.surface import regular_angles, surface_of
from pipeline.gym.env import InspectionEnv
from pipeline.gym.six_dof import VELOCITY, SixDofInspectionEnv
from pipeline.physics.illumination import sun_direction_h
from pipeline.physics.quaternion import dcm_b_from_h
from pipeline.physics.sight import is_sunlit

#: points of a cluster, about, and the tolerance of k-means, as theirs
POINTS_OF_CLUSTER: Final = 10
TOLERANCE: Final = 1e-4


class PublishedObservation(gymnasium.Wrapper[NDArray[np.float64], NDArray[Any], Any, NDArray[Any]]):
    """Observes as safe-autonomy-sims 4.2.3 does, number for number.

    Position (m) and velocity (m/s), with six degrees of freedom rate (rad/s) and attitude; the Sun's angle
    from +i towards -j (rad), the points inspected, and the unit vector from the chief's centre to the nearest
    cluster of points that are lit and not inspected; where points have a priority, its direction, and the
    weight inspected. There is a cluster for each ten points, found by k-means from the clusters of the step
    before; further ones begin at points that are drawn.

    Parameters
    ----------
    env : InspectionEnv or SixDofInspectionEnv
        Or wrappers that observe nothing else.
    random : numpy.random.Generator or numpy.random.RandomState, optional
        Draws those points; theirs is NumPy's global generator.

    Raises
    ------
    ValueError
        If the environment is another.
    """

    def __init__(self, env: gymnasium.Env[Any, Any], random: Any = None) -> None:
        super().__init__(env)
        inner: Any = env.unwrapped
        if type(inner) not in (InspectionEnv, SixDofInspectionEnv):
            raise ValueError(
                f"{type(inner).__name__} is none that inspects; AFRL's observations are of InspectionEnv and "
                "SixDofInspectionEnv"
            )
        mission = inner.task.mission
        self._inner, self._random = inner, random or np.random.default_rng()
        self._surface, self._optics = surface_of(mission), optics_of(mission)
        self._points = self._surface.points
        if mission.chief.placement == "deserno":  # to their last bits, by which clusters at the centre part
            radius, angles = mission.chief.inspection_radius_m, regular_angles(mission.chief.num_points)
            rings = [(radius * sin(polar), radius * cos(polar), turned) for polar, turned in angles]
            self._points = np.array([(out * cos(turned), out * sin(turned), up) for out, up, turned in rings])
        self._turned, self._centres = chief_attitudes(mission), np.zeros((0, 3))
        self._is_weighted = mission.chief.weights == "priority"
        turning = [np.inf] * 3 + [1.0] * 4 if isinstance(inner, SixDofInspectionEnv) else []
        most = 2.0 * pi + mission.orbit.mean_motion_rad_s * mission.duration_s
        high = [*[np.inf] * 6, *turning, most, float(len(self._surface.points)), *[1.0] * 3]
        high += [1.0] * 4 if self._is_weighted else []
        low = -np.array(high)
        low[6 + len(turning) : 8 + len(turning)] = 0.0
        self.observation_space = Box(low, np.array(high), dtype=np.float64)

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> Any:
        """Start an episode."""
        _, info = self.env.reset(seed=seed, options=options)
        self._centres = np.zeros((0, 3))
        return self._seen(), info

    def step(self, action: NDArray[Any]) -> Any:
        """Fly to the next action."""
        _, reward, terminated, truncated, info = self.env.step(action)
        return self._seen(), reward, terminated, truncated, info

    def _seen(self) -> Floats:
        """Return the observation now."""
        inner, mission = self._inner, self._inner.task.mission
        k, start, priority = inner.num_flown, inner.scenario, inner.priority
        gone = mission.orbit.mean_motion_rad_s * k * mission.control_period_s
        motion = inner.state[VELOCITY.stop :]  # none, or attitude and rate
        parts = [inner.state[: VELOCITY.stop], motion[4:], motion[:4]]
        parts += [[-start.sun_angle_rad % (2.0 * pi) + gone, inner.is_inspected.sum()]]
        parts += [self._nearest_cluster(k, start.sun_angle_rad - gone)]
        if self._is_weighted:
            parts += [priority @ dcm_b_from_h(self._turned[k]), [inner.weight_inspected]]
        return np.concatenate(parts)

    def _nearest_cluster(self, k: int, sun: float) -> Floats:
        """Return the direction of the cluster that is nearest to the deputy; zero where there is none."""
        axes, surface = dcm_b_from_h(self._turned[k]), self._surface
        along_sun = surface.normals @ axes @ np.asarray(sun_direction_h(sun)) + self._optics.past_terminator
        with plainly("pipeline"):
            is_lit = np.asarray(is_sunlit(along_sun, np.sum(surface.normals * surface.points, axis=1)))
        points = self._points[is_lit & ~self._inner.is_inspected] @ axes
        if not len(points):
            return np.zeros(3)
        count, begun = ceil(len(points) / POINTS_OF_CLUSTER), self._centres
        if not len(begun):
            begun = np.zeros((count, 3))
        elif count > len(begun):
            drawn = self._random.choice(len(begun), size=count - len(begun))
            begun = np.vstack([begun, points[drawn]])
        self._centres = clustered(points, begun[:count], TOLERANCE)
        apart = np.linalg.norm(self._inner.state[:3] - self._centres, axis=1)
        centre = self._centres[np.argmin(apart)]
        return np.asarray(centre / np.linalg.norm(centre))
