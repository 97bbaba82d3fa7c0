"""How a controller is trained: starts, what is tuned, prices, and the search."""

import math
from dataclasses import replace
from typing import Annotated, Literal

from pydantic import Field

from pipeline.settings import checks, start_table
from pipeline.settings.checks import (
    Count,
    Cure,
    Flag,
    Interval,
    Natural,
    NotNegative,
    NotNegativeInterval,
    Number,
    Positive,
    PositiveInterval,
    SettingError,
    Share,
    Text,
    Whole,
    Workers,
)
from pipeline.settings.groups import settings

#: of a population, or a tournament
MOST_INDIVIDUALS = 100_000
#: largest prices, m/s
MOST_PRICE = 1e15


@settings("starts")
class Starts:
    """Starts of training flights: at rest on the octants' diagonals, drawn in a shell, or from a table."""

    kind: Literal["octants", "random", "file"]
    num_cases: Annotated[Count, Cure("; without scenarios nothing can be trained")]
    min_distance_m: Annotated[Positive, Field(description="from the chief, m; equal for the octants")]
    max_distance_m: Annotated[Number, Field(description="from the chief, m")]
    redraw: Annotated[Flag, Field(description="whether each round of training draws its own")]
    num_hard: Annotated[
        Natural,
        Field(description="more starts, from the second round on: of hard_from, the champion's worst"),
    ]
    hard_from: Natural
    max_speed_m_s: Annotated[
        NotNegative, Field(le=100, description="of starts that are drawn, in any direction, m/s; 0 for rest")
    ] = 0.0
    path: Annotated[Text | None, Field(description="of the CSV file that the table came from")] = None
    table: Annotated[Text | None, Field(description="the rows of that file, as CSV text")] = None

    def __post_init__(self) -> None:
        """Check the shell's bounds, that the hard starts are a subset, and that there are eight octants."""
        checks.shell("starts", self.min_distance_m, self.max_distance_m)
        if self.num_hard > self.hard_from:
            raise SettingError(
                f"starts.num_hard is {self.num_hard} and starts.hard_from {self.hard_from}; the hard starts "
                "are the worst of so many, which must be more"
            )
        if (self.kind == "file") != (self.table is not None):
            given = "null" if self.table is None else "given"
            raise SettingError(
                f"starts.kind is {self.kind} and starts.table is {given}; choose a file by starts=PATH.csv"
            )
        num_given = self.num_cases if self.table is None else start_table.num_rows(self.table)
        if self.num_cases != num_given:
            raise SettingError(
                f"starts.num_cases is {self.num_cases}, but the file has {num_given} training starts; leave "
                "starts.num_cases out"
            )
        if self.kind == "octants" and (self.num_cases != 8 or self.min_distance_m != self.max_distance_m):
            raise SettingError(
                f"starts.kind is octants with {self.num_cases} cases from {self.min_distance_m} to "
                f"{self.max_distance_m} m; octants are eight starts at one distance: set "
                "starts.num_cases=8 and equal distances, or choose starts=random"
            )


