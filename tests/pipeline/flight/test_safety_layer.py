"""No controller, however hostile, takes a guarded deputy out of its limits; a good one is left alone.

Where nothing is exact, the layer's margins follow from bounds on the errors, and hold.
"""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import LinearConstraint, linprog, minimize
from scipy.spatial.transform import Rotation
from scipy.special import erfinv
from scipy.stats import chi

from fis_tools.compiled.three import Three
from pipeline.command_line.config import compose_experiment
from pipeline.flight.control.controller import coast, open_loop
from pipeline.flight.fly.simulation import fly_all, fly_logged
from pipeline.flight.period.act.safety import project
from pipeline.flight.reference.motion import pushed, transition
from pipeline.flight.reference.safety import SafetyLayer
from pipeline.flight.state.log import PASSIVE_SAFETY, Scenario
from pipeline.flight.world.bounds import SafetyBounds, bounds_of, guard_of, spheres_of
from pipeline.flight.world.layout import layout_of
from pipeline.flight.world.thrust_bounds import capacity_of, largest_share, most_missed
from pipeline.physics.motion import motion_over, stop_of, stopped
from pipeline.settings.experiment import Mission, Safety, SettingError
from tests.pipeline.flight.as_written import assert_as_written
from tests.pipeline.flight.cases import STARTS, STEERING, isotropic
from tests.pipeline.flight.departures import ASKEW
from tests.pipeline.flight.guarded import (
    EARLY,
    LAST_MOMENT,
    PASSIVE,
    SPHERES,
    guarded,
    pushing,
    starts_at_rest,
)
from tests.pipeline.flight.missions import MEAN_MOTION

PERIOD = 10.0
KEEP_OUT_M, KEEP_IN_M = SPHERES

NO_LAYER = replace(LAST_MOMENT, kind="none")
SAFETIES = {"at the last moment": LAST_MOMENT, "early": EARLY, "passive": PASSIVE}

random = np.random.default_rng(17)
FORCES = {
    "weak noise": random.normal(0.0, 0.05, (360, 3)),
    "strong noise": random.normal(0.0, 2.0, (360, 3)),
    "long pushes": np.repeat(random.choice([-1.0, 0.0, 1.0], (24, 3)), 15, axis=0),
    "radially": np.tile([1.0, 0.0, 0.0], (360, 1)),
    "across the track": np.tile([0.0, 0.0, -1.0], (360, 1)),
    "not at all": np.zeros((0, 3)),
}
HOSTILE = {
    "towards the chief": pushing(-1.0),
    "away from the chief": pushing(1.0),
    "slowly towards the chief": pushing(-0.01),
} | {name: open_loop(name, forces) for name, forces in FORCES.items()}


def distances(positions: np.ndarray) -> np.ndarray:
    return np.linalg.norm(positions, axis=-1)


@pytest.mark.parametrize("safety", SAFETIES)
@pytest.mark.parametrize("name", HOSTILE)
def test_nothing_leads_a_guarded_deputy_out_of_its_limits(name: str, safety: str) -> None:
    starts = starts_at_rest(24, 5)
    what = guarded(SAFETIES[safety])
    tracks = np.empty((len(starts), 361, 3), dtype=np.float32)
    outcomes = fly_all(what, HOSTILE[name], starts, 1, tracks)
    assert not outcomes.is_violated.any()
    assert outcomes.min_distance_m.min() > KEEP_OUT_M - 1e-4
    assert outcomes.max_distance_m.max() < KEEP_IN_M + 1e-4
    assert outcomes.safety_periods.max() > 0
    if safety == "early":  # and without it they would be lost
        off = fly_all(guarded(NO_LAYER), HOSTILE[name], starts, 1)
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


@pytest.mark.parametrize("limits", [(10.0, 60.0), (15.0, 50.0), (40.0, 45.0)])
def test_other_limits_masses_and_clocks(limits: tuple[float, float]) -> None:
    deputy = {"min_distance_m": limits[0], "max_distance_m": limits[1], "mass_kg": 40.0, "max_force_n": 0.5}
    narrow = replace(EARLY, keep_out_margin_m=0.5, keep_in_margin_m=0.5, braking_force_n=0.3)
    what = guarded(narrow, deputy=deputy, control_period_s=20.0)
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
    on, off = (fly_all(guarded(safety), STEERING, STARTS, 1) for safety in (EARLY, NO_LAYER))
    assert not on.safety_periods.any()
    assert not on.safety_delta_v_m_s.any()
    for name, values in vars(on).items():
        np.testing.assert_allclose(values, getattr(off, name), rtol=1e-12, err_msg=name)


