"""The Sun's direction at a time, by the low-precision formula of the Astronomical Almanac (section C).

It is good to 0.01 deg from 1950 to 2050; times are of UTC, which differ from the formula's by a minute.
"""

from datetime import UTC, datetime, timedelta
from math import asin, atan2, cos, degrees, radians, sin
from typing import Final

from pipeline.constants import DAY_S

#: Julian date of 2000 January 1, 12 h
J2000: Final = 2_451_545.0
MOST_DAYS: Final = 50 * 365.25


_J2000: Final = datetime(2000, 1, 1, 12, tzinfo=UTC)


def time_of(days: float) -> str:
    """Return the time of UTC some days after J2000, ISO 8601."""
    return (_J2000 + timedelta(days=days)).isoformat()


def days_of(epoch: str) -> float:
    """Return the days from J2000 to a time of UTC in ISO 8601.

    Raises
    ------
    ValueError
        For other texts.
    """
    time = datetime.fromisoformat(epoch)
    time = time.replace(tzinfo=UTC) if time.tzinfo is None else time
    return (time - _J2000).total_seconds() / DAY_S


def sun_longitude(days: float) -> float:
    """Return the Sun's longitude along the ecliptic some days after J2000, equinox of date, rad."""
    mean_longitude, anomaly = 280.460 + 0.9856474 * days, radians(357.528 + 0.9856003 * days)
    return radians(mean_longitude + 1.915 * sin(anomaly) + 0.020 * sin(2.0 * anomaly))


def _obliquity(days: float) -> float:
    return radians(23.439 - 0.0000004 * days)


def sun_direction(days: float) -> tuple[float, float, float]:
    """Return the unit vector to the Sun some days after J2000, equator and equinox of date."""
    longitude, obliquity = sun_longitude(days), _obliquity(days)
    return cos(longitude), cos(obliquity) * sin(longitude), sin(obliquity) * sin(longitude)


def sun_in_hill_deg(
    days: float, inclination_deg: float, raan_deg: float, latitude_argument_deg: float
) -> tuple[float, float]:
    """Return the Sun's angle in the orbit plane, from +i towards +j, and its elevation over it, deg."""
    level, ahead, up = _in_plane(sun_direction(days), inclination_deg, raan_deg)
    angle = degrees(atan2(ahead, level)) - latitude_argument_deg
    return angle % 360.0, degrees(asin(up))


def ecliptic_pole_in_hill(
    days: float, inclination_deg: float, raan_deg: float, latitude_argument_deg: float
) -> tuple[float, float, float]:
    """Return the unit vector along the ecliptic's pole, about which the Sun moves, Hill axes."""
    pole = 0.0, -sin(_obliquity(days)), cos(_obliquity(days))
    level, ahead, up = _in_plane(pole, inclination_deg, raan_deg)
    latitude = radians(latitude_argument_deg)
    along = level * cos(latitude) + ahead * sin(latitude)
    return along, ahead * cos(latitude) - level * sin(latitude), up


def _in_plane(
    direction: tuple[float, float, float], inclination_deg: float, raan_deg: float
) -> tuple[float, float, float]:
    """Return components towards the ascending node, ahead of it in the orbit plane, and along its normal."""
    x, y, z = direction
    slope, node = radians(inclination_deg), radians(raan_deg)
    level, across = x * cos(node) + y * sin(node), y * cos(node) - x * sin(node)
    return level, across * cos(slope) + z * sin(slope), z * cos(slope) - across * sin(slope)
