"""Ways out from whole cubes of starts, held against flights that SciPy integrates one by one."""

from functools import cache

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from pipeline.command_line.config import compose_experiment
from pipeline.evaluation.assurance import open_starts
from pipeline.flight.world.pack import pack_world

WORDS = ["+experiment=evaluate", "controller=coast", "safety=filter", "safety.keep_way_out=true"]
MISSION = compose_experiment(WORDS).experiment.mission
N, PERIOD_S, MASS_KG = MISSION.orbit.mean_motion_rad_s, MISSION.control_period_s, MISSION.deputy.mass_kg
#: of starts, m/s
SPEED = 0.01
TIMES = np.linspace(0.0, 2.0 * np.pi / N, 400)


@cache
def ways():
    return open_starts._WaysOut(pack_world(MISSION), SPEED)


def flown(state, seconds, force=(0.0, 0.0, 0.0), times=None):
    """States under a force, N, by Clohessy and Wiltshire's equations."""

    def rates(_, s):
        pull = 3.0 * N * N * s[0] + 2.0 * N * s[4], -2.0 * N * s[3], -N * N * s[2]
        return [*s[3:], *(np.array(pull) + np.array(force) / MASS_KG)]

    return solve_ivp(rates, (0.0, seconds), state, "DOP853", times, rtol=1e-10, atol=1e-9).y


def pushed(state, half_axis):
    """The force of a way out, N, and the state after it has been held for a control period."""
    radial, along = ways().force @ state + half_axis * np.array([ways().per_half_axis[1], 0.0])
    return (radial, along), flown(state, PERIOD_S, (radial, along, 0.0))[:, -1]


def drawn(count, seed=1, speed=SPEED):
    draw = np.random.default_rng(seed)
    directions = draw.normal(size=(2, count, 3))
    directions /= np.linalg.norm(directions, axis=2, keepdims=True)
    return np.hstack([draw.uniform(30.0, 110.0, (count, 1)) * directions[0], speed * directions[1]])


@pytest.mark.parametrize("half_axis", [0.0, 20.0, -50.0])
def test_a_way_out_closes_the_ellipse_and_gives_it_its_half_axis(half_axis):
    for state in drawn(5):
        _, after = pushed(state, half_axis)
        assert 4.0 * after[0] + 2.0 * after[4] / N == pytest.approx(0.0, abs=1e-4)
        assert after[3] / N == pytest.approx(half_axis, abs=1e-4)
        expected = ways().after @ state + half_axis * ways().per_half_axis[0]
        np.testing.assert_allclose(after, expected, rtol=1e-6, atol=1e-6)
        # after an orbit it is where it was
        np.testing.assert_allclose(flown(after, TIMES[-1])[:, -1], after, atol=1e-3)


def test_half_axes_are_tried_on_both_sides_up_to_half_the_outer_sphere():
    axes = ways().half_axes
    np.testing.assert_allclose(axes, -axes[::-1])
    assert axes.max() == pytest.approx(0.5 * pack_world(MISSION).guard.keep_in)
    assert np.ptp(np.diff(axes)) == pytest.approx(0.0, abs=1e-9)


def test_paths_that_are_said_to_stay_do_so_from_all_of_a_cube_and_others_come_near_a_sphere():
    low, high = ways().spheres
    draw, counts = np.random.default_rng(4), [0, 0]
    for state in drawn(60, 2, 0.0):
        for half in (0.25, 1.0):
            for half_axis in (0.0, 40.0, -70.0):
                is_said = bool(ways()._stay_between(half_axis, state[np.newaxis, :3], half)[0])
                counts[is_said] += 1
                near, far = np.inf, 0.0
                for _ in range(3):
                    # a start in the corner of the cube, at the greatest speed
                    other = state.copy()
                    shift, velocity = draw.normal(size=(2, 3))
                    other[:3] += half * shift / np.linalg.norm(shift)
                    other[3:] = SPEED * velocity / np.linalg.norm(velocity)
                    after = ways().after @ other + half_axis * ways().per_half_axis[0]
                    distances = np.linalg.norm(path_of(after), axis=0)
                    near, far = min(near, distances.min()), max(far, distances.max())
                if is_said:
                    assert low <= near <= far <= high
                else:
                    # what is not said may be true only where a sphere is as near as the cube's paths spread
                    assert near <= low + spread(half) or far >= high - spread(half)
    assert min(counts) > 40


def path_of(after):
    """Positions of a closed ellipse along an orbit, in closed form."""
    x, y, z, vx, _, vz = after
    cosine, sine = np.cos(N * TIMES), np.sin(N * TIMES)
    a, b = x, vx / N
    centre = y - 2.0 * b
    return np.array(
        [a * cosine + b * sine, centre - 2.0 * (a * sine - b * cosine), z * cosine + vz / N * sine]
    )


def spread(half):
    """How far paths of a cube spread at most, m, and twice that: by the largest of many, moved by a unit."""
    shifts = np.vstack([half * np.eye(6)[:3], SPEED * np.eye(6)[3:]])
    moved = [np.linalg.norm(path_of(ways().after @ shift), axis=0).max() for shift in shifts]
    return 2.0 * float(np.linalg.norm(moved[:3]) + np.linalg.norm(moved[3:])) + 2.0


def test_a_push_is_a_way_out_only_if_all_starts_of_a_cube_can_pay_it():
    limit = ways().most
    for state in drawn(40, 3, 0.0):
        for half_axis in (0.0, 30.0, 90.0):
            is_said = bool(ways()._are_by(half_axis, state[np.newaxis, :3], 0.5)[0])
            force, _ = pushed(state, half_axis)
            if is_said:
                assert max(map(abs, force)) < limit
                assert np.abs(force).sum() <= ways().affordable
            elif ways()._stay_between(half_axis, state[np.newaxis, :3], 0.5)[0]:
                assert max(map(abs, force)) > 0.9 * limit or np.abs(force).sum() > 0.9 * ways().affordable


def test_starts_beside_a_sphere_have_none_and_those_well_between_have():
    world = pack_world(MISSION)
    low, high = world.guard.keep_out, world.guard.keep_in
    for shell, expected in (((low - 1.0, 50.0, 0.0), low - 1.0), ((50.0, high + 2.0, 0.0), high + 2.0)):
        np.testing.assert_array_equal(open_starts.start_without_way_out(world, shell), [expected, 0.0, 0.0])
    assert open_starts.start_without_way_out(world, (60.0, 61.0, 0.0)) is None
    centres = np.array([[60.0, 0.0, 0.0], [0.0, 60.0, 0.0], [0.0, 0.0, 97.5], [99.5, 0.0, 0.0]])
    rest = open_starts._WaysOut(world, 0.0)
    assert rest.are_open(centres, 0.1).tolist() == [True, True, True, False]
