"""The experiment: every key of `conf/`, checked when it is built.

Groups of the mission are in `pipeline.settings.mission`, those of training in `pipeline.settings.training`.
Keys carry their units; degrees appear only in keys that end in ``_deg``. Invalid settings raise
`SettingError`.
"""

import math
import re
from dataclasses import field
from typing import Annotated, Any, Literal

from pydantic import Field

from pipeline.settings import checks, start_table
from pipeline.settings.checks import (
    Cases,
    Count,
    Cure,
    Flag,
    Natural,
    NotNegative,
    Number,
    Positive,
    Scope,
    Seed,
    SettingError,
    Text,
    Whole,
    Workers,
)
from pipeline.settings.controllers import check_controller
from pipeline.settings.groups import settings
from pipeline.settings.mission import Mission
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
    Safety,
    Sensor,
    Sun,
    ideal,
    linear,
    perfect,
    unguarded,
)
from pipeline.settings.nearest import choices_of, did_you_mean
from pipeline.settings.space import dimensions
from pipeline.settings.training import Encoding, Optimizer, Penalty, Starts

__all__ = [
    "SHIPPED",
    "STAGES",
    "Actuators",
    "Assurance",
    "Attitude",
    "Chief",
    "Compare",
    "Deputy",
    "Dynamics",
    "Encoding",
    "Experiment",
    "Guidance",
    "Light",
    "Mission",
    "MonteCarlo",
    "Navigation",
    "Optimizer",
    "Optimum",
    "Orbit",
    "Penalty",
    "Report",
    "Safety",
    "Search",
    "Sensor",
    "SettingError",
    "Starts",
    "Sun",
    "Telemetry",
    "ideal",
    "linear",
    "perfect",
    "unguarded",
]

#: in the order in which they run: each reads the files of those before it
STAGES = ("scenario", "search", "train", "evaluate", "record", "optimum", "compare", "assure", "report")

#: the minimum-fuel plans that come with the program, as a value of ``optimum.reference``
SHIPPED = "shipped"


@settings("monte_carlo")
class MonteCarlo:
    """The evaluation: flights from starts drawn, isotropic and uniform in distance, or from a given table."""

    num_cases: Annotated[Cases, Cure("; without scenarios there is nothing to fly")]
    min_distance_m: Annotated[Positive, Field(description="from the chief, m")]
    max_distance_m: Annotated[Number, Field(description="from the chief, m")]
    confidence_percent: Annotated[
        Number, Field(ge=50, le=99.99, description="of the intervals in the summary, %")
    ]
    workers: Workers = None
    max_speed_m_s: Annotated[
        NotNegative, Field(le=100, description="of starts, in any direction, m/s; 0 for rest")
    ] = 0.0
    table: Annotated[Text | None, Field(description="starts in place of drawn ones, as CSV text")] = None

    def __post_init__(self) -> None:
        """Check that the shell's bounds ascend."""
        checks.shell("monte_carlo", self.min_distance_m, self.max_distance_m)
        num_given = self.num_cases if self.table is None else start_table.num_rows(self.table)
        if self.num_cases != num_given:
            raise SettingError(
                f"monte_carlo.num_cases is {self.num_cases}, but {num_given} starts are given; leave "
                "monte_carlo.num_cases out: all starts of a file are flown"
            )


@settings("optimum")
class Optimum:
    """Minimum-fuel plans, computed with the whole flight known in advance."""

    cases: Annotated[
        Literal["evaluation", "start"],
        Field(description="those of the evaluation, or the start that the deputy is given"),
    ]
    points: Annotated[
        Count | None, Field(description="to be inspected; None for those that make a success in each case")
    ]
    restarts: Annotated[Count, Field(description="most beginnings of the global search")]
    burns: Annotated[Whole, Field(ge=2, le=5, description="most of a search, the first at the start")]
    kicks: Annotated[
        Natural, Field(description="disturbances of the best plan in a row that better nothing, to the end")
    ]
    workers: Workers = None
    reference: Annotated[
        Text | None, Field(description="cases that evaluations are measured by: `SHIPPED`, or a run's folder")
    ]


