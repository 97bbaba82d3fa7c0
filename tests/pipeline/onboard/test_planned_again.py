"""What plans on board are made again by: numbers that need no library, held against those that do."""

import numpy as np
import pytest

from fis_tools.compiled.decorator import plain
from pipeline.flight.fly.aboard import MARGIN_M, Confines, cost_ahead, limits_of, margin_of, spread_of
from pipeline.flight.fly.outlooks import rows_of_spread, spread_after
from pipeline.flight.fly.pushes import NUM_NEAR_DRAWS, gather
from pipeline.flight.fly.rehearsals import OUTSIDE_M_S
from tests.pipeline.flight.cases import mission


@pytest.mark.parametrize("seconds", [0.0, 300.0, 3000.0])
def test_the_spread_on_board_is_at_least_that_of_the_worst_direction(seconds):
    flown = mission(navigation={"mode": "fixes"})
    errors = np.random.default_rng(3).normal(0.0, [1.0] * 3 + [0.002] * 3, (20, 9, 6))
    covariances = errors.transpose(0, 2, 1) @ errors
    exact = spread_after(flown, 30, covariances, seconds)
    rows = rows_of_spread(flown, 30, seconds)
    bounds = np.array([plain(spread_of)(rows, each.ravel()) for each in covariances])
    assert (bounds >= exact * (1.0 - 1e-12)).all()
    assert (bounds <= exact * 3.0**0.25 * (1.0 + 1e-12)).all()


def test_limits_draw_in_by_the_margin_and_by_what_the_safety_layer_keeps():
    margin = plain(margin_of)(2.0)
    assert margin == MARGIN_M + 2.0
    free = Confines(15.0, 200.0, 4.0, -np.inf, np.inf, np.inf, 30.0, np.inf)
    assert plain(limits_of)(free, margin) == (15.0 + (4.0 + margin), 200.0 - (4.0 + margin), np.inf)
    layered = free._replace(keep_out=20.0, keep_in=190.0, fastest=0.5, period=300.0)
    assert plain(limits_of)(layered, margin) == (20.0 + margin, 190.0 - margin, 30.0 * (0.5 - margin / 300.0))


def test_a_flight_ahead_costs_delta_v_and_what_it_leaves():
    assert plain(cost_ahead)(0.2, 0.0, 1.0, 1.0, 0.15) == 0.2
    assert plain(cost_ahead)(0.2, 0.0, 3.0, 1.0, 0.15) == 0.2 + 0.15 * 2.0
    assert plain(cost_ahead)(0.2, 0.1, 3.0, 1.0, 0.15) == 0.2 + 0.15 * 2.0 + OUTSIDE_M_S


@pytest.mark.parametrize("num_pushes", [2, 3])
def test_plans_near_the_last_one_are_scattered_as_asked(num_pushes):
    num_genes, num_near = 4 * num_pushes - 1, 4000
    generator, last = np.random.default_rng(8), np.linspace(-0.5, 0.5, num_genes)
    lowest, highest = np.full(num_genes, -1.0), np.full(num_genes, 1.0)
    plans = generator.random((num_near + 2, num_genes))
    before = plans.copy()
    draws = generator.random((num_near, num_genes * (NUM_NEAR_DRAWS + 1)))
    spread, spread_of_times = 0.1, 0.02
    plain(gather)(plans, lowest, highest, last, num_near, spread, spread_of_times, draws)
    np.testing.assert_array_equal(plans[0], last)
    np.testing.assert_array_equal(plans[num_near], 0.0)
    np.testing.assert_array_equal(plans[-1], before[-1])
    off = plans[1:num_near] - last
    np.testing.assert_allclose((off == 0.0).mean(axis=0), 0.5, atol=0.05)
    spreads = np.r_[np.full(3 * num_pushes, spread), np.full(num_pushes - 1, spread_of_times)]
    np.testing.assert_allclose(np.sqrt(2.0) * off.std(axis=0), spreads, rtol=0.06)
    plain(gather)(plans, last - 0.05, last + 0.05, last, num_near, spread, spread_of_times, draws)
    assert (np.abs(plans[:num_near] - last) <= 0.05 + 1e-12).all()
