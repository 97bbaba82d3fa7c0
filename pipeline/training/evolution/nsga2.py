"""NSGA-II: evolution of a front of nondominated individuals.

NSGA-II (Deb, Pratap, Agarwal and Meyarivan, IEEE Transactions on Evolutionary Computation 6, 2002), DEAP's
selection: parents and children together are sorted into fronts, and of the last front that fits only in part
the least crowded survive. Children are made as in `pipeline.training.evolution.genetic`, by scattered
crossover and local mutation. Individuals with equal objectives survive only once while there are others, as
a population of copies is not a front; and the one of least fitness, the champion, always survives.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from deap import base, tools
from numpy.typing import NDArray

from pipeline.array_types import Floats
from pipeline.settings.experiment import Optimizer
from pipeline.training.evolution.genetic import Individual, lent_random, local_mutation, scattered_crossover
from pipeline.training.evolution.state import State

#: prefix of the parts of the fitness that are objectives, to be minimised
OBJECTIVE = "objective_"


@dataclass(frozen=True)
class Front:
    """The nondominated individuals of a population, no two with equal objectives.

    Parameters
    ----------
    genomes : (n, num_genes) array
        Sorted by the first objective, ascending.
    fitness : (n,) array
    parts : mapping of str to (n,) array
        Including the objectives.
    """

    genomes: Floats
    fitness: Floats
    parts: Mapping[str, Floats]


class Objectives(base.Fitness):  # type: ignore[misc]
    """Values to be minimised; DEAP stores the crowding distance with them."""

    def __init__(self, values: Sequence[float]) -> None:
        self.weights = (-1.0,) * len(values)
        super().__init__(values)


class Ranked:
    """A row of a population with its objectives, for DEAP to select."""

    def __init__(self, row: int, objectives: Sequence[float]) -> None:
        self.row = row
        self.fitness = Objectives(objectives)


def objectives_of(parts: Mapping[str, Floats]) -> Floats:
    """Return the objectives among the parts of a fitness, shape (n, num_objectives).

    Raises
    ------
    ValueError
        If there are fewer than two, or one is not finite.
    """
    names = [name for name in parts if name.startswith(OBJECTIVE)]
    if len(names) < 2 or not all(np.all(np.isfinite(parts[name])) for name in names):
        raise ValueError(
            f"the fitness function returned the parts {sorted(parts)}; for a front, two or more of them "
            f"must be finite and have names that begin with {OBJECTIVE!r}"
        )
    return np.column_stack([parts[name] for name in names])


def breed(state: State, settings: Optimizer) -> Floats:
    """Return as many children as there are parents, by crossover first; all mutate; (children, num_genes)."""
    num_children = settings.population_size
    num_crossed = round(settings.crossover_rate * num_children)
    genomes = state.genomes.tolist()
    with lent_random(state):
        rows = _select_parents(objectives_of(state.parts), num_crossed + num_children)
        parents = [Individual(genomes[row]) for row in rows]
        pairs = zip(parents[: 2 * num_crossed : 2], parents[1 : 2 * num_crossed : 2], strict=True)
        crossed = [scattered_crossover(first, second) for first, second in pairs]
        children = [local_mutation(child, state.step_size) for child in crossed + parents[2 * num_crossed :]]
    return np.array(children)


def _select_parents(objectives: Floats, num_parents: int) -> list[int]:
    """Choose rows in tournaments of two: the dominating one wins, else the less crowded one."""
    population = _ranked(objectives, range(len(objectives)))
    tools.selNSGA2(population, len(population))  # stores the crowding distances
    # DEAP takes four at a time, none more than twice
    at_once = len(population) - len(population) % 4
    chosen: list[Any] = []
    while len(chosen) < num_parents:
        chosen += tools.selTournamentDCD(population, at_once)
    return [individual.row for individual in chosen[:num_parents]]


def survivors(objectives: Floats, fitness: Floats, size: int) -> NDArray[np.int_]:
    """Return the rows of parents and children that survive, in ascending order.

    Parameters
    ----------
    objectives : (n, num_objectives) array
    fitness : (n,) array
    size : int
        Number of survivors; at most n.
    """
    first = _first_of_their_kind(objectives)
    if len(first) <= size:
        others = np.setdiff1d(np.arange(len(objectives)), first)
        return np.sort(np.concatenate((first, others[: size - len(first)])))
    chosen = [individual.row for individual in tools.selNSGA2(_ranked(objectives, first), size)]
    champion = int(first[np.argmin(fitness[first])])
    if champion not in chosen:
        # replaces the most crowded
        chosen[-1] = champion
    return np.sort(chosen)


def front_of(state: State) -> Front:
    """Return the front of a population."""
    objectives = objectives_of(state.parts)
    first = _first_of_their_kind(objectives)
    best = tools.sortNondominated(_ranked(objectives, first), len(first), first_front_only=True)[0]
    rows = np.array([individual.row for individual in best])
    rows = rows[np.argsort(objectives[rows, 0], kind="stable")]
    return Front(
        state.genomes[rows], state.fitness[rows], {name: part[rows] for name, part in state.parts.items()}
    )


def _first_of_their_kind(objectives: Floats) -> NDArray[np.int_]:
    """Return the first row of each set of equal objectives, in ascending order."""
    return np.sort(np.unique(objectives, axis=0, return_index=True)[1])


def _ranked(objectives: Floats, rows: Any) -> list[Ranked]:
    return [Ranked(int(row), objectives[row].tolist()) for row in rows]
