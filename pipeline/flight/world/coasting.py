"""Where free motion leads from a sample of a mission's flights, within them and long after their end.

Motion is that of the mission: Clohessy and Wiltshire's equations or, about the Earth, the variational
equations along the chief's orbit (`pipeline.physics.transitions`), with oblateness and drag. Sunlight, which
moves a deputy by less than a metre in three low orbits, is left out.
"""

from functools import lru_cache
from math import ceil
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fis_tools.compiled.decorator import compiled, plainly
from pipeline.array_types import Floats, Integers
from pipeline.flight.world.chief import chief_course, elements_of
from pipeline.physics.motion import state_transition
from pipeline.physics.orbit import air_of
from pipeline.physics.transitions import Transitions, transitions_of
from pipeline.settings.experiment import Mission
from pipeline.settings.mission import TwoBody
from pipeline.threads import in_threads

#: between the instants at which free motion is looked at, at most, s; control periods about the Earth may be
#: longer
SPACING_S = 10.0
#: what is fired moves a deputy further, m, and m/s, within a control period, than the rounding of its track
ROUNDED_M, ROUNDED_M_S = 1e-4, 2e-7


class Arcs(NamedTuple):
    """Free motion by its constants, which what is fired changes, at samples and at instants between them.

    A state at sample k, m and m/s, is ``onward[k] c + drift[k]`` of its six constants c, which are
    ``back[k] (state - drift[k])``; the position at instant j is ``rows[:, :, j] c + offsets[:, j]``.
    """

    onward: Floats  # (K+1, 6, 6)
    back: Floats  # (K+1, 6, 6)
    drift: Floats  # (K+1, 6)
    rows: Floats  # (3, 6, J): one instant behind the other, as vectors take them
    offsets: Floats  # (3, J)
    first: Integers  # (K+1,) instant at sample k, or the next one
    last: Integers  # (K+1,) last instant that sample k looks at
    end_rows: Floats  # (K+1, 3, 6) of positions at the end of what sample k looks at
    end_offsets: Floats  # (K+1, 3)


#: those of its tables that have a row for each instant; the others have one for each sample
BY_INSTANT = ("rows", "offsets")
#: and those that depend on drag
OF_DRAG = ("drift", "offsets", "end_offsets")


