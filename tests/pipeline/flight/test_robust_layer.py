"""Where nothing is exact, the layer's margins follow from bounds on the errors, and hold."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from scipy.special import erfinv
from scipy.stats import chi

from pipeline.command_line.config import compose_experiment
from pipeline.flight.control.controller import open_loop
from pipeline.flight.fly.simulation import fly_all
from pipeline.flight.period.act.bounds import Bounds, bounds_of, largest_share, spheres_of
from pipeline.flight.state.log import Scenario
from pipeline.physics.motion import motion_over, stop_of, stopped
from pipeline.settings.experiment import Mission, SettingError
from tests.pipeline.flight.as_written import assert_as_written
from tests.pipeline.flight.guarded import pushing


def composed(*overrides: str) -> Mission:
    job = compose_experiment(["+experiment=evaluate", "controller=coast", "safety=robust", *overrides])
    return job.experiment.mission


def between_the_spheres(mission: Mission, count: int, seed: int) -> list[Scenario]:
    generator = np.random.default_rng(seed)
    keep_out, keep_in = spheres_of(mission, bounds_of(mission))
    places = generator.normal(size=(count, 3))
    places *= (generator.uniform(keep_out, keep_in, count) / np.linalg.norm(places, axis=1))[:, np.newaxis]
    return [
        Scenario(place, np.zeros(3), angle, 0.0, (seed, 1, case))
        for case, (place, angle) in enumerate(zip(places, generator.uniform(0.0, 6.0, count), strict=True))
    ]


def test_where_all_is_exact_nothing_is_kept_to_spare() -> None:
    exact = composed()
    assert bounds_of(exact) == Bounds()
    assert spheres_of(exact, Bounds()) == (exact.keep_out_m, exact.keep_in_m)
    assert bounds_of(composed("safety=filter", "world=leo")) == Bounds()


@pytest.mark.parametrize("world", ["navigation=fixes", "actuators=real", "dynamics=low_orbit", "world=leo"])
def test_margins_grow_with_the_errors_and_with_the_probability(world: str) -> None:
    mission = composed(world)
    found = bounds_of(mission)
    assert found.does_close
    surer = bounds_of(replace(mission, safety=replace(mission.safety, probability=0.9999)))
    assert surer.keep_out_m >= found.keep_out_m > found.keep_in_m > 0.0


def test_errors_beyond_the_thrusters_do_not_close_and_limits_without_room_are_refused() -> None:
    assert not bounds_of(composed("actuators=real", "actuators.scale_error=0.3")).does_close
    wide = composed("world=leo")
    narrow = replace(wide, deputy=replace(wide.deputy, max_distance_m=30.0))
    with pytest.raises(SettingError, match=r"leave no room between deputy.min_distance_m \(15 m\)"):
        spheres_of(narrow, bounds_of(narrow))


@pytest.mark.parametrize(("scale", "turn"), [(0.05, 0.035), (0.05, 0.0), (0.0, 0.035)])
def test_the_share_is_the_quantile_of_thrusters(scale: float, turn: float) -> None:
    found = largest_share(scale, turn, 0.99)
    if turn == 0.0:
        expected = scale * np.sqrt(2.0) * erfinv(0.99 ** (1.0 / 3.0))
    elif scale == 0.0:
        expected = 2.0 * np.sin(0.5 * turn * chi.ppf(0.99, 3))
    else:
        generator = np.random.default_rng(3)
        matrices = Rotation.from_rotvec(turn * generator.normal(size=(100_000, 3))).as_matrix()
        matrices *= 1.0 + scale * generator.normal(size=(100_000, 3, 1))
        expected = np.quantile(np.linalg.norm(matrices - np.eye(3), ord=2, axis=(1, 2)), 0.99)
    assert 0.995 * expected < found < 1.02 * expected


@pytest.mark.parametrize("outward", [1.0, -1.0])
def test_steps_back_stay_within_the_bound_whatever_the_thrusters_and_the_estimate(outward: float) -> None:
    """The worst errors of the estimate in each period, and the greatest share that thrusters may be off."""
    mission = composed("world=leo")
    bounds, motion = bounds_of(mission), motion_over(mission.orbit, mission.deputy, (10.0,))
    phi, gamma, stop = motion.transition[0], motion.control[0], stop_of(motion)
    places = stopped(motion, stop).transition[0, :3]
    limits = mission.deputy.min_distance_m, mission.deputy.max_distance_m
    radius = limits[0] + bounds.keep_out_m - 5.0 if outward > 0.0 else limits[1] - bounds.keep_in_m + 5.0
    generator = np.random.default_rng(1)
    for _ in range(50):
        turn = Rotation.from_rotvec(generator.normal(size=3)).as_matrix()
        off = bounds.errors.share * turn @ np.diag(generator.choice([-1.0, 1.0], 3))
        state = np.zeros(6)
        state[:3] = generator.normal(size=3)
        state[:3] *= radius / np.linalg.norm(state[:3])
        for _ in range(100):
            away = places @ state
            away *= outward / np.linalg.norm(away)
            asked = stop @ state + (bounds.step_back_n - 0.09) * away  # the estimate is off by this
            state = phi @ state + gamma @ (asked + off @ asked - bounds.errors.force_n * away)
            assert limits[0] < np.linalg.norm(state[:3]) < limits[1]


@pytest.mark.slow
@pytest.mark.parametrize("force_n", [-1.0, 1.0, -0.01])
def test_no_adversary_takes_a_deputy_out_where_nothing_is_exact(force_n: float) -> None:
    mission = composed("world=leo")
    mission = replace(mission, attitude=replace(mission.attitude, mode="ideal"))
    starts = between_the_spheres(mission, 200, 11)
    outcomes = fly_all(mission, pushing(force_n), starts, 1)
    assert not outcomes.is_violated.any()
    assert np.mean(outcomes.safety_periods > 0) > 0.9
    # the margins of an exact world do not do, but for the hardest push, against which speed is always slow
    exact = replace(mission, safety=replace(mission.safety, probability=None, braking_force_n=0.8))
    if force_n != -1.0:
        assert fly_all(exact, pushing(force_n), starts, 1).is_violated.any()


@pytest.mark.slow
def test_nor_does_noise() -> None:
    mission = composed("navigation=fixes", "actuators=real", "attitude=ideal")
    random = np.random.default_rng(5)
    noise = open_loop("noise", random.normal(0.0, 1.0, (mission.num_controls, 3)))
    outcomes = fly_all(mission, noise, between_the_spheres(mission, 200, 13), 1)
    assert not outcomes.is_violated.any()


@pytest.mark.slow
@pytest.mark.parametrize(("force_n", "distance_m"), [(1.0, 193.0), (-1.0, 22.5)])
def test_it_steps_back_as_written(force_n: float, distance_m: float) -> None:
    """From a start in the margin, where no stop is safe, against the readable layer."""
    mission = replace(composed("world=leo"), duration_s=400.0)
    assert bounds_of(mission).step_back_n > 0.1
    (start,) = between_the_spheres(mission, 1, 5)
    place = start.position_m * distance_m / np.linalg.norm(start.position_m)
    log = assert_as_written(mission, pushing(force_n), replace(start, position_m=place))
    assert np.abs(log.force_commanded_n).max() > 0.1
    assert log.safety_limit.any()
