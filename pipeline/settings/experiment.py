"""What an experiment is made of, as frozen data: every key of `conf/`, checked when it is built.

Groups of the mission stand in `pipeline.settings.mission`, those of training in `pipeline.settings.training`.

Keys carry their units; degrees appear only in keys that end in ``_deg``. A setting that cannot be is refused
with a `SettingError`.
"""

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

from pipeline.settings import checks
from pipeline.settings.checks import SettingError
from pipeline.settings.controllers import check_controller
from pipeline.settings.mission import (
    UNGUARDED,
    Attitude,
    Chief,
    Deputy,
    Guidance,
    Mission,
    Orbit,
    Safety,
    Sensor,
    Sun,
)
from pipeline.settings.nearest import did_you_mean
from pipeline.settings.training import Encoding, Optimizer, Penalty, Starts

__all__ = [
    "SHIPPED",
    "STAGES",
    "UNGUARDED",
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
        checks.shell("monte_carlo", self.min_distance_m, self.max_distance_m)
        checks.within("monte_carlo.confidence_percent", self.confidence_percent, 50.0, 99.99, "%")
        checks.workers("monte_carlo.workers", self.workers)


@dataclass(frozen=True, kw_only=True)
class Optimum:
    """The minimum-fuel plan, made with the whole flight known."""

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
        checks.workers("optimum.workers", self.workers)


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
