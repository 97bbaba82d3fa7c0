"""Flights under a Sun out of the orbit plane, in the Earth's shadow, with cameras of limited sight.

Also a chief of real shape: points on its faces, and what it hides of itself, against trimesh's rays.
"""

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
import trimesh

from fis_tools.compiled.three import Three
from pipeline.flight.cases.starts import cases_of, starts_of
from pipeline.flight.control.controller import coast
from pipeline.flight.control.law import law_of
from pipeline.flight.fly.population import FlightError, fly_population
from pipeline.flight.fly.simulation import fly_all, fly_logged
from pipeline.flight.fly.workspace import points_of_cases
from pipeline.flight.state.log import Scenario
from pipeline.flight.world.chief import num_chief_steps
from pipeline.flight.world.pack import pack_world
from pipeline.flight.world.surface import ChiefSurface, surface_of
from pipeline.physics.sight import EDGE_CELLS, cell_of, centre_of
from pipeline.settings.experiment import Mission, SettingError
from pipeline.settings.mission import Light
from tests.pipeline.flight.cases import SEEING, STARTS, isotropic, mission
from tests.pipeline.flight.missions import IDEAL

SHADOW = Light(shadow="conical")
NOON = Scenario(np.array([0.0, 60.0, 0.0]), np.zeros(3), 0.0)


@pytest.mark.parametrize(("elevation_deg", "most"), [(0.0, 99), (30.0, 87), (60.0, 74), (90.0, 41)])
def test_points_on_the_far_side_of_a_high_sun_are_never_lit(elevation_deg: float, most: int) -> None:
    """Counted over whole orbits by rings of latitude: a ring is lit once its sunward point is."""
    start = replace(STARTS[0], sun_elevation_rad=np.radians(elevation_deg))
    world = pack_world(mission(duration_s=5680.0))
    (lit,), _ = points_of_cases(world, starts_of([start]))
    assert lit.sum() == most


def test_the_hour_from_noon_in_the_orbit_plane_lights_80_points_beside_the_shadow() -> None:
    log = fly_logged(mission(light=SHADOW), coast(), NOON)
    assert log.is_inspectable.sum() == 80
    dark = np.flatnonzero(log.visible_sun_share < 0.5)
    assert dark[0] * 10.0 == pytest.approx(1766.0, abs=10.0)
    outcomes = fly_all(mission(light=SHADOW), coast(), [NOON])
    assert outcomes.inspectable_count[0] == 80
    assert outcomes.inspected_count[0] == log.is_inspected[-1].sum()


def test_a_flight_is_over_when_all_is_inspected_that_can_be() -> None:
    """After the last point that is ever lit the deputy fires no more, though others are never seen."""
    what = mission(attitude=IDEAL.attitude)
    start = replace(STARTS[1], sun_elevation_rad=-0.3)
    log = fly_logged(what, SEEING, start)
    left = log.is_inspectable & ~log.is_inspected
    assert log.is_inspectable.sum() == 95
    done = int(np.argmin(left.any(axis=1)))
    assert 0 < done < 340
    assert not log.force_hill_n[done:].any()


def tumbling(rate, **changes):
    inertia = ((1.0, 0.0, 0.0), (0.0, 2.0, 0.0), (0.0, 0.0, 2.9))
    return mission(chief={"initial_angular_velocity_rad_s": rate, "inertia_kg_m2": inertia}, **changes)


def test_a_slow_chief_is_turned_by_the_second_and_one_too_fast_to_be_followed_is_refused():
    assert num_chief_steps(tumbling((0.0005, 0.0, 0.002))) == 10
    with pytest.raises(SettingError, match=r"takes .* steps"):
        num_chief_steps(tumbling((3.0, 4.0, 5.0), duration_s=36_000.0))


MINUTE = mission(duration_s=60.0)


def test_a_flight_that_does_not_stay_finite_is_no_result():
    start = Scenario(np.array([1e200, 0.0, 0.0]), np.array([1e308, 1e308, 0.0]), 0.0)
    for fly in (lambda: fly_all(MINUTE, coast(), [start]), lambda: fly_logged(MINUTE, coast(), start)):
        with pytest.raises(FlightError, match="did not stay finite"):
            fly()


def test_an_attitude_that_does_not_stay_finite_is_no_result():
    world = pack_world(MINUTE)
    gain = 1e300 * np.eye(3)
    wild = world._replace(proportional_gain=gain, derivative_gain=gain, max_torque=1e300)
    flown = law_of(coast(), MINUTE), coast().numbers, cases_of(MINUTE, STARTS[:1])
    assert np.isfinite(fly_population(world, *flown).delta_v_m_s).all()
    with pytest.raises(FlightError, match="did not stay finite"):
        fly_population(wild, *flown)


