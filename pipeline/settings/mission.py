"""One mission: its parts, clocks and limits, and how they must fit together."""

import math
from dataclasses import field, replace
from functools import cached_property
from typing import Annotated, Any, Literal

from pydantic import Field

from pipeline.constants import DAY_S
from pipeline.settings import checks, types
from pipeline.settings.checks import SettingError
from pipeline.settings.conditions import Only
from pipeline.settings.dispersions import Distribution, distributions, processes
from pipeline.settings.equipment import Actuators, FilteredNavigation, Navigation, PositionFixes, Sensor
from pipeline.settings.fleet import Fleet
from pipeline.settings.groups import Settings
from pipeline.settings.orbit import OrbitSettings, least_radius
from pipeline.settings.relations import check_relations

#: beyond this many points a flight fills a computer's memory
MOST_POINTS = 10_000
#: on a circle about an oblate Earth, the longest flight that counts with the mean motion, s
LONG_S = DAY_S
#: the least is beyond the accumulated rounding of a flight
Margin = Annotated[types.Number, Field(ge=0.001)]
UNIT_INERTIA = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
#: 75 m along (1, 1, 1)
START_M = (43.30127018922194, 43.30127018922194, 43.30127018922194)


class Dynamics(Settings, group="dynamics"):
    """The deputy's true motion: Clohessy and Wiltshire's equations, or an orbit about the Earth."""

    model: Literal["cw", "two_body"] = "cw"
    """Clohessy and Wiltshire's equations, or two bodies about the Earth."""


class ClohessyWiltshire(Dynamics, model="cw"):
    """Clohessy and Wiltshire's equations."""


class TwoBody(Dynamics, model="two_body"):
    """Two bodies about the Earth."""

    j2: Annotated[types.NotNegative, Field(le=0.1)] = 0.0
    """Coefficient of the planet's oblateness; 0: a sphere."""
    drag_m_s2: types.Number = 0.0
    """Acceleration by which drag slows the deputy more than the chief."""
    radiation_m_s2: types.Number = 0.0
    """Acceleration by which sunlight pushes the deputy more than the chief."""
    scale_height_m: types.Positive | None = None
    """Height over which drag falls by a factor e, from the perigee up: 53 km at 350 km, 64 km at 500 km
    (Vallado, table 8-4); null: air of one density."""


#: of the start that is given, which counts for a single flight; kept with each run, for its stages to come
IS_FLOWN = Only("telemetry.record_start=true", "optimum.cases=start", is_told=True)
FLOWN = Only("attitude.mode=flown")
NO_CASE = Only("case=null", "optimum.cases=start", is_told=True)


class DeputySettings(Settings, group="deputy"):
    """The inspecting spacecraft, its start (Hill axes) and its limits."""

    mass_kg: types.Positive = 12.0
    """Mass."""
    inertia_kg_m2: types.Inertia = UNIT_INERTIA
    """Inertia matrix, body axes."""
    initial_position_m: Annotated[types.Vector, IS_FLOWN, NO_CASE, types.Follows()] = START_M
    """Where a single flight starts, relative to the chief, Hill axes; null: 75 m along (1, 1, 1), or the
    middle of the starts of monte_carlo."""
    initial_velocity_m_s: Annotated[types.Vector, IS_FLOWN, NO_CASE] = (0.0, 0.0, 0.0)
    """Its velocity there, relative to the chief, Hill axes."""
    max_force_n: Annotated[types.Positive, Field(le=1000)] = 1.0
    """Greatest force along each Hill axis."""
    max_torque_n_m: types.Positive = 0.01
    """Greatest torque about each body axis."""
    max_momentum_n_m_s: Annotated[types.Positive | None, FLOWN] = None
    """Greatest angular momentum of a wheel along each body axis, at rest at the start; null: any."""
    min_distance_m: types.NotNegative = 15.0
    """Least distance from the chief; the limit itself is inside."""
    max_distance_m: types.Number = 200.0
    """Greatest distance from the chief; the limit itself is inside."""
    initial_quaternion: types.Quaternion = (0.0, 0.0, 0.0, 1.0)
    """Attitude at the start, from Hill to body axes, scalar last."""
    initial_angular_velocity_rad_s: types.Vector | None = None
    """Angular velocity at the start, relative to Hill, body axes; null: the mean motion about k."""

    def __post_init__(self) -> None:
        """Check the limits, and that the start lies apart from the chief and is not absurdly fast."""
        checks.shell("deputy", self.min_distance_m, self.max_distance_m, may_be_thin=False)
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


