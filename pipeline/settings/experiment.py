"""The experiment: every key of `conf/`, checked when it is built.

Groups of the mission are in `pipeline.settings.mission`, those of training in `pipeline.settings.training`.
Keys carry their units; degrees appear only in keys that end in ``_deg``. Invalid settings raise
`SettingError`.
"""

import math
from dataclasses import field
from typing import Annotated, Any, Literal

from pydantic import Field

from pipeline.settings import checks, plugged, sizes, start_table, types
from pipeline.settings.checks import SettingError, no_choice
from pipeline.settings.conditions import Only
from pipeline.settings.controllers import check_controller
from pipeline.settings.groups import Settings
from pipeline.settings.keys import choices_of
from pipeline.settings.mission import Mission, Safety, Sun
from pipeline.settings.monte_carlo import MonteCarlo
from pipeline.settings.stages import OF_FLEETS, STAGES, check_stage_names
from pipeline.settings.training import Optimizer, Starts, StartsOfFile, dimensions

#: names of other modules that are imported from here
__all__ = ["Experiment", "Mission", "Optimizer", "Safety", "SettingError", "Sun"]

#: the minimum-fuel plans that come with the program, as a value of ``optimum.reference``
SHIPPED = "shipped"


class Optimum(
    Settings, group="optimum", only=Only("stages=optimum", "stages=evaluate", "stages=compare", is_told=True)
):
    """Minimum-fuel plans, computed with the whole flight known in advance."""

    cases: Literal["evaluation", "start"] = "evaluation"
    """What is solved: the cases of the evaluation, or the start that the deputy is given."""
    points: types.Count | None = None
    """Points to be inspected; null: those that make a success in each case."""
    restarts: types.Count = 24
    """Most beginnings of the global search; it ends when three find the same."""
    burns: Annotated[types.Whole, Field(ge=2, le=5)] = 3
    """Most burns of the global search, the first at the start."""
    kicks: types.Natural = 12
    """Disturbances of the best plan in a row that better nothing, to the end."""
    workers: types.Workers = None
    """Threads that solve cases; null: one a processor."""
    reference: types.Text | None = SHIPPED
    """Cases that evaluations are measured by: `shipped`, a run's folder, or null."""


class Prove(Settings, group="prove", only=Only("stages=prove")):
    """A proof that all starts of monte_carlo.box reach the goal within the speed limit."""

    cells: Annotated[types.Whole, Field(ge=8, le=1000)] = 96
    """Cells into which the range of a position is divided; more make a tighter tube, and take longer."""


class Engine(Settings, group="engine"):
    """Where flights and plans are computed, and how a campaign is cut into parts."""

    kind: Annotated[Literal["local", "dask"], types.Freely()] = "local"
    """This process, or Dask's workers: of this machine, or of the scheduler that Dask's settings name."""
    part_cases: Annotated[types.Count, types.Freely()] = 10000
    """Flights of a part, which are kept as a file once they are flown."""


class Logger(Settings, group="logger", only=Only("stages=train", is_told=True)):
    """Where each generation of a training is logged besides its logbook."""

    kind: Annotated[types.Text, types.Freely()] = "none"
    """Nowhere else; tensorboard: in train/tensorboard; or a logger of your own, which a package offers."""

    def __post_init__(self) -> None:
        """Check that there is such a logger."""
        if self.kind not in plugged.SHIPPED_LOGGERS and self.kind not in plugged.loggers():
            raise SettingError(f"logger.kind is {no_choice(self.kind, plugged.loggers())}")

    @property
    def is_own(self) -> bool:
        """Whether an installed package offers it."""
        return self.kind not in plugged.SHIPPED_LOGGERS


