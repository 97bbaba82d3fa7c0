"""Flights are flown as they are written: of every kind, by name and with any settings, constants and signals.

`DRAWN_FLIGHTS=1000 python -m pytest tests/pipeline/flight/test_as_written.py -k any` draws that many of
each kind; four are drawn by default, the same each time.
"""

import os
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import HealthCheck, Phase, given, reject, settings
from hypothesis import strategies as st
from hypothesis.internal.conjecture import providers

from fis_tools.compiled.decorator import plainly
from pipeline.flight.control.controller import ControllerError, open_loop
from pipeline.flight.fly.population import FlightError
from pipeline.flight.fly.simulation import fly_logged
from pipeline.flight.state.log import Scenario
from pipeline.settings.experiment import SettingError
from tests import night
from tests.pipeline.flight import cases, drawn
from tests.pipeline.flight.as_written import assert_as_written
from tests.pipeline.flight.cases import STARTS, STEERING, mission
from tests.pipeline.flight.departures import (
    DRAGGED,
    ELLIPSE,
    FIXES,
    LAYOUT,
    LOW_ORBIT,
    REAL,
    SIGHTED,
    TUMBLING,
    VARYING,
)
from tests.pipeline.flight.guarded import EARLY, LAST_MOMENT, PASSIVE, guarded, pushing, starts_at_rest
from tests.pipeline.flight.missions import FULL_INERTIA, MEAN_MOTION

#: how many flights of a kind are drawn
DRAWN = int(os.environ.get("DRAWN_FLIGHTS", "4"))
#: no two of these can be drawn at a time, or their kinds would be compiled apart
UNDRAWN = ("guidance", "chief.shape", "path", "light.reflection", "actuators.kind")

#: of each kind that is compiled apart (the last for these flights alone): a mission, what is not drawn of it,
#: and whether its Sun is out of the orbit plane
KINDS = {
    "the paper's light and camera, clusters, the safety layer": (
        mission(guidance={"kind": "clusters"}, safety=vars(EARLY), attitude={"mode": "ideal"}),
        (
            *("light", "navigation", "actuators", "dynamics", "safety.kind", "radius_m"),
            *("max_incidence_deg", "max_range_m", "min_range_m", "min_sun_angle_deg"),
        ),
        False,
    ),
    "shadow, a camera with limits, errors, motion about the Earth": (
        mission(
            safety=vars(EARLY),
            light={"shadow": "conical"},
            navigation={"mode": "fixes"},
            actuators={"kind": "real"},
            dynamics={"model": "two_body"},
        ),
        (),
        True,
    ),
    "a chief that hides parts of itself and mirrors": (
        mission(
            chief={"shape": "mesh", "num_points": 60},
            safety=vars(EARLY),
            light={
                "reflection": "blinn_phong",
                "least_intensity": (0.0,) * 3,
                "greatest_intensity": (2.0,) * 3,
            },
            actuators={"kind": "real"},
            attitude={"mode": "ideal"},
        ),
        ("num_points",),
        True,
    ),
}

IDEAL = {"mode": "ideal"}
POINTED = mission(attitude=IDEAL)
TURNING = {"initial_quaternion": (0.5, -0.1, 0.5, 0.7), "initial_angular_velocity_rad_s": (0.02, -0.05, 0.03)}
LATE = {"fix_period_s": 20.0, "delay_s": 10.0, "outlier_share": 0.1}
#: some forces beyond the thruster's, and fewer than the flight has periods
PLAN = open_loop("plan", np.random.default_rng(1).normal(0.0, [0.02, 0.5, 0.01], (30, 3)))


def flight(controller=STEERING, start=STARTS[0], dispersions=None, **changes):
    """A mission, a controller and a start."""
    return replace(mission(**changes), dispersions=dispersions or {}), controller, start


