"""The safety layer's way out: one push onto a closed ellipse is left after whatever a controller asks for."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from fis_tools.compiled.three import Three
from pipeline.command_line.config import compose_experiment
from pipeline.controllers import source
from pipeline.evaluation.assurance.open_starts import start_without_way_out
from pipeline.flight.control.controller import open_loop
from pipeline.flight.fly.simulation import fly_all, fly_logged
from pipeline.flight.period.act.safety import free_state
from pipeline.flight.period.act.way_out import is_open, spare_at, way_out
from pipeline.flight.reference.motion import pushed
from pipeline.flight.state.log import WAY_OUT
from pipeline.flight.world.bounds import bounds_of
from pipeline.flight.world.pack import pack_world
from pipeline.onboard.allowed import NotTranslatableError
from pipeline.onboard.program import translate
from pipeline.scenarios import evaluation_scenarios
from pipeline.settings.experiment import SettingError
from tests import night
from tests.pipeline.flight.as_written import assert_as_written
from tests.pipeline.flight.cases import isotropic
from tests.pipeline.flight.guarded import LAST_MOMENT, SPHERES, guarded, hostile, pushing, starts_at_rest
from tests.pipeline.flight.missions import MEAN_MOTION

KEPT = guarded(replace(LAST_MOMENT, keep_way_out=True))
#: a low orbit without errors
LEO = "world=leo", "navigation=perfect", "actuators=ideal", "dynamics=cw"
ORBIT_S = 2.0 * np.pi / MEAN_MOTION
#: of starts, each of which is looked at along a whole ellipse
COUNT = night.count(100, 300)

HOSTILE = hostile(
    23,
    radially=np.tile([1.0, 0.0, 0.0], (360, 1)),
    along_the_track=np.tile([0.0, 1.0, 0.0], (360, 1)),
    across_the_track=np.tile([0.0, 0.0, -1.0], (360, 1)),
    at_the_end=np.repeat([[0.0] * 3, [-1.0, 1.0, 1.0]], [330, 30], axis=0),
) | {"slowly towards the chief": pushing(-0.01)}


def flying(state):
    return Three(*state[:3].tolist()), Three(*state[3:].tolist())


def has_way_out(mission, state):
    return is_open(pack_world(mission), 0, flying(np.asarray(state, dtype=np.float64)), 0.0)


@cache
def starts():
    """Starts at rest anywhere between the spheres that have a way out."""
    drawn = starts_at_rest(40, 5)
    kept = [start for start in drawn if has_way_out(KEPT, np.r_[start.position_m, np.zeros(3)])]
    assert len(kept) >= 16
    return kept[:16]


def coasted(state, seconds):
    """Distances of free motion by Clohessy and Wiltshire's equations, as SciPy integrates them."""

    def rates(_, s):
        n = MEAN_MOTION
        x, _, z, u, v, w = s
        return [u, v, w, 3.0 * n * n * x + 2.0 * n * v, -2.0 * n * u, -n * n * z]

    times = np.linspace(0.0, seconds, 600)
    path = solve_ivp(rates, (0.0, seconds), state, "DOP853", times, rtol=1e-11, atol=1e-10).y
    return np.linalg.norm(path[:3], axis=0)


@pytest.mark.parametrize("name", HOSTILE)
def test_whatever_is_asked_for_flights_stay_for_orbits_after_their_end(name):
    outcomes = fly_all(KEPT, HOSTILE[name], starts(), 1)
    assert not outcomes.is_violated.any()
    assert outcomes.min_distance_m.min() >= SPHERES[0]
    assert outcomes.max_distance_m.max() <= SPHERES[1]
    for start in starts()[:3]:
        log = fly_logged(KEPT, HOSTILE[name], start)
        after = coasted(np.r_[log.position_m[-1], log.velocity_m_s[-1]], 3.0 * ORBIT_S)
        assert SPHERES[0] <= after.min()
        assert after.max() <= SPHERES[1]


@pytest.mark.parametrize("name", ["away from the chief", "long pushes"])
def test_each_sample_has_a_way_out_and_the_last_needs_none(name):
    log, world = fly_logged(KEPT, HOSTILE[name], starts()[0]), pack_world(KEPT)
    states = np.hstack([log.position_m, log.velocity_m_s])
    for k in range(0, KEPT.num_controls, 20):
        free = free_state(world, k, flying(states[k]))
        is_left, force = way_out(world, k, free, spare_at(world, k), np.inf, False)
        assert is_left
        assert max(map(abs, force)) <= KEPT.braking_force_n
        after = coasted(pushed(KEPT, states[k], np.array(force), KEPT.control_period_s), ORBIT_S)
        assert SPHERES[0] <= after.min() <= after.max() <= SPHERES[1]
    assert (log.safety_limit == WAY_OUT).any()
    assert np.abs(log.force_hill_n).max() <= KEPT.deputy.max_force_n
    height = 4.0 * states[-1, 0] + 2.0 * states[-1, 4] / MEAN_MOTION
    assert height == pytest.approx(0.0, abs=1e-6)


