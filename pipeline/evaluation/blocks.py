"""Statistics of more flights than memory should hold, of rows that come in blocks.

All blocks but the last have `pipeline.settings.sizes.BLOCK_ROWS` rows, however the flights were shared out:
results do not depend on it. Those of one block are what `pipeline.evaluation.statistics` computes.
"""

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.array_types import Floats
from pipeline.evaluation import statistics
from pipeline.evaluation.statistics import (
    PERCENTS,
    Column,
    Columns,
    Fraction,
    Percentile,
    Statistic,
    binomial_quantile,
    share_of,
)
from pipeline.run import tables
from pipeline.settings.sizes import BLOCK_ROWS

#: the statistics of a block, after its number of rows
Part = tuple[int, Statistic]
#: returns the ranks of the ends of a percentile's interval, of the number of values, its share and confidence
Ranks = Callable[[int, float, float], tuple[int, int]]
#: bits of a number that one pass over all blocks decides
DIGIT_BITS = 16


class _Rows(Mapping[str, Column]):
    """Some rows of columns."""

    def __init__(self, whole: Columns, rows: slice) -> None:
        self._whole, self._rows = whole, rows

    def __getitem__(self, name: str) -> Column:
        return self._whole[name][self._rows]

    def __contains__(self, name: object) -> bool:
        return name in self._whole

    def __iter__(self) -> Iterator[str]:
        return iter(self._whole)

    def __len__(self) -> int:
        return len(self._whole)


def blocks_of(columns: Columns) -> Iterable[Columns]:
    """Return rows in blocks, of a table of a run or in memory."""
    return columns.blocks() if isinstance(columns, tables.Columns) else cut(columns)


def number_of(columns: Columns) -> int:
    """Return the number of rows of a table of flights, or of flights in memory."""
    return columns.num_rows if isinstance(columns, tables.Columns) else len(columns["case"])


def values_at(columns: Columns, name: str, rows: Sequence[int]) -> list[Any]:
    """Return a column in some rows, of a table of a run or in memory."""
    if isinstance(columns, tables.Columns):
        return columns.at(name, rows)
    return [columns[name][row].item() for row in rows]


def cut(columns: Columns) -> Iterator[Columns]:
    """Yield columns in memory as blocks."""
    number = len(columns[next(iter(columns))])
    if number <= BLOCK_ROWS:
        yield columns
        return
    for first in range(0, number, BLOCK_ROWS):
        yield _Rows(columns, slice(first, first + BLOCK_ROWS))


def joined(parts: Sequence[Part], confidence_percent: float, least: float, most: float) -> Statistic:
    """Return the statistics of a sample from those of its blocks; see `statistics.statistic`.

    Squares of deviations add up as Chan, Golub and LeVeque do it (The American Statistician 37, 1983).
    """
    if len(parts) == 1:
        return parts[0][1]
    from scipy.special import stdtrit  # noqa: PLC0415 - slower to import than a thousand flights

    number = sum(count for count, _ in parts)
    mean = math.fsum(count * of.mean for count, of in parts) / number
    within = math.fsum((count - 1) * (of.standard_deviation or 0.0) ** 2 for count, of in parts)
    between = math.fsum(count * (of.mean - mean) ** 2 for count, of in parts)
    deviation = math.sqrt((within + between) / (number - 1))
    reach = float(stdtrit(number - 1, 0.5 + confidence_percent / 200.0)) * deviation / math.sqrt(number)
    ends = min(of.minimum for _, of in parts), max(of.maximum for _, of in parts)
    return Statistic(mean, deviation, *ends, max(mean - reach, least), min(mean + reach, most))


def joined_share(parts: Iterable[tuple[int, int]], confidence_percent: float) -> Fraction:
    """Return a share with its interval, from the number of true values and of all values of each block."""
    counts, numbers = map(sum, zip(*parts, strict=True))
    return share_of(counts, numbers, confidence_percent)


