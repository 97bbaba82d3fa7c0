"""The route that tracking controllers follow where the ring shows too little: a few burns that see enough.

The ring ignores shadow, incidence and range. The route takes them into account; it is planned once, at the
start, by the search for minimum-fuel plans (`pipeline.optimum`), as a few burns after which, by Clohessy and
Wiltshire's equations and the world's law of sight, free motion shows enough for a success.
"""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from pipeline.array_types import Floats
from pipeline.flight.cases.navigation import as_believed
from pipeline.flight.state.log import Scenario, points_needed
from pipeline.flight.world.pack import pack_world
from pipeline.optimum.plan import descend, total
from pipeline.optimum.problem import check_light, problem_of
from pipeline.optimum.search import search
from pipeline.physics.motion import free_path
from pipeline.settings.experiment import Mission

#: numbers of burns to search with; the cheapest plan is taken
BURNS = (2, 3)
#: margins, as no controller follows a route exactly: extra points beyond those of a success, and degrees by
#: which the incidence of a point must be below the camera's limit
SPARE_POINTS, SPARE_DEG = 2, 4.0


class Route(NamedTuple):
    """The route of a flight of K control periods.

    Attributes
    ----------
    forces : (K, 3)
        N, Hill axes.
    states : (K + 1 + beyond, 6)
        m and m/s, Hill axes.
    """

    forces: Floats
    states: Floats


class Routes:
    """Plans the route of each start of a mission.

    Parameters
    ----------
    mission : Mission
    beyond : int
        Control periods of free motion appended after the flight's end.

    Raises
    ------
    SettingError
        If minimum-fuel routes are not available for its light.
    """

    def __init__(self, mission: Mission, beyond: int = 0) -> None:
        check_light(mission)
        self.mission, self.beyond = mission, beyond
        self._known: dict[tuple[object, ...], Route] = {}

    def __call__(self, scenario: Scenario) -> Route:
        """Return the route from a start."""
        place = (*scenario.position_m.tolist(), *scenario.velocity_m_s.tolist())
        start = (place, scenario.sun_angle_rad, scenario.sun_elevation_rad, scenario.noise)
        if start not in self._known:
            self._known[start] = self._plan(scenario)
        return self._known[start]

    def _plan(self, scenario: Scenario) -> Route:
        """Search for a route and follow it from the start."""
        mission, (start,) = as_believed(self.mission, [scenario])
        angle = max(mission.sensor.max_incidence_deg - SPARE_DEG, 0.0)
        problem = problem_of(replace(mission, sensor=replace(mission.sensor, max_incidence_deg=angle)), start)
        inspectable = int(problem.is_lit.any(axis=0).sum())
        needed = points_needed(inspectable, mission.inspection_threshold_percent) + SPARE_POINTS
        needed = min(needed, inspectable)
        drafts = [
            descend(problem, search(problem, needed, burns, np.random.default_rng(burns)), needed)
            for burns in BURNS
        ]
        forces = min(drafts, key=total).forces
        motion = pack_world(mission).motion
        states = np.empty((len(forces) + 1 + self.beyond, 6))
        states[0] = np.r_[start.position_m, start.velocity_m_s]
        for k, force in enumerate(forces):
            states[k + 1] = motion.transition[0] @ states[k] + motion.control[0] @ force
        states[len(forces) :] = free_path(motion, states[len(forces)], self.beyond + 1)
        return Route(forces, states)