def satellite(**changes: object) -> Mission:
    return mission(attitude=IDEAL.attitude, chief={"shape": "mesh"}, **changes)


@cache
def surface() -> ChiefSurface:
    return surface_of(satellite())


def body_of(corners: np.ndarray, **how: bool) -> trimesh.Trimesh:
    return trimesh.Trimesh(corners.reshape(-1, 3), np.arange(3 * len(corners)).reshape(-1, 3), **how)


def rays_are_free(directions: np.ndarray, points: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """Whether rays from points meet nothing, by trimesh; away from the surface they cannot be."""
    body = body_of(surface().corners, process=False)
    met = body.ray.intersects_any(points + 1e-5 * normals, directions)
    return ~met & (np.sum(normals * directions, axis=1) > 0.0)


def cells_of(directions: np.ndarray) -> np.ndarray:
    return np.array([cell_of(EDGE_CELLS, Three(*direction)) for direction in directions])


@pytest.mark.slow
def test_points_lie_evenly_on_the_faces_and_look_out_of_the_body() -> None:
    spread = surface()
    assert 80 <= len(spread.points) <= 100
    body = body_of(spread.corners)
    assert np.abs(trimesh.proximity.signed_distance(body, spread.points)).max() < 1e-9
    assert body.contains(spread.points - 1e-3 * spread.normals).all()
    apart = np.linalg.norm(spread.points[:, np.newaxis] - spread.points, axis=2)
    sameside = spread.normals @ spread.normals.T > 0.5
    np.fill_diagonal(apart, np.inf)
    nearest = np.where(sameside, apart, np.inf).min(axis=1)
    # a square lattice's spacing is the root of area by points
    assert nearest.min() > 0.5 * np.sqrt(body.area / 100)
    again = surface_of(satellite())
    np.testing.assert_array_equal(again.points, spread.points)


def test_a_direction_falls_into_the_cell_whose_centre_is_within_21_tenths_of_a_degree() -> None:
    directions = isotropic(np.random.default_rng(3), 2000)
    centres = np.array([centre_of(EDGE_CELLS, cell) for cell in cells_of(directions)])
    off = np.degrees(np.arccos(np.clip(np.sum(centres * directions, axis=1), -1.0, 1.0)))
    assert off.max() < 2.1
    cells = np.arange(6 * EDGE_CELLS**2)
    np.testing.assert_array_equal(cells_of([centre_of(EDGE_CELLS, cell) for cell in cells]), cells)


@pytest.mark.slow
def test_the_table_is_right_where_it_was_looked_and_nearly_everywhere_else() -> None:
    """At cells' centres as trimesh's rays; elsewhere wrong near an edge only, for 0.15 % of rays."""
    spread, generator = surface(), np.random.default_rng(4)
    cells = generator.integers(0, 6 * EDGE_CELLS**2, 400)
    points = generator.integers(0, len(spread.points), 400)
    centres = np.array([centre_of(EDGE_CELLS, int(cell)) for cell in cells])
    there = rays_are_free(centres, spread.points[points], spread.normals[points])
    by_table = spread.occlusion.is_free[cells, points] > 0
    assert np.mean(by_table != there) <= 0.0025
    assert 0.2 < there.mean() < 0.6
    directions = isotropic(generator, 2000)
    points = generator.integers(0, len(spread.points), 2000)
    cells = cells_of(directions)
    by_table = spread.occlusion.is_free[cells, points] > 0
    wrong = by_table != rays_are_free(directions, spread.points[points], spread.normals[points])
    assert wrong.mean() < 0.005
    # what the table adds to the sight of a convex body
    hidden = ~by_table & (np.sum(spread.normals[points] * directions, axis=1) > 0.0)
    assert hidden.mean() > 5.0 * wrong.mean()


def test_meshes_that_cannot_be(tmp_path: Path) -> None:
    wrong = tmp_path / "wrong.stl"
    wrong.write_text("no mesh")
    large = tmp_path / "large.stl"
    trimesh.creation.box((40.0, 1.0, 1.0)).export(large)
    none = tmp_path / "none.obj"
    for path, words in ((wrong, "cannot be read|0 triangles"), (large, r"reaches 20 m"), (none, "cannot")):
        what = mission(chief={"shape": "mesh", "path": str(path)})
        with pytest.raises(SettingError, match=words):
            surface_of(what)
