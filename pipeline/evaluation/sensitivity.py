"""Evaluation with dispersed settings: percentiles of the flights, and the effect of each dispersion."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any

from numpy.typing import NDArray

from pipeline.evaluation.statistics import percentile, rank_correlation

Column = NDArray[Any]

#: percentiles of the flights: upper ones of delta-v and greatest distance, lower ones of rate
#: and least distance
PERCENTS: Mapping[str, tuple[float, ...]] = {
    "delta_v_m_s": (50.0, 90.0, 99.0),
    "inspectable_rate_percent": (50.0, 10.0, 1.0),
    "max_distance_m": (50.0, 90.0, 99.0),
    "min_distance_m": (50.0, 10.0, 1.0),
}
#: quantities that dispersions are ranked by
RANKED = ("delta_v_m_s", "inspectable_rate_percent")


def percentiles(episodes: Mapping[str, Column], confidence_percent: float) -> dict[str, list[dict[str, Any]]]:
    """Return percentiles with intervals by column, see `PERCENTS`."""
    return {
        name: [asdict(percentile(episodes[name], percent, confidence_percent)) for percent in percents]
        for name, percents in PERCENTS.items()
    }


def sensitivity(
    episodes: Mapping[str, Column], keys: Sequence[str], confidence_percent: float
) -> list[dict[str, Any]]:
    """Rank dispersed settings by their correlation with delta-v and rate.

    Returns
    -------
    list of dict
        ``key``, and by `RANKED` the rank correlation with its interval; the strongest first.
    """
    found = []
    for key in keys:
        told: dict[str, Any] = {"key": key}
        for name in RANKED:
            told[name] = asdict(rank_correlation(episodes[key], episodes[name], confidence_percent))
        found.append(told)
    return sorted(found, key=lambda one: -max(abs(one[name]["value"]) for name in RANKED))


def is_told(correlation: Mapping[str, float]) -> bool:
    """Return whether an interval excludes zero."""
    return correlation["low"] > 0.0 or correlation["high"] < 0.0
