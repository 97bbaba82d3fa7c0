"""Settings that vary within a flight: as processes, and in flights."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation
from scipy.stats import kstest, norm, truncnorm, uniform

from pipeline.flight.cases.actuators import thrust_errors
from pipeline.flight.cases.dispersions import groups_of, mission_of_case
from pipeline.flight.cases.navigation import errors_of
from pipeline.flight.cases.processes import drag_in_time, in_time
from pipeline.flight.control.controller import coast, open_loop
from pipeline.flight.fly.simulation import fly_logged
from pipeline.flight.state.log import Scenario
from pipeline.settings.experiment import Mission
from tests.pipeline.flight.cases import STARTS, mission
from tests.pipeline.flight.departures import FIXES, LOW_ORBIT, REAL, SIGHTED

NOISY = mission(navigation=FIXES, actuators=REAL, dynamics=LOW_ORBIT, duration_s=490.0)
CASES = [Scenario(np.ones(3), np.zeros(3), 0.0, noise=(5, 0, case)) for case in range(2000)]


def varying(what: Mission, key: str, correlation_s: float = 60.0, **told: float) -> Mission:
    kind = "normal" if "mean" in told else "uniform"
    return replace(what, dispersions={key: {"kind": kind, "correlation_s": correlation_s, **told}})


def drawn(what: Mission, key: str) -> NDArray[np.float64]:
    return np.array([in_time(what, key, case, np.nan) for case in CASES])


def test_an_error_is_a_process_of_gauss_and_markov_along_each_axis():
    """Stationary from the first sample on, with a correlation of ``exp(-lag/tau)``, and none between axes."""
    found = drawn(varying(NOISY, "actuators.scale_error", mean=0.02, std=0.1), "actuators.scale_error")
    assert found.shape == (2000, 50, 3)
    scores = (found - 0.02) / 0.1
    for sample in (0, 1, 25, 49):
        assert kstest(scores[:, sample].ravel(), norm.cdf).pvalue > 1e-3
        for lag in (1, 6, 20):
            if sample + lag < 50:
                together = np.mean(scores[:, sample] * scores[:, sample + lag])
                # of 6,000 pairs; a mean of products of normal numbers varies by at most sqrt(2) of its own
                assert together == pytest.approx(np.exp(-10.0 * lag / 60.0), abs=4 * np.sqrt(2 / 6000))
    assert abs(np.mean(scores[:, 10, 0] * scores[:, 10, 1])) < 4 * np.sqrt(1 / 2000)


@pytest.mark.parametrize(
    ("key", "told", "law"),
    [
        ("dynamics.drag_m_s2", {"mean": 3e-7, "std": 2e-7, "low": 0.0}, truncnorm(-1.5, np.inf, 3e-7, 2e-7)),
        ("navigation.noise_m", {"low": 0.5, "high": 2.0}, uniform(0.5, 1.5)),
    ],
)
def test_at_each_instant_a_setting_has_its_distribution(key, told, law):
    found = drawn(varying(NOISY, key, **told), key)
    assert found.shape == (2000, 50, 1)
    for sample in (0, 30):
        assert kstest(found[:, sample, 0], law.cdf).pvalue > 1e-3
    ranks = np.corrcoef(found[:, [10, 16], 0].argsort(axis=0).argsort(axis=0).T)[0, 1]
    # of normal scores with a correlation r the ranks have 6/pi asin(r/2)
    assert ranks == pytest.approx(6 / np.pi * np.arcsin(0.5 * np.exp(-1.0)), abs=0.08)


def test_what_varies_is_what_errors_are_made_of():
    key = "navigation.bias_m"
    quiet = replace(NOISY, navigation=replace(NOISY.navigation, noise_m=1e-6, outlier_m=0.0))
    what = varying(quiet, key, mean=0.0, std=3.0)
    drawn_fixes = errors_of(what, CASES[:3]).of_fixes
    for errors, case in zip(drawn_fixes, CASES, strict=False):
        np.testing.assert_allclose(errors, in_time(what, key, case, 0.0), atol=1e-5)
    key = "navigation.attitude_bias_deg"
    what = varying(NOISY, key, mean=0.0, std=2.0)
    tilts = np.degrees(errors_of(what, CASES[:300]).of_attitude)
    assert tilts[:, 20].std() == pytest.approx(2.0, rel=0.1)
    # the rest is drawn as without
    np.testing.assert_array_equal(errors_of(what, CASES[:3]).of_fixes, errors_of(NOISY, CASES[:3]).of_fixes)
    key = "actuators.misalignment_deg"
    exact = replace(NOISY, actuators=replace(NOISY.actuators, scale_error=0.0))
    what = varying(exact, key, mean=0.0, std=2.0)
    force = np.array([1.0, -2.0, 0.5])
    turned = thrust_errors(what, CASES[:1]).matrices[0] @ force
    about = in_time(what, key, CASES[0], 0.0)[:-1]
    np.testing.assert_allclose(turned, Rotation.from_rotvec(about).apply(force), atol=1e-12)


def test_noise_whose_level_varies_is_that_of_the_level():
    sighted = mission(navigation=FIXES | SIGHTED, duration_s=490.0)
    key = "navigation.range_noise_m"
    what = varying(sighted, key, low=0.1, high=5.0)
    found = errors_of(what, CASES[:500]).of_sight[:, :, 0]
    levels = drawn(what, key)[:500, :, 0]
    assert kstest((found / levels).ravel(), norm.cdf).pvalue > 1e-3


def test_drag_that_varies_pushes_as_so_much_thrust_would():
    """And one that hardly varies as one that does not."""
    calm = mission(attitude={"mode": "ideal"}, dynamics=LOW_ORBIT, light={"shadow": "conical"})
    start = replace(STARTS[0], noise=(5, 0, 1))
    key = "dynamics.drag_m_s2"
    what = varying(calm, key, mean=3e-6, std=2e-6)
    forces = calm.deputy.mass_kg * drag_in_time(what, [start])[0]
    drifted, pushed = (
        fly_logged(*flown, start).position_m for flown in ((what, coast()), (calm, open_loop("push", forces)))
    )
    np.testing.assert_allclose(drifted, pushed, rtol=0, atol=1e-9)
    assert np.abs(drifted - fly_logged(calm, coast(), start).position_m).max() > 1.0
    slippery = replace(calm, dynamics=replace(calm.dynamics, drag_m_s2=0.0))
    steady = varying(slippery, key, low=3e-7 * (1 - 1e-9), high=3e-7 * (1 + 1e-9))
    # held along Hill axes for ten seconds, which turn by a hundredth
    drifted, dragged = (fly_logged(one, coast(), start).position_m for one in (steady, calm))
    np.testing.assert_allclose(drifted, dragged, rtol=0, atol=1e-3)
    assert np.abs(drifted - fly_logged(slippery, coast(), start).position_m).max() > 1.0


def test_cases_share_a_world_where_only_what_varies_is_dispersed():
    key = "actuators.scale_error"
    what = varying(NOISY, key, mean=0.0, std=0.1)
    (group,) = groups_of(what, CASES[:5])
    assert group == (what, [0, 1, 2, 3, 4])
    mass = {"deputy": {"mass_kg": {"kind": "uniform", "low": 11.0, "high": 13.0}}}
    own = mission_of_case(replace(what, dispersions=what.dispersions | mass), CASES[0])
    assert own == replace(what, deputy=replace(what.deputy, mass_kg=own.deputy.mass_kg))
    assert own.deputy.mass_kg != what.deputy.mass_kg
    np.testing.assert_array_equal(in_time(own, key, CASES[0], 0.0), in_time(what, key, CASES[0], 0.0))
