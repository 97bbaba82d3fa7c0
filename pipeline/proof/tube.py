"""The tube: boxes that hold, along each axis and after each control period, every state from the starts.

Positions along an axis are divided into cells, and each cell that states may be in has one box: what of the
boxes before it moves into the cell. The shear of a box is the slope of the velocity along a nominal flight,
so that the box stays narrow while the rules brake. What happens along the other axes, which moves an axis a
little, enters as intervals.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise

import numpy as np

from fis_tools.engines import interpreter, interval
from fis_tools.model import FuzzySystem
from pipeline.array_types import Floats
from pipeline.proof.surface import BEYOND, Box, Plane, Surface

#: boxes are widened by this share of their widths and by this much, m and m/s: far more than any rounding
WIDEN_SHARE, WIDEN = 1e-7, 5e-7
#: control periods of a nominal flight
NOMINAL_PERIODS = 2000
#: on one axis: the box in each cell, with the plane of the force over it
Enclosed = dict[int, tuple[Box, Plane]]


@dataclass(frozen=True)
class Axis:
    """One axis of the closed loop.

    Parameters
    ----------
    own : (2, 3)
        Effect of its own position, velocity and force on its position and velocity after a period.
    others : (2, 9)
        Effect of the positions, velocities and forces along the other axes.
    surface : Surface
    edges : (n + 1,)
        Of the cells, m.
    shears : (n,)
        Of the box in each cell, 1/s.
    """

    own: Floats
    others: Floats
    surface: Surface
    edges: Floats
    shears: Floats

    def start(self, low: Floats, high: Floats) -> dict[int, Box]:
        """Return the boxes that hold a box of positions and velocities."""
        inner = self.edges[(self.edges > low[0]) & (self.edges < high[0])]
        parts = pairwise([low[0], *inner, high[0]])
        return self._dealt(partial(_leaning, Box(*part, low[1], high[1], 0.0)) for part in parts)

    def move(self, boxes: Enclosed, happens: Floats) -> dict[int, Box]:
        """Return the boxes after a period, while intervals, (9, 2), happen along the other axes."""
        return self._dealt(partial(self.image, *pair, happens) for pair in boxes.values())

    def _dealt(self, images: Iterable[Callable[[float], Box]]) -> dict[int, Box]:
        """Return the box of each cell around those that fall into it, given as functions of the shear."""
        boxes: dict[int, Box] = {}
        for image in images:
            whole = image(0.0)
            first = int(np.searchsorted(self.edges, whole.low, side="right")) - 1
            for cell in range(first, int(np.searchsorted(self.edges, whole.high, side="left"))):
                low, high = np.clip([whole.low, whole.high], *self.edges[cell : cell + 2]).tolist()
                # a shear is for boxes as narrow as its cell: of a wide one, what falls into the cell leans
                one = _leaning(replace(whole, low=low, high=high), self.shears[cell])
                own = image(one.shear)
                least, greatest = max(one.least, own.least), min(one.greatest, own.greatest)
                one = replace(one, least=least, greatest=greatest)
                boxes[cell] = _joined(one, boxes.get(cell, one))
        return {cell: _widened(boxes[cell]) for cell in sorted(boxes)}

    def image(self, box: Box, plane: Plane, happens: Floats, shear: float) -> Box:
        """Return a box of some shear that holds the states of a box after a period."""
        turn = np.array([[1.0, 0.0], [shear, 1.0]])
        force = turn @ self.own[:, 2]
        loop = turn @ self.own[:, :2] + np.outer(force, [plane.per_position, plane.per_velocity])
        loop = loop @ np.array([[1.0, 0.0], [-box.shear, 1.0]])
        intervals = np.array([[box.low, box.high], [box.least, box.greatest], *happens])
        factors = np.hstack([loop, turn @ self.others])
        centre = factors @ intervals.mean(axis=1) + force * plane.constant
        around = 0.5 * np.abs(factors) @ np.diff(intervals)[:, 0] + np.abs(force) * plane.residual
        (low, least), (high, greatest) = (centre - around).tolist(), (centre + around).tolist()
        return Box(low, high, least, greatest, shear)


def _leaning(box: Box, shear: float) -> Box:
    """Return a box of some shear around one without."""
    lean = sorted((shear * box.low, shear * box.high))
    return Box(box.low, box.high, box.least + lean[0], box.greatest + lean[1], shear)


def _joined(a: Box, b: Box) -> Box:
    """Return the box around two of one shear."""
    low, high = min(a.low, b.low), max(a.high, b.high)
    return Box(low, high, min(a.least, b.least), max(a.greatest, b.greatest), a.shear)


def _widened(box: Box) -> Box:
    """Return a box with room for rounding."""
    p, s = (WIDEN + WIDEN_SHARE * width for width in (box.high - box.low, box.greatest - box.least))
    return Box(box.low - p, box.high + p, box.least - s, box.greatest + s, box.shear)


def axis_of(system: FuzzySystem, effects: Floats, own: list[int], surface: Surface, cells: int) -> Axis:
    """Divide the positions along an axis into cells, and find shears along a flight from either end.

    Parameters
    ----------
    system : FuzzySystem
        Drives the axis.
    effects : (2, 9)
        Of positions, velocities and forces on position and velocity along the axis after a period.
    own : list of int
        The columns of the axis.
    surface : Surface
    cells : int
        From one end of the range of positions to the other.
    """
    low, high = surface.positions[[1, -2]]
    width = (high - low) / cells
    edges = np.linspace(low - width, high + width, cells + 3)
    ends = (2.0 * low - high, 2.0 * high - low)
    flown = np.concatenate([_nominal(system, effects[:, own], end) for end in ends])
    flown = flown[np.argsort(flown[:, 0], kind="stable")]
    speeds = np.interp(edges, flown[:, 0], flown[:, 1])
    shears = np.array([0.0, *(-np.diff(speeds) / width), 0.0])
    shears[[1, -2]] = 0.0
    others = effects.copy()
    others[:, own] = 0.0
    return Axis(effects[:, own], others, surface, np.array([-BEYOND, *edges, BEYOND]), shears)


def _nominal(system: FuzzySystem, own: Floats, position: float) -> Floats:
    """Return the states, (n, 2), of a flight from rest while nothing happens along the other axes."""
    program, states = interval.pack(system), np.zeros((NOMINAL_PERIODS, 2))
    states[0, 0] = position
    for k in range(NOMINAL_PERIODS - 1):
        force = interpreter.evaluate(program, states[k : k + 1])[0]
        states[k + 1] = own @ np.array([*states[k], *force])
    return states
