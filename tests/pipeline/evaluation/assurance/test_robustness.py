"""Robustness against rtamt, whose table `rtamt_table.py` makes in an environment of its own, and by hand."""

import json
from itertools import product
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from pipeline.evaluation.assurance.formula import (
    Window,
    _least_ahead,
    _margin,
    _over,
    holds,
    parse,
    robustness,
)

TABLE = json.loads(Path(__file__).with_name("rtamt_table.json").read_text(encoding="utf-8"))
UNITS = {"a": "", "b": ""}


@pytest.mark.parametrize("case", TABLE["cases"], ids=lambda case: f"{case['formula']} on {case['trace']}")
def test_rtamt_agrees_at_every_sample(case):
    trace = {name: np.array([row]) for name, row in TABLE["traces"][case["trace"]].items()}
    ours = _over(parse(case["formula"], UNITS), trace, 1.0, _margin)[0]
    np.testing.assert_allclose(ours, case["robustness"], rtol=0, atol=1e-12)


def test_flights_do_not_know_one_another():
    traces = np.random.default_rng(3).normal(size=(7, 40))
    formula = parse("always[0:9] (a > 0 -> eventually[2:11] a < 0)", UNITS)
    together = robustness(formula, {"a": traces}, 1.0)
    alone = [robustness(formula, {"a": row[np.newaxis]}, 1.0)[0] for row in traces]
    np.testing.assert_array_equal(together, alone)


@given(arrays(np.float64, (2, 13), elements=st.floats(-5, 5)), st.integers(0, 15), st.integers(0, 15))
def test_the_least_of_a_window_is_the_least_of_its_samples(values, first, extra):
    found = _least_ahead(values, first, first + extra)
    for row, k in product(range(2), range(13)):
        assert found[row, k] == min(values[row, k + first : k + first + extra + 1], default=np.inf)


@given(arrays(np.float64, (3, 9), elements=st.sampled_from([-1.0, 0.0, 1.0])))
def test_what_holds_has_a_margin_that_is_not_below_zero(values):
    for text in ("always a >= 0", "eventually[1:4] a > 0", "not (a > 0) until[0:5] a >= 1"):
        formula = parse(text, UNITS)
        margin, truth = robustness(formula, {"a": values}, 1.0), holds(formula, {"a": values}, 1.0)
        assert np.all(truth[margin > 0.0])
        assert not np.any(truth[margin < 0.0])


def test_at_a_margin_of_zero_only_the_weak_comparison_holds():
    signals = {"a": np.array([[15.0, 20.0]])}
    assert holds(parse("always a >= 15", UNITS), signals, 1.0)[0]
    assert not holds(parse("always a > 15", UNITS), signals, 1.0)[0]


def test_windows_are_in_seconds_whatever_the_period():
    signals = {"a": np.array([[5.0, 4.0, 3.0, 2.0]])}
    for window, least in ((Window(0, 20), 3.0), (Window(0, 29.9), 3.0), (Window(10, 30), 2.0)):
        text = f"always[{window.first_s}:{window.last_s}] a >= 0"
        assert robustness(parse(text, UNITS), signals, 10.0)[0] == least


def test_margins_of_flights_with_a_closed_form():
    """On cosine of t from 0 to 2 pi: least and greatest of quarters are known."""
    time = np.linspace(0.0, 2.0 * np.pi, 361)
    signals = {"a": np.cos(time)[np.newaxis]}
    period = time[1]
    quarter = 90 * period
    for text, expected in (
        ("always a >= -1.5", 0.5),
        (f"always[0:{quarter}] a >= 0", 0.0),
        (f"eventually[{quarter}:{2 * quarter}] a <= 0", 1.0),
        (f"a >= -2 until[0:{2 * quarter}] a <= -0.5", 0.5),
    ):
        assert robustness(parse(text, UNITS), signals, period)[0] == pytest.approx(expected, abs=1e-12)
