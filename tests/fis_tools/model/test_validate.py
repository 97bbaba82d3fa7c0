"""Every way in which a system can be wrong is told, and a right one passes."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from itertools import pairwise

import pytest

from fis_tools.formats.exchange import fis, fll
from fis_tools.formats.serialize import dump_json
from fis_tools.model import (
    And,
    Consequent,
    FuzzySystem,
    Hedged,
    Is,
    Not,
    Or,
    Rule,
    shape_problems,
    shapes,
    validate,
)
from fis_tools.model.expressions import Expression
from fis_tools.model.membership import SHAPES, MembershipFunction
from fis_tools.model.numbers import Linear
from fis_tools.model.shapes import Gaussian, Sampled, Triangular
from fis_tools.model.systems import FuzzyController
from fis_tools.model.validate import MAX_NESTING, InvalidSystem, controller_problems, problems
from fis_tools.model.variables import Term, Variable
from tests.fis_tools.sample_controllers import FORCE_X, GENERAL, PAPER_LIKE, force, with_input, with_output

NAN, INF = float("nan"), float("inf")


class _Narrow(Gaussian):
    """A shape made from one of ours."""


#: the force system with its distance, or its force, changed
_with_distance = partial(with_input, FORCE_X)
_with_output = partial(with_output, FORCE_X)


def _with_membership(membership: MembershipFunction) -> FuzzySystem:
    first, *others = FORCE_X.inputs[0].terms
    return _with_distance(terms=(replace(first, membership=membership), *others))


def _with_rule(antecedent: Expression, *consequents: Consequent) -> FuzzySystem:
    rule = Rule(antecedent, consequents or (Consequent("force_x", "ZE"),))
    return replace(FORCE_X, rules=(*FORCE_X.rules, rule))


def _with_own_operators(**changes: object) -> FuzzySystem:
    first, *rest = FORCE_X.rules
    return replace(FORCE_X, rules=(replace(first, **changes), *rest))  # type: ignore[arg-type]


def _nested(depth: int) -> Expression:
    expression: Expression = Is("distance", "near")
    for _ in range(depth):
        expression = Not(expression)
    return expression


@pytest.mark.parametrize("controller", [PAPER_LIKE, GENERAL])
def test_right_controllers_have_no_problems(controller: FuzzyController) -> None:
    assert controller_problems(controller) == []
    for system in controller.systems:
        validate.validate(system)


@pytest.mark.parametrize(
    ("system", "words"),
    [
        (_with_membership(Gaussian(NAN, 1.0)), ["'very near'", "finite"]),
        (_with_membership(Gaussian(0.0, 0.0)), ["standard deviation 0.0", "above 0"]),
        (_with_membership(Gaussian(0.0, 1e-170)), ["under- or overflows"]),
        (_with_membership(Triangular(0.0, 2.0, 1.0)), ["left, peak, right", "ascend"]),
        (_with_membership(shapes.TwoSidedGaussian(1.0, 1.0, 2.0, 0.0)), ["right standard deviation 0.0"]),
        (_with_membership(shapes.ZShape(2.0, 2.0)), ["top, foot", "no width", "trapezoidal"]),
        (_with_membership(Gaussian(0.0, None)), ["mean, standard_deviation", "finite numbers"]),  # type: ignore[arg-type]
        (_with_membership(Gaussian(0.0, True)), ["mean, standard_deviation", "finite numbers"]),
        (_with_membership(Triangular("a", 1.0, 2.0)), ["left, peak, right", "finite numbers"]),  # type: ignore[arg-type]
        (_with_membership(shapes.Sigmoid(1j, 1.0)), ["inflection, slope", "finite numbers"]),  # type: ignore[arg-type]
        (_with_membership(None), ["NoneType is not a known shape", "Gaussian, Triangular"]),  # type: ignore[arg-type]
        (_with_membership(_Narrow(0.0, 1.0)), ["_Narrow is not a known shape", "Gaussian, Triangular"]),
        (_with_membership(Sampled(("x",) * 101)), ["not a number"]),  # type: ignore[arg-type]
        (_with_membership(Sampled((0.0, 1.0))), ["2 membership values", "101 points"]),
        (_with_membership(Sampled((1.5,) * 101)), ["outside [0, 1]"]),
        (_with_membership(Sampled((-0.1,) * 101)), ["outside [0, 1]"]),
        (_with_membership(Sampled((NAN,) * 101)), ["not a number"]),
        (_with_distance(minimum=NAN), ["not finite"]),
        (_with_distance(maximum=INF), ["not finite"]),
        (_with_distance(minimum=200.0), ["range [200.0, 200.0]", "empty"]),
        (_with_distance(minimum=300.0), ["range [300.0, 200.0]", "swap"]),
        (_with_distance(minimum=-1.7e308, maximum=1.7e308), ["too wide"]),
        (_with_distance(minimum="0"), ["not finite"]),
        (_with_distance(num_points=21.5), ["21.5 points", "at least 2"]),
        (_with_distance(num_points=1), ["1 points", "at least 2"]),
        (_with_distance(points=(0.0, 100.0, 200.0)), ["3 points", "num_points is 101"]),
        (_with_distance(points=(0.0, 100.0, 100.0, 200.0), num_points=4), ["do not ascend"]),
        (_with_distance(points=(0.0, NAN, 200.0), num_points=3), ["not finite"]),
        (_with_distance(points=(0.0, 100.0, 190.0), num_points=3), ["0.0 to 190.0", "[0.0, 200.0]"]),
        (_with_distance(terms=()), ["no terms"]),
        (_with_distance(default=1.0), ["input 'distance' has a default"]),
        (_with_distance(name="force_x"), ["2 variables called 'force_x'"]),
        (_with_distance(name=""), ["called ''"]),
        (_with_distance(name="a\nb"), ["printable"]),
        (_with_output(default=None), ["declare default: the output when no rule fires"]),
        (_with_output(default=NAN), ["default nan"]),
        (_with_output(default="0"), ["default 0"]),
        (_with_output(terms=force().terms * 2), ["2 terms called 'NL'"]),
        (_with_output(terms=force().terms[:4]), ["rule 1:", "no term 'PL'", "one of NL, NS, ZE, PS"]),
        (replace(FORCE_X, rules=()), ["no rules"]),
        (replace(FORCE_X, inputs=()), ["no inputs"]),
        (replace(FORCE_X, outputs=()), ["no outputs"]),
        (replace(FORCE_X, and_operator="mean"), ["and_operator 'mean'", "min, product"]),
        (replace(FORCE_X, or_operator="sum"), ["or_operator 'sum'"]),
        (replace(FORCE_X, defuzzifier="middle"), ["defuzzifier 'middle'", "centroid"]),
        (replace(FORCE_X, defuzzifier=None), ["defuzzifier None"]),
        (_with_output(defuzzifier="middle"), ["output 'force_x': defuzzifier 'middle'"]),
        (_with_output(accumulation="mean"), ["output 'force_x': accumulation 'mean'", "probabilistic_sum"]),
        (_with_distance(defuzzifier="mom"), ["input 'distance' has a defuzzifier"]),
        (_with_distance(accumulation="bounded_sum"), ["input 'distance' has an accumulation"]),
        (_with_own_operators(and_operator="mean"), ["rule 1: and_operator 'mean'", "hamacher_product"]),
        (_with_own_operators(or_operator="xor"), ["rule 1: or_operator 'xor'", "max, probabilistic_sum"]),
        (_with_rule(Is("distanse", "near")), ["rule 26", "'distanse'", "did you mean 'distance'?"]),
        (_with_rule(Is("distance", "nearby")), ["rule 26", "no term 'nearby'", "did you mean 'near'?"]),
        (_with_rule(Is("force_x", "ZE")), ["input 'force_x' does not exist"]),
        (_with_rule(None), ["rule 26: None is not a statement", "Is, Not, Hedged, And or Or"]),  # type: ignore[arg-type]
        (_with_rule(Hedged("verry", _nested(1))), ["the hedge 'verry'", "did you mean 'very'?"]),  # type: ignore[arg-type]
        (_with_rule(_nested(1), Consequent("force_x", "ZE", "1")), ["weight 1"]),  # type: ignore[arg-type]
        (_with_rule(And(())), ["'and' joins no statements"]),
        (_with_rule(Not(Or(()))), ["'or' joins no statements"]),
        (_with_rule(_nested(MAX_NESTING + 1)), ["nested more than 20 deep"]),
        (_with_rule(_nested(1), Consequent("force_y", "ZE")), ["output 'force_y' does not exist"]),
        (_with_rule(_nested(1), Consequent("force_x", "ZE", 1.5)), ["weight 1.5", "outside [0, 1]"]),
        (_with_rule(_nested(1), Consequent("force_x", "ZE", NAN)), ["weight nan"]),
        (replace(FORCE_X, rules=(Rule(_nested(1), ()),)), ["concludes nothing"]),
        (replace(FORCE_X, rules=(replace(FORCE_X.rules[0], label="a"),) * 2), ["2 rules called 'a'"]),
    ],
)
def test_each_problem_is_told_in_one_sentence(system: FuzzySystem, words: list[str]) -> None:
    matching = [problem for problem in problems(system) if all(word in problem for word in words)]
    assert len(matching) == 1, problems(system)
    assert matching[0].startswith("system 'force_x'")
    with pytest.raises(InvalidSystem):
        validate.validate(system)


def test_nesting_up_to_the_limit_is_right() -> None:
    assert problems(_with_rule(_nested(MAX_NESTING))) == []


def test_all_problems_are_told_at_once() -> None:
    system = replace(_with_membership(Gaussian(0.0, 0.0)), rules=())
    assert len(problems(system)) == 2


@pytest.mark.parametrize(
    ("controller", "words"),
    [
        (replace(PAPER_LIKE, systems=()), "has no systems"),
        (replace(PAPER_LIKE, systems=(FORCE_X, FORCE_X)), "2 systems called"),
        (replace(PAPER_LIKE, name=" x"), "called ' x'"),
        (replace(PAPER_LIKE, attributes=(("a", "1"), ("a", "2"))), "2 attributes called 'a'"),
        (replace(PAPER_LIKE, systems=(_with_output(default=None),)), "declare default"),
    ],
)
def test_controllers_are_checked_too(controller: FuzzyController, words: str) -> None:
    assert [problem for problem in controller_problems(controller) if words in problem]


def test_a_variable_outside_any_range_is_no_reason_to_stop_looking() -> None:
    broken = Variable("x", "", NAN, NAN, (Term("t", Gaussian(NAN, NAN)),), num_points=0)
    system = FuzzySystem("s", (broken,), (), ())
    assert len(problems(system)) >= 4


NO_NUMBERS = {kind for kind in SHAPES.values() if not kind.entry.kinds} | {Linear}


@pytest.mark.parametrize("kind", [kind for kind in SHAPES.values() if kind not in NO_NUMBERS])
def test_every_parameter_of_every_shape_has_its_limits(kind: type[MembershipFunction]) -> None:
    """A width that is not positive, a location that is not a number: none passes, whichever shape has it."""
    wrong = {
        "location": (NAN, INF, None),
        "slope": (NAN, INF, None),
        "width": (-1.0, 0.0, NAN),
        "deviation": (-1.0, 0.0, NAN, 1e-170, 1e170),
        "exponent": (-1.0, 0.0, INF),
    }
    right = [1.0 + index for index in range(len(kind.entry.kinds))]
    assert not list(shape_problems.parameter_problems(kind(*right)))
    for position, what in enumerate(kind.entry.kinds.values()):
        for value in wrong[what]:
            numbers = [value if index == position else number for index, number in enumerate(right)]
            assert len(list(shape_problems.parameter_problems(kind(*numbers)))) == 1
    for left, following in pairwise(kind.entry.ascending):
        swapped = replace(kind(*right), **{left: 9.0, following: 0.5})
        assert any("do not ascend" in fault for fault in shape_problems.parameter_problems(swapped))
    for foot, top in kind.entry.flanks:
        assert list(shape_problems.parameter_problems(replace(kind(*right), **{foot: 1.5, top: 1.5})))


@pytest.mark.parametrize("write", [dump_json, fis.write, fll.write])
def test_writers_refuse_a_shape_that_they_do_not_know(write: Callable[[FuzzyController], object]) -> None:
    controller = FuzzyController("c", (_with_membership(_Narrow(0.0, 1.0)),))
    with pytest.raises(InvalidSystem, match="_Narrow is not a known shape"):
        write(controller)
