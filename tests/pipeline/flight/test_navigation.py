"""What a deputy knows that navigates by fixes, and what its thrusters make of commands, as laws demand it."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import nnls
from scipy.stats import chi2

from pipeline.command_line.config import compose_experiment
from pipeline.flight.cases.actuators import layout_of, thrust_errors
from pipeline.flight.cases.navigation import errors_of
from pipeline.flight.control.controller import coast, open_loop
from pipeline.flight.fly.simulation import fly_all, fly_logged
from pipeline.flight.state.log import FlightLog, Scenario
from pipeline.settings.experiment import Mission, SettingError
from pipeline.settings.mission import Actuators
from tests.pipeline.flight.cases import STARTS, STEERING, mission
from tests.pipeline.flight.departures import ASKEW, FIXES, REAL, VARYING
from tests.pipeline.flight.guarded import LAST_MOMENT
from tests.pipeline.flight.missions import IDEAL

#: thrusters that do as they are told, flown by the code of those that do not
EXACT = REAL | {"scale_error": 0.0, "misalignment_deg": 0.0, "least_impulse_n_s": 0.0}
KNOWN = FIXES | {"bias_m": 0.0, "process_noise_m_s2": 0.0, "execution_error": 0.0}


def world(navigation: dict[str, object], actuators: dict[str, object]) -> Mission:
    return mission(navigation=navigation, actuators=actuators, safety=vars(LAST_MOMENT), duration_s=1200.0)


def flights(what: Mission, count: int) -> list[FlightLog]:
    return [fly_logged(what, STEERING, replace(STARTS[0], noise=(7, 0, case))) for case in range(count)]


def squared(logs: list[FlightLog], sample: int) -> np.ndarray:
    """Squares of the estimates' errors in their own standard deviations."""
    found = []
    for log in logs:
        error = log.estimate[sample] - np.concatenate((log.position_m[sample], log.velocity_m_s[sample]))
        found.append(error @ np.linalg.solve(log.estimate_covariance[sample], error))
    return np.array(found)


@pytest.mark.parametrize("delay_s", [0.0, 40.0])
def test_estimates_are_as_good_as_the_filter_says(delay_s: float) -> None:
    """Sums of squared errors are chi-squared, Bar-Shalom, Li and Kirubarajan, Estimation, 2001, 5.4.2."""
    logs = flights(world(KNOWN | {"delay_s": delay_s, "fix_period_s": 20.0, "gate_sigma": None}, EXACT), 40)
    for sample in (0, 7, 40, 120):
        total = squared(logs, sample).sum()
        low, high = chi2.ppf([1e-4, 1 - 1e-4], 6 * len(logs))
        assert low < total < high, sample
    assert np.sqrt(np.mean([np.diag(log.estimate_covariance[-1])[:3] for log in logs])) < 0.5


def test_estimates_by_range_and_bearing_are_as_good_as_the_filter_says() -> None:
    """The same for range and bearing, where the attitude that bearings are found by is noisy too."""
    sighted = {"measures": "range_bearing", "range_noise_m": 0.5, "bearing_noise_deg": 0.5}
    noisy = sighted | {"attitude_noise_deg": 0.5, "gate_sigma": None, "bias_m": 0.0}
    logs = flights(world(KNOWN | noisy, EXACT), 40)
    for sample in (0, 7, 40, 120):
        total = squared(logs, sample).sum()
        low, high = chi2.ppf([1e-4, 1 - 1e-4], 6 * len(logs))
        assert low < total < high, sample
    # a fix alone would be off by its bearing: 0.7 degrees of some 75 m
    assert np.sqrt(np.mean([np.diag(log.estimate_covariance[-1])[:3] for log in logs])) < 0.3


