"""Free motion in its elements: an ellipse, twice as long along the track as it is high, and its centre.

Without force the deputy moves by ``x = x_c + X``, ``y = y_c + 2 Y`` with ``X = -3 x - 2 y'/n`` and
``Y = x'/n`` (Clohessy and Wiltshire, J. Aerospace Sci. 27, 1960). The pairs ``(X, Y)`` and ``(z, z'/n)``
turn at -n, as the Sun does; ``x_c`` stays, and ``y_c`` drifts at ``-1.5 n x_c``.
"""

import numpy as np
from numpy.typing import NDArray

from fis_tools.engines.compiled import compiled
from pipeline.flight.kernel.arrays import World
from pipeline.flight.kernel.safety import corrected
from pipeline.flight.log import Scenario
from pipeline.physics.motion import propagate

Floats = NDArray[np.float64]

#: places of the elements
CENTRE_RADIAL, CENTRE_ALONG_TRACK, RING_RADIAL, RING_ALONG_TRACK, HEIGHT, HEIGHT_RATE = range(6)


@compiled(nogil=True, error_model="numpy")
def advance(world: World, state: Floats, asked: Floats) -> Floats:
    """Move a state by a period, by the force that the safety layer makes of the one that is asked for."""
    return propagate(world.motion, state, corrected(world, state, asked) if world.guard.is_on else asked)


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
