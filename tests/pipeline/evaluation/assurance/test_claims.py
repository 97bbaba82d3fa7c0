import numpy as np
import pytest
from scipy.stats import binom, binomtest

from pipeline.evaluation.assurance.verdicts import cases_needed, failures_allowed, judge, share_bounds


@pytest.mark.parametrize(
    ("probability", "cases"),
    [
        (0.99, (230, 388, 531, 667)),
        (0.9973, (852, 1440, 1970, 2473)),
        (0.99865, (1705, 2880, 3941, 4947)),
        (0.9999, (23025, 38896)),
    ],
)
def test_cases_needed_are_those_of_hanson_and_beard(probability, cases):
    """NASA/TP-2010-216447, with a consumer's risk of 10 %."""
    assert tuple(cases_needed(probability, 0.9, failed) for failed in range(len(cases))) == cases
    for failed, number in enumerate(cases):
        assert failures_allowed(number, probability, 0.9) == failed
        assert failures_allowed(number - 1, probability, 0.9) == failed - 1


@pytest.mark.parametrize(("met", "cases"), [(0, 10), (10, 10), (7, 10), (993, 1000), (9993, 10000)])
def test_bounds_are_those_of_scipy(met, cases):
    for confidence in (0.8, 0.9, 0.95):
        low, high = share_bounds(met, cases, confidence)
        greater, less = (binomtest(met, cases, alternative=side) for side in ("greater", "less"))
        assert low == pytest.approx(greater.proportion_ci(confidence).low, abs=1e-12)
        assert high == pytest.approx(less.proportion_ci(confidence).high, abs=1e-12)


def test_a_claim_is_shown_where_the_lower_bound_reaches_it():
    for cases in (50, 231, 1000):
        allowed = failures_allowed(cases, 0.99, 0.9)
        for failed in range(10):
            low, _ = share_bounds(cases - failed, cases, 0.9)
            assert (failed <= allowed) == (low >= 0.99)


def test_verdicts():
    def verdict(num_failed, num_cases=1000):
        margins = np.r_[-np.ones(num_failed), np.ones(num_cases - num_failed)]
        return judge(margins, margins > 0, 0.99, 0.9).verdict

    assert [verdict(count) for count in (0, 5, 6, 12, 15, 16)] == [
        *("shown", "shown", "open", "open", "refuted", "refuted")
    ]
    assert verdict(0, 229) == "open"
    assert verdict(0, 230) == "shown"


def test_margins_by_order_statistics():
    margins = np.random.default_rng(1).permutation(np.arange(1000.0))
    judgement = judge(margins, margins >= 3, 0.99, 0.9)
    # P(at most 5 of 1000 below the 1 % quantile) is at most 10 %, of 6 it is more
    assert binom.cdf(5, 1000, 0.01) <= 0.1 < binom.cdf(6, 1000, 0.01)
    assert (judgement.margin, judgement.worst_margin, judgement.median_margin) == (5.0, 0.0, 499.5)
    assert judge(margins[:50], margins[:50] >= 3, 0.99, 0.9).margin is None


def test_claims_are_wrong_as_rarely_as_their_confidence_says():
    """Of samples from cases of which just less than 95 % succeed, at most a tenth shows 95 %."""
    draws = np.random.default_rng(5).random((4000, 200)) < 0.9499
    failed = (~draws).sum(axis=1)
    wrong = np.mean(failed <= failures_allowed(200, 0.95, 0.9))
    assert 0.02 < wrong <= 0.1
