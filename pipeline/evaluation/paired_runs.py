"""Runs compared on the cases that they share, and the effects of a sweep's settings."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pipeline.array_types import Floats
from pipeline.evaluation import paired
from pipeline.evaluation.blocks import blocks_of, number_of
from pipeline.evaluation.paired import PairedDifference
from pipeline.evaluation.statistics import Columns, succeeds
from pipeline.settings.start_table import POSITION, VELOCITY

#: columns that identify a case's start: cases that share them are the same case
START = (*POSITION, *VELOCITY, "sun_angle_rad", "sun_elevation_rad")
#: those of a deputy's own, of which a fleet's further deputies have some too
OWN_START = (*POSITION, *VELOCITY)


@dataclass(frozen=True)
class Metric:
    """A quantity to compare runs by: its column in an evaluation, its words, and whether less is better."""

    name: str
    label: str
    unit: str
    is_less_better: bool
    decimals: int
    is_share: bool = False

    @property
    def most(self) -> float:
        """The largest value that there can be."""
        return 100.0 if self.unit == "%" else math.inf

    def of(self, episodes: Columns) -> Floats:
        """Return the metric's value in each case, (n,); that of a share is 0 or 100 %."""
        column = succeeds(episodes) if self.name == "success" else episodes[self.name]
        return np.asarray(column * (100.0 if self.is_share else 1.0), dtype=np.float64)


METRICS = (
    Metric("delta_v_m_s", "delta-v", "m/s", True, 4),
    Metric("inspection_rate_percent", "inspection rate", "%", False, 2),
    Metric("success", "successful", "%", False, 2, is_share=True),  # inside the limits
    Metric("violated", "outside the limits", "%", True, 2, is_share=True),
)


def common_cases(first: Columns, second: Columns) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the rows of the cases that two evaluations share, bit-identical in `START`.

    Fleets share a case if all deputies start alike that both have. Where both flew the same cases in the same
    order, each is paired with itself; of others each start counts once.
    """
    names = _names_of_starts(first, second)
    if _fly_the_same(first, second, names):
        rows = np.arange(number_of(first))
        return rows, rows
    mine, others = _keys(first, names), _keys(second, names)
    starts, earliest = np.unique(mine, return_index=True)
    other_starts, from_end = np.unique(others[::-1], return_index=True)
    _, here, there = np.intersect1d(starts, other_starts, assume_unique=True, return_indices=True)
    rows, other_rows = earliest[here], len(others) - 1 - from_end[there]
    order = np.argsort(rows)
    return rows[order], other_rows[order]


def of_deputy(name: str, deputy: int) -> str:
    """Return what a column of starts is called of a fleet's deputy, counted from 1."""
    return name if deputy == 1 else f"{name}_of_deputy_{deputy}"


def _names_of_starts(*evaluations: Columns) -> list[str]:
    """Return the columns of starts that tell cases of evaluations apart: of the deputies that all have."""
    names, deputy = [*START], 2
    while all(of_deputy(POSITION[0], deputy) in episodes for episodes in evaluations):
        names += [of_deputy(name, deputy) for name in OWN_START]
        deputy += 1
    return names


def _fly_the_same(first: Columns, second: Columns, names: Sequence[str]) -> bool:
    """Return whether two evaluations have equal cases, row by row; few of them are in memory at a time."""
    if number_of(first) != number_of(second):
        return False
    pairs = zip(blocks_of(first), blocks_of(second), strict=False)
    return all(
        np.array_equal(block["case"], other["case"])
        and np.array_equal(_bits(block, names), _bits(other, names))
        for block, other in pairs
    )


def _bits(episodes: Columns, names: Sequence[str]) -> NDArray[np.uint64]:
    """Return the bits of each start, (n, number of names)."""
    zeros = np.zeros(len(episodes["case"]))  # earlier versions had no elevation
    starts = np.column_stack([np.asarray(episodes.get(name, zeros), np.float64) for name in names])
    return starts.view(np.uint64)


def _keys(episodes: Columns, names: Sequence[str]) -> NDArray[np.void]:
    """Return the bits of each start as one value, (n,)."""
    bits = _bits(episodes, names)
    return bits.view(np.dtype((np.void, bits.itemsize * len(names)))).ravel()


@dataclass(frozen=True)
class Compared:
    """A metric of two runs on the same cases.

    Parameters
    ----------
    metric : Metric
    means : tuple of (float, float)
    difference : PairedDifference
        Second minus first.
    better, worse : int
        Number of cases in which the second is better and worse than the first.
    is_shown : bool
        Whether the test shows a difference, beside those of the other metrics.
    """

    metric: Metric
    means: tuple[float, float]
    difference: PairedDifference
    better: int
    worse: int
    is_shown: bool = False


def compare(first: Columns, second: Columns, confidence_percent: float) -> list[Compared]:
    """Compare two runs by every metric on the cases that they share.

    Raises
    ------
    ValueError
        If they have no common case.
    """
    rows, other_rows = common_cases(first, second)
    if not len(rows):
        raise ValueError(
            "the two runs share no case; evaluate both from the same starts: equal seed, starts, sun and "
            "monte_carlo.num_cases"
        )
    results = []
    for metric in METRICS:
        before, after = metric.of(first)[rows], metric.of(second)[other_rows]
        gained = after - before
        above, below = _signs(gained)
        better, worse = (below, above) if metric.is_less_better else (above, below)
        means = float(before.mean()), float(after.mean())
        results.append(Compared(metric, means, _of_cases(gained, metric, confidence_percent), better, worse))
    is_shown = paired.shown([row.difference.p_value for row in results], confidence_percent)
    return [replace(row, is_shown=shown) for row, shown in zip(results, is_shown, strict=True)]


