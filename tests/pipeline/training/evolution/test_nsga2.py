"""NSGA-II: fronts known in closed form, survivors by brute force, and a seed that is all that decides."""

import random

import numpy as np
import pytest

from pipeline.settings.checks import SettingError
from pipeline.training.evolution.genetic import OBJECTIVE, survivors
from pipeline.training.evolution.rounds import evolve_rounds
from tests.pipeline.training.evolution.cases import (
    broken_and_resumed,
    evolve,
    optimizer,
    rows_of,
)

pytestmark = pytest.mark.slow

NUM_GENES = 5

BEGUN = np.full((1, NUM_GENES), 0.9)


def nsga2(**changes):
    values = {"algorithm": "nsga2", "mutation": "local", "first_population": "near", "population_size": 22}
    values |= {"generations": 40, "crossover_rate": 0.5, "split": "rest", "validation_cases": 1}
    return optimizer(**(values | changes))


def judged(first: np.ndarray, second: np.ndarray) -> dict[str, np.ndarray]:
    """Two objectives, and one of many ways to weigh them."""
    return {
        "fitness": first + second,
        f"{OBJECTIVE}a": first,
        "aside": first - second,
        f"{OBJECTIVE}b": second,
    }


def schaffer(genomes: np.ndarray, shift: float = 0.0) -> dict[str, np.ndarray]:
    """Squared distances from (0, ..., 0) and (2, ..., 2): the front is the segment between them."""
    places = 6.0 * genomes - 2.0 - shift
    return judged((places**2).mean(axis=1), ((places - 2.0) ** 2).mean(axis=1))


def zdt1(genomes: np.ndarray) -> dict[str, np.ndarray]:
    """Zitzler, Deb and Thiele's first: the front is 1 - sqrt(f), where all genes but the first are zero."""
    first, slope = genomes[:, 0], 1.0 + 9.0 * genomes[:, 1:].mean(axis=1)
    return judged(first, slope * (1.0 - np.sqrt(first / slope)))


def objectives(parts) -> np.ndarray:
    return np.column_stack([parts[f"{OBJECTIVE}a"], parts[f"{OBJECTIVE}b"]])


def dominates(one, other) -> bool:
    return all(one <= other) and any(one < other)


def is_dominated(row, rows) -> bool:
    return any(dominates(other, row) for other in rows)


def test_schaffers_front_is_found_from_end_to_end() -> None:
    front = evolve(schaffer, NUM_GENES, nsga2(generations=400), seed=1, initial=BEGUN).front
    first, second = np.sqrt(objectives(front.parts)).T
    assert len(first) == 22
    # the triangle: no point is nearer to both ends; the first population comes to 4.8
    assert (first + second).min() >= 2.0 - 1e-12
    np.testing.assert_allclose(first + second, 2.0, atol=0.2)
    assert first.min() < 0.1
    assert second.min() < 0.1
    assert np.diff(first).max() < 0.3


def test_zdt1s_front_is_found_on_the_edge_of_the_box() -> None:
    front = evolve(zdt1, NUM_GENES, nsga2(generations=200), seed=2, initial=BEGUN).front
    first, second = objectives(front.parts).T
    np.testing.assert_allclose(second, 1.0 - np.sqrt(first), atol=0.05)
    assert first.min() < 0.05
    assert first.max() > 0.8


def test_a_front_is_what_nothing_dominates_in_order_and_without_copies() -> None:
    front = evolve(schaffer, NUM_GENES, nsga2(generations=3), seed=3, initial=BEGUN).front
    rows = objectives(front.parts)
    assert len(np.unique(rows, axis=0)) == len(rows)
    assert not any(is_dominated(row, rows) for row in rows)
    assert (np.diff(rows[:, 0]) > 0).all()
    np.testing.assert_array_equal(objectives(schaffer(front.genomes)), rows)
    np.testing.assert_array_equal(front.fitness, rows.sum(axis=1))


@pytest.mark.parametrize("seed", range(6))
def test_those_that_nothing_dominates_survive_first_and_the_champion_always(seed: int) -> None:
    generator = np.random.default_rng(seed)
    # few values, so that there are equals
    rows = generator.integers(0, 9, (30, 2)).astype(float)
    fitness = generator.random(30)
    kinds, first = np.unique(rows, axis=0, return_index=True)
    size = len(kinds) - 6
    kept = survivors(rows, fitness, size)
    assert len(kept) == len(set(kept.tolist())) == size
    assert set(kept) <= set(first)
    champion = first[np.argmin(fitness[first])]
    assert champion in kept
    left = [row for row in first if row not in kept]
    for row in kept:
        if row != champion:
            assert not any(dominates(rows[other], rows[row]) for other in left)


