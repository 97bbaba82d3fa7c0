"""Foresight divided among the deputies of a fleet: each answers the others' plans in turn.

A plan is priced as for one deputy (`pipeline.flight.fly.foresight`), but for points that the plans of others
show. Each deputy is first once: it plans as if alone, then the others answer, until nobody gains. The fleet
takes the cheapest of these plans together.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fis_tools.engines.kernel import FEW_LANES
from pipeline.array_types import Booleans, Floats
from pipeline.flight.control.controller import RuleController
from pipeline.flight.fly.foresight import Outlook, lead
from pipeline.flight.fly.outlooks import Deputies, at_start
from pipeline.flight.fly.prices import price_pushes
from pipeline.flight.fly.pushes import search_pushes
from pipeline.flight.fly.replanning import FIRST, pushes_of
from pipeline.flight.state.log import Scenario
from pipeline.settings.experiment import Mission
from pipeline.threads import in_threads

#: most rounds of answers, and the least gain that goes on, m/s
MOST_ROUNDS, LEAST_GAIN_M_S = 3, 1e-4


@dataclass(frozen=True)
class Team:
    """The deputies of one fleet that plan together.

    Parameters
    ----------
    deputies : Deputies
    outlooks : sequence of (Outlook, int)
        Of each, and the points that must be seen.
    """

    deputies: Deputies
    outlooks: Sequence[tuple[Outlook, int]]

    @property
    def num_pushes(self) -> int:
        """How many pushes each plans."""
        return self.deputies.num_pushes

    def divided(self) -> Floats:
        """Return the genes of the cheapest plans together, (D, 4 pushes - 1)."""
        count, num_genes = len(self.outlooks), 4 * self.num_pushes - 1
        candidates = []
        for first in range(count):
            genes = np.zeros((count, num_genes))
            order = [first, *(deputy for deputy in range(count) if deputy != first)]
            price = np.inf
            for turn in range(MOST_ROUNDS):
                before = price
                for deputy in order:
                    answered = genes.copy()
                    answered[deputy] = self._answer(genes, deputy, (first, turn))
                    if (cost := self.price(answered)) < price:
                        price, genes = cost, answered
                if not price < before - LEAST_GAIN_M_S:
                    break
            candidates.append((price, first, genes))
        return min(candidates)[2]

    def price(self, genes: Floats) -> float:
        """Return what plans cost together, m/s; points fall short by the best of all."""
        count = len(self.outlooks)
        alone = sum(self._price(self.outlooks[deputy][0], 0, genes[deputy]) for deputy in range(1, count))
        return alone + self._price(*self._left(genes, 0), genes[0])

    def _answer(self, genes: Floats, deputy: int, turn: tuple[int, int]) -> Floats:
        """Return the cheapest plan found of a deputy beside those of others."""
        outlook, needed = self._left(genes, deputy)
        starts = [[*s.position_m, *s.velocity_m_s, s.sun_angle_rad] for s in self.deputies.believed]
        words = np.array(starts).view(np.uint32).ravel().tolist()
        generator = np.random.default_rng(np.random.SeedSequence(words, spawn_key=(*turn, deputy)))
        effort = FIRST[self.num_pushes]
        reach = self.deputies.constant("foresight_reach_m_s")
        last = genes[deputy] if genes[deputy].any() or turn[1] > 0 else None
        return search_pushes(outlook, self.num_pushes, needed, reach, effort, generator, last).best

    def _left(self, genes: Floats, deputy: int) -> tuple[Outlook, int]:
        """Return the outlook of a deputy without what the plans of others show, and how much must be seen."""
        outlook, needed = self.outlooks[deputy]
        shown = np.zeros(len(outlook.heights), dtype=np.bool_)
        for other, (theirs, _) in enumerate(self.outlooks):
            shown |= self._shown(theirs, genes[other]) if other != deputy else False
        count, is_left = int(shown.sum()), ~shown
        if not is_left.any():
            return outlook, 0
        part = outlook._replace(
            points=np.ascontiguousarray(outlook.points[:, :, is_left]),
            normals=np.ascontiguousarray(outlook.normals[:, :, is_left]),
            heights=np.ascontiguousarray(outlook.heights[is_left]),
            is_lit=np.ascontiguousarray(outlook.is_lit[:, is_left]),
            required=max(0, outlook.required - count),
        )
        return part, min(max(0, needed - count), int(part.is_lit.any(axis=0).sum()))

    def _price(self, outlook: Outlook, needed: int, genes: Floats) -> float:
        costs = np.empty((1, 1))
        price_pushes(np.ascontiguousarray(genes[:, np.newaxis]), self.num_pushes, needed, outlook, costs[0])
        return float(costs[0, 0])

    def _shown(self, outlook: Outlook, genes: Floats) -> Booleans:
        """Return which points a plan shows, (P,)."""
        effects = np.ascontiguousarray(outlook.gain.transpose(2, 0, 1).reshape(3, -1))
        path = np.empty(outlook.free.size)
        lead(genes, self.num_pushes, outlook, effects, path)
        positions = path.reshape(-1, 3)
        above = np.einsum("sap,sa->sp", outlook.normals, positions) - outlook.heights
        away = np.linalg.norm(positions[:, :, np.newaxis] - outlook.points, axis=1)
        is_seen = outlook.is_lit & (above >= 0.0) & (above >= outlook.cos_incidence * away)
        is_far = np.linalg.norm(positions, axis=1) >= outlook.sight
        is_seen &= (away <= outlook.max_range) & is_far[:, np.newaxis]
        return np.asarray(is_seen.any(axis=0))


def divided_openings(
    mission: Mission, controller: RuleController, scenarios: list[Scenario], workers: int | None = 1
) -> Floats:
    """Return the planned forces of fleets, (m D, K, 4), with nothing fired after them.

    `mission` is that of each deputy, and scenarios are those of `Scenario.fleet`.
    """

    def plan(scenario: Scenario) -> Floats:
        """Return the forces of a fleet, (D, K, 4)."""
        deputies = at_start(mission, mission, controller, list(scenario.fleet), 0, FEW_LANES)
        genes = Team(deputies, deputies.outlooks()).divided()
        return np.array([_opening(deputies, of_deputy) for of_deputy in genes])

    return np.concatenate(in_threads(plan, scenarios, workers=workers))


def _opening(deputies: Deputies, genes: Floats) -> Floats:
    """Return the forces of a plan, (K, 4), large ones over several periods, and of coasting after it."""
    opening = np.zeros((deputies.world.num_controls, 4))
    opening[:, 3] = 1.0
    for begin, *force in pushes_of(genes, deputies):
        for axis, part in enumerate(force):
            periods = max(1, int(np.ceil(abs(part) / deputies.most_force - 1e-9)))
            opening[int(begin) : int(begin) + periods, axis] += part / periods
    return opening


def driven(openings: Floats) -> Floats:
    """Return openings after whose last push the rules decide."""
    changed = openings.copy()
    for opening in changed:
        fired = np.flatnonzero(np.any(opening[:, :3] != 0.0, axis=1))
        opening[fired[-1] + 1 if len(fired) else 0 :, 3] = 0.0
    return changed
