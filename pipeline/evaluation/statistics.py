"""Statistics of many flights, and of the differences between runs on their common cases."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.array_types import Floats
from pipeline.settings.start_table import POSITION, VELOCITY


@dataclass(frozen=True)
class Statistic:
    """A mean with its spread: standard deviation (ddof = 1) and confidence interval of the mean."""

    mean: float
    standard_deviation: float
    minimum: float
    maximum: float
    low: float
    high: float


@dataclass(frozen=True)
class Fraction:
    """A share of cases with its Wilson interval."""

    count: int
    fraction: float
    low: float
    high: float


def statistic(values: Floats, confidence_percent: float) -> Statistic:
    """Return the statistics of a sample of at least one value; the interval of the mean is Student's t."""
    values = np.asarray(values, dtype=np.float64)
    spread = float(values.std(ddof=1)) if len(values) > 1 else 0.0
    mean = float(values.mean())
    reach = _half_width(values, confidence_percent) if len(values) > 1 else 0.0
    return Statistic(mean, spread, float(values.min()), float(values.max()), mean - reach, mean + reach)


def _half_width(values: Floats, confidence_percent: float) -> float:
    """Return half the width of Student's t interval of the mean of at least two values."""
    from scipy.special import stdtrit  # noqa: PLC0415 - slower to import than a thousand flights

    number = len(values)
    quantile = float(stdtrit(number - 1, 0.5 + confidence_percent / 200.0))
    return quantile * float(values.std(ddof=1)) / math.sqrt(number)


def fraction(is_so: NDArray[np.bool_], confidence_percent: float) -> Fraction:
    """Return the share of true values, with the interval of Wilson (J. Am. Stat. Assoc. 22, 1927)."""
    count, number = int(np.sum(is_so)), len(is_so)
    z = _z(confidence_percent)
    share = count / number
    scale = 1.0 + z * z / number
    middle = (share + z * z / (2 * number)) / scale
    reach = z / scale * math.sqrt(share * (1.0 - share) / number + z * z / (4.0 * number * number))
    # the interval contains the share; at 0 and 1 rounding must not exclude it
    low, high = min(share, middle - reach), max(share, middle + reach)
    return Fraction(count, share, max(0.0, low), min(1.0, high))


@dataclass(frozen=True)
class Percentile:
    """A value that a share of all flights does not exceed, with a distribution-free interval.

    Parameters
    ----------
    percent : float
    value : float
        Of the sample.
    low, high : float, optional
        None if the sample is too small.
    """

    percent: float
    value: float
    low: float | None
    high: float | None


@dataclass(frozen=True)
class Correlation:
    """Spearman's rank correlation with its interval."""

    value: float
    low: float
    high: float


def percentile(values: Floats, percent: float, confidence_percent: float) -> Percentile:
    """Return a percentile by order statistics: the number of values below it is binomial.

    Each tail of the interval has half of the remaining probability (Hanson and Beard,
    NASA/TP-2010-216447; Wilks, Ann. Math. Stat. 12, 1941).
    """
    ordered, share, number = np.sort(values), percent / 100.0, len(values)
    tail = 0.5 - confidence_percent / 200.0
    # P(fewer than r of n lie below the percentile) is at most the tail, for the greatest such r; and so above
    below = binomial_quantile(tail, number, share)
    above = binomial_quantile(1.0 - tail, number, share) + 1
    value = float(np.quantile(ordered, share, method="inverted_cdf"))
    low = float(ordered[below - 1]) if below >= 1 else None
    return Percentile(percent, value, low, float(ordered[above - 1]) if above <= number else None)


def binomial_quantile(probability: float, number: int, share: float) -> int:
    """Return the quantile of a binomial distribution."""
    # as `scipy.stats.binom.ppf` computes it, which takes half a second to import
    from scipy.special import bdtr, bdtrik  # noqa: PLC0415 - slower to import than a thousand flights

    count = math.ceil(bdtrik(probability, number, share))
    return count - 1 if count > 0 and bdtr(count - 1, number, share) >= probability else count


