"""Inference against pencil and paper: the exact outline of cut triangles, from corner to corner."""

import numpy as np
import pytest

from benchmarks.by_hand import work_out
from fis_tools.engines.compiler import compile as compile_system
from fis_tools.formats.serialize import load
from tests.places import PROJECT


@pytest.mark.parametrize("name", ["champion_27", "champion_27_fixed_sun", "champion_81"])
def test_readable_champions_answer_as_by_hand(name: str) -> None:
    generator = np.random.default_rng(27)
    for system in load(PROJECT / "conf" / "controller" / f"{name}.yaml").systems:
        reaches = np.array([variable.maximum for variable in system.inputs])
        inputs = generator.uniform(-1.2, 1.2, (200, len(reaches))) * reaches
        by_hand = [work_out(system, row).force for row in inputs.tolist()]
        reach = system.outputs[0].maximum
        # the grid of 101 points cuts corners between its points
        np.testing.assert_allclose(compile_system(system)(inputs)[:, 0], by_hand, rtol=0, atol=2e-3 * reach)
