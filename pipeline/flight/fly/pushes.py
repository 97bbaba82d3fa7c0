"""Plans of a few pushes: differential evolution (Storn and Price, 1997) over their price.

Mutants lead from each plan towards one of the best eighth, and along the difference of two others
(current-to-pbest: Zhang and Sanderson, JADE, IEEE Transactions on Evolutionary Computation 13(5), 2009). All
randomness is an argument, and sorting is stable, so that a search has the same bits on any number of threads,
compiled or not.
"""

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from fis_tools.compiled.decorator import compiled
from fis_tools.compiled.vectors import borrowed
from pipeline.array_types import Floats, Integers
from pipeline.flight.fly.foresight import Outlook
from pipeline.flight.fly.prices import Pricing, price_up_to, pricing_of

#: share of what is left of a flight after which no push begins; where what follows the end counts
LATEST, LATEST_OF_ENDS = 0.85, 0.99
#: least and greatest weight of a difference, and the share of genes that a mutant has
LEAST_WEIGHT, MOST_WEIGHT, CROSSOVER = 0.3, 0.9, 0.9
#: draws of a mutant besides one for each gene: three other plans, two weights, a gene that it has anyway
NUM_DRAWS = 6
#: of plans near one that is known: their share of the first, spread of their pushes, m/s, and of their times,
#: samples
NEAR_SHARE, NEAR_M_S, NEAR_SAMPLES = 0.75, 0.006, 5.0
#: uniform numbers whose sum takes the place of a normal one's where such plans are made on board
NUM_NEAR_DRAWS = 4
#: plans are distinct where first pushes differ by more than this along all axes together, m/s, or second
#: ones by more than this, s
DISTINCT_M_S, DISTINCT_S = 0.03, 300.0


@dataclass(frozen=True)
class Effort:
    """The effort of a search: how many plans are priced side by side, and how often."""

    num_plans: int
    num_generations: int

    @property
    def num_priced(self) -> int:
        """How many plans are priced."""
        return self.num_plans * (self.num_generations + 1)


@dataclass(frozen=True)
class PushSearch:
    """A search: every plan that was priced.

    Parameters
    ----------
    genes : (G+1, 4 pushes - 1, plans)
        Of each generation, see `price_pushes`.
    costs : (G+1, plans)
        Prices, m/s; infinity of plans that were certain not to be followed up.

    Attributes
    ----------
    best : (4 pushes - 1,)
        Genes of the cheapest plan.
    """

    genes: Floats
    costs: Floats
    best: Floats = field(init=False)

    def __post_init__(self) -> None:
        """Pick the cheapest, the first of equals."""
        generation, plan = np.unravel_index(self.costs.argmin(), self.costs.shape)
        object.__setattr__(self, "best", self.genes[generation, :, plan])

    @property
    def num_pushes(self) -> int:
        """How many pushes each plan has."""
        return (len(self.best) + 1) // 4

    @property
    def cost(self) -> float:
        """The price of the cheapest plan, m/s."""
        return float(self.costs.min())

    def distinct(self, count: int, delta_v_per_force: float, step_s: float) -> tuple[Floats, Floats]:
        """Return the genes and prices of up to `count` cheapest plans that clearly differ.

        A sample lasts `step_s`.
        """
        genes = self.genes.transpose(0, 2, 1).reshape(-1, self.genes.shape[1])
        order = np.argsort(self.costs.ravel(), kind="stable")
        genes, costs = genes[order], self.costs.ravel()[order]
        first, second = genes[:, :3] * delta_v_per_force, genes[:, 3 * self.num_pushes] * step_s
        chosen: list[int] = []
        is_left = np.ones(len(genes), dtype=np.bool_)
        while is_left.any() and len(chosen) < count:
            index = int(is_left.argmax())
            chosen.append(index)
            is_far = np.abs(first - first[index]).sum(axis=1) > DISTINCT_M_S
            is_left &= is_far | (np.abs(second - second[index]) > DISTINCT_S)
        return genes[chosen], costs[chosen]


