"""Runs against each other on common cases: intervals and tests are SciPy's, effects those put in."""

import numpy as np
import pytest
from scipy import stats

from pipeline.evaluation.statistics import (
    METRICS,
    START,
    common_cases,
    compare,
    difference,
    effects,
    on_front,
)


def evaluation(seed: int, num_cases: int = 40, shift: float = 0.0) -> dict[str, np.ndarray]:
    """An evaluation: its starts follow from the seed, its delta-v is shifted by as much in every case."""
    generator = np.random.default_rng(seed)
    starts = {name: generator.normal(size=num_cases) for name in START}
    inspected = generator.integers(90, 100, num_cases)
    return {
        "case": np.arange(num_cases),
        **starts,
        "delta_v_m_s": generator.normal(1.0, 0.2, num_cases) + shift,
        "inspection_rate_percent": 100.0 * inspected / 99,
        "success": inspected >= 95,
        "violated": generator.random(num_cases) < 0.1,
    }


def test_an_interval_is_students() -> None:
    values = np.random.default_rng(3).normal(0.1, 1.0, 17)
    told = difference(values, 90.0)
    interval = stats.ttest_1samp(values, 0.0).confidence_interval(0.9)
    assert (told.low, told.high) == pytest.approx((interval.low, interval.high))
    assert told.count == 17
    assert not difference(values[:1], 90.0).is_told


def test_common_cases_are_found_in_any_order() -> None:
    first = evaluation(1)
    order = np.random.default_rng(0).permutation(40)[:25]
    second = {name: column[order] for name, column in first.items()}
    rows, others = common_cases(first, second)
    assert sorted(rows) == sorted(order)
    assert (first["sun_angle_rad"][rows] == second["sun_angle_rad"][others]).all()
    with pytest.raises(ValueError, match="share no case"):
        compare(first, evaluation(2), 95.0)


def test_two_runs_by_tests_of_scipy() -> None:
    first, second = evaluation(1), {**evaluation(1), "success": evaluation(5)["success"]}
    second["delta_v_m_s"] = first["delta_v_m_s"] + np.random.default_rng(9).normal(-0.1, 0.2, 40)
    told = {one.metric.name: one for one in compare(first, second, 95.0)}
    spent, success = told["delta_v_m_s"], told["success"]
    gained = second["delta_v_m_s"] - first["delta_v_m_s"]
    assert spent.p_value == pytest.approx(stats.wilcoxon(gained, method="exact").pvalue)
    assert (spent.better, spent.worse) == ((gained < 0).sum(), (gained > 0).sum())
    before, after = (one["success"] & ~one["violated"] for one in (first, second))
    won, lost = (after & ~before).sum(), (before & ~after).sum()
    assert (success.better, success.worse) == (won, lost)
    assert success.p_value == pytest.approx(stats.binomtest(int(won), int(won + lost)).pvalue)
    assert told["violated"].p_value == 1.0


def test_effects_are_those_put_in() -> None:
    runs = [
        ({"law": law, "seed": str(seed)}, evaluation(seed, shift=shift))
        for law, shift in (("a", 0.0), ("b", 0.25))
        for seed in (1, 2, 3)
    ]
    runs.append(({"law": "c", "seed": "1"}, evaluation(1, shift=-0.5)))
    told = {(one.factor, one.level): one for one in effects(runs, 95.0) if one.metric is METRICS[0]}
    several, single = told["law", "b"], told["law", "c"]
    assert (several.unit, several.difference.count) == ("runs", 3)
    assert several.difference.mean == pytest.approx(0.25)
    assert several.difference.is_told
    assert (single.unit, single.difference.count) == ("cases", 40)
    assert single.difference.mean == pytest.approx(-0.5)
    # seeds share no case: means are compared, of the two laws that flew both
    between = [evaluation(2)["delta_v_m_s"].mean() - evaluation(1)["delta_v_m_s"].mean()]
    assert told["seed", "2"].difference.mean == pytest.approx(between[0])
    assert told["seed", "2"].difference.count == 2


def test_the_front_is_what_no_other_surpasses() -> None:
    generator = np.random.default_rng(4)
    spent, inspected = generator.integers(0, 9, (2, 60)).astype(float)
    expected = [
        not any((p <= s and q >= i) and (p < s or q > i) for p, q in zip(spent, inspected, strict=True))
        for s, i in zip(spent, inspected, strict=True)
    ]
    assert on_front(spent, inspected).tolist() == expected
    assert 1 <= sum(expected) < 60
