"""Bounds against very many evaluations and closed forms; questions against grids; mistakes."""

import re
from dataclasses import replace

import numpy as np
import pytest

from fis_tools.analysis.bounds import Interval, ask, output_ranges
from fis_tools.analysis.condition import read_conditions, read_region
from fis_tools.array_types import Floats
from fis_tools.engines import inference, interpreter, interval
from fis_tools.engines.compiler import compile
from fis_tools.model import ALL_SEMANTICS, Consequent, FuzzySystem, Rule, Variable
from fis_tools.model.shapes import Gaussian, Sampled, Triangular
from tests.fis_tools import step_by_step
from tests.fis_tools.engines import random_systems
from tests.fis_tools.sample_controllers import FORCE_X, FORCE_Z, table_system, terms


def _boxes(system: FuzzySystem, generator: np.random.Generator, count: int) -> tuple[Floats, Floats]:
    """Boxes from a point to several universes wide, about inputs that look for trouble."""
    low, high = step_by_step.ends(system)
    centre = random_systems.inputs_for(system, generator, count)
    width = 10.0 ** generator.uniform(-6, 0.3, (count, 1)) * (high - low)
    width *= generator.choice([0.0, 1.0], width.shape, p=[0.2, 0.8])
    return centre - width * generator.random(width.shape), centre + width * generator.random(width.shape)


def _inside(low: Floats, high: Floats, generator: np.random.Generator, count: int) -> Floats:
    """Inputs in a box: everywhere, and at its corners."""
    everywhere = generator.uniform(low, high, (count, len(low)))
    corners = np.where(generator.random((8, len(low))) < 0.5, low, high)
    return np.clip(np.concatenate([everywhere, corners]), low, high)


def test_no_output_lies_outside_its_bounds():
    """Of systems of every kind that can be bounded."""
    num_systems = num_outputs = 0
    makers = (random_systems.full_table_system, *[random_systems.random_general_system] * 3)
    for seed in range(40):
        generator = np.random.default_rng([91, seed])
        system = makers[seed % 4](generator)
        system = random_systems.hedged(system, generator) if seed % 3 == 1 else system
        try:
            program = interval.pack(system)
        except interval.NotBounded:
            continue
        num_systems += 1
        low, high = _boxes(system, generator, 6)
        least, greatest, _ = interval.bound(program, low, high)
        for box in range(len(low)):
            outputs = interpreter.evaluate(program, _inside(low[box], high[box], generator, 150))
            num_outputs += outputs.size
            assert (outputs >= least[box]).all()
            assert (outputs <= greatest[box]).all()
    assert num_systems > 20
    assert num_outputs > 20_000


def test_no_output_of_a_sampled_system_lies_outside_its_bounds_or_its_range():
    """Of MATLAB's, fuzzylite's and jFuzzyLogic's systems, also at inputs beyond their ranges."""
    num_outputs = num_ranges = 0
    for number, system in enumerate(random_systems.sampled_systems(93, 60)):
        try:
            program = interval.pack(system)
        except interval.NotBounded:
            continue
        generator = np.random.default_rng([94, number])
        low = random_systems.inputs_beyond(system, generator, 8)
        spans = np.array([variable.span for variable in system.inputs])
        high = low + spans * 10.0 ** generator.uniform(-6, 0.3, (8, 1))
        least, greatest, _ = interval.bound(program, low, high)
        for box in range(len(low)):
            corners = np.where(generator.random((8, len(spans))) < 0.5, low[box], high[box])
            inputs = np.concatenate([generator.uniform(low[box], high[box], (100, len(spans))), corners])
            outputs = interpreter.evaluate(program, inputs)
            num_outputs += outputs.size
            assert (outputs >= least[box]).all()
            assert (outputs <= greatest[box]).all()
        for column, output in enumerate(system.outputs):
            if not system.weighs(output):
                num_ranges += 1
                assert output.default is not None
                assert least[:, column].min() >= min(output.minimum, output.default)
                assert greatest[:, column].max() <= max(output.maximum, output.default)
    assert num_outputs > 40_000
    assert num_ranges > 20


def test_a_bisector_may_be_rounded_below_the_point_that_it_is():
    """jFuzzyLogic counts its steps from the end of the range, and adds them up for the points."""
    system, end = random_systems.sampled_systems(34, 12)[5], -1.9922207140443116
    (bounded,) = output_ranges(system, f"x0 in [-3.457068028487083, {end}]", max_boxes=200)
    assert bounded.outer.low <= compile(system)(np.array([[end]]))[0, 0] <= bounded.outer.high


