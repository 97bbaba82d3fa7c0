"""What a flight's outcome says, worked out again from its log or by hand."""

import numpy as np
import pytest

from pipeline.flight.control.controller import coast, open_loop
from pipeline.flight.fly.simulation import fly_all, fly_logged
from pipeline.flight.state.log import FlightLog, Scenario
from tests.pipeline.flight.cases import (
    COMPLETED,
    MIXED,
    OVER_POLES,
    STARTS,
    STEERING,
    mission,
)


def assert_same(fast: FlightLog, plain: FlightLog, metres: float, others: float) -> None:
    """Compare two flights field by field: positions and targets to `metres`, other numbers to `others`."""
    for name in FlightLog._fields:
        values, expected = getattr(fast, name), getattr(plain, name)
        assert (values.shape, values.dtype) == (expected.shape, expected.dtype), name
        tolerance = metres if name in ("position_m", "target_m") else others
        if values.dtype == np.float64:
            np.testing.assert_allclose(values, expected, rtol=0, atol=tolerance, err_msg=name)
        else:
            np.testing.assert_array_equal(values, expected, err_msg=name)


def along_track(metres: float, velocity_m_s: float = 0.0) -> Scenario:
    """Ahead of the chief, where nothing pulls a deputy that rests."""
    return Scenario(np.array([0.0, metres, 0.0]), np.array([0.0, velocity_m_s, 0.0]), 0.0)


def test_outcomes_are_what_the_log_holds() -> None:
    narrow = mission(
        deputy={"max_force_n": 0.01, "min_distance_m": 64.0, "max_distance_m": 80.0}, control_period_s=20.0
    )
    starts = [*STARTS, *OVER_POLES, COMPLETED]
    outcomes = fly_all(narrow, STEERING, starts)
    for case, start in enumerate(starts):
        log = fly_logged(narrow, STEERING, start)
        spent = sum(np.abs(force).sum() for force in log.force_hill_n) * 20.0 / 12.0
        distance = [float(np.sqrt(np.dot(r, r))) for r in log.position_m]
        outside = max(max(64.0 - d, d - 80.0, 0.0) for d in distance[1:])
        assert outcomes.delta_v_m_s[case] == pytest.approx(spent, rel=1e-12)
        assert outcomes.inspected_count[case] == log.is_inspected[-1].sum()
        assert outcomes.mean_distance_m[case] == pytest.approx(sum(distance) / 181, rel=1e-12)
        assert outcomes.min_distance_m[case] == pytest.approx(min(distance), rel=1e-12)
        assert outcomes.max_distance_m[case] == pytest.approx(max(distance), rel=1e-12)
        assert outcomes.outside_m[case] == pytest.approx(outside, rel=1e-12)
        assert outcomes.is_violated[case] == (outside > 0.0)
        assert np.abs(log.force_hill_n).max() == 0.01
    assert 0 < outcomes.is_violated.sum() < len(starts)
    assert outcomes.min_distance_m.min() < 64.0
    assert outcomes.max_distance_m.max() > 80.0


def test_delta_v_sums_the_magnitudes_of_what_is_applied() -> None:
    """Ten periods of 10 s at (0.3, -0.4, 2) N, of which 1 N is applied along k, on 12 kg."""
    plan = open_loop("plan", np.tile([0.3, -0.4, 2.0], (10, 1)))
    outcomes = fly_all(mission(duration_s=200.0), plan, [along_track(75.0)])
    assert outcomes.delta_v_m_s[0] == pytest.approx(10 * 10.0 * (0.3 + 0.4 + 1.0) / 12.0, rel=1e-14)


@pytest.mark.parametrize(
    ("metres", "outside_m"),
    [
        (15.0, 0.0),
        (200.0, 0.0),
        (14.0, 1.0),
        (203.0, 3.0),
        (np.nextafter(15.0, 0.0), 15.0 - np.nextafter(15.0, 0.0)),
    ],
)
def test_the_ends_of_the_distance_limits_are_inside(metres: float, outside_m: float) -> None:
    outcomes = fly_all(mission(duration_s=600.0), coast(), [along_track(metres)])
    assert outcomes.outside_m[0] == outside_m
    assert outcomes.is_violated[0] == (outside_m > 0.0)
    assert outcomes.min_distance_m[0] == outcomes.max_distance_m[0] == outcomes.mean_distance_m[0] == metres


@pytest.mark.parametrize(("metres", "velocity_m_s"), [(14.9, 0.05), (200.5, -0.1)])
def test_the_start_itself_may_be_outside(metres: float, velocity_m_s: float) -> None:
    outcomes = fly_all(mission(duration_s=100.0), coast(), [along_track(metres, velocity_m_s)])
    assert not outcomes.is_violated[0]
    assert metres in (outcomes.min_distance_m[0], outcomes.max_distance_m[0])


def test_scikit_learn_flies_the_same_outcomes_and_logs() -> None:
    kept = {"duration_s": 300.0, "chief": {"initial_angular_velocity_rad_s": (0.01, -0.02, 0.005)}}
    ours, theirs = (
        mission(guidance={"kind": "clusters", "engine": engine}, **kept) for engine in ("compiled", "sklearn")
    )
    starts = [STARTS[1], COMPLETED]
    tracks = [np.full((2, 31, 3), np.nan, dtype=np.float32) for _ in range(2)]
    outcomes = [
        fly_all(what, MIXED, starts, 1, track) for what, track in zip((ours, theirs), tracks, strict=True)
    ]
    for name, values in vars(outcomes[0]).items():
        np.testing.assert_allclose(values, getattr(outcomes[1], name), rtol=0, atol=1e-6, err_msg=name)
    np.testing.assert_allclose(*tracks, rtol=0, atol=1e-5)
    assert outcomes[1].inspected_count.dtype == np.int64
    assert_same(fly_logged(ours, MIXED, COMPLETED), fly_logged(theirs, MIXED, COMPLETED), 1e-6, 1e-6)


def test_scikit_learn_flies_plans_too() -> None:
    kept = {"duration_s": 100.0}
    plan = open_loop("plan", np.tile([0.0, 0.02, -0.01], (5, 1)))
    ours, theirs = (
        mission(guidance={"kind": "clusters", "engine": engine}, **kept) for engine in ("compiled", "sklearn")
    )
    assert_same(fly_logged(ours, plan, COMPLETED), fly_logged(theirs, plan, COMPLETED), 1e-6, 1e-6)
    assert_same(fly_logged(ours, coast(), COMPLETED), fly_logged(theirs, coast(), COMPLETED), 1e-6, 1e-6)
