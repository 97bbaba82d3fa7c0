"""Statistics against numbers worked out by hand, and intervals against scipy's."""

import itertools

import numpy as np
import pytest
from scipy import stats

from pipeline.evaluation import statistics


@pytest.mark.parametrize("confidence_percent", [90.0, 95.0, 99.0])
@pytest.mark.parametrize(("count", "number"), [(0, 20), (1, 20), (8, 8), (960, 1000), (1, 1), (50, 99)])
def test_the_interval_of_a_fraction_is_wilsons(count: int, number: int, confidence_percent: float) -> None:
    is_so = np.arange(number) < count
    expected = stats.binomtest(count, number).proportion_ci(confidence_percent / 100.0, method="wilson")
    share = statistics.fraction(is_so, confidence_percent)
    assert (share.count, share.fraction) == (count, count / number)
    assert share.low == pytest.approx(expected.low, rel=1e-12, abs=1e-15)
    assert share.high == pytest.approx(expected.high, rel=1e-12)
    assert 0.0 <= share.low <= share.fraction <= share.high <= 1.0


def test_a_statistic_has_the_spread_of_a_sample() -> None:
    """Of 1, 2, 3, 6: mean 3, sum of squares 14, divided by 3; the interval is Student's."""
    computed = statistics.statistic(np.array([1.0, 2.0, 3.0, 6.0]), 95.0)
    spread = np.sqrt(14.0 / 3.0)
    assert (computed.mean, computed.minimum, computed.maximum) == (3.0, 1.0, 6.0)
    assert computed.standard_deviation == pytest.approx(spread, rel=1e-14)
    # the quantile of three degrees of freedom, as tables have it
    assert computed.high - 3.0 == pytest.approx(3.182446305284263 * spread / 2.0, rel=1e-12)
    assert computed.low + computed.high == pytest.approx(6.0, rel=1e-14)
    alone = statistics.statistic(np.array([4.0]), 95.0)
    assert (alone.mean, alone.standard_deviation, alone.low, alone.high) == (4.0, 0.0, 4.0, 4.0)


@pytest.mark.parametrize(("percent", "number"), [(50.0, 21), (99.0, 200), (99.0, 1000), (1.0, 1000)])
def test_the_interval_of_a_percentile_holds_it_as_often_as_it_says(percent: float, number: int) -> None:
    """Of a uniform sample the r-th value is beta distributed, whatever the law of the flights."""
    share = percent / 100.0
    interval = statistics.percentile(np.arange(1.0, number + 1.0), percent, 90.0)
    assert interval.value == np.ceil(share * number - 1e-9)
    for end, is_low in ((interval.low, True), (interval.high, False)):
        if end is None:
            continue
        passed = stats.beta(end, number + 1 - end)
        # the chance that the end lies on the wrong side of the percentile, and that the next would
        wrong = passed.sf(share) if is_low else passed.cdf(share)
        assert wrong <= 0.05
        nearer = end + 1 if is_low else end - 1
        law = stats.beta(nearer, number + 1 - nearer)
        assert (law.sf(share) if is_low else law.cdf(share)) > 0.05
    assert (interval.high is None) == (share**number > 0.05)
    assert (interval.low is None) == ((1.0 - share) ** number > 0.05)


def test_rank_correlation_is_scipys() -> None:
    generator = np.random.default_rng(5)
    first = generator.normal(size=300)
    second = np.round(np.exp(0.7 * first + generator.normal(size=300)), 1)
    correlation = statistics.rank_correlation(first, second, 95.0)
    assert correlation.value == pytest.approx(stats.spearmanr(first, second).statistic, rel=1e-12)
    bootstrap = stats.bootstrap(
        (first, second), lambda x, y: stats.spearmanr(x, y).statistic, paired=True, vectorized=False,
        n_resamples=400, method="percentile", random_state=generator,
    )  # fmt: skip
    assert correlation.low == pytest.approx(bootstrap.confidence_interval.low, abs=0.03)
    assert correlation.high == pytest.approx(bootstrap.confidence_interval.high, abs=0.03)
    assert statistics.rank_correlation(first, np.ones(300), 95.0).value == 0.0


