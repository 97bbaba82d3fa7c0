"""What the fuzzy systems of the readable reference flight sense and drive."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fis_tools.engines.compiled import compiled
from fis_tools.model import FuzzySystem
from pipeline.flight.guidance import MIN_PROJECTION_M
from pipeline.physics.clohessy_wiltshire import closest_approach
from pipeline.physics.vectors import norm, times

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

#: what a fuzzy system can sense, in the order of `measure`
SIGNALS = (
    "distance",
    "velocity_body_x",
    "velocity_body_y",
    "velocity_body_z",
    "lambda_u",
    "eta_u",
    "position_radial",
    "position_along_track",
    "position_cross_track",
    "velocity_radial",
    "velocity_along_track",
    "velocity_cross_track",
    "centre_radial",
    "centre_along_track",
    "ring_error_radial",
    "ring_error_along_track",
    "target_radial",
    "target_along_track",
    "target_cross_track",
    "sun_alignment",
    "sun_ahead",
    "predicted_centre_along_track",
    "closest_approach",
    "target_setting",
    "missed",
    "coasting_nearest",
    "coasting_farthest",
    "urgent_radial",
    "urgent_along_track",
    "urgent_cross_track",
)

#: what a fuzzy system can command, along the axes of body or Hill
OUTPUTS = ("force_x", "force_y", "force_z")

MAX_INPUTS = 3


class Channels(NamedTuple):
    """Which axis each of F fuzzy systems drives and what it senses, or a plan of forces made beforehand.

    Parameters
    ----------
    axes : array of int, shape (F,)
        0, 1 or 2; systems on one axis add up.
    signals : array of int, shape (F, 3)
        Places in `SIGNALS`, -1 where there is no further input.
    is_force_hill : bool
        Whether the systems command Hill axes instead of body axes.
    plan_h : array, shape (K, 3) or (0, 3)
        Forces to play instead of any inference, N, Hill axes; no rows where there is no plan.
    ring_size, ring_lead : float
        Height of the ring that follows the Sun, m, and how far the Sun is ahead of the place on it, rad.
    dead_band : array, shape (3,)
        Smallest force along each axis that is fired, N.
    prediction_time : float
        How far ahead the predicted centre is, s.
    coast_below, coast_margin : float
        With fewer points missed by coasting it coasts, unless that comes nearer to a distance limit, m.
    urgency_time : float
        How long before it is dark for good a point becomes urgent, s.
    skirt_distance : float
        Nearer than this to the chief the urgent direction turns aside from it, m.
    senses_approach, senses_preview, senses_urgency : bool
        Whether the closest approach is sensed, or what coasting comes to, or what is urgent, which take long
        to compute.
    """

    axes: Integers
    signals: Integers
    is_force_hill: bool
    plan_h: Floats
    ring_size: float
    ring_lead: float
    dead_band: Floats
    prediction_time: float
    coast_below: float
    coast_margin: float
    urgency_time: float
    skirt_distance: float
    senses_approach: bool
    senses_preview: bool
    senses_urgency: bool


def channels_of(
    systems: Sequence[FuzzySystem],
    force_axes: str = "body",
    plan_h: Floats | None = None,
    constants: Floats | None = None,
) -> Channels:
    """Wire fuzzy systems by the names of their variables.

    Parameters
    ----------
    systems : sequence of FuzzySystem
        Inputs are named after signals, of `SIGNALS`, the output after the force it commands, of `OUTPUTS`.
    force_axes : str
        ``body`` or ``hill``.
    plan_h : array, optional
        Shape (K, 3), N, Hill axes: forces to play instead of any inference.
    constants : array, optional
        Ring size (m), ring lead (rad), three dead bands (N), prediction time (s), points
        below which it coasts, margin of coasting (m), urgency time (s), skirt distance (m); zero unless
        given.
    """
    constants = np.zeros(10) if constants is None else constants
    ring_size, ring_lead, dead_band = constants[0], constants[1], constants[2:5]
    prediction_time, coast_below, coast_margin, urgency_time, skirt_distance = constants[5:]
    signals = np.full((len(systems), MAX_INPUTS), -1, dtype=np.int64)
    for f, system in enumerate(systems):
        signals[f, : len(system.inputs)] = [SIGNALS.index(variable.name) for variable in system.inputs]
    return Channels(
        axes=np.array([OUTPUTS.index(system.outputs[0].name) for system in systems], dtype=np.int64),
        signals=signals,
        is_force_hill=force_axes == "hill",
        plan_h=np.zeros((0, 3)) if plan_h is None else np.ascontiguousarray(plan_h, dtype=np.float64),
        ring_size=float(ring_size),
        ring_lead=float(ring_lead),
        dead_band=np.array(dead_band, dtype=np.float64),
        prediction_time=float(prediction_time),
        coast_below=float(coast_below),
        coast_margin=float(coast_margin),
        urgency_time=float(urgency_time),
        skirt_distance=float(skirt_distance),
        senses_approach=_senses(signals, "closest_approach", "closest_approach"),
        senses_preview=bool(coast_below > 0.0 or _senses(signals, "missed", "coasting_farthest")),
        senses_urgency=_senses(signals, "urgent_radial", "urgent_cross_track"),
    )


def _senses(signals: Integers, first: str, last: str) -> bool:
    """Tell whether any of these places in `SIGNALS` lies between two signals, both included."""
    return bool(((signals >= SIGNALS.index(first)) & (signals <= SIGNALS.index(last))).any())


@compiled
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


@compiled
def sun_bearing(position_h: Floats, sun_angle: float) -> Floats:
    """Return cosine and sine of the angle from the deputy to the Sun in the orbit plane."""
    reach = np.sqrt(position_h[0] ** 2 + position_h[1] ** 2)
    if reach < MIN_PROJECTION_M:
        return np.zeros(2)
    angle = sun_angle - np.arctan2(position_h[1], position_h[0])
    return np.array([np.cos(angle), np.sin(angle)])


@compiled
def direction(target_h: Floats) -> Floats:
    """Return the unit vector towards the target; zeros without one."""
    length = norm(target_h)
    return target_h / length if length >= MIN_PROJECTION_M else np.zeros(3)


@compiled
def measure(
    position_h: Floats,
    velocity_h: Floats,
    dcm: Floats,
    lambda_u: float,
    eta_u: float,
    target_h: Floats,
    mean_motion: float,
    sun_angle: float,
    foreseen: Floats,
    urgent: Floats,
    channels: Channels,
) -> Floats:
    """Return every signal, in the order of `SIGNALS`, in m, m/s, rad and pure numbers.

    Parameters
    ----------
    position_h, velocity_h : array, shape (3,)
        Of the deputy, m and m/s, Hill axes.
    dcm : array, shape (3, 3)
        From Hill to body axes.
    lambda_u, eta_u : float
        Relative angles, rad.
    target_h : array, shape (3,)
        The target, m, Hill axes; zeros without one.
    mean_motion, sun_angle : float
        rad/s and rad.
    foreseen : array, shape (3,)
        What `pipeline.flight.reference.preview.preview` gives; zeros where it is not sensed.
    urgent : array, shape (3,)
        What `pipeline.flight.reference.urgency.around_the_chief` gives; zeros where it is not sensed.
    channels : Channels
        The controller's constants, and whether it senses the closest approach; zero where it does not.
    """
    velocity_b = times(dcm, velocity_h)
    known = np.array(
        [
            norm(position_h),
            velocity_b[0],
            velocity_b[1],
            velocity_b[2],
            lambda_u,
            eta_u,
            position_h[0],
            position_h[1],
            position_h[2],
            velocity_h[0],
            velocity_h[1],
            velocity_h[2],
        ]
    )
    towards = direction(target_h)
    setting = np.cos(sun_angle) * towards[1] - np.sin(sun_angle) * towards[0]
    size, lead = channels.ring_size, channels.ring_lead
    motion = natural_motion(position_h, velocity_h, mean_motion, sun_angle, size, lead)
    # the centre drifts at -1.5 n times its height
    predicted = motion[1] - 1.5 * mean_motion * motion[0] * channels.prediction_time
    approach = closest_approach(position_h, velocity_h, mean_motion) if channels.senses_approach else 0.0
    bearing = sun_bearing(position_h, sun_angle)
    others = np.array([predicted, approach, setting])
    return np.concatenate((known, motion, towards, bearing, others, foreseen, urgent))
