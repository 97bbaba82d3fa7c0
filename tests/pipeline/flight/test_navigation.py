"""What a deputy knows that navigates by fixes, and what its thrusters make of commands, as laws demand it.

Also settings that vary within a flight: as processes, and in flights.
"""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.optimize import nnls
from scipy.spatial.transform import Rotation
from scipy.stats import chi2, kstest, norm, truncnorm, uniform

from pipeline.command_line.choices import options
from pipeline.command_line.config import compose_experiment, conf_folder
from pipeline.flight.cases.actuators import thrust_errors
from pipeline.flight.cases.dispersions import groups_of, mission_of_case
from pipeline.flight.cases.navigation import errors_of
from pipeline.flight.cases.processes import drag_in_time, in_time
from pipeline.flight.control.controller import coast, open_loop
from pipeline.flight.fly.simulation import fly_logged
from pipeline.flight.state.log import FlightLog, Scenario
from pipeline.flight.world.estimates import process_noise
from pipeline.flight.world.layout import layout_of
from pipeline.settings.experiment import Mission, SettingError
from tests.pipeline.flight.cases import STARTS, STEERING, mission
from tests.pipeline.flight.departures import ASKEW, ELLIPSE, FIXES, LOW_ORBIT, REAL, SIGHTED
from tests.pipeline.flight.guarded import LAST_MOMENT

#: thrusters that do as they are told, flown by the code of those that do not
EXACT = REAL | {"scale_error": 0.0, "misalignment_deg": 0.0, "least_impulse_n_s": 0.0}
ASKEW_ALL = {"scale_error": 0.05, "misalignment_deg": 2.0}
#: so far off that what is not fired along an axis pushes along others
FAR_OFF = REAL | {"scale_error": 0.5, "misalignment_deg": 20.0, "least_impulse_n_s": 0.1}
KNOWN = FIXES | {"bias_m": 0.0, "process_noise_m_s2": 0.0, "execution_error": 0.0}


def world(navigation: dict[str, object], actuators: dict[str, object]) -> Mission:
    return mission(navigation=navigation, actuators=actuators, safety=vars(LAST_MOMENT), duration_s=1200.0)


def flights(what: Mission, count: int) -> list[FlightLog]:
    return [fly_logged(what, STEERING, replace(STARTS[0], noise=(7, 0, case))) for case in range(count)]


def squared(logs: list[FlightLog], sample: int) -> np.ndarray:
    """Squares of the estimates' errors in their own standard deviations."""
    sizes = []
    for log in logs:
        error = log.estimate[sample] - np.concatenate((log.position_m[sample], log.velocity_m_s[sample]))
        sizes.append(error @ np.linalg.solve(log.estimate_covariance[sample], error))
    return np.array(sizes)


SIGHTING = {"measures": "range_bearing", "range_noise_m": 0.5, "bearing_noise_deg": 0.5}


@pytest.mark.parametrize(
    ("navigation", "actuators", "most_m"),
    [
        ({"fix_period_s": 20.0}, EXACT, 0.5),
        ({"fix_period_s": 20.0, "delay_s": 40.0}, EXACT, 0.5),
        # a fix alone would be off by its bearing, and the attitude that it is found by: 0.7 deg of some 75 m
        (SIGHTING | {"attitude_noise_deg": 0.5}, EXACT, 0.3),
        # errors of fixes and forces that last are considered
        ({"bias_m": 2.0}, EXACT, None),
        ({}, EXACT | ASKEW_ALL, None),
        ({"delay_s": 40.0}, REAL | ASKEW_ALL | {"delay_s": 20.0}, None),
        ({}, FAR_OFF, None),
        ({"measures": "range_bearing", "attitude_bias_deg": 0.2}, EXACT, None),
        ({"measures": "range_bearing", "attitude_bias_deg": 2.0}, EXACT, None),
    ],
)
def test_estimates_are_as_good_as_the_filter_says(navigation, actuators, most_m) -> None:
    """Sums of squared errors and innovations are chi-squared.

    Bar-Shalom, Li and Kirubarajan, Estimation, 2001, 5.4.2.
    """
    logs = flights(world(KNOWN | {"gate_sigma": None} | navigation, actuators), 40)
    for sample in (7, 40, 120):
        totals = {6: squared(logs, sample).sum()}
        if most_m is None:
            totals[3] = sum(log.innovation_square[sample] for log in logs)
        for size, total in totals.items():
            low, high = chi2.ppf([1e-4, 1 - 1e-4], size * len(logs))
            assert low < total < high, (sample, size)
    if most_m is not None:
        assert np.sqrt(np.mean([np.diag(log.estimate_covariance[-1])[:3] for log in logs])) < most_m


