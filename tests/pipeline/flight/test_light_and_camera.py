"""Flights under a Sun out of the orbit plane, in the Earth's shadow, and with cameras of limited sight."""

from dataclasses import replace

import numpy as np
import pytest

from pipeline.flight.cases.starts import starts_of
from pipeline.flight.control.controller import coast
from pipeline.flight.fly.simulation import fly_all, fly_logged
from pipeline.flight.fly.workspace import inspectable_points
from pipeline.flight.state.log import Scenario
from pipeline.flight.world.pack import pack_world
from pipeline.settings.mission_parts import Light
from tests.pipeline.flight.as_written import assert_as_written
from tests.pipeline.flight.cases import SEEING, STARTS, mission
from tests.pipeline.flight.missions import IDEAL, MEAN_MOTION

POINTED = IDEAL.attitude
SHADOW = Light(shadow="conical")
#: seen where it reflects neither too little nor too much, and while the Sun is 3 degrees below the horizon
GLITTER = Light(
    past_terminator_deg=3.0,
    reflection="blinn_phong",
    least_intensity=(0.7,) * 3,
    greatest_intensity=(2.0, 0.95, 2.0),
)
TILTED = [replace(start, sun_elevation_rad=up) for start, up in zip(STARTS, (0.5, -0.3, 1.2), strict=True)]
WORLDS = {
    "a Sun out of the plane": mission(attitude=POINTED),
    "shadow": mission(attitude=POINTED, light=SHADOW),
    "a camera of little sight": mission(
        attitude=POINTED,
        sensor={"max_incidence_deg": 65.0, "max_range_m": 90.0, "min_sun_angle_deg": 35.0},
    ),
    "a camera that sees more than half of all, backwards": mission(
        attitude=POINTED, sensor={"half_angle_deg": 120.0, "boresight": (0.0, 0.0, 1.0)}
    ),
    "all of it on a chief that tumbles": mission(
        attitude=POINTED,
        light=replace(GLITTER, shadow="conical", min_fraction=1.0),
        sensor={"max_incidence_deg": 65.0},
        chief={"initial_angular_velocity_rad_s": (0.003, 0.0, 0.002)},
    ),
}


@pytest.mark.parametrize(
    "name", ["shadow", *(pytest.param(name, marks=pytest.mark.slow) for name in WORLDS if name != "shadow")]
)
def test_flights_are_as_written(name: str) -> None:
    for start in (TILTED[0], STARTS[1]):
        assert_as_written(replace(WORLDS[name], duration_s=600.0), SEEING, start)


@pytest.mark.parametrize(("elevation_deg", "most"), [(0.0, 99), (30.0, 87), (60.0, 74), (90.0, 41)])
def test_points_on_the_far_side_of_a_high_sun_are_never_lit(elevation_deg: float, most: int) -> None:
    """Counted over whole orbits by rings of latitude: a ring is lit once its sunward point is."""
    start = replace(STARTS[0], sun_elevation_rad=np.radians(elevation_deg))
    world = pack_world(mission(duration_s=5680.0))
    (lit,) = inspectable_points(world, starts_of([start]))
    assert lit.sum() == most


def test_the_hour_from_noon_in_the_orbit_plane_lights_80_points_beside_the_shadow() -> None:
    noon = Scenario(np.array([0.0, 60.0, 0.0]), np.zeros(3), 0.0)
    log = fly_logged(mission(light=SHADOW), coast(), noon)
    assert log.is_inspectable.sum() == 80
    dark = np.flatnonzero(log.visible_sun_share < 0.5)
    assert dark[0] * 10.0 == pytest.approx(1766.0, abs=10.0)
    outcomes = fly_all(mission(light=SHADOW), coast(), [noon])
    assert outcomes.inspectable_count[0] == 80
    assert outcomes.inspected_count[0] == log.is_inspected[-1].sum()


def test_a_flight_is_over_when_all_is_inspected_that_can_be() -> None:
    """After the last point that is ever lit the deputy fires no more, though others are never seen."""
    what, start = mission(attitude=POINTED), TILTED[1]
    log = fly_logged(what, SEEING, start)
    count, inspectable = log.is_inspected.sum(axis=1), log.is_inspectable.sum()
    assert inspectable == 95
    assert count[-1] == inspectable
    done = int(np.argmax(count == inspectable))
    assert done < 340
    assert not log.force_hill_n[done:].any()


def test_a_day_of_orbits_flies_as_one_hour_does() -> None:
    """Three orbits: the Sun turns three times, and what is seen in the first is in the longer flight, too."""
    short, long = mission(light=SHADOW, duration_s=5680.0), mission(light=SHADOW, duration_s=17030.0)
    start = Scenario(np.array([0.0, 60.0, 0.0]), np.zeros(3), 0.0)
    first, whole = fly_logged(short, coast(), start), fly_logged(long, coast(), start)
    assert first.is_inspectable.all()
    np.testing.assert_array_equal(whole.is_inspected[: len(first.is_inspected)], first.is_inspected)
    shadowed = np.diff((whole.visible_sun_share < 0.5).astype(int))
    assert np.count_nonzero(shadowed == 1) == 3
    orbit = 2.0 * np.pi / MEAN_MOTION
    assert np.diff(np.flatnonzero(shadowed == 1)).tolist() == pytest.approx([orbit / 10.0] * 2, abs=1.0)
