"""CMA-ES: the distribution learns, its centre is the champion, and a seed is all that decides."""

import numpy as np
import pytest

from pipeline.training.evolution.rounds import evolve_rounds
from tests.pipeline.training.evolution.cases import (
    Sphere,
    broken_and_resumed,
    column,
    evolve,
    optimizer,
    rows_of,
)

NUM_GENES = 10


def cma(**changes):
    values = {"algorithm": "cma_es", "population_size": 13, "generations": 60, "initial_step": 0.2}
    return optimizer(**(values | changes))


def ellipsoid(genomes: np.ndarray) -> dict[str, np.ndarray]:
    """Axes a thousand times as steep as one another, turned: only a learnt covariance gets far."""
    turned = (genomes - 0.4) @ np.linalg.qr(np.random.default_rng(5).normal(size=(NUM_GENES, NUM_GENES)))[0]
    return {"fitness": (turned**2 * np.logspace(0, 6, NUM_GENES)).sum(axis=1)}


def test_it_learns_the_covariance_of_a_turned_ellipsoid() -> None:
    begun = np.full((1, NUM_GENES), 0.6)
    learnt = evolve(ellipsoid, NUM_GENES, cma(generations=600), seed=1, initial=begun)
    np.testing.assert_allclose(learnt.history[-1].champion, 0.4, atol=1e-6)


def test_the_centre_comes_first_and_is_the_champion() -> None:
    sphere, begun = Sphere(), np.full((1, NUM_GENES), 0.7)
    result = evolve(sphere, NUM_GENES, cma(), seed=2, initial=begun)
    np.testing.assert_array_equal(sphere.batches[0][0], begun[0])
    for generation, batch in zip(result.history, sphere.batches, strict=True):
        assert batch.shape == (13, NUM_GENES)
        np.testing.assert_array_equal(generation.champion, batch[0])
    assert result.history[-1].best < 1e-3 * result.history[0].best


def test_what_is_judged_stays_in_the_box_and_an_optimum_on_its_edge_is_found() -> None:
    sphere = Sphere(centre=-0.2)
    result = evolve(sphere, NUM_GENES, cma(generations=150), seed=3, initial=np.full((1, NUM_GENES), 0.5))
    judged = np.concatenate(sphere.batches)
    assert judged.min() >= 0.0
    assert judged.max() <= 1.0
    np.testing.assert_allclose(result.history[-1].champion, 0.0, atol=0.02)


@pytest.mark.parametrize("next_round", ["afresh", "carried"])
def test_interrupted_anywhere_and_resumed_it_equals_the_whole(next_round: str, tmp_path) -> None:
    settings = cma(generations=5, rounds=3, next_round=next_round)
    spheres = [Sphere(0.2), Sphere(0.4), Sphere(0.6)]
    begun = np.full((1, NUM_GENES), 0.5)

    def fitness(index, _):
        return spheres[index]

    whole = evolve_rounds(fitness, NUM_GENES, settings, seed=7, initial=begun)
    for num_generations in (1, 5, 7, 12):
        first, rest = broken_and_resumed(
            fitness, settings, begun, num_generations, tmp_path / f"{num_generations}.npz"
        )
        assert first.interrupted
        assert rows_of(rest) == rows_of(whole)
        np.testing.assert_array_equal(rest.history[-1].champion, whole.history[-1].champion)


def test_a_carried_round_goes_on_with_its_steps_and_a_fresh_one_begins_anew() -> None:
    begun = np.full((1, NUM_GENES), 0.5)
    settings = cma(generations=40, rounds=2)
    fresh = evolve(Sphere(), NUM_GENES, settings, seed=8, initial=begun)
    carried = evolve(
        Sphere(), NUM_GENES, cma(generations=40, rounds=2, next_round="carried"), 8, initial=begun
    )
    assert column(fresh, "step_size")[41] == 0.2
    steps = column(carried, "step_size")
    assert steps[41] < 0.5 * 0.2
    assert 0.5 < steps[41] / steps[40] < 2.0
