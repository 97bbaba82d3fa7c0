"""The paths that tracking controllers follow: a ring of free motion, or a route where it shows too little.

*Elements of free motion.* Without force the deputy moves by ``x = x_c + X``, ``y = y_c + 2 Y`` with
``X = -3 x - 2 y'/n`` and ``Y = x'/n`` (Clohessy and Wiltshire, J. Aerospace Sci. 27, 1960): on an ellipse,
twice as long along the track as it is high, about a centre. The pairs ``(X, Y)`` and ``(z, z'/n)`` turn at
-n, as the Sun does; ``x_c`` stays, and ``y_c`` drifts at ``-1.5 n x_c``.

*The ring* is an ellipse of free motion that follows the Sun. Both turn at the same rate, so that a deputy on
the ring stays in phase with the Sun without force. Across the orbit plane the deputy keeps its own
oscillation, limited in amplitude, because from high above one pole the other is out of sight for long; a lead
brings it to the other side sooner.

*The route* takes shadow, incidence and range into account, which the ring ignores. It is planned once, at the
start, by the search for minimum-fuel plans (`pipeline.optimum`), as a few burns after which, by Clohessy and
Wiltshire's equations or along the chief's true course, and by the world's law of sight, free motion shows
enough for a success.
"""

import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from pipeline.array_types import Floats
from pipeline.flight.cases.navigation import as_believed
from pipeline.flight.state.log import Scenario, points_needed
from pipeline.flight.world.chief import predicted_motion
from pipeline.flight.world.pack import pack_world
from pipeline.optimum.plan import descend, total
from pipeline.optimum.problem import check_light, problem_of
from pipeline.optimum.search import search
from pipeline.physics.motion import free_path
from pipeline.settings.controllers import Ring
from pipeline.settings.experiment import Mission, SettingError
from pipeline.settings.relations import MOST_CIRCULAR

#: indices of the elements
CENTRE_RADIAL, CENTRE_ALONG_TRACK, RING_RADIAL, RING_ALONG_TRACK, HEIGHT, HEIGHT_RATE = range(6)


def elements_matrix(mean_motion: float) -> Floats:
    """Return the matrix from states to elements ``x_c, y_c, X, Y, z, z'/n``, all in m, shape (6, 6)."""
    n = mean_motion
    return np.array(
        [
            [4.0, 0.0, 0.0, 0.0, 2.0 / n, 0.0],
            [0.0, 1.0, 0.0, -2.0 / n, 0.0, 0.0],
            [-3.0, 0.0, 0.0, 0.0, -2.0 / n, 0.0],
            [0.0, 0.0, 0.0, 1.0 / n, 0.0, 0.0],
            [0.0, 0.0, 1.0, 0.0, 0.0, 0.0],
            [0.0, 0.0, 0.0, 0.0, 0.0, 1.0 / n],
        ]
    )


def check_circle(what: str, cure: str, mission: Mission) -> None:
    """Raise SettingError on an eccentric course for a path that is closed about a circle alone.

    Raises
    ------
    SettingError
    """
    eccentricity = mission.orbit.elements.eccentricity
    if mission.has_true_course and eccentricity > MOST_CIRCULAR:
        raise SettingError(
            f"orbit.eccentricity is {eccentricity:g}, and {what} is an ellipse of free motion that closes "
            f"about a circle alone, up to {MOST_CIRCULAR:g}; {cure}, or set orbit.course=uniform to take the "
            "orbit as a circle"
        )


def check_ring(ring: Ring, mission: Mission) -> None:
    """Raise SettingError for a ring that leaves the distance limits, or that the orbit does not close.

    Raises
    ------
    SettingError
    """
    check_circle("controller.follows=ring", "set controller.follows=route", mission)
    deputy = mission.deputy
    farthest = math.hypot(2.0 * ring.ring_size_m, ring.max_height_m)
    if not (deputy.min_distance_m <= ring.ring_size_m and farthest <= deputy.max_distance_m):
        raise SettingError(
            f"controller.ring_size_m is {ring.ring_size_m:g} and controller.max_height_m "
            f"{ring.max_height_m:g}, a ring from {ring.ring_size_m:g} to {farthest:.4g} m from the chief; "
            f"it must stay within deputy.min_distance_m={deputy.min_distance_m:g} and deputy.max_distance_m="
            f"{deputy.max_distance_m:g} (m): choose another size or less height"
        )


def ring_elements(ring: Ring, scenario: Scenario, angles: Floats) -> Floats:
    """Return the elements of free motion on the ring.

    Parameters
    ----------
    ring : Ring
    scenario : Scenario
        Gives the Sun that the ring follows, and the oscillation that it keeps.
    angles : (n,)
        By which the Sun has turned, mean motion times time, rad.

    Returns
    -------
    (n, 6) array
        ``x_c, y_c, X, Y, z, z'/n`` in m.
    """
    phase = scenario.sun_angle_rad - ring.ring_lead_rad - angles
    amplitude = np.clip(scenario.position_m[2], -ring.max_height_m, ring.max_height_m)
    centre = np.zeros((2, len(angles)))
    swing = angles + ring.height_lead_rad
    in_plane = ring.ring_size_m * np.array([np.cos(phase), np.sin(phase)])
    return np.column_stack([*centre, *in_plane, amplitude * np.cos(swing), -amplitude * np.sin(swing)])


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
        state = (*scenario.position_m.tolist(), *scenario.velocity_m_s.tolist())
        start = (state, scenario.sun_angle_rad, scenario.sun_elevation_rad, scenario.noise)
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
        if problem.is_on_course:
            _, course = predicted_motion(mission, self.beyond * mission.control_period_s)
            held = np.concatenate([forces, np.zeros((self.beyond, 3))])
            for k, force in enumerate(held):
                states[k + 1] = course.steps[k] @ states[k] + course.pushes[k] @ force
            return Route(forces, states)
        for k, force in enumerate(forces):
            states[k + 1] = motion.transition[0] @ states[k] + motion.control[0] @ force
        states[len(forces) :] = free_path(motion, states[len(forces)], self.beyond + 1)
        return Route(forces, states)
