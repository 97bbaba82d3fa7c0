"""The rotation of a deputy that plays it from a table."""

from typing import NamedTuple

import numpy as np

from pipeline.array_types import Floats


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


#: turns of a deputy that aims its camera at the chief
AIMED = Turns(np.zeros((0, 4)), np.zeros((0, 3)))
