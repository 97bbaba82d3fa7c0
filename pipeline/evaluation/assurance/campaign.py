"""Many flights and their margins: by how much every case satisfies each requirement's formula."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.array_types import Floats
from pipeline.evaluation.assurance.formula import Formula, quantities_of
from pipeline.evaluation.assurance.quantities import of_tracks
from pipeline.evaluation.assurance.requirements import Requirement, RequirementError, require_heard
from pipeline.evaluation.assurance.robustness import holds, robustness
from pipeline.flight.control.controller import Controller
from pipeline.flight.fly.simulation import fly_all
from pipeline.flight.state.arrays import NUM_TRACKED
from pipeline.flight.state.log import Scenario
from pipeline.flight.world.pack import inspection_points
from pipeline.settings.experiment import Mission

#: flights whose tracks are in memory at once, 22 kB per hour of flight
PART = 1000
#: flights too few to be worth sharing out
FEW = 64


@dataclass(frozen=True)
class Outcome:
    """Results of some cases for a formula: the margin of each, (n,), and whether it holds, (n,)."""

    margins: Floats
    is_met: NDArray[np.bool_]


class Flights:
    """Flights of one controller in one mission, evaluated by formulas; each part of them is flown once.

    Parameters
    ----------
    mission : Mission
    controller : Controller
    workers : int, optional
        Worker threads; one per processor unless given.
    """

    def __init__(self, mission: Mission, controller: Controller, workers: int | None = None) -> None:
        self._mission, self._controller, self._workers = mission, controller, workers
        self._num_points = len(inspection_points(mission))

    def judge(self, scenarios: Sequence[Scenario], requirements: Sequence[Requirement]) -> dict[str, Outcome]:
        """Fly all scenarios; return the outcome of each requirement with a formula, by its id.

        Raises
        ------
        RequirementError
            If flights of this mission do not determine a formula.
        """
        mission = self._mission
        require_heard(requirements, mission.duration_s, mission.control_period_s)
        formulas = {one.id: one.formula for one in requirements if one.formula is not None}
        parts: list[dict[str, Outcome]] = []
        for first in range(0, len(scenarios), PART):
            tracks = self.tracks(list(scenarios[first : first + PART]))
            parts.append(judged(tracks, self._num_points, formulas, mission.control_period_s))
        return {name: joined([part[name] for part in parts]) for name in formulas}

    def tracks(self, scenarios: list[Scenario]) -> NDArray[np.float32]:
        """Return the tracks of some flights, (n, K+1, 15), see `pipeline.evaluation.assurance.quantities`."""
        shape = (len(scenarios), self._mission.num_controls + 1, NUM_TRACKED)
        tracks = np.empty(shape, dtype=np.float32)
        # a few fly side by side in one thread: shared out, they would leave vectors half empty
        workers = 1 if len(scenarios) < FEW else self._workers
        fly_all(self._mission, self._controller, scenarios, workers, tracks)
        return tracks


def judged(
    tracks: NDArray[np.floating], num_points: int, formulas: Mapping[str, Formula], period_s: float
) -> dict[str, Outcome]:
    """Return the outcomes of formulas, by name, on flights whose tracks are given, (n, K+1, 15)."""
    names = dict.fromkeys(name for formula in formulas.values() for name in quantities_of(formula))
    quantities = of_tracks(tracks, num_points, names)
    outcomes = {
        name: Outcome(robustness(formula, quantities, period_s), holds(formula, quantities, period_s))
        for name, formula in formulas.items()
    }
    for name, outcome in outcomes.items():
        if not np.all(np.isfinite(outcome.margins)):
            raise RequirementError(
                f"{name}: its formula says nothing about a flight of {(tracks.shape[1] - 1) * period_s:g} s; "
                "let its windows begin before the end of the flight and hold a sample"
            )
    return outcomes


def joined(parts: Sequence[Outcome]) -> Outcome:
    """Concatenate outcomes of one formula."""
    return Outcome(
        np.concatenate([part.margins for part in parts]), np.concatenate([part.is_met for part in parts])
    )
