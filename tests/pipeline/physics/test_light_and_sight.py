from collections import Counter

import numpy as np
import pytest
from scipy.spatial import Delaunay
from scipy.spatial.transform import Rotation

from fis_tools.compiled.three import three_of
from pipeline.constants import EARTH_RADIUS_M
from pipeline.flight.world.surface import fibonacci_placement, regular_placement
from pipeline.physics import illumination
from pipeline.physics.illumination import sun_direction_h, visible_share
from pipeline.physics.sight import Optics, fits_from, is_facing, is_in_cone, is_in_rectangle, is_lit, sight_of

RADIUS = 10.0
SUN_SIZE = illumination.SUN_RADIUS_M / illumination.ASTRONOMICAL_UNIT_M
MEAN_MOTION = 0.0011068


def test_the_sun_goes_backwards_through_the_orbit_plane():
    assert illumination.sun_angle(1.0, MEAN_MOTION, 3600.0) == pytest.approx(1.0 - 3600.0 * MEAN_MOTION)
    np.testing.assert_allclose(sun_direction_h(np.pi / 2), [0.0, 1.0, 0.0], atol=1e-16)
    after = sun_direction_h(illumination.sun_angle(0.0, MEAN_MOTION, 1.0))
    np.testing.assert_allclose(after[1], -MEAN_MOTION, rtol=1e-6)


def test_the_conditions_without_roots_are_those_of_the_paper():
    """A point is lit by ``p . (p - r_s) < 0``, and in view between the tangents and inside the cone."""
    rng = np.random.default_rng(8)
    points = rng.normal(size=(200, 3))
    points *= RADIUS / np.linalg.norm(points, axis=1)[:, None]
    for half_angle in (0.1, 0.5, 1.2):
        sight, num_seen = sight_of(RADIUS, half_angle), 0
        for _ in range(40):
            position = rng.normal(size=3) * rng.choice([8.0, 20.0, 60.0])
            boresight = -position / np.linalg.norm(position) + 0.3 * rng.normal(size=3)
            boresight /= np.linalg.norm(boresight)
            sun = sun_direction_h(rng.uniform(0.0, 2.0 * np.pi))
            away = points - position
            distance = np.linalg.norm(away, axis=1)
            seen = is_facing(sight, points @ position) & is_in_cone(sight, away @ boresight, distance**2)
            expected = points @ position >= RADIUS * np.linalg.norm(points, axis=1)
            expected &= away @ boresight >= np.cos(half_angle) * distance
            np.testing.assert_array_equal(seen, expected)
            lit = is_lit(sight, points[:, 0], points[:, 1], sun[0], sun[1])
            expected = np.sum(points**2, axis=1) - illumination.ASTRONOMICAL_UNIT_M * (points @ sun) < 0.0
            np.testing.assert_array_equal(lit, expected)
            num_seen += np.count_nonzero(seen)
        assert num_seen > 20


def test_a_rectangular_field_of_view_is_a_pyramid():
    """Points are in it where SciPy's triangulation of the pyramid contains them."""
    rng, count = np.random.default_rng(3), Counter()
    for _ in range(30):
        across, rise = np.tan(rng.uniform(0.05, 1.3, 2))
        optics = Optics(*[0.0] * 7, across, rise)
        side, up, boresight = Rotation.random(random_state=rng).as_matrix()
        corners = [boresight + i * across * side + j * rise * up for i in (-1, 1) for j in (-1, 1)]
        pyramid = Delaunay(np.array([np.zeros(3), *corners]))
        for point in rng.normal(size=(40, 3)) * 0.6:
            if point @ boresight < 1.0:  # the pyramid ends there
                isin = is_in_rectangle(optics, *map(three_of, (-point, boresight, up)))
                count[isin] += 1
                assert isin == (pyramid.find_simplex(point) >= 0)
    assert min(count[True], count[False]) > 50


def test_from_afar_the_whole_chief_fits_into_the_field_of_view():
    half_angle = np.radians(15.0)
    assert np.sqrt(fits_from(sight_of(RADIUS, half_angle))) == pytest.approx(RADIUS / np.sin(half_angle))


ORBIT_M = (3.986004418e14 / MEAN_MOTION**2) ** (1.0 / 3.0)


def integrated_share(sun_h: np.ndarray) -> float:
    """Rays from the chief to a fine lattice on the Sun's disc, each missing the Earth's sphere or not."""
    ticks = np.linspace(-1.0, 1.0, 501)
    u, v = np.meshgrid(ticks, ticks)
    inside = u**2 + v**2 <= 1.0
    across = np.linalg.svd(sun_h[np.newaxis])[2][1:]
    rays = sun_h + SUN_SIZE * (u[inside, np.newaxis] * across[0] + v[inside, np.newaxis] * across[1])
    rays /= np.linalg.norm(rays, axis=1)[:, np.newaxis]
    # the chief is at ORBIT_M along i from the Earth's centre
    along = ORBIT_M * rays[:, 0]
    misses = (along > 0.0) | (ORBIT_M**2 - along**2 > EARTH_RADIUS_M**2)
    return float(np.mean(misses))


