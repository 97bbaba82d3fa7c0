"""Hedges: what they make of a degree, alike in all engines."""

import numpy as np
import pytest

from fis_tools.engines import inference, interpreter
from fis_tools.engines.program import assemble
from fis_tools.model.operators import HEDGES
from fis_tools.model.validate import problems
from tests.fis_tools.engines.random_systems import hedged, inputs_for, random_general_system


@pytest.mark.parametrize(
    ("hedge", "quarter", "most"),
    [
        ("very", 0.0625, 0.6724),
        ("somewhat", 0.5, 0.9055385138137417),
        ("extremely", 0.015625, 0.551368),
        ("intensely", 0.125, 0.9352),
        ("seldom", 0.3535533905932738, 0.7),
    ],
)
def test_degrees_are_those_of_the_standard(hedge: str, quarter: float, most: float) -> None:
    """IEEE 1855, annex A, at 0.25 and 0.82 by hand; 0 and 1 stay, and so they do but for rounding."""
    change = HEDGES[hedge]  # type: ignore[index]
    degrees = change(np.array([0.0, 0.25, 0.82, 1.0]))
    np.testing.assert_allclose(degrees, [0.0, quarter, most, 1.0], rtol=0, atol=1e-15)
    grown = change(np.linspace(0.0, 1.0, 1001))
    assert np.all(np.diff(grown) > 0.0)
    assert not np.isnan(change(np.array([-1e-16, 1.0 + 1e-15]))).any()


def test_all_engines_agree_about_hedges_anywhere() -> None:
    for seed in range(12):
        generator = np.random.default_rng([61, seed])
        system = hedged(random_general_system(generator), generator)
        assert problems(system) == []
        rows = inputs_for(system, generator, 30)
        program = assemble(system)
        expected = inference.firing_strengths(system, rows)
        np.testing.assert_allclose(interpreter.fire(program, rows), expected, rtol=0, atol=1e-14)
        widths = np.array([output.maximum - output.minimum for output in system.outputs])
        outputs = interpreter.evaluate(program, rows) / widths
        np.testing.assert_allclose(outputs, inference.evaluate(system, rows) / widths, rtol=0, atol=1e-12)