@pytest.mark.parametrize(
    ("navigation", "actuators"),
    [
        ({"bias_m": 2.0}, EXACT),
        ({}, EXACT | {"scale_error": 0.05, "misalignment_deg": 2.0}),
        ({"delay_s": 40.0}, REAL | {"scale_error": 0.05, "misalignment_deg": 2.0, "delay_s": 20.0}),
        ({"measures": "range_bearing", "attitude_bias_deg": 0.2}, EXACT),
        ({"measures": "range_bearing", "attitude_bias_deg": 2.0}, EXACT),
    ],
)
def test_constant_errors_are_considered(navigation: dict[str, object], actuators: dict[str, object]) -> None:
    """Squared errors and innovations stay chi-squared, though errors of fixes and forces last."""
    logs = flights(world(KNOWN | {"gate_sigma": None} | navigation, actuators), 40)
    for sample in (7, 40, 120):
        distances = sum(log.innovation_square[sample] for log in logs)
        for size, total in ((6, squared(logs, sample).sum()), (3, distances)):
            low, high = chi2.ppf([1e-4, 1 - 1e-4], size * len(logs))
            assert low < total < high, (sample, size)


def test_fixes_beyond_the_gate_are_not_believed() -> None:
    wild = KNOWN | {"outlier_share": 0.2, "outlier_m": 50.0}
    errors = {}
    for gate in (None, 5.0):
        logs = flights(world(wild | {"gate_sigma": gate}, EXACT), 10)
        apart = [np.linalg.norm(log.estimate[30:, :3] - log.position_m[30:], axis=1) for log in logs]
        errors[gate] = np.sqrt(np.mean(np.square(apart)))
    assert errors[5.0] < 0.3 * errors[None]


def test_a_filter_that_is_wrong_itself_comes_to_believe_its_fixes_again() -> None:
    """Drag that it knows nothing of carries the deputy beyond its gate; it does not stay lost."""
    what = world(KNOWN | {"gate_sigma": 3.0, "noise_m": 0.1}, EXACT)
    dragged = replace(what, dynamics=replace(what.dynamics, model="two_body", drag_m_s2=1e-4))
    log = fly_logged(dragged, coast(), replace(STARTS[0], position_m=np.array([0.0, 100.0, 0.0])))
    off = np.linalg.norm(log.estimate[:, :3] - log.position_m, axis=1)
    spread = np.sqrt(log.estimate_covariance[:, [0, 1, 2], [0, 1, 2]].sum(axis=1))
    grown = spread[1:] / spread[:-1]
    # the first rejected fix widens the covariance by 4, a standard deviation by 2, beyond what a period adds
    assert grown[10:].max() > 1.5
    assert off[40:].max() < 2.0
    assert np.linalg.norm(log.position_m[-1] - log.position_m[0]) > 50.0


def test_errors_are_drawn_as_the_settings_say() -> None:
    what = mission(navigation=FIXES | {"outlier_share": 0.25}, duration_s=490.0)
    starts = [Scenario(np.ones(3), np.zeros(3), 0.0, noise=(1, 0, case)) for case in range(400)]
    drawn = errors_of(what, starts)
    means = drawn.of_fixes.mean(axis=1)
    spread = np.sqrt(0.5**2 + (1.0 + 0.25 * 20.0**2) / 50)
    np.testing.assert_allclose(means.std(axis=0), spread, rtol=0.15)
    np.testing.assert_allclose(drawn.at_start.std(axis=0), [1.0] * 3 + [0.001] * 3, rtol=0.15)
    assert not np.array_equal(drawn.of_fixes[0], drawn.of_fixes[1])
    np.testing.assert_array_equal(errors_of(what, starts[5:6]).of_fixes[0], drawn.of_fixes[5])


def test_a_layout_of_thrusters_gives_what_is_asked_and_no_torque() -> None:
    """Two thrusters a face: what is commanded comes out, by forces not below zero that cannot be less."""
    what = compose_experiment(
        ["+experiment=evaluate", "controller=coast", "actuators=layout"]
    ).experiment.mission
    table, layout = layout_of(what.actuators.thrusters)
    for force in np.random.default_rng(8).normal(0.0, 0.2, (20, 3)):
        thrusts = table @ np.concatenate((np.maximum(force, 0.0), np.maximum(-force, 0.0)))
        assert np.all(thrusts >= 0.0)
        np.testing.assert_allclose(layout[:, :6].T @ thrusts, [*force, 0.0, 0.0, 0.0], atol=1e-12)
        exact, rest = nnls(layout[:, :6].T, np.array([*force, 0.0, 0.0, 0.0]))
        assert rest < 1e-12
        assert thrusts.sum() <= exact.sum() + 1e-12
    # askew, it pushes as asked where torques cannot be avoided, and refuses what it cannot push at all
    table, layout = layout_of(ASKEW)
    np.testing.assert_allclose(layout[:, :3].T @ table, np.hstack([np.eye(3), -np.eye(3)]), atol=1e-12)
    rows = [[float(number) for number in row] for row in ASKEW[:5]]
    lame = ["+experiment=fly", "controller=coast", "actuators=layout", f"actuators.thrusters={rows}"]
    with pytest.raises(SettingError, match="cannot push in every direction"):
        compose_experiment(lame)


