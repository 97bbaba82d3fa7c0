"""Runs compared case by case, and effects of settings, against differences put in and tests of scipy."""

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from pipeline.evaluation import blocks, paired_runs
from pipeline.evaluation.statistics import Columns


def evaluation(seed: int, num_cases: int = 40, shift: float = 0.0) -> dict[str, np.ndarray]:
    """An evaluation: its starts follow from the seed, its delta-v is shifted by as much in every case."""
    generator = np.random.default_rng(seed)
    starts = {name: generator.normal(size=num_cases) for name in paired_runs.START}
    inspected = generator.integers(90, 100, num_cases)
    return {
        "case": np.arange(num_cases),
        **starts,
        "delta_v_m_s": generator.normal(1.0, 0.2, num_cases) + shift,
        "inspection_rate_percent": 100.0 * inspected / 99,
        "success": inspected >= 95,
        "violated": generator.random(num_cases) < 0.1,
    }


def test_common_cases_are_found_in_any_order() -> None:
    first = evaluation(1)
    order = np.random.default_rng(0).permutation(40)[:25]
    second = {name: column[order] for name, column in first.items()}
    rows, others = paired_runs.common_cases(first, second)
    assert sorted(rows) == sorted(order)
    assert (first["sun_angle_rad"][rows] == second["sun_angle_rad"][others]).all()
    moving = first | {"velocity_y_m_s": first["velocity_y_m_s"] + 0.1}
    for other in (evaluation(2), moving):
        with pytest.raises(ValueError, match="share no case"):
            paired_runs.compare(first, other, 95.0)


@given(rows=st.tuples(*[st.lists(st.integers(0, 6), min_size=1, max_size=12)] * 2), block=st.integers(1, 5))
def test_each_start_counts_once_also_where_it_was_flown_twice(rows: tuple[list[int], list[int]], block: int):
    def flown(starts: list[int]) -> dict[str, np.ndarray]:
        columns = {name: np.array(starts) * 0.25 for name in paired_runs.START}
        return {**columns, "case": np.arange(len(starts))}

    wanted = {}
    for row, start in enumerate(rows[0]):
        if start in rows[1] and start not in wanted:
            wanted[start] = (row, len(rows[1]) - 1 - rows[1][::-1].index(start))
    same = [(row, row) for row in range(len(rows[0]))]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(blocks, "BLOCK_ROWS", block)
        pairs = zip(*paired_runs.common_cases(*map(flown, rows)), strict=True)
    assert list(pairs) == (same if rows[0] == rows[1] else list(wanted.values()))


def test_two_runs_by_tests_of_scipy() -> None:
    first, second = evaluation(1), {**evaluation(1), "success": evaluation(5)["success"]}
    second["delta_v_m_s"] = first["delta_v_m_s"] + np.random.default_rng(9).normal(-0.1, 0.2, 40)
    by_metric = {row.metric.name: row for row in paired_runs.compare(first, second, 95.0)}
    spent, success = by_metric["delta_v_m_s"], by_metric["success"]
    gained = second["delta_v_m_s"] - first["delta_v_m_s"]
    assert spent.difference.p_value == pytest.approx(stats.wilcoxon(gained, method="exact").pvalue)
    assert (spent.better, spent.worse) == ((gained < 0).sum(), (gained > 0).sum())
    before, after = (row["success"] & ~row["violated"] for row in (first, second))
    won, lost = (after & ~before).sum(), (before & ~after).sum()
    assert (success.better, success.worse) == (won, lost)
    assert success.difference.p_value == pytest.approx(stats.binomtest(int(won), int(won + lost)).pvalue)
    assert by_metric["violated"].difference.p_value == 1.0