class PlanSearch(NamedTuple):
    """A search under way, for the cheapest of n plans of G genes."""

    lowest: Floats  # (G,) bounds of genes
    highest: Floats  # (G,)
    plans: Floats  # (n, G) each the cheapest of its line so far
    prices: Floats  # (n,) m/s
    mutants: Floats  # (n, G) of the generation that is tried
    costs: Floats  # (n,) their prices, m/s; infinity where they exceed those of the plans for certain
    top: Integers  # (n / 8,) the cheapest plans
    best: Floats  # (G,) the cheapest plan of all
    cost: Floats  # (1,) its price, m/s


@compiled(error_model="numpy")
def rank(search: PlanSearch) -> None:
    """Note the cheapest plans, of equals the first one first."""
    prices, top = search.prices, search.top
    for plan in range(len(prices)):
        placed, is_behind = plan, False
        for i in range(len(top)):
            if i < plan and (is_behind or prices[placed] < prices[top[i]]):
                top[i], placed = placed, top[i]
                is_behind = True
            elif i == plan:
                top[i] = placed
                placed = plan


@compiled(error_model="numpy")
def mutate(plan: int, drawn: Floats, search: PlanSearch) -> None:
    """Write the mutant of a plan, from numbers from 0 to 1, (NUM_DRAWS + G,)."""
    plans, num_plans, num_genes = search.plans, len(search.plans), search.plans.shape[1]
    best = search.top[int(drawn[0] * len(search.top))]
    plus, minus = int(drawn[1] * num_plans), int(drawn[2] * num_plans)
    towards = LEAST_WEIGHT + (MOST_WEIGHT - LEAST_WEIGHT) * drawn[3]
    along = LEAST_WEIGHT + (MOST_WEIGHT - LEAST_WEIGHT) * drawn[4]
    kept = int(drawn[5] * num_genes)
    for gene in range(num_genes):
        value = plans[plan, gene]
        if gene == kept or drawn[NUM_DRAWS + gene] < CROSSOVER:
            mutant = value + towards * (plans[best, gene] - value)
            mutant = mutant + along * (plans[plus, gene] - plans[minus, gene])
            # beyond a bound it goes halfway there
            if mutant < search.lowest[gene]:
                mutant = 0.5 * (search.lowest[gene] + value)
            elif mutant > search.highest[gene]:
                mutant = 0.5 * (search.highest[gene] + value)
            value = mutant
        search.mutants[plan, gene] = value


@compiled(error_model="numpy")
def begin(search: PlanSearch) -> None:
    """Let the plans of the first generation be tried as if they took the place of any."""
    search.cost[0] = np.inf
    for plan in range(len(search.plans)):
        search.prices[plan] = np.inf
        for gene in range(search.plans.shape[1]):
            search.mutants[plan, gene] = search.plans[plan, gene]


@compiled(error_model="numpy")
def gather(
    plans: Floats,
    lowest: Floats,
    highest: Floats,
    last: Floats,
    num_near: int,
    spread_n: float,
    spread_samples: float,
    draws: Floats,
) -> None:
    """Write plans near what is left of the last one, itself the first of them, and one that does nothing.

    Parameters
    ----------
    plans : (n, G)
        The first of them are written.
    lowest, highest : (G,)
        Bounds of genes.
    last : (G,)
    num_near : int
        How many plans are near the last one.
    spread_n, spread_samples : float
        Standard deviations of forces, N, and of times, samples.
    draws : (num_near, G (NUM_NEAR_DRAWS + 1))
        Numbers from 0 to 1.
    """
    for plan in range(num_near):
        drawn = draws[plan]
        for gene in range(plans.shape[1]):
            value, first = last[gene], gene * (NUM_NEAR_DRAWS + 1)
            # the sum of four has a variance of a third; every other gene stays as it is
            if plan > 0 and drawn[first + NUM_NEAR_DRAWS] < 0.5:
                off = drawn[first] + drawn[first + 1] + drawn[first + 2] + drawn[first + 3] - 2.0
                is_time = 4 * gene >= 3 * (plans.shape[1] + 1)
                value = value + (spread_samples if is_time else spread_n) * np.sqrt(3.0) * off
            plans[plan, gene] = min(highest[gene], max(lowest[gene], value))
    for gene in range(plans.shape[1]):
        plans[num_near, gene] = 0.0


