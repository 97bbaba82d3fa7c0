"""NSGA-II: fronts known in closed form, survivors by brute force, and a seed that is all that decides."""

import itertools
import random

import numpy as np
import pytest
from deap import tools

from pipeline.settings.checks import SettingError
from pipeline.training.evolution import operators
from pipeline.training.evolution.front import OBJECTIVE, Ranked, survivors
from pipeline.training.evolution.rounds import evolve_rounds
from tests.pipeline.training.evolution.cases import optimizer, rows_of

NUM_GENES = 5
BEGUN = np.full((1, NUM_GENES), 0.9)


def nsga2(**changes):
    values = {"algorithm": "nsga2", "population_size": 22, "generations": 4, "crossover_rate": 0.5}
    return optimizer(**(values | changes))


def front_of(fitness, settings, seed, num_genes=NUM_GENES):
    begun = np.full((1, num_genes), 0.9)
    return evolve_rounds(lambda *_: fitness, num_genes, settings, seed, initial=begun)


def parts_of(*values: np.ndarray) -> dict[str, np.ndarray]:
    """Objectives, and one of many ways to weigh them, with a part that is none between them."""
    names = [f"{OBJECTIVE}{index}" for index in range(len(values))]
    return {"fitness": sum(values), "aside": values[0], **dict(zip(names, values, strict=True))}


def schaffer(genomes: np.ndarray, shift: float = 0.0) -> dict[str, np.ndarray]:
    """Squared distances from (0, ..., 0) and (2, ..., 2): the front is the segment between them."""
    points = 6.0 * genomes - 2.0 - shift
    return parts_of((points**2).mean(axis=1), ((points - 2.0) ** 2).mean(axis=1))


def zdt1(genomes: np.ndarray) -> dict[str, np.ndarray]:
    """Zitzler, Deb and Thiele's first: the front is 1 - sqrt(f), where all genes but the first are zero."""
    first, slope = genomes[:, 0], 1.0 + 9.0 * genomes[:, 1:].mean(axis=1)
    return parts_of(first, slope * (1.0 - np.sqrt(first / slope)))


def objectives(parts) -> np.ndarray:
    return np.column_stack([values for name, values in parts.items() if name.startswith(OBJECTIVE)])


def dominates(first, second) -> bool:
    return all(first <= second) and any(first < second)


def test_parents_are_drawn_as_deaps_own_from_the_global_generator() -> None:
    rows = np.random.default_rng(4).integers(0, 4, (23, 2)).astype(float)
    population = [Ranked(index, row.tolist()) for index, row in enumerate(rows)]
    tools.selNSGA2(population, len(population))
    random.seed(8)
    generator = random.Random()  # noqa: S311
    generator.setstate(random.getstate())
    for _ in range(3):
        theirs = tools.selTournamentDCD(population, 20)
        assert [id(parent) for parent in operators.select_uncrowded(population, generator)] == [
            id(parent) for parent in theirs
        ]
    assert generator.getstate() == random.getstate()


def test_schaffers_front_is_found_from_end_to_end() -> None:
    result = front_of(schaffer, nsga2(generations=250), seed=1)
    rows = objectives(result.front.parts)
    first, second = np.sqrt(rows).T
    assert len(first) == 22
    # the triangle: no point is nearer to both ends; the first population comes to 4.8
    assert (first + second).min() >= 2.0 - 1e-12
    np.testing.assert_allclose(first + second, 2.0, atol=0.25)
    assert first.min() < 0.15
    assert second.min() < 0.15
    # in order, nothing twice, and the parts are those of the genomes
    assert (np.diff(first) > 0).all()
    np.testing.assert_array_equal(objectives(schaffer(result.front.genomes)), rows)
    np.testing.assert_array_equal(result.front.fitness, rows.sum(axis=1))
    # the champion stands on the front; of the sum of the squares the middle of the segment is best
    best = [generation.best for generation in result.history]
    assert best == sorted(best, reverse=True)
    assert (result.front.genomes == result.history[-1].champion).all(axis=1).any()
    assert best[-1] == pytest.approx(2.0, abs=0.3)
    assert result.history[-1].evaluations == 251 * 22


