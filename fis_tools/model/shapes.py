"""The membership shapes, one entry each in the registry of `fis_tools.model.membership`.

The entry of a shape contains all that the rest of the toolkit needs, so that a shape is added in one place:
its formula, its numbers and their relations, its wording, and its names in files. Formulas follow
scikit-fuzzy's generators (`gaussmf`, `trimf`, `gbellmf` and so on) to the last bit.
"""

from dataclasses import dataclass

import numpy as np

from fis_tools.array_types import Floats
from fis_tools.errors import Mistake
from fis_tools.model.membership import (
    Deviation,
    Exponent,
    Location,
    MembershipFunction,
    MonotoneFunction,
    Slope,
    Width,
    shape,
)

#: Sampled memberships below this are set to zero: differences of denormal numbers lose all their digits.
SMALLEST_MEMBERSHIP = 1e-290
#: Exponents from which on a sigmoid differs from zero or one by less than 1e-12.
SATURATED = 28.0


def gaussian(x: Floats, mean: Floats, standard_deviation: Floats) -> Floats:
    """Evaluate Gaussian membership functions, zero below `SMALLEST_MEMBERSHIP`.

    Populations of systems and single systems use this same expression, so that a genome flies in
    training exactly as its controller file does later.

    Parameters
    ----------
    x, mean, standard_deviation : arrays
        Of shapes that broadcast.
    """
    with np.errstate(over="ignore", under="ignore", divide="ignore", invalid="ignore"):
        values: Floats = np.exp(-((x - mean) ** 2.0) / (2 * standard_deviation**2.0))
    values[values < SMALLEST_MEMBERSHIP] = 0.0
    return values


@shape(
    "gaussian",
    "Gaussian, mean {mean}, standard deviation {standard_deviation}",
    fis=("gaussmf", "standard_deviation", "mean"),
    fll=("Gaussian",),
    fcl=("GAUSS",),
)
class Gaussian(MembershipFunction):
    """``exp(-(x - mean)^2 / (2 standard_deviation^2))``, in units of the variable."""

    mean: Location
    standard_deviation: Deviation

    def at(self, x: Floats) -> Floats:
        """Evaluate the formula."""
        return gaussian(x, np.array([self.mean]), np.array([self.standard_deviation]))


@shape(
    "triangular",
    "triangle from {left} over {peak} to {right}",
    ascending=("left", "peak", "right"),
    fis=("trimf",),
    fll=("Triangle",),
    fcl=("TRIAN",),
    corners=("left", "peak", "right"),
)
class Triangular(MembershipFunction):
    """Zero at `left` and `right`, one at `peak`."""

    left: Location
    peak: Location
    right: Location

    def at(self, x: Floats) -> Floats:
        """Evaluate the formula; a flank of zero width is a step."""
        values = np.zeros(len(x))
        if self.left != self.peak:
            rising = (self.left < x) & (x < self.peak)
            values[rising] = (x[rising] - self.left) / (self.peak - self.left)
        if self.peak != self.right:
            falling = (self.peak < x) & (x < self.right)
            values[falling] = (self.right - x[falling]) / (self.right - self.peak)
        values[x == self.peak] = 1.0
        return values


@shape(
    "trapezoidal",
    "trapezoid from {left} over {left_top} to {right_top} to {right}",
    ascending=("left", "left_top", "right_top", "right"),
    fis=("trapmf",),
    fll=("Trapezoid",),
    fcl=("TRAPE",),
)
class Trapezoidal(MembershipFunction):
    """Zero at `left` and `right`, one from `left_top` to `right_top`."""

    left: Location
    left_top: Location
    right_top: Location
    right: Location

    def at(self, x: Floats) -> Floats:
        """Evaluate the formula; a flank of zero width is a step."""
        values = np.ones(len(x))
        rising, falling = x <= self.left_top, x >= self.right_top
        values[rising] = Triangular(self.left, self.left_top, self.left_top).at(x[rising])
        values[falling] = Triangular(self.right_top, self.right_top, self.right).at(x[falling])
        values[(x < self.left) | (x > self.right)] = 0.0
        return values

    @property
    def corners(self) -> tuple[float, ...]:
        """Its four points, without the top if that has zero width."""
        top = (self.right_top,) if self.right_top > self.left_top else ()
        return (self.left, self.left_top, *top, self.right)


@shape(
    "two_sided_gaussian",
    "two-sided Gaussian, one from {left_mean} to {right_mean}, standard deviations "
    "{left_standard_deviation} and {right_standard_deviation}",
    fis=("gauss2mf", "left_standard_deviation", "left_mean", "right_standard_deviation", "right_mean"),
    fll=("GaussianProduct",),
    fcl=("GAUSS2",),
)
class TwoSidedGaussian(MembershipFunction):
    """A Gaussian up to `left_mean`, one from there to `right_mean`, another Gaussian beyond.

    If the means do not ascend it is the product of both between them.
    """

    left_mean: Location
    left_standard_deviation: Deviation
    right_mean: Location
    right_standard_deviation: Deviation

    def at(self, x: Floats) -> Floats:
        """Evaluate the formula."""
        values = np.ones(len(x))
        left, right = x <= self.left_mean, x > self.right_mean
        values[left] = Gaussian(self.left_mean, self.left_standard_deviation).at(x[left])
        values[right] *= Gaussian(self.right_mean, self.right_standard_deviation).at(x[right])
        return values


