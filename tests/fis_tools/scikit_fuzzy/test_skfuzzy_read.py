"""Reading scikit-fuzzy's control systems: what is recognised, what is kept, and what is refused."""

import operator
from dataclasses import replace
from functools import partial, reduce
from typing import Any

import networkx as nx
import numpy as np
import pytest
import skfuzzy
from hypothesis import given, settings
from hypothesis import strategies as st
from skfuzzy import control

from fis_tools.engines.inference import infer
from fis_tools.model import And, Consequent, FuzzySystem, Is, Not, Or, Rule, Term, Variable, operators, shapes
from fis_tools.model.systems import with_variables
from fis_tools.model.variables import sample
from fis_tools.scikit_fuzzy.read import UnreadableControlSystem, read_control_system
from fis_tools.scikit_fuzzy.recognition import recognise
from tests.fis_tools import step_by_step
from tests.fis_tools.control_systems import build_control_system, build_simulation
from tests.fis_tools.engines.random_systems import any_shape, inputs_for, random_general_system
from tests.fis_tools.sample_controllers import FORCE_X, FORCE_Z, GENERAL
from tests.seeds import seeds


def _graded(variable: Any) -> Any:
    variable.automf(3)
    return variable


def _variables() -> tuple[Any, Any, Any]:
    a, b = (_graded(control.Antecedent(np.arange(0, 11), name)) for name in "ab")
    return a, b, _graded(control.Consequent(np.linspace(0, 1, 21), "y"))


def _read(*rules: control.Rule, **options: Any) -> FuzzySystem:
    return read_control_system(control.ControlSystem(rules), **options)


def test_the_tipping_problem_is_read_as_it_was_written():
    """The example of scikit-fuzzy's documentation, with `automf` for the inputs."""
    names = ("quality", "service")
    quality, service = (_graded(control.Antecedent(np.arange(0, 11, 1), name)) for name in names)
    tip = control.Consequent(np.arange(0, 26, 1), "tip")
    for name, corners in (("low", [0, 0, 13]), ("medium", [0, 13, 25]), ("high", [13, 25, 25])):
        tip[name] = skfuzzy.trimf(tip.universe, corners)
    rules = [
        control.Rule(quality["poor"] | service["poor"], tip["low"]),
        control.Rule(service["average"], tip["medium"]),
        control.Rule(service["good"] | quality["good"], tip["high"]),
    ]
    source = control.ControlSystem(rules)

    def triangles(**corners):
        return tuple(Term(name, shapes.Triangular(*corners_of)) for name, corners_of in corners.items())

    degrees = triangles(poor=(0.0, 0.0, 5.0), average=(0.0, 5.0, 10.0), good=(5.0, 10.0, 10.0))
    tips = triangles(low=(0.0, 0.0, 13.0), medium=(0.0, 13.0, 25.0), high=(13.0, 25.0, 25.0))
    system = read_control_system(source, "tipping")
    assert system.inputs == tuple(Variable(n, "", 0.0, 10.0, degrees, 11) for n in names)
    assert system.outputs == (Variable("tip", "", 0.0, 25.0, tips, 26, default=0.0),)
    assert system.rules == (
        Rule(Or((Is("quality", "poor"), Is("service", "poor"))), (Consequent("tip", "low"),)),
        Rule(Is("service", "average"), (Consequent("tip", "medium"),)),
        Rule(Or((Is("service", "good"), Is("quality", "good"))), (Consequent("tip", "high"),)),
    )
    assert system == FuzzySystem("tipping", system.inputs, system.outputs, system.rules)
    # 19.84 % for quality 6.5 and service 9.8, as the documentation prints it
    assert infer(system, np.array([6.5, 9.8])).values[0] == pytest.approx(19.84, abs=0.01)


def with_an_unused_input() -> FuzzySystem:
    """The force system, its inputs the other way round, and one that no rule mentions before them."""
    unused = replace(FORCE_X.inputs[0], name="unused")
    return replace(FORCE_X, inputs=(unused, *FORCE_X.inputs[::-1]), rules=FORCE_X.rules[:3])