@settings("engine")
class Engine:
    """Where the parts of a campaign run: in this process, or in several managed by Dask."""

    kind: Annotated[Literal["local", "dask"], Scope.MACHINE] = "local"
    processes: Workers = None
    scheduler: Annotated[
        Text | None,
        Scope.OUTSIDE,
        Field(description="address or file of one to join; None to start processes"),
    ] = None
    part_cases: Annotated[Count, Scope.MACHINE, Field(description="flights of a part")] = 10000


@settings("tracking")
class Tracking:
    """Where else each generation of a training is logged."""

    kind: Annotated[Literal["none", "tensorboard", "mlflow"], Scope.OUTSIDE] = "none"
    place: Annotated[Text | None, Scope.OUTSIDE, Field(description="folder or store that is written to")] = (
        None
    )

    def __post_init__(self) -> None:
        """Check that there is somewhere to write to."""
        if self.kind != "none" and self.place is None:
            raise SettingError(f"tracking.kind is {self.kind}, but tracking.place is null; give a place")


@settings("search")
class Search:
    """Settings to try, and the flights on which trials compete."""

    space: Annotated[dict[str, Any], Field(description="keys, each with {low, high, log} or {choices}")] = (
        field(default_factory=dict, hash=False)
    )
    trials: Count = 40
    num_cases: Annotated[Count, Field(description="starts, flown by no training, of a trial")] = 400
    block_cases: Annotated[Count, Field(description="of them that are flown before trials compare")] = 40
    prune_below: Annotated[
        NotNegative, Field(le=1, description="p of Wilcoxon's test below which a trial ends; 0: never")
    ] = 0.1
    trains: Annotated[Flag, Field(description="whether each trial trains its controller")] = False

    def __post_init__(self) -> None:
        """Check that every key of the space exists and has something to choose from."""
        dimensions(self.space)


@settings("compare")
class Compare:
    """Comparison of controllers: which fly, and under which conditions."""

    controllers: Annotated[tuple[Text, ...], Field(description="names as in controller=NAME, or paths")]
    suns: tuple[Text, ...]
    safety: tuple[Text, ...]
    worlds: Annotated[
        dict[str, dict[str, Any]],
        Field(description="by name, what differs from the experiment's own; none for that alone"),
    ] = field(default_factory=dict, hash=False)

    def __post_init__(self) -> None:
        """Check that the table has rows, and no row twice."""
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


@settings("assurance")
class Assurance:
    """Evidence for requirements: which, and how thoroughly they are tested."""

    requirements: Annotated[Text, Field(description="those that ship, by name, or the path of a file")]
    num_cases: Annotated[Count, Cure("; without flights nothing is shown")]
    searches: Annotated[Count, Field(description="for the worst case of a requirement")]
    search_starts: Annotated[Count, Field(description="random flights that a search begins with")]
    search_population: Annotated[Whole, Field(ge=5, description="flights in each generation of CMA-ES")]
    search_generations: Annotated[Count, Field(description="after the first flights")]
    search_step: Annotated[Positive, Field(le=1, description="first spread, as a share of what is chosen")]
    domain_cases: Annotated[
        Count, Field(description="flights that make the operational domain, and as many that try it")
    ]
    workers: Workers = None


@settings("telemetry")
class Telemetry:
    """Which flights are recorded, and the distances that the log calls near."""

    record_training: Annotated[Flag, Field(description="the flights of the training scenarios")]
    record_ranked: Annotated[Flag, Field(description="of the evaluation: the worst, the median, the best")]
    record_start: Annotated[Flag, Field(description="the flight from deputy.initial_position_m")]
    near_limit_m: Annotated[NotNegative, Field(description="nearer to a distance limit the log warns, m")]


@settings("report")
class Report:
    """Appearance of the report."""

    title: Text
    dots_per_inch: Annotated[Whole, Field(ge=20, le=1200, description="of the PNG files")]
    training_case: Annotated[Natural, Field(description="the scenario that is drawn, from 0")]