def test_copies_fill_up_where_there_is_nothing_else() -> None:
    rows = np.array([[1.0, 2.0], [1.0, 2.0], [2.0, 1.0], [1.0, 2.0]])
    assert survivors(rows, np.arange(4.0), 3).tolist() == [0, 1, 2]


def test_the_champion_is_never_lost_within_a_round_and_lies_on_the_front() -> None:
    result = evolve(schaffer, NUM_GENES, nsga2(generations=200), seed=4, initial=BEGUN)
    best = [generation.best for generation in result.history]
    assert best == sorted(best, reverse=True)
    assert result.history[-1].evaluations == 201 * 22
    assert (result.front.genomes == result.history[-1].champion).all(axis=1).any()
    # of the sum of the squares the middle of the segment is best
    assert result.history[-1].best == pytest.approx(2.0, abs=0.3)


def test_same_seed_same_front_and_the_caller_keeps_his_random_numbers() -> None:
    fronts = []
    for seed in (11, 12):
        random.seed(seed)
        before = random.getstate()
        fronts.append(evolve(schaffer, NUM_GENES, nsga2(generations=5), seed=5, initial=BEGUN).front)
        assert random.getstate() == before
    np.testing.assert_array_equal(fronts[0].genomes, fronts[1].genomes)
    other = evolve(schaffer, NUM_GENES, nsga2(generations=5), seed=6, initial=BEGUN).front
    assert not np.array_equal(other.genomes, fronts[0].genomes)


@pytest.mark.parametrize("next_round", ["afresh", "carried"])
def test_interrupted_anywhere_and_resumed_it_equals_the_whole(next_round: str, tmp_path) -> None:
    settings = nsga2(generations=4, rounds=3, next_round=next_round, cooling=0.8)

    def fitness(index, _):
        return lambda genomes: schaffer(genomes, 0.2 * index)

    whole = evolve_rounds(fitness, NUM_GENES, settings, seed=7, initial=BEGUN)
    for num_generations in (1, 4, 5, 6, 14):
        first, rest = broken_and_resumed(
            fitness, settings, BEGUN, num_generations, tmp_path / f"{num_generations}.npz"
        )
        assert first.interrupted
        assert len(first.front.genomes) > 0
        assert rows_of(rest) == rows_of(whole)
        np.testing.assert_array_equal(rest.history[-1].champion, whole.history[-1].champion)
        np.testing.assert_array_equal(rest.front.genomes, whole.front.genomes)
        assert {name: part.tolist() for name, part in rest.front.parts.items()} == {
            name: part.tolist() for name, part in whole.front.parts.items()
        }


def test_a_front_of_three_objectives_is_the_triangle_between_their_optima() -> None:
    corners = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])

    def fitness(genomes):
        squares = ((2.0 * genomes[:, np.newaxis] - 0.5 - corners) ** 2).sum(axis=2)
        return {"fitness": squares.sum(axis=1)} | {f"{OBJECTIVE}{i}": squares[:, i] for i in range(3)}

    settings = nsga2(population_size=40, generations=150)
    front = evolve(fitness, 2, settings, seed=1, initial=np.full((1, 2), 0.9)).front
    places = 2.0 * front.genomes - 0.5
    assert len(places) == 40
    # how much of each corner a place is made of
    weights = np.column_stack([1.0 - places.sum(axis=1), places])
    assert np.quantile(weights.min(axis=1), 0.25) > -0.05
    assert (weights.max(axis=0) > 0.9).all()


@pytest.mark.parametrize("second", [{}, {f"{OBJECTIVE}b": np.full(22, np.inf)}])
def test_a_fitness_without_two_objectives_is_refused(second) -> None:
    def fitness(genomes):
        return {"fitness": genomes[:, 0], f"{OBJECTIVE}a": genomes[:, 0], **second}

    with pytest.raises(
        ValueError, match="two or more of them must be finite and have names that begin with 'objective_'"
    ):
        evolve(fitness, NUM_GENES, nsga2(), seed=1, initial=BEGUN)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"mutation": "adaptive_feasible"}, "it must be local"),
        ({"population_size": 3}, "at least 4"),
        ({"validation_cases": 0}, "a front is judged on them"),
    ],
)
def test_settings_without_a_front_are_refused(changes, words: str) -> None:
    with pytest.raises(SettingError, match=words):
        nsga2(**changes)
