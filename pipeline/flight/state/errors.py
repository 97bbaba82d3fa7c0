"""Where flights differ from the deputies' model of them: navigation, thrusters, motion about the Earth."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fis_tools.compiled.vectors import Rows
from pipeline.physics.orbit import Course

Floats = NDArray[np.float64]

#: What navigation works with, a lane for each flight.
ESTIMATED: Rows = {
    "filtered": (6,),  # estimate from the fixes up to `delay` periods ago
    "covariance": (6, 6),  # its covariance
    "known": (6,),  # the same estimate, propagated to now
    "now": (6, 6),  # its covariance, where a flight is logged
    "half": (6, 6),  # scratch
    "truth": (6,),  # while the estimate stands in its place
    "turn": (4,),  # from the true attitude to the sensed one
    "tilt": (3,),  # the same as an angle about each axis, Hill axes
    "attitude": (4,),  # the true one while the sensed one stands in its place
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
    lanes: Any  # a record of `ESTIMATED`
    fixes: Floats  # (F, 3, L) measured so far
    acting: Floats  # (K, 3, L) commanded forces, in the periods in which they act


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
    commands: Floats  # (K, 3, L) so far
    lanes: Any  # a record of `THRUSTING`
    thrust: Floats  # (N, L) of each thruster of a layout


class ModelErrors(NamedTuple):
    """Differences between flights and the deputies' model of them; each part may be off."""

    fixes: Fixes
    firing: Firing
    course: Course  # about the Earth; off where motion is linear
