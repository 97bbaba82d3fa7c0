"""Where a plan of a few pushes leads, and what is to be seen from there, by geometry alone, without a flight.

Clohessy-Wiltshire motion is linear: the position at sample k is ``free_k + sum_i gain_(k-i) force_i``. On a
true course it is ``free_k + rows_k sum_i (sums_(i+1) - sums_i) force_i``. The Sun's motion is known, and so
is what is lit when. A point is seen from beyond its tangent plane, or from inside the cone and the sphere
that limits on incidence and range bend it into, once the deputy is as far away as its camera needs to cover
the chief (`sight`). Parts of the chief that hide others, a blinded camera and how bright a point is are left
to the flight that every plan is tried in before it is fired.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fis_tools.compiled.decorator import compiled
from pipeline.array_types import Bytes, Floats, Integers
from pipeline.flight.cases.starts import StartRows
from pipeline.flight.fly.workspace import make_workspace, optics_in_use
from pipeline.flight.period.look.optics import beam_of_case, note_lit, want_all
from pipeline.flight.state.arrays import FullOptics, Workspace, World
from pipeline.physics.motion import repeated
from pipeline.physics.sight import NORMAL
from pipeline.physics.transitions import follows_course
from pipeline.settings.experiment import Mission

#: margin of the camera's pointing error for a slightly different flight
ERROR_SHARE = 0.2
#: of so many samples one is looked at first
COARSE = 8
#: control periods that no push takes
MOST_PERIODS = 1_000_000


class Tail(NamedTuple):
    """What free motion after a plan's pushes and its end depends on; without rows it costs nothing."""

    # (T, 3, 6) from constants of free motion to positions so far apart, m
    rows: Floats
    offsets: Floats  # (T, 3) where drag leads from rest, m
    spacing: float  # in control periods
    constants: Floats  # (6,) without force
    kicks: Floats  # (L+1, 6, 3) what 1 N held over so many control periods adds to the constants
    num_after: int  # rows after the end at which both limits count
    num_passive: int  # rows after a push at which the least distance counts, besides those to the next push
    # how far along the track the estimate where the plan begins may be off, squares, (T,), m^2
    doubts: Floats
    # what thrusters may fire wrongly of a force, along its axis and across it, squares of shares
    scale_doubt: float
    tilt_doubt: float
    doubt_price: float  # of a metre by which errors may add to what is outside after a push, m/s
    # along an axis that is fired as planned, N, where pushes may take longer: failures may come within them
    most_force: float


#: free motion that costs nothing
NO_TAIL = Tail(
    *(np.zeros((0, 3, 6)), np.zeros((0, 3)), 1.0, np.zeros(6), np.zeros((0, 6, 3)), 0, 0),
    *(np.zeros(0), 0.0, 0.0, 0.0, np.inf),
)


class Outlook(NamedTuple):
    """What the price of a plan depends on, at S samples from where it begins, evenly apart; P points."""

    free: Floats  # (S, 3) positions without force, m, Hill axes
    gain: Floats  # (S, 3, 3) effect of 1 N held over a control period on the position that much later, m/N
    points: Floats  # (S, 3, P) m, Hill axes
    normals: Floats  # (S, 3, P) unit vectors out of the surface
    heights: Floats  # (P,) of the points' tangent planes over the chief's centre, m
    is_lit: NDArray[np.bool_]  # (S, P) and still to be seen
    sight: Floats  # (S,) distance from which the camera covers all, m; infinite if it points away
    cos_incidence: float  # of the greatest incidence; 0 for any
    max_range: float  # m; infinite for any
    nearest: float  # least distance, m
    farthest: float  # greatest distance, m
    longest_way: float  # along an axis from one sample to the next, m; infinite for any
    least_force: float  # a component smaller than this is not fired, N
    delta_v_per_force: float  # of 1 N held over a control period, m/s
    required: int  # points, of those to see, whose shortfall costs more
    most_force: float  # of thrusters along an axis, N; larger pushes take several control periods
    held: Floats  # (3, step, n) of 1 N along each axis held over more periods, see `by_steps`, m/N
    step: int  # control periods from one sample to the next
    # on a true course instead of gain and held, elsewhere empty: (S, 3, 6) from constants of free motion to
    # positions, and (L, 6, 3) what 1 N held over so many control periods adds to these constants
    rows: Floats = np.zeros((0, 3, 6))
    sums: Floats = np.zeros((0, 6, 3))
    tail: Tail = NO_TAIL


class Geometry(NamedTuple):
    """A chief with P points and a deputy's motion and camera at K+1 samples, in a mission."""

    drift: Floats  # (K+1, 3, 6) from position and velocity at the start to positions without force
    gain: Floats  # (K+1, 3, 3) as of an `Outlook`
    held: Floats  # (K+1, 3, 3) effect of 1 N held over so many control periods at the end of the last, m/N
    points: Floats  # (K+1, 3, P)
    normals: Floats  # (K+1, 3, P)
    heights: Floats  # (P,)
    radius: float  # of the sphere that contains all points, m
    cos_incidence: float
    max_range: float
    # on a true course, else empty: (K+1, 3, 6) from constants of free motion to positions, (K+1, 6, 6) from
    # states to constants, and (K+1, 6, 3) what 1 N held since the start has added to them
    rows: Floats = np.zeros((0, 3, 6))
    back: Floats = np.zeros((0, 6, 6))
    sums: Floats = np.zeros((0, 6, 3))


