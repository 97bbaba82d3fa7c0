"""Many samples by the inference that keeps every step."""

from typing import Any

import numpy as np

from fis_tools.engines.inference import as_rows, infer
from fis_tools.model import FuzzySystem


def evaluate(system: FuzzySystem, inputs: Any) -> np.ndarray:
    """Outputs of samples, (n, num_outputs)."""
    found = [infer(system, row).values for row in as_rows(system, inputs)]
    return np.array(found).reshape(-1, len(system.outputs))


def firing_strengths(system: FuzzySystem, inputs: Any) -> np.ndarray:
    """Each rule's firing strength before weights, (n, num_rules)."""
    found = [infer(system, row).firing_strengths for row in as_rows(system, inputs)]
    return np.array(found).reshape(-1, len(system.rules))


def ends(system: FuzzySystem) -> tuple[np.ndarray, np.ndarray]:
    """Where the ranges of the inputs begin and end, each (num_inputs,)."""
    low, high = np.array([[variable.minimum, variable.maximum] for variable in system.inputs]).T
    return low, high


def assert_near(found: Any, expected: Any, system: FuzzySystem, share: float = 1e-12) -> None:
    """Outputs, the last axis, differ by a share of their ranges at most."""
    spans = np.array([variable.maximum - variable.minimum for variable in system.outputs])
    np.testing.assert_allclose(np.asarray(found) / spans, np.asarray(expected) / spans, rtol=0, atol=share)
