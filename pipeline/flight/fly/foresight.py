"""What a plan of a few pushes would come to, by geometry alone: its price, without a flight.

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
from fis_tools.compiled.vectors import least, load, most, some, store
from pipeline.array_types import Bytes, Floats, Integers
from pipeline.flight.cases.starts import StartRows
from pipeline.flight.fly.workspace import make_workspace, optics_in_use
from pipeline.flight.period.look.optics import beam_of_case, note_lit, want_all
from pipeline.flight.state.arrays import FullOptics, Workspace, World
from pipeline.physics.motion import repeated
from pipeline.physics.sight import NORMAL
from pipeline.physics.transitions import follows_course
from pipeline.settings.experiment import Mission

#: prices of a metre, m/s: by which a point falls short, more where it is required, and outside the limits
PRICE_OF_HEIGHT, PRICE_OF_REQUIRED, PRICE_OF_DISTANCE = 0.01, 0.03, 0.05
#: metres outside the limits that cost as much as a metre of a way that is too long
WAY_AS_FAR = 5.0
#: shortfall of a point that is never lit while the camera works, m
NEVER = -1e3
#: margin of the camera's pointing error for a slightly different flight
ERROR_SHARE = 0.2
#: of so many samples one is looked at first
COARSE = 8
#: control periods that no push takes
MOST_PERIODS = 1_000_000
#: plans that are evaluated side by side
PLANS = 16


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


#: free motion that costs nothing
NO_TAIL = Tail(
    *(np.zeros((0, 3, 6)), np.zeros((0, 3)), 1.0, np.zeros(6), np.zeros((0, 6, 3)), 0, 0),
    *(np.zeros(0), 0.0, 0.0, 0.0),
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


@compiled(error_model="numpy")
def longest_of(genes: Floats, num_pushes: int, push: int, outlook: Outlook) -> int:
    """Return how many control periods a push takes: the most along any axis, and 1 of nothing."""
    longest = 1
    for axis in range(3):
        force = genes[3 * push + axis]
        if abs(force) >= outlook.least_force:
            longest = max(longest, num_periods(force, outlook.most_force))
    return longest


@compiled(error_model="numpy")
def num_doubts(tail: Tail, num_pushes: int) -> int:
    """Return how many deviations of pushes there are: along each axis, none of thrusters without errors."""
    return 3 * num_pushes if tail.scale_doubt + tail.tilt_doubt > 0.0 else 0


@compiled(error_model="numpy")
def follow_pushes(
    genes: Floats, num_pushes: int, outlook: Outlook, period: int, constants: Floats, doubts: Floats
) -> None:
    """Write the constants of free motion after what the pushes of a plan fire before a control period.

    Columns of `doubts`, see `num_doubts`, are what a deviation of each push along each axis adds to them.
    """
    tail, kicks = outlook.tail, outlook.tail.kicks
    stop = min(period, max(0, len(kicks) - 1))
    for q in range(6):
        constants[q] = tail.constants[q]
        for column in range(doubts.shape[1]):
            doubts[q, column] = 0.0
    for push in range(num_pushes):
        begin = outlook.step * sample_of(genes, num_pushes, push, len(outlook.free))
        square, longest = 0.0, 1
        for axis in range(3 if begin < period else 0):
            force = genes[3 * push + axis]
            if abs(force) >= outlook.least_force:
                periods = num_periods(force, outlook.most_force)
                end = min(begin + periods, stop)
                for q in range(6):
                    constants[q] += (kicks[end, q, axis] - kicks[begin, q, axis]) * force / periods
                square, longest = square + force * force, max(longest, periods)
        if doubts.shape[1] > 0 and square > 0.0:
            end = min(begin + longest, stop)
            for axis in range(3):
                force = genes[3 * push + axis]
                along = force * force if abs(force) >= outlook.least_force else 0.0
                wrong = np.sqrt(tail.scale_doubt * along + tail.tilt_doubt * (square - along)) / longest
                for q in range(6):
                    doubts[q, 3 * push + axis] = (kicks[end, q, axis] - kicks[begin, q, axis]) * wrong


@compiled(error_model="numpy")
def doubt_along(tail: Tail, j: int, doubts: Floats) -> float:
    """Return how far along the track free motion may be off at a row of a tail, m."""
    square = tail.doubts[j]
    for column in range(doubts.shape[1]):
        off = 0.0
        for q in range(6):
            off += tail.rows[j, 1, q] * doubts[q, column]
        square += off * off
    return np.sqrt(square)


@compiled(error_model="numpy")
def reach_of(
    tail: Tail, first: int, last: int, constants: Floats, doubts: Floats, is_certain: bool
) -> tuple[float, float, float]:
    """Return the least and the greatest distance of free motion at rows of a tail, and the least in doubt, m.

    Errors of estimates and thrusters grow along the track: unless it `is_certain`, they bring the deputy
    nearer there.
    """
    near_square, far_square, nearer_square = np.inf, 0.0, np.inf
    count = len(tail.rows)
    for j in range(max(0, min(first, count)), max(0, min(last + 1, count))):
        across, ahead, doubt = 0.0, 0.0, 0.0
        if not is_certain:
            doubt = doubt_along(tail, j, doubts)
        for axis in range(3):
            along = tail.offsets[j, axis]
            for q in range(6):
                along += tail.rows[j, axis, q] * constants[q]
            if axis == 1:
                ahead = abs(along)
            else:
                across += along * along
        square, near = across + ahead * ahead, max(0.0, ahead - doubt)
        near_square, far_square = min(near_square, square), max(far_square, square)
        nearer_square = min(nearer_square, across + near * near)
    return np.sqrt(near_square), np.sqrt(far_square), np.sqrt(nearer_square)


@compiled(error_model="numpy")
def outside_later(
    genes: Floats, num_pushes: int, outlook: Outlook, constants: Floats, doubts: Floats
) -> tuple[float, float]:
    """Return how far outside the limits free motion leads after a plan's pushes, and after the end, m.

    The last two are working space, (6,) and (6, num_doubts).

    After each push the thrusters may fail, at any time up to the next one, or up to the end, and within one
    after each control period. It is the most of all these, and the sum of what errors may add after each
    push.
    """
    tail, last, worst, doubtful = outlook.tail, len(outlook.tail.kicks) - 1, 0.0, 0.0
    num_samples = len(outlook.free)
    if len(tail.rows) == 0:
        return worst, doubtful
    for push in range(num_pushes if tail.num_passive > 0 else 0):
        begin = outlook.step * sample_of(genes, num_pushes, push, num_samples)
        longest = longest_of(genes, num_pushes, push, outlook)
        for fired in range(1, longest + 1):
            end, is_last = begin + fired, fired == longest
            following = last if is_last else end
            for other in range(num_pushes):
                at = outlook.step * sample_of(genes, num_pushes, other, num_samples)
                if other != push and at + longest_of(genes, num_pushes, other, outlook) > end:
                    following = min(following, max(at, end))
            follow_pushes(genes, num_pushes, outlook, end, constants, doubts)
            first = int(np.ceil(end / tail.spacing))
            until = int(np.ceil(following / tail.spacing)) + tail.num_passive
            near, _, nearer = reach_of(tail, first, until, constants, doubts, not is_last)
            outside = max(0.0, outlook.nearest - near)
            worst = max(worst, outside)
            if is_last:
                doubtful = doubtful + max(0.0, outlook.nearest - nearer) - outside
    if tail.num_after > 0:
        follow_pushes(genes, num_pushes, outlook, last, constants, doubts)
        end = int(np.ceil(last / tail.spacing))
        near, far, _ = reach_of(tail, end, end + tail.num_after, constants, doubts, True)
        worst = max(worst, outlook.nearest - near, far - outlook.farthest)
    return worst, doubtful


@compiled(error_model="numpy")
def price_shortfalls(best: Floats, needed: int, required: int) -> float:
    """Return what it costs by how much the `needed` points nearest to being seen fall short, m/s."""
    short, short_of_required = 0.0, 0.0
    # those that fall short of nothing cost nothing, and need no order
    shortfalls = np.sort(-best[best < 0.0])
    num_seen = len(best) - len(shortfalls)
    for j in range(needed - num_seen):
        short += shortfalls[j]
        if num_seen + j < required:
            short_of_required = short
    return PRICE_OF_HEIGHT * short + PRICE_OF_REQUIRED * short_of_required


@compiled(nogil=True, error_model="numpy")
def price_pushes(genes: Floats, num_pushes: int, needed: int, outlook: Outlook, costs: Floats) -> None:
    """Compute the price of each of n plans, m/s.

    It is a plan's delta-v, plus a price for each metre by which points fall short of being seen, summed over
    the nearest ones, plus one for each metre outside the distance limits, or beyond the longest way allowed.

    Parameters
    ----------
    genes : (4 num_pushes - 1, n)
        Forces in N, push by push, then the samples of all pushes but the first; one column per plan.
    num_pushes, needed : int
        Number of pushes, the first at the first sample, and of points to see.
    outlook : Outlook
    costs : (n,)
        Filled.
    """
    free, normals, points, heights = outlook.free, outlook.normals, outlook.points, outlook.heights
    is_lit, sight, cos_incidence, max_range = (
        outlook.is_lit,
        outlook.sight,
        outlook.cos_incidence,
        outlook.max_range,
    )
    num_samples, num_points, num_plans = len(free), normals.shape[2], genes.shape[1]
    effects = np.ascontiguousarray(outlook.gain.transpose(2, 0, 1)).reshape(3, -1)
    path, spent = np.empty(3 * num_samples), np.empty(PLANS)
    outside, doubtful = np.empty(PLANS), np.empty(PLANS)
    positions, best = np.empty((num_samples, 3, PLANS)), np.empty((num_points, PLANS))
    is_flat = cos_incidence == 0.0 and max_range == np.inf
    left = np.arange(num_points)
    order, constants = samples_coarsely(num_samples), np.empty(6)
    doubts = np.empty((6, num_doubts(outlook.tail, num_pushes)))
    for first in range(0, num_plans, PLANS):
        for lane in range(PLANS):
            # spare lanes repeat the last plan
            plan = min(first + lane, num_plans - 1)
            spent[lane] = lead(genes[:, plan], num_pushes, outlook, effects, path)
            outside[lane], doubtful[lane] = outside_later(
                genes[:, plan], num_pushes, outlook, constants, doubts
            )
            positions[:, :, lane] = path.reshape(-1, 3)
        best[:], num_left = NEVER, num_points
        for turn in range(num_samples):
            # coarsely first: most points are soon seen by all plans
            k = order[turn]
            x, y = load(positions, (k, 0, 0), PLANS), load(positions, (k, 1, 0), PLANS)
            z = load(positions, (k, 2, 0), PLANS)
            distance = np.sqrt(x * x + y * y + z * z)
            if k > 0:
                beyond = most(outlook.nearest - distance, distance - outlook.farthest)
                if outlook.longest_way < np.inf:
                    way = abs(x - load(positions, (k - 1, 0, 0), PLANS))
                    way = most(abs(y - load(positions, (k - 1, 1, 0), PLANS)), way)
                    way = most(abs(z - load(positions, (k - 1, 2, 0), PLANS)), way)
                    beyond = most(WAY_AS_FAR * (way - outlook.longest_way), beyond)
                store(outside, 0, most(beyond, load(outside, 0, PLANS)))
            room, index = distance - sight[k], 0
            while index < num_left and sight[k] < np.inf:
                j = left[index]
                index += 1
                if is_lit[k, j]:
                    height = normals[k, 0, j] * x + normals[k, 1, j] * y + normals[k, 2, j] * z - heights[j]
                    reached, before = least(height, room), load(best, (j, 0), PLANS)
                    # incidence and range only lower it: no root where it would not be the best anyway
                    if not is_flat and some(reached > before):
                        dx, dy, dz = x - points[k, 0, j], y - points[k, 1, j], z - points[k, 2, j]
                        apart = np.sqrt(dx * dx + dy * dy + dz * dz)
                        height = least(height - cos_incidence * apart, max_range - apart)
                        reached = least(height, room)
                    reached = most(reached, before)
                    store(best, (j, 0), reached)
                    if not some(reached < 0.0):  # seen by all plans, by how much costs nothing
                        index, num_left = index - 1, num_left - 1
                        left[index], left[num_left] = left[num_left], j
        for lane in range(min(PLANS, num_plans - first)):
            cost = spent[lane] * outlook.delta_v_per_force
            cost = cost + price_shortfalls(best[:, lane], needed, outlook.required)
            cost = cost + PRICE_OF_DISTANCE * outside[lane]
            costs[first + lane] = cost + outlook.tail.doubt_price * doubtful[lane]