@compiled(error_model="numpy")
def breed(search: PlanSearch, draws: Floats) -> None:
    """Write a mutant of each plan; `draws`, (n, NUM_DRAWS + G), are numbers from 0 to 1."""
    rank(search)
    for plan in range(len(search.plans)):
        mutate(plan, draws[plan], search)


@compiled(error_model="numpy")
def select_cheaper(
    search: PlanSearch,
    num_pushes: int,
    num_lit: int,
    needed: int,
    outlook: Outlook,
    pricing: Pricing,
    is_exact: bool,
) -> None:
    """Price the mutants: each takes the place of its plan if it costs at most as much.

    Where `is_exact`, mutants are priced to the end. See `price_up_to` for the others.
    """
    for plan in range(len(search.plans)):
        price = search.prices[plan]
        limit = np.inf if is_exact else price
        cost = price_up_to(search.mutants[plan], num_pushes, num_lit, needed, outlook, pricing, limit)
        search.costs[plan] = cost
        if cost <= price:
            search.prices[plan] = cost
            for gene in range(search.plans.shape[1]):
                search.plans[plan, gene] = search.mutants[plan, gene]
            if cost < search.cost[0]:
                search.cost[0] = cost
                for gene in range(search.plans.shape[1]):
                    search.best[gene] = search.mutants[plan, gene]


@compiled(nogil=True, error_model="numpy")
def evolve_all(
    search: PlanSearch,
    draws: Floats,
    num_pushes: int,
    num_lit: int,
    needed: int,
    outlook: Outlook,
    pricing: Pricing,
    is_exact: bool,
    genes: Floats,
    costs: Floats,
) -> None:
    """Evolve plans from the first generation on, whose genes are given, and write down what was tried.

    Parameters
    ----------
    search, num_pushes, num_lit, needed, outlook, pricing, is_exact
        As `select_cheaper` takes them.
    draws : (G, n, NUM_DRAWS + 4 pushes - 1)
        Numbers from 0 to 1.
    genes : (G+1, 4 pushes - 1, n)
        All but the first are filled.
    costs : (G+1, n)
        Filled, m/s.
    """
    search, outlook, pricing = borrowed((search, outlook, pricing))
    search.plans[:] = genes[0].T
    begin(search)
    select_cheaper(search, num_pushes, num_lit, needed, outlook, pricing, is_exact)
    costs[0] = search.costs
    for generation in range(len(draws)):
        breed(search, draws[generation])
        select_cheaper(search, num_pushes, num_lit, needed, outlook, pricing, is_exact)
        genes[generation + 1] = search.mutants.T
        costs[generation + 1] = search.costs


def search_of(lowest: Floats, highest: Floats, num_plans: int) -> PlanSearch:
    """Return a search between bounds of genes that has not begun."""
    num_genes = len(lowest)
    return PlanSearch(
        lowest=lowest,
        highest=highest,
        plans=np.empty((num_plans, num_genes)),
        prices=np.empty(num_plans),
        mutants=np.empty((num_plans, num_genes)),
        costs=np.empty(num_plans),
        top=np.zeros(num_best(num_plans), dtype=np.int64),
        best=np.empty(num_genes),
        cost=np.empty(1),
    )


