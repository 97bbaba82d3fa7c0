"""Each operator keeps the promise its name makes."""

import itertools
import math
import random

import numpy as np
import pytest
from deap import tools
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from pipeline.training.evolution import generations, operators
from pipeline.training.evolution.rounds import evolve_rounds
from tests.pipeline.training.evolution.cases import NUM_GENES, Sphere, column, evolve, optimizer, rows_of

STEPS = [4.0**-k for k in range(14)]


@pytest.mark.parametrize(
    ("size", "split", "expected"),
    [(200, "whole", (20, 160, 20)), (200, "rest", (20, 144, 36)), (5, "whole", (1, 4, 0))],
)
def test_split_of_the_population(size, split, expected):
    split = generations.split_population(optimizer(population_size=size, split=split))
    assert (split.elite, split.crossover, split.mutants) == expected


def test_scattered_crossover_takes_each_gene_from_either_parent_half_the_time():
    generator = random.Random(1)  # noqa: S311
    zeros = operators.Individual([0.0] * 200, 1.0)
    ones = operators.Individual([1.0] * 200, 2.0)
    children = np.array([operators.scattered_crossover(zeros, ones, generator) for _ in range(400)])
    assert set(np.unique(children)) == {0.0, 1.0}
    # each gene and the whole within five standard deviations of the binomial
    assert abs(children.mean() - 0.5) < 5 * 0.5 / math.sqrt(children.size)
    assert np.all(np.abs(children.mean(axis=0) - 0.5) < 5 * 0.5 / math.sqrt(400))
    # genes are chosen apart from one another: neighbours agree half the time
    assert abs(np.mean(children[:, 1:] == children[:, :-1]) - 0.5) < 0.01
    assert (list(zeros), list(ones)) == ([0.0] * 200, [1.0] * 200)


def test_they_draw_as_deaps_own_do_from_the_global_generator():
    """The same numbers, in the same order: checkpoints and champions of earlier versions stay."""
    genes = np.random.default_rng(4).random((12, 30))
    population = [operators.Individual(row.tolist(), float(row.sum())) for row in genes]
    random.seed(8)
    generator = random.Random()  # noqa: S311
    generator.setstate(random.getstate())
    theirs = tools.selTournament(population, 50, 3)
    ours = operators.select_parents(population, 50, 3, generator)
    assert [id(parent) for parent in ours] == [id(parent) for parent in theirs]
    child, _ = tools.cxUniform(operators.Individual(population[0]), operators.Individual(population[1]), 0.5)
    assert operators.scattered_crossover(population[0], population[1], generator) == child
    share, scale = (random.choice(values) for values in (operators.LOCAL_SHARES, operators.LOCAL_STEPS))  # noqa: S311
    (mutant,) = tools.mutGaussian(operators.Individual(population[2]), 0.0, scale * 0.7, share)
    expected = [min(1.0, max(0.0, gene)) for gene in mutant]
    assert operators.local_mutation(population[2], 0.7, generator) == expected
    assert generator.getstate() == random.getstate()


def test_a_sample_of_cma_es_is_deaps_own():
    settings, centre = cma(), np.linspace(0.1, 0.9, NUM_GENES)
    strategy = generations._strategy(centre, 0.3, settings)
    state = generations.EvolutionState(
        0,
        0.3,
        np.empty((0, NUM_GENES)),
        (),
        np.random.default_rng(6),
        strategy=generations._carried(strategy),
    )
    drawn = generations.sample_strategy(state, settings)
    np.random.seed(int(np.random.default_rng(6).integers(2**32)))  # noqa: NPY002
    np.testing.assert_array_equal(drawn, [centre, *strategy.generate(list)])


def test_tournament_of_four_prefers_the_best_as_order_statistics_say():
    generator = random.Random(2)  # noqa: S311
    population = [operators.Individual([float(rank)], float(rank)) for rank in range(20)]
    ranks = np.array([parent[0] for parent in operators.select_parents(population, 20_000, 4, generator)])
    # rank r wins where the best of four draws is r: ((20-r)^4 - (19-r)^4) / 20^4
    expected = 20_000 * ((20 - np.arange(20.0)) ** 4 - (19 - np.arange(20.0)) ** 4) / 20**4
    observed = np.bincount(ranks.astype(int), minlength=20)
    assert observed[0] > 3000
    # the hindmost win too seldom for a chi-square test, so they count together
    pooled = [np.append(counts[:12], counts[12:].sum()) for counts in (observed, expected)]
    assert stats.chisquare(*pooled).pvalue > 1e-4


