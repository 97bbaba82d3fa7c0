"""Flights of a deputy that turns itself: what is observed of them, and one stepped by forces and torques."""

from typing import Final

import numpy as np

from fis_tools.compiled.decorator import plainly
from pipeline.array_types import Booleans, Floats
from pipeline.flight.control.law import played
from pipeline.flight.fly.published import priority_weights
from pipeline.flight.fly.stepping import NOT_STARTED, SteppedFlights
from pipeline.flight.state.arrays import AIMED, Plans
from pipeline.flight.state.log import Scenario
from pipeline.flight.world.chief import chief_attitudes
from pipeline.flight.world.pack import optics_of
from pipeline.flight.world.surface import surface_of
from pipeline.physics.illumination import sun_angle, sun_direction_h
from pipeline.physics.quaternion import dcm_b_from_h
from pipeline.physics.sight import is_sunlit
from pipeline.settings.experiment import Mission

#: observations in this order, vectors along Hill axes: position (m), velocity (m/s), attitude from Hill to
#: body axes, inertial rate (rad/s, body axes), directions to the Sun, to the mean of the points that are lit
#: and not inspected, and of the priority; weight inspected, time left (s)
NUM_OBSERVED: Final = 24
#: where a state has its parts: position (m) and velocity (m/s), Hill axes; attitude; inertial rate (rad/s)
POSITION, VELOCITY, ATTITUDE, RATE = slice(0, 3), slice(3, 6), slice(6, 10), slice(10, 13)
#: and an observation, after it, weight inspected and time left (s)
WEIGHT_INSPECTED, TIME_LEFT = 22, 23
#: greatest inertial rate about each body axis in AFRL's environments, rad/s
MOST_RATE: Final = 0.034907


class SixDofView:
    """What is observed of a deputy that turns itself, see `NUM_OBSERVED`.

    Parameters
    ----------
    mission : Mission
        Under a Sun in the orbit plane.
    """

    def __init__(self, mission: Mission) -> None:
        self._mission, self._surface = mission, surface_of(mission)
        self._optics, self._turned = optics_of(mission), chief_attitudes(mission)

    def axes(self, k: int) -> Floats:
        """Return the matrix from Hill axes to the chief's at a sample, (3, 3)."""
        with plainly("pipeline"):
            return np.asarray(dcm_b_from_h(self._turned[k]))

    def sun(self, k: int, angle_rad: float) -> Floats:
        """Return the unit vector towards the Sun at a sample, (3,), Hill axes; the angle is the start's."""
        time, rate = k * self._mission.control_period_s, self._mission.orbit.mean_motion_rad_s
        return sun_direction_h(sun_angle(angle_rad, rate, time))

    def is_lit(self, k: int, angle_rad: float) -> Booleans:
        """Return which points the Sun lights at a sample, (P,)."""
        points, normals = self._surface.points, self._surface.normals
        sun, height = self.axes(k) @ self.sun(k, angle_rad), np.sum(normals * points, axis=1)
        with plainly("pipeline"):
            return np.asarray(is_sunlit(normals @ sun + self._optics.past_terminator, height))

    def weights(self, priority: Floats) -> Floats:
        """Return what points count, (P,), of sum one, where they have one by the priority's direction."""
        points = self._surface.points
        if self._mission.chief.weights == "priority":
            return priority_weights(points, priority)
        return np.full(len(points), 1.0 / len(points))

    def seen(
        self, k: int, state: Floats, sun_angle_rad: float, is_inspected: Booleans, priority: Floats
    ) -> Floats:
        """Return the observation at a sample, (24,), as single precision has it.

        See `pipeline.flight.fly.published.PublishedView.seen`; the state is (13,).
        """
        axes, is_wanted = self.axes(k), self.is_lit(k, sun_angle_rad) & ~is_inspected
        target = self._surface.points[is_wanted].sum(axis=0) @ axes
        length = max(float(np.linalg.norm(target)), 1e-9)
        left = (self._mission.num_controls - k) * self._mission.control_period_s
        directions = (self.sun(k, sun_angle_rad), target / length, priority @ axes)
        weight = float(self.weights(priority)[is_inspected].sum())
        return np.concatenate((state, *directions, [weight, left])).astype(np.float32)


class TurnedFlight(SteppedFlights):
    """One flight from a start, stepped by forces along body axes and torques about them.

    A force keeps its direction among Hill axes for a control period, as in every flight.

    Parameters
    ----------
    mission : Mission
    scenario : Scenario

    Attributes
    ----------
    torques : (K, 3) array
        Of the control periods so far, N m.
    """

    def __init__(self, mission: Mission, scenario: Scenario) -> None:
        self.torques = np.zeros((mission.num_controls, 3))
        super().__init__(mission, 1, is_tilted=scenario.sun_elevation_rad != 0.0)
        self.start(0, scenario)
        self.step_started()

    def _plans(self, num_controls: int) -> Plans:
        return played(np.zeros((0, num_controls, 3)), AIMED._replace(torques=self.torques))

    @property
    def state(self) -> Floats:
        """The true state, (13,), see `POSITION` and the others."""
        truth = self._states.truth
        return np.concatenate([truth[name][0, :, 0] for name in ("position", "velocity", "attitude", "rate")])

    def turn(self, force_b: Floats, torque: Floats) -> Floats:
        """Fly by a control period under a force, N, and a torque, N m; return the force in Hill axes, (3,).

        Raises
        ------
        ValueError
            If they are not finite.
        """
        if self.samples[0] > NOT_STARTED:
            self.torques[self.samples[0]] = torque
        force = dcm_b_from_h(self.state[ATTITUDE]).T @ force_b
        self.step(force[np.newaxis])
        return np.asarray(force)
