"""The linear programs: least fuel where it is known, arrival on the ring, and the limits on the way."""

from dataclasses import replace

import numpy as np
import pytest

from pipeline.controllers.planned.paths import elements_matrix
from pipeline.controllers.source import load, remembering
from pipeline.flight.fly.simulation import fly_all
from pipeline.settings.experiment import SettingError
from tests.pipeline.controllers.planned.cases import (
    MASS,
    MEAN_MOTION,
    PERIOD,
    composed,
    discrete,
    flown,
    planned_ahead,
    planner,
    starts,
)

MISSION, STARTS = starts("receding_horizon", "sun=random")


@pytest.fixture(scope="module")
def plans():
    plan_for = planner("receding_horizon", "sun=random")
    return plan_for, [planned_ahead(plan_for, start) for start in STARTS]


def ring_of(settings, start, k):
    """The elements of the ring at a sample: centre, phase to the Sun, height."""
    turned = MEAN_MOTION * PERIOD * k
    phase = start.sun_angle_rad - settings.ring_lead_rad - turned
    swing = turned + settings.height_lead_rad
    height = np.clip(start.position_m[2], -settings.max_height_m, settings.max_height_m)
    size = settings.ring_size_m
    return np.array(
        [0, 0, size * np.cos(phase), size * np.sin(phase), height * np.cos(swing), -height * np.sin(swing)]
    )


@pytest.mark.slow
def test_a_single_burn_is_found_where_it_is_the_least(plans):
    # to change the swing along k, a burn of size d at one time gives d/n in one direction; no sum of
    # several, that point in other directions, gives as much for less
    plan_for = planner("receding_horizon", height_tolerance_m=1e-6, centre_tolerance_m=1e-3)
    length = max(plan_for.horizons)
    horizon = plan_for.horizons[length]
    transition, control = discrete()
    state = np.array([80.0, 0.0, 5.0, 0.0, -2.0 * MEAN_MOTION * 80.0, 0.0])
    for place, force in ((0, 0.05), (len(horizon.periods) // 2, -0.08)):
        end = state
        for k in range(length):
            burn = np.array([0.0, 0.0, force if k == horizon.periods[place] else 0.0])
            end = transition @ end + control @ burn
        solved = plan_for.solve(horizon, state, elements_matrix(MEAN_MOTION) @ end)
        expected = np.zeros_like(solved)
        expected[place, 2] = force
        np.testing.assert_allclose(solved, expected, atol=1e-6)


def test_no_force_where_free_motion_is_enough(plans):
    plan_for, _ = plans
    start = STARTS[0]
    phase = start.sun_angle_rad - plan_for.settings.ring_lead_rad
    size = plan_for.settings.ring_size_m
    on_ring = replace(
        start,
        position_m=np.array([size * np.cos(phase), 2 * size * np.sin(phase), 0.0]),
        velocity_m_s=MEAN_MOTION * np.array([size * np.sin(phase), -2 * size * np.cos(phase), 0.0]),
    )
    assert not planned_ahead(plan_for, on_ring).any()


def test_a_solution_ends_on_the_ring_unless_the_limits_forbid(plans):
    plan_for, _ = plans
    num_there = 0
    settings, horizon = plan_for.settings, plan_for.horizons[max(plan_for.horizons)]
    length = len(horizon.path)
    for start in STARTS:
        wanted = ring_of(settings, start, length)
        forces = np.zeros((length, 3))
        forces[horizon.periods] = plan_for.solve(horizon, np.r_[start.position_m, 0.0, 0.0, 0.0], wanted)
        states = flown(start, forces, length + 1)
        off = np.abs(elements_matrix(MEAN_MOTION) @ states[-1] - wanted)
        distances = np.linalg.norm(states[1:, :3], axis=1)
        if (off <= plan_for.tolerances + 1e-6).all():
            num_there += 1
            # of least fuel: nothing is spent on the middle of the tolerances
            assert np.isclose(off, plan_for.tolerances, atol=1e-5).sum() >= 3
        else:
            assert distances.min() < plan_for.limits[0] + 1.0 or distances.max() > 190.0
    assert num_there >= 6


def test_it_comes_to_the_ring_and_stays(plans):
    plan_for, made = plans
    settings = plan_for.settings
    for start, plan in zip(STARTS, made, strict=True):
        assert np.abs(plan).max() <= 1.0
        elements = flown(start, plan) @ elements_matrix(MEAN_MOTION).T
        for k in (200, 300, 360):
            off = np.abs(elements[k] - ring_of(settings, start, k))
            assert off.max() < 25.0


@pytest.mark.slow
def test_it_keeps_the_limits_where_the_way_leads_past_them():
    plan_for = planner("receding_horizon", "sun=random", "monte_carlo.num_cases=30")
    _, many = starts("receding_horizon", "sun=random", "monte_carlo.num_cases=30")
    crossing = [
        s for s in many if np.cos(np.arctan2(s.position_m[1] / 2, s.position_m[0]) - s.sun_angle_rad) < -0.5
    ]
    assert len(crossing) > 4
    nearest = []
    for start in crossing:
        distances = np.linalg.norm(flown(start, planned_ahead(plan_for, start))[:, :3], axis=1)
        nearest.append(distances.min())
        assert distances.min() >= 15.0
        assert distances.max() <= 200.0
    assert min(nearest) < 30.0


def test_it_burns_less_than_the_regulator(plans):
    regulator = load(composed("lqr", "sun=random").experiment.controller, MISSION)
    regulated = fly_all(MISSION, regulator, STARTS, 1).delta_v_m_s
    spent = np.array([np.abs(plan).sum() * PERIOD / MASS for plan in plans[1]])
    assert spent.mean() < 0.9 * regulated.mean()
    assert max(spent.max(), regulated.max()) < 2.0


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"solution_period_s": 500.0}, "no solution may be flown beyond its horizon, and the first is"),
        ({"first_horizon_s": 300.0}, "controller.first_horizon_s 300; no solution"),
        ({"horizon_s": 0.0}, "controller.horizon_s is 0.0; it must be greater than 0"),
        ({"margin_m": -1.0}, "controller.margin_m is -1.0; it must be at least 0"),
    ],
)
def test_horizons_that_cannot_be(changes, message):
    with pytest.raises(SettingError, match=message):
        planner("receding_horizon", **changes)


