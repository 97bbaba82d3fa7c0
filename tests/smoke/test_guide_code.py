"""The Python of the guide on speed runs, and gives what it says."""

from typing import Any

import numpy as np
import pytest
from skfuzzy import control

from tests.smoke.pages import DOCS, blocks


def test_a_compiled_control_system_gives_what_compute_gives() -> None:
    """Some of the million tips that are computed there, one by one."""
    (code,) = blocks(DOCS / "how-to" / "speed-up-scikit-fuzzy.md", "python")
    names: dict[str, Any] = {}
    exec(code, names)  # noqa: S102 - our own page
    services = np.array([0.0, 1.3, 5.0, 8.8, 10.0])
    tips = names["infer"]({"service": services, "food": 6.5})["tip"]
    simulation = control.ControlSystemSimulation(control.ControlSystem(names["rules"]))
    for service, tip in zip(services, tips, strict=True):
        simulation.input["service"], simulation.input["food"] = service, 6.5
        simulation.compute()
        assert tip == pytest.approx(simulation.output["tip"], abs=25e-12)
    assert names["tips"].shape == (1_000_000,)
    assert 0.0 < names["tips"].min() < names["tips"].max() < 25.0
