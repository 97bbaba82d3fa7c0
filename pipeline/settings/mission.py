"""The world of a flight and its limits: the groups that make a mission."""

import math
from dataclasses import field
from functools import cached_property
from typing import Annotated, Any, Literal

from pydantic import Field, Strict

from pipeline.settings import checks
from pipeline.settings.checks import (
    Count,
    Flag,
    Inertia,
    Interval,
    NotNegative,
    Number,
    Positive,
    Quaternion,
    SettingError,
    Share,
    Text,
    Thrusters,
    UnitVector,
    Vector,
)
from pipeline.settings.dispersions import Distribution, distributions, processes
from pipeline.settings.groups import settings

#: by which specific impulse is a speed of exhaust
STANDARD_GRAVITY_M_S2 = 9.80665

#: beyond these a flight fills the memory of a computer; the last two are of a whole flight
MOST_POINTS, MOST_CONTROLS = 10_000, 100_000
MOST_POINTS_SAMPLED, MOST_ATTITUDES = 20_000_000, 5_000_000
#: beyond so many control periods of free drift the safety layer takes longer than the flight
MOST_HORIZONS = 10_000

#: numbers that all flights of an evaluation share: what their samples and decisions keep time by
SHARED = (
    *("attitude_period_s", "control_period_s", "duration_s"),
    *("navigation.fix_period_s", "navigation.delay_s", "actuators.delay_s"),
)
#: with what the groups count of which something may vary within a flight
COUNTS_WITH = {
    "navigation": ("mode", "fixes"),
    "actuators": ("kind", "real"),
    "dynamics": ("model", "two_body"),
}
#: the least is beyond what rounding adds up to in a flight
Margin = Annotated[Number, Field(ge=0.001)]


@settings("orbit")
class Orbit:
    """The chief's circular orbit."""

    #: the densest planets allow 0.0015 rad/s
    mean_motion_rad_s: Annotated[Positive, Field(le=0.1)]
    radius_m: Annotated[
        float | None,
        Strict(),
        Field(gt=0, le=1e9, description="about the Earth's centre, m; None is that of the mean motion"),
    ] = None


@settings("dynamics")
class Dynamics:
    """How the deputy really moves: by Clohessy and Wiltshire's equations, or about the Earth as the chief."""

    model: Literal["cw", "two_body"]
    eccentricity: Annotated[NotNegative, Field(lt=1, description="of the chief's orbit at the start")]
    true_anomaly_deg: Annotated[Number, Field(description="of the chief at the start, from the perigee, deg")]
    inclination_deg: Annotated[Number, Field(ge=0, le=180, description="of the orbit to the equator, deg")]
    latitude_argument_deg: Annotated[
        Number, Field(description="of the chief at the start, from the ascending node, deg")
    ]
    j2: Annotated[NotNegative, Field(le=0.1, description="coefficient of the Earth's oblateness")]
    drag_m_s2: Annotated[
        Number, Field(description="by which drag slows the deputy more than the chief, m/s^2")
    ]
    radiation_m_s2: Annotated[
        Number, Field(description="by which sunlight pushes the deputy more than the chief, m/s^2")
    ]


@settings("deputy")
class Deputy:
    """The inspecting spacecraft, its start (Hill axes) and its limits."""

    mass_kg: Positive
    inertia_kg_m2: Annotated[Inertia, Field(description="about the body axes, kg m^2")]
    initial_position_m: Annotated[Vector, Field(description="relative to the chief, Hill axes, m")]
    initial_velocity_m_s: Annotated[Vector, Field(description="relative to the chief, Hill axes, m/s")]
    max_force_n: Annotated[Positive, Field(description="along each axis, N")]
    max_torque_n_m: Annotated[Positive, Field(description="about each axis, N m")]
    min_distance_m: Annotated[NotNegative, Field(description="least distance from the chief, m")]
    max_distance_m: Annotated[Number, Field(description="greatest distance from the chief, m")]
    initial_quaternion: Annotated[
        Quaternion, Field(description="at the start, Hill to body axes, scalar last")
    ] = (0.0, 0.0, 0.0, 1.0)
    initial_angular_velocity_rad_s: Annotated[
        Vector | None,
        Field(description="at the start, relative to Hill, body axes; None is the mean motion about k"),
    ] = None

    def __post_init__(self) -> None:
        """Check the limits, and that the start lies apart from the chief and is not absurdly fast."""
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


