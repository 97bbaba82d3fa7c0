"""Free motion from any sample of a flight, for the pages that draw it."""

import numpy as np

from fis_tools.compiled.decorator import plainly
from pipeline.array_types import Floats
from pipeline.physics.motion import state_transition

#: samples of one orbit of free motion
NUM_COASTED = 97


def free_motion(mean_motion: float) -> Floats:
    """Return the matrices from a state to its positions over one orbit, (NUM_COASTED, 3, 6).

    Of the motion about a circular orbit, see `pipeline.physics.motion.state_transition`.
    """
    times = np.linspace(0.0, 2.0 * np.pi / mean_motion, NUM_COASTED)
    with plainly("pipeline"):  # a hundred of them: compiling takes longer
        return np.array([np.asarray(state_transition(mean_motion, time_s))[:3] for time_s in times])
