"""What stays the same throughout a flight."""

from collections import defaultdict
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from tests.readable_flight.errors import Errors
from tests.readable_flight.light import lit_points, sun_at
from tests.readable_flight.mesh import Mesh
from tests.readable_flight.turning import chief_attitudes
from tests.readable_flight.two_body import Earth, chief_orbit, hill_axes


@dataclass(frozen=True)
class Flight:
    """A mission, a controller, a start, and a surface: points and normals, (P, 3), and triangles, (T, 3, 3).

    `opening` is a force, N, fired in the first control period in place of the rules'.
    """

    mission: Any
    controller: Any
    scenario: Any
    points: np.ndarray
    normals: np.ndarray
    corners: np.ndarray
    errors: Errors = field(default_factory=Errors)
    opening: np.ndarray | None = None

    @cached_property
    def constants(self):
        """The controller's constants by name; zero where not set."""
        attributes = self.controller.fuzzy.attributes if self.controller.fuzzy else ()
        return defaultdict(float, {name: float(text) for name, text in attributes if name != "force_axes"})

    @cached_property
    def plan(self):
        """Planned forces, (K, 3), N, the controller's axes; zero after the last."""
        forces = self.controller.plan
        if self.controller.regulator is not None:
            forces = self.controller.regulator.forces(self.scenario)
        plan = np.zeros((self.mission.num_controls, 3))
        plan[: len(forces)] = forces
        return plan

    @property
    def has_plan(self):
        """Whether forces are planned rather than inferred."""
        return self.controller.plan is not None or self.controller.regulator is not None

    @cached_property
    def chief(self):
        """The chief's attitude at each sample."""
        return chief_attitudes(self.mission)

    @cached_property
    def earth(self):
        """The Earth that attracts both craft; None where motion is linear."""
        return Earth(self.mission) if self.mission.dynamics.model == "two_body" else None

    @cached_property
    def orbit(self):
        """The chief's place and velocity about the Earth at each sample; None where motion is linear."""
        return None if self.earth is None else chief_orbit(self.earth, self.mission)

    @cached_property
    def hill_axes(self):
        """Rows i, j, k at each sample in axes that do not turn, Hill's at the start."""
        return [hill_axes(self.earth, chief)[0] for chief in self.orbit]

    @cached_property
    def suns(self):
        """The Sun's angle and elevation at each sample, rad."""
        return [sun_at(self, k) for k in range(self.mission.num_controls + 1)]

    @cached_property
    def mesh(self):
        """The triangles that hide points; None of a sphere."""
        return Mesh(self.points, self.normals, self.corners) if len(self.corners) else None

    @cached_property
    def is_papers(self):
        """Whether light and camera are the paper's, and the Sun is in the orbit plane at the start."""
        light, sensor = self.mission.light, self.mission.sensor
        return (
            (light.shadow, light.reflection, self.mission.chief.shape) == ("none", "none", "sphere")
            and (light.past_terminator_deg, sensor.min_sun_angle_deg, sensor.max_incidence_deg) == (0, 0, 90)
            and sensor.max_range_m is None
            and sensor.half_angle_deg < 90.0
            and self.scenario.sun_elevation_rad == 0.0
        )

    @cached_property
    def is_lit(self):
        """Which points are lit at each sample, (K+1, P)."""
        return np.array([lit_points(self, k, sun) for k, sun in enumerate(self.suns)])

    @cached_property
    def is_inspectable(self):
        """Which points are lit at some sample, (P,)."""
        return self.is_lit.any(axis=0)

    @cached_property
    def is_counted(self):
        """Which points must be inspected: in other worlds than the paper's not those that are never lit."""
        return np.ones(len(self.points), dtype=bool) if self.is_papers else self.is_inspectable

    @cached_property
    def last_lit(self):
        """When each point is lit for the last time, s; zero for those that are never lit after the start."""
        times = self.time(np.arange(len(self.is_lit)))
        return np.max(np.where(self.is_lit, times[:, np.newaxis], 0.0), axis=0)

    def time(self, k):
        """Seconds from the start to a sample."""
        return k * self.mission.control_period_s

    def periods(self, seconds):
        """The whole number of control periods in a time."""
        return round(seconds / self.mission.control_period_s)

    def surface_at(self, k):
        """Points, m, and normals at a sample, Hill axes, (P, 3) each."""
        return self.chief[k].apply(self.points), self.chief[k].apply(self.normals)

    def free_towards(self, directions, is_asked, k):
        """Which points, of those asked for, are free of the chief towards directions, (P, 3), Hill axes."""
        if self.mesh is None:
            return np.ones(len(self.points), dtype=bool)
        turned = self.chief[k].inv().apply(directions)
        return np.array([asked and self.mesh.is_free(i, turned[i]) for i, asked in enumerate(is_asked)])

    def tilt_angles(self, k):
        """The angles from the true attitude to the sensed one, rad about each body axis."""
        return self.errors.of_attitude[k] if len(self.errors.of_attitude) else np.zeros(3)

    def tilt(self, k):
        """The rotation by these small angles."""
        return Rotation.from_quat([*(0.5 * self.tilt_angles(k)), 1.0])

    def played(self, k):
        """The attitude, and the torque, played in a control period; None each where none is."""
        attitudes, torques = self.controller.turns
        most = self.mission.deputy.max_torque_n_m
        attitude = Rotation.from_quat(attitudes[min(k, len(attitudes) - 1)]) if len(attitudes) else None
        torque = None
        if len(torques):
            torque = np.clip(torques[k], -most, most) if k < len(torques) else np.zeros(3)
        return attitude, torque
