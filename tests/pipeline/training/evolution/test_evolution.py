"""The loop: what is kept, what is evaluated, and that a seed is all that decides."""

import json
import random
import sys
import threading

import numpy as np
import pytest

from pipeline.settings.checks import SettingError
from pipeline.settings.training import Encoding, Penalty
from pipeline.training.evolution import generations
from pipeline.training.evolution.generations import Subspace
from pipeline.training.evolution.rounds import Evolution, evolve_rounds
from pipeline.training.evolution.state import CheckpointError
from tests.pipeline.training.evolution.cases import NUM_GENES, Sphere, column, evolve, optimizer, rows_of


def assert_same(first: Evolution, second: Evolution) -> None:
    """Bit for bit."""
    assert rows_of(first) == rows_of(second)
    champions = ([generation.champion for generation in each.history] for each in (first, second))
    np.testing.assert_array_equal(*champions)


def test_converges_on_a_sphere():
    result = evolve(Sphere(), optimizer(population_size=100, generations=120), seed=1)
    assert result.history[-1].best < 1e-4
    np.testing.assert_allclose(result.history[-1].champion, 0.3, atol=0.01)
    assert not result.interrupted


def test_elite_is_kept_verbatim_and_nothing_is_evaluated_again(monkeypatch):
    sphere, bred, breed_once = Sphere(), [], generations.breed

    def breed(*given):
        bred.append(breed_once(*given))
        return bred[-1]

    monkeypatch.setattr(generations, "breed", breed)
    result = evolve(sphere, optimizer(), seed=2)
    assert result.history[-1].evaluations == 40 + 30 * 36
    best = [generation.best for generation in result.history]
    assert best == sorted(best, reverse=True)
    assert sum(map(len, sphere.batches)) < 40 + 30 * 36 - 5
    # each generation is the four best of the last one and the children, to the last bit
    population = sphere.batches[0]
    for generation, batch, children in zip(result.history[1:], sphere.batches[1:], bred, strict=True):
        met = {genome.tobytes() for genome in population}
        is_new = [not (key in met or met.add(key)) for key in map(np.ndarray.tobytes, children)]
        np.testing.assert_array_equal(batch, children[is_new])
        squares = ((population - 0.3) ** 2).sum(axis=1)
        population = np.concatenate((population[np.argsort(squares, kind="stable")[:4]], children))
        squares = ((population - 0.3) ** 2).sum(axis=1)
        assert (generation.best, generation.mean) == (squares.min(), squares.mean())
        np.testing.assert_array_equal(generation.champion, population[squares.argmin()])


def test_step_size_follows_success():
    result = evolve(Sphere(), optimizer(generations=60), seed=4)
    steps, best = column(result, "step_size"), column(result, "best")
    assert steps[:2] == [1.0, 1.0]
    for k in range(2, len(steps)):
        improved = best[k - 1] < best[k - 2]
        assert steps[k] == (min(1.0, 4 * steps[k - 1]) if improved else max(2.0**-26, steps[k - 1] / 4))
    assert len(set(steps)) > 2


def test_a_seed_alone_decides_and_the_global_generators_are_left_as_they_were():
    def restless(genomes):
        random.random()  # noqa: S311
        np.random.random()  # noqa: NPY002
        return Sphere()(genomes)

    def state():
        return random.getstate(), np.random.get_state()[1].tolist()  # noqa: NPY002

    before = state()
    small = optimizer(generations=8)
    undisturbed = evolve(Sphere(), small, seed=5)
    assert state() == before
    assert_same(evolve(restless, small, seed=5), undisturbed)
    assert state() != before
    assert_same(evolve(Sphere(), small, seed=5), undisturbed)
    assert evolve(Sphere(), small, seed=6).history[-1].best != undisturbed.history[-1].best


