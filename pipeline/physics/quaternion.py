"""Unit quaternions ``[q1, q2, q3, q4]``, shape (4,), scalar last, for transforms between two frames' axes.

`dcm_b_from_h` gives ``v_b = C(q) v_h`` (Choi, Kim and Leeghim, AAS 25-727, the matrix C_DC). Read as an
active rotation, the same four numbers turn body vectors into Hill vectors. All arrays are float64.
"""

from math import sqrt

import numpy as np

from fis_tools.compiled.decorator import compiled
from pipeline.array_types import Floats


@compiled
def dot(a: Floats, b: Floats) -> float:
    """Return the scalar product of two vectors of shape (3,)."""
    return float(a[0] * b[0] + a[1] * b[1] + a[2] * b[2])


@compiled
def norm(a: Floats) -> float:
    """Return the length of a vector of shape (3,)."""
    return sqrt(a[0] * a[0] + a[1] * a[1] + a[2] * a[2])


@compiled
def cross(a: Floats, b: Floats) -> Floats:
    """Return the vector product of two vectors of shape (3,)."""
    return np.array([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])


@compiled
def times(matrix: Floats, a: Floats) -> Floats:
    """Return ``matrix @ a`` for shapes (3, 3) and (3,)."""
    return np.array(
        [
            matrix[0, 0] * a[0] + matrix[0, 1] * a[1] + matrix[0, 2] * a[2],
            matrix[1, 0] * a[0] + matrix[1, 1] * a[1] + matrix[1, 2] * a[2],
            matrix[2, 0] * a[0] + matrix[2, 1] * a[1] + matrix[2, 2] * a[2],
        ]
    )


@compiled(error_model="numpy")
def assign(target: Floats, source: Floats) -> None:
    """Write the elements of one vector, shape (n,), into another.

    Compiled assignments to slices include an error message for different shapes, and with it some eighty
    string functions to compile.
    """
    for i in range(len(target)):
        target[i] = source[i]


@compiled
def dcm_b_from_h(quaternion_b_from_h: Floats) -> Floats:
    """Return the matrix from Hill to body components, shape (3, 3): its rows are the body axes."""
    q1, q2, q3, q4 = quaternion_b_from_h
    dcm = np.empty((3, 3))
    dcm[0, 0] = q1 * q1 - q2 * q2 - q3 * q3 + q4 * q4
    dcm[0, 1] = 2.0 * (q1 * q2 + q3 * q4)
    dcm[0, 2] = 2.0 * (q1 * q3 - q2 * q4)
    dcm[1, 0] = 2.0 * (q1 * q2 - q3 * q4)
    dcm[1, 1] = -q1 * q1 + q2 * q2 - q3 * q3 + q4 * q4
    dcm[1, 2] = 2.0 * (q2 * q3 + q1 * q4)
    dcm[2, 0] = 2.0 * (q1 * q3 + q2 * q4)
    dcm[2, 1] = 2.0 * (q2 * q3 - q1 * q4)
    dcm[2, 2] = -q1 * q1 - q2 * q2 + q3 * q3 + q4 * q4
    return dcm


@compiled
def normalised(quaternion: Floats) -> Floats:
    """Return the quaternion scaled to unit length, shape (4,)."""
    q1, q2, q3, q4 = quaternion
    return quaternion / sqrt(q1 * q1 + q2 * q2 + q3 * q3 + q4 * q4)


@compiled
def from_dcm(dcm: Floats) -> Floats:
    """Return the unit quaternion of a direction cosine matrix, in the sense of `dcm_b_from_h`.

    Its largest component is positive; among equal ones the last (Shepperd, Journal of Guidance and Control
    1(3), 1978).
    """
    trace = dcm[0, 0] + dcm[1, 1] + dcm[2, 2]
    if trace >= dcm[0, 0] and trace >= dcm[1, 1] and trace >= dcm[2, 2]:
        double = sqrt(1.0 + trace)
        scale = 0.5 / double
        q1 = (dcm[1, 2] - dcm[2, 1]) * scale
        q2 = (dcm[2, 0] - dcm[0, 2]) * scale
        q3 = (dcm[0, 1] - dcm[1, 0]) * scale
        q4 = 0.5 * double
    elif dcm[2, 2] >= dcm[0, 0] and dcm[2, 2] >= dcm[1, 1]:
        double = sqrt(1.0 - trace + 2.0 * dcm[2, 2])
        scale = 0.5 / double
        q1 = (dcm[2, 0] + dcm[0, 2]) * scale
        q2 = (dcm[1, 2] + dcm[2, 1]) * scale
        q3 = 0.5 * double
        q4 = (dcm[0, 1] - dcm[1, 0]) * scale
    elif dcm[1, 1] >= dcm[0, 0]:
        double = sqrt(1.0 - trace + 2.0 * dcm[1, 1])
        scale = 0.5 / double
        q1 = (dcm[0, 1] + dcm[1, 0]) * scale
        q2 = 0.5 * double
        q3 = (dcm[1, 2] + dcm[2, 1]) * scale
        q4 = (dcm[2, 0] - dcm[0, 2]) * scale
    else:
        double = sqrt(1.0 - trace + 2.0 * dcm[0, 0])
        scale = 0.5 / double
        q1 = 0.5 * double
        q2 = (dcm[0, 1] + dcm[1, 0]) * scale
        q3 = (dcm[2, 0] + dcm[0, 2]) * scale
        q4 = (dcm[1, 2] - dcm[2, 1]) * scale
    return normalised(np.array([q1, q2, q3, q4]))


@compiled
def derivative(quaternion_b_from_h: Floats, angular_velocity_b: Floats) -> Floats:
    """Return the time derivative of an attitude, 1/s, at a rate relative to its frame, rad/s, body axes.

    ``q_v' = -1/2 [w x] q_v + 1/2 q4 w`` and ``q4' = -1/2 w . q_v`` (Choi, Kim and Leeghim, AAS 25-727).
    """
    q1, q2, q3, q4 = quaternion_b_from_h
    w1, w2, w3 = angular_velocity_b
    return np.array(
        [
            0.5 * (q4 * w1 - w2 * q3 + w3 * q2),
            0.5 * (q4 * w2 - w3 * q1 + w1 * q3),
            0.5 * (q4 * w3 - w1 * q2 + w2 * q1),
            -0.5 * (w1 * q1 + w2 * q2 + w3 * q3),
        ]
    )
