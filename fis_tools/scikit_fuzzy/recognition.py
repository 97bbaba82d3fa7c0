"""Shapes from samples: which membership function gave these values on this universe.

Each kind of shape is estimated from what its formula makes a straight line of, and fitted; then its
parameters are set to the shortest decimals, or the nearby floating-point numbers, that give the values again.
Nothing is taken for a shape that does not give them.
"""

from collections.abc import Callable, Iterator
from itertools import product
from math import floor, log10

import numpy as np
from scipy.optimize import least_squares

from fis_tools import model
from fis_tools.array_types import Booleans, Floats
from fis_tools.model.shape_problems import shape_problems
from fis_tools.model.shapes import SMALLEST_MEMBERSHIP

Kind = type[model.MembershipFunction]
Numbers = tuple[float, ...]
Estimate = tuple[Kind, Numbers]

#: An estimate that misses the samples by more is not looked at further.
NEAR = 1e-6
#: Points of a flank that are too few to do without one.
FEW = 3
#: Decimal digits of a floating-point number.
DIGITS = 17
#: How far from an estimate, in units of its last place, a parameter is looked for.
NUDGES = 6
#: A parameter smaller than this share of the universe is known to no more places than one of this share.
SMALL = 1 / 1024


def recognise(universe: Floats, values: Floats) -> model.MembershipFunction:
    """Find the shape that gives the values on the universe, or keep the values.

    Triangles and trapezoids are preferred, then Gaussians and the rest, each only if the values say more than
    its parameters can be fitted to.

    Parameters
    ----------
    universe, values : array
        Ascending points and the memberships there, shape (num_points,).

    Returns
    -------
    MembershipFunction
        `Sampled` where nothing else gives the values, to the last bit.
    """
    samples = SampledTerm(universe, values)
    with np.errstate(all="ignore"):  # an estimate that is not a number is dropped
        for kind, parameters in _estimates(samples):
            shape = _settled(samples, kind, parameters)
            if shape is not None:
                return shape
    return model.Sampled(tuple(values.tolist()))


class SampledTerm:
    """Memberships on a universe, with the flanks to either side of the top."""

    def __init__(self, universe: Floats, values: Floats) -> None:
        self.universe = universe
        self.values = np.where(values < SMALLEST_MEMBERSHIP, 0.0, values)
        self.width = float(universe[-1] - universe[0])
        highest = np.flatnonzero(self.values == self.values.max())
        is_between = (self.values > 0.0) & (self.values < 1.0)
        indices = np.arange(len(universe))
        self.rising = is_between & (indices < highest[0])
        self.falling = is_between & (indices > highest[-1])
        # A highest point below one belongs to one of the flanks; to which, is known at the ends only.
        if highest[0] == len(universe) - 1 and self.rising.sum() < FEW:
            self.rising = is_between
        elif highest[-1] == 0 and self.falling.sum() < FEW:
            self.falling = is_between
        self.top = universe[highest[[0, -1]]] if self.values.max() == 1.0 else None
        self.num_between = int(is_between.sum())

    def misses(self, shape: model.MembershipFunction) -> Floats:
        """Return a shape's error at each value; NaN where it has no value, infinite if it is invalid."""
        if any(shape_problems(shape, len(self.values))):
            return np.full(len(self.values), np.inf)
        given = model.shape_values(self.universe, shape)
        given = np.where(given < SMALLEST_MEMBERSHIP, 0.0, given)
        return np.abs(given - self.values)


def _settled(samples: SampledTerm, kind: Kind, parameters: Numbers) -> model.MembershipFunction | None:
    """Return the shape of the simplest numbers near an estimate that gives the samples, if there is one.

    Where rounding does not find it neighbouring parameters move, two at a time and by units in their last
    place, while fewer samples are missed: the errors of a foot and a top, or of a mean and a deviation,
    belong together.
    """

    def missed(numbers: Numbers) -> int:
        return int(np.count_nonzero(samples.misses(_made(kind, numbers))))

    def moves(index: int) -> set[float]:
        unit = float(np.spacing(max(abs(best[index]), samples.width * SMALL)))
        nudged = {best[index] + nudge * unit for nudge in range(-NUDGES, NUDGES + 1)}
        return nudged.union(candidate[index] for candidate in candidates[-NUDGES:])

    if not samples.misses(_made(kind, parameters)).max() <= NEAR:
        return None
    rounded = [_rounded(kind, parameters, digits, samples.width) for digits in range(1, DIGITS + 1)]
    candidates = [*rounded, parameters]
    best = min(candidates, key=missed)
    fewest, before = missed(best), len(samples.values) + 1
    while 0 < fewest < before:
        before = fewest
        for index in range(len(best) - 1):
            for pair in product(moves(index), moves(index + 1)):
                tried = (*best[:index], *pair, *best[index + 2 :])
                if (count := missed(tried)) < fewest:
                    best, fewest = tried, count
    return None if fewest else _made(kind, best)


