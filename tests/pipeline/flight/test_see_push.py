"""The push that shows what sets, against numpy's least squares along a path by matrix exponentials."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.linalg import expm

from pipeline.flight.control.controller import ControllerError, from_fuzzy
from pipeline.flight.fly.simulation import fly_all, fly_logged
from pipeline.flight.state.log import FlightLog, Scenario
from pipeline.flight.state.signals import constant
from pipeline.flight.world.surface import regular_placement
from tests.pipeline.flight.cases import SEEING, STARTS, mission
from tests.pipeline.flight.missions import MEAN_MOTION as N

Floats = NDArray[np.float64]

FREE = mission(attitude={"mode": "ideal"}, coast_when_complete=False)
HORIZON_S, TIME_S, DAMPING, SKIRT_M = 1500.0, 400.0, 0.08, 70.0
#: of the Clohessy-Wiltshire equations, s' = A s
SYSTEM = np.zeros((6, 6))
SYSTEM[:3, 3:] = np.eye(3)
SYSTEM[3, 0], SYSTEM[3, 4], SYSTEM[4, 3], SYSTEM[5, 2] = 3 * N**2, 2 * N, -2 * N, -(N**2)
#: over 0, 60, 120, … s
OVER = np.array([expm(60.0 * step * SYSTEM) for step in range(61)])
#: from where much sets unseen: behind the Sun's way
BEHIND = [
    Scenario(65.0 * np.array([np.cos(angle), np.sin(angle), 0.3]), np.zeros(3), 0.0)
    for angle in (3.7, 4.4, 5.1)
]


def expected_push(log: FlightLog, k: int) -> Floats:
    """The push at a sample, m/s, and how many points it is for."""
    points = regular_placement(99, 10.0)
    units = points / 10.0
    angles = log.sun_angle_rad[0] - N * 10.0 * np.arange(361)
    is_lit = points @ np.array([np.cos(angles), np.sin(angles), 0.0 * angles]) > 0.0
    remaining = 10.0 * (np.max(np.where(is_lit, np.arange(361), -1), axis=1) - k)
    wanted = ~log.is_inspected[k] & (remaining > 0.0) & (remaining <= HORIZON_S)
    state = np.concatenate((log.position_m[k], log.velocity_m_s[k]))
    rows, right = [np.sqrt(DAMPING) * np.eye(3)], [np.zeros(3)]
    for i in np.flatnonzero(wanted):
        looks = []
        for step in range(1, min(25, (360 - k) // 6) + 1):
            if not is_lit[i, k + 6 * step]:
                continue
            position = (OVER[step] @ state)[:3]
            short = 10.0 - units[i] @ position
            if np.linalg.norm(position) < 30.0:
                short = max(short, 1.0)
            looks.append((short, *(units[i] @ OVER[step][:3, 3:])))
        found = np.array(looks).reshape(-1, 4)
        if not len(found) or found[:, 0].min() <= 0.0:
            continue
        short, *slopes = found[np.argmin(found[:, 0] ** 2 / np.sum(found[:, 1:] ** 2, axis=1))]
        root = np.exp(-0.5 * remaining[i] / TIME_S)
        rows.append(root * np.array([slopes]) / 1000.0)
        right.append(root * np.array([short]) / 1000.0)
    push = np.linalg.lstsq(np.concatenate(rows), np.concatenate(right), rcond=None)[0]
    outward = state[:3] / np.linalg.norm(state[:3])
    nearness = np.clip((SKIRT_M - np.linalg.norm(state[:3])) / (SKIRT_M - 15.0), 0.0, 1.0)
    return push - 2.0 * nearness * min(push @ outward, 0.0) * outward


@pytest.mark.parametrize("start", BEHIND)
def test_it_is_the_damped_least_squares_push(start: Scenario) -> None:
    log = fly_logged(FREE, SEEING, start)
    samples = np.arange(0, 360, 5)
    expected = np.array([expected_push(log, k) for k in samples])
    np.testing.assert_allclose(log.fis_input[samples, :, 0], expected, rtol=0, atol=1e-9)
    assert np.abs(expected).max() > 0.005
    assert not expected[-1].any()  # an hour later nothing that sets is left to come


def test_the_aim_adds_what_is_urgent() -> None:
    push, aim, urgent = fly_logged(FREE, SEEING, STARTS[0]).fis_input.transpose(2, 0, 1)
    np.testing.assert_allclose(aim, push + 0.04 * urgent, rtol=0, atol=1e-15)
    assert np.abs(urgent).max() > 0.5


def test_it_must_say_how_urgent_and_how_damped() -> None:
    assert SEEING.fuzzy is not None
    for name in ("urgency_time_s", "see_damping_ks2"):
        silent = tuple(pair for pair in SEEING.fuzzy.attributes if pair[0] != name)
        with pytest.raises(ControllerError, match=f"senses .*see_push.* sets no {name}; give it"):
            from_fuzzy(replace(SEEING.fuzzy, attributes=silent))
    assert SEEING.constants[constant("see_damping_ks2")] == DAMPING


def test_flights_side_by_side_are_those_flown_alone() -> None:
    """While one lane coasts, its neighbours still sense."""
    together = fly_all(mission(), SEEING, STARTS)
    for i, start in enumerate(STARTS):
        alone = fly_all(mission(), SEEING, [start])
        assert together.delta_v_m_s[i] == alone.delta_v_m_s[0]
        assert together.inspected_count[i] == alone.inspected_count[0]