@settings("")
class Experiment:
    """Everything a run depends on.

    Attributes
    ----------
    name : str
        Names the run's folder.
    seed : int
        Of all randomness.
    stages : tuple of str
        The stages to run, in order.
    mission, sun, starts, optimizer, monte_carlo, optimum, compare, assurance, telemetry, report, engine,
    search, tracking
        The groups of the configuration.
    controller : mapping
        As plain data: a controller written out (``schema``, ``systems``, …), ``{path: ...}`` of a controller
        file, ``{kind: open_loop, path: ...}`` of a force table, ``{kind: coast}``, or one of a planning kind.
    reproducible : bool
        Whether libraries compute identically on all x86-64 processors.
    case : int, optional
        Case of the evaluation that `telemetry.record_start` flies instead of the given start.
    resume : bool
        Whether to go on from a checkpoint in the run's folder; not part of the configuration.
    """

    name: Text
    seed: Seed
    stages: tuple[Text, ...]
    mission: Mission
    sun: Sun
    starts: Starts
    optimizer: Optimizer
    monte_carlo: MonteCarlo
    optimum: Optimum
    compare: Compare
    assurance: Assurance
    telemetry: Telemetry
    report: Report
    controller: dict[str, Any] = field(hash=False)
    engine: Engine = field(default_factory=Engine)
    search: Search = field(default_factory=Search)
    tracking: Tracking = field(default_factory=Tracking)
    reproducible: Annotated[
        Flag, Field(description="whether libraries compute alike on all x86-64 processors")
    ] = False
    case: Annotated[
        Natural | None, Field(description="of the evaluation, flown by telemetry.record_start")
    ] = None
    resume: bool = False

    def __post_init__(self) -> None:
        """Check settings that must fit together."""
        if not re.fullmatch(r"[A-Za-z0-9_.-]+", self.name):
            raise SettingError(
                f"name is {self.name!r}; it names a folder: use letters, digits, '_', '-' and '.' only"
            )
        self._check_stages()
        check_controller(self.controller)
        self._check_start()
        limits = self.mission.deputy.min_distance_m, self.mission.deputy.max_distance_m
        for table in (self.starts.table, self.monte_carlo.table):
            if table is not None:
                start_table.check_within(table, f"the starts of {self.starts.path}", limits)
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

    @property
    def sun_in_words(self) -> str:
        """The Sun of the evaluation: its mode, or that the starts define it."""
        return self.sun.mode if self.monte_carlo.table is None else "of the starts"

    def _check_start(self) -> None:
        if self.case is not None:
            self._check_case(self.case)
            return
        if "record" not in self.stages or not self.telemetry.record_start:
            return
        deputy = self.mission.deputy
        distance = math.hypot(*deputy.initial_position_m)
        # a billionth outside is rounding: a start on a limit, which is inside, may be written by its axes
        if not deputy.min_distance_m * (1 - 1e-9) <= distance <= deputy.max_distance_m * (1 + 1e-9):
            raise SettingError(
                f"deputy.initial_position_m is {distance:.6g} m from the chief, outside the limits of the "
                f"flight; it must be from deputy.min_distance_m={deputy.min_distance_m:g} to "
                f"deputy.max_distance_m={deputy.max_distance_m:g} (m): move the start, or a limit"
            )

    def _check_case(self, case: int) -> None:
        table = self.monte_carlo.table
        if table is not None and not case < self.monte_carlo.num_cases:
            raise SettingError(
                f"case is {case}, but there are {self.monte_carlo.num_cases} starts; choose one from 0 to "
                f"{self.monte_carlo.num_cases - 1}"
            )

    def _check_stages(self) -> None:
        if not self.stages:
            raise SettingError(f"stages is empty; name at least one of {', '.join(STAGES)}")
        for stage in self.stages:
            if stage not in STAGES:
                raise SettingError(f"stages has {stage!r}{choices_of(stage, STAGES, 'stages')}")
        if list(self.stages) != sorted(set(self.stages), key=STAGES.index):
            raise SettingError(
                f"stages is [{', '.join(self.stages)}]; each reads what those before it wrote, so name each "
                f"once in the order {', '.join(STAGES)}"
            )
        if "search" in self.stages and not self.search.space:
            raise SettingError(
                "stages has search, and search.space is empty; say what may be chosen, as in "
                "'+search.space.optimizer.initial_step={low: 0.01, high: 0.3, log: true}'"
            )
        if "train" in self.stages and self.mission.dispersions:
            raise SettingError(
                "stages has train, and dispersions are given, which training does not fly; train without "
                "them, and evaluate with them"
            )
        if "train" in self.stages and "systems" not in self.controller and "kind" in self.controller:
            raise SettingError(
                f"stages has train, but a controller of kind {self.controller['kind']} has nothing to train; "
                "drop the stage or choose a fuzzy controller"
            )
