"""Where free motion leads after the pushes of a plan, if all thrusters fail, and after its end.

On a circle and on a true course it is linear in constants that pushes change; oblateness, drag and eccentric
orbits are in the rows of a `Tail`, which `pipeline.flight.fly.drift` makes.
"""

import numpy as np

from fis_tools.compiled.decorator import compiled
from pipeline.array_types import Floats
from pipeline.flight.fly.foresight import Outlook, Tail, num_periods, sample_of


@compiled(error_model="numpy")
def longest_of(genes: Floats, num_pushes: int, push: int, outlook: Outlook) -> int:
    """Return how many control periods a push takes: the most along any axis, and 1 of nothing."""
    longest, most_force = 1, min(outlook.most_force, outlook.tail.most_force)
    for axis in range(3):
        force = genes[3 * push + axis]
        if abs(force) >= outlook.least_force:
            longest = max(longest, num_periods(force, most_force))
    return longest


@compiled(error_model="numpy")
def num_doubts(tail: Tail, num_pushes: int) -> int:
    """Return how many deviations of pushes there are: along each axis, none of thrusters without errors."""
    return 3 * num_pushes if tail.scale_doubt + tail.tilt_doubt > 0.0 else 0


@compiled(error_model="numpy")
def follow_pushes(
    genes: Floats, num_pushes: int, outlook: Outlook, period: int, constants: Floats, doubts: Floats
) -> None:
    """Write the constants of free motion after what the pushes of a plan fire before a control period.

    Columns of `doubts`, see `num_doubts`, are what a deviation of each push along each axis adds to them.
    """
    tail, kicks = outlook.tail, outlook.tail.kicks
    until, last = max(0, period), max(0, len(kicks) - 1)  # of C it is proved that no index is below 0
    stop = min(until, last)
    most_force = min(outlook.most_force, tail.most_force)
    for q in range(6):
        constants[q] = tail.constants[q]
        for column in range(doubts.shape[1]):
            doubts[q, column] = 0.0
    for push in range(num_pushes):
        begin = outlook.step * sample_of(genes, num_pushes, push, len(outlook.free))
        square, longest = 0.0, 1
        for axis in range(3 if begin < period else 0):
            force = genes[3 * push + axis]
            if abs(force) >= outlook.least_force:
                periods = num_periods(force, most_force)
                end = min(begin + periods, stop)
                for q in range(6):
                    constants[q] += (kicks[end, q, axis] - kicks[begin, q, axis]) * force / periods
                square, longest = square + force * force, max(longest, periods)
        if doubts.shape[1] > 0 and square > 0.0:
            end = min(begin + longest, stop)
            for axis in range(3):
                force = genes[3 * push + axis]
                along = force * force if abs(force) >= outlook.least_force else 0.0
                wrong = np.sqrt(tail.scale_doubt * along + tail.tilt_doubt * (square - along)) / longest
                for q in range(6):
                    doubts[q, 3 * push + axis] = (kicks[end, q, axis] - kicks[begin, q, axis]) * wrong


@compiled(error_model="numpy")
def doubt_along(tail: Tail, j: int, doubts: Floats) -> float:
    """Return how far along the track free motion may be off at a row of a tail, m."""
    square = tail.doubts[j]
    for column in range(doubts.shape[1]):
        off = 0.0
        for q in range(6):
            off += tail.rows[j, 1, q] * doubts[q, column]
        square += off * off
    return np.sqrt(square)


@compiled(error_model="numpy")
def reach_of(
    tail: Tail, first: int, last: int, constants: Floats, doubts: Floats, is_certain: bool
) -> tuple[float, float, float]:
    """Return the least and the greatest distance of free motion at rows of a tail, and the least in doubt, m.

    Errors of estimates and thrusters grow along the track: unless it `is_certain`, they bring the deputy
    nearer there.
    """
    near_square, far_square, nearer_square = np.inf, 0.0, np.inf
    count = len(tail.rows)
    for j in range(max(0, min(first, count)), max(0, min(last + 1, count))):
        across, ahead, doubt = 0.0, 0.0, 0.0
        if not is_certain:
            doubt = doubt_along(tail, j, doubts)
        for axis in range(3):
            along = tail.offsets[j, axis]
            for q in range(6):
                along += tail.rows[j, axis, q] * constants[q]
            if axis == 1:
                ahead = abs(along)
            else:
                across += along * along
        square, near = across + ahead * ahead, max(0.0, ahead - doubt)
        near_square, far_square = min(near_square, square), max(far_square, square)
        nearer_square = min(nearer_square, across + near * near)
    return np.sqrt(near_square), np.sqrt(far_square), np.sqrt(nearer_square)


@compiled(error_model="numpy")
def outside_later(
    genes: Floats, num_pushes: int, outlook: Outlook, constants: Floats, doubts: Floats
) -> tuple[float, float]:
    """Return how far outside the limits free motion leads after a plan's pushes, and after the end, m.

    The last two are working space, (6,) and (6, num_doubts).

    After each push the thrusters may fail, at any time up to the next one, or up to the end, and within one
    after each control period. It is the most of all these, and the sum of what errors may add after each
    push.
    """
    tail, last, worst, doubtful = outlook.tail, len(outlook.tail.kicks) - 1, 0.0, 0.0
    num_samples = len(outlook.free)
    if len(tail.rows) == 0:
        return worst, doubtful
    for push in range(num_pushes if tail.num_passive > 0 else 0):
        begin = outlook.step * sample_of(genes, num_pushes, push, num_samples)
        longest = 1
        if tail.most_force < np.inf:
            longest = longest_of(genes, num_pushes, push, outlook)
        for fired in range(1, longest + 1):
            end, is_last = begin + fired, fired == longest
            following = last if is_last else end
            for other in range(num_pushes if is_last else 0):
                at = outlook.step * sample_of(genes, num_pushes, other, num_samples)
                if end <= at < following:
                    following = at
            follow_pushes(genes, num_pushes, outlook, end, constants, doubts)
            first = int(np.ceil(end / tail.spacing))
            until = int(np.ceil(following / tail.spacing)) + tail.num_passive
            near, _, nearer = reach_of(tail, first, until, constants, doubts, not is_last)
            outside = max(0.0, outlook.nearest - near)
            worst = max(worst, outside)
            if is_last:
                doubtful = doubtful + max(0.0, outlook.nearest - nearer) - outside
    if tail.num_after > 0:
        follow_pushes(genes, num_pushes, outlook, last, constants, doubts)
        end = int(np.ceil(last / tail.spacing))
        near, far, _ = reach_of(tail, end, end + tail.num_after, constants, doubts, True)
        worst = max(worst, outlook.nearest - near, far - outlook.farthest)
    return worst, doubtful
