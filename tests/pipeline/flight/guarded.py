"""Missions with the safety layer on, and controllers that mean the deputy harm."""

from dataclasses import replace
from typing import Any

import numpy as np

from fis_tools.model import FuzzySystem, Gaussian, Term, Variable, table_rules
from pipeline.array_types import Floats
from pipeline.flight.control.controller import Controller, coast, open_loop
from pipeline.flight.state.log import Scenario
from pipeline.settings.experiment import Mission, Safety
from tests.pipeline.flight.cases import controller, isotropic, mission

#: radii that the layer keeps the deputy between, m
SPHERES = 16.0, 198.0

#: without the limits that act early
LAST_MOMENT = Safety(
    kind="filter",
    keep_out_margin_m=1.0,
    keep_in_margin_m=2.0,
    speed_limit_m_s=0.2,
    speed_slope_per_s=0.0044272,
    speed_distance_m=15.0,
    braking_force_n=0.8,
    passive_horizon_s=0.0,
    keep_in_horizon_s=0.0,
)
#: as shipped, nearly
EARLY = replace(LAST_MOMENT, passive_horizon_s=300.0, keep_in_horizon_s=450.0)
#: drift for an orbit does not meet the chief
PASSIVE = replace(EARLY, passive_horizon_s=5677.0)


def guarded(safety: Safety = LAST_MOMENT, **changes: Any) -> Mission:
    """The paper's mission with the layer on and, for attitude does not matter to it, ideal pointing."""
    return replace(mission(attitude={"mode": "ideal"}, **changes), safety=safety)


def starts_at_rest(count: int, seed: int) -> list[Scenario]:
    """Anywhere between the spheres."""
    generator = np.random.default_rng(seed)
    directions = isotropic(generator, count)
    distances = generator.uniform(SPHERES[0] + 0.01, SPHERES[1] - 0.01, count)
    return [Scenario(r * d, np.zeros(3), 0.0) for r, d in zip(distances, directions, strict=True)]


def pushing(force_n: float) -> Controller:
    """Away from the chief, wherever the deputy is; towards it where the force is negative."""
    seen = Variable("distance", "m", 0.0, 250.0, (Term("any", Gaussian(125.0, 500.0)),))
    terms = (Term("push", Gaussian(force_n, 0.2 * abs(force_n))),)
    output = Variable("force_x", "N", -2.0 * abs(force_n), 2.0 * abs(force_n), terms, default=force_n)
    return controller((FuzzySystem("push", (seen,), (output,), table_rules((seen,), output, ["push"])),))


def hostile(seed: int, **forces_n: Floats) -> dict[str, Controller]:
    """Controllers that ask for what a safety layer must not grant, by name; forces, (n, 3), add others."""
    random = np.random.default_rng(seed)
    drawn = {
        "weak noise": random.normal(0.0, 0.05, (360, 3)),
        "strong noise": random.normal(0.0, 2.0, (360, 3)),
        "long pushes": np.repeat(random.choice([-1.0, 0.0, 1.0], (24, 3)), 15, axis=0),
    }
    named = drawn | {name.replace("_", " "): forces for name, forces in forces_n.items()}
    return {
        "towards the chief": pushing(-1.0),
        "away from the chief": pushing(1.0),
        "not at all": coast(),
        **{name: open_loop(name, forces) for name, forces in named.items()},
    }