@pytest.mark.parametrize("name", ["towards the chief", "away from the chief", "strong noise", "long pushes"])
def test_every_sample_could_be_the_last(name: str) -> None:
    """At each sample one stop leads to a standstill between the spheres, with the force set aside for it."""
    what = guarded()
    stop = guard_of(what).stop
    for start in starts_at_rest(3, 29):
        log = fly_logged(what, HOSTILE[name], start)
        assert np.abs(log.force_hill_n).max() <= 1.0
        for state in np.hstack([log.position_m, log.velocity_m_s]):
            force = stop @ state
            assert np.abs(force).max() <= 0.8 + 1e-5
            stopped = pushed(what, state, force, PERIOD)
            np.testing.assert_allclose(stopped[3:], 0.0, atol=1e-12)
            assert KEEP_OUT_M - 1e-5 <= np.linalg.norm(stopped[:3]) <= KEEP_IN_M + 1e-5
            fastest = 0.2 + 0.0044272 * (np.linalg.norm(state[:3]) - 15.0)
            assert np.linalg.norm(state[3:]) <= fastest + 1e-6


def test_passive_safety_holds_at_every_sample_after_the_first() -> None:
    """Should the thrusters fail at any sample, free drift for an orbit keeps clear of the chief."""
    drifts = np.stack([transition(MEAN_MOTION, PERIOD * j)[0][:3] for j in range(569)])
    safety = replace(PASSIVE, keep_in_horizon_s=0.0)
    for controller in (STEERING, coast()):
        for start in starts_at_rest(3, 31):
            log = fly_logged(guarded(safety), controller, start)
            states = np.hstack([log.position_m, log.velocity_m_s])
            closest = distances(np.einsum("jik,nk->nji", drifts, states[1:])).min(axis=1)
            assert closest.min() > KEEP_OUT_M - 1e-3


def test_a_deputy_that_would_drift_into_the_chief_is_led_past_it_early_and_for_little() -> None:
    start = Scenario(np.array([0.5, -0.5, 60.0]), np.zeros(3), 0.0)
    off, late, early, passive = (
        fly_all(guarded(safety), coast(), [start], 1) for safety in (NO_LAYER, *SAFETIES.values())
    )
    assert off.is_violated[0]
    assert passive.delta_v_m_s[0] < early.delta_v_m_s[0] < late.delta_v_m_s[0]
    # a radial push u leads past it in the plane a quarter of an orbit later: x = u/n, y = -2 u/n
    assert passive.delta_v_m_s[0] == pytest.approx(KEEP_OUT_M * MEAN_MOTION / np.sqrt(5.0), rel=0.1)
    log = fly_logged(guarded(PASSIVE), coast(), start)
    assert log.safety_limit[0] == PASSIVE_SAFETY
    assert log.safety_limit[100:].max() == 0


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


def nearest_by_slsqp(requested, first, accuracy, constraint):
    """The force nearest to one asked for, within the thrusters' limits and a constraint."""
    return minimize(
        lambda force: np.sum((force - requested) ** 2),
        first,
        jac=lambda force: 2.0 * (force - requested),
        bounds=[(-1.0, 1.0)] * 3,
        constraints=constraint,
        method="SLSQP",
        options={"ftol": accuracy},
    )


@pytest.mark.slow
def test_the_change_is_the_least() -> None:
    """Against a solver of the nonlinear problem itself, at the outer sphere, where it is convex."""
    what, num_compared = guarded(), 0
    layer = SafetyLayer(what)
    for start in starts_at_rest(400, 37):
        towards = start.position_m / np.linalg.norm(start.position_m)
        at = np.concatenate([(KEEP_IN_M - random.uniform(0.1, 3.0)) * towards, random.normal(0.0, 0.1, 3)])
        requested = random.uniform(-1.0, 1.0, 3)

        def room(force, at=at):
            excesses = layer.excesses(pushed(what, at, force, PERIOD), 2)
            return -excesses[np.isfinite(excesses)]  # the others are off

        force, limit = layer.assured(at, requested)
        if layer.excesses(at, 2).max() > 0.0 or limit != "keep_in":
            continue
        solved = nearest_by_slsqp(requested, force, 1e-12, {"fun": room, "type": "ineq"})
        if solved.success:
            assert room(force).min() >= 0.0
            assert np.linalg.norm(force - requested) <= np.linalg.norm(solved.x - requested) + 1e-3
            num_compared += 1
    assert num_compared > 50


