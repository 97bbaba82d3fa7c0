"""Shapes from samples: which membership function gave these values on this universe.

Each kind of shape is estimated from what its formula makes a straight line of, then its parameters are set
to the shortest decimals, or the nearby floating-point numbers, that give the values again. Nothing is taken
for a shape that does not give them.
"""

from collections.abc import Callable, Iterator
from itertools import product
from math import floor, log10

import numpy as np
from scipy.optimize import least_squares

from fis_tools import model
from fis_tools.array_types import Booleans, Floats
from fis_tools.model.shapes import SMALLEST_MEMBERSHIP
from fis_tools.model.validate import shape_problems
from fis_tools.model.variables import is_unimodal, shape_values

Estimate = tuple[type[model.MembershipFunction], tuple[float, ...]]

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


def recognise(universe: Floats, values: Floats, tolerance: float = 0.0) -> model.MembershipFunction:
    """Find the shape that gives the values on the universe, or keep the values.

    Triangles and trapezoids are preferred, then Gaussians and the rest, each only if the values say more than
    its parameters can be fitted to.

    Parameters
    ----------
    universe, values : array
        Ascending points and the memberships there, shape (num_points,).
    tolerance : float
        How far the shape may be from the values; 0 asks for every bit, 1e-15 also takes values that were
        computed by another formula of the same shape.

    Returns
    -------
    MembershipFunction
        `Sampled` where nothing else gives the values.
    """
    samples = Samples(universe, values)
    with np.errstate(all="ignore"):  # an estimate that is not a number is dropped
        for kind, parameters in _estimates(samples):
            shape = _settled(samples, kind, parameters, tolerance)
            if shape is not None:
                return shape
    return model.Sampled(tuple(values.tolist()))


class Samples:
    """Memberships on a universe, with the flanks to either side of the top."""

    def __init__(self, universe: Floats, values: Floats) -> None:
        self.universe = universe
        self.values = np.where(values < SMALLEST_MEMBERSHIP, 0.0, values)
        self.width = float(universe[-1] - universe[0])
        highest = np.flatnonzero(self.values == self.values.max())
        is_between = (self.values > 0.0) & (self.values < 1.0)
        places = np.arange(len(universe))
        self.rising = is_between & (places < highest[0])
        self.falling = is_between & (places > highest[-1])
        # A highest point below one belongs to one of the flanks; to which, is known at the ends only.
        if highest[0] == len(universe) - 1 and self.rising.sum() < FEW:
            self.rising = is_between
        elif highest[-1] == 0 and self.falling.sum() < FEW:
            self.falling = is_between
        self.top = universe[highest[[0, -1]]] if self.values.max() == 1.0 else None
        self.num_between = int(is_between.sum())

    def misses(self, shape: model.MembershipFunction) -> Floats:
        """Return how far a shape is from each value; no number where it has none, infinite if it is wrong."""
        if any(shape_problems(shape, len(self.values))):
            return np.full(len(self.values), np.inf)
        given = shape_values(self.universe, shape)
        given = np.where(given < SMALLEST_MEMBERSHIP, 0.0, given)
        return np.abs(given - self.values)


def _settled(
    samples: Samples, kind: type[model.MembershipFunction], parameters: tuple[float, ...], tolerance: float
) -> model.MembershipFunction | None:
    """Return the shape of the simplest numbers near an estimate that gives the samples, if there is one."""
    is_near = samples.misses(_made(kind, parameters)).max() <= NEAR + tolerance
    if not np.isfinite(parameters).all() or not is_near:
        return None
    rounded = [_rounded(kind, parameters, digits, samples.width) for digits in range(1, DIGITS + 1)]
    for numbers in rounded:
        shape = _made(kind, numbers)
        if samples.misses(shape).max() <= tolerance:
            return shape
    shape = _improved(samples, kind, [*rounded, parameters])
    return shape if samples.misses(shape).max() <= tolerance else None


def _made(kind: type[model.MembershipFunction], parameters: tuple[float, ...]) -> model.MembershipFunction:
    return kind(*map(float, parameters))


def _rounded(
    kind: type[model.MembershipFunction], parameters: tuple[float, ...], digits: int, width: float
) -> tuple[float, ...]:
    """Round places to digits of the universe's width, spreads and slopes to digits of their own."""
    rounded = []
    for what, value in zip(kind.entry.kinds.values(), parameters, strict=True):
        scale = width if what == "place" else abs(value)
        rounded.append(round(value, digits - 1 - floor(log10(scale))) if scale > 0 else value)
    return tuple(rounded)