@pytest.mark.parametrize("system", [FORCE_X, FORCE_Z, *GENERAL.systems, with_an_unused_input()])
def test_a_system_survives_being_built_and_read(system):
    defaults = {output.name: output.default for output in system.outputs if output.default is not None}
    read = read_control_system(build_control_system(system), system.name, defaults=defaults)
    # a ControlSystem has no place for the rest
    assert read == with_variables(system, lambda variable: replace(variable, unit="", description=""))


def test_a_simulation_is_read_like_its_system():
    built = build_control_system(FORCE_X)
    assert read_control_system(build_simulation(FORCE_X), "s") == read_control_system(built, "s")


def test_chains_to_the_left_are_flat_and_others_are_nested():
    a, b, y = _variables()
    poor, good, average = a["poor"], b["good"], a["average"]
    is_poor, is_good, is_average = Is("a", "poor"), Is("b", "good"), Is("a", "average")
    for tree, expected in (
        (poor & good & average, And((is_poor, is_good, is_average))),
        (poor & (good & average), And((is_poor, And((is_good, is_average))))),
        ((poor | good) & average, And((Or((is_poor, is_good)), is_average))),
        (~(poor | ~good), Not(Or((is_poor, Not(is_good))))),
    ):
        assert _read(control.Rule(tree, y["good"])).rules[0].antecedent == expected


def test_weights_and_several_consequents_are_read():
    a, _, y = _variables()
    rule = control.Rule(a["poor"], (y["good"] % 0.25, y["poor"]))
    assert _read(rule).rules[0].consequents == (Consequent("y", "good", 0.25), Consequent("y", "poor"))


@pytest.mark.parametrize(
    ("labels", "read"),
    [(("first", None, "3", "2"), ["first", "", "", "2"]), (("same", "same"), ["same", "same #2"])],
)
def test_labels_of_persons_are_kept_and_told_apart_and_scikit_fuzzys_are_not(labels, read):
    a, _, y = _variables()
    rules = [control.Rule(a["poor"], y["good"], label) for label in labels]
    assert [rule.label for rule in _read(*rules).rules] == read


def test_methods_are_those_of_most_and_the_rest_says_so():
    a, b, y = _variables()
    z = _graded(control.Consequent(np.linspace(0, 1, 5), "z", "SOM"))
    z.accumulation_method = operators.bounded_sum
    rules = [
        control.Rule(a["poor"] & b["poor"], y["good"], and_func=np.multiply),
        control.Rule(a["good"] & b["good"], y["poor"], and_func=operator.mul),
        control.Rule(a["good"] & b["poor"], z["poor"]),
        control.Rule(a["good"], z["good"], and_func=operators.hamacher_product),
    ]
    system = _read(*rules)
    assert system.and_operator == "product"
    assert [rule.and_operator for rule in system.rules] == [None, None, "min", None]
    assert [rule.or_operator for rule in system.rules] == [None] * 4
    assert system.defuzzifier == "centroid"
    assert [output.defuzzifier for output in system.outputs] == [None, "som"]
    assert [output.accumulation for output in system.outputs] == ["max", "bounded_sum"]


def test_defaults_are_zero_or_nearest_to_it_unless_given():
    a, _, y = _variables()
    heat = _graded(control.Consequent(np.linspace(15, 30, 11), "heat"))
    rule = control.Rule(a["poor"], (y["good"], heat["good"]))
    assert [output.default for output in _read(rule).outputs] == [0.0, 15.0]
    given = _read(rule, defaults={"heat": 20.0})
    assert [output.default for output in given.outputs] == [0.0, 20.0]
    assert infer(given, np.array([10.0])).values.tolist() == [0.0, 20.0]
    with pytest.raises(
        UnreadableControlSystem, match="defaults name an unknown output 'heet'; did you mean 'heat'"
    ):
        _read(rule, defaults={"heet": 20.0})


def test_a_universe_is_even_only_to_the_last_bit():
    a, b, y = _variables()
    universe = np.linspace(-1.0, 1.0, 21)
    universe[3] = np.nextafter(universe[3], 1.0)
    uneven = control.Antecedent(universe, "c")
    uneven["low"] = skfuzzy.trapmf(uneven.universe, [-1, -1, 0.25, 0.75])
    system = _read(control.Rule(a["poor"] & b["poor"] & uneven["low"], y["good"]))
    assert [variable.points is None for variable in system.inputs] == [True, True, False]
    np.testing.assert_array_equal(system.inputs[2].universe, uneven.universe)
    assert system.inputs[2].terms[0].membership == shapes.Trapezoidal(-1.0, -1.0, 0.25, 0.75)


