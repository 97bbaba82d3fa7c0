"""Each operator keeps the promise its name makes."""

import math
import random

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from pipeline.training.evolution.genetic import (
    SMALLEST_STEP,
    Individual,
    adapt_step_size,
    adaptive_feasible_mutation,
    poll_directions,
    scattered_crossover,
    select_parents,
    split_population,
)
from tests.pipeline.training.evolution.cases import optimizer

STEPS = [4.0**-k for k in range(14)]


@pytest.mark.parametrize(
    ("size", "split", "expected"),
    [
        (200, "whole", (20, 160, 20)),
        (200, "rest", (20, 144, 36)),
        (10, "whole", (1, 8, 1)),
        (5, "whole", (1, 4, 0)),
    ],
)
def test_split_of_the_population(size, split, expected):
    split = split_population(optimizer(population_size=size, split=split))
    assert (split.elite, split.crossover, split.mutants) == expected


def test_scattered_crossover_takes_each_gene_from_either_parent_half_the_time():
    random.seed(1)
    zeros, ones = Individual([0.0] * 200, 1.0), Individual([1.0] * 200, 2.0)
    children = np.array([scattered_crossover(zeros, ones) for _ in range(400)])
    assert set(np.unique(children)) == {0.0, 1.0}
    # each gene and the whole within five standard deviations of the binomial
    assert abs(children.mean() - 0.5) < 5 * 0.5 / math.sqrt(children.size)
    assert np.all(np.abs(children.mean(axis=0) - 0.5) < 5 * 0.5 / math.sqrt(400))
    # genes are chosen apart from one another: neighbours agree half the time
    assert abs(np.mean(children[:, 1:] == children[:, :-1]) - 0.5) < 0.01
    assert list(zeros) == [0.0] * 200
    assert list(ones) == [1.0] * 200


def test_tournament_of_four_prefers_the_best_as_order_statistics_say():
    random.seed(2)
    population = [Individual([float(rank)], float(rank)) for rank in range(20)]
    ranks = np.array([parent[0] for parent in select_parents(population, 20_000, 4)])
    # rank r wins where the best of four draws is r: ((20-r)^4 - (19-r)^4) / 20^4
    expected = 20_000 * ((20 - np.arange(20.0)) ** 4 - (19 - np.arange(20.0)) ** 4) / 20**4
    observed = np.bincount(ranks.astype(int), minlength=20)
    assert observed[0] > 3000
    # the hindmost win too seldom for a chi-square test, so they count together
    pooled = [np.append(counts[:12], counts[12:].sum()) for counts in (observed, expected)]
    assert stats.chisquare(*pooled).pvalue > 1e-4


def test_step_size_grows_fourfold_to_one_and_shrinks_to_the_root_of_epsilon():
    assert adapt_step_size(1.0, True) == 1.0
    assert adapt_step_size(1 / 64, True) == 1 / 16
    assert adapt_step_size(1.0, False) == 0.25
    step_size = 1.0
    for _ in range(40):
        step_size = adapt_step_size(step_size, False)
    assert step_size == SMALLEST_STEP == math.sqrt(np.finfo(float).eps)


@pytest.mark.parametrize("step_size", STEPS)
def test_poll_directions_are_a_basis_of_the_stated_form(step_size):
    generator = np.random.default_rng(3)
    basis = poll_directions(12, step_size, generator)
    largest = 1 / math.sqrt(step_size)
    assert np.linalg.matrix_rank(basis) == 12
    assert np.abs(basis).max() == largest
    # a permutation of rows keeps the determinant up to sign: the product of the diagonal
    assert np.linalg.slogdet(basis).logabsdet == pytest.approx(12 * math.log(largest), abs=1e-9)
    np.testing.assert_array_equal(basis, np.round(basis))
    # every column has its diagonal entry; all others are smaller
    assert np.all(np.abs(basis).max(axis=0) == largest)
    assert np.sum(np.abs(basis) == largest) == 12


@settings(max_examples=40, deadline=None)
@given(
    genome=st.lists(st.sampled_from([0.0, 1.0, 0.5, 1e-9, 0.3, 0.75]), min_size=1, max_size=12),
    step_size=st.sampled_from(STEPS),
    seed=st.integers(0, 1000),
)
def test_mutants_stay_in_the_box_and_move(genome, step_size, seed):
    parent = np.array(genome)
    mutant = adaptive_feasible_mutation(parent, step_size, np.random.default_rng(seed))
    assert np.all((mutant >= 0.0) & (mutant <= 1.0))
    assert not np.array_equal(mutant, parent)
    # no entry of a direction times the step is longer than the root of the step
    assert np.abs(mutant - parent).max() <= math.sqrt(step_size) + 1e-12


def test_mutants_go_both_ways_along_every_axis():
    generator = np.random.default_rng(5)
    parent = np.full(4, 0.5)
    moves = np.array([adaptive_feasible_mutation(parent, 1 / 16, generator) for _ in range(500)]) - parent
    assert np.all(moves.min(axis=0) == -0.25)
    assert np.all(moves.max(axis=0) == 0.25)
