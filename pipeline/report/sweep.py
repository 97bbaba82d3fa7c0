"""The results of a sweep: its runs, the effect of each setting, the front, and how to fly the best."""

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
    effects,
    on_front,
)
from pipeline.report.contents import read_summary
from pipeline.report.figures.comparison import front_of_runs
from pipeline.report.figures.style import caption_of, illustrate, style
from pipeline.run import artifacts, sweep, tables

Columns = dict[str, list[Any] | NDArray[Any]]

#: what runs are repeated by: of it no effect is told, over it the others are averaged
REPLICATE = "seed"
#: metrics that are shares of flights, and what summaries call them
SHARES = {"success": SUCCESS, "violated": "violated"}
#: what a summary is told in where the runs do not say
CONFIDENCE_PERCENT = 95.0
#: words of a run's command that say nothing about a single flight
NOT_FLOWN = ("+experiment=", "stages=", "hydra.", "seed=", "name=", "monte_carlo", "optimizer", "starts")
#: of the runs on the front, how many are offered to be flown
MOST_OFFERED = 5


class Value(NamedTuple):
    """A metric of a run with its interval."""

    value: float
    low: float
    high: float


@dataclass(frozen=True, kw_only=True)
class Run(sweep.SweptRun):
    """A run of a sweep, with what came out.

    Parameters
    ----------
    state : str
        Of `pipeline.run.sweep`.
    num_cases : int
        Zero where nothing was evaluated.
    values : mapping of str to Value
        By the name of a metric; empty where nothing was evaluated.
    fly : str
        The command that flies its controller; empty where nothing was evaluated.
    """

    state: str
    num_cases: int = 0
    values: Mapping[str, Value] = field(default_factory=dict)
    fly: str = ""


@dataclass(frozen=True)
class Swept:
    """A sweep with what came out."""

    folder: Path
    runs: tuple[Run, ...]
    effects: tuple[Effect, ...]
    confidence_percent: float

    @property
    def factors(self) -> list[str]:
        """What the runs differ in."""
        return list(dict.fromkeys(key for run in self.runs for key in run.differs))

    @property
    def evaluated(self) -> list[Run]:
        """The runs that were evaluated."""
        return [run for run in self.runs if run.values]

    @property
    def failed(self) -> list[Run]:
        """The runs that failed."""
        return [run for run in self.runs if run.failure]

    @cached_property
    def front(self) -> list[Run]:
        """The runs that no other surpasses in mean delta-v and inspection rate; the most successful first."""
        runs = self.evaluated
        spent, inspected = (
            np.array([run.values[name].value for run in runs])
            for name in ("delta_v_m_s", "inspection_rate_percent")
        )
        chosen = [run for run, stands in zip(runs, on_front(spent, inspected), strict=True) if stands]
        return sorted(chosen, key=lambda run: (-run.values["success"].value, run.values["delta_v_m_s"].value))

    @property
    def offered(self) -> list[Run]:
        """The first of the front, each controller and world once."""
        return list({run.fly: run for run in reversed(self.front)}.values())[::-1][:MOST_OFFERED]


def gather(folder: Path) -> Swept:
    """Read what a sweep has come to so far.

    Raises
    ------
    pipeline.run.artifacts.ArtifactError
        If the folder holds no sweep, or a file in it cannot be read.
    """
    runs, flown, confidence = [], [], CONFIDENCE_PERCENT
    for run in sweep.gather(folder):
        own = folder / run.folder
        summary = read_summary(own) if (own / artifacts.SUMMARY).exists() else None
        if summary is not None:
            confidence = float(summary.get("confidence_percent", confidence))
            flown.append((run.differs, tables.read_parquet(own, artifacts.EPISODES)))
        runs.append(_run(folder, run, summary))
    found = tuple(effect for effect in effects(flown, confidence) if effect.factor != REPLICATE)
    return Swept(folder, tuple(runs), found, confidence)