def rank_correlation(first: Floats, second: Floats, confidence_percent: float) -> Correlation:
    """Return Spearman's correlation, zero if one of the two is constant.

    Its interval is by Fisher's transformation, with the variance of Bonett and
    Wright (Psychometrika 65, 2000).
    """
    from scipy.stats import rankdata  # noqa: PLC0415 - as in `binomial_quantile`

    ranks = [rankdata(values) - (len(values) + 1) / 2.0 for values in (first, second)]
    spread = math.sqrt(float(ranks[0] @ ranks[0]) * float(ranks[1] @ ranks[1]))
    value = float(ranks[0] @ ranks[1]) / spread if spread > 0.0 else 0.0
    if len(first) < 4:
        return Correlation(value, -1.0, 1.0)
    reach = _z(confidence_percent) * math.sqrt((1.0 + value * value / 2.0) / (len(first) - 3))
    middle = math.atanh(max(-1.0 + 1e-12, min(1.0 - 1e-12, value)))
    return Correlation(value, math.tanh(middle - reach), math.tanh(middle + reach))


def _z(confidence_percent: float) -> float:
    """Return the standard normal quantile of a two-sided confidence."""
    from scipy.special import ndtri  # noqa: PLC0415 - slower to import than a thousand flights

    return float(ndtri(0.5 + confidence_percent / 200.0))


Column = NDArray[Any]
Columns = Mapping[str, Column]

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


def percentiles(episodes: Columns, confidence_percent: float) -> dict[str, list[dict[str, Any]]]:
    """Return percentiles with intervals by column, see `PERCENTS`."""
    return {
        name: [asdict(percentile(episodes[name], percent, confidence_percent)) for percent in percents]
        for name, percents in PERCENTS.items()
    }


def sensitivity(episodes: Columns, keys: Sequence[str], confidence_percent: float) -> list[dict[str, Any]]:
    """Rank dispersed settings by their correlation with delta-v and rate.

    Returns
    -------
    list of dict
        ``key``, and by `RANKED` the rank correlation with its interval; the strongest first.
    """
    entries = []
    for key in keys:
        entry: dict[str, Any] = {"key": key}
        for name in RANKED:
            entry[name] = asdict(rank_correlation(episodes[key], episodes[name], confidence_percent))
        entries.append(entry)
    return sorted(entries, key=lambda entry: -max(abs(entry[name]["value"]) for name in RANKED))


def percent_ahead(delta_v_m_s: Floats | float, ahead_m_s: Floats | float) -> float:
    """Return which share of the fuel of flights was chosen ahead, by foresight or rehearsals, in per cent."""
    ahead = float(np.sum(ahead_m_s))
    return min(100.0, 100.0 * ahead / float(np.sum(delta_v_m_s))) if ahead > 0.0 else 0.0


def by_rules(percent: float) -> str:
    """Return which share of the fuel rules fired, in words, where some was chosen ahead, in per cent."""
    return f", {100.0 - percent:.1f} % of it by rules" if percent > 0.0 else ""


def succeeds(episodes: Columns) -> NDArray[np.bool_]:
    """Return which flights succeed: they inspect enough, and stay inside the limits."""
    return np.asarray(episodes["success"]) & ~np.asarray(episodes["violated"])


#: columns that identify a case's start: cases that share them are the same case
START = (*POSITION, *VELOCITY, "sun_angle_rad", "sun_elevation_rad")


@dataclass(frozen=True)
class Metric:
    """A quantity to compare runs by: its column in an evaluation, its words, and whether less is better."""

    name: str
    label: str
    unit: str
    is_less_better: bool
    decimals: int

    @property
    def most(self) -> float:
        """The largest difference that there can be."""
        return 100.0 if self.unit == "%" else math.inf

    def of(self, episodes: Columns) -> Floats:
        """Return the metric's value in each case, (n,); that of a share is 0 or 100 %."""
        column = succeeds(episodes) if self.name == "success" else episodes[self.name]
        return np.asarray(column * (100.0 if column.dtype == np.bool_ else 1.0), dtype=np.float64)


METRICS = (
    Metric("delta_v_m_s", "delta-v", "m/s", True, 4),
    Metric("inspection_rate_percent", "inspection rate", "%", False, 2),
    Metric("success", "successful", "%", False, 2),  # inside the limits
    Metric("violated", "outside the limits", "%", True, 2),
)


@dataclass(frozen=True)
class PairedDifference:
    """A mean difference with its Student's t interval, and the number of pairs.

    Parameters
    ----------
    mean, low, high : float
        The interval is NaN for a single pair.
    count : int
    """

    mean: float
    low: float
    high: float
    count: int

    @property
    def excludes_zero(self) -> bool:
        """Whether the interval excludes zero."""
        return self.low > 0.0 or self.high < 0.0

    def in_words(self, decimals: int) -> str:
        """Return the mean with its interval, each with its sign and a number of decimals."""
        return f"{self.mean:+.{decimals}f} ({self.low:+.{decimals}f} to {self.high:+.{decimals}f})"


