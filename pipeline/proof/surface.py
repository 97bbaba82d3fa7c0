"""The force that rules ask for, enclosed over a grid of cells of position and velocity."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from fis_tools.engines import interval
from fis_tools.model import FuzzySystem
from pipeline.array_types import Floats

#: cells from one end of an input's range to the other; beyond its ends, where the input is clipped, one more
CELLS = (160, 240)
#: farther and faster than any deputy, m and m/s
BEYOND = 1e6
#: residuals are this much greater than found, and by this many N, so that others who bound forces agree
MORE, ROUNDING_N = 1.1, 1e-6


@dataclass(frozen=True)
class Box:
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

    def ends(self, box: Box) -> tuple[float, float]:
        """Return the least and greatest force over a box."""
        across = self.per_position - self.per_velocity * box.shear, self.per_velocity
        middle = across[0] * (box.low + box.high) / 2 + across[1] * (box.least + box.greatest) / 2
        around = abs(across[0]) * (box.high - box.low) / 2 + abs(across[1]) * (box.greatest - box.least) / 2
        around += self.residual
        return self.constant + middle - around, self.constant + middle + around


@dataclass(frozen=True)
class Surface:
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

    def plane(self, box: Box) -> Plane:
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


def surface_of(system: FuzzySystem, dead_band_n: float, max_force_n: float) -> Surface:
    """Bound the force of a system of position and velocity over its cells."""
    positions, velocities = (
        np.array([-BEYOND, *np.linspace(one.minimum, one.maximum, cells + 1), BEYOND])
        for one, cells in zip(system.inputs, CELLS, strict=True)
    )
    corners = [
        np.stack(np.meshgrid(positions[part], velocities[part], indexing="ij"), axis=-1)
        for part in (slice(None, -1), slice(1, None))
    ]
    bounds = interval.bound(interval.pack(system), *(each.reshape(-1, 2) for each in corners))
    low, high = (each.reshape(corners[0].shape[:2]) for each in bounds[:2])
    is_cut = (low < dead_band_n) & (high > -dead_band_n)
    low, high = np.where(is_cut, np.minimum(low, 0.0), low), np.where(is_cut, np.maximum(high, 0.0), high)
    return Surface(
        positions,
        velocities,
        np.clip(low, -max_force_n, max_force_n),
        np.clip(high, -max_force_n, max_force_n),
    )