def test_step_size_grows_fourfold_to_one_and_shrinks_to_the_root_of_epsilon():
    assert operators.adapt_step_size(1.0, True) == 1.0
    assert operators.adapt_step_size(1 / 64, True) == 1 / 16
    assert operators.adapt_step_size(1.0, False) == 0.25
    step_size = 1.0
    for _ in range(40):
        step_size = operators.adapt_step_size(step_size, False)
    assert step_size == operators.SMALLEST_STEP == math.sqrt(np.finfo(float).eps)


@pytest.mark.parametrize("step_size", STEPS)
def test_poll_directions_are_a_basis_of_the_stated_form(step_size):
    basis = operators.poll_directions(12, step_size, np.random.default_rng(3))
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
    mutant = operators.adaptive_feasible_mutation(parent, step_size, np.random.default_rng(seed))
    assert np.all((mutant >= 0.0) & (mutant <= 1.0))
    assert not np.array_equal(mutant, parent)
    # no entry of a direction times the step is longer than the root of the step
    assert np.abs(mutant - parent).max() <= math.sqrt(step_size) + 1e-12


def test_mutants_go_both_ways_along_every_axis():
    generator = np.random.default_rng(5)
    parent = np.full(4, 0.5)
    mutants = [operators.adaptive_feasible_mutation(parent, 1 / 16, generator) for _ in range(500)]
    np.testing.assert_array_equal(np.min(mutants, axis=0), 0.25)
    np.testing.assert_array_equal(np.max(mutants, axis=0), 0.75)


def begun(at: float) -> np.ndarray:
    return np.full((1, NUM_GENES), at)


LOCAL = {"mutation": "local", "first_population": "near", "initial_step": 0.05, "elitism_rate": 0.5}


def local(**changes):
    return optimizer(**(LOCAL | {"split": "rest", "crossover_rate": 0.4} | changes))


def test_a_local_mutant_moves_few_genes_a_little_and_stays_in_the_box() -> None:
    generator = random.Random(3)  # noqa: S311
    parent = [0.0, 1.0] * 200
    mutants = np.array([operators.local_mutation(parent, 0.1, generator) for _ in range(300)])
    moved = mutants != parent
    # half of the steps at an edge lead out of the box and stop there: shares of 1, 3 and 10 % halve
    assert 0.5 * 0.01 < moved.mean() < 0.5 * 0.14 / 3 * 1.3
    assert (mutants.min(), mutants.max()) == (0.0, 1.0)
    assert np.abs(mutants - parent)[moved].mean() < 0.2


def test_the_first_population_lies_near_the_seed() -> None:
    sphere = Sphere()
    evolve(sphere, local(generations=1), seed=1, initial=begun(0.6))
    first = sphere.batches[0]
    assert first.shape == (40, NUM_GENES)
    np.testing.assert_array_equal(first[0], 0.6)
    assert 0 < np.abs(first - 0.6).max() < 0.5
    assert (first == 0.6).mean() > 0.7


def test_it_converges_and_children_of_crossover_mutate_too() -> None:
    sphere = Sphere()
    result = evolve(sphere, local(generations=300), seed=2, initial=begun(0.6))
    assert result.history[-1].best < 1e-3
    assert not np.isin(sphere.batches[1][:8], sphere.batches[0]).all()