@settings("chief")
class Chief:
    """The inspected spacecraft and the points on it."""

    inertia_kg_m2: Annotated[Inertia, Field(description="about the body axes, kg m^2")]
    initial_angular_velocity_rad_s: Annotated[
        Vector | None,
        Field(description="inertial, in chief axes, rad/s; None keeps the chief aligned with Hill"),
    ]
    inspection_radius_m: Annotated[Positive, Field(description="of the sphere of inspection points, m")]
    num_points: Annotated[Count, Field(le=MOST_POINTS)]
    placement: Literal["deserno", "fibonacci"]
    shape: Annotated[
        Literal["sphere", "mesh"], Field(description="the points lie on a sphere, or on the faces of a mesh")
    ] = "sphere"
    path: Annotated[
        Text | None, Field(description="of the mesh, an STL or OBJ file in chief axes, m; None ships")
    ] = None


@settings("sensor")
class Sensor:
    """The deputy's camera."""

    half_angle_deg: Annotated[Positive, Field(le=180, description="of the field of view, deg")]
    boresight: Annotated[UnitVector, Field(description="body axes")]
    max_incidence_deg: Annotated[
        Positive, Field(le=90, description="between a point's normal and the direction to the deputy, deg")
    ] = 90.0
    max_range_m: Annotated[Positive | None, Field(description="from which a point is resolved, m")] = None
    min_sun_angle_deg: Annotated[
        NotNegative, Field(le=180, description="between boresight and Sun, deg; nearer the camera is blind")
    ] = 0.0


@settings("light")
class Light:
    """What takes the sunlight from the chief, and what its surface makes of it."""

    shadow: Annotated[Literal["none", "conical"], Field(description="of the Earth")] = "none"
    min_fraction: Annotated[
        Share, Field(description="of the Sun's disc, with less of which visible nothing is lit")
    ] = 0.5
    past_terminator_deg: Annotated[
        NotNegative, Field(le=10, description="by which the Sun may be below a point's horizon, deg")
    ] = 0.0
    reflection: Annotated[
        Literal["none", "blinn_phong"], Field(description="by which a point must be bright enough to be seen")
    ] = "none"
    ambient: Annotated[Vector, Field(description="of the chief's surface, [red, green, blue]")] = (0.4,) * 3
    diffuse: Annotated[Vector, Field(description="of the chief's surface, [red, green, blue]")] = (0.1,) * 3
    specular: Annotated[Vector, Field(description="of the chief's surface, [red, green, blue]")] = (1.0,) * 3
    specular_exponent: Annotated[
        Count, Field(le=1000, description="how closely the surface mirrors: a quarter of AFRL's shininess")
    ] = 25
    least_intensity: Annotated[
        Vector, Field(description="that a point must exceed to be seen, [red, green, blue]")
    ] = (0.8,) * 3
    greatest_intensity: Annotated[
        Vector, Field(description="that it must stay below, of at most 1, [red, green, blue]")
    ] = (0.9, 2.0, 2.0)


@settings("sun")
class Sun:
    """Where the Sun starts: one angle for every case, one drawn for each, or both by turns."""

    mode: Literal["fixed", "random", "mixed"]
    angle_deg: Annotated[Number, Field(description="of the fixed Sun, from +i towards +j, deg")]
    elevation_deg: Annotated[
        Number, Field(ge=-90, le=90, description="of the Sun over the orbit plane towards +k, deg")
    ] = 0.0
    elevation_range_deg: Annotated[
        Interval | None, Field(description="from which a Sun that is drawn has its elevation, deg")
    ] = None

    def __post_init__(self) -> None:
        """Check that no elevation is beyond the poles."""
        for elevation in self.elevation_range_deg or ():
            checks.within("sun.elevation_range_deg", elevation, -90.0, 90.0, "deg")


