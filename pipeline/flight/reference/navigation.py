"""Navigation by fixes in matrices: the readable twin of `pipeline.flight.period.look.navigation`."""

import numpy as np
from numpy.typing import NDArray

from pipeline.flight.cases.navigation import Filter, errors_of, filter_of, measured
from pipeline.flight.period.look.navigation import WIDER
from pipeline.flight.state.log import Scenario
from pipeline.physics.motion import motion_over, propagate
from pipeline.physics.quaternion import dcm_b_from_h, normalised
from pipeline.settings.experiment import Mission

Floats = NDArray[np.float64]

#: a fix measures the position
SEEN = np.eye(3, 6)


class Navigator:
    """One deputy's estimate of its state.

    Parameters
    ----------
    mission : Mission
        Whose deputy navigates by fixes.
    scenario : Scenario
        Its start.
    """

    def __init__(self, mission: Mission, scenario: Scenario):
        self._law: Filter = filter_of(mission)
        self._motion = motion_over(mission.orbit, mission.deputy, (mission.control_period_s,))
        errors = errors_of(mission, [scenario])
        start = np.concatenate((scenario.position_m, scenario.velocity_m_s))
        self._of_fixes, self._of_sight, self._of_attitude = (
            errors.of_fixes[0],
            errors.of_sight[0],
            errors.of_attitude[0],
        )
        self._filtered: tuple[Floats, Floats] = (start + errors.at_start[0], self._law.at_start.copy())
        self._fixes: list[Floats] = []
        self._acting = np.zeros((mission.num_controls, 3))

    def estimate(self, k: int, position: Floats, quaternion: Floats) -> tuple[Floats, Floats]:
        """Return estimate and covariance at a sample, once its fix is measured."""
        law = self._law
        if k % law.stride == 0:
            which = k // law.stride
            seen = self._of_sight[which] if len(self._of_sight) else None
            tilt_h = dcm_b_from_h(quaternion).T @ self._tilt(k)
            self._fixes.append(measured(position, self._of_fixes[which], seen, tilt_h))
        filtered_to = k - law.delay
        if filtered_to > 0:
            self._filtered = self._moved(*self._filtered, filtered_to - 1)
        if filtered_to >= 0 and filtered_to % law.stride == 0:
            self._filtered = self._corrected(*self._filtered, self._fixes[filtered_to // law.stride])
        known = self._filtered
        for period in range(max(filtered_to, 0), k):
            known = self._moved(*known, period)
        return known

    def turn(self, k: int) -> Floats:
        """Return the turn from the true attitude to the one sensed in a control period, shape (4,)."""
        return normalised(np.append(0.5 * self._tilt(k), 1.0))

    def _tilt(self, k: int) -> Floats:
        return np.asarray(self._of_attitude[k]) if len(self._of_attitude) else np.zeros(3)

    def note(self, k: int, delay: int, force: Floats) -> None:
        """Store the command of a sample for the control period in which it acts."""
        if k + delay < len(self._acting):
            self._acting[k + delay] = force

    def _moved(self, state: Floats, covariance: Floats, period: int) -> tuple[Floats, Floats]:
        force, phi = self._acting[period], self._motion.transition[0]
        noise = self._law.process + self._law.process_per_force * (force @ force)
        return propagate(self._motion, state, force), phi @ covariance @ phi.T + noise

    def _corrected(self, state: Floats, covariance: Floats, fix: Floats) -> tuple[Floats, Floats]:
        place = SEEN @ state
        difference = fix - place
        along = np.outer(place, place) / (place @ place)
        across = self._law.bearing * (place @ place) * (np.eye(3) - along)
        spread = SEEN @ covariance @ SEEN.T + self._law.fix * np.eye(3) + self._law.range * along + across
        if difference @ np.linalg.solve(spread, difference) > self._law.gate:
            return state, WIDER * covariance
        gain = covariance @ SEEN.T @ np.linalg.inv(spread)
        return state + gain @ difference, covariance - gain @ SEEN @ covariance