def test_a_carried_round_gets_the_champion_and_judges_the_population_anew_by_its_own_fitness() -> None:
    spheres = [Sphere(0.2), Sphere(0.8)]
    handed = []

    def fitness(index, champion):
        handed.append(champion)
        return spheres[index]

    settings = local(generations=10, rounds=2, next_round="carried", cooling=0.5)
    result = evolve_rounds(fitness, NUM_GENES, settings, seed=3, initial=begun(0.6))
    carried = spheres[1].batches[0]
    ends, begins = result.history[10:12]
    assert (ends.round, begins.round, begins.generation) == (0, 1, 0)
    assert handed[0] is None
    np.testing.assert_array_equal(handed[1], ends.champion)
    assert carried.shape == (40, NUM_GENES)
    assert (carried == ends.champion).all(axis=1).any()
    assert begins.best == pytest.approx(((carried - 0.8) ** 2).sum(axis=1).min(), rel=1e-12)
    assert (result.history[0].step_size, begins.step_size) == (0.05, 0.025)


def cma(**changes):
    values = {"algorithm": "cma_es", "population_size": 13, "generations": 60, "initial_step": 0.2}
    return optimizer(**(values | changes))


def ellipsoid(genomes: np.ndarray) -> dict[str, np.ndarray]:
    """Axes a thousand times as steep as one another, turned: only a learnt covariance gets far."""
    turned = (genomes - 0.4) @ np.linalg.qr(np.random.default_rng(5).normal(size=(NUM_GENES, NUM_GENES)))[0]
    return {"fitness": (turned**2 * np.logspace(0, 6, NUM_GENES)).sum(axis=1)}


def test_it_learns_the_covariance_of_a_turned_ellipsoid() -> None:
    learnt = evolve(ellipsoid, cma(generations=600), seed=1, initial=begun(0.6))
    np.testing.assert_allclose(learnt.history[-1].champion, 0.4, atol=1e-6)


def test_the_centre_comes_first_and_is_the_champion() -> None:
    sphere = Sphere()
    result = evolve(sphere, cma(), seed=2, initial=begun(0.7))
    np.testing.assert_array_equal(sphere.batches[0][0], 0.7)
    for generation, batch in zip(result.history, sphere.batches, strict=True):
        assert batch.shape == (13, NUM_GENES)
        np.testing.assert_array_equal(generation.champion, batch[0])
    assert result.history[-1].best < 1e-3 * result.history[0].best


def test_what_is_judged_stays_in_the_box_and_an_optimum_on_its_edge_is_found() -> None:
    sphere = Sphere(centre=-0.2)
    result = evolve(sphere, cma(generations=150), seed=3, initial=begun(0.5))
    judged = np.concatenate(sphere.batches)
    assert 0.0 <= judged.min() <= judged.max() <= 1.0
    np.testing.assert_allclose(result.history[-1].champion, 0.0, atol=0.02)


@pytest.mark.parametrize("kind", ["genetic", "afresh", "carried"])
def test_interrupted_anywhere_and_resumed_it_equals_the_whole(kind: str, tmp_path) -> None:
    rounds = {"generations": 5, "rounds": 3}
    settings = optimizer(**rounds) if kind == "genetic" else cma(**rounds, next_round=kind)
    spheres = [Sphere(0.2), Sphere(0.4), Sphere(0.6)]

    def run(limit=None, **how):
        num_calls = itertools.count()

        def fitness(index, _):
            def evaluate(genomes):
                if next(num_calls) == limit:
                    raise KeyboardInterrupt
                return spheres[index](genomes)

            return evaluate

        return evolve_rounds(fitness, NUM_GENES, settings, seed=7, initial=begun(0.5), **how)

    whole = run()
    for stop in (1, 5, 7, 12):
        first = run(stop, checkpoint=tmp_path / f"{stop}.npz")
        assert first.interrupted
        assert len(first.history) == stop
        rest = run(checkpoint=tmp_path / f"{stop}.npz", resume=True)
        assert rows_of(rest) == rows_of(whole)
        np.testing.assert_array_equal(rest.history[-1].champion, whole.history[-1].champion)


def test_a_carried_round_goes_on_with_its_steps_and_a_fresh_one_begins_anew() -> None:
    fresh, carried = (
        evolve(Sphere(), cma(generations=40, rounds=2, next_round=kind), 8, initial=begun(0.5))
        for kind in ("afresh", "carried")
    )
    assert column(fresh, "step_size")[41] == 0.2
    steps = column(carried, "step_size")
    assert steps[41] < 0.5 * 0.2
    assert 0.5 < steps[41] / steps[40] < 2.0
