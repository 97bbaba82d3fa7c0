"""Signals that lead ahead: the push onto the tour near the chief, and the points that go dark first."""

from dataclasses import replace

import numpy as np
import pytest

from pipeline.flight.control.controller import Controller, ControllerError, from_fuzzy
from pipeline.flight.fly.simulation import fly_logged
from pipeline.flight.state.log import Scenario
from pipeline.flight.state.signals import constant
from tests.pipeline.flight.cases import HURRYING, SEEING, STARTS, TOURING, mission, touring


def with_attributes(controller: Controller, **changes: str | None) -> Controller:
    """Another controller, without the attributes that are None."""
    fuzzy = controller.fuzzy
    assert fuzzy is not None
    attributes = dict(fuzzy.attributes) | changes
    kept = sorted((name, text) for name, text in attributes.items() if text is not None)
    return from_fuzzy(replace(fuzzy, attributes=tuple(kept)))


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


def test_a_long_urgency_time_takes_the_middle_of_all() -> None:
    middling = with_attributes(HURRYING, urgency_time_s="1e9", skirt_distance_m="0", coast_below_points=None)
    log = fly_logged(mission(attitude={"mode": "ideal"}, coast_when_complete=False), middling, STARTS[0])
    target = log.target_m[:-1]
    has_target = np.linalg.norm(target, axis=1) > 0.1
    centroid = target[has_target] / np.linalg.norm(target[has_target], axis=1, keepdims=True)
    np.testing.assert_allclose(log.fis_input[has_target, :, 1], centroid, rtol=0, atol=1e-4)


@pytest.mark.parametrize(
    ("controller", "name", "value"),
    [
        (SEEING, "urgency_time_s", None),
        (SEEING, "see_damping_ks2", 0.08),
        (HURRYING, "urgency_time_s", 150.0),
        (HURRYING, "skirt_distance_m", 70.0),
        (TOURING, "tour_time_s", 700.0),
    ],
)
def test_a_controller_must_set_what_its_signals_need(
    controller: Controller, name: str, value: float | None
) -> None:
    if value is not None:
        assert controller.constants[constant(name)] == value
    if name != "skirt_distance_m":  # which has a default
        with pytest.raises(ControllerError, match=f"sets no {name}; give it"):
            _ = with_attributes(controller, **{name: None}).constants


@pytest.mark.parametrize("name", ["tour_time_s", "tour_wait_s"])
def test_from_half_an_orbit_on_no_push_across_the_track_leads_anywhere(name: str) -> None:
    with pytest.raises(ControllerError, match=rf"{name} 2839.*less than half an orbit, 2838"):
        fly_logged(mission(), touring(**{name: 2839.0}), STARTS[0])
