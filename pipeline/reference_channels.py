"""What the fuzzy systems of the readable reference flight sense and drive."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from fis_tools.model import FuzzySystem
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
    """

    axes: Integers
    signals: Integers
    is_force_hill: bool
    plan_h: Floats


def channels_of(
    systems: Sequence[FuzzySystem], force_axes: str = "body", plan_h: Floats | None = None
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
    """
    signals = np.full((len(systems), MAX_INPUTS), -1, dtype=np.int64)
    for f, system in enumerate(systems):
        signals[f, : len(system.inputs)] = [SIGNALS.index(variable.name) for variable in system.inputs]
    return Channels(
        axes=np.array([OUTPUTS.index(system.outputs[0].name) for system in systems], dtype=np.int64),
        signals=signals,
        is_force_hill=force_axes == "hill",
        plan_h=np.zeros((0, 3)) if plan_h is None else np.ascontiguousarray(plan_h, dtype=np.float64),
    )


@njit(cache=True)
def measure(position_h: Floats, velocity_h: Floats, dcm: Floats, lambda_u: float, eta_u: float) -> Floats:
    """Return every signal, in the order of `SIGNALS`, in m, m/s and rad.

    Parameters
    ----------
    position_h, velocity_h : array, shape (3,)
        Of the deputy, m and m/s, Hill axes.
    dcm : array, shape (3, 3)
        From Hill to body axes.
    lambda_u, eta_u : float
        Relative angles, rad.
    """
    velocity_b = times(dcm, velocity_h)
    return np.array(
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
