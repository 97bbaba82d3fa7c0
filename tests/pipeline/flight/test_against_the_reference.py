"""The fast flight against the readable reference, field by field of everything that happens.

The two integrate the attitude by different methods of fourth order, so that after an hour they are some
micrometres apart, and angles more where a projection is short; with ideal pointing only rounding is left.
"""

from collections.abc import Iterable
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from fis_tools.compiled import cache, decorator
from pipeline.flight.control.controller import Controller, coast, law_of, open_loop
from pipeline.flight.fly.simulation import fly_logged
from pipeline.flight.reference.channels import channels_of, plan_of
from pipeline.flight.reference.loop import fly, inference_of
from pipeline.flight.state.log import FlightLog, Scenario
from pipeline.settings.experiment import Mission
from tests.pipeline.flight.cases import (
    COMPLETED,
    FORESEEING,
    HURRYING,
    LOOKING_AHEAD,
    MIXED,
    ORBITAL,
    OVER_POLES,
    PAUSING,
    RESTORING,
    SEEING,
    SPARSE,
    STARTS,
    STEERING,
    TOURING,
    assert_same,
    ball,
    mission,
    touring,
)
from tests.pipeline.flight.guarded import EARLY, LAST_MOMENT, PASSIVE, guarded, pushing, starts_at_rest
from tests.pipeline.flight.missions import FULL_INERTIA, MEAN_MOTION

TUMBLING = {"initial_angular_velocity_rad_s": (0.01, -0.02, 0.005)}
IDEAL = {"mode": "ideal"}
BLENDING = {"pole_blending": True}

FIXES = {
    "mode": "fixes",
    "bias_m": 0.5,
    "outlier_m": 20.0,
    "process_noise_m_s2": 1e-5,
    "execution_error": 0.05,
    "initial_velocity_m_s": 0.001,
}
SIGHTED = {
    "measures": "range_bearing",
    "range_noise_m": 0.3,
    "bearing_noise_deg": 0.2,
    "attitude_bias_deg": 1.0,
    "attitude_noise_deg": 0.3,
}
REAL = {"kind": "real", "scale_error": 0.05, "misalignment_deg": 2.0, "least_impulse_n_s": 0.02}

#: a thruster a direction beside the centre of mass, askew and weak
ASKEW = tuple(
    (*np.roll((0.15, 0.02 * sign, -0.03), axis), *np.roll((sign * 0.8, 0.6, 0.0), axis), 0.03)
    for axis in range(3)
    for sign in (1.0, -1.0)
)

LAYOUT = {
    "thrusters": ASKEW,
    "specific_impulse_s": 60.0,
    "least_impulse_n_s": 0.01,
    "impulse_step_n_s": 0.005,
}

LOW_ORBIT = {
    "model": "two_body",
    "eccentricity": 0.02,
    "inclination_deg": 51.6,
    "latitude_argument_deg": 30.0,
    "j2": 1.08262668e-3,
    "drag_m_s2": 3e-7,
    "radiation_m_s2": 1e-7,
}

#: what may vary within a flight: none stays constant or normal alone
VARYING = {
    "navigation": {
        "bias_m": {"kind": "normal", "mean": 0.3, "std": 0.5, "correlation_s": 400.0},
        "range_noise_m": {"kind": "uniform", "low": 0.1, "high": 0.6, "correlation_s": 1000.0},
        "bearing_noise_deg": {"kind": "normal", "mean": 0.2, "std": 0.1, "low": 0.0, "correlation_s": 100.0},
        "attitude_bias_deg": {"kind": "normal", "mean": 0.0, "std": 1.0, "correlation_s": 300.0},
        "attitude_noise_deg": {"kind": "uniform", "low": 0.0, "high": 0.4, "correlation_s": 50.0},
    },
    "actuators": {
        "scale_error": {"kind": "normal", "mean": 0.0, "std": 0.1, "correlation_s": 600.0},
        "misalignment_deg": {"kind": "uniform", "low": -5.0, "high": 5.0, "correlation_s": 200.0},
    },
}
DRAGGED = {"dynamics.drag_m_s2": {"kind": "normal", "mean": 1e-5, "std": 3e-6, "correlation_s": 300.0}}