class HparamsSearch(Settings, group="hparams_search", only=Only("stages=search", is_told=True)):
    """Settings that Optuna tries, and the flights on which trials compete."""

    space: dict[str, Any] = field(default_factory=dict, hash=False)
    """Keys, each with {low: 0.1, high: 10.0, log: true} or {choices: [a, b]}."""
    trials: types.Count = 40
    """How many are tried."""
    num_cases: types.Count = 400
    """Starts of a trial, flown by no training."""
    block_cases: types.Count = 40
    """Of them, those flown before a trial is compared with the best."""
    prune_below: Annotated[types.NotNegative, Field(le=1)] = 0.1
    """The p of Wilcoxon's test below which a trial ends; 0: never."""
    trains: types.Flag = False
    """Whether each trial trains its controller, or flies the configured one."""

    def __post_init__(self) -> None:
        """Check that every key of the space exists and has something to choose from."""
        dimensions(self.space)


class FitSettings(Settings, group="fit", only=Only("stages=fit", is_told=True)):
    """A controller from champions that are scaled to the mission; see `pipeline.evaluation.fitting`."""

    bases: types.Texts = ("champion_27", "champion_81", "champion_leo", "champion_any_sun")
    """Champions that compete, as shipped and scaled; names as in controller=NAME, or paths."""
    planners: types.Texts = ("champion_27_rehearsed",)
    """Champions that plan, which compete where the goal is missed; names as in controller=NAME, or paths."""
    draws: types.Count = 18
    """Sizes and tempos that each is scaled to."""
    neighbours: types.Natural = 20
    """Further ones near the best, where that misses the goal."""
    cases: tuple[types.Count, ...] = (12, 40, 150)
    """Flights of each competitor in the first round, the second, and so on."""
    kept: tuple[types.Count, ...] = (16, 4)
    """Competitors that stay after each round but the last."""
    num_cases: types.Count = 300
    """Starts that no competitor has flown, on which the result is judged; plans may fly from fewer."""
    goal_percent: Annotated[types.Number, Field(ge=0, le=100)] = 95.0
    """Lower bound of the success aimed at; where it is missed, the safety layer and tuning are tried."""
    tunes: Literal["needed", "always", "never"] = "needed"
    """Whether the best is tuned by the optimizer: where it misses the goal, always, or never."""
    workers: types.Workers = None
    """Threads that fly; null: one a processor."""

    def __post_init__(self) -> None:
        """Check that there is a base, and a number of competitors kept after each round but the last."""
        checks.each_once("fit.bases", self.bases)
        if len(self.cases) != len(self.kept) + 1:
            raise SettingError(
                f"fit.cases has {len(self.cases)} numbers and fit.kept {len(self.kept)}; the second must "
                "have one less than the first: after the last round the best is left"
            )


class Compare(Settings, group="compare", only=Only("stages=compare", is_told=True)):
    """Comparison of controllers: which fly, and under which conditions."""

    controllers: types.Texts = ("coast", "natural_motion", "lqr", "receding_horizon", "paper_champion")
    """Names as in controller=NAME, or paths of controllers and tables."""
    suns: tuple[Literal["fixed", "random", "mixed"], ...] = ("fixed", "random")
    """Sun settings under which each flies: fixed, random, mixed."""
    safety: tuple[Literal["none", "filter"], ...] = ("none", "filter")
    """Safety layers under which each flies: none, filter."""
    worlds: dict[str, dict[str, Any]] = field(default_factory=dict, hash=False)
    """By name, what differs from the experiment's own, or the name of a world."""

    def __post_init__(self) -> None:
        """Check that the table has rows, and no row twice."""
        for name in ("controllers", "suns", "safety"):
            checks.each_once(f"compare.{name}", getattr(self, name))