CLUSTERS = {"kind": "clusters"}
LAST = vars(LAST_MOMENT)
FLIGHTS = {
    "paper": flight(),
    "clusters": flight(guidance=CLUSTERS),
    "full inertia": flight(
        start=STARTS[1],
        deputy={"inertia_kg_m2": FULL_INERTIA, "max_momentum_n_m_s": 0.04} | TURNING,
        attitude={"gravity_gradient": True},
    ),
    "ball that is sometimes fast": flight(start=STARTS[1], deputy={"inertia_kg_m2": cases.ball(0.4)}),
    "pole blending": flight(start=cases.OVER_POLES[1], attitude={"pole_blending": True}),
    "over the poles": flight(start=cases.OVER_POLES[0], guidance=CLUSTERS),
    "attitude periods of 2.5 s": flight(attitude_period_s=2.5, deputy={"inertia_kg_m2": FULL_INERTIA}),
    "plan": flight(PLAN),
    "late fixes, late thrusters with errors": flight(
        navigation=FIXES | LATE | {"gate_sigma": 4.0, "attitude_bias_deg": 6.0},
        actuators=REAL | {"delay_s": 10.0, "impulse_step_n_s": 0.01},
        safety=LAST,
    ),
    "range and bearing, an attitude known with an error, a layout": flight(
        start=STARTS[1],
        navigation=FIXES | SIGHTED | LATE,
        actuators=REAL
        | LAYOUT
        | {"delay_s": 10.0, "thrust_arm_m": 0.02, "failed_thruster": 2, "failure_s": 95.0},
        safety=LAST,
    ),
    "fixes, far beyond the limits": flight(
        start=replace(STARTS[0], position_m=np.array([0.0, 1000.0, 0.0])), attitude=IDEAL, navigation=FIXES
    ),
    "fixes about the oblate Earth, noise of the distance": flight(
        start=replace(STARTS[0], position_m=np.array([0.0, 400.0, 30.0])),
        attitude=IDEAL,
        navigation=FIXES | {"process_noise_m_s2": None},
        dynamics=LOW_ORBIT,
        orbit=ELLIPSE,
    ),
    "range and bearing, errors that vary": flight(
        attitude=IDEAL,
        navigation=FIXES | SIGHTED,
        actuators=REAL | {"thrust_arm_m": 0.02, "specific_impulse_s": 60.0},
        dispersions=VARYING,
    ),
    "about the oblate Earth, in and out of its shadow": flight(
        attitude=IDEAL, dynamics=LOW_ORBIT, orbit=ELLIPSE, light={"shadow": "conical"}, dispersions=DRAGGED
    ),
    "on an ellipse, past the perigee": flight(
        attitude=IDEAL, dynamics=LOW_ORBIT, orbit=ELLIPSE | {"eccentricity": 0.05, "true_anomaly_deg": 40.0}
    ),
    "Hill axes, weak thruster, slow clocks, narrow camera": flight(
        cases.RESTORING,
        attitude_period_s=2.0,
        control_period_s=20.0,
        deputy={"max_force_n": 0.004},
        sensor={"half_angle_deg": 7.0, "boresight": (-0.8, 0.6, 0.0)},
    ),
    "systems of one, two and three inputs": flight(cases.MIXED, STARTS[1]),
    "a controller that is often silent": flight(cases.SPARSE, STARTS[2]),
    "free motion, target and Sun": flight(cases.ORBITAL, attitude=IDEAL),
    "where drift leads": flight(cases.LOOKING_AHEAD, STARTS[1], attitude=IDEAL),
    "what coasting shows": flight(cases.FORESEEING, cases.OVER_POLES[1], attitude=IDEAL),
    "what goes dark soon": flight(cases.HURRYING, STARTS[1], attitude=IDEAL),
    "a decision every half minute, safety layer": (guarded(PASSIVE), cases.PAUSING, starts_at_rest(3, 47)[0]),
    "the push that shows what sets on a tumbling chief": flight(cases.SEEING, attitude=IDEAL, chief=TUMBLING),
    "the push that parks": flight(cases.PARKING, attitude=IDEAL),
    "the push onto a tour": flight(cases.TOURING, STARTS[1], attitude=IDEAL),
    "turned aside between the least distance and a skirt just outside it": flight(
        cases.touring(skirt_distance_m=15.5),
        replace(STARTS[1], position_m=np.array([9.0, 12.2, 1.0])),
        attitude=IDEAL,
    ),
    "onto a tour when the shadow ends": flight(
        cases.touring(tour_wait_s=2000.0),
        replace(STARTS[1], sun_angle_rad=5.2),
        attitude=IDEAL,
        light={"shadow": "conical"},
    ),
    "safety layer against a plan": (guarded(LAST_MOMENT), PLAN, starts_at_rest(3, 43)[1]),
    "safety layer against a push": (guarded(EARLY), pushing(-0.3), STARTS[2]),
    "few on a spiral": flight(chief={"placement": "fibonacci", "num_points": 37, "inspection_radius_m": 8.0}),
}
TILTED = replace(STARTS[0], sun_elevation_rad=0.5)
SHADOW = {"shadow": "conical"}
#: seen where it reflects neither too little nor too much, and while the Sun is 3 degrees below the horizon
GLITTER = {
    "past_terminator_deg": 3.0,
    "reflection": "blinn_phong",
    "least_intensity": (0.7,) * 3,
    "greatest_intensity": (2.0, 0.95, 2.0),
}
FLIGHTS |= {
    name: flight(cases.SEEING, TILTED, attitude=IDEAL, **world)
    for name, world in {
        "a Sun out of the plane": {},
        "shadow": {"light": SHADOW},
        "a camera of little sight": {
            "sensor": {"max_incidence_deg": 65.0, "max_range_m": 90.0, "min_sun_angle_deg": 35.0}
            | {"min_range_m": 68.0}
        },
        "a camera that sees more than half of all, backwards": {
            "sensor": {"half_angle_deg": 120.0, "boresight": (0.0, 0.0, 1.0)}
        },
        "all of it on a chief that tumbles": {
            "light": GLITTER | SHADOW | {"min_fraction": 1.0},
            "sensor": {"max_incidence_deg": 65.0},
            "chief": {"initial_angular_velocity_rad_s": (0.003, 0.0, 0.002)},
        },
        "a chief that hides parts of itself and tumbles": {
            "light": SHADOW,
            "sensor": {"max_range_m": 120.0, "rectangle_deg": (9.0, 4.0), "up": (0.0, 0.6, 0.8)},
            "chief": {"shape": "mesh", "initial_angular_velocity_rad_s": (0.002, 0.001, 0.003)},
        },
    }.items()
}
#: those that a developer waits for
QUICK = (
    *("paper", "clusters", "full inertia", "plan", "late fixes, late thrusters with errors"),
    *("pole blending", "Hill axes, weak thruster, slow clocks, narrow camera", "what goes dark soon"),
    "about the oblate Earth, in and out of its shadow",
    "on an ellipse, past the perigee",
    "safety layer against a push",
    "shadow",
)


