"""Rare events of flights, for `pipeline.evaluation.splitting`: their cases, and their margins.

A case's genes are its start, its Sun and its dispersed settings (`pipeline.evaluation.assurance.case_space`);
from its number follow the errors within its flight.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from pipeline.array_types import Floats
from pipeline.evaluation.assurance.campaign import Campaign
from pipeline.evaluation.assurance.case_space import CaseSpace, numbered
from pipeline.evaluation.assurance.requirements import Requirement
from pipeline.evaluation.population import Numbers
from pipeline.flight.control.controller import Controller
from pipeline.flight.goals.flights import fly_all
from pipeline.flight.state.log import Scenario
from pipeline.settings.experiment import Mission

#: first part of the spawn key of these cases, see `pipeline.scenarios`
RARE: Final = 1 << 23


@dataclass(frozen=True)
class FlightLaw:
    """The cases of an evaluation by their genes and numbers.

    Parameters
    ----------
    space : CaseSpace
        An exact one.
    seed : int
    """

    space: CaseSpace
    seed: int

    @property
    def is_periodic(self) -> NDArray[np.bool_]:
        """Whether a gene's ends are neighbours, (num_genes,)."""
        return self.space.is_periodic

    def scenarios(self, genes: Floats, numbers: Numbers) -> list[Scenario]:
        """Return the cases of genes (n, num_genes) and numbers (n,)."""
        return [
            numbered(self.space.scenario(of_case), (self.seed, RARE, number))
            for of_case, number in zip(genes, numbers.tolist(), strict=True)
        ]


@dataclass(frozen=True)
class OutsideLimits(FlightLaw):
    """The event that a flight leaves its limits; its margin is the least distance from them, m.

    Parameters
    ----------
    mission : Mission
        Without spheres to stay out of, of which flights do not tell how near they came.
    controller : Controller
    workers : int, optional
    """

    mission: Mission
    controller: Controller
    workers: int | None

    def margins(self, genes: Floats, numbers: Numbers) -> Floats:
        """Return by how much cases stay within the limits, (n,), m."""
        outcomes = fly_all(self.mission, self.controller, self.scenarios(genes, numbers), self.workers)
        limits = self.mission.deputy
        inside = np.minimum(
            outcomes.min_distance_m - limits.min_distance_m, limits.max_distance_m - outcomes.max_distance_m
        )
        return np.where(outcomes.is_violated, -outcomes.outside_m, np.maximum(inside, 0.0))


@dataclass(frozen=True)
class NotMet(FlightLaw):
    """The event that a requirement is not met; its margin is that of the requirement's formula.

    Parameters
    ----------
    campaign : Campaign
    requirement : Requirement
        With a formula.
    """

    campaign: Campaign
    requirement: Requirement

    def margins(self, genes: Floats, numbers: Numbers) -> Floats:
        """Return the margins of cases, (n,), below zero where the requirement is not met."""
        name = self.requirement.id
        outcome = self.campaign.judge(self.scenarios(genes, numbers), [self.requirement])[name]
        least = np.finfo(np.float64).tiny
        return np.where(outcome.is_met, np.maximum(outcome.margins, 0.0), np.minimum(outcome.margins, -least))
