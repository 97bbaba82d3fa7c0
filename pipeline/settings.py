"""What an experiment is made of, as frozen data: every key of `conf/`, checked when it is built.

Keys carry their units; degrees appear only in keys that end in ``_deg``. A setting that cannot be is refused
with a `SettingError`.
"""

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Literal

from pipeline import checks
from pipeline.checks import SettingError
from pipeline.controller_settings import check_controller
from pipeline.nearest import did_you_mean

__all__ = [
    "SHIPPED",
    "STAGES",
    "Attitude",
    "Chief",
    "Compare",
    "Deputy",
    "Encoding",
    "Experiment",
    "Guidance",
    "Mission",
    "MonteCarlo",
    "Optimizer",
    "Optimum",
    "Orbit",
    "Penalty",
    "Report",
    "Safety",
    "Sensor",
    "SettingError",
    "Starts",
    "Sun",
    "Telemetry",
]

#: in the order in which they run: each reads what those before it have written
STAGES = ("scenario", "train", "evaluate", "record", "optimum", "compare", "report")

#: the plans of least fuel that come with the program, as a value of ``optimum.reference``
SHIPPED = "shipped"

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
    """One inspection flight: everything the simulation depends on but the start and the controller."""

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


@dataclass(frozen=True, kw_only=True)
class Starts:
    """Where training flights start, always at rest: the eight octants' diagonals, or drawn in a shell."""

    kind: Literal["octants", "random"]
    #: training scenarios; the octants are eight
    num_cases: int
    #: distance from the chief; equal for the octants
    min_distance_m: float
    max_distance_m: float
    #: whether each round of training draws its own
    redraw: bool
    #: besides them, from the second round on: of so many more starts, those on which the champion does worst
    num_hard: int = 0
    hard_from: int = 0

    def __post_init__(self) -> None:
        """Refuse training without scenarios and shells that are inside out."""
        checks.count("starts.num_cases", self.num_cases, 1, "; without scenarios nothing can be trained")
        _check_shell("starts", self.min_distance_m, self.max_distance_m)
        checks.count("starts.num_hard", self.num_hard, 0)
        checks.count("starts.hard_from", self.hard_from, 0)
        if self.num_hard > self.hard_from:
            raise SettingError(
                f"starts.num_hard is {self.num_hard} and starts.hard_from {self.hard_from}; the hard starts "
                "are the worst of so many, which must be more"
            )
        if self.kind == "octants" and (self.num_cases != 8 or self.min_distance_m != self.max_distance_m):
            raise SettingError(
                f"starts.kind is octants with {self.num_cases} cases from {self.min_distance_m} to "
                f"{self.max_distance_m} m; octants are eight starts at one distance: set "
                "starts.num_cases=8 and equal distances, or choose starts=random"
            )


@dataclass(frozen=True, kw_only=True)
class Encoding:
    """How far genes can move what they tune."""

    #: width of the window of an inner mean, a fraction of the spacing of evenly spaced terms
    mean_window: float
    #: least and greatest, as fractions of the width of a variable's range
    standard_deviation_fraction: tuple[float, ...]
    #: least and greatest half-width of the output's range
    output_range_n: tuple[float, ...]
    #: every rule's term a gene of its own; rule tables as planes, from a gain for each input; or rules kept
    rules: Literal["free", "planes", "fixed"] = "free"
    #: least and greatest of a controller's constants; None keeps what the controller sets
    ring_size_m: tuple[float, ...] | None = None
    ring_lead_rad: tuple[float, ...] | None = None
    dead_band_n: tuple[float, ...] | None = None
    prediction_time_s: tuple[float, ...] | None = None
    ring_hold_rad: tuple[float, ...] | None = None
    coast_below_points: tuple[float, ...] | None = None
    coast_margin_m: tuple[float, ...] | None = None

    def __post_init__(self) -> None:
        """Refuse bounds between which there is nothing."""
        checks.positive("optimizer.encoding.mean_window", self.mean_window)
        checks.within("optimizer.encoding.mean_window", self.mean_window, 0.0, 0.99)
        checks.bounds(
            "optimizer.encoding.standard_deviation_fraction", self.standard_deviation_fraction, 0.0, 1.0
        )
        checks.bounds("optimizer.encoding.output_range_n", self.output_range_n, 0.0, math.inf, "N")
        for name, unit, least in (
            ("ring_size_m", "m", 0.0),
            ("ring_lead_rad", "rad", -math.inf),
            ("dead_band_n", "N", 0.0),
            ("prediction_time_s", "s", 0.0),
            ("ring_hold_rad", "rad", 0.0),
            ("coast_below_points", "", 0.0),
            ("coast_margin_m", "m", 0.0),
        ):
            if (bounds := getattr(self, name)) is not None:
                checks.interval(f"optimizer.encoding.{name}", bounds, least, math.inf, unit)


