"""The results of a sweep: which setting is better, by how much, how sure; and how to fly the best."""

import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fis_tools.document import Block, Code, Document, Figure, Heading, Items, Paragraph, Table, html
from pipeline.evaluation.monte_carlo import SUCCESS
from pipeline.evaluation.statistics import (
    METRICS,
    Compared,
    Effect,
    Metric,
    PairedDifference,
    common_cases,
    effects,
    fraction,
    on_front,
    statistic,
)
from pipeline.report.contents import read_summary
from pipeline.report.figures.comparison import front_of_runs
from pipeline.report.figures.style import caption_of, illustrate, style
from pipeline.run import artifacts, configuration, sweep, tables

Columns = dict[str, list[Any] | NDArray[Any]]

#: what settings are repeated with: it is none itself
REPLICATE = "seed"
#: stages that make another controller for each seed; without them a seed only draws cases
MAKING = {"train", "search"}
#: metrics that are shares of flights, and what summaries call them
SHARES = {"success": SUCCESS, "violated": "violated"}
#: of intervals, where the runs do not say
CONFIDENCE_PERCENT = 95.0
#: words of a run's command that say nothing about a single flight
NOT_FLOWN = ("+experiment=", "stages=", "hydra.", "seed=", "name=", "monte_carlo", "optimizer", "starts")
#: of the settings on the front, how many are offered to be flown
MOST_OFFERED = 5
DOTS_PER_INCH = 100
#: metrics in sentences, where their labels are no nouns
NOUNS = {"success": "success rate", "violated": "flights outside the limits"}


class Estimate(NamedTuple):
    """A metric of flights with its interval."""

    value: float
    low: float
    high: float

    def in_words(self, metric: Metric) -> str:
        """Return the value with its interval."""
        value, low, high = (f"{number:.{metric.decimals}f}" for number in self)
        return f"{value} ({low} to {high})"


Estimates = Mapping[str, Estimate]


@dataclass(frozen=True, kw_only=True)
class RunResult(sweep.SweptRun):
    """A run of a sweep, with its results.

    Parameters
    ----------
    state : str
        Of `pipeline.run.sweep`.
    num_cases : int
        Zero where nothing was evaluated.
    estimates : mapping of str to Estimate
        By the name of a metric; empty where nothing was evaluated.
    fly : str
        The command that flies its controller; empty where nothing was evaluated.
    """

    state: str
    num_cases: int = 0
    estimates: Estimates = field(default_factory=dict)
    fly: str = ""

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
    def evaluated(self) -> list[RunResult]:
        """The runs that were evaluated."""
        return [run for run in self.runs if run.estimates]

    @property
    def failed(self) -> list[RunResult]:
        """The runs that failed."""
        return [run for run in self.runs if run.failure]

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
        return list({run.fly: run for run in reversed(best)}.values())[::-1][:MOST_OFFERED]


def gather_results(folder: Path) -> SweepResults:
    """Read the results of a sweep so far, or of other runs in a folder.

    Raises
    ------
    pipeline.run.artifacts.ArtifactError
        If the folder holds no run, or a file in it cannot be read.
    """
    runs, confidence, makes_controllers = [], CONFIDENCE_PERCENT, False
    episodes: dict[str, tables.RunTable] = {}
    for run in sweep.gather_runs(folder):
        path = folder / run.folder
        summary = read_summary(path) if (path / artifacts.SUMMARY).exists() else None
        if summary is not None:
            confidence = float(summary.get("confidence_percent", confidence))
            episodes[run.folder] = tables.read_parquet(path, artifacts.EPISODES)
            makes_controllers |= not MAKING.isdisjoint(configuration.read(path).get("stages", []))
        runs.append(_run_result(folder, run, summary))
    flown = [(run.differs, episodes[run.folder]) for run in runs if run.folder in episodes]
    estimated = effects(flown, confidence, pools_seeds=not makes_controllers)
    settings = _settings(runs, episodes, confidence, pools_seeds=not makes_controllers)
    return SweepResults(
        folder,
        tuple(runs),
        tuple(settings),
        tuple(effect for effect in estimated if effect.factor != REPLICATE),
        confidence,
        not makes_controllers,
    )


def _run_result(folder: Path, run: sweep.SweptRun, summary: Mapping[str, Any] | None) -> RunResult:
    """Return a run with the estimates of its metrics, if it was evaluated."""
    result = RunResult(**vars(run), state=sweep.state_of(folder, run))
    if summary is None:
        return result
    estimates = {metric.name: _estimate_of(summary, metric.name) for metric in METRICS}
    fly = _fly_command(folder / run.folder, run)
    return replace(result, num_cases=int(summary["num_cases"]), estimates=estimates, fly=fly)


