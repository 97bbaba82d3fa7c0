"""What is told of a sweep, read from the folders of its runs."""

import shlex
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.evaluation.monte_carlo import SUCCESS
from pipeline.evaluation.paired import METRICS, Effect, effects, on_front
from pipeline.run import artifacts, sweep, tables

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


@dataclass(frozen=True)
class Value:
    """A metric of a run with its interval."""

    value: float
    low: float
    high: float


@dataclass(frozen=True)
class Run:
    """A run of a sweep, with what came out.

    Parameters
    ----------
    name : str
        Its folder in the sweep's.
    differs : mapping of str to str
    state : str
        Of `pipeline.run.sweep`.
    failure : str
    num_cases : int
        Zero where nothing was evaluated.
    values : mapping of str to Value
        By the name of a metric; empty where nothing was evaluated.
    fly : str
        The command that flies its controller; empty where nothing was evaluated.
    """

    name: str
    differs: Mapping[str, str]
    state: str
    failure: str
    num_cases: int
    values: Mapping[str, Value]
    fly: str


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

    @cached_property
    def front(self) -> list[Run]:
        """The runs that no other surpasses in mean delta-v and inspection rate; the most successful first."""
        runs = self.evaluated
        spent, inspected = (
            np.array([run.values[name].value for run in runs])
            for name in ("delta_v_m_s", "inspection_rate_percent")
        )
        chosen = [run for run, stands in zip(runs, on_front(spent, inspected), strict=True) if stands]
        return sorted(
            chosen,
            key=lambda run: (-run.values["success"].value, run.values["delta_v_m_s"].value),
        )

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
    for told in sweep.read(folder):
        own = folder / told.folder
        summary = artifacts.read_json(own, artifacts.SUMMARY) if (own / artifacts.SUMMARY).exists() else None
        if summary is not None:
            confidence = float(summary["confidence_percent"])
            flown.append((told.differs, tables.read_parquet(own, artifacts.EPISODES)))
        runs.append(_run(folder, told, summary))
    found = tuple(effect for effect in effects(flown, confidence) if effect.factor != REPLICATE)
    return Swept(folder, tuple(runs), found, confidence)


def _run(folder: Path, told: sweep.SweptRun, summary: Mapping[str, Any] | None) -> Run:
    return Run(
        told.folder,
        told.differs,
        sweep.state_of(folder, told),
        told.failure,
        int(summary["num_cases"]) if summary else 0,
        {metric.name: _value(summary, metric.name) for metric in METRICS} if summary else {},
        _command(folder / told.folder, told) if summary else "",
    )


def _value(summary: Mapping[str, Any], name: str) -> Value:
    told = summary[SHARES.get(name, name)]
    value, scale = ("fraction", 100.0) if name in SHARES else ("mean", 1.0)
    return Value(*(scale * float(told[part]) for part in (value, "low", "high")))


def _command(folder: Path, told: sweep.SweptRun) -> str:
    """Return the command that flies the controller of a run once, in the world of the run."""
    kept = [word for word in told.command if not word.startswith(NOT_FLOWN)]
    for name in (artifacts.CHAMPION, artifacts.CONTROLLER):
        if (folder / name).exists():
            kept = [word for word in kept if not word.startswith("controller")]
            kept.append(f"controller={folder / name}")
            break
    return shlex.join(["python", "-m", "pipeline", "+experiment=fly", *kept])


def columns_of(swept: Swept) -> dict[str, list[Any] | NDArray[Any]]:
    """Return a sweep as a table, a row a run; what was not evaluated is NaN."""
    runs, nothing = swept.runs, Value(np.nan, np.nan, np.nan)
    columns: dict[str, list[Any] | NDArray[Any]] = {"run": [run.name for run in runs]}
    columns |= {key: [run.differs.get(key, "") for run in runs] for key in swept.factors}
    columns |= {"state": [run.state for run in runs], "failure": [run.failure for run in runs]}
    columns["num_cases"] = np.array([run.num_cases for run in runs])
    columns["on_front"] = np.array([run in swept.front for run in runs])
    for metric in METRICS:
        name = metric.name if metric.name not in SHARES else f"{metric.name}_percent"
        values = [run.values.get(metric.name, nothing) for run in runs]
        columns[name] = np.array([value.value for value in values])
        columns[f"{name}_low"] = np.array([value.low for value in values])
        columns[f"{name}_high"] = np.array([value.high for value in values])
    return columns


def effect_columns(swept: Swept) -> dict[str, list[Any] | NDArray[Any]]:
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