@dataclass(frozen=True, kw_only=True)
class Penalty:
    """Weights of the fitness besides delta-v, m/s: outside the limits, each point short of 95, of 99."""

    c_d: float
    c_95: float
    c_99: float
    #: by which c_95 and c_99 are multiplied from one round of training to the next
    growth: float = 1.0
    #: in training a flight counts as outside from here on, inside the distance limits
    near_margin_m: float = 0.0
    far_margin_m: float = 0.0

    def __post_init__(self) -> None:
        """Refuse penalties that reward."""
        for name in ("c_d", "c_95", "c_99"):
            checks.within(f"optimizer.penalty.{name}", getattr(self, name), 0.0, math.inf, "m/s")
        checks.within("optimizer.penalty.growth", self.growth, 1.0, 10.0)
        for name in ("near_margin_m", "far_margin_m"):
            checks.within(f"optimizer.penalty.{name}", getattr(self, name), 0.0, math.inf, "m")

    def of_round(self, round_index: int) -> "Penalty":
        """Return the weights of a round, counted from 0."""
        factor = self.growth**round_index
        return replace(self, c_95=factor * self.c_95, c_99=factor * self.c_99)


@dataclass(frozen=True, kw_only=True)
class Optimizer:
    """The evolution; the crossover rate counts the `whole` population or the `rest` but the elite."""

    population_size: int
    generations: int
    tournament_size: int
    crossover_rate: float
    elitism_rate: float
    split: Literal["whole", "rest"]
    stall_generations: int | None
    rounds: int
    encoding: Encoding
    penalty: Penalty
    #: threads that fly episodes; None is one for each processor
    workers: int | None
    #: the genetic algorithm, a normal distribution that adapts its covariance, or a front of two objectives
    algorithm: Literal["genetic", "cma_es", "nsga2"] = "genetic"
    #: of the genetic algorithm: MATLAB's, or few genes by small steps
    mutation: Literal["adaptive_feasible", "local"] = "adaptive_feasible"
    #: besides the controller that training starts from: drawn anywhere, or local mutants of it
    first_population: Literal["random", "near"] = "random"
    #: whether a round after the first begins with a new first population or goes on with the one it finds
    next_round: Literal["afresh", "carried"] = "afresh"
    #: standard deviation of local mutation's steps and of CMA-ES's first sample, in genes
    initial_step: float = 0.1
    #: by which the steps of local mutation are multiplied from one round to the next
    cooling: float = 1.0
    #: starts that neither training nor evaluation flies, on which the best of the rounds' champions is
    #: chosen; with 0 it is the last one
    validation_cases: int = 0

    def step_of_round(self, round_index: int) -> float:
        """Return the step with which a round begins, counted from 0."""
        return 1.0 if self.mutation == "adaptive_feasible" else self.initial_step * self.cooling**round_index

    def __post_init__(self) -> None:
        """Refuse populations that cannot breed."""
        checks.count("optimizer.population_size", self.population_size, 2)
        checks.count("optimizer.generations", self.generations, 1)
        checks.count("optimizer.tournament_size", self.tournament_size, 1)
        checks.within("optimizer.crossover_rate", self.crossover_rate, 0.0, 1.0)
        checks.within("optimizer.elitism_rate", self.elitism_rate, 0.0, 0.9)
        checks.count("optimizer.rounds", self.rounds, 1)
        if self.stall_generations is not None:
            checks.count("optimizer.stall_generations", self.stall_generations, 1, ", or null for none")
        _check_workers("optimizer.workers", self.workers)
        checks.within("optimizer.initial_step", self.initial_step, 1e-6, 1.0)
        checks.within("optimizer.cooling", self.cooling, 0.1, 1.0)
        checks.count("optimizer.validation_cases", self.validation_cases, 0)
        if self.algorithm == "cma_es":
            checks.within("optimizer.population_size", self.population_size, 5, math.inf)
        if self.algorithm == "nsga2":
            self._check_front()
        if self.split == "whole" and self.crossover_rate + self.elitism_rate > 1.0 + 1e-9:
            raise SettingError(
                f"optimizer.crossover_rate is {self.crossover_rate} and optimizer.elitism_rate "
                f"{self.elitism_rate}, together more than the whole population; lower one of them, or choose "
                "optimizer.split=rest"
            )

    def _check_front(self) -> None:
        """Refuse populations in which no tournament is held, and fronts that nobody could judge."""
        checks.within("optimizer.population_size", self.population_size, 4, math.inf)
        checks.count("optimizer.validation_cases", self.validation_cases, 1, "; a front is judged on them")
        if self.mutation != "local":
            raise SettingError(
                f"optimizer.mutation is {self.mutation}, which follows a single fitness; with "
                "optimizer.algorithm=nsga2 it must be local"
            )


