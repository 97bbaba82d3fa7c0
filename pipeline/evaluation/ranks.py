"""Ranks of flights that come in blocks: rows from the worst to the best, and rank correlations.

Several passes over the blocks take the place of sorting, so that memory does not grow with the flights.
"""

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import asdict
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.array_types import Floats
from pipeline.evaluation.blocks import selected
from pipeline.evaluation.statistics import (
    RANKED,
    Column,
    Columns,
    Correlation,
    correlation_ends,
    normal_quantile,
)

#: by which flights are ranked
NUM_KEYS = 3
#: returns the blocks anew each time, for several passes
Blocks = Callable[[], Iterable[Columns]]


def from_worst_to_best(blocks: Blocks, ranks: Sequence[int]) -> list[int]:
    """Return the rows at ranks, from 0, of flights from the worst to the best.

    A flight outside the limits is worse than one inside; then a smaller share of the points that can be
    inspected is worse; then more delta-v. Equal ones stay in order.
    """
    return [_row_at(blocks, rank) for rank in ranks]


def _row_at(blocks: Blocks, rank: int) -> int:
    """Return the row at a rank: what is sought is narrowed key by key."""
    sought: list[float] = []
    for key in range(NUM_KEYS):

        def alike(key: int = key) -> Iterator[Floats]:
            return (keys[key][_is_alike(keys, sought)] for keys in map(_keys, blocks()))

        (value,) = selected(alike, [rank])
        rank -= sum(int(np.count_nonzero(values < value)) for values in alike())
        sought.append(value)
    first = 0
    for keys in map(_keys, blocks()):
        rows = np.flatnonzero(_is_alike(keys, sought))
        if rank < len(rows):
            return first + int(rows[rank])
        rank, first = rank - len(rows), first + len(keys[0])
    raise IndexError("there are fewer flights")


def _keys(episodes: Columns) -> list[Floats]:
    """Return what flights are ranked by, the first before the others; less is worse."""
    # missing in earlier versions
    rate = "inspectable_rate_percent" if "inspectable_rate_percent" in episodes else "inspected_count"
    keys = (~episodes["violated"].astype(np.bool_), episodes[rate], -episodes["delta_v_m_s"])
    return [np.asarray(key, dtype=np.float64) for key in keys]


def _is_alike(keys: Sequence[Floats], sought: Sequence[float]) -> NDArray[np.bool_]:
    """Return which rows have the first keys that are sought."""
    is_alike = np.ones(len(keys[0]), dtype=np.bool_)
    for values, value in zip(keys, sought, strict=False):
        is_alike &= values == value
    return is_alike


def sensitivity(blocks: Blocks, keys: Sequence[str], confidence_percent: float) -> list[dict[str, Any]]:
    """Rank dispersed settings by their correlation with delta-v and rate.

    Returns
    -------
    list of dict
        ``key``, and by `RANKED` the rank correlation with its interval; the strongest first.
    """
    pairs = [(key, name) for key in keys for name in RANKED]
    correlations = dict(zip(pairs, rank_correlations(blocks, pairs, confidence_percent), strict=True))
    entries = [{"key": key} | {name: asdict(correlations[key, name]) for name in RANKED} for key in keys]
    return sorted(entries, key=lambda entry: -max(abs(entry[name]["value"]) for name in RANKED))


def rank_correlations(
    blocks: Blocks, pairs: Sequence[tuple[str, str]], confidence_percent: float
) -> list[Correlation]:
    """Return Spearman's correlations of pairs of columns, zero where one of the two is constant.

    Intervals are by Fisher's transformation, with the variance of Bonett and Wright (Psychometrika 65, 2000).
    Beyond one block, numbers between two neighbours of a sample of about `BLOCK_ROWS` rows count as equal.
    They are so few that correlations change by less than a millionth.
    """
    names = list(dict.fromkeys(name for pair in pairs for name in pair))
    every = sum(1 for _ in blocks())
    samples = {name: [block[name][::every] for block in blocks()] for name in names}
    ranking = {name: _MidRanks(np.concatenate(samples.pop(name))) for name in names}
    number = 0
    for block in blocks():
        for name, of in ranking.items():
            of.count(block[name])
        number += len(block[names[0]]) if names else 0
    sums: dict[tuple[str, str], list[float]] = {}
    for block in blocks():
        ranks = {name: of.centred(block[name]) for name, of in ranking.items()}
        for pair in dict.fromkeys([*pairs, *((name, name) for name in names)]):
            sums.setdefault(pair, []).append(float(ranks[pair[0]] @ ranks[pair[1]]))
    total = {pair: math.fsum(of) for pair, of in sums.items()}
    quantile = normal_quantile(confidence_percent)
    correlations = []
    for first, second in pairs:
        spread = math.sqrt(total[first, first] * total[second, second])
        value = total[first, second] / spread if spread > 0.0 else 0.0
        correlations.append(Correlation(value, *correlation_ends(value, number, quantile)))
    return correlations


class _MidRanks:
    """The ranks of a column's numbers among all, the mean of theirs for equal ones.

    Parameters
    ----------
    sample : (m,)
        Numbers of the column. Others between two neighbours count as equal.
    """

    def __init__(self, sample: Column) -> None:
        self._edges = np.unique(sample)
        self._counts = np.zeros(2 * len(self._edges) + 1, dtype=np.int64)

    def _bins(self, values: Column) -> NDArray[np.intp]:
        """Return the bin of each number: odd ones hold the numbers of the sample, even ones those between."""
        return np.searchsorted(self._edges, values, "left") + np.searchsorted(self._edges, values, "right")

    def count(self, values: Column) -> None:
        """Count the numbers of a block."""
        self._counts += np.bincount(self._bins(values), minlength=len(self._counts))

    def centred(self, values: Column) -> Floats:
        """Return the ranks of a block's numbers less the mean of all, once all are counted."""
        upto = np.cumsum(self._counts)
        middle = upto - (self._counts - 1) / 2.0 - (upto[-1] + 1) / 2.0
        return np.asarray(middle[self._bins(values)], dtype=np.float64)