@pytest.mark.slow
def test_under_several_layers_what_is_known_alike_is_planned_once() -> None:
    experiment = composed("receding_horizon", "sun=random").experiment
    alone = load(experiment.controller, experiment.mission)
    assert alone.planner is not None
    asked = []

    class Counting:
        decisions = alone.planner.decisions[:4]

        def __call__(self, scenario, decision, state):
            asked.append((decision, tuple(state)))
            return alone.planner(scenario, decision, state)

    both = remembering(replace(alone, planner=Counting()))
    guard = replace(experiment.mission.safety, kind="filter")
    guarded = replace(experiment.mission, safety=guard)
    flown_twice = [fly_all(mission, both, STARTS[:2], 1) for mission in (experiment.mission, guarded)]
    assert len(asked) == len(set(asked))
    assert 2 * len(Counting.decisions) <= len(asked) < 4 * len(Counting.decisions)
    again = replace(alone, planner=Counting())
    for mission, found in zip((experiment.mission, guarded), flown_twice, strict=True):
        expected = fly_all(mission, again, STARTS[:2], 1)
        np.testing.assert_array_equal(found.delta_v_m_s, expected.delta_v_m_s)
        np.testing.assert_array_equal(found.inspected_count, expected.inspected_count)


def test_where_no_solution_is_found_nothing_is_fired(plans):
    plan_for, _ = plans
    assert plan_for._least(np.ones((2, 3)), np.array([-1.0, np.nan])).tolist() == [0.0, 0.0, 0.0]
