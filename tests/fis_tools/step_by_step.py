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
