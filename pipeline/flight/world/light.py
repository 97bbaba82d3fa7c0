"""When the Sun shines on the chief, and whether light and camera are the paper's."""

import numpy as np

from pipeline.array_types import Floats
from pipeline.flight.world.course import semi_major_axis
from pipeline.physics.illumination import EARTH_RADIUS_M, sun_direction_h, visible_share
from pipeline.physics.reflection import Reflection
from pipeline.settings.experiment import Light, Mission, Orbit, SettingError

RIGHT_ANGLE_DEG, STRAIGHT_ANGLE_DEG = 90.0, 180.0


def sees_as_in_the_paper(mission: Mission) -> bool:
    """Return whether light and camera are the paper's, given a Sun in the orbit plane."""
    sensor = mission.sensor
    return (
        mission.light.shadow == "none"
        and mission.chief.shape == "sphere"
        and sensor.half_angle_deg < RIGHT_ANGLE_DEG
        and sensor.max_incidence_deg == RIGHT_ANGLE_DEG
        and sensor.max_range_m is None
        and sensor.min_sun_angle_deg == 0.0
        and mission.light.past_terminator_deg == 0.0
        and mission.light.reflection == "none"
    )


def reflection_of(light: Light) -> Reflection:
    """Return the chief's reflection model."""
    colours = light.ambient, light.diffuse, light.specular, light.least_intensity, light.greatest_intensity
    ambient, diffuse, specular, least, greatest = (np.array(colour, dtype=np.float64) for colour in colours)
    is_on, exponent = light.reflection != "none", light.specular_exponent
    return Reflection(is_on, ambient, diffuse, specular, exponent, least, greatest)


def shadowing_radius(orbit: Orbit, light: Light) -> float:
    """Return the radius of the orbit on which the chief passes through the Earth's shadow, m.

    Raises
    ------
    SettingError
        If the orbit lies inside the Earth.
    """
    radius = semi_major_axis(orbit)
    if not radius > EARTH_RADIUS_M:
        raise SettingError(
            f"the orbit's radius is {radius:,.0f} m, inside the Earth whose shadow light.shadow="
            f"{light.shadow} asks for; it must be greater than {EARTH_RADIUS_M:,.0f} m: lower "
            "orbit.mean_motion_rad_s, or set orbit.radius_m"
        )
    return radius


def sun_shares(mission: Mission, angles: Floats, elevations: Floats) -> Floats:
    """Return the share of the Sun's disc visible from the chief at each of the Sun's places, shape (n,)."""
    if mission.light.shadow == "none":
        return np.ones(len(angles))
    radius = shadowing_radius(mission.orbit, mission.light)
    places = zip(angles.tolist(), elevations.tolist(), strict=True)
    return np.array([visible_share(sun_direction_h(*place), radius) for place in places])
