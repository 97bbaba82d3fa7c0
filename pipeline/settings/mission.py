"""The world of a flight and its limits, as frozen data: the groups that make a mission."""

import math
from dataclasses import dataclass
from typing import Literal

from pipeline.settings import checks
from pipeline.settings.checks import SettingError

#: beyond these a flight fills the memory of any computer
MOST_POINTS, MOST_CONTROLS = 10_000, 100_000
#: beyond so many control periods of free drift the safety layer takes longer than the flight
MOST_HORIZONS = 10_000


@dataclass(frozen=True, kw_only=True)
class Orbit:
    """The chief's circular orbit."""

    mean_motion_rad_s: float

    def __post_init__(self) -> None:
        """Refuse an orbit that does not go round."""
        checks.positive("orbit.mean_motion_rad_s", self.mean_motion_rad_s, "rad/s")


@dataclass(frozen=True, kw_only=True)
class Deputy:
    """The inspecting spacecraft, its start (Hill axes) and its limits."""

    mass_kg: float
    inertia_kg_m2: tuple[tuple[float, ...], ...]
    initial_position_m: tuple[float, ...]
    initial_velocity_m_s: tuple[float, ...]
    max_force_n: float
    max_torque_n_m: float
    min_distance_m: float
    max_distance_m: float

    def __post_init__(self) -> None:
        """Refuse bodies and limits that cannot be."""
        checks.positive("deputy.mass_kg", self.mass_kg, "kg")
        checks.within("deputy.mass_kg", self.mass_kg, 1e-3, math.inf, "kg")
        checks.inertia("deputy.inertia_kg_m2", self.inertia_kg_m2)
        checks.vector("deputy.initial_position_m", self.initial_position_m, "m")
        checks.vector("deputy.initial_velocity_m_s", self.initial_velocity_m_s, "m/s")
        checks.positive("deputy.max_force_n", self.max_force_n, "N")
        checks.positive("deputy.max_torque_n_m", self.max_torque_n_m, "N m")
        checks.within("deputy.min_distance_m", self.min_distance_m, 0.0, math.inf, "m")
        checks.ascending(
            "deputy.min_distance_m", self.min_distance_m, "deputy.max_distance_m", self.max_distance_m, "m"
        )
        if not math.hypot(*self.initial_velocity_m_s) <= 1e3:
            raise SettingError(
                f"deputy.initial_velocity_m_s is {list(self.initial_velocity_m_s)}; its length must be at "
                "most 1000 (m/s), for it is relative to the chief"
            )
        if not math.hypot(*self.initial_position_m) > 1e-6:
            raise SettingError(
                f"deputy.initial_position_m is {list(self.initial_position_m)}, the chief's own place, "
                "from where there is no line of sight to it; start at a distance from it"
            )


@dataclass(frozen=True, kw_only=True)
class Chief:
    """The inspected spacecraft and the points on it."""

    inertia_kg_m2: tuple[tuple[float, ...], ...]
    #: inertial rate in chief axes; None keeps the chief aligned with Hill
    initial_angular_velocity_rad_s: tuple[float, ...] | None
    inspection_radius_m: float
    num_points: int
    placement: Literal["deserno", "fibonacci"]

    def __post_init__(self) -> None:
        """Refuse bodies and points that cannot be."""
        checks.inertia("chief.inertia_kg_m2", self.inertia_kg_m2)
        if self.initial_angular_velocity_rad_s is not None:
            checks.vector(
                "chief.initial_angular_velocity_rad_s", self.initial_angular_velocity_rad_s, "rad/s"
            )
        checks.positive("chief.inspection_radius_m", self.inspection_radius_m, "m")
        checks.count("chief.num_points", self.num_points, 1)
        checks.within("chief.num_points", self.num_points, 1, MOST_POINTS)


