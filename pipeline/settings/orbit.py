"""The chief's orbit: given once, by one of its sizes or by a two-line element set, and how it lies in space.

Angles are to the equator and the equinox of date. With `orbit.epoch` the Sun's direction follows from them.
"""

import math
from abc import abstractmethod
from collections.abc import Iterable
from functools import cached_property
from typing import Annotated, Any, Literal, NamedTuple

from pydantic import AfterValidator, BeforeValidator, Field, Strict

from pipeline.constants import DAY_S, EARTH_GRAVITY_M3_S2, EARTH_RADIUS_M
from pipeline.settings import ephemeris, types
from pipeline.settings.checks import SettingError
from pipeline.settings.conditions import Only
from pipeline.settings.groups import Settings

#: WGS 84
#: least altitude, where the air ends an orbit within a turn
LOWEST_M = 100_000.0
#: relative difference within which two values of a planet's gravity agree
GRAVITY_TOLERANCE = 1e-3
#: the least and the greatest mean motion; the densest planets allow 0.0015 rad/s
SLOWEST_RAD_S, FASTEST_RAD_S = 1e-8, 0.1

Length = Annotated[float, Strict(), Field(gt=0, le=1e9)]
Inclination = Annotated[types.Number, Field(ge=0, le=180)]
#: where the deputy's motion, or the Sun's direction, depends on how the orbit lies
ORIENTED = Only("dynamics.model=two_body", "orbit.epoch")
ABOUT_A_PLANET = ("dynamics.model=two_body", "light.shadow=conical")
#: where the planet's gravity counts
OF_A_PLANET = Only(*ABOUT_A_PLANET, "orbit.kind=radius", "orbit.kind=elements")


def _epoch(text: str) -> str:
    try:
        days = ephemeris.days_of(text)
    except ValueError:
        raise ValueError(
            f"{{key}} is {text!r}; it must be a date and time of UTC, as 2026-11-26T12:00:00"
        ) from None
    if not abs(days) <= ephemeris.MOST_DAYS:
        raise ValueError(f"{{key}} is {text!r}; it must be from 1950 to 2050, where the Sun's formula holds")
    return text


def _two_lines(lines: tuple[str, ...]) -> tuple[str, ...]:
    if len(lines) != 2:
        raise ValueError(f"{{key}} has {len(lines)} lines; it must have two, ['1 ...', '2 ...']")
    for number, line in enumerate(lines, start=1):
        if len(line) != 69 or not line.startswith(f"{number} ") or not line[68].isdigit():
            raise ValueError(
                f"{{key}}[{number - 1}] is {line!r}; it must be line {number} of a set, of 69 characters"
            )
        total = sum(int(letter) if letter.isdigit() else letter == "-" for letter in line[:68]) % 10
        if total != int(line[68]):
            raise ValueError(
                f"{{key}}[{number - 1}] ends in {line[68]}, and its digits give the checksum {total}; copy "
                "the line anew"
            )
    return lines


def _word(value: Any) -> Any:
    """Return the word true where YAML has read it as a truth value."""
    return "true" if value is True else value


class KeplerElements(NamedTuple):
    """Osculating elements at the start of a flight."""

    semi_major_axis_m: float
    eccentricity: float
    inclination_deg: float
    raan_deg: float  # right ascension of the ascending node
    latitude_argument_deg: float  # from the ascending node
    true_anomaly_deg: float  # from the perigee


def least_radius(elements: KeplerElements, mean_turn: float) -> float:
    """Return the least distance from the planet's centre while the mean anomaly grows by an angle, m.

    Parameters
    ----------
    elements : KeplerElements
        At the start.
    mean_turn : float
        The mean motion times the duration, rad.
    """
    size, e = elements.semi_major_axis_m, elements.eccentricity
    half = math.radians(elements.true_anomaly_deg) / 2.0
    began = 2.0 * math.atan2(math.sqrt(1.0 - e) * math.sin(half), math.sqrt(1.0 + e) * math.cos(half))
    began = math.remainder(began, 2.0 * math.pi)
    mean = began - e * math.sin(began)
    if mean <= 0.0 <= mean + mean_turn or mean + mean_turn >= 2.0 * math.pi:
        return size * (1.0 - e)
    # between two perigees the ends are the nearest: Kepler's equation, whose sides grow, by bisection
    low, high = began, began + mean_turn / (1.0 - e)
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if middle - e * math.sin(middle) < mean + mean_turn else (low, middle)
    return size * (1.0 - e * max(math.cos(began), math.cos(low)))