def _signs(gained: Floats) -> tuple[int, int]:
    """Return in how many cases the second run has more, and less."""
    return int(np.sum(gained > 0.0)), int(np.sum(gained < 0.0))


def _of_cases(gained: Floats, metric: Metric, confidence_percent: float) -> PairedDifference:
    if metric.is_share:
        return paired.of_shares(*_signs(gained), len(gained), confidence_percent)
    return paired.of_numbers(gained, confidence_percent)


@dataclass(frozen=True)
class Effect:
    """The effect of a setting: a level of a factor against the factor's first, all else equal.

    Parameters
    ----------
    factor, level, baseline : str
    metric : Metric
    difference : PairedDifference
    unit : str
        The kind of pairs: ``runs`` if several pairs of runs differ in nothing else, ``cases`` if only one
        does.
    is_shown : bool
        Whether the test shows a difference, beside all others of the sweep.
    """

    factor: str
    level: str
    baseline: str
    metric: Metric
    difference: PairedDifference
    unit: str
    is_shown: bool = False


#: what settings are repeated with: it is none itself
REPLICATE = "seed"
Flown = tuple[Mapping[str, str], Columns]


def effects(runs: Sequence[Flown], confidence_percent: float, *, pools_seeds: bool = False) -> list[Effect]:
    """Return the effect of each factor of a sweep but the seed.

    Runs are paired with those that differ from them in one factor only, and their cases with the same
    cases; pairs without common cases are compared by their means.

    Parameters
    ----------
    runs : sequence of (levels by factor, columns of the evaluation)
    confidence_percent : float
    pools_seeds : bool
        Whether seeds only draw cases, whose differences then all count; else a pair of runs counts once, for
        its seed also made another controller.
    """
    results = []
    for factor in dict.fromkeys(name for levels, _ in runs for name in levels if name != REPLICATE):
        by_level: dict[str, dict[tuple[tuple[str, str], ...], Columns]] = {}
        for levels, episodes in runs:
            if factor not in levels:  # a sweep that was extended has others
                continue
            rest = tuple((name, value) for name, value in levels.items() if name != factor)
            by_level.setdefault(levels[factor], {})[rest] = episodes
        baseline, *others = by_level
        for level in others:
            of_seeds: dict[str, list[tuple[Columns, Columns]]] = {}
            for rest, episodes in by_level[level].items():
                if rest in by_level[baseline]:
                    pair = by_level[baseline][rest], episodes
                    of_seeds.setdefault(dict(rest).get(REPLICATE, ""), []).append(pair)
            for metric in METRICS if of_seeds else ():
                pairs = list(of_seeds.values())
                gain, unit = _over(pairs, metric, confidence_percent, pools_seeds=pools_seeds)
                results.append(Effect(factor, level, baseline, metric, gain, unit))
    is_shown = paired.shown([effect.difference.p_value for effect in results], confidence_percent)
    return [replace(effect, is_shown=shown) for effect, shown in zip(results, is_shown, strict=True)]


def _over(
    of_seeds: Sequence[Sequence[tuple[Columns, Columns]]],
    metric: Metric,
    confidence_percent: float,
    *,
    pools_seeds: bool,
) -> tuple[PairedDifference, str]:
    """Return the difference over common cases, if seeds are pooled or there is one, else runs; and which.

    Pairs of runs of the same seed fly the same cases, so only their mean counts.
    """
    differences = [[_between(*pair, metric) for pair in pairs] for pairs in of_seeds]
    sizes = [{len(values) for values in pairs} for pairs in differences]
    share_cases = all(len(size) == 1 and size != {1} for size in sizes)
    is_single = all(len(pairs) == 1 for pairs in differences)
    if share_cases and (pools_seeds or len(differences) == 1):
        gained = np.concatenate([np.mean(pairs, axis=0) for pairs in differences])
        if not metric.is_share or is_single:
            return _of_cases(gained, metric, confidence_percent), "cases"
        return paired.of_averaged_shares(gained, *_signs(gained), len(gained), confidence_percent), "cases"
    gained = np.array([np.mean([values.mean() for values in pairs]) for pairs in differences])
    if not metric.is_share:
        return paired.of_runs(gained, confidence_percent), "runs"
    cases = np.concatenate([np.concatenate(pairs) for pairs in differences])
    count = len(cases) if share_cases else 0
    return paired.of_averaged_shares(gained, *_signs(cases), count, confidence_percent), "runs"


def _between(first: Columns, second: Columns, metric: Metric) -> Floats:
    """Return the differences per common case; without common cases, the difference of the means."""
    rows, other_rows = common_cases(first, second)
    before, after = metric.of(first), metric.of(second)
    return after[other_rows] - before[rows] if len(rows) else np.array([after.mean() - before.mean()])


def on_front(spent: Floats, inspected: Floats) -> NDArray[np.bool_]:
    """Return which runs are nondominated: no other spends no more, inspects no less, and is better in one."""
    no_more = spent[:, np.newaxis] >= spent
    no_less = inspected[:, np.newaxis] <= inspected
    better = (spent[:, np.newaxis] > spent) | (inspected[:, np.newaxis] < inspected)
    return np.asarray(~np.any(no_more & no_less & better, axis=1))
