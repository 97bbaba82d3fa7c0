"""The foreign systems of the examples are read, evaluated and drawn like any other."""

import importlib.util
import warnings
from types import ModuleType

import numpy as np
import pytest
from skfuzzy import control

from fis_tools.analysis.arrays import spread_inputs
from fis_tools.engines.compiler import compile
from fis_tools.formats import serialize
from tests.places import PROJECT

EXAMPLES = PROJECT / "docs" / "examples"


@pytest.mark.parametrize(
    ("name", "num_rules", "inputs", "low", "high"),
    [
        ("tipper.fis", 3, {"service": 1.0, "food": 2.0}, 4.0, 7.0),
        ("tipper.fis", 3, {"service": 9.0, "food": 8.0}, 23.0, 26.0),
        ("dimmer.fll", 4, {"daylight": 0.05, "presence": 1.0}, 0.75, 0.9),
        ("dimmer.fll", 4, {"daylight": 0.95, "presence": 0.9}, 0.0, 0.15),
        ("dimmer.fll", 4, {"daylight": 0.5, "presence": 1.0}, 0.4, 0.6),
        ("pendulum.fml", 25, {"angle": 0.0, "angular_velocity": 0.0}, -1e-9, 1e-9),
        ("pendulum.fml", 25, {"angle": 0.5, "angular_velocity": 1.5}, 13.0, 18.0),
        ("pendulum.fml", 25, {"angle": -0.2, "angular_velocity": 0.7}, -1.0, 1.0),
    ],
)
def test_files_of_other_programs_say_what_they_are_meant_to(
    name: str, num_rules: int, inputs: dict[str, float], low: float, high: float
) -> None:
    controller = serialize.load(EXAMPLES / name)
    (system,) = controller.systems
    assert len(system.rules) == num_rules
    (value,) = compile(system)(np.array([[inputs[variable.name] for variable in system.inputs]]))[0]
    assert low <= value <= high


def tipping() -> ModuleType:
    spec = importlib.util.spec_from_file_location("tipping", EXAMPLES / "tipping.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_the_tipping_system_of_scikit_fuzzy_is_compiled() -> None:
    compiled = compile(tipping().build_tipping())
    samples = spread_inputs(compiled.system, 60)
    ours = compiled(samples)
    simulation = control.ControlSystemSimulation(tipping().build_tipping())
    theirs = []
    for sample in samples:
        for variable, value in zip(compiled.system.inputs, sample, strict=True):
            simulation.input[variable.name] = value
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", DeprecationWarning)
            simulation.compute()
        theirs.append(simulation.output["tip"])
    np.testing.assert_allclose(ours[:, 0], theirs, rtol=0, atol=25e-12)
    assert np.ptp(theirs) > 5.0
