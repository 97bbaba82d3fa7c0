"""Foresight divided among the deputies of a fleet: each answers the others' plans in turn, then all together.

A plan is priced as for one deputy (`pipeline.flight.fly.foresight`), but for points that the plans of others
show, and for coming too near to them. Each deputy is first once: it plans as if alone, then the others
answer, until nobody gains. From these plans a search over those of all deputies together begins. Where plans
are made again, what is left of the last ones is flown on if it is still nearly good enough, and otherwise
among those that the search begins with.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from pipeline.array_types import Booleans, Floats
from pipeline.flight.fly.aboard import SLACK_M_S
from pipeline.flight.fly.foresight import Outlook, lead
from pipeline.flight.fly.joint import JointOutlook, joint_outlook, price_together, search_together
from pipeline.flight.fly.outlooks import Deputies
from pipeline.flight.fly.pushes import Effort
from pipeline.flight.fly.replanning import FIRST, pushes_of
from pipeline.flight.world.bounds import stops_apart
from pipeline.settings.experiment import Mission

#: most rounds of answers, and the least gain that goes on, m/s
MOST_ROUNDS, LEAST_GAIN_M_S = 3, 1e-4
#: of the search over all plans together
TOGETHER = Effort(64, 300)
#: by how much plans keep deputies farther apart than the safety layer does, m: from nearer it changes forces
#: of two that go towards each other, since neither may pass the middle between their stops
APART_MARGIN_M = 5.0


@dataclass(frozen=True)
class Team:
    """The deputies of one fleet that plan together.

    Parameters
    ----------
    deputies : Deputies
    outlooks : sequence of (Outlook, int)
        Of each, and the points that must be seen.
    apart_m : float
        How far plans keep any two apart; 0: not at all.
    last : (D, 4 pushes - 1), optional
        Genes of what the last plans would still fire.

    Attributes
    ----------
    searches : list of Effort
        Those made so far.
    """

    deputies: Deputies
    outlooks: Sequence[tuple[Outlook, int]]
    apart_m: float = 0.0
    last: Floats | None = None
    searches: list[Effort] = field(default_factory=list, init=False)

    @property
    def num_pushes(self) -> int:
        """How many pushes each plans."""
        return self.deputies.num_pushes

    @cached_property
    def is_held(self) -> bool:
        """Whether what is left of the last plans is still nearly good enough, as that of one deputy is."""
        if self.last is None:
            return False
        spent = np.abs(self.last[:, : 3 * self.num_pushes]).sum()
        return self.price(self.last) <= spent * self.outlooks[0][0].delta_v_per_force + SLACK_M_S

    @cached_property
    def apart(self) -> Floats:
        """How far plans keep deputies apart, (D, D), m: those that start nearer come no nearer."""
        starts = np.array([outlook.free[0] for outlook, _ in self.outlooks])
        away = np.linalg.norm(starts[:, np.newaxis] - starts, axis=2)
        return np.minimum(away, self.apart_m)

    @property
    def num_priced(self) -> int:
        """How many plans were priced, of one deputy or of all together."""
        return sum(search.num_priced for search in self.searches)

    def divided(self) -> Floats:
        """Return the genes of the cheapest plans together, (D, 4 pushes - 1); of the last, if these hold.

        The first plans are the cheapest of as many attempts as the controller's `foresight_searches`.
        """
        if self.last is not None and self.is_held:
            return self.last
        again = 0 if self.last is not None else round(self.deputies.constant("foresight_searches")) - 1
        attempts = [(), *((attempt,) for attempt in range(1, again + 1))]
        return min(map(self._attempted, attempts), key=self.price)

    def _attempted(self, attempt: tuple[int, ...]) -> Floats:
        """Return the genes of the cheapest plans together that an attempt finds, (D, 4 pushes - 1)."""
        count = len(self.outlooks)
        plans = [self.answered(first, attempt) for first in range(count)]
        answers = sorted(plans if self.last is None else [*plans, self.last], key=self.price)
        known = np.array([genes.ravel() for genes in answers])
        together = self._searched(range(count), known, answers[0], (count, *attempt), self.outlooks)
        return min(answers[0], together, key=self.price)

    def answered(self, first: int, attempt: tuple[int, ...] = ()) -> Floats:
        """Return the genes of plans by answers in turn, (D, 4 pushes - 1), the first made as if alone."""
        count = len(self.outlooks)
        genes, price = np.zeros((count, 4 * self.num_pushes - 1)), np.inf
        order = [first, *(deputy for deputy in range(count) if deputy != first)]
        for turn in range(MOST_ROUNDS):
            before = price
            for deputy in order:
                changed = genes.copy()
                changed[deputy] = self._answer(genes, deputy, (first, turn, deputy, *attempt))
                if (cost := self.price(changed)) < price:
                    price, genes = cost, changed
            if not price < before - LEAST_GAIN_M_S:
                break
        return genes

    def price(self, genes: Floats) -> float:
        """Return what plans cost together, m/s: points fall short by the best of all."""
        (joint, num_lit), needed = self._joint, self.outlooks[0][1]
        return float(price_together(genes.ravel(), self.num_pushes, num_lit, needed, joint, np.inf))

    @cached_property
    def _joint(self) -> tuple[JointOutlook, int]:
        """What prices the plans of all deputies."""
        outlooks = [outlook for outlook, _ in self.outlooks]
        reach = self.deputies.constant("foresight_reach_m_s") / outlooks[0].delta_v_per_force
        nobody = np.zeros((0, *outlooks[0].free.shape))
        return joint_outlook(outlooks, self.num_pushes, reach, nobody, self.apart)

    def _answer(self, genes: Floats, deputy: int, key: tuple[int, ...]) -> Floats:
        """Return the cheapest plan that a search finds for a deputy beside those of others."""
        turn, left = key[1], [self._left(genes, deputy)]
        known = genes[deputy : deputy + 1] if genes[deputy].any() or turn > 0 else genes[:0]
        return self._searched([deputy], known, genes, key, left)[0]

    def _searched(
        self,
        movers: Sequence[int],
        known: Floats,
        genes: Floats,
        key: tuple[int, ...],
        outlooks: Sequence[tuple[Outlook, int]],
    ) -> Floats:
        """Search for the plans of some deputies, with their outlooks, beside those that others have."""
        others = [other for other in range(len(genes)) if other not in movers]
        paths = [self._path(other, genes[other]) for other in others]
        starts = [[*s.position_m, *s.velocity_m_s, s.sun_angle_rad] for s in self.deputies.believed]
        words = np.array(starts).view(np.uint32).ravel().tolist()
        effort = FIRST[self.num_pushes] if len(movers) == 1 else TOGETHER
        self.searches.append(effort)
        return search_together(
            [outlook for outlook, _ in outlooks],
            self.num_pushes,
            outlooks[0][1],
            self.deputies.constant("foresight_reach_m_s"),
            effort,
            np.random.default_rng(np.random.SeedSequence(words, spawn_key=key)),
            known,
            np.array(paths).reshape(len(others), *outlooks[0][0].free.shape),
            self.apart[np.ix_(movers, [*movers, *others])],
        )

    def _left(self, genes: Floats, deputy: int) -> tuple[Outlook, int]:
        """Return the outlook of a deputy without what the plans of others show, and how much must be seen."""
        outlook, needed = self.outlooks[deputy]
        shown = np.zeros(len(outlook.heights), dtype=np.bool_)
        for other in range(len(self.outlooks)):
            shown |= self._shown(other, genes[other]) if other != deputy else False
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

    def _path(self, deputy: int, genes: Floats) -> Floats:
        """Return the positions that a plan leads to, (S, 3), m."""
        outlook, _ = self.outlooks[deputy]
        effects = np.ascontiguousarray(outlook.gain.transpose(2, 0, 1).reshape(3, -1))
        path = np.empty(outlook.free.size)
        lead(genes, self.num_pushes, outlook, effects, path)
        return path.reshape(-1, 3)

    def _shown(self, deputy: int, genes: Floats) -> Booleans:
        """Return which points a plan shows, (P,)."""
        (outlook, _), positions = self.outlooks[deputy], self._path(deputy, genes)
        above = np.einsum("sap,sa->sp", outlook.normals, positions) - outlook.heights
        away = np.linalg.norm(positions[:, :, np.newaxis] - outlook.points, axis=1)
        is_seen = outlook.is_lit & (above >= 0.0) & (above >= outlook.cos_incidence * away)
        is_far = np.linalg.norm(positions, axis=1) >= outlook.sight
        is_seen &= (away <= outlook.max_range) & is_far[:, np.newaxis]
        return np.asarray(is_seen.any(axis=0))


def team_of(mission: Mission, deputies: Deputies, last: Floats | None = None) -> Team:
    """Return the deputies of one fleet as they plan together: each tells the others all that it knows.

    Plans are priced by the errors of the one that knows least. `last` is that of a `Team`.
    """
    least = int(deputies.spreads_m.argmax())
    count, left = len(deputies.believed), deputies.left
    pooled = replace(
        deputies,
        spreads_m=np.full(count, deputies.spreads_m[least]),
        covariances=np.repeat(deputies.covariances[least : least + 1], count, axis=0),
        left=None if left is None else np.repeat(left.min(axis=0, keepdims=True), count, axis=0),
    )
    apart_m = stops_apart(mission)
    return Team(pooled, pooled.outlooks(), apart_m + APART_MARGIN_M if apart_m > 0.0 else 0.0, last)


def openings_of(deputies: Deputies, plans: Floats) -> Floats:
    """Return the forces of plans from a sample on, (m, K, 4), large ones over several periods, then coasting.

    `plans` are genes, (m, 4 pushes - 1).
    """
    openings = deputies.coasting()
    for opening, genes in zip(openings, plans, strict=True):
        for begin, *force in pushes_of(genes, deputies):
            for axis, part in enumerate(force):
                periods = max(1, int(np.ceil(abs(part) / deputies.most_force - 1e-9)))
                opening[int(begin) : int(begin) + periods, axis] += part / periods
    return openings


def driven(openings: Floats, sample: int = 0) -> Floats:
    """Return openings after whose last push from a sample on the rules decide."""
    changed = openings.copy()
    for opening in changed:
        fired = np.flatnonzero(np.any(opening[sample:, :3] != 0.0, axis=1))
        opening[sample + (fired[-1] + 1 if len(fired) else 0) :, 3] = 0.0
    return changed
