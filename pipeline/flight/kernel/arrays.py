"""What compiled flights work on: what they share, what they carry, and what they write down, as arrays.

Up to `LANES` flights of one controller run side by side, so that vector units work on all of them. What a
lane carries are rows of one flat array, lanes fastest: with one array the compiler knows what may overlap.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fis_tools.engines.kernel import LANES
from pipeline.physics.motion import Motion, Stop

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

#: columns of a row of outcomes
DELTA_V, INSPECTED, MEAN_DISTANCE, MIN_DISTANCE, MAX_DISTANCE, OUTSIDE = 0, 1, 2, 3, 4, 5
SAFETY_PERIODS, SAFETY_DELTA_V, NUM_OUTCOMES = 6, 7, 8


class Guard(NamedTuple):
    """What the safety layer keeps to, see `kernel.safety`; without numbers where it is off."""

    is_on: bool
    keep_out: float  # m
    keep_in: float  # m
    speed_at_chief: float  # v0 - v1 d0, m/s
    speed_slope: float  # v1, 1/s
    braking_force: float  # N
    stop: Stop  # within a control period
    places: Motion  # (2 + J) a state itself, stopped, and after 1 ... J periods of free drift
    num_kept_out: int  # rows of places that are kept out of the inner sphere
    num_kept_in: int  # and in the outer one


class World(NamedTuple):
    """What all flights of a mission share, as numbers and arrays in SI."""

    num_controls: int
    num_attitude_steps: int
    mean_motion: float
    control_period: float
    attitude_period: float
    acceleration_per_force: float
    motion: Motion  # over a control period
    instants: Motion  # over 0, 1, … S-1 attitude periods
    orbit_parts: Motion  # over parts of an orbit
    preview_stride: int  # control periods between the samples of a preview
    strides: Motion  # over 0, 1, … preview_stride control periods
    points: Floats  # (K+1 or 1, 3, P padded), Hill axes
    num_points: int
    sun_threshold: float  # a point is lit where p . s exceeds it, m
    horizon: float  # a point is above the horizon where p . r reaches it, m^2
    cos_half_angle_squared: float
    boresight: Floats  # (3,) body axes
    is_spherical: bool
    inertia: Floats  # (3, 3)
    inverse_inertia: Floats  # (3, 3)
    proportional_gain: Floats  # (3, 3) N m
    derivative_gain: Floats  # (3, 3) N m s
    max_torque: float
    max_force: float
    min_distance: float
    max_distance: float
    is_attitude_ideal: bool
    has_pole_blending: bool
    has_clusters: bool
    coasts_when_complete: bool
    guard: Guard


class Law(NamedTuple):
    """What one controller commands, for a controller with fuzzy systems or with a plan of forces."""

    axes: Integers  # (F,) which component each system drives
    signals: Integers  # (F, 3) slots of the signals it senses
    needs: int  # what must be computed for them, see `pipeline.flight.signals`
    num_inputs: Integers  # (F,)
    layout: Any  # of `fis_tools.engines.packing.Packed`
    constants: int  # where the controller's constants begin among its values; -1 where it has none
    force_axes: int
    has_plan: bool
    plan: Floats  # (K, 3) forces in Hill axes, N; empty without a plan


class Workspace(NamedTuple):
    """Arrays that flights work in; any content is right."""

    lanes: Floats  # (NUM_ROWS * LANES,) rows of what each lane carries
    aims: Floats  # (S * 4 * LANES,) desired attitudes at the instants of a control period
    unseen: Floats  # (LANES, P padded) 1 where a point is not inspected
    candidate: Floats  # (P padded,) 1 where it is lit and not inspected
    ahead: Floats  # (P padded,) 1 where a point is neither inspected nor foreseen to be
    deadlines: Floats  # (LANES, P padded) when a point is lit for the last time, s
    signals: Floats  # (signals * LANES,) in the order of `pipeline.flight.signals.SIGNALS`
    passing: Floats  # (4 * LANES,) where free drift has come to, and the square of the least distance so far
    inputs: Floats  # (3 * LANES,)
    outputs: Floats  # (LANES,)
    scratch: Any  # of `fis_tools.engines.kernel.make_scratch`
    y_before: Floats  # (LANES, 3)
    is_general: NDArray[np.bool_]  # (LANES,) whether a lane's attitude is integrated the general way
    turned: Floats  # (LANES, 7) their attitudes and rates
    candidates: Floats  # (3, P) those of this sample, packed
    centres: Floats  # (LANES, C, 3)
    num_centres: Integers  # (LANES,)
    clustered: Floats  # (LANES, P padded) the candidates that the centres are of, as in `candidate`
    labels: Integers  # (2, P)
    distances: Floats  # (P,)
    sums: Floats  # (C, 4)
    cuts: Floats  # (MOST_CUTS, 4) half-spaces g . f >= b that the safety layer works with


# Rows of `Workspace.lanes`, as offsets: position, velocity, attitude, inertial rate, force as commanded,
# force as applied, what has been spent and seen so far, the Sun at the start, what the safety layer did and
# where it sees the forces lead: the next state, the square of the least and the greatest distance, haste.
RX, RY, RZ, VX, VY, VZ, Q1, Q2, Q3, Q4, WX, WY, WZ = (LANES * row for row in range(13))
GX, GY, GZ, FX, FY, FZ = (LANES * row for row in range(13, 19))
SPENT, TRAVELLED, NEAREST, FARTHEST, LEFT, POLES, BEYOND = (LANES * row for row in range(19, 26))
SUN_COS, SUN_SIN = (LANES * row for row in range(26, 28))
ACTED, CORRECTED, AHEAD = (LANES * row for row in range(28, 31))
CLOSEST, REACH, HASTE = (LANES * row for row in range(36, 39))
COASTS = LANES * 39  # 1 where nothing is fired
NUM_ROWS = 40
#: the columns of a track: position, velocity, delta-v spent, points not yet inspected
TRACKED = (RX, RY, RZ, VX, VY, VZ, SPENT, LEFT)
