"""The push that parks, against paths that SciPy integrates."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from pipeline.flight.fly.reference import reference_of
from pipeline.flight.reference.parking import park_push, tried
from pipeline.flight.state.log import Scenario
from tests.pipeline.flight import cases
from tests.pipeline.flight.cases import mission, with_attributes
from tests.pipeline.flight.missions import MEAN_MOTION

ORBIT_S = 2.0 * np.pi / MEAN_MOTION
#: the last minutes of a flight, when points no longer count
LATE = with_attributes(cases.PARKING, park_before_s="600")


def flight(controller=LATE):
    start = Scenario(np.array([50.0, 0.0, 0.0]), np.zeros(3), 0.3)
    return reference_of(mission(duration_s=400.0), controller, start)


def distances(state, orbits):
    """Distances of free motion, every half minute, m."""
    n = MEAN_MOTION

    def rates(_, s):
        return [*s[3:], 3.0 * n * n * s[0] + 2.0 * n * s[4], -2.0 * n * s[3], -n * n * s[2]]

    times = np.arange(0.0, orbits * ORBIT_S, 30.0)
    path = solve_ivp(rates, (0.0, times[-1]), state, method="DOP853", rtol=1e-10, atol=1e-8, t_eval=times).y
    return np.linalg.norm(path[:3], axis=0)


def states(count):
    """States about the chief, moving as flights do."""
    generator = np.random.default_rng(20)
    return np.hstack(
        [generator.normal(0.0, [30.0, 70.0, 20.0], (count, 3)), generator.normal(0.0, 0.04, (count, 3))]
    )


def test_what_is_pushed_stays_for_three_orbits_and_what_needs_no_push_gets_none():
    flown, nothing = flight(), np.zeros(99, dtype=np.bool_)
    pushes = [park_push(flown, 0, state, nothing) for state in states(200)]
    parked = [(s, push) for s, push in zip(states(200), pushes, strict=True) if push is not None]
    assert len(parked) > 60
    for state, push in parked:
        after = state + np.concatenate([np.zeros(3), push])
        far = distances(after, 3)
        assert far.min() > 15.0
        assert far.max() < 200.0
        assert not park_push(flown, 0, after, nothing).any()
    # where none is found, none of those tried stays
    for state, push in zip(states(200)[:30], pushes, strict=False):
        if push is None:
            after = [state + np.concatenate([np.zeros(3), each]) for each in tried(flown, state)]
            ends = [distances(each, 3) for each in after if np.abs(each - state).max() <= 1.0]
            assert all(far.min() < 19.0 or far.max() > 196.0 for far in ends)


def test_a_shifted_swing_keeps_the_deputy_away_wherever_the_ellipse_lies():
    for state in states(20):
        for push in tried(flight(), state):
            if push[2] != 0.0:
                x, y, z, u, v, w = state + np.concatenate([np.zeros(3), push])
                least = min(np.hypot(x, u / MEAN_MOTION), np.hypot(z, w / MEAN_MOTION))
                for shift in (-120.0, -30.0, 0.0, 60.0):
                    assert distances([x, y + shift, z, u, v, w], 1).min() > least - 0.01


@pytest.mark.parametrize("before_s", [0.0, 600.0])
def test_points_count_until_the_end_comes_near(before_s):
    """All points but one are unseen and dark soon: no ellipse shows enough."""
    controller = with_attributes(cases.PARKING, park_below_points="1", park_before_s=str(before_s))
    state = flight(controller).scenario
    coasting = np.array([*state.position_m, 0.0, -2.0 * MEAN_MOTION * 50.0, 0.0])
    push = park_push(flight(controller), 0, coasting, np.zeros(99, dtype=np.bool_))
    assert (push is None) == (before_s == 0.0)
