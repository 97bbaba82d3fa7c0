"""Which points the deputy's camera sees (docs/explanation/light-and-camera.md)."""

import numpy as np

from pipeline.array_types import Booleans, Floats
from pipeline.flight.reference.flight import ReferenceFlight
from pipeline.flight.reference.light import SunAngles, sun_direction
from pipeline.settings.equipment import Sensor
from pipeline.settings.mission import Light


def seen_points(
    flight: ReferenceFlight, k: int, position: Floats, boresight: Floats, sun: SunAngles
) -> Booleans:
    """Return which points a camera at a position sees along a boresight at a sample, lit or not, (P,)."""
    mission, sensor, direction = flight.mission, flight.mission.sensor, sun_direction(*sun)
    points, normals = flight.surface_at(k)
    to_camera = position - points
    distance, above = np.linalg.norm(to_camera, axis=1), np.sum(normals * to_camera, axis=1)
    is_seen = np.asarray(above >= least_cosine(sensor) * distance)
    if sensor.half_angle_deg < 180.0:
        is_seen &= -to_camera @ boresight >= np.cos(np.radians(sensor.half_angle_deg)) * distance
    is_seen &= distance >= sensor.min_range_m
    if sensor.max_range_m is not None:
        is_seen &= distance <= sensor.max_range_m
    if (
        boresight @ direction > np.cos(np.radians(sensor.min_sun_angle_deg))
        and sensor.min_sun_angle_deg > 0.0
    ):
        is_seen[:] = False
    if mission.light.reflection != "none":
        is_seen &= is_bright(mission.light, normals, direction, to_camera / distance[:, np.newaxis])
    return is_seen & flight.free_towards(to_camera, is_seen, k)


def least_cosine(sensor: Sensor) -> float:
    """Return the cosine of the greatest incidence, exactly 0 at 90 degrees."""
    return 0.0 if sensor.max_incidence_deg == 90.0 else float(np.cos(np.radians(sensor.max_incidence_deg)))


def is_bright(light: Light, normals: Floats, sun: Floats, to_camera: Floats) -> Booleans:
    """Return whether what points reflect is between the limits in each colour, (P,).

    Blinn, Models of light reflection for computer synthesized pictures, Computer Graphics 11, 1977:
    ``ambient + diffuse n.l + specular (n.h)^p``, at most 1, h halfway between the Sun and the camera.
    """
    halfway = sun + to_camera
    halfway /= np.linalg.norm(halfway, axis=1)[:, np.newaxis]
    facing = np.maximum(0.0, normals @ sun)[:, np.newaxis]
    glancing = np.maximum(0.0, np.sum(normals * halfway, axis=1))[:, np.newaxis] ** light.specular_exponent
    colours = light.ambient + np.array(light.diffuse) * facing + np.array(light.specular) * glancing
    colours = np.minimum(1.0, colours)
    is_between = (colours > np.array(light.least_intensity)) & (colours < np.array(light.greatest_intensity))
    return np.asarray(np.all(is_between, axis=1))
