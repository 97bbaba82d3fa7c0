"""The arrays of compiled flights: shared data, state, working space and logs.

Up to L flights of one controller run side by side: every quantity that a flight carries is a vector with
a lane for each of them (`fis_tools.compiled.vectors`).
"""

from collections.abc import Mapping
from functools import cache
from typing import Annotated, Any, NamedTuple, get_args, get_type_hints

import numpy as np

from fis_tools.compiled.decorator import compiled
from fis_tools.compiled.vectors import Rows, aligned, make_rows
from pipeline.array_types import ELEMENTS, Floats, Integers
from pipeline.flight.state.errors import ESTIMATED, THRUSTING
from pipeline.flight.state.signals import SIGNALS
from pipeline.physics.illumination import Reflection
from pipeline.physics.motion import Motion
from pipeline.physics.orbit import Course
from pipeline.physics.sight import Occlusion, Optics, Sight
from pipeline.physics.transitions import Transitions

#: columns of a track: position (m, Hill axes), or these
NUM_PLACED, NUM_TRACKED = 3, 15
#: of a track, after position and velocity (m/s): delta-v spent (m/s), points not yet inspected, where the
#: columns begin of the force fired next (N, Hill axes, zero at the last sample) and of the boresight (Hill
#: axes), and the deputy's angular rate relative to Hill (rad/s)
TRACK_SPENT, TRACK_LEFT, TRACK_FORCE, TRACK_BORESIGHT, TRACK_TURN_RATE = 6, 7, 8, 11, 14
#: columns of a row of outcomes
DELTA_V, INSPECTED, MEAN_DISTANCE, MIN_DISTANCE, MAX_DISTANCE, OUTSIDE = 0, 1, 2, 3, 4, 5
SAFETY_PERIODS, SAFETY_DELTA_V, FULL_WHEELS, NUM_OUTCOMES = 6, 7, 8, 9


class Guard(NamedTuple):
    """Parameters of the safety layer, see `pipeline.flight.period.act.safety`; empty where it is off."""

    is_on: bool
    keep_out: float  # m
    keep_in: float  # m
    speed_at_chief: float  # v0 - v1 d0, m/s
    speed_slope: float  # v1, 1/s
    braking_force: float  # N
    planned_force: float  # greatest along each axis that is passed on, N
    step_back: float  # force beyond the stop where even the stop is not safe, N; 0: none
    # (3, 6 or 7; 6) gain of the law that stops within a control period, N; then velocities times what makes
    # `braking_force` their limit, or zeros without one; then the cosine of the half angle of the Sun's cone
    stop: Floats
    checks: Motion  # (2 + J) the state itself, stopped, and after 1 ... J periods of free drift
    num_kept_out: int  # rows of positions that must stay outside the inner sphere
    num_kept_in: int  # and inside the outer one
    # the greatest delta-v of a flight, m/s, or infinity, where a way out without thrust is kept,
    # `pipeline.flight.period.act.way_out`; else None, which is known at compile time
    way_out: float | None


class FullOptics(NamedTuple):
    """Marks at compile time that light or the camera is not the paper's; `World.optics` has the numbers."""

    # True where parts of the chief may hide one another, a point must be bright enough to be seen, or the
    # field of view is a rectangle; else None, which is known at compile time
    by_point: bool | None