def _made(kind: Kind, parameters: Numbers) -> model.MembershipFunction:
    return kind(*map(float, parameters))


def _rounded(kind: Kind, parameters: Numbers, digits: int, width: float) -> Numbers:
    """Round places to digits of the universe's width, spreads and slopes to digits of their own."""
    rounded = []
    for what, value in zip(kind.entry.kinds.values(), parameters, strict=True):
        scale = width if what == "location" else abs(value)
        rounded.append(round(value, digits - 1 - floor(log10(scale))) if scale > 0 else value)
    return tuple(rounded)


def _estimates(samples: SampledTerm) -> Iterator[Estimate]:
    """Yield the shapes that may give the samples: first straight ones, then smooth ones, refined."""
    if not model.is_unimodal(samples.values):
        return
    yield from _straight(samples)
    for kind, parameters in _smooth(samples):
        if samples.num_between > len(parameters) and np.isfinite(parameters).all():
            yield kind, _fitted(samples, kind, parameters)


def _line(x: Floats, y: Floats, weights: Floats) -> tuple[float, float]:
    """Fit a line; return its zero, and its distance from zero to one; NaN for fewer than two points."""
    shares = weights / weights.sum()
    x_mean, y_mean = (shares * x).sum(), (shares * y).sum()
    slope = (shares * (x - x_mean) * (y - y_mean)).sum() / (shares * (x - x_mean) ** 2).sum()
    return float(x_mean - y_mean / slope), float(1.0 / slope)


# Triangles and trapezoids: memberships that are straight lines themselves.


def _straight(samples: SampledTerm) -> Iterator[Estimate]:
    """Yield the triangles and trapezoids whose flanks pass through the samples."""
    x, y = samples.universe, samples.values
    if samples.top is None:
        for left, peak in _flanks(x, y, samples.rising):
            yield model.Triangular, (left, peak, peak)
            for right, _ in _flanks(x, y, samples.falling, peak):
                yield model.Triangular, (left, peak, right)
        for right, peak in _flanks(x, y, samples.falling):
            yield model.Triangular, (peak, peak, right)
            for left, _ in _flanks(x, y, samples.rising, peak):
                yield model.Triangular, (left, peak, right)
        return
    first, last = (float(end) for end in samples.top)
    rising = list(_flanks(x, y, samples.rising, first))
    falling = list(_flanks(x, y, samples.falling, last))
    if first == last:
        for left, _ in rising:
            for right, _ in falling:
                yield model.Triangular, (left, first, right)
    for left, left_top in rising:
        for right, right_top in falling:
            yield model.Trapezoidal, (left, left_top, right_top, right)


def _flanks(x: Floats, y: Floats, flank: Booleans, top: float | None = None) -> Iterator[tuple[float, float]]:
    """Yield (foot, top) of the line through a flank: where it is zero and where it is one."""
    points, heights = x[flank], y[flank]
    if len(points) >= 2:
        foot, width = _line(points, heights, np.ones(len(points)))
        yield foot, foot + width
    elif len(points) == 1 and top is not None:
        point, height = float(points[0]), float(heights[0])
        yield top - (top - point) / (1.0 - height), top
        beyond = int(np.flatnonzero(flank)[0]) + (1 if point > top else -1)
        if 0 <= beyond < len(x):
            yield x[beyond], x[beyond] + (point - x[beyond]) / height
    elif top is not None:
        yield top, top


# Smooth shapes, by what makes straight lines of their flanks.