class FreeMotion:
    """Where free motion leads from a sample of a mission's flights, up to so many seconds beyond the end."""

    def __init__(self, mission: Mission, beyond_s: float) -> None:
        self._mission, self._period = mission, mission.control_period_s
        self._tables = tabulated(mission, beyond_s) if isinstance(mission.dynamics, TwoBody) else None

    def times(self, seconds: float, spacing_s: float) -> Floats:
        """Return the times after a sample for which there are rows, (J,), s.

        They are `spacing_s` or a control period apart, the last perhaps less: the first is zero, the last
        `seconds`, or, along the chief's orbit about the Earth, the end of that control period.
        """
        if self._tables is None:
            return np.linspace(0.0, seconds, ceil(seconds / spacing_s) + 1)
        return self._period * self._samples(seconds, spacing_s).astype(np.float64)

    def _samples(self, seconds: float, spacing_s: float) -> Integers:
        """Return how many control periods after a sample there are rows for."""
        last, stride = ceil(seconds / self._period - 1e-9), max(1, round(spacing_s / self._period))
        return np.r_[np.arange(0, last, stride), last]

    def rows(self, k: int, seconds: float, spacing_s: float) -> Floats:
        """Return the rows of positions, m, by a state at sample k, m and m/s, and 1, (J, 3, 7).

        There is one for each of `times`.
        """
        if self._tables is None:
            count = len(self.times(seconds, spacing_s))
            return _rows(self._mission.orbit.mean_motion_rad_s, seconds, count)
        course, drag = self._tables
        samples = k + self._samples(seconds, spacing_s)
        rows = course.onward[samples, :3] @ course.back[k]
        off = drag[samples, :3] - rows @ drag[k]
        return np.concatenate([rows, off[:, :, np.newaxis]], axis=2)

    def path(
        self, k: int, states: Floats, seconds: float, spacing_s: float, drifts: Floats | None = None
    ) -> Floats:
        """Return positions, (J, 3, m), m, from states at sample k, (m, 6); see `rows` and `drifts`."""
        rows = self.rows(k, seconds, spacing_s)
        known = np.column_stack([states, np.ones(len(states))])
        path = np.asarray((rows.reshape(-1, 7) @ known.T).reshape(len(rows), 3, len(states)))
        if drifts is None or self._tables is None:
            return path
        more = drifts - self._tables[1]
        samples = k + self._samples(seconds, spacing_s)
        return path + more[:, samples, :3].transpose(1, 2, 0) - rows[:, :, :6] @ more[:, k].T

    def drifts(self, more: Floats) -> Floats:
        """Return where drag, and what accelerates flights besides, leads from rest, (m, N, 6).

        Positions and velocities at N samples, up to beyond the end, are in m and m/s, Hill axes.

        Parameters
        ----------
        more : (m, N-1, 3) array
            Of each flight, held over each control period, m/s^2, Hill axes.

        Raises
        ------
        ValueError
            If motion is that about a circular orbit, which no drag moves.
        """
        if self._tables is None:
            raise ValueError("drag moves deputies about the Earth alone: choose dynamics.model=two_body")
        course, drag = self._tables
        kicks = self._mission.deputy.mass_kg * np.einsum("kij,mkj->mki", course.pushes, more)
        drifts = np.zeros((len(more), *drag.shape))
        for k, step in enumerate(course.steps):
            drifts[:, k + 1] = drifts[:, k] @ step.T + kicks[:, k]
        return drag + drifts

    def distances(
        self,
        states: Floats,
        seconds: float,
        workers: int = 1,
        sample: int = 0,
        *,
        is_relative: bool = False,
        drifts: Floats | None = None,
    ) -> tuple[Floats, Floats]:
        """Return the least and the greatest distance of free motion from the states of flights on.

        Along the chief's orbit about the Earth it is followed for whole control periods.

        Parameters
        ----------
        states : (n, S, 6) array
            Position, m, and velocity, m/s, Hill axes, at each sample.
        seconds : float
        workers : int
            Threads.
        sample : int
            That of the first state.
        is_relative : bool
            Whether states are differences of two deputies', which drag moves alike.
        drifts : (n, N, 6) array, optional
            Where drag leads each flight from rest, if not all alike; see `drifts`.

        Returns
        -------
        nearest, farthest : (n, S) arrays
            m.
        """
        whole = self._arcs(seconds)
        if is_relative:
            whole = whole._replace(**{name: np.zeros_like(getattr(whole, name)) for name in OF_DRAG})
        arcs = _from_sample(whole, sample)
        states = np.ascontiguousarray(states, dtype=np.float64)
        squares = np.empty((2, *states.shape[:2]))

        def follow(flights: slice) -> None:
            if drifts is None:
                note_extremes(arcs, states[flights], squares[0, flights], squares[1, flights])
                return
            for flight in range(flights.start, flights.stop):
                drift, offsets, end_offsets = self._of_drag(drifts[flight], seconds)
                moved = whole._replace(drift=drift, offsets=offsets, end_offsets=end_offsets)
                row = slice(flight, flight + 1)
                note_extremes(_from_sample(moved, sample), states[row], squares[0, row], squares[1, row])

        shares = [share for share in np.array_split(np.arange(len(states)), workers) if len(share)]
        in_threads(follow, [slice(share[0], share[-1] + 1) for share in shares], workers=workers)
        nearest, farthest = np.sqrt(squares.clip(0.0))
        return nearest, farthest

    def _arcs(self, seconds: float) -> Arcs:
        num_samples, period = self._mission.num_controls + 1, self._period
        if self._tables is None:
            return _circular_arcs(self._mission.orbit.mean_motion_rad_s, period, num_samples, seconds)
        course, drag = self._tables
        stride, samples, instants, ends = self._looked_at(seconds)
        drift, offsets, end_offsets = self._of_drag(drag, seconds)
        return Arcs(
            *(course.onward[samples], course.back[samples], drift),
            *(np.ascontiguousarray(course.onward[instants, :3].transpose(1, 2, 0)), offsets),
            *(-(-samples // stride), ends // stride),
            *(np.ascontiguousarray(course.onward[ends, :3]), end_offsets),
        )

    def _looked_at(self, seconds: float) -> tuple[int, Integers, Integers, Integers]:
        """Return the control periods between instants, the samples, the instants, and the ends of samples."""
        stride, samples = max(1, round(SPACING_S / self._period)), np.arange(self._mission.num_controls + 1)
        ends = samples + ceil(seconds / self._period - 1e-9)
        return stride, samples, np.arange(0, ends[-1] + 1, stride), ends

    def _of_drag(self, drag: Floats, seconds: float) -> tuple[Floats, Floats, Floats]:
        """Return the tables `OF_DRAG` from where drag leads from rest, (N, 6)."""
        _, samples, instants, ends = self._looked_at(seconds)
        return drag[samples], drag[instants, :3].T.copy(), np.ascontiguousarray(drag[ends, :3])


def _from_sample(whole: Arcs, sample: int) -> Arcs:
    """Return the tables from a sample on."""
    return Arcs(*(table if name in BY_INSTANT else table[sample:] for name, table in whole._asdict().items()))


@lru_cache(maxsize=4)
def _circular_arcs(mean_motion: float, period: float, num_samples: int, seconds: float) -> Arcs:
    """Return free motion by Clohessy and Wiltshire's equations; its constants are the state at the start."""
    each, stride = max(1, ceil(period / SPACING_S)), max(1, int(SPACING_S / period))
    spacing = period * stride if each == 1 else period / each

    def transitions(times: NDArray[np.floating]) -> Floats:
        with plainly("pipeline"):
            return np.array([state_transition(mean_motion, time) for time in times.tolist()])

    times = period * np.arange(num_samples)
    samples = np.arange(num_samples)
    # instants by whole numbers, so that no rounding parts an instant from its sample
    first = samples * each if each > 1 else -(-samples // stride)
    last = np.floor((times + seconds) / spacing + 1e-9).astype(np.int64)
    instants = spacing * np.arange(last[-1] + 1)
    drift = np.zeros((num_samples, 6))
    return Arcs(
        *(transitions(times), transitions(-times), drift),
        *(
            np.ascontiguousarray(transitions(instants)[:, :3].transpose(1, 2, 0)),
            np.zeros((3, len(instants))),
        ),
        *(first, last),
        *(np.ascontiguousarray(transitions(times + seconds)[:, :3]), drift[:, :3].copy()),
    )


@compiled(error_model="numpy")
def square_at(rows: Floats, offsets: Floats, constants: Floats) -> float:
    """Return the square of the distance, m^2, at rows of positions, (3, 6), with offsets, (3,)."""
    square = 0.0
    for axis in range(3):
        along = offsets[axis]
        for q in range(6):
            along += rows[axis, q] * constants[q]
        square += along * along
    return square


@compiled(error_model="numpy")
def is_on_arc(arcs: Arcs, constants: Floats, sample: int, state: Floats) -> bool:
    """Return whether free motion of some constants leads to a state, to the rounding of tracks."""
    for row in range(6):
        off = arcs.drift[sample, row] - state[row]
        for q in range(6):
            off += arcs.onward[sample, row, q] * constants[q]
        if abs(off) > (ROUNDED_M if row < 3 else ROUNDED_M_S):
            return False
    return True


@compiled(error_model="numpy")
def with_vertex(squares: Floats, j: int, ahead: bool, behind: bool) -> tuple[float, float]:
    """Return the least and the greatest at an instant and at the vertex of the parabola through three there.

    The vertex counts where it is ahead of the instant, or behind it, by less than an interval. `squares` are
    squares of distances, (J,), m^2, of which those beside `j` are known.
    """
    before, now, after = squares[j - 1], squares[j], squares[j + 1]
    slope, bend = 0.5 * (after - before), after - 2.0 * now + before
    step = -slope / bend if bend != 0.0 else 0.0
    if abs(step) >= 1.0 or (step > 0.0 and not ahead) or (step < 0.0 and not behind):
        return now, now
    square = now + step * (slope + 0.5 * step * bend)
    return min(now, square), max(now, square)


@compiled(nogil=True, error_model="numpy")
def note_extremes(arcs: Arcs, states: Floats, nearest: Floats, farthest: Floats) -> None:
    """Fill the squares of the least and of the greatest distance of free motion from each state on, m^2.

    Samples between which nothing was fired are on one arc, which is looked at once.

    Parameters
    ----------
    arcs : Arcs
    states : (n, K+1, 6)
    nearest, farthest : (n, K+1)
        Filled.
    """
    num_samples, room = states.shape[1], arcs.rows.shape[2]
    squares, least, most = np.empty(room), np.empty(room), np.empty(room)
    constants = np.empty(6)
    for flight in range(len(states)):
        k = 0
        while k < num_samples:
            state, past = states[flight, k], k + 1
            for row in range(6):
                constants[row] = 0.0
                for q in range(6):
                    constants[row] += arcs.back[k, row, q] * (state[q] - arcs.drift[k, q])
            while past < num_samples and arcs.first[past] <= arcs.last[k]:
                if not is_on_arc(arcs, constants, past, states[flight, past]):
                    break
                past += 1
            low, middle, high = arcs.first[k], arcs.last[k], arcs.last[past - 1]
            look_along(arcs, constants, low, high, squares)
            accumulate(squares, low, middle, high, least, most)
            for sample in range(k, past):
                now = states[flight, sample]
                near = now[0] * now[0] + now[1] * now[1] + now[2] * now[2]
                then = square_at(arcs.end_rows[sample], arcs.end_offsets[sample], constants)
                begin, end = arcs.first[sample], arcs.last[sample]
                lowest, greatest = within(squares, begin, end, low, middle, high, least, most)
                nearest[flight, sample] = min(near, then, lowest)
                farthest[flight, sample] = max(near, then, greatest)
            k = past


@compiled(error_model="numpy")
def look_along(arcs: Arcs, constants: Floats, low: int, high: int, squares: Floats) -> None:
    """Fill the squares of the distance, (J,), m^2, from an instant to another; `constants` are six."""
    a, b, c, d, e, f = constants[0], constants[1], constants[2], constants[3], constants[4], constants[5]
    for axis in range(3):
        rows, offsets = arcs.rows[axis], arcs.offsets[axis]
        for j in range(low, high + 1):
            along = offsets[j] + rows[0, j] * a + rows[1, j] * b + rows[2, j] * c
            along = along + rows[3, j] * d + rows[4, j] * e + rows[5, j] * f
            squares[j] = along * along if axis == 0 else squares[j] + along * along


@compiled(error_model="numpy")
def accumulate(squares: Floats, low: int, middle: int, high: int, least: Floats, most: Floats) -> None:
    """Fill extremes, (J,), m^2: before the middle instant from each to there, then from there to each."""
    for j in range(middle - 1, low, -1):
        least[j], most[j] = with_vertex(squares, j, True, True)
        if j < middle - 1:
            least[j], most[j] = min(least[j], least[j + 1]), max(most[j], most[j + 1])
    after = max(middle, low + 1)
    for j in range(after, high):
        least[j], most[j] = with_vertex(squares, j, True, True)
        if j > after:
            least[j], most[j] = min(least[j], least[j - 1]), max(most[j], most[j - 1])


@compiled(error_model="numpy")
def within(
    squares: Floats, begin: int, end: int, low: int, middle: int, high: int, least: Floats, most: Floats
) -> tuple[float, float]:
    """Return the extremes from an instant to another, m^2, with those that `accumulate` filled in between."""
    near, far = np.inf, 0.0
    if begin > end:
        return near, far
    for j in (begin, end):
        lowest, greatest = squares[j], squares[j]
        if low < j < high:
            lowest, greatest = with_vertex(squares, j, j == begin, j == end)
        near, far = min(near, lowest), max(far, greatest)
    if begin + 1 < middle:
        near, far = min(near, least[begin + 1]), max(far, most[begin + 1])
    if end - 1 >= max(middle, begin + 1):
        near, far = min(near, least[end - 1]), max(far, most[end - 1])
    return near, far


@lru_cache(maxsize=8)
def _rows(mean_motion: float, seconds: float, count: int) -> Floats:
    """Return the rows of positions of Clohessy and Wiltshire's motion at `count` times, (count, 3, 7)."""
    rows = np.zeros((count, 3, 7))
    with plainly("pipeline"):
        for row, time in zip(rows, np.linspace(0.0, seconds, count).tolist(), strict=True):
            row[:, :6] = state_transition(mean_motion, time)[:3]
    return rows


@lru_cache(maxsize=4)
def tabulated(mission: Mission, beyond_s: float) -> tuple[Transitions, Floats]:
    """Return motion about the Earth to beyond a flight's end, and where drag leads from rest, (N, 6).

    Positions and velocities are in m and m/s, Hill axes. The mission's dynamics are those of two bodies.
    """
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
