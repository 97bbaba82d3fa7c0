"""Fronts: what no other individual beats in every objective, by NSGA-II.

NSGA-II (Deb, Pratap, Agarwal and Meyarivan, IEEE Transactions on Evolutionary Computation 6, 2002) with
DEAP's selection: parents and children together are sorted into fronts, and of the last one that fits only in
part the least crowded survive. Children are made by scattered crossover and local mutation. Individuals with
equal objectives survive but once while there are others, as copies make no front, and the one of least
fitness, the champion, always survives.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from deap import base, tools
from numpy.typing import NDArray

from pipeline.array_types import Floats
from pipeline.settings.training import Nsga2
from pipeline.training.evolution.operators import (
    Individual,
    local_mutation,
    scattered_crossover,
    select_uncrowded,
)
from pipeline.training.evolution.state import EvolutionState, drawing

#: prefix of the parts of the fitness that are objectives, to be minimised
OBJECTIVE = "objective_"


@dataclass(frozen=True)
class Front:
    """The nondominated individuals of a population, no two with equal objectives.

    Parameters
    ----------
    genomes : (n, num_genes) array
        By the first objective, ascending.
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


def breed_for_front(state: EvolutionState, settings: Nsga2) -> Floats:
    """Return as many children as there are parents, by crossover first; all mutate; (children, num_genes)."""
    num_crossed = round(settings.crossover_rate * settings.population_size)
    genomes = state.genomes.tolist()
    population = _ranked(objectives_of(state.parts), range(len(genomes)))
    tools.selNSGA2(population, len(population))  # stores the crowding distances
    with drawing(state) as generator:
        chosen: list[Any] = []
        while len(chosen) < num_crossed + settings.population_size:
            chosen += select_uncrowded(population, generator)
        parents = [Individual(genomes[individual.row]) for individual in chosen]
        pairs = zip(parents[: 2 * num_crossed : 2], parents[1 : 2 * num_crossed : 2], strict=True)
        crossed = [scattered_crossover(first, second, generator) for first, second in pairs]
        others = parents[2 * num_crossed : num_crossed + settings.population_size]
        children = [local_mutation(child, state.step_size, generator) for child in (*crossed, *others)]
    return np.array(children)


def survivors(objectives: Floats, fitness: Floats, size: int) -> NDArray[np.int_]:
    """Return the rows of parents and children that survive, ascending.

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
        chosen[-1] = champion  # in place of the most crowded
    return np.sort(chosen)


def front_of(state: EvolutionState) -> Front:
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
    """Return the first row of each set of equal objectives, ascending."""
    return np.sort(np.unique(objectives, axis=0, return_index=True)[1])


def _ranked(objectives: Floats, rows: Any) -> list[Ranked]:
    return [Ranked(int(row), objectives[row].tolist()) for row in rows]
