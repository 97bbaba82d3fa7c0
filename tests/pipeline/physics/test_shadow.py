"""The Earth's shadow against an integration over the Sun's disc and closed forms of eclipses."""

import numpy as np
import pytest

from pipeline.physics.illumination import (
    ASTRONOMICAL_UNIT_M,
    EARTH_RADIUS_M,
    SUN_RADIUS_M,
    least_sun_height,
    orbit_radius,
    sun_direction_h,
    visible_share,
)

pytestmark = pytest.mark.slow

MEAN_MOTION = 0.0011068
RADIUS = orbit_radius(MEAN_MOTION)


def integrated_share(sun_h: np.ndarray) -> float:
    """Rays from the chief to a fine lattice on the Sun's disc, each missing the Earth's sphere or not."""
    reach = SUN_RADIUS_M / ASTRONOMICAL_UNIT_M
    ticks = np.linspace(-1.0, 1.0, 501)
    u, v = np.meshgrid(ticks, ticks)
    inside = u**2 + v**2 <= 1.0
    across = np.linalg.svd(sun_h[np.newaxis])[2][1:]
    rays = sun_h + reach * (u[inside, np.newaxis] * across[0] + v[inside, np.newaxis] * across[1])
    rays /= np.linalg.norm(rays, axis=1)[:, np.newaxis]
    # the chief is at RADIUS along i from the Earth's centre
    along = RADIUS * rays[:, 0]
    misses = (along > 0.0) | (RADIUS**2 - along**2 > EARTH_RADIUS_M**2)
    return float(np.mean(misses))


def test_the_orbit_of_the_paper_is_500_km_high() -> None:
    assert pytest.approx(EARTH_RADIUS_M + 500e3, abs=500.0) == RADIUS


@pytest.mark.parametrize("elevation", [0.0, 0.6, -1.1])
def test_the_penumbra_is_that_of_rays_to_the_suns_disc(elevation: float) -> None:
    edge = np.arccos(-np.sqrt(1.0 - (EARTH_RADIUS_M / RADIUS) ** 2) / np.cos(elevation))
    shares = []
    for angle in edge + np.linspace(-0.05, 0.05, 21):
        sun_h = sun_direction_h(angle, elevation)
        shares.append(visible_share(sun_h, RADIUS))
        assert shares[-1] == pytest.approx(integrated_share(sun_h), abs=2e-3)
    assert max(shares) == 1.0
    assert min(shares) == 0.0
    assert any(0.1 < share < 0.9 for share in shares)


@pytest.mark.parametrize("min_share", [0.1, 0.5, 1.0])
def test_one_height_of_the_sun_tells_light_from_shadow(min_share: float) -> None:
    least = least_sun_height(RADIUS, min_share)
    for angle in (np.arccos(least) - 1e-6, np.arccos(least) + 1e-6):
        share = visible_share(sun_direction_h(angle), RADIUS)
        assert (share >= min_share) == (np.cos(angle) >= least)
        assert share == pytest.approx(min_share, abs=2e-4)
    assert least_sun_height(RADIUS, 0.0) == -2.0


def test_eclipses_last_as_long_as_they_are_published_to() -> None:
    """37.8 % of a 500 km orbit in its Sun's plane; none for a Sun more than 68 deg above it."""
    angles = np.linspace(0.0, 2.0 * np.pi, 20_001)
    least = least_sun_height(RADIUS, 0.5)
    assert np.mean(np.cos(angles) < least) == pytest.approx(0.378, abs=0.0005)
    closed_form = np.arcsin(EARTH_RADIUS_M / RADIUS) / np.pi  # a cylinder's shadow
    assert np.mean(np.cos(angles) < least) == pytest.approx(closed_form, abs=0.001)
    highest = np.degrees(np.arccos(-least))
    assert highest == pytest.approx(68.0, abs=0.1)
    assert visible_share(sun_direction_h(np.pi, np.radians(68.5)), RADIUS) == 1.0
    assert visible_share(sun_direction_h(np.pi, np.radians(67.5)), RADIUS) == 0.0


def test_a_small_earth_far_away_makes_a_ring_of_the_sun() -> None:
    far = 2.5e9
    ratio = np.arcsin(EARTH_RADIUS_M / far) / np.arcsin(SUN_RADIUS_M / ASTRONOMICAL_UNIT_M)
    assert visible_share(np.array([-1.0, 0.0, 0.0]), far) == pytest.approx(1.0 - ratio**2, rel=1e-6)
