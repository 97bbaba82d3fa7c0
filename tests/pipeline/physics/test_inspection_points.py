import numpy as np
import pytest

from pipeline.flight.world.surface import fibonacci_placement, regular_placement

RINGS = [3, 9, 13, 16, 17, 16, 13, 9, 3]


@pytest.fixture(scope="module")
def points():
    return regular_placement(100, 10.0)


def smallest_distances(points):
    distances = np.linalg.norm(points[:, None] - points[None], axis=2)
    np.fill_diagonal(distances, np.inf)
    return distances.min(axis=1)


def test_asking_for_100_gives_99_on_the_sphere(points):
    assert points.shape == (99, 3)
    np.testing.assert_allclose(np.linalg.norm(points, axis=1), 10.0, rtol=1e-15)


def test_rings_lie_from_plus_k_to_minus_k(points):
    start = 0
    for ring, size in enumerate(RINGS):
        height = points[start : start + size, 2]
        np.testing.assert_allclose(height, 10.0 * np.cos(np.radians(10 + 20 * ring)), atol=1e-14)
        start += size
    assert start == len(points)


def test_a_ring_runs_from_plus_i_towards_plus_j(points):
    start = 0
    for size in RINGS:
        azimuth = np.degrees(np.arctan2(points[start : start + size, 1], points[start : start + size, 0]))
        np.testing.assert_allclose(azimuth % 360.0, 360.0 * np.arange(size) / size, atol=1e-12)
        start += size


@pytest.mark.parametrize("wanted", [1, 2, 10, 50, 250, 1000])
def test_about_as_many_points_as_asked_for(wanted):
    points = regular_placement(wanted, 2.0)
    assert abs(len(points) - wanted) <= max(2, 0.06 * wanted)
    np.testing.assert_allclose(np.linalg.norm(points, axis=1), 2.0, rtol=1e-15)


@pytest.mark.parametrize("wanted", [1, 7, 100])
def test_fibonacci_gives_exactly_as_many(wanted):
    points = fibonacci_placement(wanted, 10.0)
    assert points.shape == (wanted, 3)
    np.testing.assert_allclose(np.linalg.norm(points, axis=1), 10.0, rtol=1e-15)


def test_fibonacci_points_are_evenly_spaced_with_none_on_a_pole():
    points = fibonacci_placement(100, 10.0)
    side = 10.0 * np.sqrt(4.0 * np.pi / 100)
    assert smallest_distances(points).min() > 0.8 * side
    assert np.all(np.diff(points[:, 2]) < 0.0)
    np.testing.assert_allclose(points.mean(axis=0), 0.0, atol=0.02)
