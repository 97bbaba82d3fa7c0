"""Drag that varies within a flight, as the difference from the constant drag of the course."""

from dataclasses import replace

import numpy as np

from pipeline.array_types import Floats
from pipeline.flight.cases.processes import in_time, varies
from pipeline.flight.state.log import Scenario
from pipeline.flight.world.course import chief_course
from pipeline.settings.experiment import Mission

KEY = "dynamics.drag_m_s2"


def drag_in_time(mission: Mission, scenarios: list[Scenario]) -> Floats:
    """Return the difference from constant drag on the deputies in each control period.

    Returns
    -------
    (m, K, 3) array
        m/s^2, Hill axes, along which it is held; no rows where drag is constant.
    """
    if not varies(mission, KEY):
        return np.zeros((0, 0, 3))
    constant = mission.dynamics.drag_m_s2
    more = [in_time(mission, KEY, scenario, constant)[:-1] - constant for scenario in scenarios]
    with_drag, without = (
        chief_course(replace(mission, dynamics=replace(mission.dynamics, drag_m_s2=drag)))
        for drag in (1.0, 0.0)
    )
    middles = slice(with_drag.num_steps, None, 2 * with_drag.num_steps)
    pushes = with_drag.common[middles] - without.common[middles]
    pushes_h = np.einsum("kij,kj->ki", with_drag.axes[middles], pushes)
    return np.asarray(np.array(more) * pushes_h)