def test_zdt1s_front_is_found_on_the_edge_of_the_box() -> None:
    first, second = objectives(front_of(zdt1, nsga2(generations=150), seed=2).front.parts).T
    np.testing.assert_allclose(second, 1.0 - np.sqrt(first), atol=0.08)
    assert first.min() < 0.05
    assert first.max() > 0.7


def test_a_front_of_three_objectives_is_the_triangle_between_their_optima() -> None:
    corners = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])

    def fitness(genomes):
        return parts_of(*((2.0 * genomes[:, np.newaxis] - 0.5 - corners) ** 2).sum(axis=2).T)

    front = front_of(fitness, nsga2(population_size=40, generations=150), seed=1, num_genes=2).front
    points = 2.0 * front.genomes - 0.5
    assert len(points) == 40
    # how much of each corner a point is made of
    weights = np.column_stack([1.0 - points.sum(axis=1), points])
    assert np.quantile(weights.min(axis=1), 0.25) > -0.05
    assert (weights.max(axis=0) > 0.9).all()


@pytest.mark.parametrize("seed", range(6))
def test_those_that_nothing_dominates_survive_first_and_the_champion_always(seed: int) -> None:
    generator = np.random.default_rng(seed)
    rows = generator.integers(0, 9, (30, 2)).astype(float)  # few values, so that there are equals
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
        assert row == champion or not any(dominates(rows[other], rows[row]) for other in left)


def test_copies_fill_up_where_there_is_nothing_else() -> None:
    rows = np.array([[1.0, 2.0], [1.0, 2.0], [2.0, 1.0], [1.0, 2.0]])
    assert survivors(rows, np.arange(4.0), 3).tolist() == [0, 1, 2]


@pytest.mark.parametrize("next_round", ["afresh", "carried"])
def test_interrupted_anywhere_and_resumed_it_equals_the_whole(next_round: str, tmp_path) -> None:
    settings = nsga2(rounds=3, next_round=next_round, cooling=0.8)

    def run(limit=None, **how):
        num_calls = itertools.count()

        def of_round(index, _):
            def evaluate(genomes):
                if next(num_calls) == limit:
                    raise KeyboardInterrupt
                return schaffer(genomes, 0.2 * index)

            return evaluate

        return evolve_rounds(of_round, NUM_GENES, settings, seed=7, initial=BEGUN, **how)

    random.seed(3)
    before = random.getstate()
    whole = run()
    assert random.getstate() == before
    for stop in (1, 5, 6, 14):
        first = run(stop, checkpoint=tmp_path / f"{stop}.npz")
        assert first.interrupted
        assert len(first.front.genomes) > 0
        rest = run(checkpoint=tmp_path / f"{stop}.npz", resume=True)
        assert rows_of(rest) == rows_of(whole)
        np.testing.assert_array_equal(rest.front.genomes, whole.front.genomes)
        for name, values in whole.front.parts.items():
            np.testing.assert_array_equal(rest.front.parts[name], values)
    other = evolve_rounds(lambda *_: schaffer, NUM_GENES, settings, seed=6, initial=BEGUN)
    assert not np.array_equal(other.front.genomes, whole.front.genomes)


@pytest.mark.parametrize("second", [{}, {f"{OBJECTIVE}b": np.full(22, np.inf)}])
def test_a_fitness_without_two_objectives_is_refused(second) -> None:
    def fitness(genomes):
        return {"fitness": genomes[:, 0], f"{OBJECTIVE}a": genomes[:, 0], **second}

    words = "two or more of them must be finite and have names that begin with 'objective_'"
    with pytest.raises(ValueError, match=words):
        front_of(fitness, nsga2(), seed=1)


def test_tournaments_take_four() -> None:
    with pytest.raises(SettingError, match="at least 4"):
        nsga2(population_size=3)