@pytest.mark.parametrize("semantics", [tool for tool in ALL_SEMANTICS if tool != "scikit-fuzzy"])
def test_bisectors_of_sets_with_a_gap_between_them_and_at_an_end_lie_inside(semantics):
    """As near to half are all points of the gap; jFuzzyLogic does not count the ends."""
    x = Variable("x", "", 0.0, 1.0, terms(a=Triangular(-1.0, 0.0, 1.0), b=Triangular(0.0, 1.0, 2.0)))
    y = Variable(
        "y", "", 0.0, 9.0, terms(c=Triangular(0.0, 0.0, 2.0), d=Triangular(7.0, 8.0, 8.5)), default=0.0
    )
    system = table_system("gap", (x,), y, "cd", semantics=semantics, defuzzifier="bisector")
    program = interval.pack(system)
    low = np.linspace(0.0, 0.9, 300)[:, np.newaxis]
    for width in (0.0, 1e-3, 0.1):
        least, greatest, _ = interval.bound(program, low, low + width)
        for share in (0.0, 0.4, 1.0):
            answers = interpreter.evaluate(program, low + share * width)
            assert ((answers >= least) & (answers <= greatest)).all()


@pytest.mark.parametrize("system", [FORCE_X, FORCE_Z], ids=lambda system: system.name)
def test_at_a_point_the_interval_is_tight_about_the_output(system):
    generator = np.random.default_rng(94)
    inputs = generator.uniform(*step_by_step.ends(system), (300, len(system.inputs)))
    least, greatest, _ = interval.bound(interval.pack(system), inputs, inputs)
    outputs = step_by_step.evaluate(system, inputs[:40])
    assert ((outputs >= least[:40]) & (outputs <= greatest[:40])).all()
    width = (greatest - least)[:, 0] / (system.outputs[0].maximum - system.outputs[0].minimum)
    assert np.quantile(width, 0.5) < 1e-11
    assert width.max() < 1e-3


def test_intervals_shrink_with_their_boxes():
    generator = np.random.default_rng(95)
    inputs = generator.uniform(*step_by_step.ends(FORCE_X), (200, 2))
    ranges = np.subtract(*step_by_step.ends(FORCE_X)[::-1])
    program = interval.pack(FORCE_X)
    widths = []
    for size in (1e-2, 1e-3, 1e-4):
        least, greatest, _ = interval.bound(program, inputs - size * ranges, inputs + size * ranges)
        widths.append(float(np.mean(greatest - least)))
    assert widths[0] > 5 * widths[1] > 25 * widths[2] > 0.0


def _bounds(system: FuzzySystem, **box: tuple[float, float]) -> Interval:
    """Bound the only output over a box of inputs, in one step."""
    ends = {v.name: (v.minimum, v.maximum) for v in system.inputs} | box
    low, high = np.array(list(ends.values())).T[:, np.newaxis]
    least, greatest, _ = interval.bound(interval.pack(system), low, high)
    return Interval(least.item(), greatest.item())


def test_the_extremal_centroids_of_two_blocks_are_known():
    """Two blocks, one unit wide, about 0.5 and 3.5; x cuts the first at 1 - x and the second at x."""
    edge = 1e-6
    points = (0.0, edge, 1.0 - edge, 1.0, 3.0, 3.0 + edge, 4.0 - edge, 4.0)
    blocks = terms(left=Sampled((0, 1, 1, 0, 0, 0, 0, 0)), right=Sampled((0, 0, 0, 0, 0, 1, 1, 0)))
    falling_rising = terms(low=Triangular(0.0, 0.0, 1.0), high=Triangular(0.0, 1.0, 1.0))
    x = Variable("x", "", 0.0, 1.0, falling_rising, num_points=11)
    y = Variable("y", "", 0.0, 4.0, blocks, num_points=8, points=points, default=0.0)
    system = table_system("blocks", (x,), y, ["left", "right"])
    # cuts in [0.5, 0.8] and [0.2, 0.5]: the centroid is (0.5 a + 3.5 b) / (a + b)
    bounded = _bounds(system, x=(0.2, 0.5))
    assert bounded.low == pytest.approx((0.5 * 0.8 + 3.5 * 0.2) / 1.0, abs=1e-5)
    assert bounded.high == pytest.approx((0.5 * 0.5 + 3.5 * 0.5) / 1.0, abs=1e-5)


