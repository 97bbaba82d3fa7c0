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


@pytest.mark.parametrize("angle", [0.0, 0.7, np.pi / 2, 3.0, 5.5])
def test_the_subsolar_point_is_lit_and_its_antipode_dark(angle):
    sun = sun_direction_h(angle)
    assert is_illuminated(RADIUS * sun, sun)
    assert not is_illuminated(-RADIUS * sun, sun)


def test_the_terminator_is_dark_and_lies_where_sun_rays_touch_the_sphere():
    sun = sun_direction_h(0.0)
    touch = np.arccos(RADIUS / ASTRONOMICAL_UNIT_M)  # seen from the centre, 6.7e-11 rad short of 90 deg
    assert not is_illuminated(np.array([0.0, RADIUS, 0.0]), sun)
    assert not is_illuminated(np.array([0.0, 0.0, -RADIUS]), sun)
    assert is_illuminated(on_the_sphere(touch - 1e-12), sun)
    assert not is_illuminated(on_the_sphere(touch + 1e-12), sun)


def test_half_of_the_sphere_is_lit():
    rng = np.random.default_rng(5)
    points = rng.normal(size=(400, 3))
    points *= RADIUS / np.linalg.norm(points, axis=1)[:, None]
    sun = sun_direction_h(0.4)
    lit = np.array([is_illuminated(point, sun) for point in points])
    np.testing.assert_array_equal(lit, points @ sun > 0.0)


def sees(angle_from_i, distance, half_angle=np.pi / 2, off_axis=0.0):
    boresight = np.array([-np.cos(off_axis), 0.0, np.sin(off_axis)])
    position = np.array([distance, 0.0, 0.0])
    return is_in_view(on_the_sphere(angle_from_i), position, boresight, np.cos(half_angle), RADIUS)


@pytest.mark.parametrize("distance", [15.0, 20.0, 75.0, 200.0])
def test_the_horizon_is_where_lines_of_sight_touch_the_sphere(distance):
    horizon = np.arccos(RADIUS / distance)
    assert sees(horizon - 1e-9, distance)
    assert not sees(horizon + 1e-9, distance)
    assert not sees(np.pi, distance)


def test_nothing_is_in_view_from_inside():
    assert not any(sees(angle, 9.0) for angle in np.linspace(0.0, np.pi, 50))


@pytest.mark.parametrize("off_axis", [0.0, 0.1, -0.1])
def test_the_field_of_view_is_a_cone_about_the_boresight(off_axis):
    half_angle, distance = np.radians(8.0), 40.0
    for side in (-1.0, 1.0):
        for inside in (True, False):
            # from the angle at the deputy to that at the chief, by the triangle chief, point, deputy
            at_deputy = off_axis + side * (half_angle + (-1e-9 if inside else 1e-9))
            opposite = np.pi - np.arcsin(distance * np.sin(abs(at_deputy)) / RADIUS)
            at_chief = np.pi - abs(at_deputy) - opposite
            point_angle = np.sign(at_deputy) * at_chief
            assert sees(point_angle, distance, half_angle, off_axis) is inside


def test_what_lies_behind_the_camera_is_not_in_view():
    assert not sees(0.0, 40.0, np.radians(15.0), np.pi)


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