@pytest.mark.parametrize("dynamics", options([conf_folder()])["dynamics"])
@pytest.mark.parametrize("problem", options([conf_folder()])["problem"])
def test_covariances_are_numbers_in_each_problem(problem: str, dynamics: str) -> None:
    """Also where the least distance is zero, and the deputy passes through it."""
    words = ["+experiment=fly", f"problem={problem}", "controller=coast", "navigation=fixes"]
    what = compose_experiment([*words, f"dynamics={dynamics}", "duration_s=600"]).experiment.mission
    noise = process_noise(what)
    assert np.isfinite([noise.at(0.0), noise.at(what.deputy.max_distance_m)]).all()
    log = fly_logged(what, coast(), replace(STARTS[0], velocity_m_s=-STARTS[0].position_m / 300.0))
    assert np.isfinite(log.estimate_covariance).all()
    assert (np.linalg.eigvalsh(log.estimate_covariance) > 0.0).all()


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
    matrices = thrust_errors(mission(actuators=REAL), starts).matrices[:, 0]
    np.testing.assert_allclose(matrices[:, [0, 1, 2], [0, 1, 2]].std(axis=0), 0.05, rtol=0.1)
    np.testing.assert_allclose(matrices[:, [0, 1, 2], [1, 2, 0]].std(axis=0), np.radians(2.0), rtol=0.1)


def test_a_layout_of_thrusters_gives_what_is_asked_and_no_torque() -> None:
    """Two thrusters a face: what is commanded comes out, by forces not below zero that cannot be less."""
    words = ["+experiment=fly", "controller=coast", "actuators=layout"]
    table, layout = layout_of(compose_experiment(words).experiment.mission.actuators.thrusters)
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
    with pytest.raises(SettingError, match="cannot push in every direction"):
        compose_experiment([*words, f"actuators.thrusters={rows}"])


def test_mass_falls_by_the_rocket_equation_and_nothing_fires_without_propellant() -> None:
    """Tsiolkovsky: ``m = m_0 exp(-dv/(g I))``, of any thrust."""
    forces = np.random.default_rng(6).normal(0.0, 0.1, (120, 3))
    for propellant, is_used_up in ((1.0, False), (0.05, True)):
        real = EXACT | {"specific_impulse_s": 60.0, "propellant_kg": propellant}
        log = fly_logged(world(KNOWN, real), open_loop("plan", forces), STARTS[0])
        np.testing.assert_allclose(log.mass_kg, 12.0 * np.exp(-log.delta_v_m_s / (9.80665 * 60.0)), rtol=1e-9)
        empty = 12.0 - propellant
        assert (log.mass_kg[-1] == pytest.approx(empty, rel=1e-12)) == is_used_up
        is_dry = log.mass_kg[:-1] <= empty + 1e-11
        assert log.mass_kg.min() >= empty - 1e-11
        np.testing.assert_array_equal(is_dry, ~log.force_hill_n.any(axis=1))


@pytest.mark.parametrize("degrees", [0.1, 10.0, 30.0])
def test_a_misaligned_thrust_is_turned_and_not_stretched(degrees):
    what = mission(actuators=EXACT | {"misalignment_deg": degrees})
    scenarios = [replace(STARTS[0], noise=(1, 0, case)) for case in range(20)]
    matrices = thrust_errors(what, scenarios).matrices[:, 0]
    drawn = [np.radians(degrees) * scenario.generator(2).standard_normal((2, 3))[1] for scenario in scenarios]
    for matrix, turn in zip(matrices, drawn, strict=True):
        np.testing.assert_allclose(matrix @ matrix.T, np.eye(3), rtol=0, atol=1e-14)
        assert np.trace(matrix) == pytest.approx(1.0 + 2.0 * np.cos(np.linalg.norm(turn)), abs=1e-14)
        np.testing.assert_allclose(matrix @ turn, turn, rtol=0, atol=1e-14)


NOISY = mission(navigation=FIXES, actuators=REAL, dynamics=LOW_ORBIT, orbit=ELLIPSE, duration_s=490.0)
CASES = [Scenario(np.ones(3), np.zeros(3), 0.0, noise=(5, 0, case)) for case in range(2000)]


COAST = coast()


def test_beyond_the_limits_the_filter_allows_for_what_its_equations_neglect() -> None:
    """Which the bound within them no longer covers: errors would be hundreds of standard deviations."""
    what = mission(
        navigation=KNOWN | {"gate_sigma": None, "process_noise_m_s2": None},
        dynamics=LOW_ORBIT,
        orbit=ELLIPSE,
        attitude={"mode": "ideal"},
        duration_s=1200.0,
    )
    far = replace(STARTS[0], position_m=np.array([0.0, 20_000.0, 0.0]))
    logs = [fly_logged(what, coast(), replace(far, noise=(7, 0, case))) for case in range(20)]
    for sample in (7, 40, 120):
        assert squared(logs, sample).sum() < chi2.ppf(1 - 1e-4, 6 * len(logs))


