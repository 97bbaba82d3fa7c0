"""Which planner a kind of controller has."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from pipeline.controllers.planned.lqr import LqrPlanner
from pipeline.controllers.planned.natural_motion import NaturalMotionPlanner
from pipeline.controllers.planned.receding_horizon import RecedingHorizonPlanner
from pipeline.flight.log import Scenario
from pipeline.settings.controllers import Lqr, NaturalMotion, Planned
from pipeline.settings.experiment import Mission

Planner = Callable[[Scenario], NDArray[np.float64]]


def planner_of(settings: Planned, mission: Mission) -> Planner:
    """Return the planner of the forces for each start of a mission.

    Raises
    ------
    SettingError
        If the settings do not fit the mission.
    """
    if isinstance(settings, NaturalMotion):
        return NaturalMotionPlanner(settings, mission)
    if isinstance(settings, Lqr):
        return LqrPlanner(settings, mission)
    return RecedingHorizonPlanner(settings, mission)
