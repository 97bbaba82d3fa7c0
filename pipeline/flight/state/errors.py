"""Where flights differ from the deputies' model of them: navigation, thrusters, motion about the Earth."""

from typing import NamedTuple

from fis_tools.compiled.vectors import Rows
from pipeline.array_types import Floats, Integers
from pipeline.physics.orbit import Course

#: constant errors that the filter may consider, three each: scales of the thrusters, and where their
#: rotations, those of the sensed attitude, biases of fixes, and squares of the attitude's rotations begin, as
#: they shift fixes and as they shorten forces
OF_ROTATION, OF_ATTITUDE, OF_FIXES, OF_SQUARES, OF_SHORTENED, MOST_CONSTANT = 3, 6, 9, 12, 15, 18
#: What navigation works with, a lane for each flight.
ESTIMATED: Rows = {
    "filtered": (6,),  # estimate from the fixes up to `delay` periods ago
    "covariance": (6, 6 + MOST_CONSTANT),  # its covariance, and beside it that with the constant errors
    "known": (6,),  # the same estimate, propagated to now
    "now": (6, 6 + MOST_CONSTANT),  # its covariance, where a flight is logged
    "half": (6, 6 + MOST_CONSTANT),  # scratch
    "pushes": (6, MOST_CONSTANT),  # of the constant errors on the state in a control period
    "innovation": (4,),  # the last fix minus the position expected, m, and its square in standard deviations
    "turn": (4,),  # from the true attitude to the sensed one
    "tilt": (3,),  # the same as an angle about each axis, Hill axes
}

#: What thrusters fire, and the remaining mass, a lane for each flight.
THRUSTING: Rows = {
    "errors": (9,),  # of the flights being flown, by rows of the matrix
    "mass": (),  # as a fraction of that at the start
}


class Filter(NamedTuple):
    """Parameters of the deputies' filter; covariances are in m and m/s."""

    stride: int  # control periods from one fix to the next
    delay: int  # control periods from a fix to its use
    at_start: Floats  # (6, 6) covariance of the first estimate
    process: Floats  # (6, 6) added to the covariance in each control period
    nearest: float  # distance from the chief from which on the former grows, m
    farthest: float  # the greatest distance allowed, m
    growth: Floats  # (3,) of its root, by powers of the distance over the greatest
    process_per_force: Floats  # (6, 6) added as well for each square newton commanded
    command_delay: int  # control periods from a command to its force
    constants: Integers  # (E,) constant errors that are considered, as numbers up to `MOST_CONSTANT`
    variances: Floats  # (E,) of them: 1, rad^2, m^2, rad^4
    fix: float  # variance of a fix along each axis, m^2
    gate: float  # square of the number of standard deviations beyond which a fix is rejected
    is_sight: bool  # whether fixes are a range and a bearing, not positions
    range: float  # further variance along the line of sight, m^2
    bearing: float  # and of its direction about each axis, rad^2
    kept: float  # share of a force that is left in the mean when it is turned with the attitude's errors
    seen: float  # share of a position that is left in the mean of its fixes, as bearings turn these


class NavigationErrors(NamedTuple):
    """Navigation errors in some flights."""

    at_start: Floats  # (m, 6) the first estimate minus the truth, m and m/s
    of_fixes: Floats  # (m, F, 3) fixes minus the truth, without errors of range and bearing, m, Hill axes
    # (m, F, 4) ranges minus the truth, m, and rotations of bearings, rad, Hill axes; no fixes if positions
    of_sight: Floats
    # (m, K+1, 3) rotation from the true to the sensed attitude, rad, body axes; no samples without this error
    of_attitude: Floats


class Fixes(NamedTuple):
    """Navigation of some flights."""

    is_on: bool  # False where the deputy knows its state
    law: Filter
    errors: NavigationErrors


class Thrusters(NamedTuple):
    """Thruster properties that all flights of a mission share."""

    delay: int  # control periods from a command to its force
    step: float  # forces are multiples of this, N; 0 for any
    least: float  # least force along an axis, N
    exhaust_speed: float  # of propellant, m/s; infinite where the mass stays
    dry: float  # share of the mass at the start that is not propellant; -1 where the mass stays
    table: Floats  # (N, 6) forces per newton along +x, +y, +z, -x, -y, -z of the body; no rows for no layout
    layout: Floats  # (N, 7) directions, torques per newton, m, body axes, and greatest forces, N
    failed: int = -1  # row of the thruster that fires nothing from a control period on; -1 for none
    fails_at: int = 0


class ThrustErrors(NamedTuple):
    """Errors of the thrusters in some flights."""

    matrices: Floats  # (m, K or 1, 3, 3) from a command to the force fired, before impulses and limits
    arms: Floats  # (m, 3) point where the thrust acts, from the centre of mass, m, body axes


class Firing(NamedTuple):
    """Thrusters of some flights."""

    is_on: bool  # False for ideal thrusters
    thrusters: Thrusters
    errors: ThrustErrors


class ModelErrors(NamedTuple):
    """Differences between flights and the deputies' model of them; each part may be off."""

    fixes: Fixes
    firing: Firing
    course: Course  # about the Earth; off where motion is linear
