"""The rotation of a deputy that plays it from a table."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


class Turns(NamedTuple):
    """Attitudes or torques, one row per control period.

    Attributes
    ----------
    attitudes : (K, 4) array
        Reference of the attitude law, or actual attitude with ideal pointing, from Hill to body axes, scalar
        last; the last row stays. Without rows the camera is aimed at the chief.
    torques : (K, 3) array
        Instead of the attitude law's, N m, body axes, zero after the last row. Without rows the law acts.
    """

    attitudes: Floats
    torques: Floats

    def attitude(self, period: int) -> Floats:
        """Return the attitude of a control period, shape (4,), or (0,) if none is played."""
        if not len(self.attitudes):
            return np.zeros(0)
        wanted: Floats = self.attitudes[min(period, len(self.attitudes) - 1)]
        return wanted

    def torque(self, period: int, most: float) -> Floats:
        """Return the torque of a control period, each component at most `most`, or shape (0,) for none."""
        if not len(self.torques):
            return np.zeros(0)
        beyond = period >= len(self.torques)
        return np.zeros(3) if beyond else np.clip(self.torques[period], -most, most)


#: turns of a deputy that aims its camera at the chief
AIMED = Turns(np.zeros((0, 4)), np.zeros((0, 3)))
