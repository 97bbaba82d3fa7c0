"""Where free motion leads from a sample of a mission's flights, within them and long after their end.

Motion is that of the mission: Clohessy and Wiltshire's equations or, about the Earth, the variational
equations along the chief's orbit (`pipeline.physics.transitions`), with oblateness and drag. Sunlight, which
moves a deputy by less than a metre in three low orbits, is left out.
"""

from functools import lru_cache
from math import ceil

import numpy as np

from fis_tools.compiled.decorator import plainly
from pipeline.array_types import Floats
from pipeline.flight.world.chief import chief_course, elements_of, hill_rates
from pipeline.physics.motion import state_transition
from pipeline.physics.orbit import air_of
from pipeline.physics.transitions import Transitions, transitions_of
from pipeline.settings.experiment import Mission
from pipeline.settings.mission import TwoBody


class FreeMotion:
    """Where free motion leads from a sample of a mission's flights, up to so many seconds beyond the end."""

    def __init__(self, mission: Mission, beyond_s: float) -> None:
        self._mission, self._period = mission, mission.control_period_s
        self._tables = _tables(mission, beyond_s) if isinstance(mission.dynamics, TwoBody) else None
        self.fastest = float(np.abs(hill_rates(mission)).max())

    def rows(self, k: int, seconds: float, spacing_s: float) -> Floats:
        """Return the rows, (J, 3, 7), of positions, m, by a state at sample k, m and m/s, and 1.

        They are `spacing_s` or a control period apart: the first is that of the state itself, the last after
        so many seconds.
        """
        if self._tables is None:
            count = ceil(seconds / spacing_s) + 1
            return _rows(self._mission.orbit.mean_motion_rad_s, seconds, count)
        course, drag = self._tables
        last, stride = k + ceil(seconds / self._period - 1e-9), max(1, round(spacing_s / self._period))
        samples = np.r_[np.arange(k, last, stride), last]
        rows = course.onward[samples, :3] @ course.back[k]
        off = drag[samples, :3] - rows @ drag[k]
        return np.concatenate([rows, off[:, :, np.newaxis]], axis=2)

    def path(self, k: int, states: Floats, seconds: float, spacing_s: float) -> Floats:
        """Return positions, (J, 3, m), m, from states at sample k, (m, 6); see `rows`."""
        rows = self.rows(k, seconds, spacing_s)
        known = np.column_stack([states, np.ones(len(states))])
        return np.asarray((rows.reshape(-1, 7) @ known.T).reshape(len(rows), 3, len(states)))


@lru_cache(maxsize=8)
def _rows(mean_motion: float, seconds: float, count: int) -> Floats:
    """Return the rows of positions of Clohessy and Wiltshire's motion at `count` times, (count, 3, 7)."""
    rows = np.zeros((count, 3, 7))
    with plainly("pipeline"):
        for row, time in zip(rows, np.linspace(0.0, seconds, count).tolist(), strict=True):
            row[:, :6] = state_transition(mean_motion, time)[:3]
    return rows


@lru_cache(maxsize=4)
def _tables(mission: Mission, beyond_s: float) -> tuple[Transitions, Floats]:
    """Return motion about the Earth to beyond a flight's end, and where drag leads from rest, (N, 6)."""
    course, mass, dynamics = chief_course(mission, beyond_s), mission.deputy.mass_kg, mission.dynamics
    motion = transitions_of(course, mass)
    drag = np.zeros((len(motion.onward), 6))
    if not isinstance(dynamics, TwoBody) or dynamics.drag_m_s2 == 0.0:
        return motion, drag
    rows = slice(None, None, 2 * course.num_steps)
    positions, axes = course.positions[rows], course.axes[rows]
    speeds = np.diff(positions, axis=0) / mission.control_period_s
    air = air_of(elements_of(mission), mission.orbit.elements.semi_major_axis_m, course.gravity)
    thinned = np.exp(air.thinning * (air.lowest - np.linalg.norm(positions[:-1], axis=1)))
    slowed = -air.drag_per_square * (thinned * np.linalg.norm(speeds, axis=1))[:, np.newaxis] * speeds
    for k, pull in enumerate(slowed):
        drag[k + 1] = motion.steps[k] @ drag[k] + motion.pushes[k] @ (mass * axes[k] @ pull)
    return motion, drag


#: between the instants at which what follows a flight's end is looked at, s
LOOK_AFTER_S = 20.0


def rows_after(mission: Mission, after_s: float) -> Floats:
    """Return `World.after`: rows of positions after the end, (J, 3, 7); none for no time."""
    if after_s == 0.0:
        return np.zeros((0, 3, 7))
    return FreeMotion(mission, after_s).rows(mission.num_controls, after_s, LOOK_AFTER_S)