class Assurance(Settings, group="assurance", only=Only("stages=assure", is_told=True)):
    """Evidence for requirements: which, and how thoroughly they are tested."""

    requirements: types.Text = "inspection"
    """Those that ship, by name, or the path of a file."""
    num_cases: types.Count = 10000
    """Flights on which claims are judged."""
    stop_width: types.Positive | None = None
    """Width of the intervals of the shares that meet claims at which flights end; null: all are flown."""
    searches: types.Count = 24
    """Searches for the worst case of each requirement."""
    search_starts: types.Count = 32
    """Random flights that a search begins with."""
    search_population: Annotated[types.Whole, Field(ge=5)] = 16
    """Flights in each generation of a search (CMA-ES)."""
    search_generations: types.Count = 20
    """Generations after the first flights."""
    search_step: Annotated[types.Positive, Field(le=1)] = 0.1
    """First step of a search, as a share of the range of what it varies."""
    splitting_flights: Annotated[types.Whole, Field(ge=1000, le=sizes.MOST)] = 100_000
    """Flights with which splitting tells how rare the failures of a requirement are."""
    domain_cases: types.Count = 200
    """Flights that make the operational domain, and as many others that test it."""
    workers: types.Workers = None
    """Threads that fly; null: one a processor."""


class Telemetry(
    Settings, group="telemetry", only=Only("stages=record", "stages=assure", "stages=scenario", is_told=True)
):
    """Which flights are recorded, and the distances that the log calls near."""

    record_training: types.Flag = True
    """The flights of the training scenarios."""
    record_ranked: types.Flag = True
    """Of the evaluation: the worst, the median and the best flight."""
    record_start: types.Flag = False
    """The flight from deputy.initial_position_m, or of a case of the evaluation."""
    near_limit_m: types.NotNegative = 5.0
    """The log warns when a distance limit is nearer."""


class Report(Settings, group="report", only=Only("stages=report", is_told=True)):
    """Appearance of the report."""

    title: types.Text = "Spacecraft inspection by fuzzy control"
    """Heading of the page."""
    dots_per_inch: Annotated[types.Whole, Field(ge=20, le=1200)] = 150
    """Of the PNG files."""
    training_case: types.Natural = 0
    """The training scenario that is drawn, from 0."""


