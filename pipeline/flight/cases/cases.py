"""Starts as compiled flights read them, with their errors of navigation and thrusters."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.array_types import Floats
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
from pipeline.flight.state.errors import Firing, Fixes, ModelErrors
from pipeline.flight.state.log import Scenario
from pipeline.physics.orbit import Course
from pipeline.settings.experiment import Mission

#: an array of `CASE`
Starts = np.recarray[Any, Any]


@dataclass(frozen=True)
class Cases:
    """Some starts in a mission.

    Parameters
    ----------
    starts : (m,) array of `CASE`
    navigation : (Filter, Errors), optional
        None where the deputy knows its state.
    thrusters : (Thrusters, ThrustErrors), optional
        None for ideal thrusters.
    drag : (m, K, 3) array
        As in `pipeline.flight.cases.drag.drag_in_time`.
    """

    starts: Starts
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

    def model_errors(self, course: Course) -> ModelErrors | None:
        """Return how the flights differ from the deputies' model of them; None if they do not."""
        if self.navigation is None and self.thrusters is None and not course.is_on:
            return None
        law, errors = self.navigation or (NO_FILTER, ALWAYS_RIGHT)
        thrusters, of_thrust = self.thrusters or (NO_THRUSTERS, NO_ERRORS)
        return ModelErrors(
            Fixes(self.navigation is not None, *law, *errors),
            Firing(self.thrusters is not None, *thrusters, *of_thrust),
            course._replace(varying=self.drag),
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
    return Cases(starts_of(scenarios), navigation, thrusters, drag)