def _rule_with(**changes: Any) -> None:
    a, b, y = _variables()
    _read(control.Rule((a["poor"] & b["poor"]) | b["good"], y["good"], "odd", **changes))


def _input_with(universe: Any, membership: Any) -> None:
    _, _, y = _variables()
    c = control.Antecedent(universe, "c")
    c["odd"] = membership
    _read(control.Rule(c["odd"], y["good"]))


def _chained(weight: float = 1.0, and_func: Any = np.fmin) -> None:
    """A chain of two rules."""
    a, b, y = _variables()
    z = _graded(control.Consequent(np.arange(5), "z"))
    before = control.Rule(a["poor"] & b["poor"], y["good"] % weight, and_func=and_func)
    _read(before, control.Rule(y["good"] & b["poor"], z["good"], "last"))


def _without_its_source() -> None:
    a, _, y = _variables()
    z = _graded(control.Consequent(np.arange(5), "z"))
    source = control.ControlSystem([control.Rule(a["poor"], y["poor"])])
    source.graph = nx.compose(source.graph, control.Rule(y["good"], z["good"]).graph)
    read_control_system(source)


def _concluding_an_input() -> None:
    a, b, _ = _variables()
    _read(control.Rule(a["poor"], b["good"], "odd"))


def _with_terms_made_again() -> None:
    a, _, y = _variables()
    rule = control.Rule(a["poor"], y["good"], "old")
    a.automf(3)
    _read(rule)


def _concluding(method: str = "centroid", weight: float = 1.0) -> None:
    a, _, y = _variables()
    y.defuzzify_method = method
    _read(control.Rule(a["poor"], y["good"] % weight))


def _nested() -> None:
    a, _, y = _variables()
    _read(control.Rule(reduce(lambda tree, _: ~tree, range(30), a["poor"]), y["good"], "deep"))


AND_CURE = "pass a function of fis_tools.model.operators: min, product"
OR_CURE = "pass a function of fis_tools.model.operators: max, probabilistic_sum"
FIVE = np.arange(5.0)
SINGLE = FIVE.astype(np.float32)
ABOVE_ONE = np.array([0.0, 1.0 + 5e-7, 0.0])


def _product(p: float, q: float) -> float:
    return p * q


class _Unhashable:
    __hash__ = None  # type: ignore[assignment]

    def __call__(self, a: float, b: float) -> float:
        return (a + b) / 2.0


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: read_control_system({}), ["this is a dict", "pass a scikit-fuzzy ControlSystem"]),
        (_read, ["no inputs", "no outputs", "no rules"]),
        (partial(_rule_with, and_func=_product), ["and_func of rule 'odd'", "_product", AND_CURE]),
        (partial(_rule_with, or_func=_product), ["or_func of rule 'odd'", "_product", OR_CURE]),
        (partial(_rule_with, and_func=_Unhashable()), ["_Unhashable", "not known", AND_CURE]),
        (partial(_concluding, method="middle"), ["defuzzify_method of 'y' is 'middle'", "centroid"]),
        (partial(_concluding, weight=1.5), ["weight 1.5", "outside [0, 1]"]),
        (partial(_concluding, weight=-0.5), ["weight -0.5"]),
        (partial(_chained, weight=0.5), ["rule 'last' asks for 'y' 'good'", "with weight 0.5, and no antec"]),
        (partial(_chained, and_func=np.multiply), ["combine by min and product", "give them the same"]),
        (_without_its_source, ["'if y[good] then z[good]' asks for 'y'", "no rule before it concludes"]),
        (_concluding_an_input, ["rule 'odd' concludes 'b'", "make it a Consequent"]),
        (_with_terms_made_again, ["rule 'old' mentions a term 'poor' that 'a' no longer has"]),
        (_nested, ["rule 'deep' nests", "more than 20 deep", "split the rule"]),
        (partial(_input_with, SINGLE, np.zeros(5)), ["'c' is stored as float32", "as float64"]),
        (partial(_input_with, FIVE, np.eye(5, dtype=np.uint8)[0]), ["term 'odd' is stored as uint8"]),
        (partial(_input_with, FIVE, np.eye(5, dtype=bool)[0]), ["as bool, with which", "rounds or fails"]),
        (partial(_input_with, FIVE[::-1], np.zeros(5)), ["universe of 'c'", "ascending", "sort it"]),
        (partial(_input_with, np.array([1.0]), np.zeros(1)), ["two or more ascending numbers"]),
        (partial(_input_with, FIVE[:3], ABOVE_ONE), ["'odd' runs from 0 to 1", "in [0, 1]"]),
        (partial(_input_with, FIVE[:3], np.array([0.0, np.nan, 0.0])), ["term 'odd' runs from nan"]),
        (partial(_input_with, np.arange(4.0), np.zeros((2, 2))), ["has shape (2, 2), the universe (4,)"]),
    ],
)
def test_what_a_fuzzy_system_cannot_say_is_refused(make, words):
    with pytest.raises(UnreadableControlSystem) as refusal:
        make()
    for word in words:
        assert word in str(refusal.value)