def test_rounds_start_afresh_from_the_last_champion():
    spheres = [Sphere(0.3), Sphere(0.6), Sphere(0.6)]
    settings = optimizer(rounds=3, generations=10)
    result = evolve_rounds(lambda index, _: spheres[index], NUM_GENES, settings, seed=1)
    assert column(result, "round") == 11 * [0] + 11 * [1] + 11 * [2]
    for index in (1, 2):
        np.testing.assert_array_equal(spheres[index].batches[0][0], result.history[11 * index - 1].champion)
        assert not np.array_equal(spheres[index].batches[0][1:], spheres[index - 1].batches[0][1:])
        assert result.history[11 * index].step_size == 1.0
    # the same fitness function: the champion carried over can only be beaten
    assert result.history[22].best <= result.history[21].best


PLANES = {
    "planes": {"rounds": 2, "population_size": 12, "generations": 30, "initial_step": 0.2, "growth": 2.0},
    **{"rounds": 4, "next_round": "carried", "mutation": "local", "cooling": 0.5},
}
#: within each half of a genome, which one gene moves, genes differ by so much
SLOPE = np.tile(np.linspace(0.0, 0.2, NUM_GENES // 2), 2)
HALVES = Subspace(np.array([0.8, 0.6]), lambda genes: 0.8 * np.repeat(genes, NUM_GENES // 2, axis=1) + SLOPE)


def test_planes_are_sought_first_and_the_next_round_begins_near_their_champion():
    spheres, champions = [Sphere() for _ in range(4)], []

    def evaluate_for_round(index, champion):
        champions.append(champion)
        return spheres[index]

    settings = optimizer(generations=20, **PLANES)
    result = evolve_rounds(evaluate_for_round, NUM_GENES, settings, seed=1, planes=HALVES)
    of_rounds = [np.concatenate(sphere.batches) for sphere in spheres]
    # the centre comes first
    np.testing.assert_array_equal(of_rounds[0][0], HALVES.expand(HALVES.start[np.newaxis])[0])
    for genomes in of_rounds[:2]:
        np.testing.assert_allclose(genomes, HALVES.expand(genomes[:, :: NUM_GENES // 2] / 0.8))
        assert len(genomes) == 31 * 12
    assert column(result, "generation") == 2 * [*range(31)] + 2 * [*range(21)]
    ends = [result.history[index] for index in (30, 61, 82, 103)]
    # least squares: the slopes remain
    assert ends[1].best == pytest.approx(np.sum((SLOPE - SLOPE.mean()) ** 2), rel=1e-6)
    np.testing.assert_array_equal(spheres[2].batches[0][0], ends[1].champion)
    assert len(np.unique(spheres[2].batches[0], axis=0)) > 10
    assert ends[3].best < ends[2].best < 0.5 * ends[1].best
    assert champions[0] is None
    for champion, end in zip(champions[1:], ends, strict=False):
        np.testing.assert_array_equal(champion, end.champion)
    assert [result.history[index].step_size for index in (0, 62, 83)] == [0.2, 0.1, 0.05]


def test_planes_have_prices_of_their_own():
    penalty = {"short_point_m_s": 3.0, "missed_point_m_s": 0.5, "growth": 1.5, "outside_m_s": 7.0}
    settings = optimizer(penalty=Penalty(**penalty), **PLANES)
    prices = [settings.penalty_of_round(index) for index in range(4)]
    assert [price.short_point_m_s for price in prices] == [1.0, 2.0, 3.0, 4.5]
    assert [price.missed_point_m_s for price in prices] == [0.05, 0.1, 0.5, 0.75]
    assert {price.outside_m_s for price in prices} == {7.0}


def test_planes_that_are_interrupted_go_on_as_if_they_were_not(tmp_path):
    settings, whole = optimizer(generations=3, **PLANES), []
    undisturbed = evolve(Sphere(), settings, seed=4, planes=HALVES)

    def stop_at(count):
        def stop(history):
            if len(history) == count:
                raise KeyboardInterrupt

        return stop

    path = tmp_path / "checkpoint.npz"
    for count in (2, 31, 40, 62, 64, 69):
        kept = {"planes": HALVES, "checkpoint": path, "resume": True}
        evolve(Sphere(), settings, seed=4, on_generation=stop_at(count), **kept)
        whole.append(evolve(Sphere(), settings, seed=4, **kept))
        path.unlink()
    for resumed in whole:
        assert_same(resumed, undisturbed)


@pytest.mark.parametrize(
    ("changes", "refusal"),
    [
        ({"rounds": 2}, "set optimizer.rounds to at least 3"),
        ({"encoding": Encoding(rules="planes")}, "optimizer.encoding.rules=free"),
        ({"planes": {"rounds": 2, "population_size": 4}}, "optimizer.planes.population_size"),
        ({"planes": {"rounds": 20, "growth": 10.0}, "rounds": 30}, "optimizer.planes.growth"),
    ],
)
def test_planes_without_a_round_rules_or_individuals_to_go_on_with_are_refused(changes, refusal):
    with pytest.raises(SettingError, match=refusal):
        optimizer(**(PLANES | changes))


def test_stall_ends_a_round():
    settings = optimizer(stall_generations=4, rounds=2, generations=50)
    result = evolve(lambda genomes: {"fitness": np.ones(len(genomes))}, settings, seed=1)
    assert column(result, "generation") == [0, 1, 2, 3, 4, 0, 1, 2, 3, 4]


@pytest.fixture
def checkpoint(tmp_path):
    """Of a run that is over, in the place of a file that was no checkpoint."""
    path = tmp_path / "checkpoint.npz"
    path.write_bytes(b"nothing of ours")
    evolve(Sphere(), optimizer(generations=1), seed=1, checkpoint=path)
    return path


def resume(checkpoint, seed=1, **settings):
    sphere = Sphere()
    return sphere, evolve(sphere, optimizer(**settings), seed, checkpoint=checkpoint, resume=True)


def test_resuming_a_finished_run_evaluates_nothing(checkpoint):
    sphere, again = resume(checkpoint, generations=1)
    assert_same(evolve(Sphere(), optimizer(generations=1), seed=1), again)
    assert sphere.batches == []


def test_checkpoint_of_other_settings_is_refused(checkpoint):
    with pytest.raises(CheckpointError, match=r"seed = 1, now it is 2; resume with the configuration"):
        resume(checkpoint, seed=2)
    with pytest.raises(CheckpointError, match=r"optimizer.population_size = 40, now it is 50"):
        resume(checkpoint, population_size=50)


@pytest.mark.parametrize("content", [None, b"", b"nothing of ours", b"PK\x03\x04 nothing", b"\x80\x04}."])
def test_cut_and_other_files_are_refused_in_our_own_words(content, checkpoint):
    checkpoint.write_bytes(checkpoint.read_bytes()[:1000] if content is None else content)
    with pytest.raises(CheckpointError, match=r"checkpoint\.npz is not a readable checkpoint .*; delete it"):
        resume(checkpoint)


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("version", "has checkpoint version None, this program reads 2; delete it"),
        *((name, "is not a readable checkpoint") for name in ("fingerprint", "round", "parts", "history")),
        *((name, "is not a readable checkpoint") for name in ("python_state", "numpy_state", "step_size")),
    ],
)
def test_a_checkpoint_that_lacks_something_is_refused(name, message, checkpoint):
    with np.load(checkpoint) as archive:
        arrays = dict(archive)
    note = json.loads(arrays.pop("note").tobytes())
    del note[name]
    np.savez(checkpoint, note=np.frombuffer(json.dumps(note).encode(), dtype=np.uint8), **arrays)
    with pytest.raises(CheckpointError, match=message):
        resume(checkpoint, generations=1)


def test_a_fitness_that_is_no_number_is_refused():
    with pytest.raises(ValueError, match="a finite number for each genome"):
        evolve(lambda genomes: {"fitness": np.full(len(genomes), np.nan)}, optimizer(), seed=1)


def test_threads_that_draw_from_the_global_generator_change_nothing():
    undisturbed, is_over = evolve(Sphere(), optimizer(generations=10), seed=5), threading.Event()

    def draw():
        while not is_over.is_set():
            random.random()  # noqa: S311

    thread, interval = threading.Thread(target=draw), sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    thread.start()
    try:
        assert_same(undisturbed, evolve(Sphere(), optimizer(generations=10), seed=5))
    finally:
        sys.setswitchinterval(interval)
        is_over.set()
        thread.join()