def test_the_orbit_of_the_paper_is_500_km_high() -> None:
    assert pytest.approx(EARTH_RADIUS_M + 500e3, abs=500.0) == ORBIT_M


@pytest.mark.slow
@pytest.mark.parametrize("elevation", [0.0, 0.6, -1.1])
def test_the_penumbra_is_that_of_rays_to_the_suns_disc(elevation: float) -> None:
    edge = np.arccos(-np.sqrt(1.0 - (EARTH_RADIUS_M / ORBIT_M) ** 2) / np.cos(elevation))
    shares = []
    for angle in edge + np.linspace(-0.05, 0.05, 21):
        sun_h = sun_direction_h(angle, elevation)
        shares.append(visible_share(sun_h[0], ORBIT_M))
        assert shares[-1] == pytest.approx(integrated_share(sun_h), abs=2e-3)
    assert max(shares) == 1.0
    assert min(shares) == 0.0
    assert any(0.1 < share < 0.9 for share in shares)


@pytest.mark.parametrize("min_share", [0.1, 0.5, 1.0])
def test_one_height_of_the_sun_tells_light_from_shadow(min_share: float) -> None:
    least = illumination.least_sun_height(ORBIT_M, min_share)
    for angle in (np.arccos(least) - 1e-6, np.arccos(least) + 1e-6):
        share = visible_share(np.cos(angle), ORBIT_M)
        assert (share >= min_share) == (np.cos(angle) >= least)
        assert share == pytest.approx(min_share, abs=2e-4)
    assert illumination.least_sun_height(ORBIT_M, 0.0) == -2.0


def test_eclipses_last_as_long_as_they_are_published_to() -> None:
    """37.8 % of a 500 km orbit in its Sun's plane; none for a Sun more than 68 deg above it."""
    least = illumination.least_sun_height(ORBIT_M, 0.5)
    share = np.mean(np.cos(np.linspace(0.0, 2.0 * np.pi, 20_001)) < least)
    assert share == pytest.approx(0.378, abs=0.0005)
    # a cylinder's shadow
    assert share == pytest.approx(np.arcsin(EARTH_RADIUS_M / ORBIT_M) / np.pi, abs=0.001)
    assert np.degrees(np.arccos(-least)) == pytest.approx(68.0, abs=0.1)
    assert visible_share(sun_direction_h(np.pi, np.radians(68.5))[0], ORBIT_M) == 1.0
    assert visible_share(sun_direction_h(np.pi, np.radians(67.5))[0], ORBIT_M) == 0.0


def test_a_small_earth_far_away_makes_a_ring_of_the_sun() -> None:
    far = 2.5e9
    ratio = np.arcsin(EARTH_RADIUS_M / far) / np.arcsin(SUN_SIZE)
    assert visible_share(-1.0, far) == pytest.approx(1.0 - ratio**2, rel=1e-6)


RINGS = [3, 9, 13, 16, 17, 16, 13, 9, 3]


def test_asking_for_100_gives_99_in_rings_from_plus_k_to_minus_k_and_from_plus_i_towards_plus_j():
    points = regular_placement(100, 10.0)
    np.testing.assert_allclose(np.linalg.norm(points, axis=1), 10.0, rtol=1e-15)
    rings = np.split(points, np.cumsum(RINGS))
    assert [len(ring) for ring in rings] == [*RINGS, 0]
    for polar_angle, ring in zip(range(10, 180, 20), rings, strict=False):
        np.testing.assert_allclose(ring[:, 2], 10.0 * np.cos(np.radians(polar_angle)), atol=1e-14)
        azimuth = np.degrees(np.arctan2(ring[:, 1], ring[:, 0])) % 360.0
        np.testing.assert_allclose(azimuth, 360.0 * np.arange(len(ring)) / len(ring), atol=1e-12)


@pytest.mark.parametrize("wanted", [1, 2, 10, 50, 250, 1000])
def test_about_as_many_points_as_asked_for(wanted):
    points = regular_placement(wanted, 2.0)
    assert abs(len(points) - wanted) <= max(2, 0.06 * wanted)
    np.testing.assert_allclose(np.linalg.norm(points, axis=1), 2.0, rtol=1e-15)


@pytest.mark.parametrize("wanted", [1, 7, 100])
def test_fibonacci_gives_exactly_as_many_evenly_spaced_from_pole_to_pole(wanted):
    points = fibonacci_placement(wanted, 10.0)
    assert points.shape == (wanted, 3)
    np.testing.assert_allclose(np.linalg.norm(points, axis=1), 10.0, rtol=1e-15)
    if wanted == 100:
        apart = np.linalg.norm(points[:, None] - points[None], axis=2)[~np.eye(100, dtype=bool)]
        assert apart.min() > 0.55 * 10.0 * np.sqrt(4.0 * np.pi / 100)
        assert np.all(np.diff(points[:, 1]) < 0.0)
        np.testing.assert_allclose(points[[0, -1], 1], [10.0, -10.0])
        np.testing.assert_allclose(points.mean(axis=0), 0.0, atol=0.02)
