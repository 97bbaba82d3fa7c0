"""The scikit-fuzzy form: what it is made of, and the traps it must not fall into."""

from dataclasses import replace

import numpy as np
import pytest
import skfuzzy
from skfuzzy import control

from fis_tools.engines.inference import infer
from fis_tools.model import Consequent, FuzzySystem, Is, Or, Rule, Term, Triangular, Variable
from tests.fis_tools.reference_engine import ReferenceEngine
from tests.fis_tools.sample_controllers import force_x_system


def _hand_built() -> control.ControlSystemSimulation:
    """The tipping problem of scikit-fuzzy's documentation, built by hand."""
    quality = control.Antecedent(np.arange(0, 11), "quality")
    service = control.Antecedent(np.arange(0, 11), "service")
    tip = control.Consequent(np.arange(0, 26), "tip")
    for variable in (quality, service):
        variable["poor"] = skfuzzy.trimf(variable.universe, [0, 0, 5])
        variable["average"] = skfuzzy.trimf(variable.universe, [0, 5, 10])
        variable["good"] = skfuzzy.trimf(variable.universe, [5, 10, 10])
    tip["low"] = skfuzzy.trimf(tip.universe, [0, 0, 13])
    tip["medium"] = skfuzzy.trimf(tip.universe, [0, 13, 25])
    tip["high"] = skfuzzy.trimf(tip.universe, [13, 25, 25])
    rules = [
        control.Rule(quality["poor"] | service["poor"], tip["low"]),
        control.Rule(service["average"], tip["medium"]),
        control.Rule(service["good"] | quality["good"], tip["high"]),
    ]
    return control.ControlSystemSimulation(control.ControlSystem(rules))


def _ours() -> FuzzySystem:
    terms = (
        Term("poor", Triangular(0, 0, 5)),
        Term("average", Triangular(0, 5, 10)),
        Term("good", Triangular(5, 10, 10)),
    )
    inputs = tuple(Variable(name, "", 0, 10, terms, 11) for name in ("quality", "service"))
    tip_terms = (
        Term("low", Triangular(0, 0, 13)),
        Term("medium", Triangular(0, 13, 25)),
        Term("high", Triangular(13, 25, 25)),
    )
    tip = Variable("tip", "%", 0, 25, tip_terms, 26, default=0.0)
    rules = (
        Rule(Or((Is("quality", "poor"), Is("service", "poor"))), (Consequent("tip", "low"),)),
        Rule(Is("service", "average"), (Consequent("tip", "medium"),)),
        Rule(Or((Is("service", "good"), Is("quality", "good"))), (Consequent("tip", "high"),)),
    )
    return FuzzySystem("tipping", inputs, (tip,), rules)


@pytest.mark.parametrize(
    ("quality", "service"), [(6.5, 9.8), (0.0, 0.0), (5.0, 5.0), (10.0, 2.5), (3.3, 7.7)]
)
def test_a_system_built_by_hand_gives_the_same(quality: float, service: float) -> None:
    by_hand = _hand_built()
    by_hand.input["quality"] = quality
    by_hand.input["service"] = service
    by_hand.compute()
    inputs = np.array([quality, service])
    assert ReferenceEngine(_ours()).compute(inputs)[0] == by_hand.output["tip"]
    assert infer(_ours(), inputs).values[0] == by_hand.output["tip"]


def test_the_tipping_problem_gives_the_documented_tip() -> None:
    """19.84 % for quality 6.5 and service 9.8, as scikit-fuzzy's documentation prints it."""
    assert ReferenceEngine(_ours()).compute(np.array([6.5, 9.8]))[0] == pytest.approx(19.84, abs=0.01)


def test_an_input_no_rule_mentions_is_left_alone_and_an_output_no_rule_concludes_is_its_default() -> None:
    system = force_x_system()
    unused_input = replace(system.inputs[0], name="unused")
    unused_output = replace(system.outputs[0], name="silent", default=0.75)
    system = replace(system, inputs=(unused_input, *system.inputs), outputs=(*system.outputs, unused_output))
    outputs = ReferenceEngine(system).compute(np.array([1.0, 20.0, 0.1]))
    assert outputs[1] == 0.75
    np.testing.assert_array_equal(
        outputs[:1], ReferenceEngine(force_x_system()).compute(np.array([20.0, 0.1]))
    )
    np.testing.assert_array_equal(infer(system, np.array([1.0, 20.0, 0.1])).values, outputs)


def test_weights_scale_the_cut() -> None:
    system = _ours()
    rule = Rule(Is("service", "good"), (Consequent("tip", "high", 0.25),))
    cuts = infer(replace(system, rules=(rule,)), np.array([0.0, 10.0])).outputs[0].cuts
    np.testing.assert_array_equal(cuts, [np.nan, np.nan, 0.25])


@pytest.mark.parametrize("inputs", [[1.0], [1.0, 2.0, 3.0], [np.nan, 1.0]])
def test_wrong_inputs_are_refused_by_both_engines(inputs: list[float]) -> None:
    with pytest.raises(ValueError, match=r"inputs have shape|NaN"):
        ReferenceEngine(_ours()).compute(np.array(inputs))
    with pytest.raises(ValueError, match=r"inputs have shape|NaN"):
        infer(_ours(), np.array(inputs))
