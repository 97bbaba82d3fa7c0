"""One mission: its parts, clocks and limits, and how they must fit together."""

from dataclasses import field
from functools import cached_property
from typing import Annotated, Any

from pydantic import Field

from pipeline.settings import checks
from pipeline.settings.checks import Flag, Number, Positive, SettingError
from pipeline.settings.dispersions import Distribution, distributions, processes
from pipeline.settings.groups import settings
from pipeline.settings.mission_parts import (
    Actuators,
    Attitude,
    Chief,
    Deputy,
    Dynamics,
    Guidance,
    Light,
    Navigation,
    Orbit,
    Problem,
    Safety,
    Sensor,
)

#: standard gravity: the exhaust speed is the specific impulse times this
STANDARD_GRAVITY_M_S2 = 9.80665

#: beyond these a flight fills a computer's memory
MOST_CONTROLS, MOST_POINTS_SAMPLED, MOST_ATTITUDES = 100_000, 20_000_000, 5_000_000
#: beyond this many control periods of free drift the safety layer takes longer than the flight
MOST_HORIZONS = 10_000

#: numbers that all flights of an evaluation share, since samples and decisions depend on them
SHARED = (
    *("attitude_period_s", "control_period_s", "duration_s"),
    *("navigation.fix_period_s", "navigation.delay_s", "actuators.delay_s"),
)


