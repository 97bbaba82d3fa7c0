"""Partitions that a person can read: triangles in order, each point held by its neighbours with a sum of one.

Such a partition is called strong, or Ruspini's (E. H. Ruspini, Information and Control 15, 1969). Whatever
its peaks are, some term holds each point to one half or more, and two terms share a third of their area or
less (Jaccard's measure), so readability need not be watched while the peaks move.

Peaks are moved until an error no longer falls, by compass search. They lie on hundredths of a range, in order
and a few of them apart; so the search is over whole numbers, and tries each peak to either side by ever
smaller steps (T. G. Kolda, R. M. Lewis and V. Torczon, SIAM Review 45, 2003). Nothing is drawn: the same
table gives the same system.

The combinations of terms that a table's rows belong to, its cells, become the rules.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from fis_tools.array_types import Floats, Integers
from fis_tools.model import And, Expression, Is, Term, Triangular, Variable

#: What terms are called, from the lowest to the highest, by their number.
WORDS = {
    2: ("low", "high"),
    3: ("low", "medium", "high"),
    4: ("very_low", "low", "high", "very_high"),
    5: ("very_low", "low", "medium", "high", "very_high"),
    6: ("extremely_low", "very_low", "low", "high", "very_high", "extremely_high"),
    7: ("extremely_low", "very_low", "low", "medium", "high", "very_high", "extremely_high"),
}
#: Steps of a range. A peak lies on one of them, so that memberships are exact on the points of a universe.
STEPS = 100
#: Steps that peaks keep apart.
CLOSEST = 5


@dataclass(frozen=True)
class Partition:
    """Where the terms of a variable have their peaks.

    Parameters
    ----------
    low, high : float
        The range; the first and the last peak lie at its ends.
    places : tuple of int
        The peaks in hundredths of the range, ascending.
    """

    low: float
    high: float
    places: tuple[int, ...]

    @property
    def peaks(self) -> Floats:
        """The peaks in the unit of the variable, shape (num_terms,)."""
        points = np.linspace(self.low, self.high, STEPS + 1)
        peaks: Floats = points[list(self.places)]
        return peaks

    @property
    def num_moved(self) -> int:
        """How many peaks are not where they are in an even partition."""
        evenly = even(self.low, self.high, len(self.places)).places
        return sum(mine != other for mine, other in zip(self.places, evenly, strict=True))

    def memberships(self, values: Floats) -> Floats:
        """Return how far values, (n,), belong to each term, (n, num_terms); outside as at the ends."""
        peaks = self.peaks
        return np.stack([np.interp(values, peaks, own) for own in np.eye(len(peaks))], axis=1)

    def moved(self, index: int, steps: int) -> "Partition | None":
        """Return it with an inner peak moved; None where that would come too close to another."""
        place = self.places[index] + steps
        if place - self.places[index - 1] < CLOSEST or self.places[index + 1] - place < CLOSEST:
            return None
        return replace(self, places=(*self.places[:index], place, *self.places[index + 1 :]))

    def as_input(self, name: str, unit: str) -> Variable:
        """Return the variable over the range."""
        peaks = self.peaks.tolist()
        around = [peaks[0], *peaks, peaks[-1]]
        return Variable(name, unit, self.low, self.high, _terms(around), STEPS + 1)

    def as_output(self, name: str, unit: str, default: float) -> Variable:
        """Return the variable for centroids: outer terms are whole, so that their centres are the ends."""
        before, after = self.places[1], STEPS - self.places[-2]
        num_points = before + STEPS + after + 1
        step = (self.high - self.low) / STEPS
        low, high = self.low - before * step, self.high + after * step
        points = np.linspace(low, high, num_points)
        around = points[[0, *(before + place for place in self.places), -1]].tolist()
        return Variable(name, unit, low, high, _terms(around), num_points, default=default)


def even(low: float, high: float, num_terms: int) -> Partition:
    """Return the partition whose peaks are evenly spaced, as nearly as its points allow."""
    places = np.round(np.linspace(0, STEPS, num_terms)).astype(int)
    return Partition(low, high, tuple(places.tolist()))


def range_of(values: Floats) -> tuple[float, float]:
    """Return the range of values, its ends rounded outward to two digits of its width; never empty."""
    low, high = float(values.min()), float(values.max())
    if low == high:
        half = max(0.5, abs(low) * 0.5)
        return low - half, high + half
    digits = 1 - math.floor(math.log10(high - low))
    scale = 10.0**digits
    ends = math.floor(low * scale + ROUNDING) / scale, math.ceil(high * scale - ROUNDING) / scale
    return ends if all(map(math.isfinite, ends)) and ends[0] < ends[1] else (low, high)


#: Of the last digit of a range: what rounding may have added to a value.
ROUNDING = 1e-6


def _terms(around: list[float]) -> tuple[Term, ...]:
    """Return a triangle over each point between the first and the last."""
    corners = zip(around[:-2], around[1:-1], around[2:], strict=True)
    words = WORDS[len(around) - 2]
    return tuple(Term(word, Triangular(*three)) for word, three in zip(words, corners, strict=True))


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


Places = Integers


def strongest(memberships: Sequence[Floats]) -> Places:
    """Return the term that each row belongs to most of each input, (n, num_inputs); of equals the lower.

    Parameters
    ----------
    memberships : sequence of (n, num_terms)
        Of each input.
    """
    return np.stack([degrees.argmax(axis=1) for degrees in memberships], axis=1)


def held(memberships: Sequence[Floats]) -> Places:
    """Return the combinations that some row belongs to most, (rules, num_inputs), the last input fastest."""
    return np.unique(strongest(memberships), axis=0)


def firing(memberships: Sequence[Floats], cells: Places) -> Floats:
    """Return how far each row belongs to each combination, by the product: (n, rules)."""
    strengths = memberships[0][:, cells[:, 0]]
    for degrees, terms in zip(memberships[1:], cells.T[1:], strict=True):
        strengths = strengths * degrees[:, terms]
    return strengths


def antecedent(inputs: Sequence[Variable], cell: Places) -> Expression:
    """Return what a combination says, as a rule does."""
    statements = tuple(Is(v.name, v.terms[int(term)].name) for v, term in zip(inputs, cell, strict=True))
    return statements[0] if len(statements) == 1 else And(statements)
