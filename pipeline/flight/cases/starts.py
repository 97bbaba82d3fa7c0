"""Starts of flights as arrays, and how each flight differs from the deputy's model of it."""

from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from pipeline.array_types import Floats
from pipeline.flight.cases.actuators import firing_of
from pipeline.flight.cases.navigation import fixes_of
from pipeline.flight.cases.processes import drag_in_time
from pipeline.flight.state.arrays import CASE
from pipeline.flight.state.errors import Firing, Fixes, ModelErrors, NavigationErrors, ThrustErrors
from pipeline.flight.state.log import Scenario
from pipeline.physics.orbit import Course
from pipeline.settings.experiment import Mission

StartRows = np.recarray[Any, Any]  # an array of `CASE`


@dataclass(frozen=True)
class Cases:
    """Some starts in a mission, m of them."""

    starts: StartRows
    fixes: Fixes
    firing: Firing
    drag: Floats  # see `pipeline.flight.cases.processes.drag_in_time`

    def __len__(self) -> int:
        """Return the number of starts."""
        return len(self.starts)

    def repeated(self, times: int) -> "Cases":
        """Return the cases with every start repeated `times` times in a row, with the same errors."""
        each = partial(np.repeat, repeats=times, axis=0)
        return Cases(
            each(self.starts).view(np.recarray),
            self.fixes._replace(errors=NavigationErrors(*map(each, self.fixes.errors))),
            self.firing._replace(errors=ThrustErrors(*map(each, self.firing.errors))),
            each(self.drag),
        )

    def model_errors(self, course: Course) -> ModelErrors | None:
        """Return how the flights differ from the deputies' model of them; None if they do not."""
        if not (self.fixes.is_on or self.firing.is_on or course.is_on):
            return None
        return ModelErrors(self.fixes, self.firing, course._replace(varying=self.drag))


def starts_of(scenarios: list[Scenario]) -> StartRows:
    """Return starts as an array, shape (m,)."""
    rows = [
        (scenario.position_m, scenario.velocity_m_s, scenario.sun_angle_rad, scenario.sun_elevation_rad)
        for scenario in scenarios
    ]
    return np.array(rows, CASE).view(np.recarray)


def cases_of(mission: Mission, scenarios: list[Scenario]) -> Cases:
    """Prepare starts to be flown in a mission."""
    fixes, firing = fixes_of(mission, scenarios), firing_of(mission, scenarios)
    return Cases(starts_of(scenarios), fixes, firing, drag_in_time(mission, scenarios))