@dataclass(frozen=True, kw_only=True)
class Sensor:
    """The deputy's camera."""

    half_angle_deg: float
    boresight: tuple[float, ...]

    def __post_init__(self) -> None:
        """Refuse a camera that sees nothing or looks nowhere."""
        checks.positive("sensor.half_angle_deg", self.half_angle_deg, "deg")
        # visibility compares squared cosines, which tell no angle from its supplement
        checks.within("sensor.half_angle_deg", self.half_angle_deg, 0.0, 89.9, "deg")
        checks.unit_vector("sensor.boresight", self.boresight)


@dataclass(frozen=True, kw_only=True)
class Sun:
    """Where the Sun starts: one angle for every case, one drawn for each, or both by turns."""

    mode: Literal["fixed", "random", "mixed"]
    angle_deg: float

    def __post_init__(self) -> None:
        """Refuse an angle that is no number."""
        checks.number("sun.angle_deg", self.angle_deg, "degrees")


@dataclass(frozen=True, kw_only=True)
class Attitude:
    """How the deputy points its camera; gains multiply the inertia matrix."""

    mode: Literal["flown", "ideal"]
    proportional_gain: float
    derivative_gain: float
    pole_blending: bool

    def __post_init__(self) -> None:
        """Refuse gains that do not bring the deputy back."""
        checks.positive("attitude.proportional_gain", self.proportional_gain, "1/s^2")
        checks.positive("attitude.derivative_gain", self.derivative_gain, "1/s")


@dataclass(frozen=True, kw_only=True)
class Guidance:
    """How the direction of the points that are lit and not yet inspected is chosen."""

    kind: Literal["centroid", "clusters"]
    engine: Literal["compiled", "sklearn"]


@dataclass(frozen=True, kw_only=True)
class Safety:
    """Run-time assurance around any controller: the least change of force that keeps the deputy safe."""

    kind: Literal["none", "filter"]
    #: by which the keep-out sphere is greater than `Deputy.min_distance_m`
    keep_out_margin_m: float
    #: by which the keep-in sphere is less than `Deputy.max_distance_m`
    keep_in_margin_m: float
    #: greatest speed at `speed_distance_m`, and by how much it grows with each metre beyond
    speed_limit_m_s: float
    speed_slope_per_s: float
    speed_distance_m: float
    #: greatest force along each Hill axis that stopping within one control period may need
    braking_force_n: float
    #: free drift for so long stays outside the keep-out sphere (passive safety); 0 for off
    passive_horizon_s: float
    #: free drift for so long stays inside the keep-in sphere; 0 for off
    keep_in_horizon_s: float

    def __post_init__(self) -> None:
        """Refuse what would guard nothing."""
        # the least margin is beyond what rounding adds up to in a flight
        for name in ("keep_out_margin_m", "keep_in_margin_m"):
            checks.within(f"safety.{name}", getattr(self, name), 0.001, math.inf, "m")
        checks.within("safety.speed_limit_m_s", self.speed_limit_m_s, 0.0, math.inf, "m/s")
        checks.within("safety.speed_slope_per_s", self.speed_slope_per_s, 0.0, math.inf, "1/s")
        checks.within("safety.speed_distance_m", self.speed_distance_m, 0.0, math.inf, "m")
        checks.positive("safety.braking_force_n", self.braking_force_n, "N")
        checks.within("safety.passive_horizon_s", self.passive_horizon_s, 0.0, math.inf, "s")
        checks.within("safety.keep_in_horizon_s", self.keep_in_horizon_s, 0.0, math.inf, "s")


#: no layer: forces are applied as a controller asks for them
UNGUARDED = Safety(
    kind="none",
    keep_out_margin_m=1.0,
    keep_in_margin_m=1.0,
    speed_limit_m_s=0.2,
    speed_slope_per_s=0.0,
    speed_distance_m=0.0,
    braking_force_n=1.0,
    passive_horizon_s=0.0,
    keep_in_horizon_s=0.0,
)