@pytest.mark.parametrize("seed", range(40))
def test_the_projection_is_that_of_a_solver(seed: int) -> None:
    generator = np.random.default_rng(seed)
    inside = generator.uniform(-0.8, 0.8, 3)
    cuts = generator.normal(size=(generator.integers(1, 6), 4))
    cuts[:, 3] = cuts[:, :3] @ inside - generator.exponential(0.2, len(cuts))
    requested = generator.uniform(-1.0, 1.0, 3)
    projected = project(Three(*requested), cuts, len(cuts), 1.0)
    solved = nearest_by_slsqp(requested, inside, 1e-14, LinearConstraint(cuts[:, :3], cuts[:, 3]))
    assert solved.success
    np.testing.assert_allclose(projected, solved.x, atol=1e-5)


def composed(*overrides: str) -> Mission:
    job = compose_experiment(["+experiment=evaluate", "controller=coast", "safety=robust", *overrides])
    return job.experiment.mission


def between_the_spheres(mission: Mission, count: int, seed: int) -> list[Scenario]:
    generator = np.random.default_rng(seed)
    keep_out, keep_in = spheres_of(mission, bounds_of(mission))
    positions = isotropic(generator, count) * generator.uniform(keep_out, keep_in, (count, 1))
    angles = generator.uniform(0.0, 6.0, count)
    return [
        Scenario(position, np.zeros(3), angle, 0.0, (seed, 1, case))
        for case, (position, angle) in enumerate(zip(positions, angles, strict=True))
    ]


def test_where_all_is_exact_nothing_is_kept_to_spare() -> None:
    exact = composed()
    assert bounds_of(exact) == SafetyBounds()
    assert spheres_of(exact, SafetyBounds()) == (exact.keep_out_m, exact.keep_in_m)
    assert bounds_of(composed("safety=filter", "world=leo")) == SafetyBounds()
    assert repr(guard_of(exact)) == repr(guard_of(composed("safety=filter")))


LAYOUT = "world=leo", "actuators=layout"
#: for so short that the propellant burnt changes the mass little
TANK = *LAYOUT, "actuators.specific_impulse_s=220", "duration_s=300"


@pytest.mark.parametrize(
    "world",
    [("navigation=fixes",), ("actuators=real",), ("dynamics=low_orbit",), ("world=leo",), LAYOUT, TANK],
    ids=" ".join,
)
def test_margins_grow_with_the_errors_and_with_the_probability(world: tuple[str, ...]) -> None:
    mission = composed(*world)
    bounds = bounds_of(mission)
    assert bounds.does_close
    assert bounds.keep_out_m < (11.0 if world == TANK else 10.5)
    surer = bounds_of(replace(mission, safety=replace(mission.safety, probability=0.9999)))
    assert surer.keep_out_m >= bounds.keep_out_m > bounds.keep_in_m > 0.0
    near, far = spheres_of(mission, bounds)
    assert near - mission.deputy.min_distance_m >= bounds.keep_out_m
    assert mission.deputy.max_distance_m - far >= bounds.keep_in_m


@pytest.mark.parametrize("late", ["delay_s=0", "delay_s=30"])
def test_the_estimate_is_bounded_from_the_first_sample_on_and_with_its_constant_error(late: str) -> None:
    """With late or useless fixes the first error stays; a bias moves the estimate by as much in the end."""
    blind = bounds_of(composed("navigation=fixes", f"navigation.{late}", "navigation.initial_position_m=10"))
    first = 10.0 * chi.isf(0.001 / 4.0, 3)
    assert blind.errors.position_m > (first if late != "delay_s=0" else 0.4 * first)
    biased = bounds_of(composed("navigation=fixes", f"navigation.{late}", "navigation.bias_m=1"))
    assert biased.errors.position_m > biased.errors.constant_m > chi.isf(0.001 / 12.0, 3) - 0.01


def test_errors_beyond_the_thrusters_do_not_close_and_limits_without_room_are_refused() -> None:
    assert not bounds_of(composed("actuators=real", "actuators.scale_error=0.3")).does_close
    wide = composed("world=leo")
    narrow = replace(wide, deputy=replace(wide.deputy, max_distance_m=30.0))
    with pytest.raises(SettingError, match=r"leave no room between deputy.min_distance_m \(15 m\)"):
        spheres_of(narrow, bounds_of(narrow))


