"""Observations as AFRL's environments give them: safe-autonomy-sims 4.2.3, number for number."""

from math import ceil, cos, pi, sin
from typing import Any, Final

import numpy as np

from fis_tools.compiled.decorator import plainly
from pipeline.array_types import Booleans, Floats
from pipeline.flight.reference.guidance import clustered
from pipeline.flight.world.chief import chief_attitudes
from pipeline.flight.world.pack import optics_of
from pipeline.flight.world.surface import regular_angles, surface_of
from pipeline.physics.illumination import sun_direction_h
from pipeline.physics.quaternion import dcm_b_from_h
from pipeline.physics.sight import is_sunlit
from pipeline.settings.experiment import Mission

#: points of a cluster, about, and the tolerance of k-means, as theirs
POINTS_OF_CLUSTER: Final = 10
TOLERANCE: Final = 1e-4
#: how many numbers are observed, how many more where points have a priority, and how many of a deputy that
#: turns itself: its rate and attitude
NUM_PUBLISHED, NUM_OF_PRIORITY, NUM_OF_TURNING = 11, 4, 7


def priority_weights(points: Floats, priority: Floats) -> Floats:
    """Return weights of points, (P,), of sum one, proportional to their angles from ``-priority``."""
    cosines = points @ -priority / (np.linalg.norm(points, axis=1) * np.linalg.norm(priority))
    angles = np.arccos(np.clip(cosines, -1.0, 1.0))
    return np.asarray(angles / angles.sum())


def num_published(mission: Mission) -> int:
    """Return how many numbers AFRL's environments observe in a mission."""
    return NUM_PUBLISHED + NUM_OF_PRIORITY * (mission.chief.weights == "priority")


class PublishedView:
    """What AFRL's agents observe in one flight, sample after sample.

    Position (m) and velocity (m/s), with six degrees of freedom rate (rad/s) and attitude; the Sun's angle
    from +i towards -j (rad), the points inspected, and the unit vector from the chief's centre to the nearest
    cluster of points that are lit and not inspected; where points have a priority, its direction, and the
    weight inspected. There is a cluster for each ten points, found by k-means from the clusters of the sample
    before; further ones begin at points that are drawn.

    Parameters
    ----------
    mission : Mission
    random : numpy.random.Generator or numpy.random.RandomState
        Draws those points.
    """

    def __init__(self, mission: Mission, random: Any) -> None:
        self._mission, self._random = mission, random
        self._surface, self._optics = surface_of(mission), optics_of(mission)
        self._points = self._surface.points
        if mission.chief.placement == "deserno":  # to their last bits, by which clusters at the centre part
            radius, angles = mission.chief.inspection_radius_m, regular_angles(mission.chief.num_points)
            rings = [(radius * sin(polar), radius * cos(polar), turned) for polar, turned in angles]
            self._points = np.array([(out * cos(turned), out * sin(turned), up) for out, up, turned in rings])
        self._turned, self._centres = chief_attitudes(mission), np.zeros((0, 3))
        self._is_weighted = mission.chief.weights == "priority"

    def begin(self) -> None:
        """Forget the clusters of another flight."""
        self._centres = np.zeros((0, 3))

    def seen(
        self, k: int, state: Floats, sun_angle_rad: float, is_inspected: Booleans, priority: Floats
    ) -> Floats:
        """Return the observation at sample k, (n,).

        Parameters
        ----------
        k : int
        state : (6,) or (13,) array
            Position and velocity, Hill axes; attitude from Hill to body axes and inertial rate, body axes.
        sun_angle_rad : float
            At the start.
        is_inspected : (P,) array of bool
        priority : (3,) array
            Its direction, where points have one.
        """
        gone = self._mission.orbit.mean_motion_rad_s * k * self._mission.control_period_s
        motion = state[6:]
        parts: list[Any] = [state[:6], motion[4:], motion[:4]]
        parts += [[-sun_angle_rad % (2.0 * pi) + gone, is_inspected.sum()]]
        parts += [self._nearest_cluster(k, state[:3], sun_angle_rad - gone, is_inspected)]
        if self._is_weighted:
            weights = priority_weights(self._surface.points, priority)
            parts += [priority @ self._axes(k), [weights[is_inspected].sum()]]
        return np.concatenate(parts)

    def _axes(self, k: int) -> Floats:
        """Return the matrix from Hill axes to the chief's at a sample, (3, 3)."""
        with plainly("pipeline"):
            return np.asarray(dcm_b_from_h(self._turned[k]))

    def _nearest_cluster(self, k: int, position: Floats, sun: float, is_inspected: Booleans) -> Floats:
        """Return the direction of the cluster that is nearest to the deputy; zero where there is none."""
        axes, surface = self._axes(k), self._surface
        with plainly("pipeline"):
            along_sun = surface.normals @ axes @ sun_direction_h(sun) + self._optics.past_terminator
            is_lit = np.asarray(is_sunlit(along_sun, np.sum(surface.normals * surface.points, axis=1)))
        points = self._points[is_lit & ~is_inspected] @ axes
        if not len(points):
            return np.zeros(3)
        count, begun = ceil(len(points) / POINTS_OF_CLUSTER), self._centres
        if not len(begun):
            begun = np.zeros((count, 3))
        elif count > len(begun):
            drawn = self._random.choice(len(begun), size=count - len(begun))
            begun = np.vstack([begun, points[drawn]])
        self._centres = clustered(points, begun[:count], TOLERANCE)
        apart = np.linalg.norm(position - self._centres, axis=1)
        centre = self._centres[np.argmin(apart)]
        return np.asarray(centre / np.linalg.norm(centre))
