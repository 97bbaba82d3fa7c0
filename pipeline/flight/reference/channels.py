"""The signals that the readable reference senses and the axes that it drives."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fis_tools.model import FuzzySystem
from pipeline.flight.period.look.guidance import MIN_PROJECTION_M
from pipeline.flight.reference.world import PlainWorld
from pipeline.flight.state.arrays import Plans
from pipeline.flight.state.signals import (
    APPROACH,
    AXES,
    CONSTANTS,
    FORCE_AXES,
    HILL,
    PREVIEW,
    SIGNALS,
    constant,
    needs_of,
    slot,
)
from pipeline.physics.motion import closest_approach
from pipeline.physics.vectors import norm, times

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

DISTANCE, LAMBDA_U, ETA_U = slot("distance"), slot("lambda_u"), slot("eta_u")
VELOCITY_BODY = slot("velocity_body_x", "velocity_body_y", "velocity_body_z")
POSITION_HILL = slot("position_radial", "position_along_track", "position_cross_track")
VELOCITY_HILL = slot("velocity_radial", "velocity_along_track", "velocity_cross_track")
CENTRE = slot("centre_radial", "centre_along_track")
PREDICTED_CENTRE, CLOSEST_APPROACH = slot("predicted_centre_along_track"), slot("closest_approach")
RING_ERROR = slot("ring_error_radial", "ring_error_along_track")
TARGET_DIRECTION = slot("target_radial", "target_along_track", "target_cross_track")
SUN_BEARING, TARGET_SETTING = slot("sun_alignment", "sun_ahead"), slot("target_setting")
FORESEEN = slot("missed", "coasting_nearest", "coasting_farthest")
URGENT = slot("urgent_radial", "urgent_along_track", "urgent_cross_track")
PUSH = slot("see_push_radial", "see_push_along_track", "see_push_cross_track")
TOUR_PUSH = slot("tour_push_radial", "tour_push_along_track", "tour_push_cross_track")
AIM = slot("aim_radial", "aim_along_track", "aim_cross_track")
RING_SIZE, RING_LEAD = constant("ring_size_m"), constant("ring_lead_rad")
PREDICTION_TIME, AIM_URGENT = constant("prediction_time_s"), constant("aim_urgent_m_s")

NUM_SIGNALS = len(SIGNALS)
MAX_INPUTS = 3


class Plan(NamedTuple):
    """Planned forces for one flight, and the feedback on deviations from the planned path.

    Parameters
    ----------
    forces_h : array, shape (K, 3)
        N, Hill axes.
    path_h : array, shape (K, 6), or None
        Wanted states, m and m/s, Hill axes; None without feedback.
    gain : array, shape (3, 6)
        From a deviation to the corrective force, N/m and N s/m.
    least_answer : float
        A component smaller than this is not fired, N.
    """

    forces_h: Floats
    path_h: Floats | None
    gain: Floats
    least_answer: float


def forced(forces_h: Floats) -> Plan:
    """Return the plan of forces, shape (K, 3), played open loop."""
    return Plan(np.ascontiguousarray(forces_h, dtype=np.float64), None, np.zeros((3, 6)), 0.0)


def plan_of(plans: Plans) -> Plan | None:
    """Return the first of some plans; None if there is none."""
    path = plans.paths[0] if len(plans.paths) else None
    return Plan(plans.forces[0], path, plans.gain, plans.least_answer) if len(plans.forces) else None


class Channels(NamedTuple):
    """Which axis each of F fuzzy systems drives and what it senses, or a plan of forces.

    Parameters
    ----------
    axes : array of int, shape (F,)
        0, 1 or 2; systems on the same axis add up.
    signals : array of int, shape (F, 3)
        Slots of `pipeline.flight.state.signals`, -1 for unused inputs.
    is_force_hill : bool
        Whether the systems command Hill axes instead of body axes.
    plan : Plan or None
        Flown instead of inference.
    constants : array
        In the order of `pipeline.flight.state.signals.CONSTANTS`.
    needs : int
        What must be computed, as flags of `pipeline.flight.state.signals`.
    """

    axes: Integers
    signals: Integers
    is_force_hill: bool
    plan: Plan | None
    constants: Floats
    needs: int


def channels_of(
    systems: Sequence[FuzzySystem],
    force_axes: str = "body",
    plan: Plan | None = None,
    constants: Floats | None = None,
) -> Channels:
    """Wire fuzzy systems by the names of their variables.

    Parameters
    ----------
    systems : sequence of FuzzySystem
        Inputs are named after signals, the output after the force component that it commands.
    force_axes : str
        ``body`` or ``hill``.
    plan : Plan, optional
        To fly instead of inference.
    constants : array, optional
        In the order of `pipeline.flight.state.signals.CONSTANTS`; zero unless given.
    """
    constants = np.zeros(len(CONSTANTS)) if constants is None else constants
    signals = np.full((len(systems), MAX_INPUTS), -1, dtype=np.int64)
    for f, system in enumerate(systems):
        signals[f, : len(system.inputs)] = [slot(variable.name) for variable in system.inputs]
    needs = needs_of(variable.name for system in systems for variable in system.inputs)
    if constants[constant("coast_below_points")] > 0.0:
        needs |= PREVIEW
    return Channels(
        axes=np.array([AXES[system.outputs[0].name] for system in systems], dtype=np.int64),
        signals=signals,
        is_force_hill=FORCE_AXES[force_axes] == HILL,
        plan=plan,
        constants=constants,
        needs=needs,
    )


def natural_motion(
    position_h: Floats,
    velocity_h: Floats,
    mean_motion: float,
    sun_angle: float,
    ring_size: float,
    ring_lead: float,
) -> Floats:
    """Return the centre of the ellipse of free motion, radial and along the track, and the ring errors, m.

    Free motion is ``x = x_c + X``, ``y = y_c + 2 Y``, where ``(X, Y)`` turns at minus the mean motion, as the
    Sun does, and ``x_c`` is constant (Clohessy and Wiltshire, J. Aerospace Sci. 27, 1960).
    """
    x, y = position_h[0], position_h[1]
    x_rate, y_rate = velocity_h[0], velocity_h[1]
    centre = np.array([4.0 * x + 2.0 * y_rate / mean_motion, y - 2.0 * x_rate / mean_motion])
    offset = np.array([x - centre[0], 0.5 * (y - centre[1])])
    place = ring_size * np.array([np.cos(sun_angle - ring_lead), np.sin(sun_angle - ring_lead)])
    return np.concatenate((centre, offset - place))


def sun_bearing(position_h: Floats, sun_angle: float) -> Floats:
    """Return cosine and sine of the angle from the deputy to the Sun in the orbit plane."""
    reach = np.sqrt(position_h[0] ** 2 + position_h[1] ** 2)
    if reach < MIN_PROJECTION_M:
        return np.zeros(2)
    angle = sun_angle - np.arctan2(position_h[1], position_h[0])
    return np.array([np.cos(angle), np.sin(angle)])


def direction(target_h: Floats) -> Floats:
    """Return the unit vector towards the target; zeros without one."""
    length = norm(target_h)
    return target_h / length if length >= MIN_PROJECTION_M else np.zeros(3)


def measure(
    world: PlainWorld,
    position_h: Floats,
    velocity_h: Floats,
    dcm: Floats,
    lambda_u: float,
    eta_u: float,
    target_h: Floats,
    sun_angle: float,
    foreseen: Floats,
    urgent: Floats,
    push: Floats,
    tour_push: Floats,
    channels: Channels,
) -> Floats:
    """Return every signal, in its slot, in the unit of `pipeline.flight.state.signals.SIGNALS`.

    Parameters
    ----------
    world : PlainWorld
    position_h, velocity_h : array, shape (3,)
        Of the deputy, m and m/s, Hill axes.
    dcm : array, shape (3, 3)
        From Hill to body axes.
    lambda_u, eta_u : float
        Relative angles, rad.
    target_h : array, shape (3,)
        The target, m, Hill axes; zeros without one.
    sun_angle : float
        rad.
    foreseen : array, shape (3,)
        Of `pipeline.flight.reference.preview.preview`; zeros if not sensed.
    urgent : array, shape (3,)
        Of `pipeline.flight.reference.urgency.around_the_chief`; zeros if not sensed.
    push : array, shape (3,)
        Of `pipeline.flight.reference.see_push.push_of`, turned aside near the chief, m/s; zeros if
        not sensed.
    tour_push : array, shape (3,)
        The push onto the tour, turned aside likewise, m/s; zeros if not sensed.
    channels : Channels
        The controller's constants, and whether it senses the closest approach; zero if it does not.
    """
    signals, mean_motion = np.zeros(NUM_SIGNALS), world.mean_motion
    signals[DISTANCE] = norm(position_h)
    signals[VELOCITY_BODY : VELOCITY_BODY + 3] = times(dcm, velocity_h)
    signals[LAMBDA_U], signals[ETA_U] = lambda_u, eta_u
    signals[POSITION_HILL : POSITION_HILL + 3] = position_h
    signals[VELOCITY_HILL : VELOCITY_HILL + 3] = velocity_h
    size, lead = channels.constants[RING_SIZE], channels.constants[RING_LEAD]
    motion = natural_motion(position_h, velocity_h, mean_motion, sun_angle, size, lead)
    signals[CENTRE : CENTRE + 2], signals[RING_ERROR : RING_ERROR + 2] = motion[:2], motion[2:]
    # the centre drifts at -1.5 n times its height
    drift = 1.5 * mean_motion * motion[0] * channels.constants[PREDICTION_TIME]
    signals[PREDICTED_CENTRE] = motion[1] - drift
    if channels.needs & APPROACH:
        signals[CLOSEST_APPROACH] = closest_approach(world.orbit_parts, position_h, velocity_h)
    towards = direction(target_h)
    signals[TARGET_DIRECTION : TARGET_DIRECTION + 3] = towards
    signals[TARGET_SETTING] = np.cos(sun_angle) * towards[1] - np.sin(sun_angle) * towards[0]
    signals[SUN_BEARING : SUN_BEARING + 2] = sun_bearing(position_h, sun_angle)
    signals[FORESEEN : FORESEEN + 3] = foreseen
    signals[URGENT : URGENT + 3] = urgent
    signals[PUSH : PUSH + 3] = push
    signals[AIM : AIM + 3] = push + channels.constants[AIM_URGENT] * urgent
    signals[TOUR_PUSH : TOUR_PUSH + 3] = tour_push
    return signals