class OrbitSettings(Settings, group="orbit"):
    """The chief's orbit about the Earth."""

    kind: Literal["mean_motion", "elements", "radius", "altitude", "tle"] = "mean_motion"
    """What gives it: the mean motion, Kepler's elements, a circle's radius or altitude, or a TLE."""
    epoch: Annotated[types.Text, AfterValidator(_epoch)] | None = None
    """Time of the start, UTC, from which the Sun's direction follows; null: unknown."""
    course: Annotated[
        Literal["auto", "uniform", "true"], BeforeValidator(_word), Only("dynamics.model=two_body")
    ] = "auto"
    """How Hill axes turn: by the mean motion (uniform), or by the orbit, and the Sun moves (true); auto: true
    on an ellipse and, about an oblate Earth, beside a turning chief and in flights longer than a day."""

    @property
    def mean_motion_rad_s(self) -> float:
        """Mean motion of the chief, rad/s."""
        gravity: float = getattr(self, "gravity_m3_s2", EARTH_GRAVITY_M3_S2)
        return math.sqrt(gravity / self.elements.semi_major_axis_m**3)

    @property
    @abstractmethod
    def elements(self) -> KeplerElements:
        """The elements at the start."""

    @property
    def is_of_earth(self) -> bool:
        """Whether it is about a planet with the Earth's gravity."""
        return True

    @property
    def earth_radii(self) -> float:
        """The planet's radius over the Earth's."""
        return 1.0

    @property
    def days_at_start(self) -> float | None:
        """Days from J2000 to the start; None without an epoch."""
        return None if self.epoch is None else ephemeris.days_of(self.epoch)

    @property
    def start_time(self) -> str | None:
        """The time of the start, UTC, ISO 8601; None if it is unknown."""
        days = self.days_at_start
        return None if days is None else ephemeris.time_of(days)

    @property
    def sun_at_epoch_deg(self) -> tuple[float, float] | None:
        """The Sun's angle in the orbit plane and its elevation over it; None without an epoch."""
        if self.days_at_start is None:
            return None
        _, _, *angles, _ = self.elements
        return ephemeris.sun_in_hill_deg(self.days_at_start, *angles)

    def sun_moved(self, seconds: Iterable[float]) -> tuple[tuple[float, float, float], list[float]]:
        """Return the axis about which the Sun turns, Hill axes of the start, and its turns by then, rad.

        It stays among the stars without an epoch.
        """
        start = self.days_at_start
        if start is None:
            return (0.0, 0.0, 1.0), [0.0 for _ in seconds]
        _, _, *angles, _ = self.elements
        first = ephemeris.sun_longitude(start)
        turns = [ephemeris.sun_longitude(start + time / DAY_S) - first for time in seconds]
        return ephemeris.ecliptic_pole_in_hill(start, *angles), turns


class OrientedOrbit(OrbitSettings):
    """An orbit whose plane is given by angles."""

    inclination_deg: Annotated[Inclination, ORIENTED] = 51.6
    """Inclination of the orbit to the equator."""
    latitude_argument_deg: Annotated[types.Number, ORIENTED] = 0.0
    """The chief's angle from the ascending node at the start."""
    raan_deg: Annotated[types.Number, Only("orbit.epoch")] = 0.0
    """Right ascension of the ascending node, equinox of date."""

    def lying(
        self, semi_major_axis_m: float, eccentricity: float = 0.0, anomaly_deg: float = 0.0
    ) -> KeplerElements:
        """Return the elements of an orbit of a size and a shape."""
        angles = self.inclination_deg, self.raan_deg, self.latitude_argument_deg
        return KeplerElements(semi_major_axis_m, eccentricity, *angles, anomaly_deg)


class PlanetOrbit(OrientedOrbit):
    """An orbit about any planet."""

    gravity_m3_s2: Annotated[types.Positive, OF_A_PLANET] = EARTH_GRAVITY_M3_S2
    """Gravity of the planet, mu; the Earth's unless given."""
    planet_radius_m: Annotated[types.Positive, OF_A_PLANET] | None = None
    """Equatorial radius of the planet, which casts the shadow and is oblate; null: the Earth's."""

    @property
    def is_of_earth(self) -> bool:
        """Whether it is about a planet with the Earth's gravity."""
        return abs(self.gravity_m3_s2 / EARTH_GRAVITY_M3_S2 - 1.0) <= GRAVITY_TOLERANCE

    @property
    def earth_radii(self) -> float:
        """The planet's radius over the Earth's."""
        return 1.0 if self.planet_radius_m is None else self.planet_radius_m / EARTH_RADIUS_M


class EllipticOrbit(PlanetOrbit):
    """An orbit that may be an ellipse."""

    eccentricity: Annotated[types.NotNegative, Field(lt=1), Only("dynamics.model=two_body")] = 0.0
    """Eccentricity of the orbit at the start; 0: a circle."""
    true_anomaly_deg: Annotated[types.Number, Only("dynamics.model=two_body")] = 0.0
    """The chief's angle from the perigee at the start."""


