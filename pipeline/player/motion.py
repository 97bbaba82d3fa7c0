"""Free motion from any sample of a flight, for the pages that draw it."""

from typing import Any

import numpy as np

from fis_tools.compiled.decorator import plainly
from pipeline.array_types import Floats
from pipeline.physics.motion import state_transition
from pipeline.player.flown import as_text
from pipeline.settings.experiment import Mission

#: samples of one orbit of free motion
NUM_COASTED = 97


def free_motion(mean_motion: float) -> Floats:
    """Return the matrices from a state to its positions over one orbit, (NUM_COASTED, 3, 6).

    Of the motion about a circular orbit, see `pipeline.physics.motion.state_transition`.
    """
    times = np.linspace(0.0, 2.0 * np.pi / mean_motion, NUM_COASTED)
    with plainly("pipeline"):  # a hundred of them: compiling takes longer
        return np.array([np.asarray(state_transition(mean_motion, time_s))[:3] for time_s in times])


def motion_data(mission: Mission) -> dict[str, Any]:
    """Return how a mission's deputies move freely, as a page takes it: the mean motion, rad/s, and matrices.

    There are no matrices where motion is not that about a circular orbit.
    """
    mean_motion = mission.orbit.mean_motion_rad_s
    is_linear = mission.dynamics.model == "cw"
    return {
        "meanMotion": mean_motion,
        "freeMotion": as_text(free_motion(mean_motion), "<f4") if is_linear else "",
    }