def evaluation(seed: int, num_cases: int = 40, shift: float = 0.0) -> dict[str, np.ndarray]:
    """An evaluation: its starts follow from the seed, its delta-v is shifted by as much in every case."""
    generator = np.random.default_rng(seed)
    starts = {name: generator.normal(size=num_cases) for name in statistics.START}
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
    gain = statistics.difference(values, 90.0)
    interval = stats.ttest_1samp(values, 0.0).confidence_interval(0.9)
    assert (gain.low, gain.high) == pytest.approx((interval.low, interval.high))
    assert gain.count == 17
    assert not statistics.difference(values[:1], 90.0).excludes_zero
    shares = np.array([-100.0] * 39 + [0.0])
    assert (
        statistics.difference(shares, 95.0, most=100.0).low
        == -100.0
        < statistics.difference(shares, 95.0).high
    )


def test_common_cases_are_found_in_any_order() -> None:
    first = evaluation(1)
    order = np.random.default_rng(0).permutation(40)[:25]
    second = {name: column[order] for name, column in first.items()}
    rows, others = statistics.common_cases(first, second)
    assert sorted(rows) == sorted(order)
    assert (first["sun_angle_rad"][rows] == second["sun_angle_rad"][others]).all()
    moving = first | {"velocity_y_m_s": first["velocity_y_m_s"] + 0.1}
    for other in (evaluation(2), moving):
        with pytest.raises(ValueError, match="share no case"):
            statistics.compare(first, other, 95.0)


def test_two_runs_by_tests_of_scipy() -> None:
    first, second = evaluation(1), {**evaluation(1), "success": evaluation(5)["success"]}
    second["delta_v_m_s"] = first["delta_v_m_s"] + np.random.default_rng(9).normal(-0.1, 0.2, 40)
    by_metric = {row.metric.name: row for row in statistics.compare(first, second, 95.0)}
    spent, success = by_metric["delta_v_m_s"], by_metric["success"]
    gained = second["delta_v_m_s"] - first["delta_v_m_s"]
    assert spent.p_value == pytest.approx(stats.wilcoxon(gained, method="exact").pvalue)
    assert (spent.better, spent.worse) == ((gained < 0).sum(), (gained > 0).sum())
    before, after = (row["success"] & ~row["violated"] for row in (first, second))
    won, lost = (after & ~before).sum(), (before & ~after).sum()
    assert (success.better, success.worse) == (won, lost)
    assert success.p_value == pytest.approx(stats.binomtest(int(won), int(won + lost)).pvalue)
    assert by_metric["violated"].p_value == 1.0


def test_effects_are_those_put_in() -> None:
    runs = [
        ({"law": law, "seed": str(seed)}, evaluation(seed, shift=shift))
        for law, shift in (("a", 0.0), ("b", 0.25))
        for seed in (1, 2, 3)
    ]
    runs.append(({"law": "c", "seed": "1"}, evaluation(1, shift=-0.5)))
    estimated = [
        effect for effect in statistics.effects(runs, 95.0) if effect.metric is statistics.METRICS[0]
    ]
    by_name = {(effect.factor, effect.level): effect for effect in estimated}
    several, single = by_name["law", "b"], by_name["law", "c"]
    assert (several.unit, several.difference.count) == ("runs", 3)
    assert several.difference.mean == pytest.approx(0.25)
    assert several.difference.excludes_zero
    assert (single.unit, single.difference.count) == ("cases", 40)
    assert single.difference.mean == pytest.approx(-0.5)
    # seeds share no case: means are compared, of the two laws that flew both
    between = [evaluation(2)["delta_v_m_s"].mean() - evaluation(1)["delta_v_m_s"].mean()]
    assert by_name["seed", "2"].difference.mean == pytest.approx(between[0])
    assert by_name["seed", "2"].difference.count == 1
    extended = [*runs, ({"sun": "fixed"}, evaluation(1)), ({"sun": "random"}, evaluation(1, shift=0.5))]
    more = [effect for effect in statistics.effects(extended, 95.0) if effect.metric is statistics.METRICS[0]]
    assert [effect.difference for effect in more if effect.factor == "law"] == [
        several.difference,
        single.difference,
    ]
    assert [effect.difference.mean for effect in more if effect.factor == "sun"] == [pytest.approx(0.5)]


def test_runs_of_the_same_cases_count_once() -> None:
    noise = np.random.default_rng(2).normal(0.1, 0.2, 40)
    runs = []
    for layer, level in itertools.product("xy", "ab"):
        flown = evaluation(1)
        flown["delta_v_m_s"] = flown["delta_v_m_s"] + noise * (level == "b")
        runs.append(({"layer": layer, "law": level}, flown))
    estimated = [
        effect for effect in statistics.effects(runs, 95.0) if effect.metric is statistics.METRICS[0]
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
    assert statistics.on_front(spent, inspected).tolist() == expected
    assert 1 <= sum(expected) < 60