def geometry_of(mission: Mission, world: World) -> Geometry:
    """Return the geometry of a mission, whose world is given too."""
    num_controls, num_points = world.num_controls, world.num_points
    motion, course, after = repeated(world.motion, num_controls), world.transitions, num_controls + 1
    kicks = course.back[1:after] @ course.pushes[:num_controls]
    sums = np.concatenate([np.zeros((1, 6, 3)), np.cumsum(kicks, axis=0)])
    drift = np.concatenate([np.eye(6)[np.newaxis, :3], motion.transition[:, :3]])
    gain = np.concatenate([np.zeros((1, 3, 3)), motion.control[:, :3]])
    shape = (num_controls + 1, 3, num_points)
    points = np.ascontiguousarray(np.broadcast_to(world.points[:, :, :num_points], shape))
    normals = np.broadcast_to(world.surface[:, NORMAL : NORMAL + 3, :num_points], shape)
    radius, is_sphere = mission.chief.inspection_radius_m, mission.chief.shape == "sphere"
    if not is_sphere:
        radius = float(np.linalg.norm(points[0], axis=0).max())
    return Geometry(
        drift=drift,
        gain=gain,
        held=np.cumsum(gain, axis=0),
        points=points,
        normals=points / radius if is_sphere else np.ascontiguousarray(normals),
        heights=np.full(num_points, radius) if is_sphere else np.sum(points[0] * normals[0], axis=0),
        radius=radius,
        cos_incidence=float(np.sqrt(world.optics.incidence_squared)),
        max_range=float(np.sqrt(world.optics.range_squared)),
        rows=course.onward[:after, :3],
        back=course.back[:after],
        sums=sums if follows_course(course) else np.zeros((0, 6, 3)),
    )


def by_steps(held: Floats, step: int) -> Floats:
    """Return effects of forces held over control periods, (K+1, 3, 3), by axis and by sample, (3, step, n).

    Row r has those of r periods, of ``r + step`` and so on, three components each: the samples of an outlook
    are `step` periods apart, so that it is read from one end to the other.
    """
    padded = np.pad(held, ((0, -len(held) % step), (0, 0), (0, 0)))
    return np.ascontiguousarray(padded.reshape(-1, step, 3, 3).transpose(3, 1, 0, 2)).reshape(3, step, -1)


def sight_along(positions: Floats, boresights: Floats, radius: float, half_angle_deg: float) -> Floats:
    """Return the distances from which a camera covers everything above the horizon, (n,), m.

    Infinite where it points away; positions (m) and boresights, (n, 3), are in the same axes, and `radius` is
    that of the sphere that contains all points.
    """
    inward = -positions / np.linalg.norm(positions, axis=1)[:, np.newaxis]
    off = np.arctan2(
        np.linalg.norm(np.cross(boresights, inward), axis=1), np.sum(boresights * inward, axis=1)
    )
    left = np.radians(half_angle_deg) - (1.0 + ERROR_SHARE) * off
    # a camera with less than a tenth of a degree to spare cannot be relied on
    is_useful = left > np.radians(0.1)
    # a field of view of a right angle or more covers everything above the horizon
    angle = np.minimum(np.where(is_useful, left, 1.0), 0.5 * np.pi)
    return np.where(is_useful, radius / np.sin(angle), np.inf)


def lit_at_samples(world: World, starts: StartRows, work: Workspace | None = None) -> NDArray[np.bool_]:
    """Return which points are lit at each sample of one case's flight, shape (K+1, P).

    A workspace that is given spares making one.
    """
    is_lit = np.empty((world.num_controls + 1, world.points.shape[2]), dtype=np.uint8)
    optics = optics_in_use(world, starts.sun_elevation)
    note_lit_at_samples(world, optics, work or make_workspace(world), starts, is_lit)
    return np.ascontiguousarray(is_lit[:, : world.num_points] > 0)


@compiled(nogil=True, error_model="numpy")
def note_lit_at_samples(
    world: World, optics: FullOptics | None, work: Workspace, cases: Any, is_lit: Bytes
) -> None:
    """Set `is_lit`, (K+1, P padded), to 1 where a point is lit at a sample of the first case's flight."""
    for k in range(len(is_lit)):
        want_all(world, work.ahead)
        note_lit(world, optics, work.ahead, work.lit, beam_of_case(world, optics, cases[0], k))
        for j in range(len(work.lit)):
            is_lit[k, j] = work.lit[j] > 0.0


@compiled(error_model="numpy")
def num_periods(force: float, most_force: float) -> int:
    """Return how many control periods a push takes that would be so large in one, N."""
    periods, share = 1, abs(force) / most_force - 1e-9
    if share == share and 1.0 < share < MOST_PERIODS:  # noqa: PLR0124 - NaN is told apart on board
        periods = int(np.ceil(share))
    return max(1, min(periods, MOST_PERIODS))


