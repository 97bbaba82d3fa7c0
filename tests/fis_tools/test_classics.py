"""The classic systems answer as their sources say, and as their symmetry demands."""

import numpy as np
import pytest

from docs.scripts.classics import paths
from fis_tools.engines.compiler import compile
from fis_tools.engines.inference import infer
from fis_tools.model import FuzzySystem
from fis_tools.source import read_controller

SYSTEMS = {path.stem: path for path in paths()}


def system(name: str) -> FuzzySystem:
    (only,) = read_controller(SYSTEMS[name]).systems
    return only


def test_there_are_ten_and_each_names_its_source() -> None:
    assert len(SYSTEMS) == 10
    ours = [path for path in SYSTEMS.values() if path.suffix == ".yaml"]
    assert all(dict(read_controller(path).provenance)["source"] for path in ours)


def test_the_pendulum_answers_as_in_the_book() -> None:
    """Passino and Yurkovich, example of section 2.2.5: (0 · 4.375 - 10 · 9.375) / (4.375 + 9.375)."""
    answer = compile(system("pendulum"))({"angle_error": 0.0, "error_rate": np.pi / 8 - np.pi / 32})
    assert answer["force"] == pytest.approx(-10 * 9.375 / (4.375 + 9.375), abs=1e-12)


def test_the_risk_of_the_project_fires_as_in_the_book() -> None:
    """Negnevitsky's example: funding 35 %, staffing 60 %."""
    step = infer(system("project_risk"), np.array([35.0, 60.0]))
    assert step.firing_strengths == pytest.approx([0.1, 0.2, 0.5])


@pytest.mark.parametrize(
    ("name", "middle"),
    [
        ("parking", (90.0, 50.0)),
        *((name, (0.0, 0.0)) for name in ("pendulum", "proportional_derivative", "water_tank")),
    ],
)
def test_the_other_side_answers_the_opposite(name: str, middle: tuple[float, float]) -> None:
    original = system(name)
    reach = np.array([[v.maximum - v.minimum for v in original.inputs]]) / 2
    away = reach * np.array([[0.1, 0.3], [-0.4, 0.2], [0.7, -0.9]])
    there, back = (compile(original).infer(np.array(middle) + sign * away).outputs for sign in (1.0, -1.0))
    ranges = [output.maximum - output.minimum for output in original.outputs]
    assert np.abs(there + back).max() <= 1e-12 * max(ranges)


def test_the_taps_of_the_shower_change_places_between_cold_and_hot() -> None:
    infer_taps = compile(system("shower")).infer
    there = infer_taps(np.array([[-4.0, 0.5], [7.0, -1.2], [15.0, 2.0]])).outputs
    back = infer_taps(np.array([[4.0, 0.5], [-7.0, -1.2], [-15.0, 2.0]])).outputs
    assert np.abs(there - back[:, ::-1]).max() <= 1e-12
