"""The groups of settings that a mission is made of, with their defaults."""

import math
from functools import cache
from typing import Annotated, Literal

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
from pipeline.settings.groups import settings

#: beyond this many points a flight fills a computer's memory
MOST_POINTS = 10_000
#: the least is beyond the accumulated rounding of a flight
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
    """The deputy's true motion: Clohessy and Wiltshire's equations, or an orbit about the Earth."""

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
    """Shadow on the chief, and how its surface reflects."""

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
    """The Sun's initial direction: one angle for every case, one drawn for each, or both alternately."""

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
    """How the target direction is chosen among the points that are lit and not yet inspected."""

    kind: Literal["centroid", "clusters"]
    engine: Literal["compiled", "sklearn"]


@settings("safety")
class Safety:
    """Run-time assurance around any controller: the smallest change of force that keeps the deputy safe."""

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
    """The deputy's knowledge of its own state: the truth, or a filter's estimate from fixes."""

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
    """How the thrusters deviate from their commands."""

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


# defaults and what missions are compared with, made when first needed: making one compiles its checks


@cache
def perfect() -> Navigation:
    """Return perfect navigation."""
    return Navigation(
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


@cache
def ideal() -> Actuators:
    """Return ideal thrusters."""
    return Actuators(
        kind="ideal",
        delay_s=0.0,
        scale_error=0.0,
        misalignment_deg=0.0,
        impulse_step_n_s=0.0,
        least_impulse_n_s=0.0,
    )


@cache
def linear() -> Dynamics:
    """Return motion in closed form."""
    return Dynamics(
        model="cw",
        eccentricity=0.0,
        true_anomaly_deg=0.0,
        inclination_deg=0.0,
        latitude_argument_deg=0.0,
        j2=0.0,
        drag_m_s2=0.0,
        radiation_m_s2=0.0,
    )


@cache
def unguarded() -> Safety:
    """Return no safety layer: forces are applied as commanded."""
    return Safety(
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
