"""Where flights differ from the deputies' model of them: navigation, thrusters, motion about the Earth."""

from typing import NamedTuple

from fis_tools.compiled.vectors import Rows
from pipeline.array_types import Floats
from pipeline.physics.orbit import Course

#: What navigation works with, a lane for each flight.
ESTIMATED: Rows = {
    "filtered": (6,),  # estimate from the fixes up to `delay` periods ago
    "covariance": (6, 6),  # its covariance
    "known": (6,),  # the same estimate, propagated to now
    "now": (6, 6),  # its covariance, where a flight is logged
    "half": (6, 6),  # scratch
    "turn": (4,),  # from the true attitude to the sensed one
    "tilt": (3,),  # the same as an angle about each axis, Hill axes
}

#: Errors of the thrusters and remaining mass, a lane for each flight.
THRUSTING: Rows = {
    "errors": (9,),  # of the flights being flown, by rows
    "mass": (),  # as a fraction of that at the start
}


class Fixes(NamedTuple):
    """Navigation of some flights: see `pipeline.flight.cases.navigation.Filter` and `Errors`."""

    is_on: bool  # False where the deputy knows its state
    stride: int
    delay: int
    start_covariance: Floats
    process: Floats
    process_per_force: Floats
    fix: float
    gate: float
    range: float
    bearing: float
    at_start: Floats
    of_fixes: Floats
    of_sight: Floats
    of_attitude: Floats


class Firing(NamedTuple):
    """Thrusters of some flights: see `pipeline.flight.cases.actuators.Thrusters` and `thrust_errors`."""

    is_on: bool  # False for ideal thrusters
    delay: int
    step: float
    least: float
    exhaust_speed: float
    dry: float
    table: Floats
    layout: Floats
    matrices: Floats
    arms: Floats


class ModelErrors(NamedTuple):
    """Differences between flights and the deputies' model of them; each part may be off."""

    fixes: Fixes
    firing: Firing
    course: Course  # about the Earth; off where motion is linear
