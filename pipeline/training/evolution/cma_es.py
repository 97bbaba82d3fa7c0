"""CMA-ES: samples around a centre that moves towards the better ones.

CMA-ES (Hansen and Ostermeier, Evolutionary Computation 9, 2001), DEAP's `deap.cma`. Genes are sampled
unbounded; the nearest point of [0, 1] is evaluated, and the distance to it is added to the fitness that
the strategy sees, so that it does not drift away from the box. DEAP draws from NumPy's global generator: it
temporarily gets a state of ours, and the caller's is restored.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
from deap import cma

from pipeline.array_types import Floats
from pipeline.settings.experiment import Optimizer
from pipeline.training.evolution.genetic import Individual
from pipeline.training.evolution.state import State

#: state that `deap.cma.Strategy` carries between generations; the rest follows from it
CARRIED = ("centroid", "sigma", "C", "ps", "pc", "update_count")


def begin(centre: Floats, settings: Optimizer) -> dict[str, Floats]:
    """Return the strategy before its first sample, around a genome."""
    return _carried(
        cma.Strategy(
            centroid=centre.copy(), sigma=settings.initial_step, lambda_=settings.population_size - 1
        )
    )


def sample(state: State, settings: Optimizer) -> Floats:
    """Draw a population, unbounded, with the centre itself first; shape (population_size, num_genes)."""
    strategy = _restored(state.strategy, settings)
    with _lent_global_random(state.generator):
        drawn = strategy.generate(Individual)
    return np.vstack([strategy.centroid, *drawn])


def learn(state: State, settings: Optimizer, drawn: Floats, fitness: Floats) -> None:
    """Update the strategy of a state from the fitness of its samples, except that of the centre."""
    strategy = _restored(state.strategy, settings)
    outside = np.sum(np.abs(drawn - np.clip(drawn, 0.0, 1.0)), axis=1)
    judged = fitness + outside * (np.ptp(fitness) + 1e-12)
    strategy.update(
        [Individual(genes.tolist(), float(value)) for genes, value in zip(drawn[1:], judged[1:], strict=True)]
    )
    state.strategy = _carried(strategy)


def _carried(strategy: Any) -> dict[str, Floats]:
    return {name: np.array(getattr(strategy, name), dtype=np.float64) for name in CARRIED}


def _restored(carried: dict[str, Floats], settings: Optimizer) -> Any:
    """Rebuild the strategy; its axes follow from its covariance, as after DEAP's update."""
    strategy = cma.Strategy(
        centroid=carried["centroid"].copy(),
        sigma=float(carried["sigma"]),
        lambda_=settings.population_size - 1,
    )
    for name in CARRIED:
        value = carried[name]
        setattr(strategy, name, float(value) if value.ndim == 0 else value.copy())
    lengths, axes = np.linalg.eigh(strategy.C)
    order = np.argsort(lengths)
    strategy.cond = lengths[order[-1]] / lengths[order[0]]
    strategy.diagD = lengths[order] ** 0.5
    strategy.B = axes[:, order]
    strategy.BD = strategy.B * strategy.diagD
    return strategy


@contextmanager
def _lent_global_random(generator: np.random.Generator) -> Iterator[None]:
    """Seed NumPy's global generator from ours, and restore the caller's afterwards."""
    callers = np.random.get_state()  # noqa: NPY002
    np.random.seed(int(generator.integers(2**32)))  # noqa: NPY002
    try:
        yield
    finally:
        np.random.set_state(callers)  # noqa: NPY002