@pytest.mark.parametrize(
    ("scale", "turn", "share"),
    [(0.05, 0.035, 0.99), (0.05, 0.0, 0.99), (0.05, 0.0, 0.99996), (0.0, 0.035, 0.99), (0.0, 0.035, 0.99996)],
)
def test_the_share_is_the_quantile_of_thrusters(scale: float, turn: float, share: float) -> None:
    quantile = largest_share(scale, turn, share)
    if turn == 0.0:
        expected = scale * np.sqrt(2.0) * erfinv(share ** (1.0 / 3.0))
    elif scale == 0.0:
        expected = 2.0 * np.sin(0.5 * turn * chi.ppf(share, 3))
    else:
        generator = np.random.default_rng(3)
        matrices = Rotation.from_rotvec(turn * generator.normal(size=(100_000, 3))).as_matrix()
        matrices *= 1.0 + scale * generator.normal(size=(100_000, 3, 1))
        expected = np.quantile(np.linalg.norm(matrices - np.eye(3), ord=2, axis=(1, 2)), 0.99)
    assert 0.995 * expected < quantile < (1.02 if share == 0.99 else 1.08) * expected


def strongest_by_linprog(rows: np.ndarray, direction: np.ndarray, *, is_turning: bool) -> float:
    """The greatest force of thrusters along a direction, which turn the body or do not."""
    forces = rows[:, 3:6]
    torques = np.cross(rows[:, :3], forces)[:, [] if is_turning else [0, 1, 2]]
    pushes = np.column_stack([forces, torques])
    solved = linprog(
        np.r_[np.zeros(len(rows)), -1.0],
        A_eq=np.column_stack([pushes.T, -np.r_[direction, np.zeros(torques.shape[1])]]),
        b_eq=np.zeros(pushes.shape[1]),
        bounds=[(0.0, most) for most in rows[:, 6]] + [(0.0, None)],
    )
    return float(solved.x[-1])


def test_the_least_force_of_a_layout_is_that_over_all_attitudes() -> None:
    """Against linear programmes, and against what the table gives in many directions."""
    directions = np.concatenate([np.eye(3), -np.eye(3), isotropic(np.random.default_rng(2), 20_000)])
    for rows, is_turning in ((composed(*LAYOUT).actuators.thrusters, False), (ASKEW, True)):
        (table, layout), capacity = layout_of(rows), capacity_of(rows)
        thrusts = np.hstack([np.maximum(directions, 0.0), np.maximum(-directions, 0.0)]) @ table.T
        given = 1.0 / (thrusts / layout[:, 6]).max(axis=1)
        assert capacity.least_force_n == pytest.approx(given.min(), rel=1e-2)
        assert capacity.least_force_n <= given.min() * (1.0 + 1e-12)
        assert capacity.thrusts_per_newton == pytest.approx(thrusts.sum(axis=1).max(), rel=1e-2)
        assert capacity.thrusts_per_newton >= thrusts.sum(axis=1).max() * (1.0 - 1e-12)
        greatest = [
            strongest_by_linprog(np.array(rows), way, is_turning=is_turning) for way in directions[:40]
        ]
        assert np.all(given[:40] <= np.array(greatest) * (1.0 + 1e-9))
        if not is_turning:
            assert min(greatest) == pytest.approx(capacity.least_force_n)


@pytest.mark.parametrize(("least", "step"), [(0.04, 0.0), (0.0, 0.05), (0.055, 0.01)])
def test_what_a_layout_misses_by_its_impulses_is_within_the_bound(least: float, step: float) -> None:
    """Flown: small forces in all directions, with thrusters that are exact but for their impulses."""
    exact = "actuators.scale_error=0", "actuators.misalignment_deg=0", "attitude=ideal"
    rounded = f"actuators.least_impulse_n_s={least}", f"actuators.impulse_step_n_s={step}"
    mission = composed("safety=none", "actuators=layout", "navigation=perfect", *exact, *rounded)
    scale = 2.0 * max(least, 0.5 * step) / PERIOD
    forces = np.random.default_rng(3).uniform(-scale, scale, (mission.num_controls, 3))
    missed = []
    for start in starts_at_rest(3, 8):
        log = fly_logged(mission, open_loop("small", forces), start)
        missed.append(np.linalg.norm(log.force_hill_n - log.force_commanded_n, axis=1).max())
    bound = most_missed(mission.actuators.thrusters, -0.5 * step / PERIOD, (least + 0.5 * step) / PERIOD)
    assert 0.75 * bound < max(missed) <= bound
    if step == 0.0:
        assert bound == pytest.approx(2.0 * np.sqrt(3.0) * least / PERIOD)


def test_a_flight_uses_no_more_propellant_than_the_layer_allows_for() -> None:
    mission = composed(*TANK, "attitude=ideal")
    allowed = bounds_of(mission).propellant_kg
    assert allowed < mission.actuators.propellant_kg
    for force in (-1.0, 1.0):
        log = fly_logged(mission, pushing(force), between_the_spheres(mission, 1, 3)[0])
        assert 0.005 < log.mass_kg[0] - log.mass_kg[-1] < allowed