@pytest.mark.parametrize("defuzzifier", ["centroid", "mom", "som", "lom"])
def test_the_default_is_possible_exactly_where_no_rule_may_fire(defuzzifier):
    """A rule on either side, and inputs between 0.4 and 0.6 for which none fires."""
    ends = terms(low=Triangular(-0.4, 0.0, 0.4), high=Triangular(0.6, 1.0, 1.4))
    x = Variable("x", "", 0.0, 1.0, ends)
    sides = terms(left=Triangular(-1.5, -1.0, -0.5), right=Triangular(0.5, 1.0, 1.5))
    y = Variable("y", "", -2.0, 2.0, sides, default=5.0)
    system = table_system("gapped", (x,), y, ["left", "right"], defuzzifier=defuzzifier)
    assert _bounds(system, x=(0.45, 0.55)) == Interval(5.0, 5.0)
    over_the_edge = _bounds(system, x=(0.3, 0.5))
    assert over_the_edge.high == 5.0
    assert over_the_edge.low < -0.99
    assert _bounds(system, x=(0.1, 0.3)).high < 0.0


def test_outputs_that_collapse_for_want_of_area_stay_inside():
    """scikit-fuzzy divides by 2.2e-16 at least: outputs of a universe as narrow as that fall out of it."""
    y = Variable("y", "", 1e-16, 2e-16, terms(only=Gaussian(1.5e-16, 1e-17)), default=1.5e-16)
    x = Variable("x", "", 0.0, 1.0, terms(any=Triangular(0.0, 1.0, 1.0)))
    system = table_system("tiny", (x,), y, ["only"])
    output = step_by_step.evaluate(system, np.array([[0.5]]))[0, 0]
    assert output < y.minimum
    bounded = _bounds(system, x=(0.4, 0.6))
    assert bounded.low <= output <= bounded.high


def test_what_cannot_be_bounded_is_refused_in_a_sentence():
    with pytest.raises(interval.NotBounded, match="bisector is not the bisector"):
        _bounds(replace(FORCE_X, defuzzifier="bisector"))
    last = Rule(FORCE_X.rules[0].antecedent, (Consequent("force_x", "ZE"),), and_operator="product")
    system = replace(FORCE_X, rules=(*FORCE_X.rules, last))
    _bounds(system)
    _bounds(replace(system, outputs=(replace(system.outputs[0], accumulation="hamacher_sum"),)))


def _on_grid(system: FuzzySystem, where: str) -> Floats:
    region = read_region(system, where)
    axes = [np.linspace(low, high, 60) for low, high in zip(region.low, region.high, strict=True)]
    inputs = np.stack([axis.ravel() for axis in np.meshgrid(*axes)], axis=1)
    return interpreter.evaluate(interval.pack(system), inputs[region.holds(inputs)])


@pytest.mark.parametrize(
    ("system", "where"),
    [
        (FORCE_X, ""),
        (FORCE_X, "distance > 150, velocity_body_x > 0.1"),
        (FORCE_X, "distance + 400 velocity_body_x in [100, 110]"),
        (FORCE_Z, "eta_u >= 0, distance<=50"),
        (FORCE_Z, "velocity_body_z = 0.1"),
        (FORCE_Z, "distance = 500, eta_u - 10 velocity_body_z > 1"),
    ],
)
def test_questions_are_answered_as_a_fine_grid_tells(system, where):
    output = system.outputs[0].name
    highest, lowest = float(_on_grid(system, where).max()), float(_on_grid(system, where).min())
    margin = 0.01 * (system.outputs[0].maximum - system.outputs[0].minimum)
    for question in (f"{output} > {highest - margin}", f"{output} in [{lowest}, {lowest + margin}]"):
        answer = ask(system, question, where)
        assert answer.verdict == "yes", answer
        _check_example(system, question, where, answer.example or {})
    for question in (f"{output} >= {highest + margin}", f"-{output} > {margin - lowest}"):
        answer = ask(system, question, where)
        assert answer.verdict == "no", answer
        assert answer == ask(system, question, where)
    assert ask(system, f"{output} > {lowest}, {output} < {lowest - margin}", where).verdict == "no"


def _check_example(system: FuzzySystem, question: str, where: str, example: dict[str, float]) -> None:
    inputs = np.array([example[variable.name] for variable in system.inputs])
    output = system.outputs[0].name
    assert inference.infer(system, inputs).values[0] == pytest.approx(example[output], abs=1e-14)
    names = [variable.name for variable in system.inputs]
    conditions = [*read_conditions(question, [output]), *(read_conditions(where, names) if where else ())]
    for condition in conditions:
        value = sum(factor * example[name] for name, factor in condition.coefficients.items())
        assert condition.least <= value <= condition.greatest