class MeanMotionOrbit(EllipticOrbit, kind="mean_motion"):
    """An orbit of a mean motion."""

    mean_motion_rad_s: Annotated[types.Positive, Field(le=FASTEST_RAD_S)] = 0.0011068
    """Mean motion of the chief."""
    radius_m: Annotated[Length | None, Only(*ABOUT_A_PLANET, "orbit.kind=radius")] = None
    """Radius of the orbit, the semi-major axis of an ellipse; null: that of the mean motion."""

    @property
    def elements(self) -> KeplerElements:
        """The elements at the start."""
        size = self.radius_m
        if size is None:
            size = float((self.gravity_m3_s2 / self.mean_motion_rad_s**2) ** (1.0 / 3.0))
        return self.lying(size, self.eccentricity, self.true_anomaly_deg)


class ElementsOrbit(EllipticOrbit, kind="elements"):
    """An orbit given by Kepler's elements."""

    semi_major_axis_m: Length = 6_878_137.0
    """Semi-major axis."""

    @property
    def elements(self) -> KeplerElements:
        """The elements at the start."""
        return self.lying(self.semi_major_axis_m, self.eccentricity, self.true_anomaly_deg)


class RadiusOrbit(PlanetOrbit, kind="radius"):
    """A circle of a radius."""

    radius_m: Length = 6_878_137.0

    @property
    def elements(self) -> KeplerElements:
        """The elements at the start."""
        return self.lying(self.radius_m)


class AltitudeOrbit(OrientedOrbit, kind="altitude"):
    """A circle at an altitude."""

    altitude_m: Annotated[Length, Field(ge=LOWEST_M)] = 500_000.0
    """Altitude of a circular orbit over the Earth's equator."""

    @property
    def elements(self) -> KeplerElements:
        """The elements at the start."""
        return self.lying(EARTH_RADIUS_M + self.altitude_m)


class TwoLineOrbit(OrbitSettings, kind="tle"):
    """The orbit of an element set."""

    tle: Annotated[types.Texts, AfterValidator(_two_lines)] = ()
    """Two lines, from which SGP4 computes the orbit at orbit.epoch, or at the lines' own if that is null."""

    @cached_property
    def osculating(self) -> tuple[KeplerElements, float]:
        """The elements at the start, and the days from J2000 to it.

        Raises
        ------
        SettingError
            Without lines or the package sgp4, or if the satellite has decayed by then.
        """
        if not self.tle:
            raise SettingError("orbit.kind is tle, and orbit.tle is empty; give its two lines")
        try:
            from sgp4.api import Satrec  # noqa: PLC0415 - optional
        except ImportError as error:
            raise SettingError(
                "orbit.kind is tle, which needs the package sgp4; install it, python -m pip install sgp4, or "
                "give the elements, orbit.kind=elements"
            ) from error
        satellite = Satrec.twoline2rv(*self.tle)
        julian = satellite.jdsatepoch, satellite.jdsatepochF
        if self.epoch is not None:
            julian = ephemeris.J2000, ephemeris.days_of(self.epoch)
        fault, position_km, velocity_km_s = satellite.sgp4(*julian)
        if fault:
            raise SettingError(f"orbit.tle has no orbit at the epoch, SGP4's error {fault}; give a newer one")
        state = [1e3 * value for value in (*position_km, *velocity_km_s)]
        return elements_of(state), julian[0] - ephemeris.J2000 + julian[1]

    @property
    def elements(self) -> KeplerElements:
        """The elements at the start."""
        return self.osculating[0]

    @property
    def days_at_start(self) -> float:
        """Days from J2000 to the epoch, or to that of the element set."""
        return self.osculating[1]


def elements_of(state: list[float]) -> KeplerElements:
    """Return the elements that a position (m) and velocity (m/s) about the Earth osculate.

    Vallado, Fundamentals of Astrodynamics and Applications, 4th edition, algorithm 9; of a circle the anomaly
    is counted from the ascending node.
    """
    x, y, z, u, v, w = state
    radius, along = math.hypot(x, y, z), (x * u + y * v + z * w)
    momentum = (y * w - z * v, z * u - x * w, x * v - y * u)
    square = sum(part * part for part in momentum)
    energy = 0.5 * (u * u + v * v + w * w) - EARTH_GRAVITY_M3_S2 / radius
    axis, parameter = -0.5 * EARTH_GRAVITY_M3_S2 / energy, square / EARTH_GRAVITY_M3_S2
    slope = math.acos(momentum[2] / math.sqrt(square))
    node = math.atan2(momentum[0], -momentum[1])
    level = x * math.cos(node) + y * math.sin(node)
    across = (y * math.cos(node) - x * math.sin(node)) * math.cos(slope) + z * math.sin(slope)
    sine, cosine = math.sqrt(parameter / EARTH_GRAVITY_M3_S2) * along / radius, parameter / radius - 1.0
    angles = slope, node, math.atan2(across, level), math.atan2(sine, cosine)
    return KeplerElements(axis, math.hypot(sine, cosine), *(math.degrees(angle) for angle in angles))