def _run(folder: Path, run: sweep.SweptRun, summary: Mapping[str, Any] | None) -> Run:
    own = Run(**vars(run), state=sweep.state_of(folder, run))
    if summary is None:
        return own
    values = {metric.name: _value(summary, metric.name) for metric in METRICS}
    return replace(
        own, num_cases=int(summary["num_cases"]), values=values, fly=_command(folder / run.folder, run)
    )


def _value(summary: Mapping[str, Any], name: str) -> Value:
    measure = summary[SHARES.get(name, name)]
    value, scale = ("fraction", 100.0) if name in SHARES else ("mean", 1.0)
    return Value(*(scale * float(measure[part]) for part in (value, "low", "high")))


def _command(folder: Path, run: sweep.SweptRun) -> str:
    """Return the command that flies the controller of a run once, in the world of the run."""
    kept = [word for word in run.command if not word.startswith(NOT_FLOWN)]
    for name in (artifacts.CHAMPION, artifacts.CONTROLLER):
        if (folder / name).exists():
            kept = [word for word in kept if not word.startswith("controller")]
            kept.append(f"controller={folder / name}")
            break
    return shlex.join(["python", "-m", "pipeline", "+experiment=fly", *kept])


def columns_of(swept: Swept) -> Columns:
    """Return a sweep as a table, a row a run; what was not evaluated is NaN."""
    runs, nothing = swept.runs, Value(np.nan, np.nan, np.nan)
    columns: Columns = {"run": [run.folder for run in runs]}
    columns |= {key: [run.differs.get(key, "") for run in runs] for key in swept.factors}
    columns |= {"state": [run.state for run in runs], "failure": [run.failure for run in runs]}
    columns["num_cases"] = np.array([run.num_cases for run in runs])
    columns["on_front"] = np.array([run in swept.front for run in runs])
    for metric in METRICS:
        name = f"{metric.name}_percent" if metric.name in SHARES else metric.name
        values = [run.values.get(metric.name, nothing) for run in runs]
        for suffix, column in zip(("", "_low", "_high"), np.array(values).reshape(-1, 3).T, strict=True):
            columns[name + suffix] = column
    return columns


def effect_columns(swept: Swept) -> Columns:
    """Return the effects as a table, a row for each level and metric."""
    found = swept.effects
    return {
        "factor": [effect.factor for effect in found],
        "level": [effect.level for effect in found],
        "baseline": [effect.baseline for effect in found],
        "metric": [effect.metric.name for effect in found],
        "unit": [effect.metric.unit for effect in found],
        "difference": np.array([effect.difference.mean for effect in found]),
        "low": np.array([effect.difference.low for effect in found]),
        "high": np.array([effect.difference.high for effect in found]),
        "pairs": np.array([effect.difference.count for effect in found], dtype=np.int64),
        "pairs_of": [effect.unit for effect in found],
    }


def _headed(metric: Metric) -> str:
    return f"{metric.label} ({metric.unit})"


def runs_table(swept: Swept) -> list[Block]:
    """Return the runs, a line each: what they differ in, what came out, and where they stand."""
    factors = swept.factors
    rows = []
    for run in swept.runs:
        values = [_valued(run.values.get(metric.name), metric) for metric in METRICS]
        state = "on the front" if run in swept.front else run.state
        rows.append((*(run.differs.get(key, "") for key in factors), state, *values))
    confidence = f"{swept.confidence_percent:g} % intervals"
    heads = [*factors, "state", *map(_headed, METRICS)]
    table = Table(heads, rows, numbers=range(len(factors) + 1, len(heads)))
    return [*_seeds(swept), Paragraph(f"{len(swept.runs)} runs, {confidence}:"), table]


def _seeds(swept: Swept) -> list[Block]:
    """Warn of the order of runs, where these are of several seeds."""
    return [Paragraph(caption_of("seeds"))] if REPLICATE in swept.factors else []


def _valued(value: Value | None, metric: Metric) -> str:
    if value is None:
        return ""
    places = metric.decimals
    return f"{value.value:.{places}f} ({value.low:.{places}f} to {value.high:.{places}f})"


