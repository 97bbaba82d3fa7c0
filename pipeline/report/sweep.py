"""The results of a sweep: which setting is better, by how much, how sure; and how to fly the best."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pipeline.evaluation import statistics
from pipeline.evaluation.comparison import percent_ahead
from pipeline.evaluation.evaluated import read_flights
from pipeline.evaluation.monte_carlo import SUCCESS
from pipeline.evaluation.paired_runs import (
    METRICS,
    REPLICATE,
    Effect,
    Metric,
    common_cases,
    effects,
    on_front,
)
from pipeline.evaluation.statistics import Statistic, fraction, statistic
from pipeline.report.contents import read_summary
from pipeline.run import artifacts, configuration, manifests, sweep, typed
from pipeline.settings.experiment import Mission
from pipeline.settings.groups import names_of
from pipeline.settings.keys import FREE, TAGS

Columns = dict[str, list[Any] | NDArray[Any]]

#: stages that make another controller for each seed; without them a seed only draws cases
MAKING = {"train", "search"}
#: metrics that are shares of flights, and what summaries call them
SHARES = {"success": SUCCESS, "violated": "violated"}
#: of intervals, where the runs do not say
CONFIDENCE_PERCENT = 95.0
#: the controllers that a run made or kept
KEPT = (artifacts.CHAMPION, artifacts.CONTROLLER)
#: the state of a run of which a file cannot be read
UNREADABLE = "unreadable"
#: of the settings on the front, how many are offered to be flown
MOST_OFFERED = 5


class Estimate(NamedTuple):
    """A metric of flights with its interval; NaN at both ends where there is none."""

    value: float
    low: float
    high: float

    def in_words(self, metric: Metric) -> str:
        """Return the value with its interval."""
        value, low, high = (f"{number:.{metric.decimals}f}" for number in self)
        return value if math.isnan(self.low) else f"{value} ({low} to {high})"


Estimates = Mapping[str, Estimate]


@dataclass(frozen=True, kw_only=True)
class RunResult(sweep.SweptRun):
    """A run of a sweep, with its results.

    Parameters
    ----------
    state : str
        Of `pipeline.run.sweep`, or `UNREADABLE`.
    num_cases : int
        Zero where nothing was evaluated.
    estimates : mapping of str to Estimate
        By the name of a metric; empty where nothing was evaluated.
    fly : str
        The command that flies a case of it again; empty where nothing was evaluated.
    flown : str
        A hash of its controller and world; empty where nothing was evaluated.
    percent_ahead : float
        Share of its fuel that was chosen ahead; NaN where nothing was evaluated.
    tags : mapping of str to str
        What its user noted about it.
    """

    state: str
    num_cases: int = 0
    estimates: Estimates = field(default_factory=dict)
    fly: str = ""
    flown: str = ""
    percent_ahead: float = np.nan
    tags: Mapping[str, str] = field(default_factory=dict)

    @property
    def setting(self) -> dict[str, str]:
        """The settings in which the run differs from others, without the seed."""
        return {key: value for key, value in self.differs.items() if key != REPLICATE}


@dataclass(frozen=True)
class SettingResult:
    """The evaluated runs of one setting, which differ in their seeds alone.

    Parameters
    ----------
    setting : mapping of str to str
    runs : tuple of RunResult
    num_cases : int
    estimates : mapping of str to Estimate
        Over all cases where seeds only draw these; else over the runs.
    """

    setting: Mapping[str, str]
    runs: tuple[RunResult, ...]
    num_cases: int
    estimates: Estimates

    @property
    def name(self) -> str:
        """Its keys and values; of a sweep over seeds alone, what its runs are."""
        return ", ".join(f"{key}={value}" for key, value in self.setting.items()) or "all runs"

    @property
    def best(self) -> RunResult:
        """The most successful run, the first of equals."""
        return max(self.runs, key=lambda run: run.estimates["success"].value)

    @property
    def percent_ahead(self) -> float:
        """Share of the fuel of all its flights that was chosen ahead."""
        spent = [run.num_cases * run.estimates["delta_v_m_s"].value for run in self.runs]
        ahead = sum(fuel * run.percent_ahead for fuel, run in zip(spent, self.runs, strict=True))
        return ahead / sum(spent) if ahead > 0.0 else 0.0


@dataclass(frozen=True)
class SweepResults:
    """A sweep with its results.

    Parameters
    ----------
    folder : Path
    runs : tuple of RunResult
    settings : tuple of SettingResult
    effects : tuple of Effect
    confidence_percent : float
    pools_seeds : bool
        Whether seeds only draw cases.
    """

    folder: Path
    runs: tuple[RunResult, ...]
    settings: tuple[SettingResult, ...]
    effects: tuple[Effect, ...]
    confidence_percent: float
    pools_seeds: bool = True

    @property
    def factors(self) -> list[str]:
        """The keys in which the runs differ, the seed included."""
        return list(dict.fromkeys(key for run in self.runs for key in run.differs))

    @property
    def tags(self) -> dict[str, str]:
        """The names of what is noted about runs, by keys, without those that the sweep is over."""
        names = dict.fromkeys(name for run in self.runs for name in run.tags)
        return {f"{TAGS}.{name}": name for name in names if f"{TAGS}.{name}" not in self.factors}

    @property
    def evaluated(self) -> list[RunResult]:
        """The runs that were evaluated."""
        return [run for run in self.runs if run.estimates]

    @property
    def chooses_ahead(self) -> bool:
        """Whether a run chose any push ahead."""
        return any(run.percent_ahead > 0.0 for run in self.runs)

    @property
    def failed(self) -> list[RunResult]:
        """The runs that failed."""
        return [run for run in self.runs if run.failure and run.state != UNREADABLE]

    @property
    def left_out(self) -> list[RunResult]:
        """The runs of which a file cannot be read; their failure says which, and why."""
        return [run for run in self.runs if run.state == UNREADABLE]

    @cached_property
    def front(self) -> list[SettingResult]:
        """The settings that no other beats in both delta-v and inspection rate; highest success first."""
        names = ("delta_v_m_s", "inspection_rate_percent")
        spent, inspected = (
            np.array([setting.estimates[name].value for setting in self.settings]) for name in names
        )
        is_on_front = on_front(spent, inspected)
        chosen = [setting for setting, stands in zip(self.settings, is_on_front, strict=True) if stands]
        return sorted(
            chosen,
            key=lambda setting: (-setting.estimates["success"].value, setting.estimates["delta_v_m_s"].value),
        )

    @property
    def offered(self) -> list[RunResult]:
        """The best run of the first settings on the front, each controller and world once."""
        best = [setting.best for setting in self.front]
        return list({run.flown: run for run in reversed(best)}.values())[::-1][:MOST_OFFERED]


def gather_results(folder: Path) -> SweepResults:
    """Read the results of a sweep so far, or of other runs in a folder.

    Raises
    ------
    pipeline.run.artifacts.ArtifactError
        If the folder holds no run, or none that can be read.
    """
    confidence, makes_controllers = CONFIDENCE_PERCENT, False
    runs: list[RunResult] = []
    episodes: dict[str, statistics.Columns] = {}
    refusals = []
    for run in sweep.gather_runs(folder):
        path = folder / run.folder
        try:
            summary = read_summary(path) if (path / artifacts.SUMMARY).exists() else None
            result = _run_result(folder, run, summary)
            if summary is not None:
                stages = configuration.read(path).get("stages", [])
                episodes[run.folder] = read_flights(path)
                confidence = float(summary.get("confidence_percent", confidence))
                makes_controllers |= not MAKING.isdisjoint(stages)
        except artifacts.ArtifactError as error:
            refusals.append(error)
            result = RunResult(**vars(run) | {"failure": str(error)}, state=UNREADABLE)
        runs.append(result)
    if refusals and len(refusals) == len(runs):
        raise refusals[0]
    flown = [(run.differs, episodes[run.folder]) for run in runs if run.folder in episodes]
    estimated = effects(flown, confidence, pools_seeds=not makes_controllers)
    settings = _settings(runs, episodes, confidence, pools_seeds=not makes_controllers)
    return SweepResults(
        folder, tuple(runs), tuple(settings), tuple(estimated), confidence, not makes_controllers
    )


def _run_result(folder: Path, run: sweep.SweptRun, summary: Mapping[str, Any] | None) -> RunResult:
    """Return a run with the estimates of its metrics, if it was evaluated."""
    tags = manifests.read_if_any(folder / run.folder).get(TAGS, {})
    result = RunResult(**vars(run), state=sweep.state_of(folder, run), tags=tags)
    if summary is None:
        return result
    estimates = {metric.name: _estimate_of(summary, metric.name) for metric in METRICS}
    fly = typed.fly(folder / run.folder)
    ahead = percent_ahead(summary)
    num_cases = int(summary["num_cases"])
    return replace(
        result,
        num_cases=num_cases,
        estimates=estimates,
        fly=fly,
        flown=_flown(folder / run.folder),
        percent_ahead=ahead,
    )


def _estimate_of(summary: Mapping[str, Any], name: str) -> Estimate:
    measure = summary[SHARES.get(name, name)]
    value, scale = ("fraction", 100.0) if name in SHARES else ("mean", 1.0)
    return Estimate(
        *(math.nan if measure[part] is None else scale * measure[part] for part in (value, "low", "high"))
    )


def _settings(
    runs: Sequence[RunResult],
    episodes: Mapping[str, statistics.Columns],
    confidence: float,
    *,
    pools_seeds: bool,
) -> list[SettingResult]:
    """Group evaluated runs by setting, in their order."""
    groups: dict[tuple[tuple[str, str], ...], list[RunResult]] = {}
    for run in runs:
        if run.estimates:
            groups.setdefault(tuple(run.setting.items()), []).append(run)
    results = []
    for setting, group in groups.items():
        flown = [episodes[run.folder] for run in group]
        # starts of a file are the same under all seeds: they count once
        is_pooled = pools_seeds and not any(len(common_cases(flown[0], other)[0]) for other in flown[1:])
        estimates = {
            metric.name: group[0].estimates[metric.name]
            if len(group) == 1
            else _over_cases(np.concatenate([metric.of(columns) for columns in flown]), metric, confidence)
            if is_pooled
            else _over_runs([run.estimates[metric.name].value for run in group], metric, confidence)
            for metric in METRICS
        }
        num_cases = sum(run.num_cases for run in group)
        results.append(SettingResult(dict(setting), tuple(group), num_cases, estimates))
    return results


def _over_cases(values: NDArray[np.float64], metric: Metric, confidence: float) -> Estimate:
    """Return the estimate from all cases, as a summary of one run has it."""
    if metric.name in SHARES:
        share = fraction(values > 0.0, confidence)
        return Estimate(*(100.0 * part for part in (share.fraction, share.low, share.high)))
    return _estimate(statistic(values, confidence, 0.0, metric.most))


def _over_runs(values: Sequence[float], metric: Metric, confidence: float) -> Estimate:
    """Return the estimate of the mean over runs, each of which counts once."""
    return _estimate(statistic(np.array(values), confidence, 0.0, metric.most))


def _estimate(mean: Statistic) -> Estimate:
    """Return an estimate, whose ends are NaN where a single value has no interval."""
    return Estimate(*(math.nan if part is None else part for part in (mean.mean, mean.low, mean.high)))


def _flown(folder: Path) -> str:
    """Return a hash of the controller and the world that a run flies, whatever cases it draws."""
    config = configuration.read(folder)
    flown = {key: config[key] for key in (*names_of(Mission), FREE, "sun") if key in config}
    made = [artifacts.file_hash(folder / name) for name in KEPT if (folder / name).exists()]
    return configuration.config_hash({**flown, "made": made})


def columns_of(results: SweepResults) -> Columns:
    """Return a sweep as a table, a row a run; what was not evaluated is NaN."""
    runs, nothing = results.runs, Estimate(np.nan, np.nan, np.nan)
    on_the_front = {run.folder for setting in results.front for run in setting.runs}
    columns: Columns = {"run": [run.folder for run in runs]}
    columns |= {key: [run.differs.get(key, "") for run in runs] for key in results.factors}
    columns |= {key: [run.tags.get(name, "") for run in runs] for key, name in results.tags.items()}
    columns |= {"state": [run.state for run in runs], "failure": [run.failure for run in runs]}
    columns["num_cases"] = np.array([run.num_cases for run in runs])
    columns["on_front"] = np.array([run.folder in on_the_front for run in runs])
    for metric in METRICS:
        name = f"{metric.name}_percent" if metric.name in SHARES else metric.name
        values = [run.estimates.get(metric.name, nothing) for run in runs]
        for suffix, column in zip(("", "_low", "_high"), np.array(values).reshape(-1, 3).T, strict=True):
            columns[name + suffix] = column
    if results.chooses_ahead:
        columns["ahead_percent"] = np.array([run.percent_ahead for run in runs])
    return columns


def effect_columns(results: SweepResults) -> Columns:
    """Return the effects as a table, a row for each level and metric."""
    rows = results.effects
    return {
        "factor": [effect.factor for effect in rows],
        "level": [effect.level for effect in rows],
        "baseline": [effect.baseline for effect in rows],
        "metric": [effect.metric.name for effect in rows],
        "unit": [effect.metric.unit for effect in rows],
        "difference": np.array([effect.difference.mean for effect in rows]),
        "low": np.array([effect.difference.low for effect in rows]),
        "high": np.array([effect.difference.high for effect in rows]),
        "p_value": np.array([effect.difference.p_value for effect in rows]),
        "is_shown": np.array([effect.is_shown for effect in rows], dtype=bool),
        "pairs": np.array([effect.difference.count for effect in rows], dtype=np.int64),
        "pairs_of": [effect.unit for effect in rows],
    }
