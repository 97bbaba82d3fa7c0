"""How the flights went, in rows of the page: those of an evaluation together, and each that was recorded."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from fis_tools.analysis import tables
from fis_tools.analysis.flights import Outcome
from fis_tools.errors import ControllerFileError

SUMMARY = Path("evaluate") / "summary.json"
RECORDINGS = "episodes"
EPISODES = Path("evaluate") / "episodes.parquet"
#: so many of the flights that fail are named
MOST_NAMED = 3
UNKNOWN = "–"


def recordings(paths: Sequence[Path | str]) -> list[Path]:
    """Return the recordings that are named, and those of the folders of runs that are named.

    Raises
    ------
    ControllerFileError
        If a folder holds no recording.
    """
    found: list[Path] = []
    for path in map(Path, paths):
        inside = sorted((path / RECORDINGS).glob("*.mcap")) if path.is_dir() else [path]
        if not inside:
            raise ControllerFileError(
                f"{path} is a folder without {RECORDINGS}/*.mcap; give the folder of a run that has recorded "
                "flights, a flight, or a table (.csv, .parquet)"
            )
        found += inside
    return found


@dataclass(frozen=True)
class Evaluation:
    """All flights of a run's evaluation: their summary, and which failed worst."""

    summary: Mapping[str, Any]
    worst: str


def evaluations(paths: Sequence[Path | str]) -> list[Evaluation]:
    """Return the evaluations of the runs that are named, or whose recordings are."""
    folders = [path if path.is_dir() else path.parent.parent for path in map(Path, paths)]
    return [
        Evaluation(json.loads((folder / SUMMARY).read_text(encoding="utf-8")), _worst(folder / EPISODES))
        for folder in dict.fromkeys(folders)
        if (folder / SUMMARY).is_file()
    ]


def _worst(path: Path) -> str:
    """Name the flights of an evaluation that failed by the most."""
    if not path.is_file():
        return ""
    wanted = ("case", "success", "violated", "inspection_rate_percent")
    told = tables.read_parquet(path, lambda names: [name for name in wanted if name in names])
    if set(wanted) - set(told):
        return ""
    failed = ~told["success"].astype(bool) | told["violated"].astype(bool)
    order = sorted(np.flatnonzero(failed), key=lambda row: told["inspection_rate_percent"][row])[:MOST_NAMED]
    return ", ".join(
        f"case {told['case'][row]} ({told['inspection_rate_percent'][row]:.1f} %"
        f"{', outside' if told['violated'][row] else ''})"
        for row in order
    )


def failures(evaluation: Evaluation) -> str:
    """Say how often flights fail, over all that were evaluated, and which worst."""
    told, count = evaluation.summary, evaluation.summary["num_cases"]
    parts = []
    if found := told.get("success"):
        failed, low, high = count - found["count"], 1 - found["high"], 1 - found["low"]
        missed = {"count": failed, "fraction": failed / count, "low": low, "high": high}
        parts.append(f"{_share(missed, count)} inspect too little")
    if found := told.get("violated"):
        parts.append(f"{_share(found, count)} leave the limits")
    worst = f" The worst: {evaluation.worst}." if evaluation.worst else ""
    return f"Over all {count:,} flights of the evaluation: {'; '.join(parts)}.{worst}"


def rows(told: Sequence[Evaluation], names: Sequence[str], flown: Sequence[Outcome]) -> list[list[str]]:
    """Return the rows of the table, as many cells each as `HEADS` has: evaluations, then single flights.

    Recorded flights are chosen, and stand for no others: nothing is counted over them.
    """
    return [_evaluation(one.summary) for one in told] + [
        _flight(name, one) for name, one in zip(names, flown, strict=True)
    ]


HEADS = (
    *("flights", "delta-v (m/s)", "inspected (%)", "success", "distance (m)", "outside", "safety acted"),
    "periods fired, of those asked for",
)


def _evaluation(summary: Mapping[str, Any]) -> list[str]:
    count = summary["num_cases"]
    spent, rate = (summary[name] for name in ("delta_v_m_s", "inspection_rate_percent"))
    return [
        f"all {count} of the evaluation",
        f"{spent['mean']:.3f} ± {spent['standard_deviation']:.3f}",
        f"{rate['mean']:.2f} ± {rate['standard_deviation']:.2f}",
        *(_share(summary.get(name), count) for name in ("success",)),
        UNKNOWN,
        *(_share(summary.get(name), count) for name in ("violated", "safety_acted")),
        UNKNOWN,
    ]


def _share(found: Mapping[str, float] | None, count: int) -> str:
    if found is None:
        return UNKNOWN
    low, high = 100 * found["low"], 100 * found["high"]
    return f"{found['count']:.0f} of {count}: {100 * found['fraction']:.1f} % ({low:.1f} to {high:.1f})"


def _span(nearest: Sequence[float | None], farthest: Sequence[float | None]) -> str:
    low = [value for value in nearest if value is not None]
    high = [value for value in farthest if value is not None]
    return f"{min(low):.1f} to {max(high):.1f}" if low and high else UNKNOWN


def _flight(name: str, one: Outcome) -> list[str]:
    def number(value: float | None, digits: int) -> str:
        return UNKNOWN if value is None else f"{value:.{digits}f}"

    def word(value: bool | None) -> str:
        return UNKNOWN if value is None else "yes" if value else "no"

    others = {key: count for key, count in one.reasons.items() if key not in {"fired", "silent", "unknown"}}
    reasons = ", ".join(f"{count} {key.replace('_', ' ')}" for key, count in others.items())
    return [
        name,
        number(one.delta_v_m_s, 3),
        number(one.inspection_rate_percent, 2),
        word(one.is_success),
        _span([one.nearest_m], [one.farthest_m]),
        word(one.is_outside),
        f"in {one.reasons.get('safety', 0)} periods" if one.reasons else UNKNOWN,
        (f"{one.num_fired} of {one.num_asked}" if one.num_periods else UNKNOWN)
        + (f"; {reasons}" if reasons else ""),
    ]