class World(NamedTuple):
    """Data that all flights of a mission share, as numbers and arrays in SI."""

    num_controls: int
    first: int  # sample at which flights begin: 0, but for those flown ahead from later ones
    last: int  # sample at which they end: `num_controls`, but for those flown up to an earlier one
    num_attitude_steps: int
    mean_motion: float
    # (K+1 or 1, 3) of Hill axes, rad/s: in each control period of a true course, or uniform
    hill_rates: Floats
    control_period: float
    attitude_period: float
    acceleration_per_force: float
    delta_v_per_force: float  # held over a control period
    motion: Motion  # over a control period
    instants: Motion  # over 0, 1, … S-1 attitude periods
    orbit_parts: Motion  # over parts of an orbit
    preview_stride: int  # control periods between the samples of a preview
    strides: Motion  # over 0, 1, … preview_stride control periods
    look_stride: int  # control periods between the looks of a push that shows setting points
    looks: Motion  # over 0, 1, … of these strides, to the flight's end
    points: Floats  # (K+1 or 1, 3, P padded), Hill axes
    num_points: int
    order: Integers  # (P padded,) of points, such that neighbours are adjacent
    patches: Floats  # (K+1 or 1, 3, P padded) points in this order
    sight: Sight
    has_optics: bool  # whether light or camera are not the paper's, whatever the Sun's elevation
    optics: Optics
    # (K+1,) `Optics.least_height` at the chief's true distance on an eccentric orbit, and beyond the end as
    # far as `transitions`; none on a circle
    least_heights: Floats
    reflection: Reflection
    surface: Floats  # (K+1 or 1, NUM_SURFACE, P padded) surface at points, Hill axes; zeros in the padding
    occlusion: Occlusion  # without cells where nothing is hidden
    chief_axes: Floats  # (K+1 or 1, 3, 3) from Hill to chief
    boresight: Floats  # (3,) body axes
    up: Floats  # (3,) up in the image, body axes, perpendicular to the boresight
    keep_out: Floats  # (K+1 or 1, S, 4) spheres to stay out of: centre, Hill axes, and radius, m
    attitude_at_start: Floats  # (4,) Hill to body
    rate_at_start: Floats  # (3,) inertial, body axes
    is_spherical: bool
    inertia: Floats  # (3, 3)
    inverse_inertia: Floats  # (3, 3)
    proportional_gain: Floats  # (3, 3) N m
    derivative_gain: Floats  # (3, 3) N m s
    max_torque: float
    max_momentum: float  # of each wheel, N m s; infinite for any
    max_force: float
    min_distance: float
    max_distance: float
    # (K+1 or 1,) 3 mu/R^3 of the chief, 3 n^2 on a circle, or 0 where it turns nothing, 1/s^2
    gravity_gradient: Floats
    turns_by_thrust: bool
    is_attitude_ideal: bool
    has_pole_blending: bool
    has_clusters: bool
    coasts_when_complete: bool
    guard: Guard
    course: Course  # of the chief about the Earth; off where motion is linear
    # (J, 3, 7) from the state at the flight's end, and 1, to positions after it at which limits count, m
    after: Floats
    transitions: Transitions  # what deputies predict by; none where that is a uniform turn


class Turns(NamedTuple):
    """The rotation of a deputy that plays it from a table, one row per control period."""

    # (K, 4) reference of the attitude law, or actual attitude with ideal pointing, Hill to body, scalar last;
    # the last row stays. Without rows the camera is aimed at the chief
    attitudes: Floats
    # (K, 3) instead of the attitude law's, N m, body axes, zero after the last row. Without rows the law acts
    torques: Floats


#: turns of a deputy that aims its camera at the chief
AIMED = Turns(np.zeros((0, 4)), np.zeros((0, 3)))


class Plans(NamedTuple):
    """Planned forces, the feedback on deviations from the planned path, and planned rotation."""

    forces: Floats  # (m or 1, K, 3) of each flight or of all, Hill axes, N; no rows without a plan
    paths: Floats  # (m, K, 6) states that the feedback tracks; no rows without feedback
    gain: Floats  # (3, 6) from a deviation to the corrective force, N/m and N s/m
    least_answer: float  # a component smaller than this is not fired, N
    turns: Turns


class Law(NamedTuple):
    """What controllers of one structure command, by fuzzy systems or by plans of forces."""

    axes: Integers  # (F,) which component each system drives
    signals: Integers  # (F, 3) slots of the signals it senses
    needs: int  # what must be computed for them, see `pipeline.flight.state.signals`
    num_inputs: Integers  # (F,)
    layout: Any  # of `fis_tools.engines.packing.Packed`
    constants: int  # index of the controller's constants among its values; -1 without constants
    decision_stride: int  # control periods from one decision to the next
    force_axes: int
    has_plan: bool
    plans: Plans


