"""How a controller is trained: starts, what is tuned, prices, and the search."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Annotated, Any, Literal

from pydantic import Field

from pipeline.settings import checks, start_table, types
from pipeline.settings.checks import SettingError
from pipeline.settings.conditions import Only
from pipeline.settings.groups import Settings
from pipeline.settings.keys import is_key, leaves, unknown

#: of a population, or a tournament
MOST_INDIVIDUALS = 100_000
#: largest prices, m/s
MOST_PRICE = 1e15


DRAWS = Only("stages=scenario", "stages=train", "stages=search", "stages=fit", is_told=True)
TRAINS = Only("stages=train", "stages=search", "stages=fit", is_told=True)


class Starts(Settings, group="starts", only=DRAWS):
    """Starts of training flights: at rest on the octants' diagonals, drawn in a shell, or from a table."""

    kind: Literal["octants", "random", "file"] = "octants"
    """The octants' diagonals, drawn in a shell, or the rows of a file."""
    num_cases: types.Count = 8
    """Training scenarios."""
    min_distance_m: Annotated[types.Positive, types.Follows()] = 75.0
    """Least distance from the chief; null: as in monte_carlo, for the octants the mean of both."""
    max_distance_m: Annotated[types.Number, types.Follows()] = 75.0
    """Greatest distance from the chief; null: as in monte_carlo, for the octants the mean of both."""
    num_hard: types.Natural = 0
    """Further starts from the second round on: the champion's worst of hard_from."""
    hard_from: Annotated[types.Natural, Only("starts.num_hard>0")] = 0
    """Starts among which the hard ones are sought."""
    max_speed_m_s: Annotated[types.NotNegative, Field(le=100)] = 0.0
    """Greatest speed of starts that are drawn, any direction; 0: rest."""
    directions: Literal["even", "angles"] = "even"
    """Directions of starts and speeds: even on the sphere, or by even angles, denser at the poles (AFRL)."""
    box: types.Box | None = None
    """Least and greatest x, y, z, x', y', z' of starts drawn evenly between them; null: the shell."""

    def __post_init__(self) -> None:
        """Check the shell's bounds, and that the hard starts are a subset."""
        checks.shell("starts", self.min_distance_m, self.max_distance_m)
        if self.num_hard > self.hard_from:
            raise SettingError(
                f"starts.num_hard is {self.num_hard} and starts.hard_from {self.hard_from}; the hard starts "
                "are the worst of the second number, which must be greater"
            )

    @property
    def is_redrawn(self) -> bool:
        """Whether each round of training draws its own."""
        return isinstance(self, DrawnStarts) and self.redraw

    @property
    def rows(self) -> str | None:
        """The rows of a file, as CSV text; None of starts that are not given."""
        return self.table if isinstance(self, StartsOfFile) else None


class DrawnStarts(Starts):
    """Starts that a round may draw anew."""

    redraw: types.Flag = False
    """Whether each round of training draws its own."""


class OctantStarts(DrawnStarts, kind="octants"):
    """Starts at rest on the octants' diagonals."""

    def __post_init__(self) -> None:
        """Check that there are eight at one distance."""
        super().__post_init__()
        if self.num_cases != 8 or self.min_distance_m != self.max_distance_m:
            raise SettingError(
                f"starts.kind is octants with {self.num_cases} cases from {self.min_distance_m} to "
                f"{self.max_distance_m} m; octants are eight starts at one distance: set "
                "starts.num_cases=8 and equal distances, or choose starts=random"
            )


class RandomStarts(DrawnStarts, kind="random"):
    """Starts drawn in a shell."""


class StartsOfFile(Starts, kind="file"):
    """The rows of a file."""

    path: types.Text | None = None
    """The CSV file that the table came from."""
    table: types.Text | None = None
    """The rows of that file, as CSV text."""

    def __post_init__(self) -> None:
        """Check that there is a table with as many starts."""
        super().__post_init__()
        if self.table is None:
            raise SettingError("starts.kind is file and starts.table is null; choose starts=PATH.csv")
        start_table.check_count("starts", self.num_cases, self.table)


