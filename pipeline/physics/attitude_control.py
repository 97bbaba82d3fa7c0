"""The deputy's desired attitude, and the control torque.

The desired axes are ``x* = r/|r|``, ``y* = k x r/|k x r|`` and ``z* = x* x y*``, so that a camera along -x*
looks at the chief. Over the poles of the orbit plane, where k x r vanishes, the previous y* is kept instead.
Positions (m, not at the origin) and axes (unit vectors) have the shape (3,), Hill axes.
"""

from math import atan2, cos, sin

import numpy as np

from fis_tools.compiled.decorator import compiled
from pipeline.array_types import Floats
from pipeline.physics.vectors import assign, cross, dot, norm

#: y* before the first instant, Hill axes
FIRST_Y = (0.0, 1.0, 0.0)
#: |k x r|/|r| below which y* is not defined by the position
POLE = 1e-3
#: |k x r|/|r| below which pole blending carries y* along
BLENDED_POLE = 0.2
#: rate at which pole blending lets y* return, rad/s
RETURN_RATE = 0.005


@compiled
def _carried_y(x: Floats, previous_y: Floats) -> Floats:
    """Return the previous y* made orthogonal to x*, shape (3,)."""
    y = previous_y - dot(previous_y, x) * x
    length = norm(y)
    if length < 1e-9:  # the previous y* lies along x*: any other axis will do
        y = cross(x, np.array([1.0, 0.0, 0.0])) if abs(x[0]) < 0.9 else cross(x, np.array([0.0, 1.0, 0.0]))
        length = norm(y)
    return y / length


@compiled
def desired_y(position_h: Floats, previous_y_h: Floats) -> Floats:
    """Return the desired second body axis, from that at the previous instant; `FIRST_Y` before the first."""
    distance = norm(position_h)
    horizontal = np.array([-position_h[1], position_h[0], 0.0])
    length = norm(horizontal)
    if length < POLE * distance:
        return _carried_y(position_h / distance, previous_y_h)
    return horizontal / length


@compiled
def blended_y(position_h: Floats, previous_y_h: Floats, attitude_period: float) -> Floats:
    """Return the desired second body axis, without fast turns over a pole.

    Where ``|k x r|/|r|`` is below `BLENDED_POLE` the axis of an attitude period (s) ago is kept; elsewhere it
    returns to ``k x r/|k x r|`` by a turn about x* at a rate of at most `RETURN_RATE`. The first is
    `desired_y`.
    """
    distance = norm(position_h)
    x = position_h / distance
    carried = _carried_y(x, previous_y_h)
    horizontal = np.array([-position_h[1], position_h[0], 0.0])
    length = norm(horizontal)
    if length < BLENDED_POLE * distance:
        return carried
    goal = horizontal / length
    sideways = cross(x, carried)
    angle = atan2(dot(goal, sideways), dot(goal, carried))
    most = RETURN_RATE * attitude_period
    if abs(angle) <= most:
        return goal
    turn = most if angle > 0.0 else -most
    return cos(turn) * carried + sin(turn) * sideways


@compiled
def desired_dcm(position_h: Floats, y_h: Floats) -> Floats:
    """Return the desired attitude as a matrix from Hill to body components, with rows x*, y*, z*."""
    dcm = np.empty((3, 3))
    assign(dcm[0], position_h / norm(position_h))
    assign(dcm[1], y_h)
    assign(dcm[2], cross(dcm[0], y_h))
    return dcm