class ChiefSettings(Settings, group="chief"):
    """The inspected spacecraft and the points on it."""

    inertia_kg_m2: Annotated[types.Inertia, Only("chief.initial_angular_velocity_rad_s")] = UNIT_INERTIA
    """Inertia matrix, chief axes."""
    initial_angular_velocity_rad_s: types.Vector | None = None
    """Inertial angular velocity at the start, chief axes; null: aligned with Hill."""
    inspection_radius_m: Annotated[types.Positive, Only("chief.shape=sphere")] = 10.0
    """Radius of the sphere of inspection points."""
    num_points: Annotated[types.Count, Field(le=MOST_POINTS)] = 100
    """Inspection points requested; Deserno's placement makes 99 of 100."""
    placement: Annotated[Literal["deserno", "fibonacci"], Only("chief.shape=sphere")] = "deserno"
    """How points are spread over the sphere."""
    weights: Literal["equal", "priority"] = "equal"
    """How points count: alike, or, in pipeline.gym, by their angle from a direction of each episode."""
    shape: Literal["sphere", "mesh"] = "sphere"
    """Points on a sphere, or on the faces of a mesh."""
    path: Annotated[types.Text | None, Only("chief.shape=mesh")] = None
    """File of the mesh, STL or OBJ, chief axes, m; null: the satellite that ships."""
    keep_out_m: types.Spheres = ()
    """Spheres that the deputy must stay out of, such as about a boom, each [x, y, z, radius], chief axes."""


class Problem(Settings, group="problem", only=Only("problem.kind=reach")):
    """What a flight is for: to inspect points, or to reach the chief without ever being too fast."""

    kind: Literal["inspection", "reach"] = "inspection"
    """To inspect the chief's points, or to reach the chief within a limit on the speed."""
    goal_radius_m: types.Positive = 0.5
    """Distance from the chief's centre at which a flight ends."""
    goal_speed_m_s: types.Positive = 0.2
    """Greatest speed there; faster is a crash."""
    limit_base_m_s: types.NotNegative = 0.2
    """Limit on the speed at limit_offset_m from the chief."""
    limit_slope_per_s: types.NotNegative = 0.0
    """How much the limit grows with each metre farther out."""
    limit_offset_m: types.Number = 0.0
    """Distance from the chief at which the limit is limit_base_m_s."""
    most_excess_m_s: types.NotNegative = 0.0
    """Greatest sum over samples of the speed's excess over the limit; beyond it a flight has failed."""


REFLECTED = Only("light.reflection=blinn_phong")


class Light(Settings, group="light"):
    """Shadow on the chief, and how its surface reflects."""

    shadow: Literal["none", "conical"] = "none"
    """The Earth's shadow."""
    min_fraction: Annotated[types.Share, Only("light.shadow=conical")] = 0.5
    """Least visible share of the Sun's disc with which anything is lit."""
    past_terminator_deg: Annotated[types.Number, Field(gt=-90, le=10)] = 0.0
    """Angle by which the Sun may be below a point's horizon; negative: by which it must be above it."""
    reflection: Literal["none", "blinn_phong"] = "none"
    """Law by which a point must reflect enough to be seen."""
    ambient: Annotated[types.Vector, REFLECTED] = (0.4,) * 3
    """Reflected whatever the direction, [red, green, blue]."""
    diffuse: Annotated[types.Vector, REFLECTED] = (0.1,) * 3
    """Reflected evenly of light that falls on it, [red, green, blue]."""
    specular: Annotated[types.Vector, REFLECTED] = (1.0,) * 3
    """Mirrored, [red, green, blue]."""
    specular_exponent: Annotated[types.Count, Field(le=1000), REFLECTED] = 25
    """How closely the surface mirrors: a quarter of AFRL's shininess."""
    least_intensity: Annotated[types.Vector, REFLECTED] = (0.8,) * 3
    """Intensity that a point must exceed to be seen, [red, green, blue]."""
    greatest_intensity: Annotated[types.Vector, REFLECTED] = (0.9, 2.0, 2.0)
    """Intensity that it must stay below, of at most 1, [red, green, blue]."""


