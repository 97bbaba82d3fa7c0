"""The route: free motion but for a few burns, which shows enough in light and to a camera with limits."""

import numpy as np
import pytest

from pipeline.controllers.planned.natural_motion import count_seen
from pipeline.controllers.planned.paths import SPARE_POINTS, Route, Routes
from pipeline.controllers.source import load
from pipeline.flight.fly.simulation import fly_logged
from pipeline.flight.state.log import points_needed
from pipeline.flight.world.pack import pack_world
from tests.pipeline.controllers.planned.cases import composed, discrete, planner, starts

WORLD = ("world=leo", "navigation=perfect", "actuators=ideal", "dynamics=cw", "controller.follows=route")
MISSION, STARTS = starts("lqr", *WORLD)
START = STARTS[0]


@pytest.fixture(scope="module")
def route() -> Route:
    return Routes(MISSION, 40)(START)


@pytest.mark.slow
def test_it_follows_from_its_few_burns(route: Route) -> None:
    transition, control = discrete()
    forces, states = route
    assert len(states) == len(forces) + 41 == MISSION.num_controls + 41
    np.testing.assert_array_equal(states[0], np.r_[START.position_m, START.velocity_m_s])
    held = np.vstack([forces, np.zeros((40, 3))])
    np.testing.assert_allclose(states[1:], states[:-1] @ transition.T + held @ control.T, atol=1e-9)
    assert 0 < np.count_nonzero(forces.any(axis=1)) < 20
    distances = np.linalg.norm(states[: len(forces) + 1, :3], axis=1)
    assert distances.min() >= 15.0
    assert distances.max() <= 200.0


@pytest.mark.slow
def test_it_shows_what_makes_a_success_and_more(route: Route) -> None:
    path = route.states[: MISSION.num_controls + 1, :3]
    log = fly_logged(MISSION, load(composed("lqr", *WORLD).experiment.controller, MISSION), START)
    needed = points_needed(int(log.is_inspectable.sum()), 95.0)
    # a camera that is on the chief from the start sees a little more than one that has to turn to it
    assert count_seen(pack_world(MISSION), START, path[np.newaxis])[0] >= needed + SPARE_POINTS
    # nothing is unknown here, so that the regulator has nothing to answer
    np.testing.assert_allclose(log.position_m, path, atol=1e-6)
    np.testing.assert_allclose(log.force_hill_n, route.forces, atol=1e-9)


@pytest.mark.slow
def test_the_receding_horizon_ends_on_it(route: Route) -> None:
    plan_for = planner("receding_horizon", *WORLD)
    beyond = plan_for.routes(START).states
    np.testing.assert_allclose(plan_for.elements @ beyond[300], plan_for.wanted(START, 300), atol=1e-12)
    np.testing.assert_array_equal(beyond[: len(route.states)], route.states[: len(beyond)])
