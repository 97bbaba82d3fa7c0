"""What chance draws for a flight, and what is worked out beforehand."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np


@dataclass(frozen=True)
class Errors:
    """What chance draws for a flight, and a layout's table; of no length where there is none.

    Attributes
    ----------
    at_start : (6,)
        First estimate minus truth.
    of_fixes, of_sight : (F, 3), (F, 4)
        Of places, m; of ranges, m, and bearings, rad about each axis.
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
    margins : (4,), optional
        What the safety layer keeps for errors: the radii between which it plans, m, the greatest force that
        it plans along an axis and the force of a step back, N.
    """

    at_start: Any = field(default_factory=lambda: np.zeros(6))
    of_fixes: Any = ()
    of_sight: Any = ()
    of_attitude: Any = ()
    matrices: Any = field(default_factory=lambda: np.eye(3)[np.newaxis])
    arm: Any = field(default_factory=lambda: np.zeros(3))
    table: Any = ()
    more_drag: Any = ()
    margins: Any = None

    def thrust(self, k):
        """The matrix from a command to its force in a control period."""
        return self.matrices[min(k, len(self.matrices) - 1)]