GIVEN_ELEVATION = Only("sun.mode=fixed", "sun.mode=mixed", "sun.elevation_range_deg=null")
DRAWN = Only("sun.mode=random", "sun.mode=mixed")
Elevation = Annotated[types.Number, Field(ge=-90, le=90)]


class Sun(Settings, group="sun"):
    """The Sun's initial direction: one angle for every case, one drawn for each, or both alternately."""

    mode: Literal["fixed", "random", "mixed"] = "fixed"
    """One angle for all cases, one drawn for each, or every second one drawn."""
    angle_deg: Annotated[types.Number, Only("sun.mode=fixed", "sun.mode=mixed"), types.Follows()] = 0.0
    """Angle of the fixed Sun at the start, from +i towards +j; null: that of the orbit's epoch, or 0."""
    elevation_deg: Annotated[Elevation, GIVEN_ELEVATION, types.Follows()] = 0.0
    """Elevation of the Sun over the orbit plane, towards +k; null: that of the orbit's epoch, or 0."""
    elevation_range_deg: Annotated[types.IntervalOf[Elevation] | None, DRAWN] = None
    """Range [low, high] of a drawn Sun's elevation; null: elevation_deg."""

    @property
    def elevations_deg(self) -> tuple[float, float]:
        """The lowest and the highest elevation that a start can have."""
        drawn = () if self.mode == "fixed" else self.elevation_range_deg or ()
        given = () if self.mode == "random" and drawn else (self.elevation_deg,)
        return min(given + drawn), max(given + drawn)


class Attitude(Settings, group="attitude"):
    """How the deputy points its camera."""

    mode: Literal["flown", "ideal"] = "flown"
    """Turned by a torque-limited law, or pointing perfectly."""
    proportional_gain: Annotated[types.Positive, FLOWN] = 0.08
    """Torque for a unit quaternion error, times the inertia matrix."""
    derivative_gain: Annotated[types.Positive, FLOWN] = 0.32
    """Torque for a unit rate, times the inertia matrix."""
    gravity_gradient: Annotated[types.Flag, FLOWN] = False
    """Whether the gradient of gravity turns a deputy on a circular orbit, by 3 n^2 i x J i."""
    pole_blending: types.Flag = False
    """Whether the camera's roll is carried along near the poles, not flipped."""


class Guidance(Settings, group="guidance"):
    """How the target direction is chosen among the points that are lit and not yet inspected."""

    kind: Literal["centroid", "clusters"] = "centroid"
    """Their mean, or the nearest centre of k-means clusters of about ten."""
    engine: Annotated[Literal["compiled", "sklearn"], Only("guidance.kind=clusters")] = "compiled"
    """What computes clusters; sklearn, the reference, flies one flight at a time."""


