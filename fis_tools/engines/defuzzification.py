"""Defuzzification in plain numpy: aggregated sets as polygons, or as heights at points."""

from collections.abc import Callable

import numpy as np

from fis_tools.array_types import Floats
from fis_tools.model import TOOLS, FuzzySystem, Variable

#: scikit-fuzzy divides by the larger of the area and this.
SMALLEST_AREA = float(np.finfo(np.float64).eps)
#: Heights of sampled outputs that differ by less than this share of the highest are equal but for rounding.
TIE = 1e-12


def defuzzify_sampled(system: FuzzySystem, variable: Variable, x: Floats, y: Floats) -> float:
    """Defuzzify heights at points as another program does; `fis_tools.engines.sampling` is its fast twin.

    Return NaN where the program finds no number although some heights are positive.
    """
    method, by_magnitude = system.defuzzifier_of(variable), TOOLS[system.semantics].is_by_magnitude
    y = y / y.max()
    if method == "centroid":
        return float(np.clip((x * y).sum() / y.sum(), x[0], x[-1]))
    top = x[y >= 1.0 - TIE]
    if method == "mom":
        return float(np.mean(top))
    if method in {"som", "lom"}:
        size = np.abs(top) if by_magnitude else top
        return float(top[size.argmin() if method == "som" else size.argmax()])
    running = np.cumsum(y)
    if system.semantics == "matlab":
        return float(x[np.argmax(running >= running[-1] / 2.0 * (1.0 - TIE))])
    if system.semantics == "fuzzylite":
        distance = np.abs(running / running[-1] - 0.5)
        return float(np.mean(x[distance <= distance.min() + TIE]))
    return _meeting(x, y)


def _meeting(x: Floats, y: Floats) -> float:
    """Return where walks meet, always on the side with the smaller sum; NaN if the lower one's is zero."""
    low, high, sum_low, sum_high = 0, len(x) - 1, 0.0, 0.0
    while low < high:
        if sum_low <= sum_high * (1.0 + TIE):
            low += 1
            sum_low += y[low]
        else:
            high -= 1
            sum_high += y[high]
    return float(min(x[0] + (x[1] - x[0]) * low, x[-1])) if sum_low > 0.0 else np.nan


def crossings(grid: Floats, mf: Floats, cut: float) -> Floats:
    """Return the points where a membership function crosses its cut between two points of the grid."""
    reaches = mf > cut if cut == 0.0 else mf >= cut
    i = np.flatnonzero(reaches[1:] != reaches[:-1])
    return grid[i] + (cut - mf[i]) * (grid[i + 1] - grid[i]) / (mf[i + 1] - mf[i])


def _centroid(x: Floats, y: Floats) -> float:
    """Return the centre of area of a polygon, summed segment by segment."""
    moment, area = 0.0, 0.0
    for x1, x2, y1, y2 in zip(x[:-1], x[1:], y[:-1], y[1:], strict=True):
        if x1 == x2 or y1 == y2 == 0.0:
            continue
        width = x2 - x1
        if y1 == y2:
            segment_centre, segment = 0.5 * (x1 + x2), width * y1
        elif y1 == 0.0:
            segment_centre, segment = 2.0 / 3.0 * width + x1, 0.5 * width * y2
        elif y2 == 0.0:
            segment_centre, segment = 1.0 / 3.0 * width + x1, 0.5 * width * y1
        else:
            segment_centre = (2.0 / 3.0 * width * (y2 + 0.5 * y1)) / (y1 + y2) + x1
            segment = 0.5 * width * (y1 + y2)
        moment += segment_centre * segment
        area += segment
    return float(moment / np.fmax(area, SMALLEST_AREA))


def _bisector(x: Floats, y: Floats) -> float:
    """Return the point with half of the area on either side.

    scikit-fuzzy takes the area left of a segment from the segment before it, and for an empty one that is
    zero; with a gap in the polygon the result is therefore not the bisector, and may be NaN. This function
    does the same.
    """
    areas = np.zeros(len(x) - 1)
    total = 0.0
    for i, (x1, x2, y1, y2) in enumerate(zip(x[:-1], x[1:], y[:-1], y[1:], strict=True)):
        if x1 == x2 or y1 == y2 == 0.0:
            continue
        if y1 == y2:
            total += (x2 - x1) * y1
        else:
            total += 0.5 * (x2 - x1) * (y1 + y2)
        areas[i] = total
    i = int(np.flatnonzero(areas >= total / 2.0)[0])
    rest = total / 2.0 - (areas[i - 1] if i > 0 else 0.0)
    x1, x2, y1, y2 = x[i], x[i + 1], y[i], y[i + 1]
    with np.errstate(invalid="ignore", divide="ignore"):
        if y1 == y2:
            return float(rest / y1 + x1)
        if y1 == 0.0:
            return float(x1 + np.sqrt(2.0 * rest * (x2 - x1) / y2))
        if y2 == 0.0:
            return float(x2 - np.sqrt((x2 - x1) * (x2 - x1) - 2.0 * rest * (x2 - x1) / y1))
        slope = (y2 - y1) / (x2 - x1)
        return float(x1 - (y1 - np.sqrt(y1 * y1 + 2.0 * slope * rest)) / slope)


DEFUZZIFIERS: dict[str, Callable[[Floats, Floats], float]] = {
    "centroid": _centroid,
    "bisector": _bisector,
    "mom": lambda x, y: float(np.mean(x[y == y.max()])),
    "som": lambda x, y: float(np.min(x[y == y.max()])),
    "lom": lambda x, y: float(np.max(x[y == y.max()])),
}
