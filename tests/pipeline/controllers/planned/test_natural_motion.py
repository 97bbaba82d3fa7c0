"""One burn onto an ellipse: it closes, goes around the chief, keeps the limits and sees what was foretold."""

from dataclasses import replace

import numpy as np
import pytest

from pipeline.controllers.planned.natural_motion import count_seen
from pipeline.flight.control.controller import open_loop
from pipeline.flight.fly.simulation import fly_all
from pipeline.flight.reference.motion import transition
from pipeline.flight.world.pack import pack_world
from tests.pipeline.controllers.planned import cases
from tests.pipeline.controllers.planned.cases import MEAN_MOTION, flown

REVOLUTION_S = 2.0 * np.pi / MEAN_MOTION
MISSION, STARTS = cases.starts("natural_motion", "sun=random")
#: also one in motion
STARTS = [*STARTS, replace(STARTS[0], velocity_m_s=np.array([0.03, -0.02, 0.01]))]

#: nothing, and a newton along j
UNITS_Y = np.zeros((1, 3)), np.array([[0.0, 1.0, 0.0]])


def centre_height(state):
    """Where a closed ellipse has its centre, m: zero if it is closed."""
    return 4.0 * state[0] + 2.0 * state[4] / MEAN_MOTION


@pytest.fixture(scope="module")
def plans():
    plan_for = cases.planner("natural_motion", "sun=random")
    return [cases.planned_ahead(plan_for, start, 1) for start in STARTS]


def test_after_one_burn_the_ellipse_closes_around_the_chief_within_the_limits(plans):
    times = np.linspace(0.0, REVOLUTION_S, 400)
    for start, plan in zip(STARTS, plans, strict=True):
        assert plan.shape == (1, 3)
        assert np.abs(plan).max() <= 1.0
        assert np.abs(plan).sum() * cases.PERIOD / cases.MASS < 0.5
        path = np.array([transition(MEAN_MOTION, time)[0] @ flown(start, plan, 2)[1] for time in times])
        np.testing.assert_allclose(path[-1], path[0], atol=1e-5)
        distances = np.linalg.norm(path[:, :3], axis=1)
        assert distances.min() > 19.0
        assert distances.max() < 196.0
        # it passes all four quarters of the orbit plane
        assert len(set(zip(path[:, 0] > 0, path[:, 1] > 0, strict=True))) == 4


@pytest.mark.slow
def test_no_closed_burn_nearby_does_as_well_for_less(plans):
    world = pack_world(MISSION)
    generator = np.random.default_rng(4)
    for start, plan in zip(STARTS[:3], plans[:3], strict=True):
        spent = np.abs(plan).sum()
        required = min(97, count_seen(world, start, flown(start, plan)[np.newaxis, :, :3])[0])
        better = 0
        for _ in range(60):
            burn = plan[0] + generator.normal(0.0, 0.02, 3)
            # along j what closes it: the height of the centre, 4 x + 2 y'/n, is linear in the force
            before, after = (centre_height(flown(start, burn[np.newaxis] + extra, 2)[1]) for extra in UNITS_Y)
            burn[1] -= before / (after - before)
            path = flown(start, burn[np.newaxis], 569)[:, :3]
            distances = np.linalg.norm(path[1:], axis=1)
            if np.abs(burn).sum() < spent - 1e-3 and distances.min() > 20.0 and distances.max() < 195.0:
                better += count_seen(world, start, path[np.newaxis, :361])[0] >= required
        assert better == 0


STRANGE = ("light=shadow", "sensor.max_incidence_deg=70", "sensor.max_range_m=120", "chief.shape=mesh")
WORLDS = [("sun=fixed",), ("sun=random",), ("chief=tumbling",)]
WORLDS += [pytest.param(("chief=tumbling", *STRANGE), marks=pytest.mark.slow)]


@pytest.mark.parametrize("world", WORLDS)
def test_what_is_foretold_is_what_a_camera_on_the_chief_inspects(world):
    mission, scenarios = cases.starts("natural_motion", *world, "attitude=ideal")
    plan_for = None if "chief=tumbling" in world else cases.planner("natural_motion", *world)
    for start in scenarios[:2]:
        plan = cases.planned_ahead(plan_for, start, 1) if plan_for else np.zeros((0, 3))
        foreseen = count_seen(pack_world(mission), start, flown(start, plan)[np.newaxis, :, :3])[0]
        assert fly_all(mission, open_loop("plan", plan), [start], workers=1).inspected_count[0] == foreseen


def test_fewer_points_asked_for_cost_less():
    few, many = (cases.planner("natural_motion", points=points) for points in (40, 97))
    plans = [[cases.planned_ahead(plan_for, start, 1) for start in STARTS] for plan_for in (few, many)]
    spent = np.abs(np.array(plans)).sum(axis=(2, 3))
    assert (spent[0] <= spent[1] + 1e-9).all()
    assert spent[0].mean() < 0.9 * spent[1].mean()
