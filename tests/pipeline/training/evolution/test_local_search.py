"""The genetic algorithm near a controller: local mutants, populations carried from round to round."""

import random

import numpy as np
import pytest

from pipeline.training.evolution.genetic import local_mutation
from pipeline.training.evolution.rounds import evolve_rounds
from tests.pipeline.training.evolution.cases import (
    Sphere,
    column,
    evolve,
    optimizer,
    round_champions,
)

NUM_GENES = 10

LOCAL = {"mutation": "local", "first_population": "near", "initial_step": 0.05, "elitism_rate": 0.5}


BEGUN = np.full((1, NUM_GENES), 0.6)


def local(**changes):
    return optimizer(**(LOCAL | {"split": "rest", "crossover_rate": 0.4} | changes))


def test_a_local_mutant_moves_few_genes_a_little_and_stays_in_the_box() -> None:
    random.seed(3)
    parent = [0.0, 1.0] * 200
    mutants = np.array([local_mutation(parent, 0.1) for _ in range(300)])
    moved = mutants != parent
    # half of the steps at an edge lead out of the box and stop there: shares of 1, 3 and 10 % halve
    assert 0.5 * 0.01 < moved.mean() < 0.5 * 0.14 / 3 * 1.3
    assert mutants.min() == 0.0
    assert mutants.max() == 1.0
    assert np.abs(mutants - parent)[moved].mean() < 0.2


def test_the_first_population_lies_near_the_seed() -> None:
    sphere = Sphere()
    evolve(sphere, NUM_GENES, local(generations=1), seed=1, initial=BEGUN)
    first = sphere.batches[0]
    assert first.shape == (40, NUM_GENES)
    np.testing.assert_array_equal(first[0], 0.6)
    assert 0 < np.abs(first - 0.6).max() < 0.5
    assert (first == 0.6).mean() > 0.7


def test_it_converges_and_children_of_crossover_mutate_too() -> None:
    sphere = Sphere()
    result = evolve(sphere, NUM_GENES, local(generations=300), seed=2, initial=BEGUN)
    assert result.history[-1].best < 1e-3
    known = np.unique(np.concatenate(sphere.batches[:1]))
    assert not np.isin(sphere.batches[1][:8], known).all()


def test_a_carried_round_judges_the_population_anew_by_its_own_fitness() -> None:
    spheres = [Sphere(0.2), Sphere(0.8)]
    settings = local(generations=10, rounds=2, next_round="carried", cooling=0.5)
    result = evolve_rounds(lambda index, _: spheres[index], NUM_GENES, settings, seed=3, initial=BEGUN)
    carried = spheres[1].batches[0]
    assert carried.shape == (40, NUM_GENES)
    ends = [generation for generation in result.history if generation.round == 0][-1]
    assert (carried == ends.champion).all(axis=1).any()
    squares = ((carried - 0.8) ** 2).sum(axis=1)
    begins = result.history[11]
    assert (begins.round, begins.generation) == (1, 0)
    assert begins.best == pytest.approx(squares.min(), rel=1e-12)
    steps = column(result, "step_size")
    assert (steps[0], steps[11]) == (0.05, 0.025)


def test_the_champion_of_the_round_before_is_handed_to_the_next() -> None:
    handed = []

    def fitness(index, champion):
        handed.append((index, None if champion is None else champion.copy()))
        return Sphere()

    settings = local(generations=4, rounds=3, next_round="carried")
    result = evolve_rounds(fitness, NUM_GENES, settings, seed=4, initial=BEGUN)
    assert handed[0] == (0, None)
    for index in (1, 2):
        np.testing.assert_array_equal(handed[index][1], round_champions(result)[index - 1])
