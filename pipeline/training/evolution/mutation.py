"""Adaptive feasible mutation: a random step along a direction that stays in the box of genes.

The operator of MATLAB's Global Optimization Toolbox (``mutationadaptfeasible``), on genes scaled to [0, 1].
"""

import math
from typing import cast

import numpy as np

from pipeline.array_types import Floats

LARGEST_STEP = 1.0
SMALLEST_STEP = math.sqrt(np.finfo(np.float64).eps)
STEP_FACTOR = 4.0


def adapt_step_size(step_size: float, has_improved: bool) -> float:
    """Return four times the step (at most 1) after success, else a quarter (at least sqrt(eps))."""
    if has_improved:
        return min(LARGEST_STEP, step_size * STEP_FACTOR)
    return max(SMALLEST_STEP, step_size / STEP_FACTOR)


def poll_directions(num_genes: int, step_size: float, generator: np.random.Generator) -> Floats:
    """Return a random basis of a mesh-adaptive direct search.

    A lower triangular matrix with diagonal ±1/sqrt(step) and, below it, integers of smaller magnitude, its
    rows in random order: the LTMADS basis of Audet and Dennis, "Mesh adaptive direct search
    algorithms for constrained optimization", SIAM J. Optim. 17 (2006), section 4.1.

    Returns
    -------
    (num_genes, num_genes) array
        One direction per column.
    """
    largest = round(1.0 / math.sqrt(step_size))
    basis = np.tril(generator.integers(1 - largest, largest, (num_genes, num_genes)), -1).astype(np.float64)
    np.fill_diagonal(basis, largest * generator.choice((-1.0, 1.0), num_genes))
    return basis[generator.permutation(num_genes)]


def adaptive_feasible_mutation(genome: Floats, step_size: float, generator: np.random.Generator) -> Floats:
    """Return a genome moved along a random direction that keeps it in the box [0, 1].

    Directions ± the columns of `poll_directions` are tried in random order and the first feasible one wins,
    so all feasible ones are equally likely. If none is feasible, the step of this mutant is
    shortened ("the mutation chooses a direction and step length that satisfies bounds", MATLAB's
    documentation): from a quarter on a direction along one axis always fits.

    Parameters
    ----------
    genome : (num_genes,) array
    step_size : float
        In (0, 1].
    generator : numpy Generator

    Returns
    -------
    (num_genes,) array
        A new genome, in [0, 1].
    """
    steps = poll_directions(genome.size, step_size, generator).T * step_size
    room_above = 1.0 - genome
    forward = np.all((steps <= room_above) & (steps >= -genome), axis=1)
    backward = np.all((steps <= genome) & (steps >= -room_above), axis=1)
    feasible = np.flatnonzero(np.concatenate((forward, backward)))
    if feasible.size == 0:
        return adaptive_feasible_mutation(genome, step_size / STEP_FACTOR, generator)
    sign, index = divmod(int(generator.choice(feasible)), genome.size)
    # rounding may put the sum outside the box
    return cast(Floats, np.clip(genome + (steps[index] if sign == 0 else -steps[index]), 0.0, 1.0))
