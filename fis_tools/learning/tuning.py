"""Peaks of terms moved until an error no longer falls, by compass search.

Peaks lie on hundredths of a range, in order and a few of them apart; so the search is over whole numbers, and
tries each peak to either side by ever smaller steps (T. G. Kolda, R. M. Lewis and V. Torczon, SIAM Review 45,
2003). Nothing is drawn: the same table gives the same system.
"""

from collections.abc import Callable, Sequence

from fis_tools.learning.partition import Partition

#: By how many hundredths of a range peaks are moved, one size after the other.
STRIDES = (16, 8, 4, 2, 1)

Partitions = tuple[Partition, ...]


def tuned(partitions: Sequence[Partition], error: Callable[[Partitions], float]) -> Partitions:
    """Return partitions of which no single step of a peak has a lower error.

    Parameters
    ----------
    partitions : sequence of Partition
        Where to begin.
    error : callable
        What is to be low.
    """
    best = tuple(partitions)
    lowest = error(best)
    for stride in STRIDES:
        is_better = True
        while is_better:
            is_better = False
            for where, index in _inner_peaks(best):
                for steps in (stride, -stride):
                    moved = best[where].moved(index, steps)
                    if moved is None:
                        continue
                    tried = (*best[:where], moved, *best[where + 1 :])
                    found = error(tried)
                    if found < lowest:
                        best, lowest, is_better = tried, found, True
                        break
    return best


def _inner_peaks(partitions: Partitions) -> list[tuple[int, int]]:
    return [
        (where, index)
        for where, partition in enumerate(partitions)
        for index in range(1, len(partition.places) - 1)
    ]