def _estimate_of(summary: Mapping[str, Any], name: str) -> Estimate:
    measure = summary[SHARES.get(name, name)]
    value, scale = ("fraction", 100.0) if name in SHARES else ("mean", 1.0)
    return Estimate(*(scale * float(measure[part]) for part in (value, "low", "high")))


def _settings(
    runs: Sequence[RunResult],
    episodes: Mapping[str, tables.RunTable],
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
    mean = statistic(values, confidence)
    return Estimate(mean.mean, mean.low, mean.high)


def _over_runs(values: Sequence[float], metric: Metric, confidence: float) -> Estimate:
    """Return the estimate of the mean over runs, each of which counts once."""
    mean = statistic(np.array(values), confidence)
    low, high = max(mean.low, 0.0), min(mean.high, metric.most)
    return Estimate(mean.mean, low, high)


def _fly_command(folder: Path, run: sweep.SweptRun) -> str:
    """Return the command that flies the controller of a run once, in the world of the run."""
    kept = [word for word in run.command if not word.startswith(NOT_FLOWN)]
    for name in (artifacts.CHAMPION, artifacts.CONTROLLER):
        if (folder / name).exists():
            kept = [word for word in kept if not word.startswith("controller")]
            kept.append(f"controller={folder / name}")
            break
    return shlex.join(["python", "-m", "pipeline", "+experiment=fly", *kept])


def columns_of(results: SweepResults) -> Columns:
    """Return a sweep as a table, a row a run; what was not evaluated is NaN."""
    runs, nothing = results.runs, Estimate(np.nan, np.nan, np.nan)
    on_the_front = {run.folder for setting in results.front for run in setting.runs}
    columns: Columns = {"run": [run.folder for run in runs]}
    columns |= {key: [run.differs.get(key, "") for run in runs] for key in results.factors}
    columns |= {"state": [run.state for run in runs], "failure": [run.failure for run in runs]}
    columns["num_cases"] = np.array([run.num_cases for run in runs])
    columns["on_front"] = np.array([run.folder in on_the_front for run in runs])
    for metric in METRICS:
        name = f"{metric.name}_percent" if metric.name in SHARES else metric.name
        values = [run.estimates.get(metric.name, nothing) for run in runs]
        for suffix, column in zip(("", "_low", "_high"), np.array(values).reshape(-1, 3).T, strict=True):
            columns[name + suffix] = column
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
        "pairs": np.array([effect.difference.count for effect in rows], dtype=np.int64),
        "pairs_of": [effect.unit for effect in rows],
    }


def _headed(metric: Metric) -> str:
    return f"{metric.label} ({metric.unit})"


def settings_table(results: SweepResults) -> list[Block]:
    """Return the settings, a line each: their means over all cases or runs, and which are on the front."""
    if not results.settings:
        return []
    rows = []
    for setting in results.settings:
        values = [setting.estimates[metric.name].in_words(metric) for metric in METRICS]
        mark = " (front)" if setting in results.front and len(results.settings) > 1 else ""
        rows.append((setting.name + mark, f"{len(setting.runs)}, {setting.num_cases:,}", *values))
    over = "cases" if results.pools_seeds else "runs"
    title = f"{len(rows)} settings; means and {results.confidence_percent:g} % intervals over {over}:"
    return [Paragraph(title), Table(["setting", "runs, cases", *map(_headed, METRICS)], rows)]


def runs_table(results: SweepResults) -> list[Block]:
    """Return the runs, a line each, with their means."""
    rows = []
    for run in results.runs:
        values = [
            f"{run.estimates[metric.name].value:.{metric.decimals}f}" if run.estimates else ""
            for metric in METRICS
        ]
        rows.append((run.folder, run.state, *values))
    return [Paragraph(f"{len(rows)} runs:"), Table(["run", "state", *map(_headed, METRICS)], rows)]


def effects_table(results: SweepResults) -> list[Block]:
    """Return the effects, a sentence and a line a level, against the factor's first level, all else equal."""
    groups: dict[tuple[str, str, str], list[Effect]] = {}
    for effect in results.effects:
        groups.setdefault((effect.factor, effect.baseline, effect.level), []).append(effect)
    if not groups:
        return []
    rows, sentences = [], []
    for (factor, baseline, level), group in groups.items():
        gained = [differing(effect.difference, effect.metric) for effect in group]
        pairs = f"{group[0].difference.count:,} {group[0].unit}"
        rows.append((f"{factor}: {level} against {baseline}", pairs, *gained))
        sentences.append(f"{factor}={level} against {baseline}: {_verdict(group)}.")
    title = f"Paired differences, {results.confidence_percent:g} % intervals; * interval excludes zero:"
    return [Items(sentences), Paragraph(title), Table(["setting", "pairs of", *map(_headed, METRICS)], rows)]