@pytest.mark.slow
@pytest.mark.parametrize("position_m", [(300.0, 0.0, 0.0), (0.0, 2000.0, 0.0)])
def test_adrift_errors_are_about_as_large_as_the_filter_says(position_m) -> None:
    """Far from the chief, over an orbit about the oblate Earth, in which what is neglected comes and goes.

    Noise that is the same within the limits and grows with the square beyond them leaves half of the squares.
    """
    what = mission(
        navigation=KNOWN | {"gate_sigma": None, "process_noise_m_s2": None},
        dynamics=LOW_ORBIT,
        attitude={"mode": "ideal"},
        duration_s=5680.0,
    )
    start = replace(STARTS[0], position_m=np.array(position_m), velocity_m_s=np.zeros(3))
    logs = [fly_logged(what, COAST, replace(start, noise=(7, 0, case))) for case in range(20)]
    means = [squared(logs, sample).mean() for sample in range(40, 560, 20)]
    assert 4.0 < np.mean(means) < 7.0
    assert max(means) < 10.0


@pytest.mark.slow
def test_what_is_turned_at_random_is_expected_shorter() -> None:
    """Forces by the attitude's errors, and places by bearings that use it: what is along them is unbiased."""
    sighted = {"measures": "range_bearing", "attitude_bias_deg": 6.0, "fix_period_s": 200.0}
    exact = {"initial_position_m": 0.01, "initial_velocity_m_s": 1e-5, "gate_sigma": None}
    what = mission(navigation=KNOWN | exact | sighted, duration_s=200.0)
    push = open_loop("push", np.tile([0.0, 0.2, 0.0], (19, 1)))
    logs = [fly_logged(what, push, replace(STARTS[0], noise=(7, 0, case))) for case in range(300)]
    seen = [log.innovation_m[0] @ log.position_m[0] / np.linalg.norm(log.position_m[0]) for log in logs]
    gained = [np.diff((log.estimate[[0, 19], 4], log.velocity_m_s[[0, 19], 1])).ravel() for log in logs]
    # shorter by s^2, to within 3 s^4: of places 1/sqrt(1 + x^2), with x^2 of two turns of variance s^2
    square = np.radians(6.0) ** 2
    for ratios, size in ((seen, np.linalg.norm(STARTS[0].position_m)), (np.diff(gained), np.mean(gained))):
        error = np.std(ratios) / np.sqrt(len(logs))
        assert abs(np.mean(ratios)) < 4.0 * error + 3.0 * square**2 * size
        assert 4.0 * error + 3.0 * square**2 * size < 0.8 * square * size


def varying(what: Mission, key: str, correlation_s: float = 60.0, **law: float) -> Mission:
    kind = "normal" if "mean" in law else "uniform"
    return replace(what, dispersions={key: {"kind": kind, "correlation_s": correlation_s, **law}})


def drawn(what: Mission, key: str) -> NDArray[np.float64]:
    return np.array([in_time(what, key, case, np.nan) for case in CASES])


def test_an_error_is_a_process_of_gauss_and_markov_along_each_axis():
    """Stationary from the first sample on, with a correlation of ``exp(-lag/tau)``, and none between axes."""
    values = drawn(varying(NOISY, "actuators.scale_error", mean=0.02, std=0.1), "actuators.scale_error")
    assert values.shape == (2000, 50, 3)
    scores = (values - 0.02) / 0.1
    for sample in (0, 1, 25, 49):
        assert kstest(scores[:, sample].ravel(), norm.cdf).pvalue > 1e-3
        for lag in (1, 6, 20):
            if sample + lag < 50:
                together = np.mean(scores[:, sample] * scores[:, sample + lag])
                # of 6,000 pairs; a mean of products of normal numbers varies by at most sqrt(2) of its own
                assert together == pytest.approx(np.exp(-10.0 * lag / 60.0), abs=4 * np.sqrt(2 / 6000))
    assert abs(np.mean(scores[:, 10, 0] * scores[:, 10, 1])) < 4 * np.sqrt(1 / 2000)