#: some forces beyond the thruster's, and fewer than the flight has periods
PLAN = open_loop("plan", np.random.default_rng(1).normal(0.0, [0.02, 0.5, 0.01], (300, 3)))

FLOWN = {
    "paper": (mission(), STEERING, STARTS),
    "clusters": (mission(guidance={"kind": "clusters"}), STEERING, STARTS),
    "full inertia": (mission(deputy={"inertia_kg_m2": FULL_INERTIA}), STEERING, STARTS),
    "a start that turns, full inertia": (
        mission(
            deputy={
                "inertia_kg_m2": FULL_INERTIA,
                "initial_quaternion": (0.5, -0.1, 0.5, 0.7),
                "initial_angular_velocity_rad_s": (0.02, -0.05, 0.03),
            }
        ),
        STEERING,
        STARTS,
    ),
    "light ball": (mission(deputy={"inertia_kg_m2": ball(0.05)}), STEERING, STARTS),
    "ball that is sometimes fast": (mission(deputy={"inertia_kg_m2": ball(0.4)}), STEERING, STARTS),
    "heavy ball": (mission(deputy={"inertia_kg_m2": ball(2.0)}), STEERING, STARTS),
    "tumbling chief": (mission(chief=TUMBLING), STEERING, STARTS),
    "pole blending": (mission(attitude=BLENDING), STEERING, [*STARTS, *OVER_POLES]),
    "over the poles": (mission(guidance={"kind": "clusters"}), STEERING, OVER_POLES),
    "over the poles, full inertia": (mission(deputy={"inertia_kg_m2": FULL_INERTIA}), STEERING, OVER_POLES),
    "attitude period 0.5 s": (mission(attitude_period_s=0.5), STEERING, STARTS),
    "attitude period 2 s": (mission(attitude_period_s=2.0), STEERING, STARTS),
    "attitude period 2.5 s": (mission(attitude_period_s=2.5), STEERING, STARTS),
    "attitude period 2.5 s, full inertia": (
        mission(attitude_period_s=2.5, deputy={"inertia_kg_m2": FULL_INERTIA}),
        STEERING,
        STARTS,
    ),
    "plan": (mission(), PLAN, STARTS),
    "late fixes, late thrusters with errors": (
        mission(
            navigation=FIXES
            | {"fix_period_s": 20.0, "delay_s": 10.0, "outlier_share": 0.1, "gate_sigma": 4.0},
            actuators=REAL | {"delay_s": 10.0, "impulse_step_n_s": 0.01},
            safety=vars(LAST_MOMENT),
        ),
        STEERING,
        STARTS,
    ),
    "range and bearing, an attitude known with an error": (
        mission(
            navigation=FIXES | SIGHTED | {"fix_period_s": 20.0, "delay_s": 10.0, "outlier_share": 0.1},
            actuators=REAL | LAYOUT | {"delay_s": 10.0, "thrust_arm_m": 0.02},
            safety=vars(LAST_MOMENT),
            duration_s=1200.0,
        ),
        STEERING,
        STARTS,
    ),
    "coast": (mission(), coast(), [*STARTS, *OVER_POLES]),
    "Hill axes, weak thruster, slow clocks, narrow camera": (
        mission(
            attitude_period_s=2.0,
            control_period_s=20.0,
            deputy={"max_force_n": 0.004},
            sensor={"half_angle_deg": 7.0},
        ),
        RESTORING,
        STARTS,
    ),
    "systems of one, two and three inputs": (mission(), MIXED, [*STARTS, COMPLETED]),
    "a controller that is often silent": (mission(), SPARSE, STARTS),
    "free motion, target and Sun": (mission(), ORBITAL, STARTS),
    "where drift leads": (mission(), LOOKING_AHEAD, STARTS),
    "what coasting shows": (mission(), FORESEEING, STARTS),
    "what goes dark soon": (mission(), HURRYING, STARTS),
    "a decision every half minute": (mission(), PAUSING, STARTS),
    "the push that shows what sets": (mission(), SEEING, STARTS),
    "the push onto a tour": (mission(), TOURING, STARTS),
    "fewer points on a spiral": (
        mission(chief={"placement": "fibonacci", "num_points": 37, "inspection_radius_m": 8.0}),
        STEERING,
        STARTS,
    ),
}