def _improved(
    samples: Samples, kind: type[model.MembershipFunction], candidates: list[tuple[float, ...]]
) -> model.MembershipFunction:
    """Move neighbouring parameters, two at a time, while fewer samples are missed.

    They move to their values in the last candidates, and by units in their last place: the errors of a foot
    and a top, or of a mean and a deviation, belong together.
    """

    def missed(numbers: tuple[float, ...]) -> int:
        return int(np.count_nonzero(samples.misses(_made(kind, numbers))))

    def moves(place: int) -> set[float]:
        unit = float(np.spacing(max(abs(best[place]), samples.width * SMALL)))
        nudged = {best[place] + nudge * unit for nudge in range(-NUDGES, NUDGES + 1)}
        return nudged.union(candidate[place] for candidate in candidates[-NUDGES:])

    best = min(reversed(candidates), key=missed)
    fewest = missed(best)
    has_moved = True
    while fewest and has_moved:
        has_moved = False
        for place in range(len(best) - 1):
            for pair in product(moves(place), moves(place + 1)):
                tried = (*best[:place], *pair, *best[place + 2 :])
                if (count := missed(tried)) < fewest:
                    best, fewest, has_moved = tried, count, True
                    if fewest == 0:
                        return _made(kind, best)
    return _made(kind, best)


def _estimates(samples: Samples) -> Iterator[Estimate]:
    if not is_unimodal(samples.values):
        return
    yield from _straight(samples)
    smooth: list[Callable[[Samples], Iterator[Estimate]]] = [_gaussian, _sigmoid, _parabolic]
    smooth += [_two_sided, _two_sigmoids, _bell]
    for estimate in smooth:
        for kind, parameters in estimate(samples):
            if samples.num_between > len(parameters):
                yield kind, parameters


def _line(x: Floats, y: Floats, weights: Floats | None = None) -> tuple[np.float64, np.float64]:
    """Fit a line; return its slope and where it is zero, NaN for fewer than two points."""
    shares = np.ones(len(x)) if weights is None else weights
    shares = shares / shares.sum()
    x_mean, y_mean = (shares * x).sum(), (shares * y).sum()
    slope = (shares * (x - x_mean) * (y - y_mean)).sum() / (shares * (x - x_mean) ** 2).sum()
    return slope, x_mean - y_mean / slope


# Triangles and trapezoids: memberships that are straight lines themselves.


def _straight(samples: Samples) -> Iterator[Estimate]:
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
        slope, foot = _line(points, heights)
        yield foot, foot + 1.0 / slope
    elif len(points) == 1 and top is not None:
        point, height = float(points[0]), float(heights[0])
        yield top - (top - point) / (1.0 - height), top
        beyond = int(np.flatnonzero(flank)[0]) + (1 if point > top else -1)
        if 0 <= beyond < len(x):
            yield x[beyond], x[beyond] + (point - x[beyond]) / height
    elif top is not None:
        yield top, top


# Shapes that a formula makes straight lines of.


def _deviations(samples: Samples, flank: Booleans, sign: float) -> tuple[Floats, Floats, Floats]:
    """Return x, (x - mean) / standard deviation there, and how far to trust it, for a Gaussian's flank."""
    flank = flank & (samples.values > 1e-200)
    deviations = np.sqrt(-2.0 * np.log(samples.values[flank]))
    return samples.universe[flank], sign * deviations, np.fmax(1.0 / deviations, deviations) ** -2.0


def _gaussian(samples: Samples) -> Iterator[Estimate]:
    left, right = _deviations(samples, samples.rising, -1.0), _deviations(samples, samples.falling, 1.0)
    x, deviations, weights = (np.concatenate(pair) for pair in zip(left, right, strict=True))
    slope, mean = _line(x, deviations, weights)
    if slope > 0:
        yield model.Gaussian, (mean, 1.0 / slope)


def _two_sided(samples: Samples) -> Iterator[Estimate]:
    left_slope, left_mean = _line(*_deviations(samples, samples.rising, -1.0))
    right_slope, right_mean = _line(*_deviations(samples, samples.falling, 1.0))
    low, high = samples.universe[[0, -1]]
    if left_slope > 0 and right_slope > 0:
        yield model.TwoSidedGaussian, (left_mean, 1.0 / left_slope, right_mean, 1.0 / right_slope)
    elif left_slope > 0:
        yield model.TwoSidedGaussian, (left_mean, 1.0 / left_slope, max(left_mean, high), 1.0 / left_slope)
    elif right_slope > 0:
        yield model.TwoSidedGaussian, (min(right_mean, low), 1.0 / right_slope, right_mean, 1.0 / right_slope)


