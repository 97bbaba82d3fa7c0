"""What other toolkits do without a word: columns by place, defaults that look like answers, digits lost."""

from typing import Any

import numpy as np
import pyarrow as pa
import pytest

from fis_tools.engines import inference, interpreter
from fis_tools.engines.compiler import NoRuleFired, compile
from fis_tools.model import FuzzySystem, Gaussian, Term, Triangular, Variable, table_rules


def system(base: float = 0.0, width: float = 30.0) -> FuzzySystem:
    """Two inputs that differ in meaning, with a gap between two terms, where no rule fires."""
    gap = (Term("low", Triangular(0.0, 0.0, 4.0)), Term("high", Triangular(6.0, 10.0, 10.0)))
    low, high = (Gaussian(base + share * width, width / 4) for share in (0.2, 0.9))
    inputs = (
        Variable("service", "", 0.0, 10.0, gap),
        Variable("food", "", 0.0, 10.0, (Term("bad", Gaussian(0.0, 4.0)), Term("good", Gaussian(10.0, 4.0)))),
    )
    output = Variable(
        "tip", "", base, base + width, (Term("small", low), Term("large", high)), default=base + width / 2
    )
    rules = table_rules(inputs, output, ["small", "large", "small", "large"])
    return FuzzySystem("tipper", inputs, (output,), rules)


SERVICE, FOOD = np.array([1.0, 9.0, 5.0]), np.array([8.0, 2.0, 3.0])


def tables() -> list[Any]:
    """The same samples by name, with the columns the other way round and one besides."""
    structured = np.zeros(3, dtype=[("food", float), ("time", float), ("service", float)])
    structured["service"], structured["food"] = SERVICE, FOOD
    return [pa.table({"food": FOOD, "time": np.zeros(3), "service": SERVICE}), structured]


@pytest.mark.parametrize("table", tables(), ids=["data frame", "structured array"])
def test_columns_go_by_their_names(table: Any) -> None:
    tip = compile(system())
    by_place = np.stack([SERVICE, FOOD], axis=1)
    expected = tip(by_place)
    assert abs(expected[0, 0] - tip(by_place[:, ::-1])[0, 0]) > 1.0
    np.testing.assert_array_equal(tip(table)["tip"], expected[:, 0])
    np.testing.assert_array_equal(tip.firing_strengths(table), tip.firing_strengths(by_place))
    np.testing.assert_array_equal(inference.evaluate(system(), table), inference.evaluate(system(), by_place))
    named = inference.infer(system(), {"food": 8.0, "service": 1.0})
    np.testing.assert_array_equal(named.values, inference.infer(system(), np.array([1.0, 8.0])).values)


def test_a_table_without_an_input_is_refused() -> None:
    with pytest.raises(ValueError, match="column 'service' is missing; pass service, food"):
        compile(system())(pa.table({"food": FOOD, "0": SERVICE}))


def test_answers_tell_where_no_rule_fires() -> None:
    tip = compile(system())
    answers = tip.infer({"service": SERVICE, "food": FOOD})
    np.testing.assert_array_equal(answers.no_rule_fired["tip"], [False, False, True])
    assert answers.count == {"tip": 1}
    assert answers.outputs["tip"][2] == 15.0
    rows = np.stack([SERVICE, FOOD], axis=1)
    np.testing.assert_array_equal(np.isnan(tip(rows, on_no_fire="nan")[:, 0]), [False, False, True])
    with pytest.raises(NoRuleFired, match=r"'tip' fires at 1 of 3 samples, first at number 2 \(service 5"):
        tip(rows, on_no_fire="raise")
    np.testing.assert_array_equal(tip(rows[:2], on_no_fire="raise"), tip(rows[:2]))


@pytest.mark.parametrize("width", [1.0, 365.0])
def test_outputs_far_from_zero_are_scikit_fuzzys(width: float) -> None:
    julian = system(2.46e6, width)
    rows = np.random.default_rng(15).uniform(0.0, 10.0, (50, 2))
    compiled = compile(julian)
    plain = interpreter.evaluate(compiled.program, rows)
    assert np.abs(compiled(rows) - plain).max() <= 1e-12 * width
    np.testing.assert_array_equal(plain, inference.evaluate(julian, rows))
    assert np.ptp(plain) > 0.2 * width