class Safety(Settings, group="safety", only=Only("safety.kind=filter")):
    """Run-time assurance around any controller: the smallest change of force that keeps the deputy safe."""

    kind: Literal["none", "filter"] = "none"
    """Forces as commanded, or filtered to stay safe."""
    keep_out_margin_m: Margin = 1.0
    """How much greater the keep-out sphere is than deputy.min_distance_m."""
    keep_in_margin_m: Margin = 2.0
    """How much less the keep-in sphere is than deputy.max_distance_m."""
    speed_limit_m_s: types.NotNegative = 0.2
    """Greatest speed at speed_distance_m."""
    #: four times the mean motion
    speed_slope_per_s: types.NotNegative = 0.0044272
    """Growth of the greatest speed with the distance."""
    speed_distance_m: types.NotNegative = 15.0
    """Distance at which the greatest speed is speed_limit_m_s."""
    min_sun_angle_deg: Annotated[types.NotNegative, Field(lt=90)] = 0.0
    """Angle from the Sun that the chief keeps in the deputy's sight, if the other limits allow it; 0: any."""
    axis_speed_limit_m_s: types.NotNegative = 0.0
    """Greatest speed along each Hill axis; 0: any."""
    braking_force_n: types.Positive | None = None
    """Greatest force along each Hill axis to stop within a control period; null: 0.8 of the thrusters'."""
    #: rarer errors of thrusters are not drawn: pipeline.flight.world.thrust_bounds
    probability: Annotated[types.Number, Field(gt=0, le=0.9999)] | None = None
    """Probability with which a flight's errors stay within what the margins allow; null: no margins."""
    #: this and the next: a compromise between fuel and success of champion_leo in world=leo, as tried
    planned_force_n: Annotated[types.Positive, Only("safety.probability")] = 0.085
    """Greatest force along each Hill axis that is passed on where anything is inexact."""
    planned_braking_n: Annotated[types.Positive, Only("safety.probability")] = 0.22
    """Greatest force of such a stop where anything is inexact, if less than braking_force_n."""
    passive_horizon_s: types.NotNegative = 600.0
    """How long free drift stays outside the keep-out sphere; 0: off."""
    keep_in_horizon_s: types.NotNegative = 0.0
    """How long free drift stays inside the keep-in sphere; 0: off."""
    keep_way_out: Annotated[types.Flag, Only("problem.kind=inspection")] = False
    """Whether one push onto a closed ellipse between the spheres is always left; the last period fires it."""
    delta_v_limit_m_s: types.NotNegative = 0.0
    """Greatest delta-v of a flight, of which the push onto a closed ellipse is always left; 0: any."""


#: numbers that all flights of an evaluation share, since samples and decisions depend on them
SHARED = (
    *("attitude_period_s", "control_period_s", "duration_s"),
    *("navigation.fix_period_s", "navigation.delay_s", "actuators.delay_s"),
)