def test_a_question_may_stay_open_and_says_where():
    highest = float(_on_grid(FORCE_X, "").max())
    answer = ask(FORCE_X, f"force_x > {highest + 1e-4}", max_boxes=20)
    assert answer.verdict == "undecided"
    assert 0.0 < answer.undecided_share < 1.0
    assert answer.undecided is not None
    assert set(answer.undecided) == {"distance", "velocity_body_x"}
    assert all(box.high > box.low for box in answer.undecided.values())
    assert "undecided after" in answer.sentence
    above_zero = ask(FORCE_X, f"force_x > {highest + 1e-4}", "velocity_body_x > 0", max_boxes=1)
    assert "velocity_body_x from 0 to 0.3" in above_zero.sentence
    assert " ".join(repr(answer).split()) == answer.sentence
    seen: list[int] = []
    answer = ask(FORCE_X, f"force_x > {highest + 1e-4}", progress=lambda boxes, _: seen.append(boxes))
    assert answer.verdict in {"no", "yes"}
    assert seen == sorted(seen)


@pytest.mark.parametrize(
    "where", ["", "distance > 120, velocity_body_x < 0", "distance - 300 velocity_body_x > 100"]
)
def test_a_range_is_proved_outside_and_attained_inside(where):
    (output_range,) = output_ranges(FORCE_X, where)
    outputs = _on_grid(FORCE_X, where)
    assert output_range.outer.low <= outputs.min() <= outputs.max() <= output_range.outer.high
    assert {type(end) for end in (output_range.outer.low, output_range.outer.high)} == {float}
    assert (
        output_range.outer.low <= output_range.inner.low <= output_range.inner.high <= output_range.outer.high
    )
    width = FORCE_X.outputs[0].maximum - FORCE_X.outputs[0].minimum
    assert (output_range.outer.high - output_range.outer.low) - (
        output_range.inner.high - output_range.inner.low
    ) <= 3e-4 * width
    for value, at in (
        (output_range.inner.low, output_range.least_at),
        (output_range.inner.high, output_range.greatest_at),
    ):
        inputs = np.array([at[variable.name] for variable in FORCE_X.inputs])
        assert inference.infer(FORCE_X, inputs).values[0] == pytest.approx(value, abs=1e-14)
    assert "is attained at distance = " in output_range.sentence


def test_a_range_beyond_a_universe_is_attained_where_it_was_asked_for():
    (output_range,) = output_ranges(FORCE_X, "distance > 300")
    assert min(output_range.least_at["distance"], output_range.greatest_at["distance"]) > 300.0
    at_end = output_ranges(FORCE_X, "distance = 200")[0]
    assert (output_range.inner, output_range.outer) == (at_end.inner, at_end.outer)
    beyond = "; distance beyond its range of 0 to 200 m counts as the end of it."
    assert output_range.sentence.endswith(beyond)
    assert ask(FORCE_X, "force_x > 1", "distance in [150, 300]").sentence.endswith(beyond)
    assert "beyond" not in at_end.sentence + ask(FORCE_X, "force_x > 1", "distance > 150").sentence


def test_an_example_is_written_with_the_digits_that_its_conditions_take():
    where = "distance < 50, velocity_body_x > 0"
    for sentence in (ask(FORCE_X, "force_x < 1", where).sentence, output_ranges(FORCE_X, where)[0].sentence):
        shown = re.findall(r"(?:distance|velocity_body_x) = ([^,;]+?)[,;.]* ", f"{sentence} ")
        assert all(float(value) > 0.0 for value in shown[1::2])
        assert all(float(value) < 50.0 for value in shown[::2])
        assert max(map(len, shown)) <= len(repr(np.nextafter(50.0, 0.0).item()))


def test_a_range_of_which_no_input_was_found_says_so():
    (output_range,) = output_ranges(FORCE_X, "distance - 100 velocity_body_x = 50.123456789", max_boxes=500)
    assert (output_range.least_at, output_range.greatest_at) == ({}, {})
    assert output_range.outer.high > output_range.outer.low
    assert output_range.inner.high < output_range.inner.low
    assert output_range.sentence.endswith("; no input that meets all conditions was found.")


