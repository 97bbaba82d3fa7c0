"""Islands: what migrates, what is told of all of them, and that a seed decides, not who does the work."""

import random
import sys
import threading
from functools import partial

import numpy as np
import pytest

from pipeline.settings.experiment import SettingError
from pipeline.training.evolution.generations import unpopulated
from pipeline.training.evolution.rounds import evolve_rounds, migrate
from pipeline.training.evolution.state import CheckpointError
from tests.pipeline.training.evolution.cases import Sphere, broken_and_resumed, evolve, optimizer
from tests.pipeline.training.evolution.test_evolution import assert_same

NUM_GENES = 6
FOUR = {"population_size": 48, "islands": 4, "migrate_every": 4, "generations": 10}


def moving_sphere(shift, round_index, champion):
    return Sphere(0.3 + shift * round_index + (0.0 if champion is None else 0.1 * champion[0]))


def test_the_best_replace_the_worst_of_the_next_on_a_ring():
    state = unpopulated(1, (0,), 0, 1, 1.0)
    state.fitness = np.array([3.0, 1.0, 2.0, 9.0, 6.0, 5.0, 7.0, 8.0, 0.0])
    state.genomes, state.parts = state.fitness[:, np.newaxis] / 10.0, {"of": 2.0 * state.fitness}
    migrate(state, 3, 1)
    # 0 comes to the first island in the place of 3, 1 to the second in that of 9, and 5 to the third
    expected = np.array([0.0, 1.0, 2.0, 1.0, 6.0, 5.0, 7.0, 5.0, 0.0])
    np.testing.assert_array_equal(state.fitness, expected)
    np.testing.assert_array_equal(state.genomes[:, 0], expected / 10.0)
    np.testing.assert_array_equal(state.parts["of"], 2.0 * expected)


def test_what_is_told_of_a_generation_is_told_of_all_islands(tmp_path):
    told = []
    settings = optimizer(**FOUR)
    checkpoint = tmp_path / "checkpoint.npz"
    evolve(
        Sphere(), NUM_GENES, settings, seed=3, checkpoint=checkpoint,
        on_generation=lambda history: told.append((np.load(checkpoint)["fitness"], history)),
    )  # fmt: skip
    # the first population, then up to each migration and to the end
    assert [len(history) for _, history in told] == [1, 5, 9, 11]
    for fitness, history in told:
        row = history[-1]
        assert row.best == fitness.min()
        assert (row.mean, row.std) == pytest.approx((fitness.mean(), fitness.std(ddof=1)))
        assert row.best == pytest.approx(((row.champion - 0.3) ** 2).sum())
        # of 12 on an island one is its elite
        assert row.evaluations == 48 + 4 * 11 * row.generation
    assert [row.generation for row in told[-1][1]] == list(range(11))


def test_islands_converge_and_migration_spreads_the_best():
    settings = optimizer(population_size=100, generations=120, islands=5)
    result = evolve(Sphere(), NUM_GENES, settings, seed=1)
    assert result.history[-1].best < 1e-3
    apart = evolve(Sphere(), NUM_GENES, optimizer(**FOUR, migrants=0), seed=1)
    together = evolve(Sphere(), NUM_GENES, optimizer(**FOUR), seed=1)
    assert [row.best for row in apart.history[:5]] == [row.best for row in together.history[:5]]
    assert apart.history[5].mean > together.history[5].mean


@pytest.mark.parametrize("next_round", ["afresh", "carried"])
def test_islands_that_were_interrupted_end_as_if_they_had_not_been(next_round, tmp_path):
    settings = optimizer(**FOUR, rounds=3, next_round=next_round)
    begun = np.full((1, NUM_GENES), 0.9)
    whole = evolve_rounds(partial(moving_sphere, 0.1), NUM_GENES, settings, 7, initial=begun)
    assert len(whole.history) == 3 * 11
    # after the first population of the second round, and amid it
    for number in (12, 16):
        checkpoint = tmp_path / f"{number}.npz"
        broken, resumed = broken_and_resumed(partial(moving_sphere, 0.1), settings, begun, number, checkpoint)
        assert broken.interrupted
        assert_same(resumed, whole)
    with pytest.raises(CheckpointError, match=r"optimizer.migrants = 2, now it is 3"):
        evolve(Sphere(), NUM_GENES, optimizer(**FOUR, rounds=3, next_round=next_round, migrants=3), 7,
               checkpoint=checkpoint, resume=True)  # fmt: skip


def test_threads_that_draw_from_the_global_generator_change_nothing():
    one, is_over = evolve(Sphere(), NUM_GENES, optimizer(**FOUR), seed=5), threading.Event()

    def draw():
        while not is_over.is_set():
            random.random()  # noqa: S311

    thread, interval = threading.Thread(target=draw), sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    thread.start()
    try:
        assert_same(one, evolve(Sphere(), NUM_GENES, optimizer(**FOUR), seed=5))
    finally:
        sys.setswitchinterval(interval)
        is_over.set()
        thread.join()


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        ({"algorithm": "cma_es"}, "islands evolve by the genetic algorithm"),
        ({"population_size": 50}, "choose a multiple of 4, at least 8"),
        ({"population_size": 4, "migrants": 0}, "choose a multiple of 4, at least 8"),
        ({"migrants": 7}, "lower it to 6 or less"),
    ],
)
def test_islands_that_cannot_be_are_refused(changes, told):
    with pytest.raises(SettingError, match=told):
        optimizer(**(FOUR | changes))