@settings("optimizer.encoding")
class Encoding:
    """Range of the genes; a constant with bounds is tuned, None keeps the controller's."""

    mean_window: Annotated[
        Positive, Field(le=0.99, description="of an inner mean, in spacings of evenly spaced terms")
    ]
    standard_deviation_fraction: Annotated[
        PositiveInterval, Field(description="bounds, in widths of a variable's range")
    ]
    output_range_n: Annotated[PositiveInterval, Field(description="bounds of the output's half-width, N")]
    rules: Annotated[
        Literal["free", "planes", "fixed"],
        Field(description="a gene for the term of each rule; rule tables as planes; or rules kept"),
    ]
    stretch: Annotated[
        PositiveInterval | None,
        Field(description="of ranges with all their terms, in place of means and widths, as factors"),
    ]
    digits: Annotated[
        Whole | None,
        Field(ge=1, le=17, description="significant, of stretched ranges and of constants"),
        Cure(", or null for all"),
    ]
    ring_size_m: NotNegativeInterval | None
    ring_lead_rad: Interval | None
    dead_band_n: NotNegativeInterval | None
    prediction_time_s: NotNegativeInterval | None
    coast_below_points: NotNegativeInterval | None
    coast_margin_m: NotNegativeInterval | None
    urgency_time_s: NotNegativeInterval | None
    skirt_distance_m: NotNegativeInterval | None
    see_horizon_s: NotNegativeInterval | None
    see_damping_ks2: PositiveInterval | None
    aim_urgent_m_s: NotNegativeInterval | None
    tour_time_s: PositiveInterval | None = None
    tour_wait_s: NotNegativeInterval | None = None
    tour_lean_m: NotNegativeInterval | None = None
    tour_m: Annotated[
        Interval | None, Field(description="of each mean and wave of the tour that the controller sets")
    ] = None

    def __post_init__(self) -> None:
        """Check bounds that must stay in a range, and that stretched systems have genes."""
        if self.stretch is not None and self.rules == "free":
            raise SettingError(
                "optimizer.encoding.stretch is given and optimizer.encoding.rules is free; ranges stretch "
                "with rules=planes or rules=fixed: choose one of them, or set stretch=null"
            )
        for place, value in enumerate(self.standard_deviation_fraction):
            checks.within(f"optimizer.encoding.standard_deviation_fraction[{place}]", value, 0.0, 1.0)
        if self.urgency_time_s is not None:
            checks.within("optimizer.encoding.urgency_time_s[0]", self.urgency_time_s[0], 1.0, math.inf, "s")


@settings("optimizer.penalty")
class Penalty:
    """Prices in the fitness besides delta-v; see `pipeline.training.fitness`."""

    outside_m_s: Annotated[NotNegative, Field(description="outside the limits, and again for each metre")]
    outside_most_m: Annotated[
        NotNegative | None, Field(description="metres outside that are paid for at most; None: all")
    ]
    short_point_m_s: Annotated[NotNegative, Field(description="for each point short of a success")]
    missed_point_m_s: Annotated[NotNegative, Field(description="for each point that is not inspected")]
    growth: Annotated[
        Number, Field(ge=1, le=10, description="of the prices of points from one round to the next")
    ]
    near_margin_m: Annotated[
        NotNegative,
        Field(description="by which training draws the least distance in, m"),
    ]
    far_margin_m: Annotated[NotNegative, Field(description="by which it draws the greatest distance in, m")]

    def of_round(self, round_index: int) -> "Penalty":
        """Return the prices of a round, counted from 0."""
        factor = self.growth**round_index
        return replace(
            self,
            short_point_m_s=factor * self.short_point_m_s,
            missed_point_m_s=factor * self.missed_point_m_s,
        )