@compiled(error_model="numpy")
def samples_coarsely(num_samples: int) -> Integers:
    """Return samples in the order in which points are looked for: coarsely first, as most are soon seen."""
    order, count = np.empty(num_samples, dtype=np.int64), 0
    for offset in range(COARSE):
        for k in range((COARSE - 1 - offset) % COARSE, num_samples, COARSE):
            order[count], count = k, count + 1
    return order


@compiled(error_model="numpy")
def lead_along(genes: Floats, num_pushes: int, outlook: Outlook, effects: Floats, path: Floats) -> float:
    """Write the positions of a plan at all samples into `path`; return the sum of its forces, N.

    Parameters
    ----------
    genes : (4 num_pushes - 1,)
        The plan.
    num_pushes : int
    outlook : Outlook
    effects : (3, 3 S)
        Effect of 1 N along each axis from the sample at which it is fired on, m/N.
    path : (3 S,)
        Filled, m.
    """
    path[:] = outlook.free.ravel()
    spent = 0.0
    for push in range(num_pushes):
        begin = 0 if push == 0 else int(genes[3 * num_pushes + push - 1])
        f, g, h = genes[3 * push], genes[3 * push + 1], genes[3 * push + 2]
        f = f if abs(f) >= outlook.least_force else 0.0
        g = g if abs(g) >= outlook.least_force else 0.0
        h = h if abs(h) >= outlook.least_force else 0.0
        spent = spent + abs(f) + abs(g) + abs(h)
        after = path[3 * begin :]
        if max(abs(f), abs(g), abs(h)) > outlook.most_force:
            for axis, force in enumerate((f, g, h)):
                hold(after, axis, force, outlook)
            continue
        for i in range(len(after)):
            after[i] = after[i] + effects[0, i] * f + effects[1, i] * g + effects[2, i] * h
    return spent


@compiled(error_model="numpy")
def hold(after: Floats, axis: int, force: float, outlook: Outlook) -> None:
    """Add what a push does that takes more control periods than one to the positions after it begins, m.

    `force` would be that of one period, N; it is divided among as many as thrusters need.
    """
    step, periods = outlook.step, num_periods(force, outlook.most_force)
    late = (periods + step - 1) // step  # samples by which the push has ended
    ends, share = outlook.held[axis, 0], float(periods)
    during, ended = after[: 3 * late], after[3 * late :]
    for i in range(len(during)):
        during[i] = during[i] + ends[i] * force / share
    ends, begun = ends[3 * late :], outlook.held[axis, late * step - periods]
    for i in range(len(ended)):
        ended[i] = ended[i] + (ends[i] - begun[i]) * force / share


@compiled(error_model="numpy")
def lead_on_course(genes: Floats, num_pushes: int, outlook: Outlook, path: Floats) -> float:
    """Write the positions of a plan at all samples of a true course into `path`; return the sum of forces, N.

    Parameters are those of `lead_along`.
    """
    path[:] = outlook.free.ravel()
    spent = 0.0
    for push in range(num_pushes):
        begin = 0 if push == 0 else int(genes[3 * num_pushes + push - 1])
        for axis in range(3):
            force = genes[3 * push + axis]
            if abs(force) >= outlook.least_force:
                spent += abs(force)
                push_on_course(path, axis, force, begin, outlook)
    return spent


@compiled(error_model="numpy")
def push_on_course(path: Floats, axis: int, force: float, begin: int, outlook: Outlook) -> None:
    """Add what a push along an axis does to the positions after the sample at which it begins, m.

    `force` would be that of one control period, N; it is divided among as many as thrusters need.
    """
    rows, sums, step = outlook.rows, outlook.sums, outlook.step
    last, periods = len(sums) - 1, num_periods(force, outlook.most_force)
    first = min(begin * step, last)
    ended, share = min(first + periods, last), force / periods
    for sample in range(begin + 1, len(rows)):
        at = min(sample * step, ended)
        for row in range(3):
            moved = 0.0
            for q in range(6):
                moved += rows[sample, row, q] * (sums[at, q, axis] - sums[first, q, axis])
            path[3 * sample + row] += moved * share


@compiled(error_model="numpy")
def lead(genes: Floats, num_pushes: int, outlook: Outlook, effects: Floats, path: Floats) -> float:
    """Write the positions of a plan as `lead_along` or `lead_on_course` does; return the sum of forces."""
    if len(outlook.rows) > 0:
        return lead_on_course(genes, num_pushes, outlook, path)
    return lead_along(genes, num_pushes, outlook, effects, path)


@compiled(error_model="numpy", forceinline=True)
def sample_of(genes: Floats, num_pushes: int, push: int, num_samples: int) -> int:
    """Return the sample at which a push begins: the first one at the first."""
    begin = 0
    if push > 0:
        gene = genes[3 * num_pushes + push - 1]
        if gene == gene and 0.0 <= gene < num_samples:  # noqa: PLR0124 - NaN is told apart on board
            begin = int(gene)
    return begin