@settings("attitude")
class Attitude:
    """How the deputy points its camera."""

    mode: Literal["flown", "ideal"]
    proportional_gain: Annotated[Positive, Field(description="times the inertia matrix, 1/s^2")]
    derivative_gain: Annotated[Positive, Field(description="times the inertia matrix, 1/s")]
    pole_blending: Flag


@settings("guidance")
class Guidance:
    """How the direction of the points that are lit and not yet inspected is chosen."""

    kind: Literal["centroid", "clusters"]
    engine: Literal["compiled", "sklearn"]


@settings("safety")
class Safety:
    """Run-time assurance around any controller: the least change of force that keeps the deputy safe."""

    kind: Literal["none", "filter"]
    keep_out_margin_m: Annotated[Margin, Field(description="of its sphere beyond the least distance, m")]
    keep_in_margin_m: Annotated[Margin, Field(description="of its sphere inside the greatest distance, m")]
    speed_limit_m_s: Annotated[NotNegative, Field(description="greatest speed at speed_distance_m, m/s")]
    speed_slope_per_s: Annotated[NotNegative, Field(description="its growth with the distance, 1/s")]
    speed_distance_m: NotNegative
    braking_force_n: Annotated[
        Positive, Field(description="along each Hill axis, at most, to stop within a control period, N")
    ]
    passive_horizon_s: Annotated[
        NotNegative, Field(description="free drift stays outside the keep-out sphere so long, s; 0 for off")
    ]
    keep_in_horizon_s: Annotated[
        NotNegative, Field(description="free drift stays inside the keep-in sphere so long, s; 0 for off")
    ]


@settings("navigation")
class Navigation:
    """What the deputy knows of its own place: the truth, or what a filter makes of fixes."""

    mode: Literal["perfect", "fixes"]
    fix_period_s: Positive
    delay_s: Annotated[NotNegative, Field(description="from a fix to its use, s")]
    noise_m: Annotated[Positive, Field(description="standard deviation of a fix along each axis, m")]
    bias_m: Annotated[NotNegative, Field(description="standard deviation of a flight's constant error, m")]
    outlier_share: Share
    outlier_m: Annotated[NotNegative, Field(description="standard deviation of an outlier, m")]
    gate_sigma: Annotated[Positive | None, Field(description="beyond which a fix is not believed")]
    process_noise_m_s2: Annotated[NotNegative, Field(description="accelerations unknown to the filter")]
    execution_error: Annotated[NotNegative, Field(le=1, description="share of forces unknown to the filter")]
    initial_position_m: Annotated[Positive, Field(description="standard deviation at the start, m")]
    initial_velocity_m_s: Annotated[Positive, Field(description="standard deviation at the start, m/s")]
    measures: Annotated[
        Literal["position", "range_bearing"],
        Field(description="what a fix is: a place, or range and bearing"),
    ] = "position"
    range_noise_m: Annotated[Positive, Field(description="standard deviation of a range, m")] = 0.1
    bearing_noise_deg: Annotated[
        Positive, Field(le=10, description="standard deviation of a bearing along each of two angles, deg")
    ] = 0.1
    attitude_bias_deg: Annotated[
        NotNegative, Field(le=30, description="standard deviation of a flight's misalignment, each axis, deg")
    ] = 0.0
    attitude_noise_deg: Annotated[
        NotNegative, Field(le=30, description="standard deviation of the attitude sensed, each axis, deg")
    ] = 0.0


@settings("actuators")
class Actuators:
    """How the thrusters depart from what they are told."""

    kind: Literal["ideal", "real"]
    delay_s: Annotated[NotNegative, Field(description="from a command to its force, s")]
    scale_error: Annotated[NotNegative, Field(le=1, description="standard deviation, a share")]
    misalignment_deg: Annotated[NotNegative, Field(le=90, description="standard deviation, deg")]
    impulse_step_n_s: Annotated[NotNegative, Field(description="of which impulses are multiples, N s")]
    least_impulse_n_s: Annotated[NotNegative, Field(description="along an axis in a control period, N s")]
    thrust_arm_m: Annotated[
        NotNegative,
        Field(description="standard deviation of where thrust acts, from the centre of mass, each axis, m"),
    ] = 0.0
    specific_impulse_s: Annotated[
        Positive | None, Field(description="with which propellant is used up, s; None keeps the mass")
    ] = None
    thrusters: Annotated[
        Thrusters | None,
        Field(description="a row each: place (m), direction of force, greatest force (N); None is per axis"),
    ] = None
    propellant_kg: Annotated[
        Positive, Field(description="part of the deputy's mass; without any left nothing is fired, kg")
    ] = 1.0


