"""The results of a generation, and everything that the next one depends on."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from pipeline.array_types import Floats


@dataclass(frozen=True, kw_only=True)
class Generation:
    """Results of an evaluated generation.

    Parameters
    ----------
    round : int
        From 0.
    generation : int
        Within the round; 0 is the initial population.
    evaluations : int
        Individuals evaluated since the beginning, all rounds together.
    best, mean, std : float
        Fitness over the population; std with ddof = 1.
    step_size : float
        Of the mutation that produced it.
    parts : mapping of str to float
        The champion's fitness parts.
    champion : (num_genes,) array
        The genome of the best individual.
    """

    round: int
    generation: int
    evaluations: int
    best: float
    mean: float
    std: float
    step_size: float
    parts: Mapping[str, float]
    champion: Floats

    def row(self) -> dict[str, Any]:
        """Return everything except the genome and the parts, by name."""
        names = ("round", "generation", "evaluations", "best", "mean", "std", "step_size")
        return {name: getattr(self, name) for name in names}


@dataclass
class State:
    """Everything the next generation depends on.

    Parameters
    ----------
    round, generation, evaluations : int
        As in `Generation`.
    step_size : float
        Of the next mutation, before it adapts.
    genomes : (population_size, num_genes) array
    fitness : (population_size,) array
    parts : dict of str to (population_size,) array
    python_state : tuple
        Of Python's random generator, from `random.getstate`.
    generator : numpy Generator
        PCG64.
    strategy : dict of str to array
        State of CMA-ES; empty for the other algorithms.
    history : list of Generation
        All generations so far.
    """

    round: int
    generation: int
    evaluations: int
    step_size: float
    genomes: Floats
    fitness: Floats
    parts: dict[str, Floats]
    python_state: tuple[Any, ...]
    generator: np.random.Generator
    strategy: dict[str, Floats] = field(default_factory=dict)
    history: list[Generation] = field(default_factory=list)
