"""The groups of settings that a mission is made of, with their defaults: the paper's inspection."""

import math
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
from pipeline.settings.groups import Only, settings

#: beyond this many points a flight fills a computer's memory
MOST_POINTS = 10_000
#: the least is beyond the accumulated rounding of a flight
Margin = Annotated[Number, Field(ge=0.001)]
UNIT_INERTIA = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
#: 75 m along (1, 1, 1)
START_M = (43.30127018922194, 43.30127018922194, 43.30127018922194)


@settings("orbit")
class Orbit:
    """The chief's orbit: the paper's low Earth orbit."""

    #: the densest planets allow 0.0015 rad/s
    mean_motion_rad_s: Annotated[Positive, Field(le=0.1)] = 0.0011068
    """Mean motion of the chief."""
    radius_m: Annotated[
        float | None, Strict(), Field(gt=0, le=1e9), Only("light.shadow=conical", "dynamics.model=two_body")
    ] = None
    """Radius about the Earth's centre; null: that of the mean motion."""


@settings("dynamics", Only("dynamics.model=two_body"))
class Dynamics:
    """The deputy's true motion: Clohessy and Wiltshire's equations, or an orbit about the Earth."""

    model: Literal["cw", "two_body"] = "cw"
    """Clohessy and Wiltshire's equations, or two bodies about the Earth."""
    eccentricity: Annotated[NotNegative, Field(lt=1)] = 0.0
    """Eccentricity of the chief's orbit at the start; 0: a circle."""
    true_anomaly_deg: Number = 0.0
    """The chief's angle from the perigee at the start."""
    inclination_deg: Annotated[Number, Field(ge=0, le=180)] = 51.6
    """Inclination of the orbit to the Earth's equator."""
    latitude_argument_deg: Number = 0.0
    """The chief's angle from the ascending node at the start."""
    j2: Annotated[NotNegative, Field(le=0.02)] = 0.0
    """Coefficient of the Earth's oblateness; 0: a sphere."""
    drag_m_s2: Number = 0.0
    """Acceleration by which drag slows the deputy more than the chief."""
    radiation_m_s2: Number = 0.0
    """Acceleration by which sunlight pushes the deputy more than the chief."""


@settings("deputy")
class Deputy:
    """The inspecting spacecraft, its start (Hill axes) and its limits."""

    mass_kg: Positive = 12.0
    """Mass."""
    inertia_kg_m2: Inertia = UNIT_INERTIA
    """Inertia matrix, body axes."""
    initial_position_m: Vector = START_M
    """Where a single flight starts, relative to the chief, Hill axes."""
    initial_velocity_m_s: Vector = (0.0, 0.0, 0.0)
    """Its velocity there, relative to the chief, Hill axes."""
    max_force_n: Annotated[Positive, Field(le=1000)] = 1.0
    """Greatest force along each Hill axis."""
    max_torque_n_m: Positive = 0.01
    """Greatest torque about each body axis."""
    min_distance_m: NotNegative = 15.0
    """Least distance from the chief; the limit itself is inside."""
    max_distance_m: Number = 200.0
    """Greatest distance from the chief; the limit itself is inside."""
    initial_quaternion: Quaternion = (0.0, 0.0, 0.0, 1.0)
    """Attitude at the start, from Hill to body axes, scalar last."""
    initial_angular_velocity_rad_s: Vector | None = None
    """Angular velocity at the start, relative to Hill, body axes; null: the mean motion about k."""

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

    inertia_kg_m2: Annotated[Inertia, Only("chief.initial_angular_velocity_rad_s")] = UNIT_INERTIA
    """Inertia matrix, chief axes."""
    initial_angular_velocity_rad_s: Vector | None = None
    """Inertial angular velocity at the start, chief axes; null: aligned with Hill."""
    inspection_radius_m: Positive = 10.0
    """Radius of the sphere of inspection points."""
    num_points: Annotated[Count, Field(le=MOST_POINTS)] = 100
    """Inspection points asked for; Deserno's placement makes 99 of 100."""
    placement: Annotated[Literal["deserno", "fibonacci"], Only("chief.shape=sphere")] = "deserno"
    """How points are spread over the sphere."""
    weights: Literal["equal", "priority"] = "equal"
    """What points count: alike, or, in pipeline.gym, by their angle from a direction of each episode."""
    shape: Literal["sphere", "mesh"] = "sphere"
    """Points on a sphere, or on the faces of a mesh."""
    path: Annotated[Text | None, Only("chief.shape=mesh")] = None
    """File of the mesh, STL or OBJ, chief axes, m; null: the satellite that ships."""


@settings("problem", Only("problem.kind=reach"))
class Problem:
    """What a flight is for: to inspect points, or to reach the chief without ever being too fast."""

    kind: Literal["inspection", "reach"] = "inspection"
    """To inspect the chief's points, or to reach the chief within a limit on the speed."""
    goal_radius_m: Positive = 0.5
    """Distance from the chief's centre at which a flight ends."""
    goal_speed_m_s: Positive = 0.2
    """Greatest speed there; faster is a crash."""
    limit_base_m_s: NotNegative = 0.2
    """Limit on the speed at limit_offset_m from the chief."""
    limit_slope_per_s: NotNegative = 0.0
    """How much the limit grows with each metre farther out."""
    limit_offset_m: Number = 0.0
    """Distance from the chief at which the limit is limit_base_m_s."""
    most_excess_m_s: NotNegative = 0.0
    """Sum over samples of what the speed is above the limit; beyond it a flight has failed."""


