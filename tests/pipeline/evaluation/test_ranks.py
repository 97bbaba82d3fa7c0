"""Ranks of flights in blocks are those of all flights at once, by numpy and scipy."""

from functools import partial

import numpy as np
import pytest
from scipy import stats

from pipeline.evaluation import blocks, ranks, statistics
from pipeline.run import tables

NUMBER = 3000


def flights(number=NUMBER):
    """Delta-v that depends on a mass, rates of a few values, and a setting that nothing depends on."""
    generator = np.random.default_rng(number)
    mass, other = generator.normal(12.0, 1.0, number), generator.integers(0, 5, number)
    return {
        "case": np.arange(number),
        "mass": mass,
        "other": other,
        "constant": np.ones(number),
        "delta_v_m_s": np.round(0.4 + 0.05 * mass + generator.gamma(2.0, 0.05, number), 2),
        "inspectable_rate_percent": generator.integers(90, 101, number).astype(float),
        "violated": generator.random(number) < 0.1,
    }


@pytest.fixture(params=[NUMBER, 1, 17, 1000, NUMBER - 1])
def cut(request, monkeypatch):
    """Columns as blocks of so many rows."""
    monkeypatch.setattr(blocks, "BLOCK_ROWS", request.param)
    return partial(blocks.cut, flights()) if request.param > 1 else partial(blocks.cut, flights(60))


def whole_of(cut):
    return {name: np.concatenate([block[name] for block in cut()]) for name in flights(1)}


def test_rows_are_ranked_as_by_sorting(cut):
    columns = whole_of(cut)
    keys = (-columns["delta_v_m_s"], columns["inspectable_rate_percent"], ~columns["violated"])
    order, number = np.lexsort(keys), len(columns["case"])
    wanted = [0, 1, number // 3, number // 2, number - 2, number - 1]
    assert ranks.from_worst_to_best(cut, wanted) == [order[rank] for rank in wanted]


def test_correlations_are_spearmans(cut):
    columns = whole_of(cut)
    pairs = [(key, name) for key in ("mass", "other", "case") for name in statistics.RANKED]
    correlations = ranks.rank_correlations(cut, pairs, 95.0)
    # numbers between those of a sample count as equal; where there is one block, all are in it
    num_blocks = len(list(cut()))
    number = len(columns["case"])
    off = 1e-14 if num_blocks == 1 else 3.0 * num_blocks / number**1.5 + 20.0 * (num_blocks / number) ** 2
    for (key, name), correlation in zip(pairs, correlations, strict=True):
        expected = stats.spearmanr(columns[key], columns[name]).statistic
        assert correlation.value == pytest.approx(expected, rel=1e-12, abs=off)
        assert correlation.low < correlation.value < correlation.high
    (of_constant,) = ranks.rank_correlations(cut, [("constant", "delta_v_m_s")], 95.0)
    assert of_constant.value == 0.0
    ranked = ranks.sensitivity(cut, ["other", "mass"], 95.0)
    assert {entry["key"] for entry in ranked} == {"mass", "other"}
    strongest = [max(abs(entry[name]["value"]) for name in statistics.RANKED) for entry in ranked]
    assert strongest == sorted(strongest, reverse=True)


@pytest.mark.parametrize("order", ["drawn", "sorted"])
def test_numbers_between_those_of_a_sample_hardly_change_a_correlation(order, monkeypatch):
    """As beyond one block, where a sample of the rows stands for all; also where the rows come sorted."""
    columns = flights(200_000)
    columns["delta_v_m_s"] = columns["delta_v_m_s"] + np.random.default_rng(1).normal(0.0, 0.1, 200_000)
    if order == "sorted":
        rows = np.argsort(columns["delta_v_m_s"])
        columns = {name: column[rows] for name, column in columns.items()}
    monkeypatch.setattr(blocks, "BLOCK_ROWS", 5000)  # a sample of 5,000 rows, in place of 65,536
    (correlation,) = ranks.rank_correlations(partial(blocks.cut, columns), [("mass", "delta_v_m_s")], 95.0)
    expected = stats.spearmanr(columns["mass"], columns["delta_v_m_s"]).statistic
    assert abs(correlation.value - expected) < 1e-6
    assert correlation.high - correlation.low > 1e-3


def test_a_table_is_read_in_some_rows(tmp_path, monkeypatch):
    monkeypatch.setattr(tables, "GROUP_ROWS", 7)
    columns = flights(40)
    tables.write_parquet(tmp_path / "table.parquet", columns)
    table = tables.Columns(tmp_path, "table.parquet")
    rows = [39, 0, 6, 7, 20]
    assert (table.num_rows, blocks.number_of(columns)) == (40, 40)
    for name in ("mass", "violated"):
        assert table.at(name, rows) == blocks.values_at(columns, name, rows) == columns[name][rows].tolist()
    assert ranks.from_worst_to_best(table.blocks, [20]) == ranks.from_worst_to_best(lambda: [columns], [20])


def test_ranks_are_centred_and_those_of_equal_numbers_their_mean():
    values = np.random.default_rng(4).integers(0, 9, 200).astype(float)
    counted = ranks._MidRanks(values[values < 8.0])  # beyond a sample lie others
    for block in np.array_split(values, 3):
        counted.count(block)
    expected = stats.rankdata(values) - (len(values) + 1) / 2.0
    np.testing.assert_allclose(counted.centred(values), expected, atol=1e-12)
