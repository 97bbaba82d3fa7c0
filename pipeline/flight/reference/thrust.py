"""The thrust logic of the readable reference: from the commanded force to the one fired, and why.

`fis_tools.model.thrust` describes it; twin of `pipeline.flight.period.decide.thrust`.
"""

import numpy as np
from numpy.typing import NDArray

from fis_tools.model.thrust import SILENT_N
from pipeline.flight.reference.channels import Channels, Plan
from pipeline.flight.reference.world import PlainWorld
from pipeline.flight.state.log import (
    CLIPPED,
    COASTING,
    COMPLETE,
    DEAD_BAND,
    FIRED,
    LEAST_CHANGE_N,
    SAFETY,
    SILENT,
    WAITING,
)
from pipeline.flight.state.signals import FIRST_DEAD_BAND, constant
from pipeline.physics.vectors import transposed_times

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

COAST_BELOW, COAST_MARGIN = constant("coast_below_points"), constant("coast_margin_m")
DECISION_PERIOD = constant("decision_period_s")


def is_decision(channels: Channels, world: PlainWorld, k: int) -> bool:
    """Return whether a force is decided on at a sample; between two such samples nothing is fired."""
    stride = max(1, round(float(channels.constants[DECISION_PERIOD]) / world.control_period))
    return k % stride == 0


def follow(plan: Plan, state: Floats, k: int) -> Floats:
    """Return the planned force of a period plus the feedback on deviations, N, Hill axes, shape (3,)."""
    if plan.path_h is None:
        return np.asarray(plan.forces_h[k])
    answer = -plan.gain @ (state - plan.path_h[k])
    return np.asarray(plan.forces_h[k] + np.where(np.abs(answer) >= plan.least_answer, answer, 0.0))


def may_coast(channels: Channels) -> bool:
    """Return whether a controller coasts before every point is inspected."""
    return bool(channels.constants[COAST_BELOW] > 0.0)


def is_coasting_enough(channels: Channels, world: PlainWorld, foreseen: Floats) -> bool:
    """Return whether coasting to the end shows enough inside the limits."""
    missed, nearest, farthest = foreseen
    margin = channels.constants[COAST_MARGIN]
    return bool(
        missed < channels.constants[COAST_BELOW]
        and nearest >= world.min_distance + margin
        and farthest <= world.max_distance - margin
    )


def beyond_dead_bands(channels: Channels, asked: Floats) -> Floats:
    """Return the fired components, shape (3,): zero where one is within its dead band."""
    bands = channels.constants[FIRST_DEAD_BAND : FIRST_DEAD_BAND + 3]
    return np.where(np.abs(asked) < bands, 0.0, asked)


def in_hill_axes(channels: Channels, commanded: Floats, dcm: Floats) -> Floats:
    """Return a force in the controller's axes in Hill axes, shape (3,); `dcm` turns Hill to body."""
    return commanded if channels.is_force_hill else transposed_times(dcm, commanded)


def rest(is_complete: bool, decides: bool, coasts: bool) -> int | None:
    """Return why nothing is inferred at a sample; None if inference runs."""
    if is_complete:
        return COMPLETE
    if not decides:
        return WAITING
    return COASTING if coasts else None


def reasons(
    resting: int | None,
    asked: Floats,
    commanded: Floats,
    is_clipped: NDArray[np.bool_],
    change_h: Floats,
    is_force_hill: bool,
) -> Integers:
    """Return for each component why it was, or was not, fired as commanded, shape (3,).

    Parameters
    ----------
    resting : int, optional
        Of `rest`.
    asked, commanded : array, shape (3,)
        Before and after the dead bands, N, the controller's axes.
    is_clipped : array of bool, shape (3,)
        Which Hill components are beyond the thrust limit.
    change_h : array, shape (3,)
        What the safety layer added, N, Hill axes.
    is_force_hill : bool
        Whether the controller's axes are Hill's; if not, clip and safety layer concern all components.
    """
    is_changed = np.abs(change_h) > LEAST_CHANGE_N
    if not is_force_hill:
        is_clipped, is_changed = (np.full(3, which.any()) for which in (is_clipped, is_changed))
    found = np.where(np.abs(asked) < SILENT_N, SILENT, np.where(commanded == 0.0, DEAD_BAND, FIRED))
    if resting is not None:
        found = np.full(3, resting)
    found = np.where(is_clipped, CLIPPED, found)
    return np.where(is_changed, SAFETY, found).astype(np.int64)
