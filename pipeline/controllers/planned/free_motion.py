"""Elements of free motion: an ellipse, twice as long along the track as it is high, and its centre.

Without force the deputy moves by ``x = x_c + X``, ``y = y_c + 2 Y`` with ``X = -3 x - 2 y'/n`` and
``Y = x'/n`` (Clohessy and Wiltshire, J. Aerospace Sci. 27, 1960). The pairs ``(X, Y)`` and ``(z, z'/n)``
turn at -n, as the Sun does; ``x_c`` stays, and ``y_c`` drifts at ``-1.5 n x_c``.
"""

import numpy as np

from pipeline.array_types import Floats

#: indices of the elements
CENTRE_RADIAL, CENTRE_ALONG_TRACK, RING_RADIAL, RING_ALONG_TRACK, HEIGHT, HEIGHT_RATE = range(6)


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
