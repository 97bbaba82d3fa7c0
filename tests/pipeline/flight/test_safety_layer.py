"""No controller, however hostile, takes a guarded deputy out of its limits; a good one is left alone."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.linalg import expm
from scipy.optimize import minimize

from pipeline.flight.control.controller import coast, open_loop
from pipeline.flight.fly.simulation import fly_all, fly_logged
from pipeline.flight.period.act.safety import guard_of, project
from pipeline.flight.state.log import KEEP_IN, KEEP_OUT, PASSIVE_SAFETY, SPEED, Scenario
from pipeline.settings.experiment import Safety
from tests.pipeline.flight.cases import STARTS, STEERING
from tests.pipeline.flight.guarded import (
    EARLY,
    KEEP_IN_M,
    KEEP_OUT_M,
    LAST_MOMENT,
    PASSIVE,
    guarded,
    pushing,
    starts_at_rest,
)
from tests.pipeline.flight.missions import MEAN_MOTION
from tests.readable_flight.safety import Layer

#: the equations of motion, from the books and not from `pipeline.physics`
DYNAMICS = np.zeros((6, 6))
DYNAMICS[:3, 3:] = np.eye(3)
DYNAMICS[3, 0], DYNAMICS[3, 4] = 3.0 * MEAN_MOTION**2, 2.0 * MEAN_MOTION
DYNAMICS[4, 3], DYNAMICS[5, 2] = -2.0 * MEAN_MOTION, -(MEAN_MOTION**2)
MASS, PERIOD = 12.0, 10.0

SAFETIES = {"at the last moment": LAST_MOMENT, "early": EARLY, "passive": PASSIVE}

random = np.random.default_rng(17)
HOSTILE = {
    "towards the chief": pushing(-1.0),
    "away from the chief": pushing(1.0),
    "slowly towards the chief": pushing(-0.01),
    "weak noise": open_loop("weak", random.normal(0.0, 0.05, (360, 3))),
    "strong noise": open_loop("strong", random.normal(0.0, 2.0, (360, 3))),
    "long pushes": open_loop("pushes", np.repeat(random.choice([-1.0, 0.0, 1.0], (24, 3)), 15, axis=0)),
    "radially": open_loop("radial", np.tile([1.0, 0.0, 0.0], (360, 1))),
    "across the track": open_loop("across", np.tile([0.0, 0.0, -1.0], (360, 1))),
    "not at all": coast(),
}


def step(duration_s: float, state: np.ndarray, force: np.ndarray) -> np.ndarray:
    """Where a state leads under a held force, by the exponential of the augmented system."""
    augmented = np.zeros((9, 9))
    augmented[:6, :6] = DYNAMICS
    augmented[3:6, 6:] = np.eye(3) / MASS
    return (expm(augmented * duration_s) @ np.concatenate([state, force]))[:6]


def distances(positions: np.ndarray) -> np.ndarray:
    return np.linalg.norm(positions, axis=-1)


@pytest.mark.parametrize("safety", SAFETIES)
@pytest.mark.parametrize("name", HOSTILE)
def test_nothing_leads_a_guarded_deputy_out_of_its_limits(name: str, safety: str) -> None:
    starts = starts_at_rest(40, 5)
    what = guarded(SAFETIES[safety])
    tracks = np.empty((len(starts), 361, 3), dtype=np.float32)
    outcomes = fly_all(what, HOSTILE[name], starts, 1, tracks)
    assert not outcomes.is_violated.any()
    assert outcomes.min_distance_m.min() > KEEP_OUT_M - 1e-4
    assert outcomes.max_distance_m.max() < KEEP_IN_M + 1e-4
    assert outcomes.safety_periods.max() > 0
    if safety == "early":  # and without it they would be lost
        off = fly_all(replace(what, safety=replace(LAST_MOMENT, kind="none")), HOSTILE[name], starts, 1)
        assert off.is_violated.mean() > 0.5
        assert not off.safety_periods.any()
        assert not off.safety_delta_v_m_s.any()


@pytest.mark.slow
@settings(max_examples=25, deadline=None)
@given(
    seed=st.integers(0, 2**32 - 1),
    strength=st.floats(0.001, 10.0),
    hold=st.integers(1, 120),
    early=st.sampled_from([LAST_MOMENT, EARLY]),
)
def test_any_forces_from_any_start(seed: int, strength: float, hold: int, early: Safety) -> None:
    generator = np.random.default_rng(seed)
    forces = np.repeat(generator.normal(0.0, strength, (360 // hold + 1, 3)), hold, axis=0)[:360]
    outcomes = fly_all(guarded(early), open_loop("any", forces), starts_at_rest(16, seed), 1)
    assert not outcomes.is_violated.any()


@pytest.mark.parametrize("limits", [(0.0, 60.0), (15.0, 50.0), (40.0, 45.0)])
def test_other_limits_masses_and_clocks(limits: tuple[float, float]) -> None:
    what = guarded(
        replace(EARLY, keep_out_margin_m=0.5, keep_in_margin_m=0.5, braking_force_n=0.3),
        deputy={
            "min_distance_m": limits[0],
            "max_distance_m": limits[1],
            "mass_kg": 40.0,
            "max_force_n": 0.5,
        },
        control_period_s=20.0,
    )
    starts = [
        replace(start, position_m=start.position_m * np.mean(limits) / np.linalg.norm(start.position_m))
        for start in starts_at_rest(16, 9)
    ]
    noise = open_loop("noise", random.normal(0.0, 1.0, (180, 3)))
    outcomes = fly_all(what, noise, starts, 1)
    assert not outcomes.is_violated.any()
    assert outcomes.safety_periods.min() > 10


def test_a_force_that_is_safe_is_left_as_it_is() -> None:
    """Flights without the layer are compiled without it, and may round otherwise."""
    on = fly_all(guarded(EARLY), STEERING, STARTS, 1)
    off = fly_all(replace(guarded(), safety=replace(LAST_MOMENT, kind="none")), STEERING, STARTS, 1)
    assert not on.safety_periods.any()
    assert not on.safety_delta_v_m_s.any()
    for name, values in vars(on).items():
        np.testing.assert_allclose(values, getattr(off, name), rtol=1e-12, err_msg=name)


@pytest.mark.parametrize("name", HOSTILE)
def test_forces_are_within_the_thrusters_and_counted(name: str) -> None:
    (start,) = starts_at_rest(1, 23)
    log = fly_logged(guarded(EARLY), HOSTILE[name], start)
    outcomes = fly_all(guarded(EARLY), HOSTILE[name], [start], 1)
    assert np.abs(log.force_hill_n).max() <= 1.0
    has_acted = log.safety_limit > 0
    assert has_acted.sum() == outcomes.safety_periods[0] > 0
    assert not log.safety_force_hill_n[~has_acted].any()
    assert np.all(np.abs(log.safety_force_hill_n[has_acted]).sum(axis=1) > 0.0)
    spent = np.abs(log.force_hill_n).sum() * PERIOD / MASS
    assert spent == pytest.approx(outcomes.delta_v_m_s[0], rel=1e-12)
    changed = np.abs(log.safety_force_hill_n).sum() * PERIOD / MASS
    assert changed == pytest.approx(outcomes.safety_delta_v_m_s[0], rel=1e-12)


def test_the_stop_is_the_force_after_which_the_deputy_stands() -> None:
    stop = guard_of(guarded()).stop
    for state in random.normal(0.0, [60.0, 60.0, 60.0, 0.2, 0.2, 0.2], (20, 6)):
        stopped = step(PERIOD, state, stop @ state)
        np.testing.assert_allclose(stopped[3:], 0.0, atol=1e-12)
        place = np.concatenate([stopped[:3], np.zeros(3)])
        # to stand, it cancels what the orbit does to a body at rest there, and stays where it is
        held = MASS * MEAN_MOTION**2 * np.array([-3.0, 0.0, 1.0]) * place[:3]
        np.testing.assert_allclose(stop @ place, held, atol=1e-12)
        np.testing.assert_allclose(step(PERIOD, place, stop @ place), place, atol=1e-10)


@pytest.mark.parametrize("name", ["towards the chief", "away from the chief", "strong noise", "long pushes"])
def test_every_sample_could_be_the_last(name: str) -> None:
    """At each sample one stop leads to a standstill between the spheres, with the force set aside for it."""
    stop = guard_of(guarded()).stop
    for start in starts_at_rest(3, 29):
        log = fly_logged(guarded(), HOSTILE[name], start)
        for state in np.hstack([log.position_m, log.velocity_m_s]):
            force = stop @ state
            assert np.abs(force).max() <= 0.8 + 1e-5
            distance = np.linalg.norm(step(PERIOD, state, force)[:3])
            assert KEEP_OUT_M - 1e-5 <= distance <= KEEP_IN_M + 1e-5
            fastest = 0.2 + 0.0044272 * (np.linalg.norm(state[:3]) - 15.0)
            assert np.linalg.norm(state[3:]) <= fastest + 1e-6


def test_passive_safety_holds_at_every_sample_after_the_first() -> None:
    """Should the thrusters fail at any sample, free drift for an orbit keeps clear of the chief."""
    drifts = np.stack([expm(DYNAMICS * PERIOD * j)[:3] for j in range(569)])
    safety = replace(PASSIVE, keep_in_horizon_s=0.0)
    for controller in (STEERING, coast()):
        for start in starts_at_rest(3, 31):
            log = fly_logged(guarded(safety), controller, start)
            states = np.hstack([log.position_m, log.velocity_m_s])
            closest = distances(np.einsum("jik,nk->nji", drifts, states[1:])).min(axis=1)
            assert closest.min() > KEEP_OUT_M - 1e-3


def test_a_deputy_that_would_drift_into_the_chief_is_led_past_it_early_and_for_little() -> None:
    start = Scenario(np.array([0.5, -0.5, 60.0]), np.zeros(3), 0.0)
    assert fly_all(guarded(replace(LAST_MOMENT, kind="none")), coast(), [start], 1).is_violated[0]
    late, early, passive = (
        fly_all(guarded(safety), coast(), [start], 1) for safety in (LAST_MOMENT, EARLY, PASSIVE)
    )
    assert passive.delta_v_m_s[0] < early.delta_v_m_s[0] < late.delta_v_m_s[0]
    # a radial push u leads past it in the plane a quarter of an orbit later: x = u/n, y = -2 u/n
    assert passive.delta_v_m_s[0] == pytest.approx(KEEP_OUT_M * MEAN_MOTION / np.sqrt(5.0), rel=0.1)
    log = fly_logged(guarded(PASSIVE), coast(), start)
    assert log.safety_limit[0] == PASSIVE_SAFETY
    assert log.safety_limit[100:].max() == 0


def test_what_it_acts_for() -> None:
    at_rest = Scenario(np.array([0.0, 100.0, 0.0]), np.zeros(3), 0.0)
    limits = {
        name: set(fly_logged(guarded(), HOSTILE[name], at_rest).safety_limit.tolist()) - {0}
        for name in ("towards the chief", "away from the chief")
    }
    assert limits == {"towards the chief": {KEEP_OUT, SPEED}, "away from the chief": {KEEP_IN, SPEED}}


def test_from_outside_the_safe_states_it_comes_back() -> None:
    """A start too fast to be stopped at once is braked as hard as it can be; one in the margin is led out."""
    outward = Scenario(np.array([0.0, 60.0, 0.0]), np.array([0.0, 3.0, 0.0]), 0.0)
    log = fly_logged(guarded(), coast(), outward)
    assert log.force_hill_n[:2, 1].tolist() == [-1.0, -1.0]
    assert np.linalg.norm(log.velocity_m_s[4]) < 0.2 + 0.0044272 * np.linalg.norm(log.position_m[4])
    assert distances(log.position_m).max() < KEEP_IN_M
    in_the_margin = Scenario(np.array([15.2, 0.0, 0.0]), np.zeros(3), 0.0)
    distance = distances(fly_logged(guarded(), pushing(-1.0), in_the_margin).position_m)
    assert distance[1:].min() > KEEP_OUT_M - 1e-4


@pytest.mark.parametrize("seed", range(40))
def test_the_projection_is_that_of_a_solver(seed: int) -> None:
    generator = np.random.default_rng(seed)
    inside = generator.uniform(-0.8, 0.8, 3)
    cuts = generator.normal(size=(generator.integers(1, 6), 4))
    cuts[:, 3] = cuts[:, :3] @ inside - generator.exponential(0.2, len(cuts))
    asked = generator.uniform(-1.0, 1.0, 3)
    found = np.empty(3)
    project(asked, cuts, len(cuts), 1.0, found)
    solved = minimize(
        lambda force: np.sum((force - asked) ** 2),
        inside,
        jac=lambda force: 2.0 * (force - asked),
        bounds=[(-1.0, 1.0)] * 3,
        constraints={
            "type": "ineq",
            "fun": lambda f: cuts[:, :3] @ f - cuts[:, 3],
            "jac": lambda f: cuts[:, :3],
        },
        method="SLSQP",
        options={"ftol": 1e-14},
    )
    assert solved.success
    np.testing.assert_allclose(found, solved.x, atol=1e-5)


def test_the_change_is_the_least() -> None:
    """Against a solver of the nonlinear problem itself, at the outer sphere, where it is convex."""
    layer = Layer(guarded())
    num_compared = 0
    for start in starts_at_rest(400, 37):
        towards = start.position_m / np.linalg.norm(start.position_m)
        at = np.concatenate([(KEEP_IN_M - random.uniform(0.1, 3.0)) * towards, random.normal(0.0, 0.1, 3)])
        if layer.excesses(at, 2).max() > 0.0:
            continue
        asked = random.uniform(-1.0, 1.0, 3)
        force, limit = layer.assured(at, asked)
        if limit != "keep_in":
            continue
        solved = minimize(
            lambda f, wish=asked: np.sum((f - wish) ** 2),
            force,
            bounds=[(-1.0, 1.0)] * 3,
            constraints={"type": "ineq", "fun": lambda f, at=at: -layer.excesses(step(PERIOD, at, f), 2)},
            method="SLSQP",
            options={"ftol": 1e-12},
        )
        if not solved.success:
            continue
        assert layer.excesses(step(PERIOD, at, force), 2).max() <= 0.0
        assert np.linalg.norm(force - asked) <= np.linalg.norm(solved.x - asked) + 1e-3
        num_compared += 1
    assert num_compared > 50
