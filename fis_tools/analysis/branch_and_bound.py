"""Branch and bound: the greatest value over a region of inputs, between a value found and a proved bound.

The box that promises most is split next, at the middle of the input whose memberships vary most over it.
Nothing is random, and ties go to the older box, so that the same search always takes the same way.
"""

import time
from collections.abc import Callable
from dataclasses import dataclass
from heapq import heappop, heappush

import numpy as np

from fis_tools.analysis.condition import Region
from fis_tools.array_types import Floats
from fis_tools.engines import bounded_trees, interval
from fis_tools.engines.bounded_trees import SMALLEST_VARIATION, TreeProgram
from fis_tools.engines.program import Program

#: From least and greatest outputs, (n, num_outputs), to the most that they may be worth, (n,).
Promise = Callable[[Floats, Floats], Floats]
#: Called with the number of boxes looked at and how many of them are open.
Progress = Callable[[int, int], None]
#: By how much, relative to 1 or more, what inputs are worth may exceed a promise by how sums are rounded.
ROUNDING = 1e-12
#: Boxes that are split together.
BATCH = 128


@dataclass(frozen=True)
class Subdivision:
    """The result of a branch-and-bound search.

    Parameters
    ----------
    best : float
        The most that any input tried is worth; minus infinity where none was.
    best_inputs : (num_inputs,)
        This input.
    num_boxes : int
        How many boxes were bounded.
    closed : float
        No input of the boxes that were given up is worth more.
    open_low, open_high : (n, num_inputs)
        The boxes that are left.
    open_promises : (n,)
        The most that these may be worth.
    refuted_low, refuted_high : (m, num_inputs)
        The boxes that promise less than the floor; with those left, they cover the region.
    """

    best: float
    best_inputs: Floats
    num_boxes: int
    closed: float
    open_low: Floats
    open_high: Floats
    open_promises: Floats
    refuted_low: Floats
    refuted_high: Floats


def subdivide(
    system: Program | TreeProgram,
    region: Region,
    promise: Promise,
    *,
    floor: float = -np.inf,
    goal: float = np.inf,
    tolerance: float = -np.inf,
    max_boxes: int,
    max_seconds: float = np.inf,
    progress: Progress | None = None,
) -> Subdivision:
    """Search a region for the input whose outputs have the greatest value.

    Parameters
    ----------
    system : Program
        What `fis_tools.engines.bounded_trees.pack` returns.
    region : Region
        Where to search.
    promise : callable
        From bounds of the outputs over boxes to the most they may be worth there.
    floor : float
        Boxes that promise less are given up.
    goal : float
        The search ends when an input is worth this.
    tolerance : float
        Boxes that promise no more than this above the best input are given up.
    max_boxes : int
        The search ends when this many boxes have been bounded.
    max_seconds : float
        The search ends after this time.
    progress : callable, optional
        Told how it goes on.

    Raises
    ------
    fis_tools.engines.interval.NotBounded
        If an input tried in a box is worth more than the box promises, so that bounds do not hold.
    """
    ends = time.monotonic() + max_seconds
    low, high = region.low[np.newaxis], region.high[np.newaxis]
    best, best_inputs, closed, num_boxes, order = -np.inf, region.low, -np.inf, 0, 0
    waiting: list[tuple[float, int, Floats, Floats, Floats]] = []
    whole: list[tuple[float, Floats, Floats]] = []
    refuted: list[tuple[Floats, Floats]] = []
    while len(low) or waiting:
        least, greatest, variation = bounded_trees.bound(system, low, high)
        promises = np.nan_to_num(promise(least, greatest), nan=-np.inf)  # no rule fires: nothing is promised
        num_boxes += len(low)
        worth, inputs = _try(system, region, promise, low, high, promises)
        if worth > best:
            best, best_inputs = worth, inputs
        for row in np.flatnonzero(promises >= floor):
            heappush(waiting, (-promises[row], order, low[row], high[row], variation[row]))
            order += 1
        is_below = promises < floor
        closed = max(closed, promises[is_below].max(initial=-np.inf))
        refuted.append((low[is_below], high[is_below]))
        if best >= goal or num_boxes >= max_boxes or time.monotonic() > ends:
            break
        unsplit = max((promised for promised, _, _ in whole), default=-np.inf)
        if tolerance > -np.inf and waiting and unsplit >= -waiting[0][0]:
            break  # a box that cannot be split promises more than all others: no split lowers the result
        if progress is not None:
            progress(num_boxes, len(waiting))
        chosen: list[tuple[Floats, Floats, int]] = []
        while waiting and len(chosen) < BATCH:
            negated, _, one_low, one_high, varies = heappop(waiting)
            if -negated <= best + tolerance:
                closed = max(closed, -negated)
            elif (index := _index_to_split(one_low, one_high, varies)) is None:
                whole.append((-negated, one_low, one_high))
            else:
                chosen.append((one_low, one_high, index))
        low, high = _halves(chosen, low.shape[1])
        meets = region.may_meet(low, high)
        low, high = low[meets], high[meets]
    left = [*whole, *((-negated, low, high) for negated, _, low, high, _ in waiting)]
    closed = max([closed, *(entry[0] for entry in left if entry[0] <= best + tolerance)])
    left = [entry for entry in left if entry[0] > best + tolerance]
    shape = (len(left), len(region.low))
    opened = [np.array([entry[end] for entry in left]).reshape(shape) for end in (1, 2)]
    promises = np.array([value for value, _, _ in left])
    below = [np.concatenate(side) for side in zip(*refuted, strict=True)]
    boxes = (opened[0], opened[1], promises, below[0], below[1])
    return Subdivision(best, best_inputs, num_boxes, closed, *boxes)


