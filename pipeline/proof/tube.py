"""The tube: boxes that hold, along each axis and after each control period, every state from the starts.

Positions along an axis are divided into cells, and each cell that states may be in has one box: what of the
boxes before it moves into the cell. The shear of a box is the slope of the velocity along a nominal flight,
so that the box stays narrow while the rules brake. What happens along the other axes, which moves an axis a
little, enters as intervals. The force that rules ask for is enclosed over
a grid of cells of position and velocity.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from functools import cached_property, partial
from itertools import pairwise

import numpy as np

from fis_tools.engines import interpreter, interval
from fis_tools.model import FuzzySystem
from pipeline.array_types import Floats

#: cells from one end of an input's range to the other; beyond its ends, where the input is clipped, one more
CELLS = (160, 240)
#: farther and faster than any deputy, m and m/s
BEYOND = 1e6
#: residuals are this much greater than found, and by this many N, so that others who bound forces agree
MORE, ROUNDING_N = 1.1, 1e-6


@dataclass(frozen=True)
class ReachableBox:
    """States along one axis: an interval of positions p, m, and one of ``v + shear p``, v a velocity, m/s."""

    low: float
    high: float
    least: float
    greatest: float
    shear: float

    @property
    def ends(self) -> tuple[float, float, float, float]:
        """Least and greatest position and velocity."""
        lean = sorted((self.shear * self.low, self.shear * self.high))
        return self.low, self.high, self.least - lean[1], self.greatest - lean[0]


@dataclass(frozen=True)
class Plane:
    """A force over a box: ``constant + per_position p + per_velocity v``, give or take a residual, N."""

    constant: float
    per_position: float
    per_velocity: float
    residual: float

    def ends(self, box: ReachableBox) -> tuple[float, float]:
        """Return the least and greatest force over a box."""
        across = self.per_position - self.per_velocity * box.shear, self.per_velocity
        middle = across[0] * (box.low + box.high) / 2 + across[1] * (box.least + box.greatest) / 2
        radius = abs(across[0]) * (box.high - box.low) / 2 + abs(across[1]) * (box.greatest - box.least) / 2
        radius += self.residual
        return self.constant + middle - radius, self.constant + middle + radius


@dataclass(frozen=True)
class TubeSurface:
    """Bounds of a force, N, over cells.

    Parameters
    ----------
    positions, velocities : (n + 1,), (m + 1,)
        The edges of the cells.
    low, high : (n, m)
    """

    positions: Floats
    velocities: Floats
    low: Floats
    high: Floats

    @cached_property
    def gradients(self) -> tuple[Floats, Floats]:
        """Slopes of the force with position and velocity in each cell, (n, m)."""
        middle = 0.5 * (self.low + self.high)[1:-1, 1:-1]
        centres = (0.5 * (edges[2:-1] + edges[1:-2]) for edges in (self.positions, self.velocities))
        by_position, by_velocity = (np.pad(slope, 1, "edge") for slope in np.gradient(middle, *centres))
        by_position[[0, -1]] = by_velocity[:, [0, -1]] = 0.0  # there the inputs are clipped
        return by_position, by_velocity

    def plane(self, box: ReachableBox) -> Plane:
        """Enclose the force over a box, by the mean slopes of the cells that it touches."""
        columns = _touched(self.positions, box.low, box.high)
        rows = _touched(self.velocities, *box.ends[2:])
        p = np.clip([self.positions[:-1][columns], self.positions[1:][columns]], box.low, box.high)
        lean = np.sort(box.shear * p, axis=0)[..., np.newaxis]
        v = [
            np.maximum(self.velocities[:-1][rows], box.least - lean[1]),
            np.minimum(self.velocities[1:][rows], box.greatest - lean[0]),
        ]
        is_touched = v[0] <= v[1]
        weights = np.where(is_touched, (p[1] - p[0] + 1e-9)[:, np.newaxis] * (v[1] - v[0] + 1e-9), 0.0)
        a, b = (float(np.average(each[columns, rows], weights=weights)) for each in self.gradients)
        linear = np.sort(a * p, axis=0)[..., np.newaxis] + np.sort([b * v[0], b * v[1]], axis=0)
        low = float((self.low[columns, rows] - linear[1])[is_touched].min())
        high = float((self.high[columns, rows] - linear[0])[is_touched].max())
        return Plane(0.5 * (low + high), a, b, 0.5 * MORE * (high - low) + ROUNDING_N)


def _touched(edges: Floats, low: float, high: float) -> slice:
    """Return the cells that an interval touches."""
    first = int(np.searchsorted(edges, low, side="right")) - 1
    return slice(first, max(int(np.searchsorted(edges, high, side="left")), first + 1))


def surface_of(system: FuzzySystem, dead_band_n: float, max_force_n: float) -> TubeSurface:
    """Bound the force of a system of position and velocity over its cells."""
    positions, velocities = (
        np.array([-BEYOND, *np.linspace(variable.minimum, variable.maximum, cells + 1), BEYOND])
        for variable, cells in zip(system.inputs, CELLS, strict=True)
    )
    corners = [
        np.stack(np.meshgrid(positions[part], velocities[part], indexing="ij"), axis=-1)
        for part in (slice(None, -1), slice(1, None))
    ]
    bounds = interval.bound(interval.pack(system), *(each.reshape(-1, 2) for each in corners))
    low, high = (each.reshape(corners[0].shape[:2]) for each in bounds[:2])
    is_cut = (low < dead_band_n) & (high > -dead_band_n)
    low, high = np.where(is_cut, np.minimum(low, 0.0), low), np.where(is_cut, np.maximum(high, 0.0), high)
    return TubeSurface(positions, velocities, *np.clip([low, high], -max_force_n, max_force_n))


#: boxes are widened by this share of their widths and by this much, m and m/s: far more than any rounding
WIDEN_SHARE, WIDEN = 1e-7, 5e-7
#: control periods of a nominal flight
NOMINAL_PERIODS = 2000
#: on one axis: the box in each cell, with the plane of the force over it
Enclosed = dict[int, tuple[ReachableBox, Plane]]


@dataclass(frozen=True)
class Axis:
    """One axis of the closed loop.

    Parameters
    ----------
    position_effect : (2, 3)
        Effect of its own position, velocity and force on its position and velocity after a period.
    others : (2, 9)
        Effect of the positions, velocities and forces along the other axes.
    surface : Surface
    edges : (n + 1,)
        Of the cells, m.
    shears : (n,)
        Of the box in each cell, 1/s.
    """

    position_effect: Floats
    others: Floats
    surface: TubeSurface
    edges: Floats
    shears: Floats

    def start(self, low: Floats, high: Floats) -> dict[int, ReachableBox]:
        """Split a box of positions and velocities at the cells' edges; return a box for each cell."""
        inner = self.edges[(self.edges > low[0]) & (self.edges < high[0])]
        parts = pairwise([low[0], *inner, high[0]])
        return self._dealt(partial(_leaning, ReachableBox(*part, low[1], high[1], 0.0)) for part in parts)

    def move(self, boxes: Enclosed, happens: Floats) -> dict[int, ReachableBox]:
        """Return the boxes after a period; intervals, (9, 2), enclose the motion along all axes."""
        return self._dealt(partial(self.image, *pair, happens) for pair in boxes.values())

    def _dealt(self, images: Iterable[Callable[[float], ReachableBox]]) -> dict[int, ReachableBox]:
        """Merge boxes, given as functions of the shear, into one for each cell that they overlap."""
        boxes: dict[int, ReachableBox] = {}
        for image in images:
            whole = image(0.0)
            first = int(np.searchsorted(self.edges, whole.low, side="right")) - 1
            # a state on an edge, without any width, belongs to the cell after it
            last = max(first + 1, int(np.searchsorted(self.edges, whole.high, side="left")))
            for cell in range(first, last):
                low, high = np.clip([whole.low, whole.high], *self.edges[cell : cell + 2]).tolist()
                # a shear is for boxes as narrow as its cell: of a wide one, what falls into the cell leans
                box = _leaning(replace(whole, low=low, high=high), self.shears[cell])
                position_image = image(box.shear)
                least, greatest = (
                    max(box.least, position_image.least),
                    min(box.greatest, position_image.greatest),
                )
                box = replace(box, least=least, greatest=greatest)
                boxes[cell] = _joined(box, boxes.get(cell, box))
        return {cell: _widened(boxes[cell]) for cell in sorted(boxes)}

    def image(self, box: ReachableBox, plane: Plane, happens: Floats, shear: float) -> ReachableBox:
        """Return a box of a given shear that contains every state of a box after a period."""
        turn = np.array([[1.0, 0.0], [shear, 1.0]])
        force = turn @ self.position_effect[:, 2]
        loop = turn @ self.position_effect[:, :2] + np.outer(force, [plane.per_position, plane.per_velocity])
        loop = loop @ np.array([[1.0, 0.0], [-box.shear, 1.0]])
        intervals = np.array([[box.low, box.high], [box.least, box.greatest], *happens])
        factors = np.hstack([loop, turn @ self.others])
        centre = factors @ intervals.mean(axis=1) + force * plane.constant
        radii = 0.5 * np.abs(factors) @ np.diff(intervals)[:, 0] + np.abs(force) * plane.residual
        (low, least), (high, greatest) = (centre - radii).tolist(), (centre + radii).tolist()
        return ReachableBox(low, high, least, greatest, shear)