@settings("sensor")
class Sensor:
    """The deputy's camera."""

    half_angle_deg: Annotated[Positive, Field(le=180)] = 15.0
    """Half angle of the field of view."""
    boresight: UnitVector = (-1.0, 0.0, 0.0)
    """Where the camera looks, body axes."""
    max_incidence_deg: Annotated[Positive, Field(le=90)] = 90.0
    """Greatest angle between a point's normal and the direction to the deputy."""
    max_range_m: Positive | None = None
    """Greatest range from which a point is resolved; null: any."""
    min_sun_angle_deg: Annotated[NotNegative, Field(le=180)] = 0.0
    """Least angle between boresight and Sun; nearer to it the camera is blind."""


REFLECTED = Only("light.reflection=blinn_phong")


@settings("light")
class Light:
    """Shadow on the chief, and how its surface reflects."""

    shadow: Literal["none", "conical"] = "none"
    """The Earth's shadow."""
    min_fraction: Annotated[Share, Only("light.shadow=conical")] = 0.5
    """Share of the Sun's disc, with less of which visible nothing is lit."""
    past_terminator_deg: Annotated[Number, Field(gt=-90, le=10)] = 0.0
    """Angle by which the Sun may be below a point's horizon; negative: by which it must be above it."""
    reflection: Literal["none", "blinn_phong"] = "none"
    """Law by which a point must reflect enough to be seen."""
    ambient: Annotated[Vector, REFLECTED] = (0.4,) * 3
    """Reflected whatever the direction, [red, green, blue]."""
    diffuse: Annotated[Vector, REFLECTED] = (0.1,) * 3
    """Reflected evenly of light that falls on it, [red, green, blue]."""
    specular: Annotated[Vector, REFLECTED] = (1.0,) * 3
    """Mirrored, [red, green, blue]."""
    specular_exponent: Annotated[Count, Field(le=1000), REFLECTED] = 25
    """How closely the surface mirrors: a quarter of AFRL's shininess."""
    least_intensity: Annotated[Vector, REFLECTED] = (0.8,) * 3
    """Intensity that a point must exceed to be seen, [red, green, blue]."""
    greatest_intensity: Annotated[Vector, REFLECTED] = (0.9, 2.0, 2.0)
    """Intensity that it must stay below, of at most 1, [red, green, blue]."""


@settings("sun")
class Sun:
    """The Sun's initial direction: one angle for every case, one drawn for each, or both alternately."""

    mode: Literal["fixed", "random", "mixed"] = "fixed"
    """One angle for all cases, one drawn for each, or every other one drawn."""
    angle_deg: Annotated[Number, Only("sun.mode=fixed", "sun.mode=mixed")] = 0.0
    """Angle of the fixed Sun at the start, from +i towards +j."""
    elevation_deg: Annotated[
        Number, Field(ge=-90, le=90), Only("sun.mode=fixed", "sun.mode=mixed", "sun.elevation_range_deg=null")
    ] = 0.0
    """Elevation of the Sun over the orbit plane, towards +k."""
    elevation_range_deg: Annotated[Interval | None, Only("sun.mode=random", "sun.mode=mixed")] = None
    """Elevations [low, high] from which a drawn Sun has its own; null: elevation_deg."""

    def __post_init__(self) -> None:
        """Check that no elevation is beyond the poles."""
        for elevation in self.elevation_range_deg or ():
            checks.within("sun.elevation_range_deg", elevation, -90.0, 90.0, "deg")


FLOWN = Only("attitude.mode=flown")


@settings("attitude")
class Attitude:
    """How the deputy points its camera."""

    mode: Literal["flown", "ideal"] = "flown"
    """Turned by a torque-limited law, or pointing perfectly."""
    proportional_gain: Annotated[Positive, FLOWN] = 0.08
    """Torque for a unit quaternion error, times the inertia matrix."""
    derivative_gain: Annotated[Positive, FLOWN] = 0.32
    """Torque for a unit rate, times the inertia matrix."""
    pole_blending: Flag = False
    """Whether the camera's roll is carried along near the poles, not flipped."""


@settings("guidance")
class Guidance:
    """How the target direction is chosen among the points that are lit and not yet inspected."""

    kind: Literal["centroid", "clusters"] = "centroid"
    """Their mean, or the nearest centre of k-means clusters of about ten."""
    engine: Annotated[Literal["compiled", "sklearn"], Only("guidance.kind=clusters")] = "compiled"
    """What computes clusters; sklearn, the reference, flies one flight at a time."""