def test_effects_are_those_put_in() -> None:
    runs = [
        ({"law": law, "seed": str(seed)}, evaluation(seed, shift=shift))
        for law, shift in (("a", 0.0), ("b", 0.25))
        for seed in (1, 2, 3)
    ]
    runs.append(({"law": "c", "seed": "1"}, evaluation(1, shift=-0.5)))
    estimated = [
        effect for effect in paired_runs.effects(runs, 95.0) if effect.metric is paired_runs.METRICS[0]
    ]
    by_name = {(effect.factor, effect.level): effect for effect in estimated}
    several, single = by_name["law", "b"], by_name["law", "c"]
    assert (several.unit, several.difference.count) == ("runs", 3)
    assert several.difference.mean == pytest.approx(0.25)
    # by as much in each run, which tells nothing about its spread
    assert not several.difference.has_interval
    assert (single.unit, single.difference.count) == ("cases", 40)
    assert single.difference.mean == pytest.approx(-0.5)
    assert {effect.factor for effect in estimated} == {"law"}
    extended = [*runs, ({"sun": "fixed"}, evaluation(1)), ({"sun": "random"}, evaluation(1, shift=0.5))]
    more = [
        effect for effect in paired_runs.effects(extended, 95.0) if effect.metric is paired_runs.METRICS[0]
    ]
    of_law = [effect.difference.mean for effect in more if effect.factor == "law"]
    assert of_law == [several.difference.mean, single.difference.mean]
    assert [effect.difference.mean for effect in more if effect.factor == "sun"] == [pytest.approx(0.5)]


def test_runs_of_the_same_cases_count_once() -> None:
    noise = np.random.default_rng(2).normal(0.1, 0.2, 40)
    runs = []
    for layer, level in itertools.product("xy", "ab"):
        flown = evaluation(1)
        flown["delta_v_m_s"] = flown["delta_v_m_s"] + noise * (level == "b")
        runs.append(({"layer": layer, "law": level}, flown))
    estimated = [
        effect for effect in paired_runs.effects(runs, 95.0) if effect.metric is paired_runs.METRICS[0]
    ]
    law = {effect.factor: effect for effect in estimated}["law"]
    interval = stats.ttest_1samp(noise, 0.0).confidence_interval(0.95)
    assert (law.unit, law.difference.count) == ("cases", 40)
    assert (law.difference.low, law.difference.high) == pytest.approx((interval.low, interval.high))


def test_the_front_is_what_no_other_surpasses() -> None:
    generator = np.random.default_rng(4)
    spent, inspected = generator.integers(0, 9, (2, 60)).astype(float)
    expected = [
        not any((p <= s and q >= i) and (p < s or q > i) for p, q in zip(spent, inspected, strict=True))
        for s, i in zip(spent, inspected, strict=True)
    ]
    assert paired_runs.on_front(spent, inspected).tolist() == expected
    assert 1 <= sum(expected) < 60


def test_what_a_sweep_shows_is_tested_beside_all_else_in_it() -> None:
    """Sixty settings that change nothing: one in twenty would be shown if each were tested alone."""
    runs = [({"law": "0"}, flown(0, 50))]
    runs += [({"law": str(index)}, flown(index, 50)) for index in range(1, 61)]
    estimated = paired_runs.effects(runs, 95.0)
    alone = [effect for effect in estimated if effect.difference.p_value < 0.05]
    assert alone
    assert not any(effect.is_shown for effect in estimated)
    worse = paired_runs.effects([*runs, ({"law": "worse"}, flown(99, 0))], 95.0)
    assert {effect.level for effect in worse if effect.is_shown} == {"worse"}


def flown(seed: int, percent: float) -> Columns:
    """Flights from the same starts, of which about so many succeed."""
    is_success = np.random.default_rng(seed).random(40) < percent / 100.0
    return evaluation(1) | {"success": is_success, "violated": np.zeros(40, dtype=bool)}


def test_runs_that_all_succeed_do_not_prove_that_all_will() -> None:
    """Twenty flights of each of three seeds, none of which fails: the interval is that of sixty flights."""
    runs = [
        ({"law": law, "seed": str(seed)}, flown(1, 100) | seeded(seed)) for law in "ab" for seed in range(3)
    ]
    effects = {effect.metric.name: effect.difference for effect in paired_runs.effects(runs, 95.0)}
    success = effects["success"]
    assert (success.mean, success.count) == (0.0, 3)
    assert success.low < 0.0 < success.high


def seeded(seed: int) -> Columns:
    """Starts of a seed."""
    return {name: column for name, column in evaluation(seed).items() if name in paired_runs.START}
