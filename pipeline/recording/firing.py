"""Which of a controller's decisions were fired, and when."""

import numpy as np
from numpy.typing import NDArray

from fis_tools.model.thrust import COUNTED, REASONS
from pipeline.flight.cases.actuators import thrusters_of
from pipeline.flight.state.log import FlightLog
from pipeline.settings.experiment import Mission

#: the indices of the reasons with which what the rules ask for takes effect
IN_EFFECT = tuple(index for index, word in enumerate(REASONS) if word in COUNTED)


def delay_of(mission: Mission) -> int:
    """Return the control periods from a command to its force."""
    return thrusters_of(mission).delay if mission.actuators.kind == "real" else 0


def is_fired(
    log: FlightLog, decided: NDArray[np.intp], axis: int, force_axes: str, delay: int
) -> NDArray[np.bool_]:
    """Return at which decisions the force requested along an axis was fired.

    Parameters
    ----------
    log : FlightLog
    decided : (n,) int
        Samples of decisions.
    axis : int
        Of the controller's axes, 0 to 2.
    force_axes : str
        ``hill``, or ``body``: along a body axis, a force is one along all of Hill's.
    delay : int
        Control periods from a command to its force.

    Returns
    -------
    (n,) bool
    """
    due = np.minimum(decided + delay, len(log.reason) - 1)
    is_commanded = np.isin(log.command_reason[decided, axis], IN_EFFECT)
    axes = slice(None) if force_axes == "body" else [axis]
    is_in_effect = np.isin(log.reason[due], IN_EFFECT)[:, axes].any(axis=1)
    return is_commanded & is_in_effect & (decided + delay < len(log.reason))