@dataclass(frozen=True, kw_only=True)
class Mission:
    """One inspection flight: everything the simulation depends on except the start and the controller."""

    orbit: Orbit
    deputy: Deputy
    chief: Chief
    sensor: Sensor
    attitude: Attitude
    guidance: Guidance
    attitude_period_s: float
    control_period_s: float
    duration_s: float
    coast_when_complete: bool
    inspection_threshold_percent: float
    safety: Safety = UNGUARDED

    def __post_init__(self) -> None:
        """Refuse clocks that do not fit into one another."""
        checks.divides("attitude_period_s", self.attitude_period_s, "control_period_s", self.control_period_s)
        checks.divides("control_period_s", self.control_period_s, "duration_s", self.duration_s)
        if self.num_controls > MOST_CONTROLS:
            raise SettingError(
                f"duration_s is {self.duration_s:g} and control_period_s {self.control_period_s:g}, which "
                f"makes {self.num_controls} control periods; there must be at most {MOST_CONTROLS}: shorten "
                "the first or lengthen the second"
            )
        checks.within("inspection_threshold_percent", self.inspection_threshold_percent, 0.0, 100.0, "%")
        damping = self.attitude.derivative_gain * self.attitude_period_s
        # a torque held over a period turns a rate w into (1 - damping) w
        if self.attitude.mode == "flown" and not damping < 2.0:
            raise SettingError(
                f"attitude.derivative_gain is {self.attitude.derivative_gain:g} and attitude_period_s "
                f"{self.attitude_period_s:g}, with the product {damping:g}; it must be less than 2, or every "
                f"period turns an error in rate into one {abs(1.0 - damping):.3g} times as great: lower one "
                "of them"
            )
        if self.safety.kind == "filter":
            self._check_safety()

    def _check_safety(self) -> None:
        """Refuse spheres without room between them, and stops that the deputy has not the force for."""
        safety, deputy = self.safety, self.deputy
        checks.ascending(
            "deputy.min_distance_m plus safety.keep_out_margin_m",
            self.keep_out_m,
            "deputy.max_distance_m less safety.keep_in_margin_m",
            self.keep_in_m,
            "m",
        )
        checks.within("safety.braking_force_n", safety.braking_force_n, 0.0, deputy.max_force_n, "N")
        standing = 3.0 * self.orbit.mean_motion_rad_s**2 * self.keep_in_m * deputy.mass_kg
        if not standing <= safety.braking_force_n:
            raise SettingError(
                f"safety.braking_force_n is {safety.braking_force_n:g}, but to stand still "
                f"{self.keep_in_m:g} m above the chief takes {standing:.3g} N; raise it, or lower "
                "deputy.max_distance_m"
            )
        beyond = self.keep_out_m - safety.speed_distance_m
        slowest = safety.speed_limit_m_s + safety.speed_slope_per_s * beyond
        if not slowest >= 0.0:
            raise SettingError(
                f"safety.speed_limit_m_s and safety.speed_slope_per_s allow {slowest:.3g} m/s at the "
                f"keep-out sphere ({self.keep_out_m:g} m); it must be at least 0: raise the first, or lower "
                "the second or safety.speed_distance_m"
            )
        for name in ("passive_horizon_s", "keep_in_horizon_s"):
            horizon = getattr(safety, name)
            most = MOST_HORIZONS * self.control_period_s
            checks.within(f"safety.{name}", horizon, 0.0, most, "s")

    @property
    def keep_out_m(self) -> float:
        """Radius of the sphere that the safety layer keeps the deputy out of."""
        return self.deputy.min_distance_m + self.safety.keep_out_margin_m

    @property
    def keep_in_m(self) -> float:
        """Radius of the sphere that the safety layer keeps the deputy in."""
        return self.deputy.max_distance_m - self.safety.keep_in_margin_m

    @property
    def num_controls(self) -> int:
        """Control periods in the flight; the state is sampled at one instant more."""
        return round(self.duration_s / self.control_period_s)

    @property
    def num_attitude_steps(self) -> int:
        """Attitude periods in a control period."""
        return round(self.control_period_s / self.attitude_period_s)