def difference(values: Floats, confidence_percent: float, most: float = math.inf) -> PairedDifference:
    """Return the mean and interval of paired differences, at least one; none can be larger than `most`."""
    mean, number = float(values.mean()), len(values)
    if number < 2:
        return PairedDifference(mean, math.nan, math.nan, number)
    reach = _half_width(values, confidence_percent)
    return PairedDifference(mean, max(mean - reach, -most), min(mean + reach, most), number)


def common_cases(first: Columns, second: Columns) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the rows of the cases that two evaluations share, bit-identical in `START`."""

    def keys(episodes: Columns) -> list[bytes]:
        count = len(episodes["case"])
        zeros = np.zeros(count)  # earlier versions had no elevation
        starts = np.column_stack([episodes.get(name, zeros) for name in START])
        return [row.tobytes() for row in np.ascontiguousarray(starts, dtype=np.float64)]

    row_of = {key: row for row, key in enumerate(keys(second))}
    pairs = [(row, row_of.pop(key)) for row, key in enumerate(keys(first)) if key in row_of]
    rows = np.array(pairs, dtype=np.int64).reshape(-1, 2)
    return rows[:, 0], rows[:, 1]


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
    p_value : float
        By Wilcoxon's signed-rank test, for shares by McNemar's exact
        test; 1 if no case differs.
    """

    metric: Metric
    means: tuple[float, float]
    difference: PairedDifference
    better: int
    worse: int
    p_value: float


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
        above, below = int(np.sum(gained > 0.0)), int(np.sum(gained < 0.0))
        better, worse = (below, above) if metric.is_less_better else (above, below)
        test = _mcnemar(above, below) if first[metric.name].dtype == np.bool_ else _wilcoxon(gained)
        means = float(before.mean()), float(after.mean())
        results.append(
            Compared(metric, means, difference(gained, confidence_percent, metric.most), better, worse, test)
        )
    return results


def _mcnemar(above: int, below: int) -> float:
    """Return McNemar's exact p-value (Psychometrika 12, 1947): discordant pairs are like fair coin tosses."""
    from scipy.stats import binom  # noqa: PLC0415 - as above

    return min(1.0, 2.0 * float(binom.cdf(min(above, below), above + below, 0.5)))


def _wilcoxon(gained: Floats) -> float:
    """Return the p-value of Wilcoxon's signed-rank test; 1 where nothing differs."""
    from scipy.stats import wilcoxon  # noqa: PLC0415 - as above

    return float(wilcoxon(gained, axis=None).pvalue) if np.any(gained) else 1.0


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
    """

    factor: str
    level: str
    baseline: str
    metric: Metric
    difference: PairedDifference
    unit: str


Flown = tuple[Mapping[str, str], Columns]


def effects(runs: Sequence[Flown], confidence_percent: float, *, pools_seeds: bool = False) -> list[Effect]:
    """Return the effect of each factor of a sweep.

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
    for factor in dict.fromkeys(name for levels, _ in runs for name in levels):
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
                    of_seeds.setdefault(dict(rest).get("seed", ""), []).append(pair)
            for metric in METRICS if of_seeds else ():
                gained, unit = _gained(list(of_seeds.values()), metric, pools_seeds)
                gain = difference(gained, confidence_percent, metric.most)
                results.append(Effect(factor, level, baseline, metric, gain, unit))
    return results


def _gained(
    of_seeds: Sequence[Sequence[tuple[Columns, Columns]]], metric: Metric, pools_seeds: bool
) -> tuple[Floats, str]:
    """Return differences per seed, or per common case if seeds are pooled or there is one; and which.

    Pairs of runs of the same seed fly the same cases, so only their mean counts.
    """
    differences = [[_between(*pair, metric) for pair in pairs] for pairs in of_seeds]
    sizes = [{len(values) for values in pairs} for pairs in differences]
    share_cases = all(len(size) == 1 and size != {1} for size in sizes)
    if share_cases and (pools_seeds or len(differences) == 1):
        return np.concatenate([np.mean(pairs, axis=0) for pairs in differences]), "cases"
    return np.array([np.mean([values.mean() for values in pairs]) for pairs in differences]), "runs"


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
