"""The push onto the tour, against matrix exponentials, and the flight that follows it."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.linalg import expm

from pipeline.flight.controller import Controller, ControllerError, constants_of, from_fuzzy
from pipeline.flight.log import FlightLog
from pipeline.flight.signals import constant
from pipeline.flight.simulation import fly_logged
from tests.pipeline.flight.cases import STARTS, TOURING, mission
from tests.pipeline.flight.missions import MEAN_MOTION as N

Floats = NDArray[np.float64]

TIME_S, LEAN_M, SKIRT_M = 700.0, 20.0, 70.0
#: of the Clohessy-Wiltshire equations, s' = A s
SYSTEM = np.zeros((6, 6))
SYSTEM[:3, 3:] = np.eye(3)
SYSTEM[3, 0], SYSTEM[3, 4], SYSTEM[4, 3], SYSTEM[5, 2] = 3 * N**2, 2 * N, -2 * N, -(N**2)


def expected_pushes(log: FlightLog) -> Floats:
    """The push onto the tour of `TOURING` at each sample but the last, shape (K, 3), m/s."""
    angle, up = log.sun_angle_rad[:-1] - N * TIME_S, np.sin(log.sun_elevation_rad[:-1])
    tour = np.column_stack(
        [
            -11.0 + 50.0 * np.cos(angle) - 30.0 * np.sin(2.0 * angle),
            80.0 * np.sin(angle) + 17.0 * np.cos(2.0 * angle),
            25.0 * np.sin(angle) - 14.0 * np.cos(2.0 * angle) + up * (12.0 - 40.0 * np.sin(2.0 * angle)),
        ]
    )
    tour += LEAN_M * log.fis_input[:, :, 1]
    over = expm(TIME_S * SYSTEM)
    position = log.position_m[:-1]
    state = np.column_stack((position, log.velocity_m_s[:-1]))
    push = np.linalg.solve(over[:3, 3:], (tour - state @ over[:3].T).T).T
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


def with_time(text: str) -> Controller:
    assert TOURING.fuzzy is not None
    attributes = dict(TOURING.fuzzy.attributes) | {"tour_time_s": text}
    return from_fuzzy(replace(TOURING.fuzzy, attributes=tuple(sorted(attributes.items()))))


def test_a_controller_on_tour_must_say_how_far_it_looks_ahead() -> None:
    assert constants_of(TOURING)[constant("tour_time_s")] == TIME_S
    with pytest.raises(ControllerError, match="sets no tour_time_s; give it"):
        constants_of(with_time("0"))


def test_from_half_an_orbit_on_no_push_across_the_track_leads_anywhere() -> None:
    with pytest.raises(ControllerError, match=r"tour_time_s 2839.*less than half an orbit, 2838"):
        fly_logged(mission(), with_time("2839.0"), STARTS[0])
