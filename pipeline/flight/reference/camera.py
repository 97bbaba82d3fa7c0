"""Which points the deputy's camera sees (docs/explanation/motion.md)."""

import numpy as np
from scipy.spatial.transform import Rotation

from pipeline.array_types import Booleans, Floats
from pipeline.flight.reference.flight import ReferenceFlight
from pipeline.flight.reference.light import SunAngles, sun_direction
from pipeline.flight.reference.pointing import next_y
from pipeline.settings.equipment import Sensor
from pipeline.settings.experiment import Mission
from pipeline.settings.mission import Light


def seen_points(
    flight: ReferenceFlight, k: int, position: Floats, camera: Rotation, sun: SunAngles
) -> Booleans:
    """Return which points a camera at a position sees at a sample, lit or not, (P,).

    The rotation leads from axes of the camera to Hill's: its boresight, up in its image, and across.
    """
    mission, sensor, direction = flight.mission, flight.mission.sensor, sun_direction(*sun)
    points, normals = flight.surface_at(k)
    to_camera = position - points
    distance, above = np.linalg.norm(to_camera, axis=1), np.sum(normals * to_camera, axis=1)
    is_seen = np.asarray(above >= least_cosine(sensor) * distance)
    boresight = camera.apply([1.0, 0.0, 0.0])
    if sensor.rectangle_deg is not None:
        ahead, up, across = camera.inv().apply(-to_camera).T
        angles = np.degrees(np.arctan2(np.abs([across, up]), ahead))
        is_seen &= np.all(sensor.rectangle_deg >= angles.T, axis=1)
    elif sensor.half_angle_deg < 180.0:
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


def held(attitude: Rotation, sensor: Sensor) -> Rotation:
    """Return the rotation from camera to Hill axes, for a body with this rotation from body to Hill axes."""
    boresight = np.array(sensor.boresight)
    up = np.array(sensor.up) - sensor.up @ boresight * boresight
    up = up / np.linalg.norm(up) if np.any(up) else np.cross(boresight, np.roll(boresight, 1))
    return attitude * Rotation.from_matrix(np.column_stack((boresight, up, np.cross(boresight, up))))


def aimed(mission: Mission, position: Floats) -> Rotation:
    """Return the axes of a camera that is aimed at the chief's centre as the desired attitude aims it."""
    away = position / np.linalg.norm(position)
    up = np.cross(away, next_y(mission, position, None))
    return Rotation.from_matrix(np.column_stack((-away, up, np.cross(-away, up))))


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
