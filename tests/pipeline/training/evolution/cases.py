"""Small evolutions for the tests."""

from typing import Any

import numpy as np

from pipeline.settings.experiment import Optimizer
from pipeline.settings.training import Penalty
from pipeline.training.evolution.generations import Evaluate
from pipeline.training.evolution.rounds import Evolution, evolve_rounds

NUM_GENES = 10
PENALTY = Penalty(outside_m_s=100.0, short_point_m_s=10.0, missed_point_m_s=0.1)


def optimizer(**changes: Any) -> Optimizer:
    """The paper's rates at a size that runs in a moment."""
    small = {"population_size": 40, "generations": 30, "penalty": PENALTY, "workers": 1}
    return Optimizer(**(small | changes))


def evolve(evaluate: Evaluate, settings: Optimizer, seed: int, **how: Any) -> Evolution:
    """Evolve with one fitness function for all rounds."""
    return evolve_rounds(lambda _round, _champion: evaluate, NUM_GENES, settings, seed, **how)


def rows_of(evolution: Evolution) -> list[dict[str, Any]]:
    """Return each generation as plain numbers, with the parts of its champion's fitness."""
    return [{**generation.row(), **generation.parts} for generation in evolution.history]


def column(evolution: Evolution, name: str) -> list[Any]:
    """Return one number of each generation."""
    return [row[name] for row in rows_of(evolution)]


class Sphere:
    """Squared distance from a point, with a count of what was asked."""

    def __init__(self, centre: float = 0.3) -> None:
        self.centre = centre
        self.batches: list[np.ndarray] = []

    def __call__(self, genomes: np.ndarray) -> dict[str, np.ndarray]:
        self.batches.append(genomes.copy())
        squares = (genomes - self.centre) ** 2
        return {"fitness": squares.sum(axis=1), "first": squares[:, 0], "others": squares[:, 1:].sum(axis=1)}
