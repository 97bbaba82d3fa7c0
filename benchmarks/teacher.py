"""Plans that a learner is taught by: what foresight would fire from wherever a flight has come to."""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fis_tools.engines.kernel import LANES
from pipeline.controllers.source import named
from pipeline.flight.cases.starts import cases_of
from pipeline.flight.control.controller import RuleController, from_fuzzy
from pipeline.flight.fly.outlooks import Deputies, at_start, later
from pipeline.flight.fly.pushes import PushSearch, search_pushes
from pipeline.flight.fly.replanning import first_searches, pushes_of
from pipeline.flight.state.log import Scenario
from pipeline.settings.experiment import Mission

Floats = NDArray[np.float64]
#: the controller whose plans are taught
PLANNER: Final = "champion_27_rehearsed"
#: cheapest plans that clearly differ, of which the one nearest to the learner's may be taught
NUM_DISTINCT: Final = 6


@dataclass(frozen=True)
class Teacher:
    """Plans the rest of flights that a learner began.

    Pushes are planned as `pipeline.flight.fly.replanning` does for the first of a flight, and fired at
    decisions only: each at the last one that is not after its time. Plans are flown as they are, with
    coasting after them; no rules take over.

    Parameters
    ----------
    mission : Mission
        Where all is exact.
    period : int
        Control periods between decisions.
    slack_m_s : float
        By how much a plan may cost more than the cheapest if its first push is nearer to the learner's: of
        plans that cost alike, such as mirror images, no mean of several is taught.
    margin_m : float
        By which plans stay inside the limits.
    """

    mission: Mission
    period: int
    slack_m_s: float
    margin_m: float

    @cached_property
    def planner(self) -> RuleController:
        """The controller whose foresight plans."""
        fuzzy = named(PLANNER, self.mission).fuzzy
        assert fuzzy is not None
        attributes = dict(fuzzy.attributes) | {"coast_margin_m": repr(self.margin_m)}
        return from_fuzzy(replace(fuzzy, attributes=tuple(attributes.items())))

    def finish(
        self, starts: list[Scenario], flown: Floats, switches: NDArray[np.int64], seed: int, *, heeds: bool
    ) -> Floats:
        """Return the forces of flights that a learner flies up to a sample, and plans from there.

        Parameters
        ----------
        starts : list of Scenario
            Of n flights.
        flown : (n, K, 3) array
            The learner's forces, N, Hill axes, to the end.
        switches : (n,) array
            Samples from which plans are flown.
        seed : int
            Of the searches.
        heeds : bool
            Whether the learner's force at the switch decides between plans that cost alike.

        Returns
        -------
        (n, K, 3) array
        """
        forces = flown.copy()
        for sample in np.unique(switches).tolist():
            rows = np.flatnonzero(switches == sample)
            deputies = self._deputies([starts[row] for row in rows], flown[rows], sample)
            forces[rows, sample:] = 0.0
            for row, (outlook, needed) in zip(rows.tolist(), deputies.outlooks(), strict=True):
                generator = np.random.default_rng((seed, sample, row))
                reach = deputies.constant("foresight_reach_m_s")
                searches = [
                    search_pushes(outlook, deputies.num_pushes, needed, reach, effort, generator)
                    for effort in first_searches(deputies.controller)
                ]
                genes = self._chosen(searches, deputies, flown[row, sample] if heeds else None)
                for begin, *force in pushes_of(genes, deputies).tolist():
                    due = sample + (int(begin) - sample) // self.period * self.period
                    forces[row, due] += force
        most = self.mission.deputy.max_force_n
        forces[:] = np.clip(forces, -most, most)
        return forces

    def _deputies(self, starts: list[Scenario], flown: Floats, sample: int) -> Deputies:
        """Return what plans are made from, at a sample of flights under forces."""
        first = at_start(self.mission, self.mission, self.planner, starts, self.period, LANES)
        if sample == 0:
            return first
        openings = first.coasting()
        openings[:, :sample, :3] = flown[:, :sample]
        return later(first, starts, cases_of(self.mission, starts), openings, sample, self.period)

    def _chosen(self, searches: list[PushSearch], deputies: Deputies, wanted: Floats | None) -> Floats:
        """Return the genes of the plan that is taught."""
        best = min(searches, key=lambda search: search.cost)
        if wanted is None:
            return best.best
        per_force, seconds = deputies.world.delta_v_per_force, deputies.step * self.mission.control_period_s
        alike: list[tuple[float, Floats]] = []
        for search in searches:
            plans, prices = search.distinct(NUM_DISTINCT, per_force, seconds)
            for genes, price in zip(plans, prices.tolist(), strict=True):
                if price <= best.cost + self.slack_m_s:
                    alike.append((float(np.abs(genes[:3] - wanted).sum()), genes))
        return min(alike, key=lambda plan: plan[0])[1]