@settings("safety", Only("safety.kind=filter"))
class Safety:
    """Run-time assurance around any controller: the smallest change of force that keeps the deputy safe."""

    kind: Literal["none", "filter"] = "none"
    """Forces as commanded, or filtered to stay safe."""
    keep_out_margin_m: Margin = 1.0
    """By which the keep-out sphere is greater than deputy.min_distance_m."""
    keep_in_margin_m: Margin = 2.0
    """By which the keep-in sphere is less than deputy.max_distance_m."""
    speed_limit_m_s: NotNegative = 0.2
    """Greatest speed at speed_distance_m."""
    #: four times the mean motion
    speed_slope_per_s: NotNegative = 0.0044272
    """Growth of the greatest speed with the distance."""
    speed_distance_m: NotNegative = 15.0
    """Distance at which the greatest speed is speed_limit_m_s."""
    braking_force_n: Positive = 0.8
    """Greatest force along each Hill axis to stop within a control period."""
    probability: Annotated[Number, Field(gt=0, lt=1)] | None = None
    """Of a flight, that the bounds hold on its errors, for which margins are kept; null: none are."""
    planned_force_n: Annotated[Positive, Only("safety.probability")] = 0.08
    """Greatest force along each Hill axis that is passed on where anything is inexact."""
    passive_horizon_s: NotNegative = 600.0
    """How long free drift stays outside the keep-out sphere; 0: off."""
    keep_in_horizon_s: NotNegative = 0.0
    """How long free drift stays inside the keep-in sphere; 0: off."""


RANGED = Only("navigation.measures=range_bearing")


@settings("navigation", Only("navigation.mode=fixes"))
class Navigation:
    """The deputy's knowledge of its own state: the truth, or a filter's estimate from fixes."""

    mode: Literal["perfect", "fixes"] = "perfect"
    """The truth, or what a Kalman filter makes of fixes."""
    fix_period_s: Positive = 10.0
    """Time between two fixes; a multiple of control_period_s."""
    delay_s: NotNegative = 0.0
    """Time from a fix to its use; a multiple of control_period_s."""
    noise_m: Annotated[Positive, Only("navigation.measures=position")] = 1.0
    """Standard deviation of a fix along each axis."""
    bias_m: NotNegative = 0.0
    """Standard deviation of a flight's constant error along each axis."""
    outlier_share: Share = 0.0
    """Share of fixes that are outliers."""
    outlier_m: NotNegative = 20.0
    """Standard deviation of an outlier along each axis."""
    gate_sigma: Positive | None = 5.0
    """Standard deviations beyond which a fix is not believed; null: all are."""
    process_noise_m_s2: NotNegative | None = None
    """Standard deviation of accelerations unknown to the filter; null: 0.06 of the bound on those of
    `dynamics` that Clohessy and Wiltshire's equations neglect."""
    execution_error: Annotated[NotNegative, Field(le=1)] = 0.0
    """Standard deviation that the filter allows for in forces, a share, besides the thrusters' errors."""
    initial_position_m: Annotated[Positive, Field(le=1e4)] = 1.0
    """Standard deviation of the first estimate of the position, each axis."""
    initial_velocity_m_s: Annotated[Positive, Field(le=1e3)] = 0.001
    """Standard deviation of the first estimate of the velocity, each axis."""
    measures: Literal["position", "range_bearing"] = "position"
    """What a fix is: a place, or range and bearing."""
    range_noise_m: Annotated[Positive, RANGED] = 0.1
    """Standard deviation of a range."""
    bearing_noise_deg: Annotated[Positive, Field(le=10), RANGED] = 0.1
    """Standard deviation of a bearing along each of two angles."""
    attitude_bias_deg: Annotated[NotNegative, Field(le=30)] = 0.0
    """Standard deviation of the sensed attitude's constant error, each axis."""
    attitude_noise_deg: Annotated[NotNegative, Field(le=30)] = 0.0
    """Standard deviation of the sensed attitude, drawn anew, each axis."""


@settings("actuators", Only("actuators.kind=real"))
class Actuators:
    """How the thrusters deviate from their commands."""

    kind: Literal["ideal", "real"] = "ideal"
    """Thrusters that fire as commanded, or with errors."""
    delay_s: NotNegative = 0.0
    """Time from a command to its force; a multiple of control_period_s."""
    scale_error: Annotated[NotNegative, Field(le=1)] = 0.05
    """Standard deviation of each Hill axis' scale, of a flight, a share."""
    misalignment_deg: Annotated[NotNegative, Field(le=90)] = 2.0
    """Standard deviation of the thrust's turn about each Hill axis, of a flight."""
    impulse_step_n_s: NotNegative = 0.0
    """Of which impulses along each axis are multiples; 0: any."""
    least_impulse_n_s: NotNegative = 0.04
    """Least impulse along an axis in a control period; less is not fired."""
    thrust_arm_m: NotNegative = 0.0
    """Standard deviation of where thrust acts, from the centre of mass, each body axis, of a flight."""
    specific_impulse_s: Positive | None = None
    """Specific impulse with which propellant is used up; null: the mass stays."""
    thrusters: Thrusters | None = None
    """A row each: place (m), direction of force, greatest force (N), body axes; null: one an axis."""
    propellant_kg: Annotated[Positive, Only("actuators.specific_impulse_s")] = 1.0
    """Part of the deputy's mass; without any left nothing is fired."""
