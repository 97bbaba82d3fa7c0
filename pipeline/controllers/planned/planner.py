"""Which controller a kind that is computed, and not written out, has.

Planners and regulators are imported when they are asked for: two of them need scipy, which takes longer to
import than a flight takes.
"""

from pipeline.flight.controller import Controller
from pipeline.settings.controllers import Lqr, NaturalMotion, Planned
from pipeline.settings.experiment import Mission


def controller_of_kind(kind: str, settings: Planned, mission: Mission) -> Controller:
    """Return the controller of a kind, named after it.

    Raises
    ------
    SettingError
        If the settings do not fit the mission.
    """
    if isinstance(settings, Lqr):
        from pipeline.controllers.planned.lqr import LqrRegulator  # noqa: PLC0415

        return Controller(kind, (), "hill", regulator=LqrRegulator(settings, mission))
    if isinstance(settings, NaturalMotion):
        from pipeline.controllers.planned.natural_motion import NaturalMotionPlanner  # noqa: PLC0415

        return Controller(kind, (), "hill", planner=NaturalMotionPlanner(settings, mission))
    from pipeline.controllers.planned.receding_horizon import RecedingHorizonPlanner  # noqa: PLC0415

    return Controller(kind, (), "hill", planner=RecedingHorizonPlanner(settings, mission))