@pytest.mark.parametrize("outward", [1.0, -1.0])
@pytest.mark.parametrize("world", [("world=leo",), LAYOUT, TANK], ids=" ".join)
def test_steps_back_stay_within_the_bound_whatever_the_thrusters_and_the_estimate(
    world: tuple[str, ...], outward: float
) -> None:
    """The worst errors of the estimate in each period, and the greatest share that thrusters may be off.

    With a tank the share grows by as much as the mass may fall.
    """
    mission = composed(*world)
    bounds, motion = bounds_of(mission), motion_over(mission.orbit, mission.deputy, (10.0,))
    phi, gamma, stop = motion.transition[0], motion.control[0], stop_of(motion)
    stop_rows = stopped(motion, stop).transition[0, :3]
    limits = mission.deputy.min_distance_m, mission.deputy.max_distance_m
    radius = limits[0] + bounds.keep_out_m - 5.0 if outward > 0.0 else limits[1] - bounds.keep_in_m + 5.0
    generator = np.random.default_rng(1)
    for start in radius * isotropic(generator, 25):
        turn = Rotation.from_rotvec(generator.normal(size=3)).as_matrix()
        most, lighter = 1.0 + bounds.errors.share, bounds.errors.lighter
        constant = (most / (1.0 + lighter) - 1.0) * turn @ np.diag(generator.choice([-1.0, 1.0], 3))
        state = np.concatenate((start, np.zeros(3)))
        for period in range(100):
            off = constant + 0.01 * period * lighter * (np.eye(3) + constant)
            away = stop_rows @ state
            away *= outward / np.linalg.norm(away)
            requested = stop @ state + (bounds.step_back_n - 0.09) * away  # the estimate is off by this
            state = phi @ state + gamma @ (requested + off @ requested - bounds.errors.force_n * away)
            assert limits[0] < np.linalg.norm(state[:3]) < limits[1]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("force_n", "world"), [(-1.0, ("world=leo",)), (1.0, LAYOUT), (-0.01, ("world=leo",)), (-0.01, LAYOUT)]
)
def test_no_adversary_takes_a_deputy_out_where_nothing_is_exact(
    force_n: float, world: tuple[str, ...]
) -> None:
    mission = composed(*world)
    mission = replace(mission, attitude=replace(mission.attitude, mode="ideal"))
    starts = between_the_spheres(mission, 200, 12)
    outcomes = fly_all(mission, pushing(force_n), starts, 1)
    assert not outcomes.is_violated.any()
    assert np.mean(outcomes.safety_periods > 0) > 0.9
    # the margins of an exact world do not do, but for the hardest push, against which speed is always slow
    exact = replace(mission, safety=replace(mission.safety, probability=None))
    if force_n != -1.0:
        assert fly_all(exact, pushing(force_n), starts, 1).is_violated.any()


@pytest.mark.slow
def test_nor_where_the_first_estimate_is_bad_and_fixes_are_late() -> None:
    bad = "navigation.initial_position_m=5", "navigation.delay_s=60"
    mission = composed("navigation=fixes", *bad, "attitude=ideal", "duration_s=600")
    near, _ = spheres_of(mission, bounds_of(mission))
    positions = (near + 0.01) * isotropic(np.random.default_rng(14), 100)
    starts = [
        Scenario(position, np.zeros(3), 0.0, 0.0, (14, 1, case)) for case, position in enumerate(positions)
    ]
    assert not fly_all(mission, pushing(-1.0), starts, 1).is_violated.any()


@pytest.mark.slow
def test_nor_does_noise() -> None:
    mission = composed("navigation=fixes", "actuators=real", "attitude=ideal")
    noise = open_loop("noise", np.random.default_rng(5).normal(0.0, 1.0, (mission.num_controls, 3)))
    outcomes = fly_all(mission, noise, between_the_spheres(mission, 200, 13), 1)
    assert not outcomes.is_violated.any()


@pytest.mark.slow
@pytest.mark.parametrize(("force_n", "distance_m"), [(1.0, 193.0), (-1.0, 22.5)])
def test_it_steps_back_as_written(force_n: float, distance_m: float) -> None:
    """From a start in the margin, where no stop is safe, against the reference's layer."""
    mission = replace(composed("world=leo"), duration_s=400.0)
    assert bounds_of(mission).step_back_n > 0.1
    (start,) = between_the_spheres(mission, 1, 5)
    position = start.position_m * distance_m / np.linalg.norm(start.position_m)
    log = assert_as_written(mission, pushing(force_n), replace(start, position_m=position))
    assert np.abs(log.force_commanded_n).max() > 0.1
    assert log.safety_limit.any()