def test_without_it_they_are_lost():
    for name in ("away from the chief", "weak noise", "not at all"):
        log = fly_logged(guarded(LAST_MOMENT), HOSTILE[name], starts()[0])
        after = coasted(np.r_[log.position_m[-1], log.velocity_m_s[-1]], ORBIT_S)
        assert not SPHERES[0] <= after.min() <= after.max() <= SPHERES[1]


def experiment(*words):
    kept = "safety=filter", "safety.keep_way_out=true", "sun=random", "monte_carlo.num_cases=12"
    return compose_experiment(["+experiment=evaluate", "controller=champion_27", *kept, *words]).experiment


@pytest.mark.slow
@pytest.mark.parametrize("name", ["towards the chief", "away from the chief", "noise"])
def test_the_reference_decides_alike(name):
    noise = open_loop("noise", np.random.default_rng(3).normal(0.0, 0.2, (40, 3)))
    log = assert_as_written(replace(KEPT, duration_s=400.0), HOSTILE.get(name, noise), starts()[1])
    assert (log.safety_limit == WAY_OUT).any()


def test_a_good_controller_keeps_its_flights():
    """One that parks is corrected at its end alone; its points are those without the way out."""
    kept = experiment("controller=champion_27_parking")
    starts = evaluation_scenarios(kept)
    controller = source.named("champion_27_parking", kept.mission)
    on = fly_all(kept.mission, controller, starts, 1)
    bare = replace(kept.mission, safety=replace(kept.mission.safety, keep_way_out=False))
    off = fly_all(bare, controller, starts, 1)
    assert (on.inspected_count >= off.inspected_count - 3).all()
    assert abs(on.delta_v_m_s.mean() - off.delta_v_m_s.mean()) < 0.02


def test_it_is_not_exported():
    mission = experiment().mission
    with pytest.raises(NotTranslatableError, match="keep_way_out is true"):
        translate(mission, source.named("champion_27", mission))


@pytest.mark.parametrize("words", [(), LEO], ids=["paper", "leo"])
def test_a_shell_is_open_only_if_all_starts_in_it_have_a_way_out(words):
    mission = experiment(*words).mission
    world, generator = pack_world(mission), np.random.default_rng(7)
    assert start_without_way_out(world, (50.0, 90.0, 0.0)) is None
    directions, distances = isotropic(generator, COUNT), generator.uniform(50.0, 90.0, (COUNT, 1))
    for position in [*(distances * directions), *(90.0 * np.eye(3)), *(-50.0 * np.eye(3))]:
        assert has_way_out(mission, [*position, 0.0, 0.0, 0.0])
    # a closed ellipse is twice as long along the track as it is high
    height = start_without_way_out(world, (50.0, 100.0, 0.0))
    assert abs(height[0]) > 90.0
    assert not has_way_out(mission, [99.5, 0.0, 0.0, 0.0, 0.0, 0.0])
    # and beside the inner sphere no push in a period goes around it
    assert start_without_way_out(world, (10.0, 50.0, 0.0)) is not None


@pytest.mark.parametrize(
    ("words", "fault"),
    [
        (("navigation=fixes",), "navigation.mode is fixes; choose perfect"),
        (("actuators=real",), "an error of 1 mm/s leads 17 m astray in an orbit, and actuators.kind is real"),
        (("dynamics=two_body",), "dynamics.model is two_body; choose cw"),
        (("world=leo",), "navigation.mode is fixes"),
        (("fleet.deputies=2", "fleet.keep_apart_m=10"), "knows of no other deputies"),
        (("safety.probability=0.99",), "leave out orbit.course=true, dispersions and safety.probability"),
        (("safety=none",), "safety.keep_way_out counts only with safety.kind=filter"),
    ],
)
def test_where_anything_is_inexact_it_is_refused(words, fault):
    with pytest.raises(SettingError, match=fault):
        experiment(*words)


def test_margins_for_errors_would_be_wider_than_the_shell_between_the_spheres():
    """Along the track a velocity that is off by v leads 3 T v astray in an orbit's time T."""
    for words, speed_astray_m, thrust_astray_m in (
        (("navigation=fixes", "actuators=real"), 1367.0, 98.0),
        (("navigation=perfect", "actuators=real"), 0.0, 98.0),
    ):
        composed = compose_experiment(["+experiment=evaluate", "safety=robust", *words])
        mission = composed.experiment.mission
        errors, drift_s = bounds_of(mission).errors, 3.0 * ORBIT_S
        assert drift_s * errors.speed_m_s == pytest.approx(speed_astray_m, abs=1.0)
        period_s, mass_kg = mission.control_period_s, mission.deputy.mass_kg
        assert drift_s * errors.force_n * period_s / mass_kg == pytest.approx(thrust_astray_m, abs=1.0)
        assert drift_s * errors.share * 0.01 == pytest.approx(36.0, abs=2.5)