class Mission(Settings, group=""):
    """One flight: everything the simulation depends on except the start and the controller."""

    problem: Problem = field(default_factory=Problem)
    orbit: OrbitSettings = field(default_factory=OrbitSettings)
    deputy: DeputySettings = field(default_factory=DeputySettings)
    chief: ChiefSettings = field(default_factory=ChiefSettings)
    sensor: Sensor = field(default_factory=Sensor)
    attitude: Attitude = field(default_factory=Attitude)
    guidance: Guidance = field(default_factory=Guidance)
    safety: Safety = field(default_factory=Safety)
    navigation: Navigation = field(default_factory=Navigation)
    actuators: Actuators = field(default_factory=Actuators)
    dynamics: Dynamics = field(default_factory=Dynamics)
    fleet: Fleet = field(default_factory=Fleet)
    attitude_period_s: types.Positive = 1.0
    """Time between two torques; must divide control_period_s."""
    control_period_s: types.Positive = 10.0
    """Time over which a force is held."""
    duration_s: types.Positive = 3600.0
    """Length of a flight; a multiple of control_period_s."""
    after_s: Annotated[types.NotNegative, Only("problem.kind=inspection")] = 0.0
    """How long a flight must stay within the distance limits after its end, without force; 0: not at all."""
    coast_when_complete: types.Flag = True
    """Whether no force follows once every point is inspected."""
    inspection_threshold_percent: Annotated[types.Number, Field(ge=0, le=100)] = 95.0
    """Share of the points from which on a flight is a success."""
    light: Light = field(default_factory=Light)
    dispersions: dict[str, Any] = field(default_factory=dict, hash=False)
    """Distributions of settings that differ between flights, or vary within one."""
    flight: Literal["compiled", "reference"] = "compiled"
    """What flies: compiled code, or the reference in plain NumPy, slowly."""

    def __post_init__(self) -> None:
        """Check that its settings fit together, by the table of `pipeline.settings.relations`."""
        self._check_dispersions()
        check_relations(self)

    def _check_dispersions(self) -> None:
        """Raise SettingError for distributions of anything other than a number of a single flight."""
        for distribution in distributions(self.dispersions):
            node: Any = self
            for name in distribution.key.split("."):
                is_key = name != "dispersions" and name in getattr(node, "__dataclass_fields__", ())
                node = getattr(node, name) if is_key else None
            if not isinstance(node, float) or distribution.key in SHARED:
                raise SettingError(
                    f"dispersions.{distribution.key} is no number that a flight can have its own of; it must "
                    "be a key of the mission with a decimal number, and no clock or delay, as in "
                    "+dispersions.deputy.mass_kg={kind:normal,mean:12.0,std:0.1}"
                )

    def refusal_of_plans(self, planner: str) -> str | None:
        """Return what plans of pushes do not know of a camera or limits, and the cure; None if nothing."""
        sensor = self.sensor
        for words, is_set, cure in (
            ("sensor.rectangle_deg is given", sensor.rectangle_deg is not None, "null"),
            (f"sensor.min_range_m is {sensor.min_range_m:g}", sensor.min_range_m > 0.0, "0"),
            ("chief.keep_out_m is given", bool(self.chief.keep_out_m), "[]"),
        ):
            if is_set:
                return f"{words}, which {planner} do not know of; set it to {cure} for them"
        return None

    @property
    def has_fleet(self) -> bool:
        """Whether several deputies fly."""
        return self.fleet.deputies > 1

    @property
    def of_each(self) -> "Mission":
        """The mission as each deputy of a fleet flies it, as if alone, with margins if it is kept apart."""
        return replace(self, fleet=Fleet(keep_apart_m=self.fleet.keep_apart_m)) if self.has_fleet else self

    def require_one_deputy(self, what: str) -> None:
        """Raise SettingError in a mission of a fleet, for what knows of one deputy alone."""
        if self.has_fleet:
            raise SettingError(
                f"fleet.deputies is {self.fleet.deputies}, and {what} knows of one deputy; leave "
                "fleet.deputies out"
            )

    @cached_property
    def varying(self) -> dict[str, Distribution]:
        """The distributions that vary within a flight, by key."""
        return processes(self.dispersions)

    @property
    def filtered(self) -> FilteredNavigation:
        """The filter's settings: defaults where navigation is perfect, and nothing reads them."""
        return self.navigation if isinstance(self.navigation, FilteredNavigation) else PositionFixes()

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
    def braking_force_n(self) -> float:
        """Greatest force along each Hill axis with which the safety layer plans to stop."""
        given = self.safety.braking_force_n
        return 0.8 * self.deputy.max_force_n if given is None else given

    @property
    def has_true_course(self) -> bool:
        """Whether what turns, and what is predicted, follows the chief's orbit instead of its mean motion."""
        dynamics, course = self.dynamics, self.orbit.course
        if not isinstance(dynamics, TwoBody) or course != "auto":
            return isinstance(dynamics, TwoBody) and course == "true"
        # on a circle oblateness turns Hill axes by half a degree more an orbit, and moves paths by a metre
        is_told = self.chief.initial_angular_velocity_rad_s is not None or self.duration_s > LONG_S
        return self.orbit.elements.eccentricity > 0.0 or (dynamics.j2 > 0.0 and is_told)

    @property
    def fastest_turn_rad_s(self) -> float:
        """The greatest rate at which Hill axes turn in the flight: on an ellipse nearest to the planet."""
        n, (size, e, *_) = self.orbit.mean_motion_rad_s, self.orbit.elements
        if not self.has_true_course or e == 0.0:
            return n
        nearest = least_radius(self.orbit.elements, n * self.duration_s)
        return n * math.sqrt(1.0 - e * e) * (size / nearest) ** 2

    @property
    def greatest_tide_per_s2(self) -> float:
        """The greatest acceleration in the flight that holds a deputy above the chief, over its height."""
        n, (size, e, *_) = self.orbit.mean_motion_rad_s, self.orbit.elements
        if not self.has_true_course or e == 0.0:
            return 3.0 * n**2
        nearest = least_radius(self.orbit.elements, n * self.duration_s)
        return 2.0 * n**2 * (size / nearest) ** 3 + self.fastest_turn_rad_s**2

    @property
    def num_controls(self) -> int:
        """Number of control periods in the flight; the state is sampled at one instant more."""
        return round(self.duration_s / self.control_period_s)

    @property
    def num_attitude_steps(self) -> int:
        """Number of attitude periods in a control period."""
        return round(self.control_period_s / self.attitude_period_s)