class Experiment(Settings, group=""):
    """Everything a run depends on.

    Attributes
    ----------
    name : str
        Names the run's folder.
    seed : int
        Of all randomness.
    stages : tuple of str
        The stages to run, in order.
    mission, sun, starts, optimizer, monte_carlo, optimum, fit, compare, assurance, telemetry, report, engine,
    hparams_search, logger
        The groups of the configuration.
    controller : mapping
        As plain data: a controller written out (``schema``, ``systems``, …), ``{path: ...}`` of a controller
        file, ``{kind: open_loop, path: ...}`` of a force table, ``{kind: coast}``, or one of a planning kind.
    tags : mapping of str to str
        What is noted about the run.
    extensions : mapping
        Plain data for stages that installed packages offer, by the stage's name.
    reproducible : bool
        Whether libraries compute identically on all x86-64 processors.
    case : int, optional
        Case of the evaluation that `telemetry.record_start` flies instead of the given start.
    resume : bool
        Whether to go on from a checkpoint in the run's folder; not part of the configuration.
    """

    name: Annotated[types.Text, Field(pattern=r"^[A-Za-z0-9_.-]+$")] = "pipeline"
    """Names the run's folder: letters, digits, _ - and . only."""
    seed: types.Seed = 1
    """Seed of everything random."""
    stages: Annotated[
        types.Texts,
        Field(description=f"What is done, in this order: {', '.join(STAGES)}; your own anywhere among them."),
    ]
    mission: Mission = field(default_factory=Mission)
    sun: Sun = field(default_factory=Sun)
    starts: Starts = field(default_factory=Starts)
    optimizer: Optimizer = field(default_factory=Optimizer)
    monte_carlo: MonteCarlo = field(default_factory=MonteCarlo)
    optimum: Optimum = field(default_factory=Optimum)
    prove: Prove = field(default_factory=Prove)
    fit: FitSettings = field(default_factory=FitSettings)
    compare: Compare = field(default_factory=Compare)
    assurance: Assurance = field(default_factory=Assurance)
    telemetry: Telemetry = field(default_factory=Telemetry)
    report: Report = field(default_factory=Report)
    controller: dict[str, Any] = field(hash=False)
    """A controller written out, a file, or one of another kind."""
    engine: Engine = field(default_factory=Engine)
    hparams_search: HparamsSearch = field(default_factory=HparamsSearch)
    logger: Logger = field(default_factory=Logger)
    reproducible: types.Flag = False
    """Whether libraries compute alike on all x86-64 processors."""
    case: Annotated[types.Natural | None, Only("telemetry.record_start=true")] = None
    """Case of the evaluation that telemetry.record_start flies; null: the given start."""
    tags: types.Tags = field(default_factory=dict, hash=False)
    """What you note about a run, a text by name; it stands beside its results, and nothing depends on it."""
    extensions: dict[str, Any] = field(default_factory=dict, hash=False)
    """Settings of stages of your own, by the stage's name."""
    resume: bool = False

    def __post_init__(self) -> None:
        """Check settings that must fit together."""
        self._check_fleets_and_starts()
        self._check_stages()
        check_controller(self.controller)
        self._check_start()
        path = self.starts.path if isinstance(self.starts, StartsOfFile) else None
        for table in filter(None, (self.starts.rows, self.monte_carlo.table)):
            for what, distance in start_table.distances(table, f"the starts of {path}"):
                self._check_distance(what, distance)
        for group, shell in (("starts", self.starts), ("monte_carlo", self.monte_carlo)):
            for key in ("min_distance_m", "max_distance_m"):
                value = getattr(shell, key)
                self._check_distance(f"{group}.{key} is {value}", value)
            reach = max((math.hypot(*row[:3]) + row[3] for row in self.mission.chief.keep_out_m), default=0.0)
            if not reach < shell.min_distance_m:
                raise SettingError(
                    f"chief.keep_out_m reaches {reach:g} m from the chief's centre, and {group}."
                    f"min_distance_m is {shell.min_distance_m:g}; the second must be greater, or flights "
                    "start inside (m)"
                )
        if self.report.training_case >= self.starts.num_cases:
            raise SettingError(
                f"report.training_case is {self.report.training_case}, but there are {self.starts.num_cases} "
                f"training scenarios; choose one from 0 to {self.starts.num_cases - 1}"
            )

    @property
    def own_stages(self) -> tuple[str, ...]:
        """The stages that installed packages offer."""
        return tuple(stage for stage in self.stages if stage not in STAGES)

    @property
    def sun_in_words(self) -> str:
        """The Sun of the evaluation: its mode, or that the starts define it."""
        return self.sun.mode if self.monte_carlo.table is None else "of the starts"

    def _check_fleets_and_starts(self) -> None:
        """Raise SettingError for fleets, and their starts, where a run does not know them."""
        cases, deputies = self.monte_carlo, self.mission.fleet.deputies
        unaware = ", ".join(stage for stage in self.stages if stage not in OF_FLEETS)
        for words, is_set, cure in (
            (f"the stages {unaware} know", bool(unaware), f"choose stages=[{','.join(OF_FLEETS)}]"),
            (
                f"starts.kind={self.starts.kind} knows",
                "train" in self.stages and self.starts.kind == "octants",
                "choose starts=random",
            ),
            (
                "telemetry.record_start without a case knows",
                self.telemetry.record_start and self.case is None and "record" in self.stages,
                "give case=0, for example",
            ),
            ("monte_carlo.splitting_flights knows", cases.splitting_flights > 0, "leave it out"),
        ):
            if self.mission.has_fleet and is_set:
                raise SettingError(
                    f"fleet.deputies is {deputies}, and {words} of one deputy; {cure}, or leave "
                    "fleet.deputies out"
                )
        for table in filter(None, {self.starts.rows, cases.table}):
            if (given := start_table.num_deputies(table)) != deputies:
                raise SettingError(
                    f"fleet.deputies is {deputies}, and the starts are of {given} each case; give starts of "
                    "as many, with a column deputy, or change fleet.deputies"
                )

    def _check_distance(self, what: str, distance_m: float) -> None:
        """Raise SettingError if a start is outside the limits of the flight, or inside the chief."""
        deputy, chief = self.mission.deputy, self.mission.chief
        low, high = deputy.min_distance_m, deputy.max_distance_m
        # a billionth outside is rounding: a start on a limit, which is inside, may be written by its axes
        if not low * (1 - 1e-9) <= distance_m <= high * (1 + 1e-9):
            raise SettingError(
                f"{what}, outside the limits of the flight; it must be from deputy.min_distance_m={low:g} to "
                f"deputy.max_distance_m={high:g} (m): move the start, or a limit"
            )
        radius_m = chief.inspection_radius_m
        is_sphere = self.mission.problem.kind == "inspection" and chief.shape == "sphere"
        if is_sphere and not distance_m > radius_m:
            raise SettingError(
                f"{what}, and chief.inspection_radius_m is {radius_m:g}; the first must be greater, for a "
                "flight starts outside the chief (m)"
            )

    def _check_start(self) -> None:
        count = self.monte_carlo.num_cases
        if self.case is None and "record" in self.stages and self.telemetry.record_start:
            distance = math.hypot(*self.mission.deputy.initial_position_m)
            self._check_distance(f"deputy.initial_position_m is {distance:.6g} m from the chief", distance)
        elif self.case is not None and self.monte_carlo.table is not None and self.case >= count:
            raise SettingError(f"case is {self.case}, but there are {count} starts; choose 0 to {count - 1}")

    def _check_stages(self) -> None:
        if not self.stages:
            raise SettingError(f"stages is empty; name at least one of {', '.join(STAGES)}")
        check_stage_names(self.stages)
        shipped = [stage for stage in self.stages if stage in STAGES]
        if shipped != sorted(set(shipped), key=STAGES.index) or len(set(self.stages)) < len(self.stages):
            anywhere = "; your own may stand anywhere" if self.own_stages else ""
            raise SettingError(
                f"stages is [{', '.join(self.stages)}]; each reads what those before it wrote, so name each "
                f"once in the order {', '.join(STAGES)}{anywhere}"
            )
        for name in self.extensions:
            if name not in (offered := plugged.names(plugged.STAGES)):
                known = choices_of(name, offered, "stages of your own") if offered else "; none is installed"
                raise SettingError(f"extensions.{name} is of no stage of your own{known}")
        flown = {"scenario", "evaluate", "record", "report"}
        if self.mission.flight == "reference" and not flown.issuperset(shipped):
            raise SettingError(
                f"flight is reference and stages [{', '.join(self.stages)}]; the reference takes seconds a "
                f"flight and flies for {', '.join(sorted(flown))} alone: leave flight=reference out"
            )
        if self.monte_carlo.only_cases is not None and not flown.issuperset(self.stages):
            raise SettingError(
                f"monte_carlo.only_cases is given and stages [{', '.join(self.stages)}]; a shard has "
                f"{', '.join(sorted(flown))} alone: leave one of them out"
            )
        if self.monte_carlo.splitting_flights and self.mission.chief.keep_out_m:
            raise SettingError(
                "monte_carlo.splitting_flights and chief.keep_out_m are given; flights do not tell how near "
                "they came to the spheres, which splitting must know: leave one out"
            )
        if "search" in self.stages and not self.hparams_search.space:
            raise SettingError(
                "stages has search, and hparams_search.space is empty; say what may be chosen, as in "
                "'+hparams_search.space.optimizer.initial_step={low: 0.01, high: 0.3, log: true}'"
            )
        if "fit" in self.stages and self.mission.problem.kind != "inspection":
            raise SettingError(
                f"stages has fit and problem.kind is {self.mission.problem.kind}; the champions that are "
                "scaled inspect: train one, or drop the stage"
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