@pytest.mark.parametrize(
    ("key", "settings", "law"),
    [
        ("dynamics.drag_m_s2", {"mean": 3e-7, "std": 2e-7, "low": 0.0}, truncnorm(-1.5, np.inf, 3e-7, 2e-7)),
        ("navigation.noise_m", {"low": 0.5, "high": 2.0}, uniform(0.5, 1.5)),
    ],
)
def test_at_each_instant_a_setting_has_its_distribution(key, settings, law):
    values = drawn(varying(NOISY, key, **settings), key)
    assert values.shape == (2000, 50, 1)
    for sample in (0, 30):
        assert kstest(values[:, sample, 0], law.cdf).pvalue > 1e-3
    ranks = np.corrcoef(values[:, [10, 16], 0].argsort(axis=0).argsort(axis=0).T)[0, 1]
    # of normal scores with a correlation r the ranks have 6/pi asin(r/2)
    assert ranks == pytest.approx(6 / np.pi * np.arcsin(0.5 * np.exp(-1.0)), abs=0.08)


def test_what_varies_is_what_errors_are_made_of():
    key = "navigation.bias_m"
    quiet = replace(NOISY, navigation=replace(NOISY.navigation, noise_m=1e-6, outlier_m=0.0))
    what = varying(quiet, key, mean=0.0, std=3.0)
    for errors, case in zip(errors_of(what, CASES[:3]).of_fixes, CASES, strict=False):
        np.testing.assert_allclose(errors, in_time(what, key, case, 0.0), atol=1e-5)
    what = varying(NOISY, "navigation.attitude_bias_deg", mean=0.0, std=2.0)
    tilts = np.degrees(errors_of(what, CASES[:300]).of_attitude)
    assert tilts[:, 20].std() == pytest.approx(2.0, rel=0.1)
    # the rest is drawn as without
    np.testing.assert_array_equal(errors_of(what, CASES[:3]).of_fixes, errors_of(NOISY, CASES[:3]).of_fixes)
    key = "navigation.range_noise_m"
    what = varying(mission(navigation=FIXES | SIGHTED, duration_s=490.0), key, low=0.1, high=5.0)
    ranges = errors_of(what, CASES[:500]).of_sight[:, :, 0]
    assert kstest((ranges / drawn(what, key)[:500, :, 0]).ravel(), norm.cdf).pvalue > 1e-3
    key = "actuators.misalignment_deg"
    exact = replace(NOISY, actuators=replace(NOISY.actuators, scale_error=0.0))
    what = varying(exact, key, mean=0.0, std=2.0)
    force = np.array([1.0, -2.0, 0.5])
    about = in_time(what, key, CASES[0], 0.0)[:-1]
    turned = Rotation.from_rotvec(about).apply(force)
    np.testing.assert_allclose(thrust_errors(what, CASES[:1]).matrices[0] @ force, turned, atol=1e-12)


def test_drag_that_varies_pushes_as_so_much_thrust_would():
    """And one that hardly varies as one that does not."""
    calm = mission(attitude={"mode": "ideal"}, dynamics=LOW_ORBIT, orbit=ELLIPSE, light={"shadow": "conical"})
    slippery = replace(calm, dynamics=replace(calm.dynamics, drag_m_s2=0.0))
    start = replace(STARTS[0], noise=(5, 0, 1))
    what = varying(calm, "dynamics.drag_m_s2", mean=3e-6, std=2e-6)
    steady = varying(slippery, "dynamics.drag_m_s2", low=3e-7 * (1 - 1e-9), high=3e-7 * (1 + 1e-9))
    push = open_loop("push", calm.deputy.mass_kg * drag_in_time(what, [start])[0])

    def path(what, controller=COAST):
        return fly_logged(what, controller, start).position_m

    np.testing.assert_allclose(path(what), path(calm, push), rtol=0, atol=1e-9)
    assert np.abs(path(what) - path(calm)).max() > 1.0
    # held along Hill axes for ten seconds, which turn by a hundredth
    np.testing.assert_allclose(path(steady), path(calm), rtol=0, atol=1e-3)
    assert np.abs(path(steady) - path(slippery)).max() > 1.0


def test_cases_share_a_world_where_only_what_varies_is_dispersed():
    key = "actuators.scale_error"
    what = varying(NOISY, key, mean=0.0, std=0.1)
    (group,) = groups_of(what, CASES[:5])
    assert group == (what, [0, 1, 2, 3, 4])
    mass = {"deputy": {"mass_kg": {"kind": "uniform", "low": 11.0, "high": 13.0}}}
    case_mission = mission_of_case(replace(what, dispersions=what.dispersions | mass), CASES[0])
    assert case_mission == replace(what, deputy=replace(what.deputy, mass_kg=case_mission.deputy.mass_kg))
    assert case_mission.deputy.mass_kg != what.deputy.mass_kg
    np.testing.assert_array_equal(
        in_time(case_mission, key, CASES[0], 0.0), in_time(what, key, CASES[0], 0.0)
    )
