"""How the flights went, in rows of the page: those of an evaluation together, and each that was recorded."""

import json
from collections.abc import Mapping, Sequence
from math import sqrt
from pathlib import Path
from typing import Any

from fis_tools.analysis.flights import Outcome
from fis_tools.errors import ControllerFileError

SUMMARY = Path("evaluate") / "summary.json"
RECORDINGS = "episodes"
#: standard deviations of a normal distribution that hold 95 %
CONFIDENCE = 1.959963984540054
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


def rows(paths: Sequence[Path | str], names: Sequence[str], flown: Sequence[Outcome]) -> list[list[str]]:
    """Return the rows of the table, as many cells each as `HEADS` has.

    Parameters
    ----------
    paths : sequence of paths
        Recordings and folders of runs; a folder's evaluation comes first.
    names, flown : sequences
        What the flights among them are called, and how they went.
    """
    summaries = [path / SUMMARY for path in map(Path, paths) if (path / SUMMARY).is_file()]
    told = [_evaluation(json.loads(path.read_text(encoding="utf-8"))) for path in summaries]
    if len(flown) > 1 and not told:
        told.append(_together(flown))
    return told + [_flight(name, one) for name, one in zip(names, flown, strict=True)]


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


def interval(count: int, total: int) -> tuple[float, float]:
    """Return Wilson's interval of a share at 95 %.

    Source: E. B. Wilson, Journal of the American Statistical Association 22 (1927) 209-212.
    """
    share, z = count / total, CONFIDENCE
    middle = (share + z * z / (2 * total)) / (1 + z * z / total)
    half = z / (1 + z * z / total) * sqrt(share * (1 - share) / total + z * z / (4 * total * total))
    return max(0.0, middle - half), min(1.0, middle + half)


def _together(flown: Sequence[Outcome]) -> list[str]:
    """Sum up recorded flights; these need not stand for others, and no interval is told beyond success."""

    def mean(values: Sequence[float | None], digits: int) -> str:
        numbers = [value for value in values if value is not None]
        return f"{sum(numbers) / len(numbers):.{digits}f} on average" if numbers else UNKNOWN

    def share(values: Sequence[bool | None]) -> str:
        known = [value for value in values if value is not None]
        if not known:
            return UNKNOWN
        low, high = interval(sum(known), len(known))
        found = {"count": sum(known), "fraction": sum(known) / len(known), "low": low, "high": high}
        return _share(found, len(known))

    fired, asked = sum(one.num_fired for one in flown), sum(one.num_asked for one in flown)
    return [
        f"the {len(flown)} recorded",
        mean([one.delta_v_m_s for one in flown], 3),
        mean([one.inspection_rate_percent for one in flown], 2),
        share([one.is_success for one in flown]),
        _span([one.nearest_m for one in flown], [one.farthest_m for one in flown]),
        share([one.is_outside for one in flown]),
        share([None if not one.reasons else "safety" in one.reasons for one in flown]),
        f"{fired} of {asked}" if asked else UNKNOWN,
    ]


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
