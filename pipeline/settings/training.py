"""How a controller is trained, as frozen data: starts, what is tuned, prices, and the search."""

import math
from dataclasses import dataclass, replace
from typing import Literal

from pipeline.settings import checks
from pipeline.settings.checks import SettingError


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
        checks.shell("starts", self.min_distance_m, self.max_distance_m)
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
    """How far genes can change what they tune."""

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
    coast_below_points: tuple[float, ...] | None = None
    coast_margin_m: tuple[float, ...] | None = None
    urgency_time_s: tuple[float, ...] | None = None
    skirt_distance_m: tuple[float, ...] | None = None

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
            ("coast_below_points", "", 0.0),
            ("coast_margin_m", "m", 0.0),
            ("urgency_time_s", "s", 1.0),
            ("skirt_distance_m", "m", 0.0),
        ):
            if (bounds := getattr(self, name)) is not None:
                checks.interval(f"optimizer.encoding.{name}", bounds, least, math.inf, unit)


@dataclass(frozen=True, kw_only=True)
class Penalty:
    """Weights in the fitness beside delta-v, m/s: outside the limits, each point short of 95, of 99."""

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
        checks.workers("optimizer.workers", self.workers)
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
