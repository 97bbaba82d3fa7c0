"""The page infers as Python does."""

from dataclasses import replace

import numpy as np
import pytest

from fis_tools import inference, serialize
from fis_tools.model import FuzzyController, FuzzySystem, Variable, table_rules
from fis_tools.review import page
from tests.fis_tools.sample_controllers import FORCE_TERMS, force, gaussian_terms, general_controller
from tests.parity.random_systems import full_table_system, inputs_for, random_general_system

NUM_SAMPLES = 200
INFER = """([place, rows]) => rows.map((row) => {
  const told = review.infer(review.systems[place], row);
  return { values: told.outputs.map(({ value }) => String(value)), firing: [...told.firing] };
})"""


def system_of_125_rules() -> FuzzySystem:
    inputs = tuple(
        Variable(name, "m", -1.0, 1.0, gaussian_terms(FORCE_TERMS, -1.0, 1.0)) for name in ("x", "y", "z")
    )
    words = [FORCE_TERMS[(i // 25 + i // 5 + 2 * i) % 5] for i in range(125)]
    return FuzzySystem("many", inputs, (force(),), table_rules(inputs, force(), words))


def random_systems(seed: int, count: int) -> tuple[FuzzySystem, ...]:
    generator = np.random.default_rng(seed)
    makers = (random_general_system, random_general_system, full_table_system)
    return tuple(
        replace(makers[place % len(makers)](generator), name=f"random {place}") for place in range(count)
    )


CONTROLLERS = {
    "champion": lambda: serialize.load("conf/controller/paper_champion.yaml"),
    "octants": lambda: serialize.load("conf/controller/paper_octants.yaml"),
    "everything": general_controller,
    "125 rules": lambda: FuzzyController("many", (system_of_125_rules(),)),
    "random": lambda: FuzzyController("random", random_systems(seed=8, count=24)),
}


@pytest.mark.parametrize("name", CONTROLLERS)
def test_outputs_and_firing_are_those_of_python(opened, name):
    controller = CONTROLLERS[name]()
    browser_page = opened(page.write(controller))
    generator = np.random.default_rng(25)
    num_values = []
    for place, system in enumerate(controller.systems):
        rows = inputs_for(system, generator, NUM_SAMPLES)
        told = browser_page.evaluate(INFER, [place, rows.tolist()])
        values = np.array([[float(value) for value in sample["values"]] for sample in told])
        ranges = np.array([variable.maximum - variable.minimum for variable in system.outputs])
        expected = inference.evaluate(system, rows)
        np.testing.assert_allclose(values / ranges, expected / ranges, rtol=0, atol=1e-9)
        firing = np.array([sample["firing"] for sample in told])
        np.testing.assert_allclose(firing, inference.firing_strengths(system, rows), rtol=0, atol=1e-12)
        num_values.append(np.unique(expected[~np.isnan(expected)]).size)
    assert np.median(num_values) > NUM_SAMPLES / 4