def effects_table(swept: Swept) -> list[Block]:
    """Return the effects, a line a level: differences from the factor's first level, all else equal."""
    found: dict[tuple[str, str, str], list[Effect]] = {}
    for effect in swept.effects:
        found.setdefault((effect.factor, effect.baseline, effect.level), []).append(effect)
    rows = []
    for (factor, baseline, level), group in found.items():
        gained = [differing(effect.difference, effect.metric) for effect in group]
        pairs = f"{group[0].difference.count:,} {group[0].unit}"
        rows.append((factor, f"{level} against {baseline}", pairs, *gained))
    if not rows:
        return []
    title = f"Effects: paired differences, {swept.confidence_percent:g} % intervals; * where without zero:"
    heads = ["setting", "values", "pairs of", *map(_headed, METRICS)]
    return [Paragraph(title), Table(heads, rows, numbers=range(2, len(heads)))]


def differing(difference: PairedDifference, metric: Metric) -> str:
    """Write a difference with its interval; a star where it leaves zero out."""
    if difference.count < 2:
        return f"{difference.mean:+.{metric.decimals}f} (one pair)"
    return difference.in_words(metric.decimals) + ("*" if difference.excludes_zero else "")


def compared_table(one: str, other: str, compared: Sequence[Compared], confidence: float) -> list[Block]:
    """Return two runs side by side, a line a metric."""
    count = compared[0].difference.count
    rows = []
    for row in compared:
        means = [f"{mean:.{row.metric.decimals}f}" for mean in row.means]
        counts = f"{row.better:,} / {row.worse:,} / {count - row.better - row.worse:,}"
        gained = differing(row.difference, row.metric)
        rows.append((_headed(row.metric), *means, gained, counts, f"{row.p_value:.2g}"))
    title = f"{count:,} common cases; B against A, {confidence:g} % intervals; * where without zero:"
    heads = ["", f"A: {one}", f"B: {other}", "B - A", "B better / worse / equal", "p"]
    return [Paragraph(title), Table(heads, rows, numbers=range(1, len(heads)))]


DOTS_PER_INCH = 100


def write(swept: Swept) -> str:
    """Write the page: HTML that needs no other file, asks for none, and runs no script."""
    return html.page(_document(swept), html.read("templates/report.css", "pipeline.report"))


def _document(swept: Swept) -> Document:
    folder = swept.folder.as_posix()
    blocks: list[Block] = [
        Heading(f"Sweep over {', '.join(swept.factors) or 'nothing'}", 1),
        Paragraph(f"{folder}: {len(swept.runs)} runs, {len(swept.evaluated)} evaluated"),
        Heading("Best, ready to fly"),
    ]
    if swept.offered:
        blocks += [Paragraph(caption_of("best")), *_seeds(swept)]
        for run in swept.offered:
            blocks += [Heading(run.folder, 3), Code(run.fly)]
    else:
        blocks.append(Paragraph("No run has been evaluated yet."))
    failures = [f"{run.folder}: {run.failure}" for run in swept.failed]
    if failures:
        blocks += [Heading("Failed"), Items(failures), Paragraph("To try them again:")]
        blocks.append(Code(f"python -m pipeline resume={folder}"))
    if effects := effects_table(swept):
        blocks += [Heading("Effects"), Paragraph(caption_of("effects")), *effects]
    if len(swept.evaluated) > 1:
        blocks += [Heading("All runs"), _picture(swept)]
    return Document([*blocks, Heading("Runs"), *runs_table(swept)])


def _picture(swept: Swept) -> Figure:
    runs = swept.evaluated
    spent, rates = (
        np.array([run.values[name] for run in runs]) for name in ("delta_v_m_s", "inspection_rate_percent")
    )
    is_on_front = np.array([run in swept.front for run in runs])
    with style():
        figure = front_of_runs([run.folder for run in runs], spent, rates, is_on_front)
        return illustrate("front", caption_of("front"), figure, DOTS_PER_INCH).block
