"""Starts as compiled flights read them, with their errors of navigation and thrusters."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fis_tools.compiled.vectors import make_rows
from fis_tools.engines.kernel import LANES
from pipeline.flight.cases.actuators import (
    NO_ERRORS,
    NO_THRUSTERS,
    ThrustErrors,
    Thrusters,
    thrust_errors,
    thrusters_of,
)
from pipeline.flight.cases.drag import drag_in_time
from pipeline.flight.cases.navigation import ALWAYS_RIGHT, NO_FILTER, Errors, Filter, errors_of, filter_of
from pipeline.flight.state.arrays import CASE
from pipeline.flight.state.errors import ESTIMATED, THRUSTING, Firing, Fixes, ModelErrors
from pipeline.flight.state.log import Scenario
from pipeline.physics.orbit import Course
from pipeline.settings.experiment import Mission

Floats = NDArray[np.float64]
#: an array of `CASE`
Starts = np.recarray[Any, Any]


@dataclass(frozen=True)
class Cases:
    """Some starts in a mission.

    Parameters
    ----------
    starts : (m,) array of `CASE`
    num_controls : int
        Control periods of a flight.
    navigation : (Filter, Errors), optional
        None where the deputy knows its state.
    thrusters : (Thrusters, ThrustErrors), optional
        None for ideal thrusters.
    drag : (m, K, 3) array
        As in `pipeline.flight.cases.drag.drag_in_time`.
    """

    starts: Starts
    num_controls: int
    navigation: tuple[Filter, Errors] | None
    thrusters: tuple[Thrusters, ThrustErrors] | None
    drag: Floats

    def __len__(self) -> int:
        """Return the number of starts."""
        return len(self.starts)

    def repeated(self, times: int) -> "Cases":
        """Return the cases with every start repeated `times` times in a row, with the same errors."""

        def each(values: NDArray[Any]) -> NDArray[Any]:
            return np.repeat(values, times, axis=0)

        navigation, thrusters = self.navigation, self.thrusters
        return replace(
            self,
            starts=each(self.starts).view(np.recarray),
            navigation=navigation and (navigation[0], Errors(*map(each, navigation[1]))),
            thrusters=thrusters and (thrusters[0], ThrustErrors(*map(each, thrusters[1]))),
            drag=each(self.drag),
        )

    def model_errors(self, course: Course, lanes: int = LANES) -> ModelErrors | None:
        """Return the model_errors that one thread flies, `lanes` flights side by side; None without any."""
        if self.navigation is None and self.thrusters is None and not course.is_on:
            return None
        return ModelErrors(self._fixes(lanes), self._firing(lanes), course._replace(varying=self.drag))

    def _fixes(self, lanes: int) -> Fixes:
        law, errors = self.navigation or (NO_FILTER, ALWAYS_RIGHT)
        return Fixes(
            self.navigation is not None,
            *law,
            *errors,
            lanes=make_rows(ESTIMATED, lanes)[0],
            fixes=np.zeros((errors.of_fixes.shape[1], 3, lanes)),
            acting=np.zeros((self.num_controls, 3, lanes)),
        )

    def _firing(self, lanes: int) -> Firing:
        law, errors = self.thrusters or (NO_THRUSTERS, NO_ERRORS)
        commands = np.zeros((self.num_controls, 3, lanes))
        return Firing(
            self.thrusters is not None,
            *law,
            *errors,
            commands,
            make_rows(THRUSTING, lanes)[0],
            thrust=np.zeros((len(law.table), lanes)),
        )


def starts_of(scenarios: list[Scenario]) -> Starts:
    """Return starts as an array, shape (m,)."""
    starts = np.empty(len(scenarios), CASE)
    if scenarios:
        starts["position"] = np.array([scenario.position_m for scenario in scenarios])
        starts["velocity"] = np.array([scenario.velocity_m_s for scenario in scenarios])
        starts["sun_angle"] = [scenario.sun_angle_rad for scenario in scenarios]
        starts["sun_elevation"] = [scenario.sun_elevation_rad for scenario in scenarios]
    return starts.view(np.recarray)


def cases_of(mission: Mission, scenarios: list[Scenario]) -> Cases:
    """Prepare starts to be flown in a mission."""
    navigation, thrusters = None, None
    if mission.navigation.mode == "fixes":
        law = filter_of(mission)
        navigation = law, errors_of(mission, scenarios)
    if mission.actuators.kind == "real":
        thrusters = thrusters_of(mission), thrust_errors(mission, scenarios)
    drag = drag_in_time(mission, scenarios)
    return Cases(starts_of(scenarios), mission.num_controls, navigation, thrusters, drag)