@pytest.mark.parametrize("max_boxes", [1, 2, 3, 7])
def test_a_search_that_ends_early_still_bounds_all(max_boxes):
    for system in (FORCE_X, FORCE_Z):
        for output in output_ranges(system, max_boxes=max_boxes):
            values = _on_grid(system, "")
            assert output.outer.low <= values.min() <= values.max() <= output.outer.high
        # of one point, where boxes promise no more than was found
        point = ", ".join(
            f"{variable.name} = {0.5 * (variable.minimum + variable.maximum)!r}" for variable in system.inputs
        )
        (alone,) = output_ranges(system, point, max_boxes=max_boxes)
        assert alone.outer.low <= alone.inner.low <= alone.inner.high <= alone.outer.high


def test_a_search_that_is_stopped_says_what_is_left():
    (stopped,) = output_ranges(FORCE_X, max_seconds=0.0)
    assert stopped.num_boxes == 2
    assert "(stopped with 2 left, which might narrow it)" in stopped.sentence
    answer = ask(FORCE_X, "force_x > 0.001", max_seconds=0.0)
    assert answer.verdict in {"yes", "undecided"}
    (whole,) = output_ranges(FORCE_X)
    assert "stopped" not in whole.sentence


def test_conditions_on_several_inputs_keep_them_inside_their_universes():
    # at (600, 0.25) the condition holds too, with other outputs than where a distance of 200 meets it
    region = read_region(FORCE_X, "distance - 1000 velocity_body_x >= 350")
    assert (region.asked_low[0], region.asked_high[0]) == (0.0, 200.0)
    with pytest.raises(ValueError, match="'distance' is asked to lie beyond its range of 0 to 200"):
        read_region(FORCE_X, "distance > 300, distance - 1000 velocity_body_x <= 150")


def test_conditions_are_read_as_they_are_written():
    names = ["a", "a b", "c-d", "x1"]
    above, between, joint = read_conditions("a b > -1.5e1 and a in [-.5, 2], 2*a - x1 + c-d<=3", names)
    assert above.coefficients == {"a b": 1.0}
    assert (above.least, above.greatest) == (np.nextafter(-15.0, 0.0), np.inf)
    assert (between.least, between.greatest) == (-0.5, 2.0)
    assert joint.coefficients == {"a": 2.0, "x1": -1.0, "c-d": 1.0}
    assert (joint.least, joint.greatest) == (-np.inf, 3.0)
    texts = ["a b > -1.5e1", "a in [-.5, 2]", "2 * a - x1 + c-d <= 3"]
    assert [condition.text for condition in (above, between, joint)] == texts
    assert read_conditions("a<1", names)[0].greatest == np.nextafter(1.0, 0.0)
    assert read_conditions("a = 1", names)[0].least == 1.0


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (["--where", "distanse>150"], "did you mean 'distance'?"),
        (["--where", "distance"], "'the end' in 'distance' is not <"),
        (["--where", "distance > near"], "'near' in 'distance > near' stands where a number should"),
        (["--where", "0 < distance < 5"], "'<' in '0 < distance < 5' stands where a variable should"),
        (["--where", ","], "',' in ',' stands where a variable should"),
        (["--where", "distance > 1e999"], "stands where a number should"),
        (["--where", "distance in 3"], "the interval in 'distance in 3' cannot be read"),
        (["--where", "distance in [3, 2]"], "empty; give the lower end first"),
        (["--where", "distance in [3, 4"], "does not end in ]"),
        (["--where", "distance > 1 velocity_body_x > 2"], "a comma is missing"),
        (["--where", "distance > 100, distance < 50"], "no 'distance' meets all conditions"),
        (["--where", "distance + 1000 velocity_body_x > 999"], "no inputs of the universes meet"),
        (["--where", "__import__('os')"], "there is no variable"),
        (["--ask", "force_x - force_x >= 0"], "'force_x - force_x >= 0' has a sum of 0 whatever"),
        (["--ask", "force > 0"], "did you mean 'force_x'?"),
        (["--expect", "no"], "add --ask"),
        (["--boxes", "0"], "Give a whole number above 0"),
    ],
)
def test_a_mistake_ends_in_one_sentence(paper, refused, words, sentence):
    assert sentence in refused("bounds", paper, "--system", "force_x", *words)


def test_the_command_answers_and_checks(paper, run, refused):
    printed = run("bounds", paper).out
    assert [line.split()[0] for line in printed.splitlines()] == ["force_x", "force_z"]
    where = ("--system", "force_x", "--where", "distance < 20")
    question = ("bounds", paper, *where, "--ask", "force_x > 0.09")
    assert "no, proved with" in run(*question, "--expect", "no").out
    run(*question, "--expect", "yes", code=1)
    assert "add --system" in refused("bounds", paper, "--ask", "force_x > 0")