#: what a deputy knows that knows its place, and thrusters that fire what they are told
PERFECT = Navigation(
    mode="perfect",
    fix_period_s=10.0,
    delay_s=0.0,
    noise_m=1.0,
    bias_m=0.0,
    outlier_share=0.0,
    outlier_m=0.0,
    gate_sigma=None,
    process_noise_m_s2=0.0,
    execution_error=0.0,
    initial_position_m=1.0,
    initial_velocity_m_s=1.0,
)
IDEAL = Actuators(
    kind="ideal",
    delay_s=0.0,
    scale_error=0.0,
    misalignment_deg=0.0,
    impulse_step_n_s=0.0,
    least_impulse_n_s=0.0,
)


#: motion in closed form
LINEAR = Dynamics(
    model="cw",
    eccentricity=0.0,
    true_anomaly_deg=0.0,
    inclination_deg=0.0,
    latitude_argument_deg=0.0,
    j2=0.0,
    drag_m_s2=0.0,
    radiation_m_s2=0.0,
)


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


#: the paper's: the Sun shines always
PAPER_LIGHT = Light()


@settings("")
class Mission:
    """One inspection flight: everything the simulation depends on but the start and the controller."""

    orbit: Orbit
    deputy: Deputy
    chief: Chief
    sensor: Sensor
    attitude: Attitude
    guidance: Guidance
    safety: Safety
    navigation: Navigation = PERFECT
    actuators: Actuators = IDEAL
    dynamics: Dynamics = LINEAR
    attitude_period_s: Annotated[Positive, Field(description="between two torques, s")]
    control_period_s: Annotated[Positive, Field(description="between two forces, s")]
    duration_s: Positive
    coast_when_complete: Annotated[Flag, Field(description="whether no force follows the last point")]
    inspection_threshold_percent: Annotated[Number, Field(ge=0, le=100, description="of a success, %")]
    light: Light = PAPER_LIGHT
    dispersions: Annotated[
        dict[str, Any],
        Field(description="what cases have their own of, or what varies in a flight, with its distribution"),
    ] = field(default_factory=dict, hash=False)

    def __post_init__(self) -> None:
        """Check that the clocks fit into one another, the gains and the safety layer."""
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
        """Refuse distributions of what is no number of a flight's own."""
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
        for key in self.varying:
            group = key.partition(".")[0]
            switch, wanted = COUNTS_WITH[group]
            if getattr(getattr(self, group), switch) != wanted:
                raise SettingError(
                    f"dispersions.{key} has a correlation time, but {key} counts only with "
                    f"{group}.{switch}={wanted}; set that, or leave the distribution out"
                )

    def _check_clocks(self) -> None:
        """Refuse fixes and delays that do not fall on samples."""
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
        """Refuse more propellant than the deputy's mass, a control period's at full thrust besides."""
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
        """Refuse flights of which no log fits into memory, and points that no deputy can be outside of."""
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
        """Refuse gains with which the attitude law, sampled, overshoots ever more."""
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
        # an error of half a turn is answered by turning at the quotient of the gains, rad/s
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

    @cached_property
    def varying(self) -> dict[str, Distribution]:
        """What varies within a flight, by its key."""
        return processes(self.dispersions)

    @property
    def rate_at_start_rad_s(self) -> tuple[float, ...]:
        """How the deputy turns relative to Hill at the start, body axes."""
        given = self.deputy.initial_angular_velocity_rad_s
        return (0.0, 0.0, self.orbit.mean_motion_rad_s) if given is None else given

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