@dataclass(frozen=True, kw_only=True)
class MonteCarlo:
    """The evaluation: flights from random starts, isotropic and uniform in distance, at rest."""

    num_cases: int
    min_distance_m: float
    max_distance_m: float
    #: of the intervals in the summary
    confidence_percent: float
    #: threads that fly episodes; None is one for each processor
    workers: int | None

    def __post_init__(self) -> None:
        """Refuse an evaluation without cases."""
        checks.count(
            "monte_carlo.num_cases", self.num_cases, 1, "; without scenarios there is nothing to fly"
        )
        _check_shell("monte_carlo", self.min_distance_m, self.max_distance_m)
        checks.within("monte_carlo.confidence_percent", self.confidence_percent, 50.0, 99.99, "%")
        _check_workers("monte_carlo.workers", self.workers)


@dataclass(frozen=True, kw_only=True)
class Optimum:
    """The plan of least fuel, made with the whole flight known."""

    #: those of the evaluation, or the start that the deputy is given
    cases: Literal["evaluation", "start"]
    #: to be inspected
    points: int
    #: most beginnings of the global search
    restarts: int
    #: most burns of the global search, the first at the start
    burns: int
    #: disturbances of the best plan in a row that better nothing, after which it is done
    kicks: int
    #: threads that solve cases; None is one for each processor
    workers: int | None
    #: whose cases evaluations are measured by: `SHIPPED`, the folder of a run with solved cases, or None
    reference: str | None

    def __post_init__(self) -> None:
        """Refuse searches for nothing."""
        checks.count("optimum.points", self.points, 1)
        checks.count("optimum.restarts", self.restarts, 1)
        checks.count("optimum.burns", self.burns, 2)
        checks.within("optimum.burns", self.burns, 2, 5)
        checks.count("optimum.kicks", self.kicks, 0)
        _check_workers("optimum.workers", self.workers)


@dataclass(frozen=True, kw_only=True)
class Compare:
    """Controllers side by side: who flies, and under what."""

    #: names as in ``controller=NAME``, or paths
    controllers: tuple[str, ...]
    #: each of fixed, random, mixed
    suns: tuple[str, ...]
    #: each of none, filter
    safety: tuple[str, ...]

    def __post_init__(self) -> None:
        """Refuse tables without rows, and rows that nobody could tell apart."""
        known = {"suns": ("fixed", "random", "mixed"), "safety": ("none", "filter")}
        for name in ("controllers", "suns", "safety"):
            values = getattr(self, name)
            if not values or len(set(values)) != len(values):
                raise SettingError(
                    f"compare.{name} is [{', '.join(values)}]; name at least one, and each once"
                )
            for value in values:
                if name in known and value not in known[name]:
                    raise SettingError(
                        f"compare.{name} has {value!r}; it must be one of {', '.join(known[name])}"
                        + did_you_mean(value, known[name])
                    )


@dataclass(frozen=True, kw_only=True)
class Telemetry:
    """Which flights are recorded, and what the log calls near."""

    #: the flights of the training scenarios
    record_training: bool
    #: of the evaluation: the worst, the median and the best
    record_ranked: bool
    #: the flight from `deputy.initial_position_m`
    record_start: bool
    #: the log warns when a distance limit is nearer than this
    near_limit_m: float

    def __post_init__(self) -> None:
        """Refuse a margin that is none."""
        checks.within("telemetry.near_limit_m", self.near_limit_m, 0.0, math.inf, "m")


@dataclass(frozen=True, kw_only=True)
class Report:
    """How the report looks."""

    title: str
    #: of the PNG files
    dots_per_inch: int
    #: the training scenario whose force and torque are drawn, from 0
    training_case: int

    def __post_init__(self) -> None:
        """Refuse pictures nobody can see."""
        checks.count("report.dots_per_inch", self.dots_per_inch, 20)
        checks.count("report.training_case", self.training_case, 0)