POINTED = {
    "centroid, coasting at the end": (mission(attitude=IDEAL), STEERING, [*STARTS, COMPLETED]),
    "going on when complete": (mission(attitude=IDEAL, coast_when_complete=False), STEERING, [COMPLETED]),
    "clusters": (mission(attitude=IDEAL, guidance={"kind": "clusters"}), STEERING, [*STARTS, *OVER_POLES]),
    "tumbling chief": (mission(attitude=IDEAL, chief=TUMBLING), STEERING, STARTS),
    "range and bearing, errors that vary": (
        replace(
            mission(
                attitude=IDEAL,
                navigation=FIXES | SIGHTED,
                actuators=REAL | {"thrust_arm_m": 0.02, "specific_impulse_s": 60.0},
                safety=vars(LAST_MOMENT),
            ),
            dispersions=VARYING,
        ),
        STEERING,
        STARTS,
    ),
    "over a pole without force": (mission(attitude=IDEAL), coast(), OVER_POLES),
    "pole blending": (mission(attitude=IDEAL | BLENDING), STEERING, [*STARTS, *OVER_POLES]),
    "Hill axes": (mission(attitude=IDEAL), RESTORING, STARTS),
    "free motion, target and Sun": (mission(attitude=IDEAL), ORBITAL, [*STARTS, *OVER_POLES]),
    "where drift leads": (mission(attitude=IDEAL), LOOKING_AHEAD, [*STARTS, *OVER_POLES]),
    "what coasting shows": (mission(attitude=IDEAL), FORESEEING, [*STARTS, *OVER_POLES]),
    "what coasting shows of a tumbling chief": (mission(attitude=IDEAL, chief=TUMBLING), FORESEEING, STARTS),
    "what goes dark soon": (mission(attitude=IDEAL), HURRYING, [*STARTS, *OVER_POLES]),
    "what goes dark soon on a tumbling chief": (mission(attitude=IDEAL, chief=TUMBLING), HURRYING, STARTS),
    "a decision every half minute": (mission(attitude=IDEAL), PAUSING, [*STARTS, *OVER_POLES]),
    "the push that shows what sets": (mission(attitude=IDEAL), SEEING, [*STARTS, *OVER_POLES]),
    "the push that shows what sets on a tumbling chief": (
        mission(attitude=IDEAL, chief=TUMBLING),
        SEEING,
        STARTS[:1],
    ),
    "a decision every half minute, safety layer": (guarded(PASSIVE), PAUSING, starts_at_rest(3, 47)),
    "safety layer, a few forces changed": (guarded(PASSIVE), STEERING, [*STARTS, *starts_at_rest(3, 47)]),
    "safety layer against a plan": (guarded(LAST_MOMENT), PLAN, [*STARTS, *starts_at_rest(3, 43)]),
    "safety layer against a push": (guarded(EARLY), pushing(-0.3), STARTS),
    "about the oblate Earth, in and out of its shadow": (
        replace(
            mission(attitude=IDEAL, dynamics=LOW_ORBIT, light={"shadow": "conical"}), dispersions=DRAGGED
        ),
        STEERING,
        STARTS,
    ),
    "onto a tour when the shadow ends": (
        mission(attitude=IDEAL, light={"shadow": "conical"}),
        touring(tour_wait_s=2000.0),
        [replace(STARTS[1], sun_angle_rad=5.2)],
    ),
    "another camera": (mission(attitude=IDEAL, sensor={"boresight": (-0.8, 0.6, 0.0)}), STEERING, STARTS),
}


#: those that a developer waits for; the others are slow
QUICK = {
    *("paper", "clusters", "full inertia", "pole blending", "ball that is sometimes fast", "plan"),
    *(
        "late fixes, late thrusters with errors",
        "systems of one, two and three inputs",
        "what coasting shows",
    ),
    *("attitude period 2.5 s, full inertia", "Hill axes, weak thruster, slow clocks, narrow camera"),
    *("centroid, coasting at the end", "going on when complete", "what goes dark soon", "another camera"),
    *("safety layer, a few forces changed", "about the oblate Earth, in and out of its shadow"),
}


