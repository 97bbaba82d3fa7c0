"""Thrusters with errors, plainly: the twin of `pipeline.flight.period.act.actuators`."""

import numpy as np
from numpy.typing import NDArray

from pipeline.flight.cases.actuators import thrust_errors, thrusters_of
from pipeline.flight.state.log import Scenario
from pipeline.settings.experiment import Mission

Floats = NDArray[np.float64]


class PlainThrusters:
    """One deputy's thrusters, from commands to forces.

    Parameters
    ----------
    mission : Mission
        With the real thruster model.
    scenario : Scenario
        The flight's start.
    """

    def __init__(self, mission: Mission, scenario: Scenario):
        self._law = thrusters_of(mission)
        errors = thrust_errors(mission, [scenario])
        self._errors, self.arm = errors.matrices[0], errors.arms[0]
        self._max_force = mission.deputy.max_force_n
        self._period, self._full = mission.control_period_s, mission.deputy.mass_kg
        self._mass = self._full
        self._commands: list[Floats] = []
        self._thrusts, self.twist = np.zeros(0), np.zeros(3)

    @property
    def delay(self) -> int:
        """Control periods from a command to its force."""
        return self._law.delay

    def fired(self, command: Floats, dcm: Floats) -> Floats:
        """Return the force fired in the control period of a command, N, Hill axes, shape (3,).

        The matrix `dcm` turns Hill axes to the body's. `twist` is set to the torque of a layout, N m, body.
        """
        self._commands.append(command)
        if len(self._commands) <= self._law.delay or self._mass <= self._law.dry * self._full:
            self._thrusts, self.twist = np.zeros(len(self._law.layout)), np.zeros(3)
            return np.zeros(3)
        errors = self._errors[min(len(self._commands), len(self._errors)) - 1]
        wanted = errors @ self._commands[-1 - self._law.delay]
        if len(self._law.layout):
            return self._divided(wanted, dcm)
        force = self.in_impulses(wanted)
        return np.asarray(np.clip(force, -self._max_force, self._max_force))

    def _divided(self, wanted: Floats, dcm: Floats) -> Floats:
        """Return the force of a layout of thrusters, Hill axes."""
        layout, body = self._law.layout, dcm @ wanted
        asked = self._law.table @ np.concatenate((np.maximum(body, 0.0), np.maximum(-body, 0.0)))
        self._thrusts = self.in_impulses(asked * min(1.0, *(layout[:, 6] / np.maximum(asked, 1e-300))))
        self.twist = self._thrusts @ layout[:, 3:6]
        return np.asarray(dcm.T @ (self._thrusts @ layout[:, :3]))

    def burnt(self, force: Floats) -> tuple[float, float, float]:
        """Consume a control period's propellant for the force fired last, Hill axes.

        Returns the sum of all thrusters' forces, N, the mean mass in the period, and that after it, kg.
        """
        total = float(np.abs(self._thrusts if len(self._law.layout) else force).sum())
        before = self._mass
        self._mass = before - total * self._period / self._law.exhaust_speed
        return total, 0.5 * (before + self._mass), self._mass

    def known(self, force: Floats) -> Floats:
        """Return the force that the deputy expects of a command; it does not know a layout's thrusters."""
        return force if len(self._law.layout) else self.in_impulses(force)

    def in_impulses(self, force: Floats) -> Floats:
        """Return a force in whole impulses, zero below the least."""
        if self._law.step > 0.0:
            force = np.rint(force / self._law.step) * self._law.step
        return np.where(np.abs(force) >= self._law.least, force, 0.0)
