"""Free motion from a sample of a flight to long after its end, as plans are priced by what follows them."""

from functools import lru_cache
from typing import NamedTuple

import numpy as np

from fis_tools.compiled.decorator import plainly
from pipeline.array_types import Floats
from pipeline.flight.fly.foresight import NO_TAIL, Tail
from pipeline.flight.world.coasting import tabulated
from pipeline.physics.motion import motion_over, state_transition
from pipeline.settings.experiment import Mission
from pipeline.settings.mission import TwoBody

#: time between the instants at which plans are priced by what follows them, s
TAIL_S = 60.0


def tail_stride(mission: Mission) -> int:
    """Return the control periods between the rows of a tail."""
    return max(1, round(TAIL_S / mission.control_period_s))


class Drift(NamedTuple):
    """Free motion from a sample to beyond the end of a mission's flights, as a `Tail` has it."""

    rows: Floats  # (T, 3, 6)
    offsets: Floats  # (T, 3)
    kicks: Floats  # (L+1, 6, 3)
    constants: Floats  # (6, 6) from states, less `rest`, to constants
    rest: Floats  # (6,) where drag has led from rest, m and m/s


@lru_cache(maxsize=32)
def drift_from(mission: Mission, sample: int, beyond_s: float) -> Drift:
    """Return free motion from a sample to so long after the end.

    About the Earth it is along the chief's orbit, with oblateness and drag, elsewhere that of a circle, where
    the constants are the state in which it begins.
    """
    stride, period, num_controls = tail_stride(mission), mission.control_period_s, mission.num_controls
    count = int(np.ceil((num_controls - sample + beyond_s / period) / stride)) + 1
    if isinstance(mission.dynamics, TwoBody):
        motion, drag = tabulated(mission, beyond_s + stride * period)
        rows, offsets = (table[sample::stride, :3][:count] for table in (motion.onward, drag))
        kicks = motion.back[sample + 1 : num_controls + 1] @ motion.pushes[sample:num_controls]
        constants, rest = motion.back[sample], drag[sample]
    else:
        n, constants, offsets, rest = (
            mission.orbit.mean_motion_rad_s,
            np.eye(6),
            np.zeros((count, 3)),
            np.zeros(6),
        )
        push = motion_over(mission.orbit, mission.deputy, (period,)).control[0]
        with plainly("pipeline"):
            rows = np.array([state_transition(n, j * stride * period)[:3] for j in range(count)])
            backward = [state_transition(n, -(i + 1) * period) for i in range(num_controls - sample)]
        kicks = np.array(backward) @ push
    sums = np.concatenate([np.zeros((1, 6, 3)), np.cumsum(kicks, axis=0)])
    return Drift(*(np.ascontiguousarray(each) for each in (rows, offsets, sums, constants, rest)))


def tail_along(
    mission: Mission, drift: Drift, constants: Floats, *, after_s: float, passive_s: float = 0.0
) -> Tail:
    """Return what prices free motion of some constants, (6,), from a known state, by faultless thrusters.

    Both limits count for `after_s` after the end, the least distance for `passive_s` after each push.
    """
    stride = tail_stride(mission)
    spacing_s = stride * mission.control_period_s
    return NO_TAIL._replace(
        rows=drift.rows,
        offsets=drift.offsets,
        spacing=float(stride),
        constants=constants,
        kicks=drift.kicks,
        num_after=int(np.ceil(after_s / spacing_s)),
        num_passive=int(np.ceil(passive_s / spacing_s)),
        doubts=np.zeros(len(drift.rows)),
    )