class Control(NamedTuple):
    """One controller."""

    law: Law
    values: Floats  # rows of `fis_tools.engines.packing.Packed`
    rules: Integers


@compiled(error_model="numpy", forceinline=True)
def constant_of(control: Control, which: int) -> float:
    """Return a constant of a controller, of `pipeline.flight.state.signals.CONSTANTS`; zero without any."""
    return control.values[control.law.constants + which] if control.law.constants >= 0 else 0.0


#: A start: a flight's initial conditions. Hill axes, SI units.
CASE = np.dtype(
    [
        ("position", np.float64, 3),
        ("velocity", np.float64, 3),
        ("sun_angle", np.float64),
        ("sun_elevation", np.float64),
    ],
    align=True,
)

#: Where a deputy is and how it moves: as it is so, or as the deputy knows it. Hill axes, SI units.
MOVING: Rows = {
    "position": (3,),
    "velocity": (3,),
    "attitude": (4,),  # body from Hill, scalar last
    "rate": (3,),  # inertial, body axes
    "boresight": (3,),
}

#: What else flights carry, one lane each. Forces and directions in Hill axes, SI units.
CARRIED: Rows = {
    "requested": (3,),  # force after dead bands, along the controller's axes
    "commanded": (3,),  # within the thrust limit, and safe
    "force": (3,),  # as fired
    "arm": (3,),  # point where it acts, body axes, if that turns the deputy
    "twist": (3,),  # further torque of single thrusters, body axes
    "coasts": (),  # 1 where nothing is inferred
    "parks": (),  # 1 where the push that parks is fired instead, or none is needed
    "sun_at_start": (2,),  # cosine and sine of its angle
    "height_at_start": (2,),  # cosine and sine of its elevation
    "sun": (2,),  # cosine and sine of its angle now
    "sun_height": (2,),  # cosine and sine of its elevation now
    "shine": (3,),  # working array: visible share of the Sun's disc at the instants of a step
    "drag": (3,),  # working array: additional acceleration where it varies, m/s^2
    "target": (3,),  # zero without candidates
    "num_counted": (),  # points that the flight counts
    "num_unseen": (),
    "num_candidates": (),
    "spent": (),  # delta-v
    "travelled": (),  # sum of the distances
    "nearest": (),
    "farthest": (),
    "beyond": (),  # largest violation of the limits
    "num_acted": (),  # periods in which the safety layer acted
    "corrected": (),  # delta-v of its changes
    "limit": (),  # for which it acted in this period
    "change": (3,),  # of the force by it
    "is_unsafe": (),  # working array: 1 where the safety layer must check more closely
    "y_before": (3,),  # the desired attitude's y axis at the last instant
    "is_near_pole": (),  # working array: 1 where y* follows from the one before
    "turns_fast": (),  # working array: 1 where attitude is integrated by the general method
    "momentum": (3,),  # of body and wheels together, N m s, where that of wheels is limited
    "num_full": (),  # instants of the attitude clock at which a wheel is full
}

#: How flights are turned at an instant of the attitude clock; the last two are of limited wheels.
TURNED: Rows = {"attitude": (4,), "rate": (3,), "torque": (3,), "held": (3,)}


