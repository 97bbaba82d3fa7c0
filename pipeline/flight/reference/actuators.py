"""Thrusters with errors, plainly: the twin of `pipeline.flight.kernel.actuators`."""

import numpy as np
from numpy.typing import NDArray

from pipeline.flight.actuators import thrust_errors, thrusters_of
from pipeline.flight.log import Scenario
from pipeline.settings.experiment import Mission

Floats = NDArray[np.float64]


class PlainThrusters:
    """What one deputy's thrusters make of its commands.

    Parameters
    ----------
    mission : Mission
        With real thrusters.
    scenario : Scenario
        The flight's start.
    """

    def __init__(self, mission: Mission, scenario: Scenario):
        self._law = thrusters_of(mission)
        errors = thrust_errors(mission.actuators, [scenario])
        self._errors, self.arm = errors.matrices[0], errors.arms[0]
        self._max_force = mission.deputy.max_force_n
        self._period, self._full = mission.control_period_s, mission.deputy.mass_kg
        self._mass = self._full
        self._commands: list[Floats] = []

    @property
    def delay(self) -> int:
        """Control periods from a command to its force."""
        return self._law.delay

    def fired(self, command: Floats) -> Floats:
        """Return what is fired in the control period of a command, N, Hill axes, shape (3,)."""
        self._commands.append(command)
        if len(self._commands) <= self._law.delay or self._mass <= self._law.dry * self._full:
            return np.zeros(3)
        force = self.in_impulses(self._errors @ self._commands[-1 - self._law.delay])
        return np.asarray(np.clip(force, -self._max_force, self._max_force))

    def burnt(self, force: Floats) -> tuple[float, float]:
        """Use up the propellant of a control period; return the mean mass in it, and that after it, kg."""
        before = self._mass
        self._mass = before - np.abs(force).sum() * self._period / self._law.exhaust_speed
        return 0.5 * (before + self._mass), self._mass

    def in_impulses(self, force: Floats) -> Floats:
        """Return a force in whole impulses, none where it is less than the least."""
        if self._law.step > 0.0:
            force = np.rint(force / self._law.step) * self._law.step
        return np.where(np.abs(force) >= self._law.least, force, 0.0)