def _verdict(group: Sequence[Effect]) -> str:
    """Return in which metrics a level is better or worse than its baseline, and by how much."""
    words: dict[str, list[str]] = {"better": [], "worse": [], "no difference shown": []}
    for effect in group:
        metric, difference = effect.metric, effect.difference
        is_better = (difference.mean < 0.0) == metric.is_less_better
        kind = ("better" if is_better else "worse") if difference.excludes_zero else "no difference shown"
        unit = "percentage points" if metric.unit == "%" else metric.unit
        amount = f" by {abs(difference.mean):.{metric.decimals}f} {unit}"
        words[kind].append(NOUNS.get(metric.name, metric.label) + amount * difference.excludes_zero)
    return "; ".join(f"{kind} in {', '.join(names)}" for kind, names in words.items() if names)


def differing(difference: PairedDifference, metric: Metric) -> str:
    """Write a difference with its interval; a star where it excludes zero."""
    if difference.count < 2:
        return f"{difference.mean:+.{metric.decimals}f} (one pair)"
    return difference.in_words(metric.decimals) + ("*" if difference.excludes_zero else "")


def compared_table(first: str, second: str, compared: Sequence[Compared], confidence: float) -> list[Block]:
    """Return two runs side by side, a line a metric."""
    count = compared[0].difference.count
    rows = []
    for row in compared:
        means = [f"{mean:.{row.metric.decimals}f}" for mean in row.means]
        counts = f"{row.better:,} / {row.worse:,} / {count - row.better - row.worse:,}"
        gained = differing(row.difference, row.metric)
        rows.append((_headed(row.metric), *means, gained, counts, f"{row.p_value:.2g}"))
    title = f"{count:,} common cases; B against A, {confidence:g} % intervals; * interval excludes zero:"
    heads = ["", f"A: {first}", f"B: {second}", "B - A", "B better / worse / equal", "p"]
    return [Paragraph(title), Table(heads, rows, numbers=range(1, len(heads)))]


def write(results: SweepResults) -> str:
    """Write the page: HTML that needs no other file, asks for none, and runs no script."""
    return html.page(_document(results), html.read("templates/report.css", "pipeline.report"))


def _document(results: SweepResults) -> Document:
    """Return the page on a sweep: effects, settings, the best controllers, failures, and all runs."""
    folder = results.folder.as_posix()
    factors = [key for key in results.factors if key != REPLICATE] or results.factors
    blocks: list[Block] = [
        Heading(f"Sweep over {', '.join(factors) or 'nothing'}", 1),
        Paragraph(f"{folder}: {len(results.runs)} runs, {len(results.evaluated)} evaluated"),
    ]
    if tables_of_effects := effects_table(results):
        blocks += [Heading("Which is better"), Paragraph(caption_of("effects")), *tables_of_effects]
    if settings := settings_table(results):
        note = caption_of("pooled" if results.pools_seeds else "trained")
        blocks += [Heading("Settings"), Paragraph(note), *settings]
    if len(results.settings) > 1:
        blocks.append(_picture(results))
    blocks.append(Heading("Best, ready to fly"))
    if results.offered:
        blocks.append(Paragraph(caption_of("best")))
        for run in results.offered:
            blocks += [Heading(run.folder, 3), Code(run.fly)]
    else:
        blocks.append(Paragraph("No run has been evaluated yet."))
    failures = [f"{run.folder}: {run.failure}" for run in results.failed]
    if failures:
        blocks += [Heading("Failed"), Items(failures), Paragraph("To try them again:")]
        blocks.append(Code(f"python -m pipeline resume={folder}"))
    return Document([*blocks, Heading("Runs"), *runs_table(results)])


def _picture(results: SweepResults) -> Figure:
    """Draw the settings, rate over delta-v, with those on the front."""
    spent, rates = (
        np.array([setting.estimates[name] for setting in results.settings])
        for name in ("delta_v_m_s", "inspection_rate_percent")
    )
    is_on_front = np.array([setting in results.front for setting in results.settings])
    with style():
        figure = front_of_runs([setting.name for setting in results.settings], spent, rates, is_on_front)
        return illustrate("front", caption_of("front"), figure, DOTS_PER_INCH).block
