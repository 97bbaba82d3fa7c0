"""What an experiment is made of, as frozen data: every key of `conf/`, checked when it is built.

Keys carry their units; degrees appear only in keys that end in ``_deg``.
"""

from dataclasses import dataclass
from typing import Literal


@dataclass(frozen=True, kw_only=True)
class Orbit:
    """The chief's circular orbit."""

    mean_motion_rad_s: float


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


@dataclass(frozen=True, kw_only=True)
class Chief:
    """The inspected spacecraft and the points on it."""

    inertia_kg_m2: tuple[tuple[float, ...], ...]
    #: inertial rate in chief axes; None keeps the chief aligned with Hill
    initial_angular_velocity_rad_s: tuple[float, ...] | None
    inspection_radius_m: float
    num_points: int
    placement: Literal["deserno", "fibonacci"]


@dataclass(frozen=True, kw_only=True)
class Sensor:
    """The deputy's camera."""

    half_angle_deg: float
    boresight: tuple[float, ...]


@dataclass(frozen=True, kw_only=True)
class Sun:
    """Where the Sun starts: the same angle for every case, or one drawn for each."""

    mode: Literal["fixed", "random", "mixed"]
    angle_deg: float


@dataclass(frozen=True, kw_only=True)
class Attitude:
    """How the deputy points its camera; gains multiply the inertia matrix."""

    mode: Literal["flown", "ideal"]
    proportional_gain: float
    derivative_gain: float
    pole_blending: bool


@dataclass(frozen=True, kw_only=True)
class Guidance:
    """How the direction of the points that are lit and not yet inspected is chosen."""

    kind: Literal["centroid", "clusters"]
    engine: Literal["compiled", "sklearn"]


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

    @property
    def num_controls(self) -> int:
        """Control periods in the flight; the state is sampled at one instant more."""
        return round(self.duration_s / self.control_period_s)

    @property
    def num_attitude_steps(self) -> int:
        """Attitude periods in a control period."""
        return round(self.control_period_s / self.attitude_period_s)


@dataclass(frozen=True, kw_only=True)
class Encoding:
    """What a gene may say: bounds of decoded parameters; standard deviations are fractions of a universe."""

    output_range_n: tuple[float, float]
    standard_deviation_fraction: tuple[float, float]


@dataclass(frozen=True, kw_only=True)
class Penalty:
    """Weights of the fitness besides delta-v, m/s: outside the limits, each point short of 95, of 99."""

    c_d: float
    c_95: float
    c_99: float


@dataclass(frozen=True, kw_only=True)
class Optimizer:
    """The genetic algorithm; the crossover rate counts the `whole` population or the `rest` but the elite."""

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
