"""Many samples by the inference that keeps every step."""

from typing import Any

import numpy as np

from fis_tools.engines.inference import infer
from fis_tools.engines.inputs import as_rows
from fis_tools.model import FuzzySystem


def inferred(system: FuzzySystem, inputs: Any) -> tuple[np.ndarray, np.ndarray]:
    """Outputs of samples, (n, num_outputs), and firing strengths before weights, (n, num_rules)."""
    steps = [infer(system, row) for row in as_rows(system, inputs)]
    outputs = np.array([step.values for step in steps]).reshape(-1, len(system.outputs))
    return outputs, np.array([step.firing_strengths for step in steps]).reshape(-1, len(system.rules))


def evaluate(system: FuzzySystem, inputs: Any) -> np.ndarray:
    return inferred(system, inputs)[0]


def firing_strengths(system: FuzzySystem, inputs: Any) -> np.ndarray:
    return inferred(system, inputs)[1]


def ends(system: FuzzySystem) -> tuple[np.ndarray, np.ndarray]:
    """Where the ranges of the inputs begin and end, each (num_inputs,)."""
    low, high = np.array([[variable.minimum, variable.maximum] for variable in system.inputs]).T
    return low, high


def assert_near(actual: Any, expected: Any, system: FuzzySystem, share: float = 1e-12) -> None:
    """Outputs, the last axis, differ by a share of their ranges at most."""
    spans = np.array([variable.maximum - variable.minimum for variable in system.outputs])
    np.testing.assert_allclose(np.asarray(actual) / spans, np.asarray(expected) / spans, rtol=0, atol=share)
