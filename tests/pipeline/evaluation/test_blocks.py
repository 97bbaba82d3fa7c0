"""Statistics of flights in blocks are those of all flights at once, by numpy and scipy."""

from functools import partial

import numpy as np
import pytest
from scipy import stats

from pipeline.evaluation import blocks, statistics
from pipeline.evaluation.monte_carlo import summarise

#: of ties, signs, the smallest and the greatest numbers
NUMBERS = {
    "spread": lambda generator: generator.normal(size=1000),
    "ties": lambda generator: generator.integers(0, 7, 1000) / 7.0,
    "whole": lambda generator: generator.integers(-500, 500, 1000),
    "one": lambda _: np.full(1000, 0.25),
    "extreme": lambda generator: generator.choice([-0.0, 0.0, 5e-324, -5e-324, 1e308, -1e308, 1.0], 1000),
}


@pytest.mark.parametrize("kind", NUMBERS)
def test_a_selected_value_is_the_sorted_one(kind):
    values, ranks = NUMBERS[kind](np.random.default_rng(3)), [*range(0, 999, 11), 999]
    # a pass counts 65,536 digits for each block and rank
    for size, some in ((1000, ranks), (334, ranks), (7, [*ranks[::12], 999])):
        cut = np.split(values, range(size, 1000, size))
        np.testing.assert_array_equal(blocks.selected(lambda of=cut: of, some), np.sort(values)[some])


def episodes(number):
    generator = np.random.default_rng(number)
    columns = {name: generator.gamma(2.0, 0.2, number) for name in statistics.PERCENTS}
    columns |= {
        "inspection_rate_percent": generator.uniform(0, 100, number),
        "mean_distance_m": np.ones(number),
    }
    return columns | {name: generator.random(number) < 0.3 for name in ("success", "violated")}


@pytest.mark.parametrize("number", [101, 1000, 4999])
def test_percentiles_of_blocks_are_those_of_all_flights(number, monkeypatch):
    columns = episodes(number)
    expected = statistics.percentiles(columns, 99.0)
    for size in (17, 100, number - 1):
        monkeypatch.setattr(blocks, "BLOCK_ROWS", size)
        assert blocks.percentiles(partial(blocks.cut, columns), 99.0) == expected
    for name, percents in statistics.PERCENTS.items():
        values = [np.quantile(columns[name], percent / 100.0, method="inverted_cdf") for percent in percents]
        assert [each["value"] for each in expected[name]] == values


def test_means_and_shares_of_blocks_are_those_of_all_flights(monkeypatch):
    columns = episodes(5000)
    whole = summarise(columns, 95.0)
    monkeypatch.setattr(blocks, "BLOCK_ROWS", 999)
    joined = summarise(columns, 95.0)
    assert list(joined) == list(whole)
    assert (joined["success"], joined["violated"]) == (whole["success"], whole["violated"])
    values = columns["delta_v_m_s"]
    delta_v = joined["delta_v_m_s"]
    interval = stats.t.interval(0.95, len(values) - 1, np.mean(values), stats.sem(values))
    assert (delta_v["low"], delta_v["high"]) == pytest.approx(interval, rel=1e-12)
    assert (delta_v["minimum"], delta_v["maximum"]) == (values.min(), values.max())
    assert delta_v["standard_deviation"] == pytest.approx(np.std(values, ddof=1), rel=1e-12)
    assert delta_v["mean"] == pytest.approx(np.mean(values), rel=1e-14)
    assert joined["mean_distance_m"]["standard_deviation"] == 0.0


def test_few_flights_are_one_block():
    columns = episodes(50)
    assert list(blocks.cut(columns)) == [columns]