class FlightState(NamedTuple):
    """What flights carry from one control period to the next; every array says its shape.

    L is the number of lanes, P of points, padded, C of clusters, F of fixes, K of control periods, N of
    thrusters. The last three are 0 where flights are as the deputies' model has them.
    """

    truth: Annotated[Any, MOVING]  # the true state
    belief: Annotated[Any, MOVING]  # what the deputies know; the same record where they know it exactly
    lanes: Annotated[Any, CARRIED]
    unseen: Annotated[Floats, "L", "P"]  # 1 where a point counts and is not inspected
    centres: Annotated[Floats, "L", "C", 3]  # of the clusters of the last sample, m, Hill axes
    num_centres: Annotated[Integers, "L"]
    clustered: Annotated[Floats, "L", "P"]  # the candidates that the centres belong to, 1 for each
    estimate: Annotated[Any, ESTIMATED]
    thrusters: Annotated[Any, THRUSTING]
    fixes: Annotated[Floats, "F", 3, "L"]  # measured so far, m, Hill axes
    commands: Annotated[Floats, "K", 3, "L"]  # so far, N, Hill axes
    # the same in the periods in which they act, in impulses, fired or not
    acting: Annotated[Floats, "K", 3, "L"]
    # 0 where thrusters tell that they fired nothing along an axis, or 1
    has_fired: Annotated[Floats, "K", 3, "L"]
    sensed: Annotated[Floats, "3K+3", 3, "L"]  # body axes as sensed, Hill axes
    thrust: Annotated[Floats, "N", "L"]  # of each thruster of a layout, N


class Workspace(NamedTuple):
    """Working arrays of one thread; their content need not outlast a control period, but for `deadlines`.

    Shapes are as those of `FlightState`; S is the number of instants of a control period.
    """

    aims: Annotated[Any, "S", TURNED]  # desired attitudes at the instants
    passed: Annotated[Any, "S", TURNED]  # attitudes and rates at them
    candidate_marks: Annotated[Floats, "P"]  # 1 where a point is lit and not inspected
    lit: Annotated[Floats, "P"]  # 1 where a wanted point is lit
    seen: Annotated[Floats, "P"]  # 1 where one of these is seen
    ahead: Annotated[Floats, "P"]  # 1 where a point is neither inspected nor foreseen to be
    setting: Annotated[Floats, "P"]  # 1 where such a point, by another look ahead, soon goes dark for good
    deadlines: Annotated[Floats, "L", "P"]  # last light of each point, s; of the flights being flown
    looks: Annotated[Floats, 5, "P"]  # of the cheapest look at each point: cost, shortfall, slopes
    signals: Annotated[Floats, len(SIGNALS), "L"]  # in the order of `SIGNALS`
    outputs: Annotated[Floats, 3, "L"]  # of the controller's systems, N
    scratch: Any  # of `fis_tools.engines.kernel.make_scratch`
    candidates: Annotated[Floats, 3, "P"]  # positions of those so marked, side by side, m
    labels: Annotated[Floats, 2, "P"]
    distances: Annotated[Floats, "P"]
    sums: Annotated[Floats, "C", 4]
    cuts: Annotated[Floats, "cuts", 4]  # half-spaces g . f >= b that the safety layer works with


@cache
def _declared(kind: Any) -> dict[str, tuple[Any, ...]]:
    """Return the array and shape that each field of a named tuple declares; finding them out takes long."""
    return {name: get_args(hint) for name, hint in get_type_hints(kind, include_extras=True).items()}


def allocated(kind: Any, sizes: Mapping[str, int], before: tuple[int, ...] = (), **others: Any) -> Any:
    """Return a named tuple of zeros, in the shapes that its fields declare after some first axes.

    Where a shape ends with the fields of a record, these are records with L lanes. Other fields are given.
    """
    fields = dict(others)
    for name, declared in _declared(kind).items():
        if name in others:
            continue
        array, *shape = declared
        record = shape.pop() if isinstance(shape[-1], dict) else None
        numbers = (*before, *(sizes.get(size, size) for size in shape))
        if record is None:
            fields[name] = aligned(numbers, ELEMENTS[array])
        else:
            fields[name] = make_rows(record, sizes["L"], numbers)
    return kind(**fields)


class Moment(NamedTuple):
    """Flights side by side at a sample: what `look`, `decide` and `act` work on."""

    world: World
    state: FlightState
    first: int  # the lanes are flights from this one on
    num_lanes: int  # of these, so many are flown; the others repeat the last
    k: int  # the sample
