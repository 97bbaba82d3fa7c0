import pytest

from pipeline.evaluation.assurance.formula import (
    Always,
    And,
    Comparison,
    Eventually,
    FormulaError,
    Not,
    Or,
    Until,
    Window,
    parse,
    quantities_of,
    unit_of,
)

UNITS = {"distance": "m", "speed": "m/s", "inspection_rate": "%", "points": ""}
NEAR = Comparison((("distance", -1.0),), 60.0, True, "m")


def test_what_binds_closest_is_read_first():
    a, b, c = (Comparison((("points", 1.0),), -float(n), True, "") for n in (1, 2, 3))
    assert parse("points > 1 or points > 2 and points > 3", UNITS) == Or(a, And(b, c))
    assert parse("points > 1 -> points > 2 -> points > 3", UNITS) == Or(Not(a), Or(Not(b), c))
    assert parse("not points > 1 until[0:9] points > 2", UNITS) == Until(Window(0, 9), Not(a), b)
    assert parse("always eventually[2,5] points > 1", UNITS) == Always(Window(), Eventually(Window(2, 5), a))


def test_a_formula_without_end_is_refused():
    for text in ("(" * 9999, "not " * 9999, "points > 1 -> " * 9999):
        with pytest.raises(FormulaError, match="without end"):
            parse(text, UNITS)


def test_units_may_stand_or_not():
    assert parse("distance < 60", UNITS) == parse("distance < 60 m", UNITS) == NEAR
    assert parse("always[0 s: 10 s] inspection_rate >= 95 %", UNITS) == parse(
        "always[0:10] inspection_rate >= 95", UNITS
    )


def test_sums_come_to_one_side():
    formula = parse("0.5 * distance + 2 m >= distance - 3", UNITS)
    assert formula == Comparison((("distance", -0.5),), 5.0, False, "m")


def test_a_formula_tells_its_quantities_and_the_unit_of_its_margin():
    formula = parse("always (distance < 60 -> speed < 1) and distance > 15", UNITS)
    assert quantities_of(formula) == ("distance", "speed")
    assert unit_of(formula) is None
    assert unit_of(parse("always distance > 15", UNITS)) == "m"


@pytest.mark.parametrize(
    ("text", "column", "words"),
    [
        ("always (distnce >= 15)", 8, "no quantity distnce; did you mean distance?"),
        ("always (zzz >= 15)", 8, "there are distance, speed"),
        ("always (distance >= 15 m/s)", 20, "m/s does not go with m"),
        ("always[0 3600] distance >= 15", 9, "expected : and the window's end"),
        ("always (distance >= 15", 22, "expected )"),
        ("distance + speed > 3", 11, "m/s does not go with m"),
        ("points + distance > 3", 9, "m does not go with a pure number"),
        ("distance > 3 k", 13, "k is no unit here"),
        ("3 > 2", 0, "name a quantity"),
        ("always[5:3] distance > 1", 9, "before it begins"),
        ("always[0 m:3] distance > 1", 9, "windows are in s, not in m"),
        ("distance ? 3", 9, "'?' means nothing"),
        ("", 0, "expected a quantity or a number"),
        ("distance > 15 and", 17, "expected a quantity or a number"),
        ("distance > 15 15", 14, "expected and, or, until"),
        ("3 m * distance > 1", 0, "without a unit"),
        ("distance", 8, "expected >=, <=, > or <"),
    ],
)
def test_mistakes_are_pointed_at(text, column, words):
    with pytest.raises(FormulaError) as caught:
        parse(text, UNITS)
    shown, pointed = str(caught.value).split("\n")
    assert shown == text
    assert pointed.index("^") == column
    assert words in pointed
