"""The chief's orbit, for missions where the deputy moves about the Earth."""

from pipeline.physics.illumination import EARTH_RADIUS_M, orbit_radius
from pipeline.physics.orbit import NO_COURSE, Course, course_of
from pipeline.settings.experiment import Mission, Orbit, SettingError


def chief_course(mission: Mission) -> Course:
    """Return the course of a mission's chief, over the whole flight.

    Raises
    ------
    SettingError
        If the orbit intersects the Earth.
    """
    orbit, dynamics = mission.orbit, mission.dynamics
    if dynamics.model == "cw":
        return NO_COURSE
    check_perigee(mission)
    chief = orbit.mean_motion_rad_s, semi_major_axis(orbit), dynamics
    return course_of(*chief, mission.light.shadow != "none", mission.control_period_s, mission.num_controls)


def semi_major_axis(orbit: Orbit) -> float:
    """Return the semi-major axis of an orbit, the radius of a circular one, m."""
    return orbit_radius(orbit.mean_motion_rad_s) if orbit.radius_m is None else orbit.radius_m


def check_perigee(mission: Mission) -> None:
    """Raise SettingError if an orbit intersects the Earth."""
    dynamics, axis = mission.dynamics, semi_major_axis(mission.orbit)
    perigee = axis * (1.0 - dynamics.eccentricity)
    if dynamics.model != "cw" and not perigee > EARTH_RADIUS_M:
        raise SettingError(
            f"the orbit's perigee is {perigee:,.0f} m from the Earth's centre, inside the Earth about which "
            f"dynamics.model={dynamics.model} flies; it must be greater than {EARTH_RADIUS_M:,.0f} m: lower "
            "orbit.mean_motion_rad_s or dynamics.eccentricity, or set orbit.radius_m"
        )