def _try(
    system: Program | TreeProgram,
    region: Region,
    promise: Promise,
    low: Floats,
    high: Floats,
    promises: Floats,
) -> tuple[float, Floats]:
    """Evaluate the middle and two corners of each box; return the greatest value and its input.

    None may be worth more than its box promises.
    """
    points = np.concatenate([0.5 * low + 0.5 * high, low, high])
    held = region.holds(points)
    points, promises = points[held], np.tile(promises, 3)[held]
    if not len(points):
        return -np.inf, region.low
    outputs = bounded_trees.evaluate(system, points)
    worth = np.nan_to_num(promise(outputs, outputs), nan=-np.inf)
    is_broken = worth - ROUNDING * np.maximum(1.0, np.abs(worth)) > promises
    if is_broken.any():
        raise interval.NotBounded(broken(points[np.argmax(is_broken)], outputs[np.argmax(is_broken)]))
    best = int(np.argmax(worth))
    return float(worth[best]), points[best]


def broken(inputs: Floats, outputs: Floats) -> str:
    """Return a sentence on outputs that lie outside of their bounds."""
    return (
        f"at the inputs {inputs.tolist()} the outputs are {outputs.tolist()}, beyond what was bounded: this "
        "is a mistake of the program, so it says nothing; please report it with the controller"
    )


def _index_to_split(low: Floats, high: Floats, variation: Floats) -> int | None:
    """Return the input to split: of those that can be split, the one along which the outputs vary most."""
    middle = 0.5 * low + 0.5 * high
    varies = np.where((low < middle) & (middle < high), variation, 0.0)
    index = int(np.argmax(varies))
    return index if varies[index] > SMALLEST_VARIATION else None


def _halves(boxes: list[tuple[Floats, Floats, int]], num_inputs: int) -> tuple[Floats, Floats]:
    """Split boxes into halves."""
    low = np.array([box[0] for box in boxes]).reshape(-1, num_inputs)
    high = np.array([box[1] for box in boxes]).reshape(-1, num_inputs)
    indices = np.array([box[2] for box in boxes], dtype=np.int64)
    rows = np.arange(len(boxes))
    middle = 0.5 * low[rows, indices] + 0.5 * high[rows, indices]
    left_high, right_low = high.copy(), low.copy()
    left_high[rows, indices] = right_low[rows, indices] = middle
    return np.concatenate([low, right_low]), np.concatenate([left_high, high])
