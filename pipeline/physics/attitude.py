"""The deputy's desired attitude and its control torque, and the rotation of a chief that tumbles freely.

The desired axes are ``x* = r/|r|``, ``y* = k x r/|k x r|`` and ``z* = x* x y*``, so that a camera along -x*
looks at the chief. Over the poles of the orbit plane, where k x r vanishes, the previous y* is kept instead.
Positions (m, not at the origin) and axes (unit vectors) are in Hill axes. Of a chief,
attitudes have the shape (4,), from Hill to chief axes, scalar last; inertias (3, 3); inertial rates and
torques (3,), in body axes; all SI units.
"""

from math import atan2, cos, sin

import numpy as np

from fis_tools.compiled.decorator import compiled
from fis_tools.compiled.three import Three, cross, dot, length, three_of, times
from pipeline.array_types import Floats
from pipeline.physics.quaternion import dcm_b_from_h, derivative, normalised

#: |k x r|/|r| below which y* is not defined by the position
POLE = 1e-3
#: |k x r|/|r| below which pole blending carries y* along
BLENDED_POLE = 0.2
#: rate at which pole blending lets y* return, rad/s
RETURN_RATE = 0.005


@compiled(error_model="numpy")
def _carried_y(x: Three, previous_y: Three) -> Three:
    """Return the previous y* made orthogonal to x*."""
    y = previous_y - dot(previous_y, x) * x
    if length(y) < 1e-9:  # the previous y* lies along x*: any other axis will do
        y = cross(x, Three(1.0, 0.0, 0.0)) if abs(x.x) < 0.9 else cross(x, Three(0.0, 1.0, 0.0))
    return y / length(y)


@compiled(error_model="numpy")
def desired_y(position_h: Three, previous_y_h: Three) -> Three:
    """Return the desired second body axis, from that at the previous instant; (0, 1, 0) before the first."""
    distance, horizontal = length(position_h), Three(-position_h.y, position_h.x, 0.0)
    if length(horizontal) < POLE * distance:
        return _carried_y(position_h / distance, previous_y_h)
    return horizontal / length(horizontal)


@compiled(error_model="numpy")
def blended_y(position_h: Three, previous_y_h: Three, attitude_period: float) -> Three:
    """Return the desired second body axis, without fast turns over a pole.

    Where ``|k x r|/|r|`` is below `BLENDED_POLE` the axis of an attitude period (s) ago is kept; elsewhere it
    returns to ``k x r/|k x r|`` by a turn about x* at a rate of at most `RETURN_RATE`. The first is
    `desired_y`.
    """
    distance, horizontal = length(position_h), Three(-position_h.y, position_h.x, 0.0)
    x = position_h / distance
    carried = _carried_y(x, previous_y_h)
    if length(horizontal) < BLENDED_POLE * distance:
        return carried
    goal, sideways = horizontal / length(horizontal), cross(x, carried)
    angle = atan2(dot(goal, sideways), dot(goal, carried))
    most = RETURN_RATE * attitude_period
    if abs(angle) <= most:
        return goal
    turn = most if angle > 0.0 else -most
    return cos(turn) * carried + sin(turn) * sideways


@compiled(error_model="numpy")
def desired_dcm(position_h: Three, y_h: Three) -> Floats:
    """Return the desired attitude as a matrix from Hill to body components, with rows x*, y*, z*."""
    x = position_h / length(position_h)
    return np.array((x, y_h, cross(x, y_h)))


#: tolerance for the attitude of a tumbling chief at the end of a flight, applied to two errors, rad
TUMBLING_TOLERANCE_RAD = 1e-4


@compiled(error_model="numpy", forceinline=True)
def euler(inertia: Floats, inverse_inertia: Floats, inertial_rate: Three, torque: Three) -> Three:
    """Return the rate of change of an inertial rate, ``J^-1 (tau - w x J w)``: Euler's equation."""
    return times(inverse_inertia, torque - cross(inertial_rate, times(inertia, inertial_rate)))


def longest_tumbling_step(
    inertia: Floats, inertial_rate_c: Floats, mean_motion: float, duration: float
) -> float:
    """Return the longest step that keeps a torque-free chief accurate over a flight.

    The fourth-order Runge-Kutta method turns a harmonic motion of rate w by ``w (w h)^4 / 120`` too slowly,
    and damps it by ``w (w h)^5 / 144`` (its stability function on the imaginary axis; Hairer, Norsett and
    Wanner, Solving Ordinary Differential Equations I, II.1), which changes its angle with the square of time.
    Each of the two angles stays below `TUMBLING_TOLERANCE_RAD`, with w the fastest possible rate of the chief
    at the energy of its rate at the start.
    """
    energy = inertial_rate_c @ inertia @ inertial_rate_c
    rate = float(np.sqrt(energy / np.linalg.eigvalsh(inertia)[0])) + mean_motion
    turned = rate * duration
    slowed = (120.0 * TUMBLING_TOLERANCE_RAD / turned) ** (1.0 / 4.0)
    damped = (288.0 * TUMBLING_TOLERANCE_RAD / turned**2) ** (1.0 / 5.0)
    return float(min(slowed, damped) / rate)


@compiled
def tumble(
    quaternion_c_from_h: Floats,
    inertial_rate_c: Floats,
    inertia: Floats,
    inverse_inertia: Floats,
    mean_motion: float,
    duration: float,
    num_steps: int,
) -> tuple[Floats, Floats]:
    """Return attitude and rate of a torque-free chief after steps of the classical Runge-Kutta method."""
    hill_rate, free, step = Three(0.0, 0.0, mean_motion), Three(0.0, 0.0, 0.0), duration / num_steps
    attitude, rate = quaternion_c_from_h, three_of(inertial_rate_c)
    for _ in range(num_steps):
        q, w, q_next, w_next = attitude, rate, attitude, rate
        for stage in range(4):
            q_rate = derivative(q, w - times(dcm_b_from_h(q), hill_rate))
            w_rate = euler(inertia, inverse_inertia, w, free)
            weight = step / 3.0 if 0 < stage < 3 else step / 6.0
            q_next, w_next = q_next + weight * q_rate, w_next + weight * w_rate
            reach = step if stage == 2 else 0.5 * step  # to where the next stage is
            q, w = attitude + reach * q_rate, rate + reach * w_rate
        attitude, rate = normalised(q_next), w_next
    return attitude, np.array(rate)
