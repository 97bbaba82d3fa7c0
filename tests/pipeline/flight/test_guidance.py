import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from fis_tools.compiled.vectors import padded
from pipeline.flight.period.look import guidance
from pipeline.flight.reference.guidance import clustered
from pipeline.flight.world.surface import regular_placement

POINTS = regular_placement(100, 10.0)


def columns(candidates):
    """Candidates as the compiled functions take them."""
    array = np.full((3, padded(len(POINTS), guidance.POINTS)), np.nan)
    array[:, : len(candidates)] = np.reshape(candidates, (-1, 3)).T
    return array


class Carried:
    """What clustering carries from sample to sample."""

    def __init__(self, carried=()):
        self.centres, self.count, width = np.zeros((10, 3)), len(carried), columns(()).shape[1]
        self.centres[: self.count] = np.reshape(carried, (-1, 3))
        self.scratch = np.zeros((2, width)), np.zeros(width), np.zeros((10, 4))

    def of(self, candidates):
        return guidance.Clusters(columns(candidates), len(candidates), self.centres, *self.scratch)

    def chosen(self, candidates, position):
        """The centre of the cluster nearest to a place."""
        self.count = guidance.cluster_centres(self.of(candidates), np.asarray(position), self.count)
        return self.centres[guidance.nearest_row(self.centres, self.count, np.asarray(position))].copy()


@pytest.mark.slow
def test_empty_clusters_move_as_scikit_learn_moves_them():
    """Centres carried over from far away leave clusters empty, several at once."""
    rng = np.random.default_rng(12)
    num_empty = []
    for _ in range(150):
        candidates = Rotation.random(rng=rng).apply(rng.permutation(POINTS)[: rng.integers(11, 70)])
        candidates += rng.normal(scale=0.01, size=candidates.shape)
        number = guidance.num_clusters(len(candidates))
        carried = rng.normal(size=(number, 3)) * rng.choice([6.0, 20.0, 60.0], size=(number, 1))
        position = rng.normal(scale=60.0, size=3)
        nearest = np.linalg.norm(candidates[:, None] - carried[None], axis=2).argmin(axis=1)
        num_empty.append(number - len(set(nearest)))

        clusters, expected = Carried(carried), clustered(candidates, carried)
        clusters.chosen(candidates, position)
        np.testing.assert_allclose(clusters.centres[:number], expected, rtol=0, atol=1e-9)
    assert {1, 2, 3} <= set(num_empty)


def test_the_last_candidate_of_a_cluster_may_be_taken_from_it():
    """Relocation can empty another cluster; in the end each is where the mean of its members is."""
    cluster = Rotation.from_euler("xyz", [0.3, 0.1, 0.2]).apply(POINTS[40:60])
    candidates = np.vstack((cluster, [[-90.0, 5.0, 1.0]]))
    for order in ([0, 1, 2], [2, 1, 0], [1, 0, 2], [1, 2, 0]):
        carried = np.array([[0.0, 1.0, 0.5], [-70.0, 0.0, 0.0], [0.0, 500.0, 0.0]])[order]
        clusters = Carried(carried)
        clusters.chosen(candidates, [60.0, 0.0, 0.0])
        centres = clusters.centres[:3]
        labels = np.linalg.norm(candidates[:, None] - centres[None], axis=2).argmin(axis=1)
        assert set(labels) == {0, 1, 2}
        means = [candidates[labels == label].mean(axis=0) for label in range(3)]
        np.testing.assert_allclose(centres, means, rtol=0, atol=1e-12)


def test_of_equally_far_candidates_the_first_is_taken_whatever_rounding_says():
    along = [[0.1 * i, 0.0, 0.0] for i in range(9)]
    candidates = [*along, [0.4, 5.0, 0.0], [0.4, -5.0, 0.0]]
    for wobble in (0.0, 1e-14, -1e-14):
        clusters = Carried([[0.4, wobble, 0.0]])
        assert guidance.start_centres(clusters.of(candidates), np.array([0.4, 0.0, 80.0]), 1) == 2
        assert clusters.centres[1, 1] > 4.0


def test_up_to_ten_candidates_make_one_cluster_and_eleven_two_and_none_none():
    assert [guidance.num_clusters(m) for m in (0, 1, 10, 11, 20, 21, 99)] == [0, 1, 1, 2, 2, 3, 10]
    few = POINTS[:10]
    np.testing.assert_allclose(Carried().chosen(few, [0.0, 60.0, 0.0]), few.mean(axis=0), rtol=1e-14)
    assert guidance.cluster_centres(Carried(POINTS[:3]).of(()), POINTS[0], 3) == 0


def test_the_nearest_place_is_the_first_of_equals():
    centres = np.array([[0.0, 5.0, 1.0], [0.0, 5.0, -1.0], [0.0, 5.0, 1.0], [0.0, 9.0, 0.0]])
    assert guidance.nearest_row(centres, 3, np.array([0.0, 50.0, 0.0])) == 0
    assert guidance.nearest_row(centres, 4, np.array([0.0, 50.0, 0.0])) == 3
    assert guidance.nearest_row(centres, 4, np.array([0.0, 0.0, -50.0])) == 1