@settings("")
class Mission:
    """One flight: everything the simulation depends on except the start and the controller."""

    problem: Problem = field(default_factory=Problem)
    orbit: Orbit = field(default_factory=Orbit)
    deputy: Deputy = field(default_factory=Deputy)
    chief: Chief = field(default_factory=Chief)
    sensor: Sensor = field(default_factory=Sensor)
    attitude: Attitude = field(default_factory=Attitude)
    guidance: Guidance = field(default_factory=Guidance)
    safety: Safety = field(default_factory=Safety)
    navigation: Navigation = field(default_factory=Navigation)
    actuators: Actuators = field(default_factory=Actuators)
    dynamics: Dynamics = field(default_factory=Dynamics)
    attitude_period_s: Positive = 1.0
    """Time between two torques; must divide control_period_s."""
    control_period_s: Positive = 10.0
    """Time over which a force is held."""
    duration_s: Positive = 3600.0
    """Length of a flight; a multiple of control_period_s."""
    coast_when_complete: Flag = True
    """Whether no force follows once every point is inspected."""
    inspection_threshold_percent: Annotated[Number, Field(ge=0, le=100)] = 95.0
    """Share of the points from which on a flight is a success."""
    light: Light = field(default_factory=Light)
    dispersions: dict[str, Any] = field(default_factory=dict, hash=False)
    """Distributions of settings that differ between flights, or vary within one."""

    def __post_init__(self) -> None:
        """Check that clocks, gains and safety layer fit together."""
        checks.divides("attitude_period_s", self.attitude_period_s, "control_period_s", self.control_period_s)
        checks.divides("control_period_s", self.control_period_s, "duration_s", self.duration_s)
        if self.num_controls > MOST_CONTROLS:
            raise SettingError(
                f"duration_s is {self.duration_s:g} and control_period_s {self.control_period_s:g}, which "
                f"makes {self.num_controls} control periods; there must be at most {MOST_CONTROLS}: shorten "
                "the first or lengthen the second"
            )
        self._check_dispersions()
        self._check_clocks()
        self._check_size()
        self._check_gains()
        self._check_propellant()
        if self.safety.kind == "filter":
            self._check_safety()

    def _check_dispersions(self) -> None:
        """Raise SettingError for distributions of anything other than a number of a single flight."""
        for one in distributions(self.dispersions):
            node: Any = self
            for name in one.key.split("."):
                node = getattr(node, name, None) if name != "dispersions" else None
            if not isinstance(node, float) or one.key in SHARED:
                raise SettingError(
                    f"dispersions.{one.key} is no number that a flight can have its own of; it must be a key "
                    "of the mission with a decimal number, and no clock or delay, as in "
                    "+dispersions.deputy.mass_kg={kind:normal,mean:12.0,std:0.1}"
                )

    def _check_clocks(self) -> None:
        """Raise SettingError for fixes and delays that do not fall on samples."""
        period, navigation, actuators = self.control_period_s, self.navigation, self.actuators
        clocks = []
        if navigation.mode == "fixes":
            clocks += [
                ("navigation.fix_period_s", navigation.fix_period_s),
                ("navigation.delay_s", navigation.delay_s),
            ]
        if actuators.kind == "real":
            clocks.append(("actuators.delay_s", actuators.delay_s))
        for key, time in clocks:
            if abs(time / period - round(time / period)) > 1e-9 * max(1.0, time / period):
                raise SettingError(
                    f"{key} is {time:g} s and control_period_s {period:g} s; the first must be a multiple of "
                    f"the second, as {period * max(1, round(time / period)):g} s is"
                )
            checks.within(key, time, 0.0, self.duration_s, "s")

    def _check_propellant(self) -> None:
        """Raise SettingError unless the mass exceeds the propellant plus a control period at full thrust."""
        actuators, deputy = self.actuators, self.deputy
        if actuators.kind != "real" or actuators.specific_impulse_s is None:
            return
        speed = STANDARD_GRAVITY_M_S2 * actuators.specific_impulse_s
        most = deputy.mass_kg - 3.0 * deputy.max_force_n * self.control_period_s / speed
        if not actuators.propellant_kg < most:
            raise SettingError(
                f"actuators.propellant_kg is {actuators.propellant_kg:g} and deputy.mass_kg "
                f"{deputy.mass_kg:g}, of which actuators.specific_impulse_s={actuators.specific_impulse_s:g} "
                f"may use {deputy.mass_kg - most:.3g} in a control period; the first must be less than "
                f"{most:.3g}: lower it, or raise one of the others (kg)"
            )

    def _check_size(self) -> None:
        """Raise SettingError for flights whose log exceeds memory, and points beyond the deputy's reach."""
        for key, count, most in (
            ("chief.num_points", self.num_controls * self.chief.num_points, MOST_POINTS_SAMPLED),
            ("attitude_period_s", self.num_controls * self.num_attitude_steps, MOST_ATTITUDES),
        ):
            if count > most:
                raise SettingError(
                    f"duration_s is {self.duration_s:g}, control_period_s {self.control_period_s:g} and "
                    f"{key} {getattr(self, key, self.chief.num_points):g}, which makes {count:.2g} values of "
                    f"a flight; there may be at most {most:,}: shorten the flight, or make it coarser"
                )
        if not self.chief.inspection_radius_m < self.deputy.max_distance_m:
            raise SettingError(
                f"chief.inspection_radius_m is {self.chief.inspection_radius_m:g} and deputy.max_distance_m "
                f"{self.deputy.max_distance_m:g}; the first must be less than the second, or all points lie "
                "beyond the deputy (m)"
            )

    def _check_gains(self) -> None:
        """Raise SettingError for gains with which the sampled attitude law is unstable."""
        if self.attitude.mode != "flown":
            return
        damping = self.attitude.derivative_gain * self.attitude_period_s
        # a torque held over a period turns a rate w into (1 - damping) w
        if not damping < 2.0:
            raise SettingError(
                f"attitude.derivative_gain is {self.attitude.derivative_gain:g} and attitude_period_s "
                f"{self.attitude_period_s:g}, with the product {damping:g}; it must be less than 2, or every "
                f"period turns an error in rate into one {abs(1.0 - damping):.3g} times as great: lower one "
                "of them"
            )
        # for an error of half a turn the rate is the ratio of the gains, rad/s
        proportional, derivative = self.attitude.proportional_gain, self.attitude.derivative_gain
        turned = proportional / derivative * self.attitude_period_s
        if not turned < 2.0:
            raise SettingError(
                f"attitude.proportional_gain is {proportional:g}, attitude.derivative_gain {derivative:g} "
                f"and attitude_period_s {self.attitude_period_s:g}, with which the deputy turns by "
                f"{turned:.3g} rad in a period; it must be less than 2, for the law acts once a period: "
                "lower the first or the last, or raise the second"
            )

    def _check_safety(self) -> None:
        """Raise SettingError for spheres without room between them, and stops that need too much force."""
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

    @cached_property
    def varying(self) -> dict[str, Distribution]:
        """The distributions that vary within a flight, by key."""
        return processes(self.dispersions)

    @property
    def rate_at_start_rad_s(self) -> tuple[float, ...]:
        """Angular rate of the deputy relative to Hill at the start, body axes."""
        given = self.deputy.initial_angular_velocity_rad_s
        return (0.0, 0.0, self.orbit.mean_motion_rad_s) if given is None else given

    @property
    def keep_out_m(self) -> float:
        """Radius of the keep-out sphere of the safety layer."""
        return self.deputy.min_distance_m + self.safety.keep_out_margin_m

    @property
    def keep_in_m(self) -> float:
        """Radius of the keep-in sphere of the safety layer."""
        return self.deputy.max_distance_m - self.safety.keep_in_margin_m

    @property
    def num_controls(self) -> int:
        """Number of control periods in the flight; the state is sampled at one instant more."""
        return round(self.duration_s / self.control_period_s)

    @property
    def num_attitude_steps(self) -> int:
        """Number of attitude periods in a control period."""
        return round(self.control_period_s / self.attitude_period_s)
