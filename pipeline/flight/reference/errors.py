"""What chance draws for a flight, and what is worked out before it."""

from dataclasses import dataclass, field

import numpy as np

from pipeline.array_types import Floats


def _none(*shape: int) -> Floats:
    return np.zeros((0, *shape))


@dataclass(frozen=True)
class DrawnErrors:
    """What chance draws for a flight, and a layout's table; of no length where there is none.

    Attributes
    ----------
    at_start : (6,)
        First estimate minus truth.
    of_fixes, of_sight : (F, 3), (F, 4)
        Of positions, m; of ranges, m, and bearings, rad about each axis.
    of_attitude : (K+1, 3)
        From the true to the sensed attitude, rad about each body axis.
    matrices : (K or 1, 3, 3)
        From commands to forces.
    arm : (3,)
        Where thrust acts, m, body axes.
    table : (N, 6)
        Shares of a layout's thrusters in a newton along each body axis, and against it.
    more_drag : (K,)
        Beyond its constant, m/s^2.
    process : tuple
        What the filter allows for as white noise: its standard deviation, m/s^2, the distance below which
        it is the same, m, the greatest distance, m, and coefficients of 1, x and x^2 by which it is
        multiplied at x times the latter.
    margins : tuple of five float, optional
        What the safety layer keeps for errors: the radii between which it plans, m, the greatest force that
        it plans along an axis, the greatest of a stop and that of a step back, N.
    """

    at_start: Floats = field(default_factory=lambda: np.zeros(6))
    of_fixes: Floats = field(default_factory=lambda: _none(3))
    of_sight: Floats = field(default_factory=lambda: _none(4))
    of_attitude: Floats = field(default_factory=lambda: _none(3))
    matrices: Floats = field(default_factory=lambda: np.eye(3)[np.newaxis])
    arm: Floats = field(default_factory=lambda: np.zeros(3))
    table: Floats = field(default_factory=lambda: _none(6))
    more_drag: Floats = field(default_factory=_none)
    process: tuple[float, float, float, tuple[float, float, float]] = (0.0, 1.0, 1.0, (0.0, 0.0, 1.0))
    margins: tuple[float, float, float, float, float] | None = None

    def thrust(self, k: int) -> Floats:
        """Return the matrix from a command to its force in a control period."""
        return self.matrices[min(k, len(self.matrices) - 1)]