def percentiles(
    blocks: Callable[[], Iterable[Columns]], confidence_percent: float, ranks: Ranks | None = None
) -> dict[str, list[Any]]:
    """Return percentiles with intervals by column, see `PERCENTS`.

    Parameters
    ----------
    blocks : callable
        Returns the blocks anew each time, for several passes.
    confidence_percent : float
    ranks : callable, optional
        Returns the ranks of the interval's ends in place of those for a fixed number of flights, as
        `pipeline.evaluation.sequential.order_ranks` does.
    """
    lengths = [len(block[next(iter(PERCENTS))]) for block in blocks()]
    if len(lengths) == 1 and ranks is None:
        return next(iter([statistics.percentiles(block, confidence_percent) for block in blocks()]))

    def column(name: str) -> Callable[[], Iterable[Floats]]:
        return lambda: (block[name] for block in blocks())

    return {
        name: [
            asdict(of)
            for of in _percentiles(column(name), sum(lengths), percents, confidence_percent, ranks or _ranks)
        ]
        for name, percents in PERCENTS.items()
    }


def _ranks(number: int, share: float, confidence_percent: float) -> tuple[int, int]:
    """Return the ranks, from 0, of the ends of a percentile's interval; see `statistics.percentile`."""
    tail = 0.5 - confidence_percent / 200.0
    return binomial_quantile(tail, number, share) - 1, binomial_quantile(1.0 - tail, number, share)


def _percentiles(
    blocks: Callable[[], Iterable[Floats]],
    number: int,
    percents: Sequence[float],
    confidence_percent: float,
    ends_of: Ranks,
) -> list[Percentile]:
    """Return percentiles of the numbers of a column; see `statistics.percentile`, which sorts them."""
    ranks = []
    for share in (percent / 100.0 for percent in percents):
        # the first as `numpy.quantile` by the method inverted_cdf
        middle = max(math.ceil(number * share - 1.0), 0)
        ranks.append((middle, *ends_of(number, share, confidence_percent)))
    inside = sorted({rank for each in ranks for rank in each if 0 <= rank < number})
    values = dict(zip(inside, selected(blocks, inside), strict=True))
    return [
        Percentile(percent, values[middle], values.get(low), values.get(high))
        for percent, (middle, low, high) in zip(percents, ranks, strict=True)
    ]


def selected(blocks: Callable[[], Iterable[Floats]], ranks: Sequence[int]) -> list[float]:
    """Return the values at ranks, from 0, of numbers in ascending order, without sorting them.

    A radix selection: each pass over the blocks counts the next `DIGIT_BITS` bits of the numbers whose first
    bits are those of a value that is sought.
    """
    begun = [(rank, 0) for rank in ranks]  # rank among the numbers that begin with these bits
    for shift in range(64 - DIGIT_BITS, -1, -DIGIT_BITS):
        counts = {begin: np.zeros(1 << DIGIT_BITS, np.int64) for _, begin in begun}
        for values in blocks():
            keys = _keys(values)
            begins = keys >> np.uint64(shift + DIGIT_BITS) if shift + DIGIT_BITS < 64 else np.zeros_like(keys)
            for begin, count in counts.items():
                digits = (keys[begins == begin] >> np.uint64(shift)) & np.uint64((1 << DIGIT_BITS) - 1)
                np.add(count, np.bincount(digits.astype(np.intp), minlength=len(count)), out=count)
        begun = [_narrowed(counts[begin], rank, begin) for rank, begin in begun]
    keys = np.array([begin for _, begin in begun], np.uint64)
    top = np.uint64(1 << 63)
    return np.where(keys & top, keys ^ top, ~keys).view(np.float64).tolist()


def _narrowed(counts: NDArray[np.int64], rank: int, begin: int) -> tuple[int, int]:
    """Return the rank among the numbers with one digit more, and the bits with that digit."""
    upto = np.cumsum(counts)
    digit = int(np.searchsorted(upto, rank, side="right"))
    return rank - int(upto[digit] - counts[digit]), begin << DIGIT_BITS | digit


def _keys(values: Floats) -> NDArray[np.uint64]:
    """Return whole numbers in the order of numbers that are finite."""
    # a zero has no sign
    bits = (np.asarray(values, dtype=np.float64) + 0.0).view(np.uint64)
    top = np.uint64(1 << 63)
    return np.where(bits & top, ~bits, bits | top)
