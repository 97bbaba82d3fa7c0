"""Compiled systems against scikit-fuzzy's own ``compute()``, and what they accept and refuse."""

import numpy as np
import pytest
import skfuzzy
from skfuzzy import control

from fis_tools.engines import compiler, interpreter
from fis_tools.engines.compiler import CompiledSystem, compile
from fis_tools.model import FuzzySystem
from fis_tools.model.validate import InvalidSystem
from fis_tools.scikit_fuzzy.read import UnreadableControlSystem
from tests.fis_tools.sample_controllers import FORCE_X, ROOM
from tests.fis_tools.step_by_step import ends


def test_control_systems_take_a_default_for_when_no_rule_fires():
    x, y = control.Antecedent(np.linspace(0, 1, 11), "x"), control.Consequent(np.linspace(2, 3, 11), "y")
    x["high"], y["high"] = skfuzzy.trimf(x.universe, [0.5, 1, 1]), skfuzzy.trimf(y.universe, [2, 3, 3])
    system = control.ControlSystem([control.Rule(x["high"], y["high"])])
    inputs = np.array([[0.2], [1.0]])
    assert compile(system)(inputs)[0, 0] == 2.0  # the end of the universe that is nearest to zero
    outputs = compile(system, defaults={"y": 2.25})(inputs)
    assert outputs[0, 0] == 2.25
    assert outputs[1, 0] == pytest.approx(2.0 + 2.0 / 3.0, abs=1e-15)


def test_a_chain_of_rules_is_computed_as_scikit_fuzzy_does():
    """Two rules raise a term that a third asks for, and one raises a term after it was asked for."""
    universe = np.linspace(0, 1, 11)
    x, w = control.Antecedent(universe, "x"), control.Antecedent(universe, "w")
    y, z = control.Consequent(universe, "y"), control.Consequent(universe, "z")
    for variable in (x, w, y, z):
        variable["off"], variable["on"] = (skfuzzy.trimf(universe, p) for p in ([0, 0, 0.8], [0.2, 1, 1]))
    rules = [
        control.Rule(x["on"] & w["on"], y["on"]),
        control.Rule(y["on"] & ~w["off"], z["on"]),
        control.Rule(w["on"], y["on"]),
        control.Rule(x["off"], y["off"]),
        control.Rule(w["off"], y["off"]),
        control.Rule(y["off"], z["off"]),
    ]
    source = control.ControlSystem(rules)
    inputs = np.random.default_rng(3).uniform(0, 1, (20, 2))
    answers = compile(source)({"x": inputs[:, 0], "w": inputs[:, 1]})
    for index, (first, second) in enumerate(inputs):
        simulation = control.ControlSystemSimulation(source)
        simulation.input["x"], simulation.input["w"] = first, second
        simulation.compute()
        for name in ("y", "z"):
            assert answers[name][index] == simulation.output[name]
    assert np.ptp(answers["z"]) > 0.2


def test_anything_else_is_refused():
    with pytest.raises(UnreadableControlSystem, match="pass a scikit-fuzzy ControlSystem"):
        compile("controller.yaml")
    with pytest.raises(ValueError, match="declare them in the outputs"):
        compile(FORCE_X, defaults={"force_x": 1.0})
    with pytest.raises(InvalidSystem, match="has no inputs"):
        compile(FuzzySystem("broken", (), (), ()))


def compiled_room() -> CompiledSystem:
    return compile(ROOM)


def test_mappings_come_back_as_mappings_of_the_same_shape():
    room = compiled_room()
    temperatures = np.linspace(-5.0, 45.0, 6).reshape(2, 3)
    outputs = room({"wind": 3.0, "temperature": temperatures})
    rows = np.stack([temperatures.ravel(), np.full(6, 3.0)], axis=1)
    assert list(outputs) == ["heat", "vent"]
    np.testing.assert_array_equal(outputs["vent"], room(rows)[:, 1].reshape(2, 3))
    assert room({"wind": 3.0, "temperature": 20})["heat"].shape == ()


def test_values_out_of_range_and_infinite_ones_are_clipped():
    for compiled in (compiled_room(), compile(FORCE_X)):
        (a, c), (b, d) = ends(compiled.system)
        beyond = compiled(np.array([[-np.inf, np.inf], [b + 7.0, c - 7.0]]))
        np.testing.assert_array_equal(beyond, compiled(np.array([[a, d], [b, c]])))


@pytest.mark.parametrize("system", [FORCE_X, ROOM])
def test_nan_and_wrong_shapes_are_refused(system):
    compiled = compile(system)
    with pytest.raises(ValueError, match="an input is NaN"):
        compiled(np.array([[1.0, np.nan]]))
    for wrong in (np.zeros(2), np.zeros((3, 1)), np.zeros((1, 2, 2))):
        with pytest.raises(ValueError, match="a row a sample"):
            compiled(wrong)
        with pytest.raises(ValueError, match="a row a sample"):
            compiled.firing_strengths(wrong)
    with pytest.raises(ValueError, match="one for each rule"):
        compiled.conclude(np.zeros((1, 99)))
    with pytest.raises(ValueError, match="a firing strength is NaN"):
        compiled.conclude(np.full((1, len(compiled.system.rules)), np.nan))


def test_names_that_are_missing_or_unknown_are_told():
    with pytest.raises(ValueError, match="no input 'temprature'; did you mean 'temperature'"):
        compiled_room()({"temprature": 3.0, "wind": 1.0})
    with pytest.raises(ValueError, match="input 'wind' is missing; pass temperature, wind"):
        compiled_room()({"temperature": 3.0})


def test_no_samples_are_no_mistake():
    for compiled in (compiled_room(), compile(FORCE_X)):
        assert compiled(np.empty((0, 2))).shape == (0, len(compiled.system.outputs))
        assert compiled.firing_strengths(np.empty((0, 2))).shape == (0, len(compiled.system.rules))


@pytest.mark.parametrize("system", [FORCE_X, ROOM])
def test_threads_change_nothing(system, monkeypatch):
    monkeypatch.setattr(compiler, "SAMPLES_A_THREAD", 100)
    rows = np.random.default_rng(2).uniform(*ends(system), (1003, len(system.inputs)))
    alone, together = compile(system, threads=1), compile(system, threads=3)
    np.testing.assert_array_equal(alone(rows), together(rows))
    firing = alone.firing_strengths(rows)
    np.testing.assert_array_equal(alone.conclude(firing), together.conclude(firing))
    np.testing.assert_array_equal(alone.conclude(firing), interpreter.evaluate(alone.program, rows))
