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
    rates: Floats  # (K+1, 3) of Hill axes, rad/s, Hill axes
    radius: Floats  # (K+1,) of the chief from the Earth's centre, m


def true_course(course: Course) -> TrueCourse:
    """Return the samples of an integrated orbit, one at each end of a control period."""
    rows = slice(None, None, 2 * course.num_steps)
    radius = np.linalg.norm(course.positions[rows], axis=1)
    return TrueCourse(course.axes[rows], course.turning[rows], radius)


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