class Encoding(Settings, group="optimizer.encoding", only=TRAINS):
    """Range of the genes; a constant with bounds is tuned, null keeps the controller's."""

    mean_window: Annotated[types.Positive, Field(le=0.99)] = 0.9
    """Window of an inner mean, in spacings of evenly spaced terms."""
    standard_deviation_fraction: types.IntervalOf[Annotated[types.Positive, Field(le=1)]] = (0.04, 0.3)
    """Bounds of standard deviations, in widths of a variable's range."""
    output_range_n: types.PositiveInterval = (0.01, 0.3)
    """Bounds of the half-width of the output's range."""
    rules: Literal["free", "planes", "fixed"] = "free"
    """A gene for the term of each rule; rule tables as planes; or rules kept."""
    stretch: types.PositiveInterval | None = None
    """Bounds of factors on ranges with all their terms, in place of means and widths."""
    digits: Annotated[types.Whole | None, Field(ge=1, le=17)] = None
    """Significant digits of stretched ranges and of constants; null: all."""
    ring_size_m: types.NotNegativeInterval | None = None
    """Height of the ring."""
    ring_lead_rad: types.Interval | None = None
    """How far the Sun is ahead of the place on the ring."""
    dead_band_n: types.NotNegativeInterval | None = None
    """A smaller force is not fired; a gene for each axis."""
    prediction_time_s: types.NotNegativeInterval | None = None
    """How far ahead predicted_centre_along_track looks."""
    coast_below_points: types.NotNegativeInterval | None = None
    """Coast if coasting to the end would miss fewer points."""
    coast_margin_m: types.NotNegativeInterval | None = None
    """Coast only if that stays this far inside the distance limits."""
    urgency_time_s: types.IntervalOf[Annotated[types.Number, Field(ge=1)]] | None = None
    """Time before its last light within which a point becomes urgent."""
    skirt_distance_m: types.NotNegativeInterval | None = None
    """Nearer to the chief, directions turn aside from it."""
    see_horizon_s: types.NotNegativeInterval | None = None
    """Points that go dark for good within this time count in see_push_* and aim_*."""
    see_damping_ks2: types.PositiveInterval | None = None
    """Weight that keeps see_push_* small."""
    aim_urgent_m_s: types.NotNegativeInterval | None = None
    """Speed that the urgent direction adds to see_push_* in aim_*."""
    tour_time_s: types.PositiveInterval | None = None
    """Time in which a place on the tour is to be reached."""
    tour_wait_s: types.NotNegativeInterval | None = None
    """Longest wait for the end of a shadow over the tour."""
    tour_lean_m: types.NotNegativeInterval | None = None
    """How far the tour leans towards what is urgent."""
    tour_m: types.Interval | None = None
    """Each mean and wave of the tour that the controller sets."""

    def __post_init__(self) -> None:
        """Check that stretched systems have genes."""
        if self.stretch is not None and self.rules == "free":
            raise SettingError(
                "optimizer.encoding.stretch is given and optimizer.encoding.rules is free; ranges stretch "
                "with rules=planes or rules=fixed: choose one of them, or set stretch=null"
            )


class Penalty(Settings, group="optimizer.penalty", only=TRAINS):
    """Prices in the fitness besides delta-v; see `pipeline.training.fitness`.

    With 8 starts and 900 m/s, the most that 1 N can spend in a flight, the defaults make a point short of 95
    in one start outweigh any delta-v (1e4/8 > 900), and leaving the limits once outweigh all missing points
    and any delta-v (1e7/8 > 900 + 95e4).
    """

    outside_m_s: types.NotNegative = 1.0e7
    """For a flight outside the distance limits, and again for each metre outside."""
    outside_most_m: types.NotNegative | None = None
    """Most metres outside that are priced; null: all."""
    short_point_m_s: types.NotNegative = 1.0e4
    """For each point short of a success."""
    missed_point_m_s: types.NotNegative = 0.05
    """For each point that is not inspected."""
    growth: Annotated[types.Number, Field(ge=1, le=10), Only("optimizer.rounds>1")] = 1.0
    """Factor on the prices of points from one round to the next."""
    near_margin_m: types.NotNegative = 0.0
    """How much greater the least distance is in training."""
    far_margin_m: types.NotNegative = 0.0
    """How much less the greatest distance is in training."""

    def of_round(self, changes: int) -> "Penalty":
        """Return the prices after so many changes."""
        factor = self.growth**changes
        short, missed = factor * self.short_point_m_s, factor * self.missed_point_m_s
        return replace(self, short_point_m_s=short, missed_point_m_s=missed)