@shape(
    "generalized_bell",
    "bell, half width {width}, slope {slope}, centre {centre}",
    fis=("gbellmf",),
    fll=("Bell", "centre", "width", "slope"),
    fcl=("GBELL",),
)
class GeneralizedBell(MembershipFunction):
    """``1 / (1 + |(x - centre) / width|^(2 slope))``: one half at `width` from the `centre`."""

    width: Width
    slope: Exponent
    centre: Location

    def at(self, x: Floats) -> Floats:
        """Evaluate the formula."""
        return 1.0 / (1.0 + np.abs((x - self.centre) / self.width) ** (2 * self.slope))


@shape(
    "sigmoid",
    "sigmoid, inflection {inflection}, slope {slope}",
    fis=("sigmf", "slope", "inflection"),
    fll=("Sigmoid",),
    fcl=("SIGM", "slope", "inflection"),
)
class Sigmoid(MonotoneFunction):
    """``1 / (1 + exp(-slope (x - inflection)))``: 1/2 at the `inflection`; a negative `slope` falls."""

    inflection: Location
    slope: Slope

    def at(self, x: Floats) -> Floats:
        """Evaluate the formula."""
        return 1.0 / (1.0 + np.exp(-self.slope * (x - self.inflection)))

    def inverse(self, degrees: Floats) -> Floats:
        """Return the points with these degrees; infinite for a degree of one."""
        with np.errstate(divide="ignore", over="ignore"):
            return self.inflection - np.log(1.0 / degrees - 1.0) / self.slope


@dataclass(frozen=True, slots=True)
class _TwoSigmoids(MembershipFunction):
    first_inflection: Location
    first_slope: Slope
    second_inflection: Location
    second_slope: Slope

    @property
    def _sigmoids(self) -> tuple[Sigmoid, Sigmoid]:
        first = Sigmoid(self.first_inflection, self.first_slope)
        return first, Sigmoid(self.second_inflection, self.second_slope)


@shape(
    "sigmoid_difference",
    "sigmoid, inflection {first_inflection}, slope {first_slope}, less sigmoid, inflection "
    "{second_inflection}, slope {second_slope}",
    fis=("dsigmf", "first_slope", "first_inflection", "second_slope", "second_inflection"),
    fll=("SigmoidDifference", "first_inflection", "first_slope", "second_slope", "second_inflection"),
    fcl=("DSIGM", "first_slope", "first_inflection", "second_slope", "second_inflection"),
)
class SigmoidDifference(_TwoSigmoids):
    """The absolute difference of two sigmoids, each as in `Sigmoid`."""

    def at(self, x: Floats) -> Floats:
        """Evaluate the formula."""
        first, second = self._sigmoids
        return np.abs(first.at(x) - second.at(x))

    @property
    def is_reversed(self) -> bool:
        """Whether the second sigmoid exceeds the first somewhere, by more than rounding."""
        if self.first_slope * self.second_slope < 0.0:
            return True
        if self.first_slope == self.second_slope:
            return self.first_slope * (self.second_inflection - self.first_inflection) < 0.0
        products = (self.first_slope * self.first_inflection, self.second_slope * self.second_inflection)
        steeper = self.first_slope - self.second_slope
        crossing = (products[0] - products[1]) / steeper
        away = self.first_slope * (crossing - self.first_inflection)
        where_reversed = -steeper * self.first_slope  # whether exponents grow towards there, or fall
        return away * np.sign(where_reversed) < SATURATED  # both are as good as flat beyond


@shape(
    "sigmoid_product",
    "sigmoid, inflection {first_inflection}, slope {first_slope}, times sigmoid, inflection "
    "{second_inflection}, slope {second_slope}",
    fis=("psigmf", "first_slope", "first_inflection", "second_slope", "second_inflection"),
    fll=("SigmoidProduct", "first_inflection", "first_slope", "second_slope", "second_inflection"),
)
class SigmoidProduct(_TwoSigmoids):
    """The product of two sigmoids, each as in `Sigmoid`."""

    def at(self, x: Floats) -> Floats:
        """Evaluate the formula."""
        first, second = self._sigmoids
        return first.at(x) * second.at(x)


@shape(
    "s_shape",
    "S shape from {foot} up to {top}",
    ascending=("foot", "top"),
    flanks=(("foot", "top"),),
    fis=("smf",),
    fll=("SShape",),
)
class SShape(MonotoneFunction):
    """Two parabolas that rise from zero at `foot` over one half in the middle to one at `top`."""

    foot: Location
    top: Location

    def at(self, x: Floats) -> Floats:
        """Evaluate the formula."""
        return np.where(x <= self.top, _rising(x, self.foot, self.top, is_open=False), 1.0)

    def inverse(self, degrees: Floats) -> Floats:
        """Return the points with these degrees."""
        return _where_two_parabolas(degrees, self.foot, self.top)