@dataclass(frozen=True, kw_only=True)
class Experiment:
    """Everything a run depends on.

    Parameters
    ----------
    name : str
        Names the run's folder.
    seed : int
        Of everything random.
    stages : tuple of str
        What is done, in order.
    mission, sun, starts, optimizer, monte_carlo, optimum, compare, telemetry, report
        The groups of the configuration.
    controller : mapping
        As plain data: a controller written out (``schema``, ``systems``, …), ``{path: ...}`` of a controller
        file, ``{kind: open_loop, path: ...}`` of a force table, ``{kind: coast}``, or of a kind that plans.
    resume : bool
        Whether to go on from a checkpoint in the run's folder; no part of the configuration.
    """

    name: str
    seed: int
    stages: tuple[str, ...]
    mission: Mission
    sun: Sun
    starts: Starts
    optimizer: Optimizer
    monte_carlo: MonteCarlo
    optimum: Optimum
    compare: Compare
    telemetry: Telemetry
    report: Report
    controller: Mapping[str, Any] = field(hash=False)
    resume: bool = False

    def __post_init__(self) -> None:
        """Refuse what does not fit together."""
        checks.count("seed", self.seed, 0)
        if not re.fullmatch(r"[A-Za-z0-9_.-]+", self.name):
            raise SettingError(
                f"name is {self.name!r}; it names a folder: use letters, digits, '_', '-' and '.' only"
            )
        self._check_stages()
        check_controller(self.controller)
        self._check_start()
        limits = self.mission.deputy.min_distance_m, self.mission.deputy.max_distance_m
        for group, shell in (("starts", self.starts), ("monte_carlo", self.monte_carlo)):
            for key in ("min_distance_m", "max_distance_m"):
                value = getattr(shell, key)
                if not limits[0] <= value <= limits[1]:
                    raise SettingError(
                        f"{group}.{key} is {value}, outside the limits of the flight; it must be from "
                        f"deputy.min_distance_m={limits[0]:g} to deputy.max_distance_m={limits[1]:g} (m)"
                    )
        if self.report.training_case >= self.starts.num_cases:
            raise SettingError(
                f"report.training_case is {self.report.training_case}, but there are {self.starts.num_cases} "
                f"training scenarios; choose one from 0 to {self.starts.num_cases - 1}"
            )

    def _check_start(self) -> None:
        if "record" not in self.stages or not self.telemetry.record_start:
            return
        deputy = self.mission.deputy
        distance = math.hypot(*deputy.initial_position_m)
        # by a billionth outside is rounding: a start on a limit, which is inside, may be written by its axes
        if not deputy.min_distance_m * (1 - 1e-9) <= distance <= deputy.max_distance_m * (1 + 1e-9):
            raise SettingError(
                f"deputy.initial_position_m is {distance:.6g} m from the chief, outside the limits of the "
                f"flight; it must be from deputy.min_distance_m={deputy.min_distance_m:g} to "
                f"deputy.max_distance_m={deputy.max_distance_m:g} (m): move the start, or a limit"
            )

    def _check_stages(self) -> None:
        if not self.stages:
            raise SettingError(f"stages is empty; name at least one of {', '.join(STAGES)}")
        for stage in self.stages:
            if stage not in STAGES:
                guess = did_you_mean(stage, STAGES)
                raise SettingError(
                    f"stages has {stage!r}"
                    + (f"{guess} The" if guess else "; the")
                    + f" stages are {', '.join(STAGES)}"
                )
        if list(self.stages) != sorted(set(self.stages), key=STAGES.index):
            raise SettingError(
                f"stages is [{', '.join(self.stages)}]; each reads what those before it wrote, so name each "
                f"once in the order {', '.join(STAGES)}"
            )
        if "train" in self.stages and "systems" not in self.controller and "kind" in self.controller:
            raise SettingError(
                f"stages has train, but a controller of kind {self.controller['kind']} has nothing to train; "
                "drop the stage or choose a fuzzy controller"
            )


def _check_shell(group: str, low: float, high: float) -> None:
    checks.positive(f"{group}.min_distance_m", low, "m")
    checks.number(f"{group}.max_distance_m", high, "metres")
    if not low <= high:
        raise SettingError(
            f"{group}.min_distance_m is {low} and {group}.max_distance_m is {high}; the first must not be "
            "greater than the second (m)"
        )


def _check_workers(key: str, workers: int | None) -> None:
    if workers is not None:
        checks.count(key, workers, 1, ", or null for one a processor")