#: individuals of which CMA-ES needs at least so many
LEAST_OF_CMA_ES = 5
#: keys of planes that are sought
SEEKS_PLANES = Only("optimizer.planes.rounds>0")


class PlanesSearch(Settings, group="optimizer.planes", only=TRAINS):
    """First rounds, in which CMA-ES seeks rule tables that are planes; the next begins near the best."""

    rounds: Annotated[types.Natural, Only("optimizer.rounds>1"), Only("optimizer.algorithm=genetic")] = 0
    """Of the optimizer's rounds the first so many."""
    population_size: Annotated[types.Whole, Field(ge=LEAST_OF_CMA_ES, le=MOST_INDIVIDUALS), SEEKS_PLANES] = 32
    """Individuals in a generation."""
    generations: Annotated[types.Count, SEEKS_PLANES] = 74
    """Generations after the first, in each of these rounds."""
    initial_step: Annotated[types.Number, Field(ge=1e-6, le=1), SEEKS_PLANES] = 0.3
    """Standard deviation of the first sample, in genes: next to nothing is known of planes."""
    short_point_m_s: Annotated[types.NotNegative, SEEKS_PLANES] = 1.0
    """Price of each point short of a success, in the first round."""
    missed_point_m_s: Annotated[types.NotNegative, SEEKS_PLANES] = 0.05
    """Price of each point that is not inspected, in the first round."""
    growth: Annotated[types.Number, Field(ge=1, le=10), SEEKS_PLANES] = 1.6
    """Factor on these prices from one of these rounds to the next."""


#: where local mutation takes steps
LOCAL_STEPS = Only("optimizer.mutation=local", "optimizer.algorithm=nsga2")
#: where there is a first step
FIRST_STEP = Only(
    *("optimizer.algorithm=cma_es", "optimizer.algorithm=nsga2"),
    *("optimizer.mutation=local", "optimizer.first_population=near"),
)


def _check_prices(group: str, first: "Penalty | PlanesSearch", rounds_key: str, rounds: int) -> None:
    """Refuse prices of points that grow beyond what flights can be compared by."""
    digits = (rounds - 1) * math.log10(first.growth) + math.log10(
        max(first.short_point_m_s, first.missed_point_m_s, 1.0)
    )
    if digits > math.log10(MOST_PRICE):
        raise SettingError(
            f"{group}.growth is {first.growth:g} and {rounds_key} {rounds}, by which prices grow to "
            f"1e{digits:.0f} m/s; they may grow to {MOST_PRICE:g}: lower one of them"
        )