def _logit_line(samples: Samples, flank: Booleans) -> tuple[np.float64, np.float64]:
    y = samples.values[flank]
    return _line(samples.universe[flank], np.log(y) - np.log1p(-y), (y * (1.0 - y)) ** 2)


def _sigmoid(samples: Samples) -> Iterator[Estimate]:
    for flank, other in ((samples.rising, samples.falling), (samples.falling, samples.rising)):
        if not other.any():
            slope, inflection = _logit_line(samples, flank)
            yield model.Sigmoid, (inflection, slope)


def _two_sigmoids(samples: Samples) -> Iterator[Estimate]:
    slope, inflection = _logit_line(samples, samples.rising)
    other_slope, other = _logit_line(samples, samples.falling)
    if slope > 0 > other_slope:
        yield _fitted(samples, model.SigmoidProduct, (inflection, slope, other, other_slope))
        yield _fitted(samples, model.SigmoidDifference, (inflection, slope, other, -other_slope))


def _parabolic(samples: Samples) -> Iterator[Estimate]:
    left, right = _parabolas(samples, samples.rising), _parabolas(samples, samples.falling)
    if left is not None and right is not None:
        yield model.PiShape, (*left, *right[::-1])
    elif left is not None:
        yield model.SShape, left
    elif right is not None:
        yield model.ZShape, right[::-1]


def _parabolas(samples: Samples, flank: Booleans) -> tuple[float, float] | None:
    """Return (foot, top) of a flank of two parabolas."""
    y = samples.values[flank]
    if len(y) < 2:
        return None
    along = np.where(y <= 0.5, np.sqrt(y / 2.0), 1.0 - np.sqrt((1.0 - y) / 2.0))
    slope, foot = _line(samples.universe[flank], along, np.fmin(y, 1.0 - y))
    return foot, foot + 1.0 / slope


def _bell(samples: Samples) -> Iterator[Estimate]:
    flanks = samples.rising | samples.falling
    x, odds = samples.universe[flanks], 1.0 / samples.values[flanks] - 1.0
    for centre in _centres(samples):
        away = np.abs(x - centre)
        near = (away > 0) & (odds > 1e-12) & (odds < 1e12)
        if near.sum() >= 2:
            slope, zero = _line(np.log(away[near]), np.log(odds[near]))
            yield _fitted(samples, model.GeneralizedBell, (float(np.exp(zero)), slope / 2.0, centre))


def _centres(samples: Samples) -> Iterator[float]:
    """Yield where the centre of a bell may be, the likelier first; beyond the universe for half a bell."""
    half = [_crossing(samples, flank) for flank in (samples.rising, samples.falling)]
    if half[0] is not None and half[1] is not None:
        yield (half[0] + half[1]) / 2.0
    yield float(samples.universe[samples.values.argmax()])
    if not samples.rising.any():
        yield float(samples.universe[0]) - samples.width / 4.0
    if not samples.falling.any():
        yield float(samples.universe[-1]) + samples.width / 4.0


def _crossing(samples: Samples, flank: Booleans) -> float | None:
    """Return where a flank is one half, if it is."""
    x, y = samples.universe[flank], samples.values[flank]
    if len(y) < 2 or not y.min() <= 0.5 <= y.max():
        return None
    order = np.argsort(y, kind="stable")
    return float(np.interp(0.5, y[order], x[order]))


def _fitted(samples: Samples, kind: type[model.MembershipFunction], start: tuple[float, ...]) -> Estimate:
    """Improve an estimate by least squares."""
    if len(start) > len(samples.values) or not np.isfinite(start).all():
        return kind, start

    def residuals(parameters: Floats) -> Floats:
        given = shape_values(samples.universe, _made(kind, tuple(parameters)))
        return np.where(np.isfinite(given), given - samples.values, 1.0)

    # To the last digit, which a start that leads anywhere needs few steps for.
    least = least_squares(
        residuals, start, method="lm", x_scale="jac", ftol=1e-15, xtol=1e-15, gtol=1e-15, max_nfev=200
    )
    return kind, tuple(least.x)
