"""Which planner a kind of controller has.

Planners are imported when they are asked for: two of them need scipy, which takes longer to import than a
flight takes.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

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
        from pipeline.controllers.planned.natural_motion import NaturalMotionPlanner  # noqa: PLC0415

        return NaturalMotionPlanner(settings, mission)
    if isinstance(settings, Lqr):
        from pipeline.controllers.planned.lqr import LqrPlanner  # noqa: PLC0415

        return LqrPlanner(settings, mission)
    from pipeline.controllers.planned.receding_horizon import RecedingHorizonPlanner  # noqa: PLC0415

    return RecedingHorizonPlanner(settings, mission)
