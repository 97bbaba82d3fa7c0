"""Free motion in its elements: an ellipse, twice as long along the track as it is high, and its centre.

Without force the deputy moves by ``x = x_c + X``, ``y = y_c + 2 Y`` with ``X = -3 x - 2 y'/n`` and
``Y = x'/n`` (Clohessy and Wiltshire, J. Aerospace Sci. 27, 1960). The pairs ``(X, Y)`` and ``(z, z'/n)``
turn at -n, as the Sun does; ``x_c`` stays, and ``y_c`` drifts at ``-1.5 n x_c``.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fis_tools.engines.compiled import compiled
from pipeline.flight.log import Scenario
from pipeline.flight.reference.safety import SafetyWorld, assured, safety_world_of
from pipeline.physics.clohessy_wiltshire import input_matrix, propagate, state_transition
from pipeline.settings.experiment import Mission

Floats = NDArray[np.float64]

#: places of the elements
CENTRE_RADIAL, CENTRE_ALONG_TRACK, RING_RADIAL, RING_ALONG_TRACK, HEIGHT, HEIGHT_RATE = range(6)


@dataclass(frozen=True)
class Motion:
    """How states move by a control period.

    Parameters
    ----------
    mean_motion : float
        rad/s.
    transition : (6, 6)
        Free motion over a period.
    control : (6, 3)
        What 1 N held over it adds.
    num_controls : int
        Periods of a flight.
    safety : SafetyWorld
        The safety layer, which corrects what is planned too.
    """

    mean_motion: float
    transition: Floats
    control: Floats
    num_controls: int
    safety: SafetyWorld


def motion_of(mission: Mission) -> Motion:
    """Return how a mission's deputy moves."""
    mean_motion, period = mission.orbit.mean_motion_rad_s, mission.control_period_s
    return Motion(
        mean_motion=mean_motion,
        transition=state_transition(mean_motion, period),
        control=input_matrix(mean_motion, period, mission.deputy.mass_kg),
        num_controls=mission.num_controls,
        safety=safety_world_of(mission),
    )


@compiled(nogil=True)
def advance(safety: SafetyWorld, state: Floats, asked: Floats) -> Floats:
    """Move a state by a period, by the force that the safety layer makes of the one that is asked for."""
    force = assured(safety, state, asked)[0] if safety.is_on else asked
    return propagate(state, force, safety.transition, safety.control)


def start_of(scenario: Scenario) -> Floats:
    """Return the state of a start, shape (6,): m and m/s, Hill axes."""
    return np.concatenate([scenario.position_m, scenario.velocity_m_s]).astype(np.float64)


def elements_matrix(mean_motion: float) -> Floats:
    """Return the matrix from states to elements ``x_c, y_c, X, Y, z, z'/n``, all in m, shape (6, 6)."""
    n = mean_motion
    return np.array(
        [
            [4.0, 0.0, 0.0, 0.0, 2.0 / n, 0.0],
            [0.0, 1.0, 0.0, -2.0 / n, 0.0, 0.0],
            [-3.0, 0.0, 0.0, 0.0, -2.0 / n, 0.0],
            [0.0, 0.0, 0.0, 1.0 / n, 0.0, 0.0],
            [0.0, 0.0, 1.0, 0.0, 0.0, 0.0],
            [0.0, 0.0, 0.0, 0.0, 0.0, 1.0 / n],
        ]
    )


def free_path(state: Floats, transition: Floats, num_samples: int) -> Floats:
    """Return the states that free motion passes, the first being `state`, shape (num_samples, 6)."""
    path = np.empty((num_samples, 6))
    path[0] = state
    for k in range(1, num_samples):
        path[k] = transition @ path[k - 1]
    return path
