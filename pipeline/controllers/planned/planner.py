"""Controllers of the planning kinds, which are computed and not written out.

The module of a kind is imported on request: two of them need scipy, which takes longer to import than a
flight takes.
"""

from collections.abc import Sequence
from dataclasses import replace
from importlib import import_module

import numpy as np
from numpy.typing import NDArray

from pipeline.flight.control.controller import Controller, Planner
from pipeline.flight.state.log import Scenario
from pipeline.settings.controllers import Planned
from pipeline.settings.experiment import Mission


def controller_of_kind(kind: str, settings: Planned, mission: Mission) -> Controller:
    """Return the controller of a kind, made by the module that has its name.

    Raises
    ------
    SettingError
        If the settings do not fit the mission.
    """
    made: Controller = import_module(f"pipeline.controllers.planned.{kind}").controller(settings, mission)
    return made


def remembering(controller: Controller) -> Controller:
    """Return the controller with a planner, if any, that caches its plans.

    Flights from the same start with several safety layers are the same until a layer intervenes.
    """
    if controller.planner is None:
        return controller
    return replace(controller, planner=_Remembering(controller.planner))


class _Remembering:
    """A planner that caches the forces of every decision."""

    def __init__(self, planner: Planner) -> None:
        self._planner = planner
        self._known: dict[tuple[object, ...], NDArray[np.float64]] = {}

    @property
    def decisions(self) -> Sequence[int]:
        return self._planner.decisions

    def __call__(self, scenario: Scenario, decision: int, state: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the forces from a decision on; see `Planner`."""
        place, velocity = scenario.position_m.tobytes(), scenario.velocity_m_s.tobytes()
        sun = scenario.sun_angle_rad, scenario.sun_elevation_rad
        asked = (place, velocity, *sun, scenario.noise, scenario.settings, decision, state.tobytes())
        if asked not in self._known:
            self._known[asked] = self._planner(scenario, decision, state)
        return self._known[asked]