@pytest.mark.parametrize(
    "name", [name if name in QUICK else pytest.param(name, marks=pytest.mark.slow) for name in FLIGHTS]
)
def test_a_flight(name: str) -> None:
    what, controller, start = FLIGHTS[name]
    log = assert_as_written(replace(what, duration_s=40 * what.control_period_s), controller, start)
    assert log.force_hill_n.any()


@settings(
    max_examples=DRAWN,
    deadline=None,
    derandomize=DRAWN <= 6,
    suppress_health_check=list(HealthCheck),
    phases=(Phase.generate,) if DRAWN <= 6 else tuple(Phase),  # making a failure small takes minutes
)
@given(data=st.data())
def fly_any(kind: str, compared: list[str], data: st.DataObject) -> None:
    """Fly flights of a kind, drawn by Hypothesis, as they are written; note each that was compared."""
    base, undrawn, is_tilted = KINDS[kind]
    what = data.draw(drawn.mission(base, UNDRAWN + undrawn))
    start = data.draw(drawn.scenario(what, is_tilted))
    controller = data.draw(drawn.flown(what))
    try:
        assert_as_written(what, controller, start)
    except (SettingError, ControllerError, FlightError):  # as a whole it is refused, or leaves all bounds
        reject()
    compared.append(kind)


@pytest.mark.slow
@pytest.mark.parametrize("kind", [*KINDS][: night.count(2, len(KINDS))])
def test_any_flight(kind: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """The same flights whatever ran before: Hypothesis tries the numbers in loaded modules, too."""
    monkeypatch.setattr(providers, "_get_local_constants", providers.Constants)
    monkeypatch.setattr(providers, "CONSTANTS_CACHE", providers.LRUCache(1024))
    compared: list[str] = []
    fly_any(kind=kind, compared=compared)
    assert len(compared) >= DRAWN


@pytest.mark.slow
@pytest.mark.parametrize("goes_on", [False, True])
def test_an_hour_in_which_all_is_inspected(goes_on: bool) -> None:
    log = assert_as_written(replace(POINTED, coast_when_complete=not goes_on), STEERING, cases.COMPLETED)
    is_complete = log.is_inspected.all(axis=1)[:-1]
    assert 10 < is_complete.sum() < 300
    assert np.all(log.is_decided == (~is_complete | goes_on))


def test_clusters_are_forgotten_at_a_sample_without_candidates() -> None:
    """Far out under the Sun the deputy sees all that is lit; then it is thrown behind a chief that turns."""
    what = mission(
        guidance={"kind": "clusters"},
        chief={"initial_angular_velocity_rad_s": (0.015, 0.0, MEAN_MOTION)},
        deputy={"max_force_n": 10.0},
        control_period_s=100.0,
        duration_s=300.0,
    )
    start = Scenario(np.array([0.0, 2000.0, 0.0]), np.zeros(3), 0.5 * np.pi + 100.0 * MEAN_MOTION)
    thrown = open_loop("throw", np.array([[0.0, 0.0, 0.0], [0.0, -9.6, 0.0]]))
    num_candidates = assert_as_written(what, thrown, start).num_candidates
    assert num_candidates[0] > 40
    assert num_candidates[1] == 0
    assert num_candidates[2] > 20


#: of each thing that may be sensed, guarded or moved by, one
PLAIN = (
    *("paper", "clusters", "full inertia", "pole blending", "late fixes, late thrusters with errors"),
    *("free motion, target and Sun", "what coasting shows", "what goes dark soon"),
    *("the push that shows what sets on a tumbling chief", "the push onto a tour"),
    "the push that parks",
    *("safety layer against a push", "about the oblate Earth, in and out of its shadow"),
)


@pytest.mark.slow
@pytest.mark.parametrize("name", night.by_day(PLAIN, 2))
def test_plain_python_flies_as_compiled_code_does_to_the_last_bit(name: str) -> None:
    """So that it can fly where there is no compiler."""
    what, controller, start = FLIGHTS[name]
    brief = replace(what, duration_s=40 * what.control_period_s)
    fast = fly_logged(brief, controller, start)
    with plainly("pipeline"):
        plain = fly_logged(brief, controller, start)
    for field, expected, actual in zip(fast._fields, fast, plain, strict=True):
        np.testing.assert_array_equal(actual, expected, err_msg=field)
