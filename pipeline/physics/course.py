"""The chief's true course, sample by sample: how Hill axes lie and turn on orbits that are no plain circles.

Hill axes turn by the mean motion about the orbit's normal on a circle about a sphere alone. On an ellipse
they turn at ``|R x V| / R^2`` (D. A. Vallado, Fundamentals of Astrodynamics and Applications, 4th edition,
2.2), and an oblate Earth turns the plane too; axes and rates are here those of the integrated orbit.
"""

from typing import NamedTuple

import numpy as np

from pipeline.array_types import Floats
from pipeline.physics.orbit import Course
from pipeline.physics.quaternion import from_dcm, turned


class TrueCourse(NamedTuple):
    """Hill axes at each sample, relative to those of the start, which are held fixed."""

    axes: Floats  # (K+1, 3, 3) from fixed to Hill axes
    # (K+1, 3) mean rate of Hill axes over the control period that begins, or at the last sample has ended;
    # rad/s, Hill axes of either end
    rates: Floats
    radius: Floats  # (K+1,) of the chief from the Earth's centre, m


def true_course(course: Course) -> TrueCourse:
    """Return the samples of an integrated orbit, one at each end of a control period."""
    rows = slice(None, None, 2 * course.num_steps)
    radius = np.linalg.norm(course.positions[rows], axis=1)
    axes = course.axes[rows]
    turns = _rotation_vectors(axes[1:] @ axes[:-1].transpose(0, 2, 1))
    rates = turns[[*range(len(turns)), -1]] / (course.num_steps * course.step)
    return TrueCourse(axes, rates, radius)


def turned_about(axis: Floats, angles: Floats) -> Floats:
    """Return the matrices, (m, 3, 3), that turn vectors about a unit axis by angles, rad (Rodrigues)."""
    x, y, z = axis
    across = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    sines, rests = np.sin(angles)[:, np.newaxis, np.newaxis], (2.0 * np.sin(0.5 * angles) ** 2)
    return np.asarray(np.eye(3) + sines * across + rests[:, np.newaxis, np.newaxis] * (across @ across))


def _rotation_vectors(matrices: Floats) -> Floats:
    """Return by what frames turn, (m, 3), rad, from matrices from their axes before to those after."""
    pairs = ((1, 2), (2, 0), (0, 1))
    sines = 0.5 * np.stack([matrices[:, i, j] - matrices[:, j, i] for i, j in pairs], axis=1)
    size = np.linalg.norm(sines, axis=1)
    angle = np.arctan2(size, 0.5 * (np.trace(matrices, axis1=1, axis2=2) - 1.0))
    return np.asarray(sines * (angle / size)[:, np.newaxis])


def seen_from_course(course: TrueCourse, quaternions: Floats) -> Floats:
    """Return attitudes relative to Hill axes from those relative to fixed axes.

    Parameters
    ----------
    course : TrueCourse
    quaternions : (K+1, 4)
        From fixed to body axes, scalar last.

    Returns
    -------
    (K+1, 4)
        From Hill to body axes; from sample to sample without a change of sign.
    """
    relative = np.empty_like(quaternions)
    for k, (axes, quaternion) in enumerate(zip(course.axes, quaternions, strict=True)):
        a, b, c, d = from_dcm(axes)
        relative[k] = turned((-a, -b, -c, d), quaternion, 1.0)
        if k > 0 and np.dot(relative[k], relative[k - 1]) < 0.0:
            relative[k] = -relative[k]
    return relative