def num_best(num_plans: int) -> int:
    """Return how many of so many plans mutants lead to."""
    return max(2, num_plans // 8)


def bounds_of_plans(outlook: Outlook, num_pushes: int, reach: float) -> tuple[Floats, Floats]:
    """Return the bounds of a plan's genes, (4 num_pushes - 1,), for components up to `reach`, N."""
    num_later = num_pushes - 1
    latest = LATEST_OF_ENDS if outlook.tail.num_after else LATEST
    latest = max(1.0, latest * (len(outlook.free) - 1))
    lowest = np.r_[np.full(3 * num_pushes, -reach), np.zeros(num_later)]
    return lowest, np.r_[np.full(3 * num_pushes, reach), np.full(num_later, latest)]


def first_plans(
    lowest: Floats,
    highest: Floats,
    num_plans: int,
    delta_v_per_force: float,
    generator: np.random.Generator,
    known: Floats,
) -> Floats:
    """Draw the plans that a search begins with, (G, n), between bounds of genes.

    The `known` plans, (m, G), others near them, and doing nothing are among them, if there are any.
    """
    genes = lowest[:, np.newaxis] + (highest - lowest)[:, np.newaxis] * generator.random(
        (len(lowest), num_plans)
    )
    if len(known):
        num_near = int(num_plans * NEAR_SHARE)
        is_time = lowest == 0.0
        spreads = np.where(is_time, NEAR_SAMPLES, NEAR_M_S / delta_v_per_force)
        near = spreads[:, np.newaxis] * generator.standard_normal((len(lowest), num_near))
        near *= generator.random(near.shape) < 0.5
        origins = np.arange(num_near) * len(known) // num_near
        near[:, np.diff(origins, prepend=-1) > 0] = 0.0
        genes[:, :num_near] = np.clip(known[origins].T + near, lowest[:, np.newaxis], highest[:, np.newaxis])
        genes[:, num_near] = 0.0
    return genes


def search_pushes(
    outlook: Outlook,
    num_pushes: int,
    needed: int,
    reach_m_s: float,
    effort: Effort,
    generator: np.random.Generator,
    last: Floats | None = None,
    *,
    is_exact: bool = False,
    is_bare: bool = False,
) -> PushSearch:
    """Search for the cheapest plan, of components up to `reach_m_s`, by which so many points are seen.

    The genes of a `last` plan, those of plans near it, and doing nothing are among the first, if it is given;
    where `is_bare`, they are drawn as on board. Where `is_exact`, all plans are priced to the end, also those
    that are not followed up.
    """
    reach = reach_m_s / outlook.delta_v_per_force
    lowest, highest = bounds_of_plans(outlook, num_pushes, reach)
    genes = np.empty((effort.num_generations + 1, len(lowest), effort.num_plans))
    known = np.empty((0, len(lowest))) if last is None or is_bare else last[np.newaxis]
    genes[0] = first_plans(lowest, highest, effort.num_plans, outlook.delta_v_per_force, generator, known)
    if last is not None and is_bare:
        num_near = int(effort.num_plans * NEAR_SHARE)
        drawn = generator.random((num_near, (NUM_NEAR_DRAWS + 1) * len(lowest)))
        spreads = NEAR_M_S / outlook.delta_v_per_force, NEAR_SAMPLES
        plans = np.ascontiguousarray(genes[0].T)
        gather(plans, lowest, highest, last, num_near, *spreads, drawn)
        genes[0] = plans.T
    draws = generator.random((effort.num_generations, effort.num_plans, NUM_DRAWS + len(lowest)))
    costs = np.empty((effort.num_generations + 1, effort.num_plans))
    if (outlook.normals == outlook.normals[0]).all() and (outlook.points == outlook.points[0]).all():
        outlook = outlook._replace(normals=outlook.normals[:1], points=outlook.points[:1])
    pricing, num_lit = pricing_of(outlook, num_pushes, reach)
    search = search_of(lowest, highest, effort.num_plans)
    evolve_all(search, draws, num_pushes, num_lit, needed, outlook, pricing, is_exact, genes, costs)
    return PushSearch(genes, costs)