def test_variables_of_one_name_are_refused():
    a, _, y = _variables()
    twin = _graded(control.Antecedent(np.arange(0, 11), "a"))
    with pytest.raises(UnreadableControlSystem, match="2 variables called 'a'"):
        _read(control.Rule(a["poor"] & twin["good"], y["good"]))


def test_a_sum_without_a_bound_cuts_as_the_bounded_one_does():
    a, b, y = _variables()
    y.accumulation_method = np.add
    source = control.ControlSystem([control.Rule(v[term], y["good"]) for v in (a, b) for term in v.terms])
    system = read_control_system(source)
    assert system.outputs[0].accumulation == "bounded_sum"
    for inputs in ([1.0, 2.0], [7.5, 0.5], [2.5, 10.0]):
        simulation = control.ControlSystemSimulation(source)
        simulation.input["a"], simulation.input["b"] = inputs
        simulation.compute()
        assert infer(system, inputs).values[0] == pytest.approx(simulation.output["y"], abs=1e-14)


GRID = np.linspace(0.0, 10.0, 101)


@pytest.mark.parametrize(
    ("values", "expected"),
    [
        (skfuzzy.gaussmf(GRID, 3.7, 1.25), shapes.Gaussian(3.7, 1.25)),
        (skfuzzy.gaussmf(GRID, -1.0, 2.0), shapes.Gaussian(-1.0, 2.0)),
        (skfuzzy.gaussmf(GRID, 10 / 3, 1 / 7), shapes.Gaussian(10 / 3, 1 / 7)),
        (skfuzzy.trimf(GRID, [1, 4.5, 9.05]), shapes.Triangular(1.0, 4.5, 9.05)),
        (skfuzzy.trimf(GRID, [1, 4.555, 9.05]), shapes.Triangular(1.0, 4.555, 9.05)),
        (skfuzzy.trimf(GRID, [0, 0, 5]), shapes.Triangular(0.0, 0.0, 5.0)),
        (skfuzzy.trimf(GRID, [5, 10, 10]), shapes.Triangular(5.0, 10.0, 10.0)),
        (skfuzzy.trimf(GRID, [3, 3, 3]), shapes.Triangular(3.0, 3.0, 3.0)),
        (skfuzzy.trapmf(GRID, [1, 2.25, 6.5, 9]), shapes.Trapezoidal(1.0, 2.25, 6.5, 9.0)),
        (skfuzzy.trapmf(GRID, [0, 0, 2, 7.7]), shapes.Trapezoidal(0.0, 0.0, 2.0, 7.7)),
        (skfuzzy.trapmf(GRID, [2, 2, 5, 5]), shapes.Trapezoidal(2.0, 2.0, 5.0, 5.0)),
        (skfuzzy.gauss2mf(GRID, 3, 0.8, 5.5, 1.5), shapes.TwoSidedGaussian(3.0, 0.8, 5.5, 1.5)),
        (skfuzzy.gbellmf(GRID, 2.1, 3.5, 4.4), shapes.GeneralizedBell(2.1, 3.5, 4.4)),
        (skfuzzy.gbellmf(GRID, 2.1, 2.0, -1.5), shapes.GeneralizedBell(2.1, 2.0, -1.5)),
        (skfuzzy.sigmf(GRID, 4.2, 1.7), shapes.Sigmoid(4.2, 1.7)),
        (skfuzzy.sigmf(GRID, 4.2, -0.3), shapes.Sigmoid(4.2, -0.3)),
        (skfuzzy.dsigmf(GRID, 2, 5, 7, 6), shapes.SigmoidDifference(2.0, 5.0, 7.0, 6.0)),
        (skfuzzy.psigmf(GRID, 3, 2.5, 6, -4), shapes.SigmoidProduct(3.0, 2.5, 6.0, -4.0)),
        (skfuzzy.smf(GRID, 1.1, 8.3), shapes.SShape(1.1, 8.3)),
        (skfuzzy.zmf(GRID, 2, 7), shapes.ZShape(2.0, 7.0)),
        (skfuzzy.pimf(GRID, 1, 3.3, 5, 9.9), shapes.PiShape(1.0, 3.3, 5.0, 9.9)),
        (skfuzzy.piecemf(GRID, [2.0, 4.0, 8.0]), None),
        (np.where(GRID < 5, 0.25, 0.5), None),
        (np.abs(GRID - 5.0) / 5.0, None),
        (skfuzzy.gaussmf(GRID, 3.7, 1.25) + 1e-9 * np.eye(101)[40], None),
        (np.zeros(101), None),
    ],
)
def test_what_scikit_fuzzy_samples_is_found_again(values, expected):
    assert recognise(GRID, values) == (expected or shapes.Sampled(tuple(values.tolist())))


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(2, 60), st.floats(-10, 10), st.floats(0.1, 100))
def test_whatever_is_found_gives_the_samples_to_the_last_bit(seed, num_points, low, width):
    variable = Variable("x", "", low, low + width, (), num_points)
    values = sample(variable, Term("t", any_shape(np.random.default_rng(seed), variable)))
    shape = recognise(variable.universe, values)
    np.testing.assert_array_equal(sample(variable, Term("t", shape)), values)


