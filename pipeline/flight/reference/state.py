"""What a flight carries from one sample to the next, and what is known at a sample."""

from dataclasses import dataclass, field

import numpy as np
from scipy.spatial.transform import Rotation

from pipeline.array_types import Booleans, Floats
from pipeline.flight.reference.navigation import Belief, Innovation


@dataclass
class ReferenceState:
    """What a flight carries from one sample to the next.

    Attributes
    ----------
    truth : (6,)
        Position and velocity, m and m/s.
    attitude, rate
        Of the deputy, relative to Hill; the rate along body axes, rad/s.
    momentum : (3,)
        Of body and wheels, N m s, Hill axes.
    y : (3,) or None
        The desired second body axis of the last attitude instant; None before the first.
    is_inspected : (P,)
    centres : (C, 3)
        Of the last sample's clusters, m.
    belief : Belief or None
        None where the deputy knows its state.
    mass : float
        kg.
    spent : float
        Delta-v so far, m/s.
    commands : list of (3,)
        Forces as meant for ideal thrusters, N.
    planned : (n, 3)
        Forces from `planned_at` on, a sample, by a controller that plans in flight, N.
    """

    truth: Floats
    attitude: Rotation
    rate: Floats
    momentum: Floats
    y: Floats | None
    is_inspected: Booleans
    centres: Floats
    belief: Belief | None
    mass: float
    spent: float = 0.0
    commands: list[Floats] = field(default_factory=list)
    planned: Floats = field(default_factory=lambda: np.zeros((0, 3)))
    planned_at: int = 0


@dataclass
class Look:
    """What is known at a sample.

    Attributes
    ----------
    attitude, sensed
        The true attitude, and as the deputy senses it.
    is_lit, is_inspected : (P,)
    candidates : (m, 3)
        Points lit and not yet inspected, m.
    target : (3,)
        p_u, m; zeros without candidates.
    known, covariance : (6,), (6, 6)
        The state as the deputy knows it.
    y : (3,)
        The desired second body axis for where it believes to be.
    innovation : Innovation or None
        Of a fix that comes into use.
    """

    attitude: Rotation
    sensed: Rotation
    is_lit: Booleans
    is_inspected: Booleans
    candidates: Floats
    target: Floats
    known: Floats
    covariance: Floats
    y: Floats
    innovation: Innovation | None = None
