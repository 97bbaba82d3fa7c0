"""Unit quaternions ``[q1, q2, q3, q4]``, shape (4,), scalar last, for transforms between two frames' axes.

`dcm_b_from_h` gives ``v_b = C(q) v_h`` (Choi, Kim and Leeghim, AAS 25-727, the matrix C_DC). Read as an
active rotation, the same four numbers turn body vectors into Hill vectors. All arrays are float64.
"""

from math import sqrt

import numpy as np

from fis_tools.compiled.decorator import compiled, plainly
from fis_tools.compiled.three import Three, dot
from fis_tools.compiled.vectors import Vector
from pipeline.array_types import Floats

#: components of floats, or of vectors with a lane for each flight
Quaternion = tuple[Vector, Vector, Vector, Vector]


@compiled(error_model="numpy", forceinline=True)
def axes_of(q: Quaternion) -> tuple[Three, Three, Three]:
    """Return the body axes of attitudes in Hill axes: the rows of the matrix from Hill to body."""
    q1, q2, q3, q4 = q
    return (
        Three(q1 * q1 - q2 * q2 - q3 * q3 + q4 * q4, 2 * (q1 * q2 + q3 * q4), 2 * (q1 * q3 - q2 * q4)),
        Three(2 * (q1 * q2 - q3 * q4), -q1 * q1 + q2 * q2 - q3 * q3 + q4 * q4, 2 * (q2 * q3 + q1 * q4)),
        Three(2 * (q1 * q3 + q2 * q4), 2 * (q2 * q3 - q1 * q4), -q1 * q1 - q2 * q2 + q3 * q3 + q4 * q4),
    )


@compiled(error_model="numpy", forceinline=True)
def to_hill(q: Quaternion, a: Three) -> Three:
    """Transform vectors from body to Hill axes."""
    x, y, z = axes_of(q)
    return Three(
        x.x * a.x + (y.x * a.y + z.x * a.z),  # in this order, so that recorded flights stay as they are
        x.y * a.x + y.y * a.y + z.y * a.z,
        x.z * a.x + y.z * a.y + z.z * a.z,
    )


@compiled(error_model="numpy", forceinline=True)
def to_body(q: Quaternion, a: Three) -> Three:
    """Transform vectors from Hill to body axes."""
    x, y, z = axes_of(q)
    return Three(dot(x, a), dot(y, a), dot(z, a))


@compiled(error_model="numpy", forceinline=True)
def turned(q: Quaternion, turn: Quaternion, sign: float) -> Quaternion:
    """Return attitudes turned about their body axes, or turned back if way is -1."""
    q1, q2, q3, q4 = q
    a, b, c, d = sign * turn[0], sign * turn[1], sign * turn[2], turn[3]
    return (
        q4 * a + q1 * d + q2 * c - q3 * b,
        q4 * b + q2 * d + q3 * a - q1 * c,
        q4 * c + q3 * d + q1 * b - q2 * a,
        q4 * d - q1 * a - q2 * b - q3 * c,
    )


@compiled
def dcm_b_from_h(quaternion_b_from_h: Floats) -> Floats:
    """Return the matrix from Hill to body components, shape (3, 3): its rows are the body axes."""
    q1, q2, q3, q4 = quaternion_b_from_h
    return np.array(axes_of((q1, q2, q3, q4)))


def dcms_b_from_h(quaternions_b_from_h: Floats) -> Floats:
    """Return the matrix of `dcm_b_from_h` for each of K attitudes, (K, 4), without compiling; (K, 3, 3)."""
    with plainly("pipeline"):
        return np.ascontiguousarray(np.moveaxis(np.array(axes_of(tuple(quaternions_b_from_h.T))), -1, 0))


def seen_from_hill(quaternions_b_from_h: Floats, vector_b: Floats) -> Floats:
    """Transform a vector from body to Hill axes at each of K attitudes, (K, 4); return shape (K, 3)."""
    return np.array([dcm.T @ vector_b for dcm in dcms_b_from_h(quaternions_b_from_h)])


@compiled
def normalised(quaternion: Floats) -> Floats:
    """Return the quaternion scaled to unit length, shape (4,)."""
    q1, q2, q3, q4 = quaternion
    return quaternion / sqrt(q1 * q1 + q2 * q2 + q3 * q3 + q4 * q4)


@compiled
def from_dcm(dcm: Floats) -> tuple[float, float, float, float]:
    """Return the unit quaternion of a direction cosine matrix, in the sense of `dcm_b_from_h`.

    Its largest component is positive; among equal ones the last (Shepperd, Journal of Guidance and Control
    1(3), 1978).
    """
    xx, xy, xz = dcm[0]
    yx, yy, yz = dcm[1]
    zx, zy, zz = dcm[2]
    trace, x, y, z, w = xx + yy + zz, 0.0, 0.0, 0.0, 0.0
    if trace >= xx and trace >= yy and trace >= zz:
        w = 0.5 * sqrt(1.0 + trace)
        scale = 0.25 / w
        x, y, z = (yz - zy) * scale, (zx - xz) * scale, (xy - yx) * scale
    elif zz >= (yy if yy >= xx else xx):
        z = 0.5 * sqrt(1.0 - trace + 2.0 * zz)
        scale = 0.25 / z
        x, y, w = (zx + xz) * scale, (zy + yz) * scale, (xy - yx) * scale
    elif yy >= xx:
        y = 0.5 * sqrt(1.0 - trace + 2.0 * yy)
        scale = 0.25 / y
        z, x, w = (yz + zy) * scale, (yx + xy) * scale, (zx - xz) * scale
    else:
        x = 0.5 * sqrt(1.0 - trace + 2.0 * xx)
        scale = 0.25 / x
        y, z, w = (xy + yx) * scale, (xz + zx) * scale, (yz - zy) * scale
    size = sqrt(x * x + y * y + z * z + w * w)
    return x / size, y / size, z / size, w / size


@compiled
def derivative(quaternion_b_from_h: Floats, angular_velocity_b: Three) -> Floats:
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
