"""What a flight carries from one sample to the next: the truth, and what the deputy believes."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation


@dataclass
class State:
    """What a flight carries from one sample to the next.

    Attributes
    ----------
    truth : (6,)
        Position and velocity, m and m/s.
    attitude, rate
        Of the deputy, relative to Hill; the rate along body axes, rad/s.
    y : (3,) or None
        The desired second body axis of the last attitude instant; None before the first.
    is_inspected : (P,)
    centres : (C, 3)
        Of the last sample's clusters, m.
    belief : Belief or None
        None where the deputy knows its state.
    commands : list of (3,)
        Forces as meant for ideal thrusters, N.
    mass, spent : float
        kg, and delta-v so far, m/s.
    """

    truth: np.ndarray
    attitude: Rotation
    rate: np.ndarray
    y: np.ndarray | None
    is_inspected: np.ndarray
    centres: np.ndarray
    belief: Any
    commands: list
    mass: float
    spent: float
