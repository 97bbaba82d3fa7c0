"""What stays the same throughout a flight: mission, controller, start, surface, light."""

from collections import defaultdict
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import pairwise

import numpy as np
from scipy.spatial.transform import Rotation

from pipeline.array_types import Booleans, Floats
from pipeline.flight.control.controller import (
    Controller,
    OpenLoopController,
    RegulatorController,
    RuleController,
)
from pipeline.flight.reference.course import PredictedCourse
from pipeline.flight.reference.errors import DrawnErrors
from pipeline.flight.reference.light import SunAngles, faces_sun, later, semi_major_axis, sun_direction
from pipeline.flight.reference.mesh import Mesh
from pipeline.flight.reference.motion import transition
from pipeline.flight.reference.turning import chief_attitudes
from pipeline.flight.reference.two_body import Earth, chief_orbit, hill_axes
from pipeline.flight.state.log import Scenario
from pipeline.settings.experiment import Mission
from pipeline.settings.mission import TwoBody


@dataclass(frozen=True)
class ReferenceFlight:
    """A mission, a controller, a start, and a surface: points and normals, (P, 3), and triangles, (T, 3, 3).

    `given`, (n, 4), are forces of the first n control periods, N, Hill axes, and 1 for each that is fired in
    place of the rules'.
    """

    mission: Mission
    controller: Controller
    scenario: Scenario
    points: Floats
    normals: Floats
    corners: Floats
    errors: DrawnErrors = field(default_factory=DrawnErrors)
    given: Floats | None = None

    def flown_by(self, controller: Controller) -> "ReferenceFlight":
        """Return the same flight with another controller, with what is known of the chief and its light."""
        other = replace(self, controller=controller)
        others = {"constants", "plan"}
        fields = self.__dataclass_fields__.keys()
        kept = {name: value for name, value in vars(self).items() if name not in others | fields}
        vars(other).update(kept)
        return other

    @cached_property
    def constants(self) -> defaultdict[str, float]:
        """The controller's constants by name; zero where not set."""
        attributes = self.controller.fuzzy.attributes if self.controller.fuzzy else ()
        return defaultdict(float, {name: float(text) for name, text in attributes if name != "force_axes"})

    @cached_property
    def plan(self) -> Floats:
        """Forces that are known beforehand, (K, 3), N, the controller's axes; zero after the last."""
        forces = np.zeros((0, 3))
        if isinstance(self.controller, OpenLoopController):
            forces = self.controller.plan
        elif isinstance(self.controller, RegulatorController):
            forces = self.controller.regulator([self.scenario]).forces[0]
        plan = np.zeros((self.mission.num_controls, 3))
        plan[: len(forces)] = forces
        return plan

    @property
    def has_plan(self) -> bool:
        """Whether forces are planned rather than inferred."""
        return not isinstance(self.controller, RuleController)

    @cached_property
    def chief(self) -> list[Rotation]:
        """The chief's attitude at each sample."""
        return chief_attitudes(self.mission, self.hill_axes if self.mission.has_true_course else [])

    @cached_property
    def earth(self) -> Earth | None:
        """The Earth that attracts both craft; None where motion is linear."""
        dynamics = self.mission.dynamics
        return Earth(self.mission, dynamics) if isinstance(dynamics, TwoBody) else None

    @cached_property
    def orbit(self) -> Floats | None:
        """The chief's position and velocity about the Earth, (K+1, 6); None where motion is linear."""
        return None if self.earth is None else chief_orbit(self.earth, self.mission)

    @cached_property
    def hill_axes(self) -> list[Floats]:
        """Rows i, j, k at each sample, in axes fixed as Hill's at the start; empty where motion is linear."""
        if self.earth is None or self.orbit is None:
            return []
        return [hill_axes(self.earth, chief)[0] for chief in self.orbit]

    @cached_property
    def hill_rates(self) -> Floats:
        """Mean rate of Hill axes in each control period, the last once more, Hill axes, (K+1, 3), rad/s."""
        num_samples = self.mission.num_controls + 1
        if not self.mission.has_true_course:
            return np.tile([0.0, 0.0, self.mission.orbit.mean_motion_rad_s], (num_samples, 1))
        axes = [Rotation.from_matrix(rows) for rows in self.hill_axes]
        turns = [(before * after.inv()).as_rotvec() for before, after in pairwise(axes)]
        return np.array([*turns, turns[-1]]) / self.mission.control_period_s

    @cached_property
    def circular_rates(self) -> Floats:
        """Rate of a circular orbit at the chief's distance at each sample, rad/s, (K+1,)."""
        rate = np.full(self.mission.num_controls + 1, self.mission.orbit.mean_motion_rad_s)
        if self.orbit is None or not self.mission.has_true_course:
            return rate
        return rate * (semi_major_axis(self.mission) / np.linalg.norm(self.orbit[:, :3], axis=1)) ** 1.5

    @cached_property
    def predicted(self) -> PredictedCourse | None:
        """The chief's true course as the deputy predicts it; None where it counts with the mean motion."""
        return (
            PredictedCourse(self.earth, self.mission) if self.earth and self.mission.has_true_course else None
        )

    @cached_property
    def predicted_suns(self) -> list[SunAngles]:
        """The Sun at each sample of the predicted course, beyond the flight's end too."""
        start = sun_direction(self.scenario.sun_angle_rad, self.scenario.sun_elevation_rad)
        return [] if self.predicted is None else self.predicted.suns(start)

    def transition(self, k: int, sample: int) -> Floats:
        """Return Phi of free motion from one sample to a later one, (6, 6), as the deputy predicts it."""
        if self.predicted is not None:
            return self.predicted.between(k, sample)
        return transition(self.mission.orbit.mean_motion_rad_s, self.time(sample - k))[0]

    def step(self, k: int) -> tuple[Floats, Floats]:
        """Return Phi, (6, 6), and Gamma, (6, 3), of a control period, as the deputy predicts it."""
        if self.predicted is not None:
            return self.predicted.step(k)
        n, mass = self.mission.orbit.mean_motion_rad_s, self.mission.deputy.mass_kg
        return transition(n, self.mission.control_period_s, mass)

    def sun_at(self, k: int, sample: int) -> SunAngles:
        """Return the Sun at a later sample, as the deputy predicts it at sample k."""
        if self.predicted is not None:
            return self.predicted_suns[sample]
        return later(self.mission, self.suns[k], sample - k)

    @cached_property
    def distances(self) -> Floats:
        """The chief's distance from the Earth's centre at each sample, m, (K+1,); of a circle, its radius."""
        if self.orbit is None or self.mission.orbit.elements.eccentricity == 0.0:
            return np.full(self.mission.num_controls + 1, semi_major_axis(self.mission))
        return np.linalg.norm(self.orbit[:, :3], axis=1)

    @cached_property
    def suns(self) -> list[SunAngles]:
        """The Sun at each sample: at ``theta_0 - n t``, or as a true orbit turns Hill axes."""
        samples = range(self.mission.num_controls + 1)
        start = self.scenario.sun_angle_rad, self.scenario.sun_elevation_rad
        if self.orbit is None:
            return [later(self.mission, start, k) for k in samples]
        directions = [self.hill_axes[k] @ self.fixed_suns[k] for k in samples]
        return [(float(np.arctan2(y, x)), float(np.arctan2(z, np.hypot(x, y)))) for x, y, z in directions]

    @cached_property
    def fixed_suns(self) -> Floats:
        """Unit vectors to the Sun at each sample, Hill axes of the start, (K+1, 3).

        With an epoch the Sun moves along the ecliptic wherever Hill axes follow a true course.
        """
        start = sun_direction(self.scenario.sun_angle_rad, self.scenario.sun_elevation_rad)
        times = self.mission.control_period_s * np.arange(self.mission.num_controls + 1)
        if not self.mission.has_true_course:
            return np.tile(start, (len(times), 1))
        pole, turns = self.mission.orbit.sun_moved(times)
        return Rotation.from_rotvec(np.outer(turns, pole)).apply(start)

    @cached_property
    def mesh(self) -> Mesh | None:
        """The triangles that hide points; None of a sphere."""
        return Mesh(self.points, self.normals, self.corners) if len(self.corners) else None

    @cached_property
    def is_papers(self) -> bool:
        """Whether light and camera are the paper's, and the Sun is in the orbit plane at the start."""
        light, sensor = self.mission.light, self.mission.sensor
        return (
            (light.shadow, light.reflection, self.mission.chief.shape) == ("none", "none", "sphere")
            and (light.past_terminator_deg, sensor.min_sun_angle_deg, sensor.max_incidence_deg) == (0, 0, 90)
            and (sensor.max_range_m, sensor.min_range_m) == (None, 0.0)
            and sensor.half_angle_deg < 90.0
            and sensor.rectangle_deg is None
            and self.scenario.sun_elevation_rad == 0.0
        )

    @cached_property
    def is_lit(self) -> Booleans:
        """Which points are lit at each sample, (K+1, P)."""
        return np.array([self.lit_at(k, sun) for k, sun in enumerate(self.suns)])

    @cached_property
    def is_inspectable(self) -> Booleans:
        """Which points are lit at some sample, (P,)."""
        return np.asarray(self.is_lit.any(axis=0))

    @cached_property
    def is_counted(self) -> Booleans:
        """Which points must be inspected; those that are never lit count in the paper's world only."""
        return np.ones(len(self.points), dtype=np.bool_) if self.is_papers else self.is_inspectable

    @cached_property
    def last_lit(self) -> Floats:
        """When each point is lit for the last time, s; zero for those that are never lit after the start."""
        times = self.mission.control_period_s * np.arange(len(self.is_lit))
        return np.max(np.where(self.is_lit, times[:, np.newaxis], 0.0), axis=0)

    def lit_at(self, k: int, sun: SunAngles) -> Booleans:
        """Return which points a Sun lights at a sample: it is above them, and nothing hides it, (P,)."""
        direction, (points, normals) = sun_direction(*sun), self.surface_at(k)
        is_lit = faces_sun(self.mission, points, normals, direction, self.distances[k])
        return is_lit & self.free_towards(np.tile(direction, (len(points), 1)), is_lit, k)

    def time(self, k: int) -> float:
        """Return the seconds from the start to a sample."""
        return k * self.mission.control_period_s

    def periods(self, seconds: float) -> int:
        """Return the whole number of control periods in a time."""
        return round(seconds / self.mission.control_period_s)

    def surface_at(self, k: int) -> tuple[Floats, Floats]:
        """Return points, m, and normals at a sample, Hill axes, (P, 3) each."""
        return self.chief[k].apply(self.points), self.chief[k].apply(self.normals)

    def free_towards(self, directions: Floats, is_wanted: Booleans, k: int) -> Booleans:
        """Return which of the wanted points the chief does not hide, each in its direction, (P, 3)."""
        if self.mesh is None:
            return np.ones(len(self.points), dtype=np.bool_)
        turned = self.chief[k].inv().apply(directions)
        return np.array([wanted and self.mesh.is_free(i, turned[i]) for i, wanted in enumerate(is_wanted)])

    def tilt_angles(self, k: int) -> Floats:
        """Return the angles from the true attitude to the sensed one, rad about each body axis."""
        return self.errors.of_attitude[k] if len(self.errors.of_attitude) else np.zeros(3)

    def tilt(self, k: int) -> Rotation:
        """Return the rotation by these small angles."""
        return Rotation.from_quat([*(0.5 * self.tilt_angles(k)), 1.0])

    def played(self, k: int) -> tuple[Rotation | None, Floats | None]:
        """Return the attitude, and the torque, played in a control period; None each where none is."""
        if not isinstance(self.controller, OpenLoopController):
            return None, None
        attitudes, torques = self.controller.turns
        most = self.mission.deputy.max_torque_n_m
        attitude = Rotation.from_quat(attitudes[min(k, len(attitudes) - 1)]) if len(attitudes) else None
        torque = None
        if len(torques):
            torque = np.clip(torques[k], -most, most) if k < len(torques) else np.zeros(3)
        return attitude, torque
