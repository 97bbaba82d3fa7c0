"""What goes dark for good, against numpy over the Sun's whole path."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from pipeline.flight.control.controller import Controller, ControllerError, from_fuzzy
from pipeline.flight.fly.simulation import fly_all, fly_logged
from pipeline.flight.state.log import FlightLog
from pipeline.flight.state.signals import constant
from pipeline.flight.world.surface import regular_placement
from tests.pipeline.flight.cases import HURRYING, STARTS, mission

IDEAL = {"mode": "ideal"}
TIME_S, SKIRT_M = 150.0, 70.0


def with_attributes(**changes: str | None) -> Controller:
    """`HURRYING` with other attributes; without those that are None."""
    assert HURRYING.fuzzy is not None
    attributes = dict(HURRYING.fuzzy.attributes) | changes
    kept = sorted((name, text) for name, text in attributes.items() if text is not None)
    return from_fuzzy(replace(HURRYING.fuzzy, attributes=tuple(kept)))


#: it never coasts, so that every sample shows what it senses
RESTLESS = with_attributes(coast_below_points=None)


def expected_direction(log: FlightLog) -> NDArray[np.float64]:
    """The urgent direction at each sample but the last, shape (K, 3)."""
    points = regular_placement(99, 10.0)
    sun = np.column_stack([np.cos(log.sun_angle_rad), np.sin(log.sun_angle_rad), 0.0 * log.sun_angle_rad])
    is_lit = points @ sun.T > 0.0
    samples = np.arange(is_lit.shape[1])
    last_lit = np.max(np.where(is_lit, samples, -1), axis=1)
    ahead_s = 10.0 * (last_lit[:, np.newaxis] - samples)
    weights = np.where(is_lit & ~log.is_inspected.T, np.exp(-ahead_s / TIME_S), 0.0)[:, :-1]
    sums = weights.T @ points
    lengths = np.linalg.norm(sums, axis=1, keepdims=True)
    directions = np.where(lengths > 0.0, sums / np.maximum(lengths, 1e-300), 0.0)
    position = log.position_m[:-1]
    distance = np.linalg.norm(position, axis=1, keepdims=True)
    nearness = np.clip((SKIRT_M - distance) / (SKIRT_M - 15.0), 0.0, 1.0)
    towards = np.minimum(np.sum(directions * position, axis=1, keepdims=True) / distance, 0.0)
    return directions - 2.0 * nearness * towards * position / distance


@pytest.mark.parametrize("start", STARTS)
def test_it_points_to_what_is_lit_for_the_last_time_soon(start) -> None:  # type: ignore[no-untyped-def]
    log = fly_logged(mission(attitude=IDEAL, coast_when_complete=False), RESTLESS, start)
    expected = expected_direction(log)
    np.testing.assert_allclose(log.fis_input[:, :, 1], expected, rtol=0, atol=1e-9)
    assert np.ptp(expected, axis=0).max() > 0.5


def test_a_short_time_singles_out_what_goes_first_and_a_long_one_takes_the_middle() -> None:
    middling = with_attributes(urgency_time_s="1e9", skirt_distance_m="0", coast_below_points=None)
    log = fly_logged(mission(attitude=IDEAL, coast_when_complete=False), middling, STARTS[0])
    target = log.target_m[:-1]
    has_target = np.linalg.norm(target, axis=1) > 0.1
    centroid = target[has_target] / np.linalg.norm(target[has_target], axis=1, keepdims=True)
    np.testing.assert_allclose(log.fis_input[has_target, :, 1], centroid, rtol=0, atol=1e-4)


def test_a_controller_that_senses_urgency_must_say_how_urgent() -> None:
    with pytest.raises(ControllerError, match="sets no urgency_time_s; give it"):
        with_attributes(urgency_time_s=None)
    constants = HURRYING.constants
    assert constants[constant("urgency_time_s")] == TIME_S
    assert constants[constant("skirt_distance_m")] == SKIRT_M


def test_flights_side_by_side_are_those_flown_alone() -> None:
    """While one lane coasts, its neighbours still sense."""
    together = fly_all(mission(), HURRYING, STARTS)
    for i, start in enumerate(STARTS):
        alone = fly_all(mission(), HURRYING, [start])
        assert together.delta_v_m_s[i] == alone.delta_v_m_s[0]
        assert together.inspected_count[i] == alone.inspected_count[0]
