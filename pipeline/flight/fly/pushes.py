"""Plans of a few pushes: differential evolution (Storn and Price, 1997) over their price.

Mutants lead from each plan towards one of the best eighth, and along the difference of two others
(current-to-pbest: Zhang and Sanderson, JADE, IEEE Transactions on Evolutionary Computation 13(5), 2009). All
randomness is an argument, and sorting is stable, so that a search has the same bits on any number of threads,
compiled or not.
"""

from dataclasses import dataclass, field

import numpy as np

from fis_tools.compiled.decorator import compiled
from pipeline.array_types import Floats
from pipeline.flight.fly.foresight import Outlook, price_pushes

#: share of what is left of a flight after which no push begins; where what follows the end counts
LATEST, LATEST_OF_ENDS = 0.85, 0.99
#: least and greatest weight of a difference, and the share of genes that a mutant has
LEAST_WEIGHT, MOST_WEIGHT, CROSSOVER = 0.3, 0.9, 0.9
#: draws of a mutant besides one for each gene: three other plans, two weights, a gene that it has anyway
NUM_DRAWS = 6
#: of plans near one that is known: their share of the first, spread of their pushes, m/s, and of their times,
#: samples
NEAR_SHARE, NEAR_M_S, NEAR_SAMPLES = 0.75, 0.006, 5.0
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
        Prices, m/s.

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


@compiled(nogil=True, error_model="numpy")
def evolve(
    outlook: Outlook,
    num_pushes: int,
    needed: int,
    lowest: Floats,
    highest: Floats,
    draws: Floats,
    genes: Floats,
    costs: Floats,
) -> None:
    """Evolve plans from the first generation on.

    Parameters
    ----------
    outlook, num_pushes, needed
        As `price_pushes` takes them.
    lowest, highest : (4 pushes - 1,)
        Bounds of the genes.
    draws : (G, plans, NUM_DRAWS + 4 pushes - 1)
        Numbers from 0 to 1.
    genes : (G+1, 4 pushes - 1, plans)
        The first generation is given, the others are filled.
    costs : (G+1, plans)
        Filled, m/s.
    """
    num_genes, num_plans = genes.shape[1], genes.shape[2]
    num_best = max(2, num_plans // 8)
    price_pushes(genes[0], num_pushes, needed, outlook, costs[0])
    plans, prices = genes[0].copy(), costs[0].copy()
    for generation in range(len(draws)):
        order, mutants = np.argsort(prices, kind="mergesort"), genes[generation + 1]
        for plan in range(num_plans):
            drawn = draws[generation, plan]
            best = order[int(drawn[0] * num_best)]
            plus, minus = int(drawn[1] * num_plans), int(drawn[2] * num_plans)
            towards = LEAST_WEIGHT + (MOST_WEIGHT - LEAST_WEIGHT) * drawn[3]
            along = LEAST_WEIGHT + (MOST_WEIGHT - LEAST_WEIGHT) * drawn[4]
            kept = int(drawn[5] * num_genes)
            for gene in range(num_genes):
                value = plans[gene, plan]
                if gene == kept or drawn[NUM_DRAWS + gene] < CROSSOVER:
                    mutant = value + towards * (plans[gene, best] - value)
                    mutant = mutant + along * (plans[gene, plus] - plans[gene, minus])
                    # beyond a bound it goes halfway there
                    if mutant < lowest[gene]:
                        mutant = 0.5 * (lowest[gene] + value)
                    elif mutant > highest[gene]:
                        mutant = 0.5 * (highest[gene] + value)
                    value = mutant
                mutants[gene, plan] = value
        price_pushes(mutants, num_pushes, needed, outlook, costs[generation + 1])
        for plan in range(num_plans):
            if costs[generation + 1, plan] <= prices[plan]:
                prices[plan] = costs[generation + 1, plan]
                plans[:, plan] = mutants[:, plan]


def search_pushes(
    outlook: Outlook,
    num_pushes: int,
    needed: int,
    reach_m_s: float,
    effort: Effort,
    generator: np.random.Generator,
    last: Floats | None = None,
) -> PushSearch:
    """Search for the cheapest plan, of components up to `reach_m_s`, by which so many points are seen.

    The genes of a `last` plan, those of plans near it, and doing nothing are among the first, if it is given.
    """
    num_samples, num_later = len(outlook.free), num_pushes - 1
    reach = reach_m_s / outlook.delta_v_per_force
    latest = max(1.0, (LATEST_OF_ENDS if outlook.tail.num_after else LATEST) * (num_samples - 1))
    lowest = np.r_[np.full(3 * num_pushes, -reach), np.zeros(num_later)]
    highest = np.r_[np.full(3 * num_pushes, reach), np.full(num_later, latest)]
    genes = np.empty((effort.num_generations + 1, len(lowest), effort.num_plans))
    genes[0] = lowest[:, np.newaxis] + (highest - lowest)[:, np.newaxis] * generator.random(genes.shape[1:])
    if last is not None:
        num_near = int(effort.num_plans * NEAR_SHARE)
        spreads = np.r_[
            np.full(3 * num_pushes, NEAR_M_S / outlook.delta_v_per_force), np.full(num_later, NEAR_SAMPLES)
        ]
        near = spreads[:, np.newaxis] * generator.standard_normal((len(lowest), num_near))
        near *= generator.random(near.shape) < 0.5
        near[:, 0] = 0.0
        genes[0, :, :num_near] = np.clip(
            last[:, np.newaxis] + near, lowest[:, np.newaxis], highest[:, np.newaxis]
        )
        genes[0, :, num_near] = 0.0
    draws = generator.random((effort.num_generations, effort.num_plans, NUM_DRAWS + len(lowest)))
    costs = np.empty((effort.num_generations + 1, effort.num_plans))
    evolve(outlook, num_pushes, needed, lowest, highest, draws, genes, costs)
    return PushSearch(genes, costs)