@settings("optimizer")
class Optimizer:
    """The evolutionary algorithm."""

    population_size: Annotated[Whole, Field(ge=2, le=MOST_INDIVIDUALS)]
    generations: Annotated[Count, Field(description="after the first population, in each round")]
    tournament_size: Annotated[Count, Field(le=MOST_INDIVIDUALS)]
    crossover_rate: Annotated[
        Share, Field(description="of the `whole` population or the `rest` without elite")
    ]
    elitism_rate: Annotated[Number, Field(ge=0, le=0.9)]
    split: Literal["whole", "rest"]
    stall_generations: Annotated[
        Whole | None,
        Field(ge=1, le=checks.MOST, description="without improvement, after which a round ends"),
        Cure(", or null for none"),
    ]
    rounds: Count
    encoding: Encoding
    penalty: Penalty
    workers: Workers = None
    algorithm: Literal["genetic", "cma_es", "nsga2"]
    mutation: Annotated[
        Literal["adaptive_feasible", "local"], Field(description="MATLAB's, or few genes by small steps")
    ]
    first_population: Annotated[
        Literal["random", "near"], Field(description="besides the controller: drawn, or its local mutants")
    ]
    next_round: Annotated[
        Literal["afresh", "carried"],
        Field(description="whether a later round begins with a new population or the one it finds"),
    ]
    initial_step: Annotated[
        Number,
        Field(ge=1e-6, le=1, description="spread of local mutation and of CMA-ES, in genes"),
    ]
    cooling: Annotated[
        Number, Field(ge=0.1, le=1, description="of the steps of local mutation from round to round")
    ]
    validation_cases: Annotated[
        Natural, Field(description="starts on which the best of the rounds' champions is chosen; 0: the last")
    ]
    islands: Annotated[Count, Field(description="populations that share the individuals; 1: no islands")] = 1
    migrate_every: Annotated[Count, Field(description="generations between two migrations")] = 10
    migrants: Annotated[Natural, Field(description="of each island to the next; 0 keeps them apart")] = 2
    consistency: Annotated[Flag, Field(description="whether rule consistency is an objective of a front")] = (
        False
    )

    def __post_init__(self) -> None:
        """Check that rates leave room for one another and the population suits the algorithm."""
        least = {"cma_es": 5, "nsga2": 4}.get(self.algorithm, 2)
        checks.within("optimizer.population_size", self.population_size, least, math.inf)
        if self.islands > 1:
            self._check_islands()
        if self.algorithm == "nsga2":
            self._check_front()
        elif self.consistency:
            raise SettingError(
                f"optimizer.consistency is true and optimizer.algorithm {self.algorithm}, which has one "
                "objective; choose optimizer.algorithm=nsga2, or leave it false"
            )
        prices = self.penalty.short_point_m_s, self.penalty.missed_point_m_s
        digits = (self.rounds - 1) * math.log10(self.penalty.growth) + math.log10(max(*prices, 1.0))
        if digits > math.log10(MOST_PRICE):
            raise SettingError(
                f"optimizer.penalty.growth is {self.penalty.growth:g} and optimizer.rounds {self.rounds}, by "
                f"which prices grow to 1e{digits:.0f} m/s; they may grow to {MOST_PRICE:g}: lower one of them"
            )
        if self.split == "whole" and self.crossover_rate + self.elitism_rate > 1.0 + 1e-9:
            raise SettingError(
                f"optimizer.crossover_rate is {self.crossover_rate} and optimizer.elitism_rate "
                f"{self.elitism_rate}, together more than the whole population; lower one of them, or choose "
                "optimizer.split=rest"
            )

    def _check_islands(self) -> None:
        """Check that islands have equal populations, large enough to breed, and room for migrants."""
        if self.algorithm != "genetic":
            raise SettingError(
                f"optimizer.algorithm is {self.algorithm} and optimizer.islands {self.islands}; islands "
                "evolve by the genetic algorithm: set optimizer.algorithm=genetic, or optimizer.islands=1"
            )
        share, left = divmod(self.population_size, self.islands)
        if left or share < 2:
            raise SettingError(
                f"optimizer.population_size is {self.population_size} and optimizer.islands {self.islands}, "
                f"which share it equally, two or more each; choose a multiple of {self.islands}, at least "
                f"{2 * self.islands}"
            )
        if self.migrants > share // 2:
            raise SettingError(
                f"optimizer.migrants is {self.migrants}, but an island has {share} individuals, of which at "
                f"most half are replaced; lower it to {share // 2} or less"
            )

    def _check_front(self) -> None:
        """Check that there are starts to evaluate a front on, and steps that suit several objectives."""
        if self.validation_cases < 1:
            raise SettingError(
                f"optimizer.validation_cases is {self.validation_cases}; it must be a whole number of at "
                "least 1; a front is judged on them"
            )
        if self.mutation != "local":
            raise SettingError(
                f"optimizer.mutation is {self.mutation}, which follows a single fitness; with "
                "optimizer.algorithm=nsga2 it must be local"
            )

    def step_of_round(self, round_index: int) -> float:
        """Return the step with which a round begins, counted from 0, in genes."""
        return 1.0 if self.mutation == "adaptive_feasible" else self.initial_step * self.cooling**round_index