@shape(
    "z_shape",
    "Z shape from {top} down to {foot}",
    ascending=("top", "foot"),
    flanks=(("top", "foot"),),
    fis=("zmf",),
    fll=("ZShape",),
)
class ZShape(MonotoneFunction):
    """Two parabolas that fall from one at `top` over one half in the middle to zero at `foot`."""

    top: Location
    foot: Location

    def at(self, x: Floats) -> Floats:
        """Evaluate the formula."""
        return np.where(x >= self.top, _falling(x, self.top, self.foot), 1.0)

    def inverse(self, degrees: Floats) -> Floats:
        """Return the points with these degrees."""
        return _where_two_parabolas(degrees, self.foot, self.top)


@shape(
    "pi_shape",
    "pi shape from {left} over {left_top} to {right_top} to {right}",
    ascending=("left", "left_top", "right_top", "right"),
    flanks=(("left", "left_top"), ("right_top", "right")),
    fis=("pimf",),
    fll=("PiShape",),
)
class PiShape(MembershipFunction):
    """An S from `left` to `left_top`, one to `right_top`, a Z from there to `right`."""

    left: Location
    left_top: Location
    right_top: Location
    right: Location

    def at(self, x: Floats) -> Floats:
        """Evaluate the formula."""
        values = _rising(x, self.left, self.left_top, is_open=True)
        values = np.where(x <= self.left_top, values, 1.0)
        return np.where(x >= self.right_top, _falling(x, self.right_top, self.right), values)


@shape("sampled", "sampled")
class Sampled(MembershipFunction):
    """Any shape: one membership value in [0, 1] for each point of the variable's universe."""

    values: tuple[float, ...]

    def at(self, x: Floats) -> Floats:
        """Return the values; `x` must be the universe that they belong to."""
        return np.array(self.values, dtype=np.float64)


@shape("polyline", "polyline")
class Polyline(MembershipFunction):
    """Straight between the points `x`, `y`, level beyond; two equal `x` are a jump after the first."""

    x: tuple[float, ...]
    y: tuple[float, ...]

    def at(self, x: Floats) -> Floats:
        """Evaluate the formula."""
        own_x, y = np.array(self.x, dtype=np.float64), np.array(self.y, dtype=np.float64)
        if len(own_x) == 1:
            return np.full(len(x), y[0])
        right = np.clip(np.searchsorted(own_x, x, side="left"), 1, len(own_x) - 1)
        left = right - 1
        widths = own_x[right] - own_x[left]
        # of a jump at the first point, which has its own value below
        widths = np.where(widths > 0.0, widths, 1.0)
        values = y[left] + (y[right] - y[left]) * ((x - own_x[left]) / widths)
        values = np.where(x == own_x[right], y[right], values)  # a faint one would be lost
        return np.where(x <= own_x[0], y[0], np.where(x > own_x[-1], y[-1], values))

    @property
    def corners(self) -> tuple[float, ...]:
        """Its points."""
        return self.x


@shape("between", "between {lower} and {upper}")
class Between(MembershipFunction):
    """An interval type-2 set: memberships anywhere between a lower and an upper function."""

    lower: MembershipFunction
    upper: MembershipFunction

    def at(self, x: Floats) -> Floats:
        """Refuse: there is no one membership; see `fis_tools.model.intervals`."""
        raise Mistake(
            "an interval type-2 set has two memberships at a point, and this is for type-1 sets; import "
            "--sets upper makes it one"
        )


def _rising(x: Floats, foot: float, top: float, *, is_open: bool) -> Floats:
    """Two parabolas from zero up to one, for points up to `top`.

    In the middle the upper one is used, or the lower one if `is_open`: scikit-fuzzy's `smf` and `pimf` differ
    in this, and the two parabolas differ in the last bit there.
    """
    middle = (foot + top) / 2.0
    lower = 2.0 * ((x - foot) / (top - foot)) ** 2.0
    upper = 1.0 - 2.0 * ((x - top) / (top - foot)) ** 2.0
    values = np.where(x > middle if is_open else x >= middle, upper, lower)
    return np.where(x <= foot, 0.0, values)


def _falling(x: Floats, top: float, foot: float) -> Floats:
    """Two parabolas from one down to zero, for points from `top` on."""
    upper = 1.0 - 2.0 * ((x - top) / (foot - top)) ** 2.0
    lower = 2.0 * ((x - foot) / (foot - top)) ** 2.0
    return np.where(x >= foot, 0.0, np.where(x < (top + foot) / 2.0, upper, lower))


def _where_two_parabolas(degrees: Floats, foot: float, top: float) -> Floats:
    """Return where the greater of two parabolas from zero at `foot` to one at `top` has degrees."""
    width = top - foot
    lower = foot + width * np.sqrt(degrees / 2.0)
    upper = top - width * np.sqrt((1.0 - degrees) / 2.0)
    return np.where(degrees <= 0.5, lower, upper)
