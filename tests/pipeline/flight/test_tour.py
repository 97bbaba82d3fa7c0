"""The push onto the tour, against matrix exponentials, and the flight that follows it."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.linalg import expm
from scipy.optimize import brentq

from pipeline.flight.control.controller import ControllerError
from pipeline.flight.fly.simulation import fly_logged
from pipeline.flight.state.log import FlightLog, Scenario
from pipeline.flight.state.signals import constant
from pipeline.physics.illumination import sun_direction_h, visible_share
from tests.pipeline.flight.cases import STARTS, TOURING, mission, touring
from tests.pipeline.flight.missions import MEAN_MOTION as N

Floats = NDArray[np.float64]

#: radius of the orbit about the Earth, whose gravitational parameter is 3.986004418e14 m^3/s^2
ORBIT_M = (3.986004418e14 / N**2) ** (1 / 3)
TIME_S, LEAN_M, SKIRT_M = 700.0, 20.0, 70.0
#: of the Clohessy-Wiltshire equations, s' = A s
SYSTEM = np.zeros((6, 6))
SYSTEM[:3, 3:] = np.eye(3)
SYSTEM[3, 0], SYSTEM[3, 4], SYSTEM[4, 3], SYSTEM[5, 2] = 3 * N**2, 2 * N, -2 * N, -(N**2)


def expected_pushes(log: FlightLog, ahead: Floats | float = TIME_S) -> Floats:
    """The push onto the tour of `TOURING` at each sample but the last, `ahead` (s) of it, (K, 3), m/s."""
    angle, up = log.sun_angle_rad[:-1] - N * ahead, np.sin(log.sun_elevation_rad[:-1])
    tour = np.column_stack(
        [
            -11.0 + 50.0 * np.cos(angle) - 30.0 * np.sin(2.0 * angle),
            80.0 * np.sin(angle) + 17.0 * np.cos(2.0 * angle),
            25.0 * np.sin(angle) - 14.0 * np.cos(2.0 * angle) + up * (12.0 - 40.0 * np.sin(2.0 * angle)),
        ]
    )
    tour += LEAN_M * log.fis_input[:, :, 1]
    position = log.position_m[:-1]
    over = expm(np.broadcast_to(ahead, len(position))[:, np.newaxis, np.newaxis] * SYSTEM)
    state = np.column_stack((position, log.velocity_m_s[:-1]))
    off = tour - np.einsum("kij,kj->ki", over[:, :3], state)
    push = np.linalg.solve(over[:, :3, 3:], off[:, :, np.newaxis])[:, :, 0]
    distance = np.linalg.norm(position, axis=1, keepdims=True)
    nearness = np.clip((SKIRT_M - distance) / (SKIRT_M - 15.0), 0.0, 1.0)
    towards = np.minimum(np.sum(push * position, axis=1, keepdims=True) / distance, 0.0)
    return np.asarray(push - 2.0 * nearness * towards * position / distance)


@pytest.mark.parametrize("elevation_rad", [0.0, -0.4])
def test_it_leads_to_where_the_tour_is_after_its_time(elevation_rad: float) -> None:
    what = mission(attitude={"mode": "ideal"}, coast_when_complete=False)
    log = fly_logged(what, TOURING, replace(STARTS[1], sun_elevation_rad=elevation_rad))
    np.testing.assert_allclose(log.fis_input[:, :, 0], expected_pushes(log), rtol=0, atol=1e-9)
    assert np.linalg.norm(log.position_m, axis=1).min() < SKIRT_M


@pytest.mark.parametrize("skirt_m", [10.0, 15.5, 70.0])
def test_near_the_chief_it_leads_around_it(skirt_m: float) -> None:
    """At the least distance what leads inwards is mirrored, halfway to the skirt it is left out."""
    what = mission(attitude={"mode": "ideal"}, duration_s=10.0)
    distances = np.array(
        [15.0, 0.5 * (15.0 + skirt_m), 15.0 + 0.75 * (skirt_m - 15.0), skirt_m, 1.2 * skirt_m]
    )
    if skirt_m < 15.0:  # it turns nothing, even of a deputy that is nearer
        distances = np.array([5.0, 8.0, 10.0, 15.0, 18.0])
    inwards = []
    for distance in distances:
        # the tour is on the other side of the chief, where the Sun is
        start = Scenario(np.array([-distance, 0.0, 0.0]), np.zeros(3), 0.0)
        push = [
            fly_logged(what, touring(skirt_distance_m=skirt, tour_lean_m=0.0), start).fis_input[0, :, 0]
            for skirt in (skirt_m, 0.0)
        ]
        np.testing.assert_allclose(push[0][1:], push[1][1:], rtol=0, atol=1e-12)
        assert push[1][0] > 0.02
        inwards.append(push[0][0] / push[1][0])
    kept = [-1.0, 0.0, 0.5, 1.0, 1.0] if skirt_m > 15.0 else [1.0] * 5
    np.testing.assert_allclose(inwards, kept, rtol=0, atol=1e-9)


def times_to_light(log: FlightLog) -> Floats:
    """`TIME_S` at each sample but the last, or where the Sun does not shine then, when it does again."""
    elevation = log.sun_elevation_rad[0]

    def share(angle: float) -> float:
        return visible_share(sun_direction_h(angle, elevation), ORBIT_M) - 0.5

    # the shadow is around the angle of midnight, pi
    end, begin = brentq(share, 0.5 * np.pi, np.pi), brentq(share, np.pi, 1.5 * np.pi)
    then = np.mod(log.sun_angle_rad[:-1] - N * TIME_S, 2.0 * np.pi)
    return np.where((end < then) & (then < begin), TIME_S + (then - end) / N, TIME_S)


def test_where_it_would_be_dark_it_leads_to_where_the_tour_is_when_light_returns() -> None:
    what = mission(attitude={"mode": "ideal"}, light={"shadow": "conical"}, coast_when_complete=False)
    start = replace(STARTS[1], sun_angle_rad=5.2, sun_elevation_rad=0.3)
    log = fly_logged(what, touring(tour_wait_s=2000.0), start)
    ahead = times_to_light(log)
    is_asked = ahead <= 2000.0
    assert 0 < np.sum(ahead > TIME_S) < len(ahead)
    assert 0 < np.sum(~is_asked) < len(ahead)
    asked = np.where(is_asked[:, np.newaxis], expected_pushes(log, ahead), 0.0)
    np.testing.assert_allclose(log.fis_input[:, :, 0], asked, rtol=0, atol=1e-9)


def test_a_controller_on_tour_must_say_how_far_it_looks_ahead() -> None:
    assert TOURING.constants[constant("tour_time_s")] == TIME_S
    with pytest.raises(ControllerError, match="sets no tour_time_s; give it"):
        _ = touring(tour_time_s=0.0).constants


def test_from_half_an_orbit_on_no_push_across_the_track_leads_anywhere() -> None:
    with pytest.raises(ControllerError, match=r"tour_time_s 2839.*less than half an orbit, 2838"):
        fly_logged(mission(), touring(tour_time_s=2839.0), STARTS[0])
    with pytest.raises(ControllerError, match=r"tour_wait_s 2839.*less than half an orbit, 2838"):
        fly_logged(mission(), touring(tour_wait_s=2839.0), STARTS[0])