def test_uneven_universes_are_no_hindrance():
    universe = np.array([0.0, 0.5, 0.75, 2.0, 3.5, 4.0, 7.0, 10.0])
    assert recognise(universe, skfuzzy.trimf(universe, [0.5, 3.5, 10])) == shapes.Triangular(0.5, 3.5, 10.0)
    assert recognise(universe, skfuzzy.gaussmf(universe, 2.5, 1.5)) == shapes.Gaussian(2.5, 1.5)


@pytest.mark.parametrize(
    ("and_func", "or_func", "read"),
    [
        (min, max, ("min", "max")),
        (np.minimum, np.maximum, ("min", "max")),
        (operator.mul, control.accumulation_max, ("product", "max")),
        (control.accumulation_mult, np.fmax, ("product", "max")),
    ],
)
def test_functions_that_give_the_same_numbers_are_of_one_name(and_func, or_func, read):
    a, b, y = _variables()
    tree = (a["poor"] & b["poor"]) | b["good"]
    system = _read(control.Rule(tree, y["good"], and_func=and_func, or_func=or_func))
    assert (system.and_operator, system.or_operator) == read


@pytest.mark.parametrize("seed", seeds(14, 5))
def test_what_is_built_is_read_again(seed):
    generator = np.random.default_rng([32, seed])
    system = random_general_system(generator)
    defaults = {output.name: output.default for output in system.outputs if output.default is not None}
    read = read_control_system(build_control_system(system), system.name, defaults=defaults)
    rows = inputs_for(system, generator, 8)
    np.testing.assert_array_equal(step_by_step.evaluate(read, rows), step_by_step.evaluate(system, rows))
    again = read_control_system(build_control_system(read), system.name, defaults=defaults)
    assert again == read


@pytest.mark.parametrize("inputs", [[1.0], [1.0, 2.0, 3.0], [np.nan, 1.0]])
def test_wrong_inputs_are_refused(inputs: list[float]) -> None:
    with pytest.raises(ValueError, match=r"inputs have shape|NaN"):
        infer(FORCE_X, np.array(inputs))
