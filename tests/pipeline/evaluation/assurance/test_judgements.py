"""What n cases come to for a claim."""

import numpy as np
import pytest
from scipy.stats import binom, binomtest

from pipeline.evaluation.assurance import judgements
from tests.pipeline.evaluation.assurance.cases import cases


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
    assert tuple(judgements.cases_needed(probability, 0.9, failed) for failed in range(len(cases))) == cases
    for failed, number in enumerate(cases):
        assert judgements.failures_allowed(number, probability, 0.9) == failed
        assert judgements.failures_allowed(number - 1, probability, 0.9) == failed - 1


@pytest.mark.parametrize(("met", "cases"), [(0, 10), (10, 10), (7, 10), (993, 1000), (9993, 10000)])
def test_bounds_are_those_of_scipy(met, cases):
    for confidence in (0.8, 0.9, 0.95):
        low, high = judgements.share_bounds(met, cases, confidence)
        greater, less = (binomtest(met, cases, alternative=side) for side in ("greater", "less"))
        assert low == pytest.approx(greater.proportion_ci(confidence).low, abs=1e-12)
        assert high == pytest.approx(less.proportion_ci(confidence).high, abs=1e-12)


@pytest.mark.parametrize(
    ("verdict", "counts"),
    [
        ("shown", [(0, 1000), (5, 1000), (0, 230)]),
        ("not shown", [(6, 1000), (12, 1000), (0, 229)]),
        ("refuted", [(15, 1000), (16, 1000)]),
    ],
)
def test_verdicts(verdict, counts):
    assert {cases(*count).verdict for count in counts} == {verdict}


def test_margins_by_order_statistics():
    margins = np.random.default_rng(1).permutation(np.arange(1000.0))
    judgement = judgements.judge(margins, margins >= 3, 0.99, 0.9)
    # P(at most 5 of 1000 below the 1 % quantile) is at most 10 %, of 6 it is more
    assert binom.cdf(5, 1000, 0.01) <= 0.1 < binom.cdf(6, 1000, 0.01)
    assert (judgement.margin, judgement.worst_margin, judgement.median_margin) == (5.0, 0.0, 499.5)
    assert judgements.judge(margins[:50], margins[:50] >= 3, 0.99, 0.9).margin is None