class Optimizer(Settings, group="optimizer", only=TRAINS):
    """The evolutionary algorithm: by default the paper's genetic algorithm."""

    population_size: Annotated[types.Whole, Field(ge=2, le=MOST_INDIVIDUALS)] = 200
    """Individuals in a generation."""
    generations: types.Count = 500
    """Generations after the first, in each round."""
    stall_generations: types.Count | None = None
    """Generations without improvement after which a round ends; null: any number."""
    rounds: types.Count = 1
    """Rounds of training, each from the last one's champion."""
    encoding: Encoding = field(default_factory=Encoding)
    penalty: Penalty = field(default_factory=Penalty)
    planes: PlanesSearch = field(default_factory=PlanesSearch)
    workers: types.Workers = None
    """Threads that fly; null: one a processor."""
    algorithm: Literal["genetic", "cma_es", "nsga2"] = "genetic"
    """Crossover and mutation; an adapting normal distribution; a front of two objectives."""
    next_round: Annotated[Literal["afresh", "carried"], Only("optimizer.rounds>1")] = "afresh"
    """How a later round begins: with a new population and the champion, or with the last population."""
    initial_step: Annotated[types.Number, Field(ge=1e-6, le=1), FIRST_STEP] = 0.1
    """Standard deviation of local mutation, and of CMA-ES's first sample, in genes."""
    validation_cases: types.Natural = 0
    """Starts on which the best of all generations is chosen; 0: the last, if better than the given one."""
    success_goal_percent: Annotated[types.Number | None, Field(ge=0, le=100)] = None
    """Success beyond which the best are chosen by cost; null: by success wherever its intervals lie apart."""

    def __post_init__(self) -> None:
        """Check that the population suits the algorithm, and that prices stay numbers."""
        least = {"cma_es": LEAST_OF_CMA_ES, "nsga2": 4}.get(self.algorithm, 2)
        checks.within("optimizer.population_size", self.population_size, least, math.inf)
        _check_prices("optimizer.penalty", self.penalty, "optimizer.rounds", self.rounds)

    @property
    def num_planes_rounds(self) -> int:
        """How many of the first rounds seek rule tables that are planes."""
        return 0

    def of_round(self, round_index: int) -> "Optimizer":
        """Return the settings of the search in a round, counted from 0."""
        return self

    def penalty_of_round(self, round_index: int) -> Penalty:
        """Return the prices of a round, counted from 0."""
        return self.penalty.of_round(round_index)

    def step_of_round(self, round_index: int) -> float:
        """Return the step with which a round begins, counted from 0, in genes."""
        return self.initial_step


class GeneticAlgorithm(Optimizer, algorithm="genetic"):
    """The paper's genetic algorithm: crossover and mutation."""

    tournament_size: Annotated[types.Count, Field(le=MOST_INDIVIDUALS)] = 4
    """Individuals in a tournament, whose best becomes a parent."""
    crossover_rate: types.Share = 0.8
    """Share of a generation that are children of two parents."""
    elitism_rate: Annotated[types.Number, Field(ge=0, le=0.9)] = 0.1
    """Share that passes unchanged into the next."""
    split: Literal["whole", "rest"] = "whole"
    """What crossover_rate is a share of: the whole generation, or the rest without elite."""
    mutation: Literal["adaptive_feasible", "local"] = "adaptive_feasible"
    """MATLAB's, all genes along one direction, or few genes by small normal steps."""
    first_population: Literal["random", "near"] = "random"
    """Besides the controller: drawn anywhere, or its local mutants."""
    cooling: Annotated[types.Number, Field(ge=0.1, le=1), LOCAL_STEPS] = 1.0
    """Factor on the steps of local mutation from round to round."""

    def __post_init__(self) -> None:
        """Check that rates leave room for one another, and that planes leave rounds and rules to the rest."""
        super().__post_init__()
        planes = self.planes.rounds
        if planes and (planes >= self.rounds or self.encoding.rules != "free"):
            raise SettingError(
                f"optimizer.planes.rounds is {planes} with optimizer.rounds={self.rounds} and "
                f"optimizer.encoding.rules={self.encoding.rules}; a later round must free the rules of the "
                f"planes: set optimizer.rounds to at least {planes + 1} and optimizer.encoding.rules=free, "
                "or optimizer.planes.rounds=0"
            )
        _check_prices("optimizer.planes", self.planes, "optimizer.planes.rounds", planes)
        if self.split == "whole" and self.crossover_rate + self.elitism_rate > 1.0 + 1e-9:
            raise SettingError(
                f"optimizer.crossover_rate is {self.crossover_rate} and optimizer.elitism_rate "
                f"{self.elitism_rate}, together more than the whole population; lower one of them, or choose "
                "optimizer.split=rest"
            )

    def step_of_round(self, round_index: int) -> float:
        """Return the step with which a round begins, counted from 0, in genes."""
        coolings = round_index - self.num_planes_rounds
        return 1.0 if self.mutation == "adaptive_feasible" else self.initial_step * self.cooling**coolings

    @property
    def num_planes_rounds(self) -> int:
        """How many of the first rounds seek rule tables that are planes."""
        return self.planes.rounds

    def of_round(self, round_index: int) -> Optimizer:
        """Return the settings of the search in a round, counted from 0."""
        if round_index >= self.num_planes_rounds:
            return self
        shared = {name: getattr(self, name) for name in ("stall_generations", "rounds", "next_round")}
        return CmaEs(
            population_size=self.planes.population_size,
            generations=self.planes.generations,
            initial_step=self.planes.initial_step,
            **shared,
        )

    def penalty_of_round(self, round_index: int) -> Penalty:
        """Return the prices of a round, counted from 0."""
        planes = self.planes
        if round_index >= planes.rounds:
            return self.penalty.of_round(round_index - planes.rounds)
        short, missed = planes.short_point_m_s, planes.missed_point_m_s
        first = replace(self.penalty, short_point_m_s=short, missed_point_m_s=missed, growth=planes.growth)
        return first.of_round(round_index)


