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


class Tables(NamedTuple):
    """Free motion along the chief's orbit from the start of a mission's flights to so long after their end.

    N instants are a control period apart, K of them before the end.
    """

    rows: Floats  # (N, 3, 6) from constants to positions
    offsets: Floats  # (N, 3) where drag leads from rest, m
    sums: Floats  # (K+1, 6, 3) what 1 N held since the start has added to the constants
    turns: Floats  # (K+1, 6, 6) from states, less `rests`, to constants
    rests: Floats  # (K+1, 6) where drag has led from rest, m and m/s

    def from_sample(self, sample: int, stride: int, count: int) -> Drift:
        """Return so many rows from a sample on; their sums are told apart by those of the sample."""
        parts = self.rows[sample::stride][:count], self.offsets[sample::stride][:count]
        of_sample = self.sums[sample:], self.turns[sample], self.rests[sample]
        return Drift(*(np.ascontiguousarray(each) for each in (*parts, *of_sample)))


@lru_cache(maxsize=4)
def drift_tables(mission: Mission, beyond_s: float) -> Tables:
    """Return the tables that plans on board take for every sample, to so long after the end."""
    num_controls, after = mission.num_controls, beyond_s + tail_stride(mission) * mission.control_period_s
    motion, drag = tabulated(mission, after)
    kicks = motion.back[1 : num_controls + 1] @ motion.pushes[:num_controls]
    sums = np.concatenate([np.zeros((1, 6, 3)), np.cumsum(kicks, axis=0)])
    tables = (
        motion.onward[:, :3],
        drag[:, :3],
        sums,
        motion.back[: num_controls + 1],
        drag[: num_controls + 1],
    )
    return Tables(*(np.ascontiguousarray(each) for each in tables))


def num_rows(mission: Mission, sample: int, beyond_s: float) -> int:
    """Return how many rows a tail has from a sample to so long after the end."""
    periods = mission.num_controls - sample + beyond_s / mission.control_period_s
    return int(np.ceil(periods / tail_stride(mission))) + 1


@lru_cache(maxsize=32)
def drift_from(mission: Mission, sample: int, beyond_s: float) -> Drift:
    """Return free motion from a sample to so long after the end.

    About the Earth it is along the chief's orbit, with oblateness and drag, elsewhere that of a circle, where
    the constants are the state in which it begins.
    """
    stride, period, num_controls = tail_stride(mission), mission.control_period_s, mission.num_controls
    count = num_rows(mission, sample, beyond_s)
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
