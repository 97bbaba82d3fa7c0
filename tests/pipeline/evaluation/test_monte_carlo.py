"""An evaluation's table and summary."""

import json

import numpy as np
import pytest

from pipeline.evaluation.monte_carlo import episode_columns, fly_cases, summarise
from pipeline.flight.fly.simulation import fly_all
from pipeline.flight.state.log import Outcomes, Scenario
from tests.pipeline.flight.cases import STARTS, STEERING, mission


def four_cases() -> tuple[list[Scenario], Outcomes]:
    """94, 95, 99 and 97 points; the last one leaves the limits."""
    scenarios = [Scenario(np.array([10.0 * case, 60.0, -7.0]), np.zeros(3), 0.5 * case) for case in range(4)]
    found = Outcomes(
        delta_v_m_s=np.array([1.0, 2.0, 3.0, 6.0]),
        inspected_count=np.array([94, 95, 99, 97]),
        inspectable_count=np.full(4, 99),
        mean_distance_m=np.array([60.0, 70.0, 80.0, 90.0]),
        min_distance_m=np.array([50.0, 60.0, 70.0, 14.0]),
        max_distance_m=np.array([70.0, 80.0, 90.0, 100.0]),
        outside_m=np.array([0.0, 0.0, 0.0, 1.0]),
        safety_periods=np.array([0, 2, 0, 6]),
        safety_delta_v_m_s=np.array([0.0, 0.01, 0.0, 0.03]),
    )
    return scenarios, found


def test_a_row_a_case() -> None:
    columns = episode_columns(mission(), *four_cases())
    assert list(columns) == [
        "case", "position_x_m", "position_y_m", "position_z_m", "sun_angle_rad", "delta_v_m_s",
        "inspected_count", "inspection_rate_percent", "mean_distance_m", "min_distance_m", "max_distance_m",
        "success", "violated", "safety_periods", "safety_delta_v_m_s",
        "sun_elevation_rad", "inspectable_count", "inspectable_rate_percent",
    ]  # fmt: skip
    assert columns["case"].tolist() == [0, 1, 2, 3]
    assert columns["position_x_m"].tolist() == [0.0, 10.0, 20.0, 30.0]
    assert columns["position_y_m"].tolist() == [60.0] * 4
    assert columns["position_z_m"].tolist() == [-7.0] * 4
    assert columns["sun_angle_rad"].tolist() == [0.0, 0.5, 1.0, 1.5]
    np.testing.assert_allclose(columns["inspection_rate_percent"], [9400 / 99, 9500 / 99, 100.0, 9700 / 99])
    assert columns["success"].tolist() == [False, True, True, True]
    assert columns["violated"].tolist() == [False, False, False, True]


def test_a_summary_by_hand() -> None:
    summary = summarise(episode_columns(mission(), *four_cases()), 95.0)
    assert json.loads(json.dumps(summary)) == summary
    assert summary["delta_v_m_s"]["mean"] == 3.0
    assert summary["delta_v_m_s"]["standard_deviation"] == pytest.approx(np.sqrt(14.0 / 3.0))
    assert summary["mean_distance_m"]["minimum"] == 60.0
    assert summary["inspection_rate_percent"]["mean"] == pytest.approx(100.0 * 385 / 396)
    shares = {name: summary[name]["count"] for name in ("success", "violated", "success_and_within_limits")}
    assert shares == {"success": 3, "violated": 1, "success_and_within_limits": 2}
    assert summary["safety_periods"]["mean"] == 2.0
    assert summary["safety_delta_v_m_s"]["mean"] == pytest.approx(0.01)
    assert summary["safety_acted"]["count"] == 2
    # Wilson, 2 of 4 at z = 1.96: the middle stays 1/2, the reach is z sqrt(1/16 + z^2/64)/(1 + z^2/4)
    z = 1.959963984540054
    reach = z * np.sqrt(1 / 16 + z * z / 64) / (1 + z * z / 4)
    both = summary["success_and_within_limits"]
    assert (both["low"], both["high"]) == (pytest.approx(0.5 - reach), pytest.approx(0.5 + reach))


@pytest.mark.parametrize("workers", [1, 2])
def test_cases_are_flown_as_any_other_flight(workers: int) -> None:
    what = mission(duration_s=600.0)
    columns, tracks = fly_cases(what, STEERING, STARTS, workers)
    found = fly_all(what, STEERING, STARTS, 1)
    np.testing.assert_array_equal(columns["delta_v_m_s"], found.delta_v_m_s)
    np.testing.assert_array_equal(columns["inspected_count"], found.inspected_count)
    assert tracks.shape == (len(STARTS), 61, 3)
    assert tracks.dtype == np.float32
    np.testing.assert_array_equal(tracks[:, 0], np.array([s.position_m for s in STARTS]).astype(np.float32))