class CmaEs(Optimizer, algorithm="cma_es"):
    """CMA-ES: an adapting normal distribution."""


class Nsga2(Optimizer, algorithm="nsga2"):
    """NSGA-II: a front of two objectives, near a controller, by crossover and local mutation."""

    crossover_rate: types.Share = 0.3
    """Share of children of two parents."""
    cooling: Annotated[types.Number, Field(ge=0.1, le=1), LOCAL_STEPS] = 1.0
    """Factor on the steps of local mutation from round to round."""

    def step_of_round(self, round_index: int) -> float:
        """Return the step with which a round begins, counted from 0, in genes."""
        return self.initial_step * self.cooling**round_index


@dataclass(frozen=True)
class Dimension:
    """A key and its possible values.

    Parameters
    ----------
    key : str
        Dotted, such as ``optimizer.initial_step``.
    low, high : float or int
        Of a range; whole numbers if both are.
    is_log : bool
        Whether values are uniform in the logarithm.
    choices : tuple
        Instead of a range.
    """

    key: str
    low: float = 0.0
    high: float = 0.0
    is_log: bool = False
    choices: tuple[Any, ...] = ()


def dimensions(space: Mapping[str, Any]) -> tuple[Dimension, ...]:
    """Parse the space of a search: keys with ``{low:, high:}``, ``log: true`` too, or with ``{choices: []}``.

    Raises
    ------
    SettingError
        If a key is unknown, or its entry has another form.
    """
    return tuple(_dimension(key, leaf) for key, leaf in sorted(leaves(space, ("low", "high", "choices"))))


def _dimension(key: str, leaf: Any) -> Dimension:
    if not is_key(key):
        raise SettingError(f"hparams_search.space: {unknown(key)}")
    if isinstance(leaf, Mapping) and set(leaf) == {"choices"} and isinstance(leaf["choices"], list):
        if len(leaf["choices"]) > 1:
            return Dimension(key, choices=tuple(leaf["choices"]))
    elif isinstance(leaf, Mapping) and {"low", "high"} <= set(leaf) <= {"low", "high", "log"}:
        low, high, is_log = leaf["low"], leaf["high"], leaf.get("log", False)
        are_numbers = all(type(value) in (int, float) and math.isfinite(value) for value in (low, high))
        if are_numbers and low < high and isinstance(is_log, bool) and (low > 0 or not is_log):
            return Dimension(key, low, high, is_log)
    raise SettingError(
        f"hparams_search.space.{key} is {leaf}; give a range, {{low: 0.1, high: 10.0, log: true}}, the lower "
        "end less than the upper and with log positive, or {choices: [a, b]}, two or more"
    )