def _normal(y: Floats) -> tuple[Floats, Floats]:
    """Return the distance from a Gaussian's mean in standard deviations, and its weight."""
    deviations = np.sqrt(-2.0 * np.log(np.fmax(y, 1e-200)))
    return deviations, np.fmax(1.0 / deviations, deviations) ** -2.0


def _logistic(y: Floats) -> tuple[Floats, Floats]:
    """Return the logit, which is linear for a sigmoid, and its weight."""
    return np.log(y) - np.log1p(-y), (y * (1.0 - y)) ** 2


def _parabolic(y: Floats) -> tuple[Floats, Floats]:
    """Return the position along a flank of two parabolas, and its weight."""
    return np.where(y <= 0.5, np.sqrt(y / 2.0), 1.0 - np.sqrt((1.0 - y) / 2.0)), np.fmin(y, 1.0 - y)


def _flank_lines(
    samples: SampledTerm, straight: Callable[[Floats], tuple[Floats, Floats]]
) -> Iterator[tuple[float, float] | None]:
    """Yield the line fitted to each flank; None where it has too few points."""
    for flank in (samples.rising, samples.falling):
        yield _line(samples.universe[flank], *straight(samples.values[flank])) if flank.sum() > 1 else None


def _smooth(samples: SampledTerm) -> Iterator[Estimate]:
    """Yield estimates of smooth shapes from lines fitted to the transformed flanks."""
    low, high = samples.universe[[0, -1]].tolist()
    left, right = _flank_lines(samples, _normal)
    halves = [half for half in (left, right) if half is not None]
    if halves:
        middles, deviations = zip(*halves, strict=True)
        yield model.Gaussian, (float(np.mean(middles)), float(np.abs(deviations).mean()))
    odds = list(_flank_lines(samples, _logistic))
    for line, other in zip(odds, (samples.falling, samples.rising), strict=True):
        if line is not None and not other.any():
            yield model.Sigmoid, (line[0], 1.0 / line[1])
    rising, falling = _flank_lines(samples, _parabolic)
    if rising is not None and falling is not None:
        yield model.PiShape, (rising[0], sum(rising), sum(falling), falling[0])
    elif rising is not None:
        yield model.SShape, (rising[0], sum(rising))
    elif falling is not None:
        yield model.ZShape, (sum(falling), falling[0])
    if halves:
        mean, deviation = left or (min(halves[0][0], low), halves[0][1])
        other_mean, other_deviation = right or (max(mean, high), deviation)
        yield model.TwoSidedGaussian, (mean, abs(deviation), other_mean, abs(other_deviation))
    left, right = odds
    if left is not None and right is not None:
        yield model.SigmoidProduct, (left[0], 1.0 / left[1], right[0], 1.0 / right[1])
        yield model.SigmoidDifference, (left[0], 1.0 / left[1], right[0], -1.0 / right[1])
    yield from _bells(samples, odds)


def _bells(samples: SampledTerm, odds: list[tuple[float, float] | None]) -> Iterator[Estimate]:
    """Yield estimates of bells, the likelier first; beyond the universe for half a bell."""
    halves = [half for half in odds if half is not None]
    centres = [sum(middle for middle, _ in halves) / 2.0] if len(halves) == 2 else []
    centres.append(float(samples.universe[samples.values.argmax()]))
    if not samples.rising.any():
        centres.append(float(samples.universe[0]) - samples.width / 4.0)
    if not samples.falling.any():
        centres.append(float(samples.universe[-1]) + samples.width / 4.0)
    for centre in centres if halves else ():
        width = abs(halves[0][0] - centre)
        yield model.GeneralizedBell, (width, 0.5 * width / abs(halves[0][1]), centre)


def _fitted(samples: SampledTerm, kind: Kind, start: Numbers) -> Numbers:
    """Refine an estimate by least squares."""

    def residuals(parameters: Floats) -> Floats:
        given = model.shape_values(samples.universe, _made(kind, tuple(parameters)))
        return np.where(np.isfinite(given), given - samples.values, 1.0)

    # To the last digit, which a start that leads anywhere needs few steps for.
    least = least_squares(
        residuals, start, method="lm", x_scale="jac", ftol=1e-15, xtol=1e-15, gtol=1e-15, max_nfev=200
    )
    return tuple(least.x)
