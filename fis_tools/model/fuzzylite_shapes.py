"""The shapes that fuzzylite has besides those of scikit-fuzzy and MATLAB; see `fis_tools.model.shapes`."""

import numpy as np

from fis_tools.array_types import Floats
from fis_tools.model import shapes  # noqa: F401 - those stand first in the registry
from fis_tools.model.membership import Location, MembershipFunction, MonotoneFunction, Width, shape


@shape(
    "spike", "spike, centre {centre}, width {width}", fll=("Spike",), fis=("spikemf",), corners=("centre",)
)
class Spike(MembershipFunction):
    """``exp(-10 |x - centre| / width)``."""

    centre: Location
    width: Width

    def at(self, x: Floats) -> Floats:
        """Evaluate the formula."""
        return np.exp(-np.abs(10.0 / self.width * (x - self.centre)))


@shape(
    "cosine",
    "cosine, centre {centre}, width {width}",
    fll=("Cosine",),
    fis=("cosinemf",),
    fcl=("COSINE", "width", "centre"),
)
class Cosine(MembershipFunction):
    """One period of a cosine between 0 and 1 over `width`, with the crest at the `centre`; zero beyond."""

    centre: Location
    width: Width

    def at(self, x: Floats) -> Floats:
        """Evaluate the formula."""
        wave = 0.5 * (1.0 + np.cos(2.0 / self.width * np.pi * (x - self.centre)))
        return np.where(np.abs(x - self.centre) <= 0.5 * self.width, wave, 0.0)


@shape(
    "concave",
    "concave, one half at {inflection}, one from {end} on",
    fll=("Concave",),
    fis=("concavemf",),
    corners=("end",),
)
class Concave(MonotoneFunction):
    """``(end - inflection) / (2 end - inflection - x)`` up to `end`, one beyond; falls if `end` is left."""

    inflection: Location
    end: Location

    def at(self, x: Floats) -> Floats:
        """Evaluate the formula."""
        span = self.end - self.inflection
        is_below = x < self.end if span >= 0.0 else x > self.end
        return np.where(is_below, span / np.where(is_below, 2.0 * self.end - self.inflection - x, 1.0), 1.0)

    def inverse(self, degrees: Floats) -> Floats:
        """Return the points with these degrees; infinite for faint ones."""
        with np.errstate(over="ignore"):
            return 2.0 * self.end - self.inflection + (self.inflection - self.end) / degrees


@shape(
    "semi_ellipse",
    "half ellipse from {start} to {end}",
    ascending=("start", "end"),
    flanks=(("start", "end"),),
    fll=("SemiEllipse",),
    corners=("start", "end"),
)
class SemiEllipse(MembershipFunction):
    """``sqrt(r^2 - (x - centre)^2) / r`` between `start` and `end`, r half of their distance; zero beyond."""

    start: Location
    end: Location

    def at(self, x: Floats) -> Floats:
        """Evaluate the formula."""
        radius = 0.5 * (self.end - self.start)
        return _circle(x, self.start + radius, radius)


@shape("arc", "arc from zero at {start} to one at {end}", fll=("Arc",), corners=("start", "end"))
class Arc(MonotoneFunction):
    """A quarter of an ellipse from zero at `start` to one at `end`, one beyond; falls if `end` is left."""

    start: Location
    end: Location

    def at(self, x: Floats) -> Floats:
        """Evaluate the formula."""
        span = self.end - self.start
        is_beyond = x > self.end if span > 0.0 else x < self.end
        return np.where(is_beyond, 1.0, _circle(x, self.end, abs(span)))

    def inverse(self, degrees: Floats) -> Floats:
        """Return the points with these degrees."""
        return self.end + (self.start - self.end) * np.sqrt(1.0 - np.square(degrees))


@shape("ramp", "ramp from zero at {start} to one at {end}", corners=("start", "end"))
class Ramp(MonotoneFunction):
    """A straight line from zero at `start` to one at `end`, level beyond; falls if `end` is left."""

    start: Location
    end: Location

    def at(self, x: Floats) -> Floats:
        """Evaluate the formula."""
        return np.clip((x - self.start) / (self.end - self.start), 0.0, 1.0)

    def inverse(self, degrees: Floats) -> Floats:
        """Return the points with these degrees."""
        return self.start + (self.end - self.start) * degrees


def _circle(x: Floats, centre: float, radius: float) -> Floats:
    """Return the height of a circle at points, scaled to a radius of one; zero outside."""
    inside = radius * radius - np.square(x - centre)
    return np.sqrt(np.maximum(inside, 0.0)) / radius