def named(cases: Iterable[str]) -> list[object]:
    return [name if name in QUICK else pytest.param(name, marks=pytest.mark.slow) for name in cases]


def fly_both(what: Mission, controller: Controller, start: Scenario) -> tuple[FlightLog, FlightLog]:
    plan = plan_of(law_of(controller, what).plans)
    channels = channels_of(controller.systems, controller.force_axes, plan, controller.constants)
    return fly_logged(what, controller, start), fly(what, start, channels, inference_of(controller.systems))


@pytest.mark.parametrize("name", named(FLOWN))
def test_flown_attitude(name: str) -> None:
    what, controller, starts = FLOWN[name]
    for start in starts:
        assert_same(*fly_both(what, controller, start), metres=1e-4, others=1e-4)


@pytest.mark.parametrize("name", named(POINTED))
def test_ideal_pointing(name: str) -> None:
    what, controller, starts = POINTED[name]
    for start in starts:
        assert_same(*fly_both(what, controller, start), metres=1e-9, others=1e-9)


#: of each thing that may be sensed, guarded or moved by, one
PLAIN = [
    *("paper", "clusters", "full inertia", "pole blending", "late fixes, late thrusters with errors"),
    *("free motion, target and Sun", "what coasting shows", "what goes dark soon"),
    *("the push that shows what sets", "the push onto a tour", "safety layer, a few forces changed"),
    *("tumbling chief", "about the oblate Earth, in and out of its shadow"),
]


@pytest.mark.slow
@pytest.mark.parametrize("name", PLAIN)
def test_plain_python_flies_as_compiled_code_does_to_the_last_bit(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As `sparingly` promises, which lets the first flight of a kind go without compiling."""
    what, controller, starts = (FLOWN | POINTED)[name]
    brief = replace(what, duration_s=40 * what.control_period_s)
    monkeypatch.setattr(cache, "was_asked", lambda *_: True)
    fast = fly_logged(brief, controller, starts[0])
    token = decorator._plain.set("pipeline")
    try:
        with np.errstate(all="ignore"):
            plain = fly_logged(brief, controller, starts[0])
    finally:
        decorator._plain.reset(token)
    for field, expected, found in zip(fast._fields, fast, plain, strict=True):
        np.testing.assert_array_equal(found, expected, err_msg=field)


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
    fast, plain = fly_both(what, open_loop("throw", np.array([[0.0, 0.0, 0.0], [0.0, -9.6, 0.0]])), start)
    assert fast.num_candidates[0] > 40
    assert fast.num_candidates[1] == 0
    assert fast.num_candidates[2] > 20
    assert_same(fast, plain, metres=1e-6, others=1e-4)


def test_the_cases_above_reach_what_they_are_named_for() -> None:
    """Completion, clipping, poles, fast turns: a comparison where these do not happen would prove little."""
    what, controller, starts = POINTED["going on when complete"]
    (log,) = (fly_logged(what, controller, start) for start in starts)
    is_complete = log.is_inspected.all(axis=1)
    assert 10 < is_complete.sum() < 300
    assert log.is_decided.all()
    assert np.all(log.num_candidates[is_complete] == 0)

    assert np.abs(fly_logged(mission(), PLAN, STARTS[0]).force_hill_n).max() == 1.0
    for start in OVER_POLES[:2]:
        attitudes = fly_logged(mission(attitude=IDEAL), coast(), start).attitude_quaternion.reshape(-1, 4)
        line_of_sight = Rotation.from_quat(attitudes).apply([1.0, 0.0, 0.0])
        assert np.hypot(line_of_sight[:, 0], line_of_sight[:, 1]).min() < 1e-3

    rates = [
        np.linalg.norm(fly_logged(FLOWN[name][0], STEERING, STARTS[0]).angular_velocity_b_rad_s, axis=1).max()
        for name in ("light ball", "paper")
    ]
    assert rates[0] > 0.1
    assert log.is_inspected[-1].sum() == 99

    log = fly_logged(mission(), SPARSE, STARTS[0])
    is_silent = log.fis_output_n[:, 0] == 0.002
    assert 50 < is_silent.sum() < 310