def test_mass_falls_by_the_rocket_equation_and_nothing_fires_without_propellant() -> None:
    """Tsiolkovsky: ``m = m_0 exp(-dv/(g I))``, of any thrust."""
    forces = np.random.default_rng(6).normal(0.0, 0.1, (120, 3))
    for propellant, is_used_up in ((1.0, False), (0.05, True)):
        real = EXACT | {"specific_impulse_s": 60.0, "propellant_kg": propellant}
        log = fly_logged(world(KNOWN, real), open_loop("plan", forces), STARTS[0])
        left = 12.0 * np.exp(-log.delta_v_m_s / (9.80665 * 60.0))
        np.testing.assert_allclose(log.mass_kg, left, rtol=1e-9)
        empty = 12.0 - propellant
        assert (log.mass_kg[-1] == pytest.approx(empty, rel=1e-12)) == is_used_up
        assert log.mass_kg.min() >= empty - 1e-11
        is_dry = log.mass_kg[:-1] <= empty + 1e-11
        assert np.all(log.force_hill_n[is_dry] == 0.0)
        assert np.all(np.abs(log.force_hill_n[~is_dry]).sum(axis=1) > 0.0)


@pytest.mark.parametrize("varying", [{}, VARYING])
def test_a_flight_has_its_own_errors_in_any_company(varying: dict[str, object]) -> None:
    what = replace(world(FIXES, REAL), dispersions=varying)
    starts = [replace(STARTS[0], noise=(3, 0, case)) for case in range(20)]
    together = fly_all(what, STEERING, starts, workers=2).delta_v_m_s
    alone = [fly_all(what, STEERING, [start], workers=1).delta_v_m_s[0] for start in starts[::7]]
    np.testing.assert_array_equal(together[::7], alone)
    assert len(set(together.tolist())) == 20


def test_turns_and_scales_have_the_spread_of_the_settings() -> None:
    starts = [Scenario(np.ones(3), np.zeros(3), 0.0, noise=(2, 0, case)) for case in range(1000)]
    matrices = thrust_errors(mission(actuators=REAL), starts).matrices[:, 0]
    np.testing.assert_allclose(matrices[:, [0, 1, 2], [0, 1, 2]].std(axis=0), 0.05, rtol=0.1)
    np.testing.assert_allclose(matrices[:, [0, 1, 2], [1, 2, 0]].std(axis=0), np.radians(2.0), rtol=0.1)


START = Scenario(np.array([60.0, 20.0, 10.0]), np.zeros(3), 0.3, 0.0, (1, 0, 0))
EXACT_REAL = Actuators(kind="real", scale_error=0.0, misalignment_deg=0.0, least_impulse_n_s=0.0)


@pytest.mark.parametrize("degrees", [0.1, 10.0, 30.0])
def test_a_misaligned_thrust_is_turned_and_not_stretched(degrees):
    mission = replace(IDEAL, actuators=replace(EXACT_REAL, misalignment_deg=degrees))
    scenarios = [replace(START, noise=(1, 0, case)) for case in range(20)]
    matrices = thrust_errors(mission, scenarios).matrices[:, 0]
    drawn = [np.radians(degrees) * one.generator(2).standard_normal((2, 3))[1] for one in scenarios]
    for matrix, turn in zip(matrices, drawn, strict=True):
        np.testing.assert_allclose(matrix @ matrix.T, np.eye(3), rtol=0, atol=1e-14)
        assert np.trace(matrix) == pytest.approx(1.0 + 2.0 * np.cos(np.linalg.norm(turn)), abs=1e-14)
        np.testing.assert_allclose(matrix @ turn, turn, rtol=0, atol=1e-14)
