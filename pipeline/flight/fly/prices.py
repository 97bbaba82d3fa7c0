"""The price of a plan, without a flight: of many plans side by side, or of one plan up to a limit.

It is delta-v, and what is missed or leads outside the limits; both ways it is the same number. A search only
asks whether a plan costs at most as much as another one. Prices are sums of parts that are not negative, and
rounded addition is monotone: so what a part of them exceeds, the whole exceeds for certain. The points that
were hardest to see come first, each at the sample at which it was seen last, so that most plans are rejected
by a few of them. What prices one plan is also written as C, see `pipeline.onboard`.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fis_tools.compiled.decorator import compiled, plain
from fis_tools.compiled.vectors import least, load, most, some, store
from pipeline.array_types import Floats, Integers
from pipeline.flight.fly.foresight import Outlook, lead, num_periods, sample_of, samples_coarsely
from pipeline.flight.fly.free_drift import num_doubts, outside_later

#: prices of a metre, m/s: by which a point falls short, more where it is required, and outside the limits
PRICE_OF_HEIGHT, PRICE_OF_REQUIRED, PRICE_OF_DISTANCE = 0.01, 0.03, 0.05
#: metres outside the limits that cost as much as a metre of a way that is too long
WAY_AS_FAR = 5.0
#: shortfall of a point that is never lit while the camera works, m
NEVER = -1e3
#: plans that are evaluated side by side
PLANS = 16


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


class Pricing(NamedTuple):
    """What pricing remembers from plan to plan, and its working space: S samples, P points."""

    effects: Floats  # (3, 3 S) of 1 N along each axis from the sample at which it is fired on, m/N
    samples: Integers  # (S,) in the order in which points are looked for
    is_weak: bool  # whether pushes may take more than a control period
    points: Integers  # (P,) that are lit at any sample, the hardest to see first
    seen_at: Integers  # (P,) the sample at which each was seen last
    path: Floats  # (3 S,) m
    room: Floats  # (S,) by how much farther away than its camera needs the deputy is, m
    shortfalls: Floats  # (P,) of points that are not seen, ascending, m
    constants: Floats  # (6,) of free motion, see `outside_later`
    doubts: Floats  # (6, `num_doubts`) likewise


def pricing_of(outlook: Outlook, num_pushes: int, reach: float) -> tuple[Pricing, int]:
    """Return what prices plans of components up to `reach`, N, and how many points are lit at all."""
    num_samples, num_points = outlook.is_lit.shape
    pricing = Pricing(
        effects=np.ascontiguousarray(outlook.gain.transpose(2, 0, 1)).reshape(3, -1),
        samples=plain(samples_coarsely)(num_samples),
        is_weak=reach > outlook.most_force,
        points=np.zeros(num_points, dtype=np.int64),
        seen_at=np.zeros(num_points, dtype=np.int64),
        path=np.empty(3 * num_samples),
        room=np.empty(num_samples),
        shortfalls=np.empty(num_points),
        constants=np.empty(6),
        doubts=np.empty((6, num_doubts(outlook.tail, num_pushes))),
    )
    return pricing, list_lit(outlook.is_lit, pricing.points, pricing.seen_at)


@compiled(error_model="numpy")
def list_lit(is_lit: NDArray[np.bool_], points: Integers, seen_at: Integers) -> int:
    """Write which points are lit at any sample, and return how many; none was seen yet."""
    num_lit = 0
    for point in range(is_lit.shape[1]):
        is_any = False
        for sample in range(len(is_lit)):
            if is_lit[sample, point] > 0:
                is_any = True
                break
        seen_at[point] = 0
        if is_any:
            points[min(num_lit, len(points) - 1)] = point
        num_lit += is_any
    return num_lit


@compiled(error_model="numpy", forceinline=True)
def fired(genes: Floats, part: int, least_force: float) -> float:
    """Return a component of a push, N: zero where it is too small to be fired."""
    force = genes[part]
    return force if abs(force) >= least_force else 0.0


@compiled(error_model="numpy")
def note_path(genes: Floats, num_pushes: int, outlook: Outlook, pricing: Pricing) -> None:
    """Write the positions of a plan at all samples, m: `lead`, sample by sample."""
    path, num_samples = pricing.path, len(outlook.free)
    for sample in range(num_samples):
        for axis in range(3):
            path[3 * sample + axis] = outlook.free[sample, axis]
    for push in range(num_pushes):
        begin = sample_of(genes, num_pushes, push, num_samples)
        if len(outlook.rows) > 0:
            for axis in range(3):
                note_push_on_course(
                    fired(genes, 3 * push + axis, outlook.least_force), axis, begin, outlook, path
                )
        else:
            x = fired(genes, 3 * push, outlook.least_force)
            y = fired(genes, 3 * push + 1, outlook.least_force)
            z = fired(genes, 3 * push + 2, outlook.least_force)
            if pricing.is_weak and max(abs(x), abs(y), abs(z)) > outlook.most_force:
                note_long_push(x, 0, begin, outlook, path)
                note_long_push(y, 1, begin, outlook, path)
                note_long_push(z, 2, begin, outlook, path)
            else:
                note_push(x, y, z, begin, num_samples, pricing)


@compiled(error_model="numpy")
def note_push(x: float, y: float, z: float, begin: int, num_samples: int, pricing: Pricing) -> None:
    """Add what a push, N, does to the positions from a sample on, m."""
    path, effects = pricing.path, pricing.effects
    for sample in range(num_samples):
        after = sample - begin
        if after >= 0:
            for axis in range(3):
                moved = path[3 * sample + axis] + effects[0, 3 * after + axis] * x
                moved = moved + effects[1, 3 * after + axis] * y
                path[3 * sample + axis] = moved + effects[2, 3 * after + axis] * z


@compiled(error_model="numpy")
def note_long_push(force: float, component: int, begin: int, outlook: Outlook, path: Floats) -> None:
    """Add what a push along an axis does that takes as many control periods as thrusters need, m.

    `force` would be that of one period, N.
    """
    step, periods = outlook.step, num_periods(force, outlook.most_force)
    late = (periods + step - 1) // step  # samples by which the push has ended
    row, share = late * step - periods, float(periods)
    for sample in range(len(outlook.free)):
        after = sample - begin
        if after >= 0:
            for axis in range(3):
                moved = outlook.held[component, 0, 3 * after + axis]
                ended = after - late
                if ended >= 0:
                    moved = moved - outlook.held[component, row, 3 * ended + axis]
                path[3 * sample + axis] = path[3 * sample + axis] + moved * force / share


@compiled(error_model="numpy")
def note_push_on_course(force: float, component: int, begin: int, outlook: Outlook, path: Floats) -> None:
    """Add what a push along an axis does to the positions after a sample of a true course, m.

    `force` would be that of one control period, N; it is divided among as many as thrusters need.
    """
    rows, sums, step = outlook.rows, outlook.sums, outlook.step
    last, periods = max(0, len(sums) - 1), num_periods(force, outlook.most_force)
    first = min(begin * step, last)
    ended, share = min(first + periods, last), force / periods
    if force != 0.0:
        for sample in range(len(outlook.free)):
            if sample > begin:
                at = min(sample * step, ended)
                for axis in range(3):
                    moved = 0.0
                    for q in range(6):
                        moved += rows[sample, axis, q] * (sums[at, q, component] - sums[first, q, component])
                    path[3 * sample + axis] += moved * share


@compiled(error_model="numpy")
def note_distances(outlook: Outlook, pricing: Pricing) -> float:
    """Write how much farther away than its camera needs the deputy is; return how far outside, m."""
    path, outside = pricing.path, 0.0
    for sample in range(len(outlook.free)):
        x, y, z = path[3 * sample], path[3 * sample + 1], path[3 * sample + 2]
        distance = np.sqrt(x * x + y * y + z * z)
        if sample > 0:
            outside = max(outside, outlook.nearest - distance, distance - outlook.farthest)
            if outlook.longest_way < np.inf:
                before = 3 * sample - 3
                way = max(abs(x - path[before]), abs(y - path[before + 1]), abs(z - path[before + 2]))
                outside = max(outside, WAY_AS_FAR * (way - outlook.longest_way))
        pricing.room[sample] = distance - outlook.sight[sample]
    return outside


@compiled(error_model="numpy", forceinline=True)
def raised(best: float, point: int, sample: int, outlook: Outlook, pricing: Pricing) -> float:
    """Return by how much a point is seen best, m, at a sample or before."""
    room, path = pricing.room[sample], pricing.path
    if room > best and outlook.is_lit[sample, point] > 0:
        row = sample if len(outlook.normals) > 1 else 0
        x, y, z = path[3 * sample], path[3 * sample + 1], path[3 * sample + 2]
        height = outlook.normals[row, 0, point] * x + outlook.normals[row, 1, point] * y
        height = height + outlook.normals[row, 2, point] * z - outlook.heights[point]
        if (outlook.cos_incidence != 0.0 or outlook.max_range < np.inf) and height > best:
            dx, dy = x - outlook.points[row, 0, point], y - outlook.points[row, 1, point]
            dz = z - outlook.points[row, 2, point]
            apart = np.sqrt(dx * dx + dy * dy + dz * dz)
            height = min(height - outlook.cos_incidence * apart, outlook.max_range - apart)
        best = max(best, min(height, room))
    return best


@compiled(error_model="numpy")
def height_of(point: int, outlook: Outlook, pricing: Pricing) -> float:
    """Return by how much a point is seen best, m; where it is seen at all, not more than at some sample."""
    best = raised(NEVER, point, pricing.seen_at[point], outlook, pricing)
    if best < 0.0:
        for turn in range(len(pricing.samples)):
            sample = pricing.samples[turn]
            if sample < len(outlook.free):  # on board fewer are left in flight
                best = raised(best, point, sample, outlook, pricing)
            if best >= 0.0:
                pricing.seen_at[point] = sample
                break
    return best


@compiled(error_model="numpy")
def price_of_short(num_short: int, num_lit: int, needed: int, required: int, shortfalls: Floats) -> float:
    """Return what the `needed` points nearest to being seen cost, m/s; others of those lit are seen."""
    short, short_of_required = 0.0, 0.0
    num_seen = num_lit - num_short
    for j in range(num_short):
        if num_seen + j < needed:
            short += shortfalls[j]
            if num_seen + j < required:
                short_of_required = short
    return PRICE_OF_HEIGHT * short + PRICE_OF_REQUIRED * short_of_required


@compiled(error_model="numpy")
def price_up_to(
    genes: Floats,
    num_pushes: int,
    num_lit: int,
    needed: int,
    outlook: Outlook,
    pricing: Pricing,
    limit: float,
) -> float:
    """Return the price of a plan, m/s; infinity where it is certain to exceed a limit.

    Parameters
    ----------
    genes : (4 num_pushes - 1,)
        As `price_pushes` takes them.
    num_pushes, num_lit, needed : int
        Number of pushes, of points that are lit at any sample, and of those to see.
    outlook : Outlook
    pricing : Pricing
    limit : float
        m/s.
    """
    spent = 0.0
    for part in range(3 * num_pushes):
        spent = spent + abs(fired(genes, part, outlook.least_force))
    fuel = spent * outlook.delta_v_per_force
    if fuel > limit:
        return np.inf
    note_path(genes, num_pushes, outlook, pricing)
    outside = note_distances(outlook, pricing)
    if fuel + PRICE_OF_DISTANCE * outside > limit:
        return np.inf
    points, shortfalls = pricing.points, pricing.shortfalls
    num_short, short, is_over = 0, 0.0, False
    for turn in range(num_lit):
        point = points[turn]
        best = height_of(point, outlook, pricing)
        if best < 0.0:
            moved = -best
            for i in range(num_short):
                if shortfalls[i] > moved:
                    shortfalls[i], moved = moved, shortfalls[i]
            shortfalls[min(num_short, len(shortfalls) - 1)] = moved
            num_short += best < 0.0
            for i in range(turn + 1):  # it comes first the next time
                points[i], point = point, points[i]
            short = price_of_short(num_short, num_lit, needed, outlook.required, shortfalls)
            if (fuel + short) + PRICE_OF_DISTANCE * outside > limit:
                is_over = True
                break
    if is_over:
        return np.inf
    doubtful = 0.0
    if len(outlook.tail.rows) > 0:
        later, doubtful = outside_later(genes, num_pushes, outlook, pricing.constants, pricing.doubts)
        outside = max(outside, later)
    return ((fuel + short) + PRICE_OF_DISTANCE * outside) + outlook.tail.doubt_price * doubtful