def _leaning(box: ReachableBox, shear: float) -> ReachableBox:
    """Return a box of a given shear that contains a box without shear."""
    lean = sorted((shear * box.low, shear * box.high))
    return ReachableBox(box.low, box.high, box.least + lean[0], box.greatest + lean[1], shear)


def _joined(a: ReachableBox, b: ReachableBox) -> ReachableBox:
    """Return the least box that contains two of the same shear."""
    low, high = min(a.low, b.low), max(a.high, b.high)
    return ReachableBox(low, high, min(a.least, b.least), max(a.greatest, b.greatest), a.shear)


def _widened(box: ReachableBox) -> ReachableBox:
    """Return a box widened by the rounding of its computation."""
    p, s = (WIDEN + WIDEN_SHARE * width for width in (box.high - box.low, box.greatest - box.least))
    return ReachableBox(box.low - p, box.high + p, box.least - s, box.greatest + s, box.shear)


def axis_of(
    system: FuzzySystem, effects: Floats, position_columns: list[int], surface: TubeSurface, cells: int
) -> Axis:
    """Divide the positions along an axis into cells, and find shears along a flight from either end.

    Parameters
    ----------
    system : FuzzySystem
        Drives the axis.
    effects : (2, 9)
        Of positions, velocities and forces on position and velocity along the axis after a period.
    position_columns : list of int
        The columns of the axis.
    surface : Surface
    cells : int
        From one end of the range of positions to the other.
    """
    low, high = surface.positions[[1, -2]]
    width = (high - low) / cells
    edges = np.linspace(low - width, high + width, cells + 3)
    ends = (2.0 * low - high, 2.0 * high - low)
    flown = np.concatenate([_nominal(system, effects[:, position_columns], end) for end in ends])
    flown = flown[np.argsort(flown[:, 0], kind="stable")]
    speeds = np.interp(edges, flown[:, 0], flown[:, 1])
    shears = np.array([0.0, *(-np.diff(speeds) / width), 0.0])
    shears[[1, -2]] = 0.0
    others = effects.copy()
    others[:, position_columns] = 0.0
    return Axis(effects[:, position_columns], others, surface, np.array([-BEYOND, *edges, BEYOND]), shears)


def _nominal(system: FuzzySystem, position_columns: Floats, position: float) -> Floats:
    """Return the states, (n, 2), of a flight from rest with the other axes at rest."""
    program, states = interval.pack(system), np.zeros((NOMINAL_PERIODS, 2))
    states[0, 0] = position
    for k in range(NOMINAL_PERIODS - 1):
        force = interpreter.evaluate(program, states[k : k + 1])[0]
        states[k + 1] = position_columns @ np.array([*states[k], *force])
    return states
