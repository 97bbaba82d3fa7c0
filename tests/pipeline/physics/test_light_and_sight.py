import numpy as np
import pytest

from pipeline.physics.illumination import ASTRONOMICAL_UNIT_M, sun_angle, sun_direction_h
from pipeline.physics.sight import fits_from, is_facing, is_in_cone, is_lit, sight_of
from tests.pipeline.physics.conditions import is_in_view

RADIUS = 10.0
MEAN_MOTION = 0.0011068


def is_illuminated(point, sun):
    """The paper's condition, ``p . (p - r_s) < 0``."""
    return bool(point @ point - ASTRONOMICAL_UNIT_M * (point @ sun) < 0.0)


def on_the_sphere(angle_from_i):
    return RADIUS * np.array([np.cos(angle_from_i), 0.0, np.sin(angle_from_i)])


def test_the_sun_goes_backwards_through_the_orbit_plane():
    assert sun_angle(1.0, MEAN_MOTION, 3600.0) == pytest.approx(1.0 - 3600.0 * MEAN_MOTION)
    np.testing.assert_allclose(sun_direction_h(np.pi / 2), [0.0, 1.0, 0.0], atol=1e-16)
    np.testing.assert_allclose(sun_direction_h(sun_angle(0.0, MEAN_MOTION, 1.0))[1], -MEAN_MOTION, rtol=1e-6)


def sees(angle_from_i, distance, half_angle=np.pi / 2, off_axis=0.0):
    boresight = np.array([-np.cos(off_axis), 0.0, np.sin(off_axis)])
    position = np.array([distance, 0.0, 0.0])
    return is_in_view(on_the_sphere(angle_from_i), position, boresight, np.cos(half_angle), RADIUS)


def test_the_conditions_without_roots_are_those_of_the_paper():
    rng = np.random.default_rng(8)
    points = rng.normal(size=(200, 3))
    points *= RADIUS / np.linalg.norm(points, axis=1)[:, None]
    for half_angle in (0.1, 0.5, 1.2):
        sight, num_seen = sight_of(RADIUS, half_angle), 0
        for _ in range(40):
            place = rng.normal(size=3) * rng.choice([8.0, 20.0, 60.0])
            boresight = -place / np.linalg.norm(place) + 0.3 * rng.normal(size=3)
            boresight /= np.linalg.norm(boresight)
            sun = sun_direction_h(rng.uniform(0.0, 2.0 * np.pi))
            away = points - place
            squared = np.sum(away**2, axis=1)
            seen = is_facing(sight, points @ place) & is_in_cone(sight, away @ boresight, squared)
            cosine = np.cos(half_angle)
            expected = [is_in_view(point, place, boresight, cosine, RADIUS) for point in points]
            np.testing.assert_array_equal(seen, expected)
            lit = is_lit(sight, points[:, 0], points[:, 1], sun[0], sun[1])
            np.testing.assert_array_equal(lit, [is_illuminated(point, sun) for point in points])
            num_seen += np.count_nonzero(seen)
        assert num_seen > 20


def test_from_afar_the_whole_chief_fits_into_the_field_of_view():
    half_angle = np.radians(15.0)
    distance = np.sqrt(fits_from(sight_of(RADIUS, half_angle)))
    assert distance == pytest.approx(RADIUS / np.sin(half_angle))
    horizon = np.arccos(RADIUS / distance) - 1e-9
    assert sees(horizon, 1.0001 * distance, half_angle)
    assert not sees(horizon, 0.99 * distance, half_angle)
