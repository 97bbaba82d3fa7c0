"""Plans of several deputies priced and searched together; the paths of others are moving spheres.

The samples of all deputies that are planned for stand in a row, so that a point is seen best at any of them.
Two deputies are looked at along the straight way from sample to sample: coming nearer than is kept costs as
much as coming too near to the chief. Between their pushes relative paths bend by centimetres in that time.
"""

from collections.abc import Sequence
from math import sqrt
from typing import NamedTuple

import numpy as np

from fis_tools.compiled.decorator import compiled
from fis_tools.compiled.vectors import borrowed
from pipeline.array_types import Floats
from pipeline.flight.fly.foresight import Outlook
from pipeline.flight.fly.free_drift import outside_later
from pipeline.flight.fly.prices import (
    PRICE_OF_DISTANCE,
    Pricing,
    fired,
    height_of,
    note_distances,
    note_path,
    price_of_short,
    pricing_of,
)
from pipeline.flight.fly.pushes import (
    NUM_DRAWS,
    Effort,
    PlanSearch,
    begin,
    bounds_of_plans,
    breed,
    first_plans,
    search_of,
)


class JointOutlook(NamedTuple):
    """What plans of M deputies together are priced by, beside those of E others that stand; S samples."""

    each: Outlook  # of the deputy at hand: its free motion, sight and constants are written into it
    pricing: Pricing  # of `each`
    free: Floats  # (M, S, 3) positions without force, m, Hill axes
    sight: Floats  # (M, S) as of an `Outlook`
    constants: Floats  # (M, 6) of what follows pushes, see `Tail`
    whole: Outlook  # the M S samples of all in a row
    seeing: Pricing  # of `whole`
    others: Floats  # (E, S, 3) paths of the others, m
    # (M, M + E) how far each keeps from each of them, and from each of the others; 0: from none
    apart: Floats


def joint_outlook(
    outlooks: Sequence[Outlook], num_pushes: int, reach: float, others: Floats, apart: Floats
) -> tuple[JointOutlook, int]:
    """Return what prices plans of components up to `reach`, N, and how many points are lit at all.

    Outlooks are those of deputies under one Sun, of the same points; see `JointOutlook` for the last two.
    """
    first, count = outlooks[0], len(outlooks)
    is_still = bool((first.normals == first.normals[0]).all() and (first.points == first.points[0]).all())
    points, normals = (
        np.ascontiguousarray(rows[:1] if is_still else rows) for rows in (first.points, first.normals)
    )
    tail = first.tail._replace(constants=first.tail.constants.copy())
    each = first._replace(
        free=first.free.copy(), sight=first.sight.copy(), points=points, normals=normals, tail=tail
    )
    whole = each._replace(
        free=np.concatenate([outlook.free for outlook in outlooks]),
        sight=np.concatenate([outlook.sight for outlook in outlooks]),
        is_lit=np.tile(first.is_lit, (count, 1)),
        points=points if is_still else np.tile(points, (count, 1, 1)),
        normals=normals if is_still else np.tile(normals, (count, 1, 1)),
    )
    pricing, _ = pricing_of(each, num_pushes, reach)
    seeing, num_lit = pricing_of(whole, num_pushes, reach)
    joint = JointOutlook(
        each=each,
        pricing=pricing,
        free=np.array([outlook.free for outlook in outlooks]),
        sight=np.array([outlook.sight for outlook in outlooks]),
        constants=np.array([outlook.tail.constants for outlook in outlooks]),
        whole=whole,
        seeing=seeing,
        others=others,
        apart=apart,
    )
    return joint, num_lit


@compiled(error_model="numpy")
def note_deputy(deputy: int, genes: Floats, num_pushes: int, joint: JointOutlook) -> tuple[float, float]:
    """Write a deputy's path and room into those of all; return how far outside, as `outside_later` does."""
    each, pricing, num_samples = joint.each, joint.pricing, len(joint.each.free)
    first = deputy * num_samples
    for sample in range(num_samples):
        each.sight[sample] = joint.sight[deputy, sample]
        for axis in range(3):
            each.free[sample, axis] = joint.free[deputy, sample, axis]
    note_path(genes, num_pushes, each, pricing)
    outside, doubtful = note_distances(each, pricing), 0.0
    if len(each.tail.rows) > 0:
        for q in range(6):
            each.tail.constants[q] = joint.constants[deputy, q]
        later, doubtful = outside_later(genes, num_pushes, each, pricing.constants, pricing.doubts)
        outside = max(outside, later)
    for sample in range(num_samples):
        joint.seeing.room[first + sample] = pricing.room[sample]
        for axis in range(3):
            joint.seeing.path[3 * (first + sample) + axis] = pricing.path[3 * sample + axis]
    return outside, doubtful


@compiled(error_model="numpy")
def too_near(path: Floats, other: Floats, apart: float) -> float:
    """Return by how much two deputies come nearer than `apart` on straight ways between samples, m.

    Paths are (3 S,), m.
    """
    nearest = apart
    for sample in range(1, len(path) // 3):
        square = along = way = 0.0
        for axis in range(3):
            now = path[3 * sample + axis] - other[3 * sample + axis]
            step = now - (path[3 * sample - 3 + axis] - other[3 * sample - 3 + axis])
            square, along, way = square + now * now, along + now * step, way + step * step
        # back from the sample by a share of the way
        share = min(max(along / way, 0.0), 1.0) if way > 0.0 else 0.0
        nearest = min(nearest, sqrt(max(square - share * (2.0 * along - share * way), 0.0)))
    return apart - nearest


@compiled(error_model="numpy")
def all_too_near(joint: JointOutlook) -> float:
    """Return by how much deputies come too near to each other and to the others, m, summed over pairs."""
    path, length = joint.seeing.path, 3 * len(joint.each.free)
    count, total = len(joint.free), 0.0
    for deputy in range(count):
        mine = path[deputy * length : (deputy + 1) * length]
        for other in range(deputy):
            if joint.apart[deputy, other] > 0.0:
                its = path[other * length : (other + 1) * length]
                total += too_near(mine, its, joint.apart[deputy, other])
        for other in range(len(joint.others)):
            if joint.apart[deputy, count + other] > 0.0:
                total += too_near(mine, joint.others[other].ravel(), joint.apart[deputy, count + other])
    return total


@compiled(error_model="numpy")
def price_together(
    genes: Floats, num_pushes: int, num_lit: int, needed: int, joint: JointOutlook, limit: float
) -> float:
    """Return the price of plans together, m/s; infinity where it is certain to exceed a limit.

    Parameters
    ----------
    genes : (M (4 num_pushes - 1),)
        Of one deputy after the other, as `price_pushes` takes them.
    num_pushes, num_lit, needed : int
        Number of pushes of each, of points that are lit at any sample, and of those to see.
    joint : JointOutlook
    limit : float
        m/s.
    """
    each, count, num_genes = joint.each, len(joint.free), 4 * num_pushes - 1
    spent = 0.0
    for deputy in range(count):
        for part in range(3 * num_pushes):
            spent = spent + abs(fired(genes, deputy * num_genes + part, each.least_force))
    fuel = spent * each.delta_v_per_force
    if fuel > limit:
        return np.inf
    outside = doubtful = 0.0
    for deputy in range(count):
        plan = genes[deputy * num_genes : (deputy + 1) * num_genes]
        beyond, doubts = note_deputy(deputy, plan, num_pushes, joint)
        outside, doubtful = outside + beyond, doubtful + doubts
    outside = outside + all_too_near(joint)
    if fuel + PRICE_OF_DISTANCE * outside > limit:
        return np.inf
    points, shortfalls, short = joint.seeing.points, joint.seeing.shortfalls, 0.0
    num_short = 0
    for turn in range(num_lit):
        point = points[turn]
        best = height_of(point, joint.whole, joint.seeing)
        if best < 0.0:
            moved = -best
            for i in range(num_short):
                if shortfalls[i] > moved:
                    shortfalls[i], moved = moved, shortfalls[i]
            shortfalls[num_short] = moved
            num_short += 1
            for i in range(turn + 1):  # it comes first the next time
                points[i], point = point, points[i]
            short = price_of_short(num_short, num_lit, needed, each.required, shortfalls)
            if (fuel + short) + PRICE_OF_DISTANCE * outside > limit:
                return np.inf
    return ((fuel + short) + PRICE_OF_DISTANCE * outside) + each.tail.doubt_price * doubtful


@compiled(error_model="numpy")
def leave_others(search: PlanSearch, movers: Floats, num_deputies: int) -> None:
    """Let some mutants change the plan of a single deputy, by numbers from 0 to 1, (n,); the rest all."""
    num_genes = search.plans.shape[1] // num_deputies
    for plan in range(len(movers)):
        mover = int(movers[plan] * (num_deputies + 1))
        for gene in range(search.plans.shape[1]):
            if mover < num_deputies and gene // num_genes != mover:
                search.mutants[plan, gene] = search.plans[plan, gene]


@compiled(error_model="numpy")
def keep_cheaper(search: PlanSearch, num_pushes: int, num_lit: int, needed: int, joint: JointOutlook) -> None:
    """Price the mutants: each takes the place of its plan if it costs at most as much."""
    for plan in range(len(search.plans)):
        price = search.prices[plan]
        cost = price_together(search.mutants[plan], num_pushes, num_lit, needed, joint, price)
        if cost <= price:
            search.prices[plan] = cost
            search.plans[plan] = search.mutants[plan]
            if cost < search.cost[0]:
                search.cost[0] = cost
                search.best[:] = search.mutants[plan]


@compiled(nogil=True, error_model="numpy")
def evolve_together(
    search: PlanSearch,
    draws: Floats,
    movers: Floats,
    num_pushes: int,
    num_lit: int,
    needed: int,
    joint: JointOutlook,
) -> None:
    """Evolve plans of deputies from the first generation on, which stands in `search.plans`.

    Parameters
    ----------
    search : PlanSearch
    draws : (G, n, NUM_DRAWS + M (4 pushes - 1))
        Numbers from 0 to 1, see `breed`.
    movers : (G, n)
        Likewise, see `leave_others`.
    num_pushes, num_lit, needed, joint
        As `price_together` takes them.
    """
    search, joint = borrowed((search, joint))
    begin(search)
    keep_cheaper(search, num_pushes, num_lit, needed, joint)
    for generation in range(len(draws)):
        breed(search, draws[generation])
        leave_others(search, movers[generation], len(joint.free))
        keep_cheaper(search, num_pushes, num_lit, needed, joint)


def search_together(
    outlooks: Sequence[Outlook],
    num_pushes: int,
    needed: int,
    reach_m_s: float,
    effort: Effort,
    generator: np.random.Generator,
    known: Floats,
    others: Floats,
    apart: Floats,
) -> Floats:
    """Search for the cheapest plans together, of components up to `reach_m_s`; see `JointOutlook`.

    Parameters
    ----------
    known : (n, M (4 pushes - 1))
        Plans near which the search begins, besides doing nothing; it begins anywhere without any.

    Returns
    -------
    (M, 4 pushes - 1)
        Genes of each.
    """
    count, reach = len(outlooks), reach_m_s / outlooks[0].delta_v_per_force
    joint, num_lit = joint_outlook(outlooks, num_pushes, reach, others, apart)
    lowest, highest = (np.tile(bound, count) for bound in bounds_of_plans(outlooks[0], num_pushes, reach))
    search = search_of(lowest, highest, effort.num_plans)
    search.plans[:] = first_plans(
        lowest, highest, effort.num_plans, outlooks[0].delta_v_per_force, generator, known
    ).T
    draws = generator.random((effort.num_generations, effort.num_plans, NUM_DRAWS + len(lowest)))
    shape = effort.num_generations, effort.num_plans
    # one deputy alone is always the one that moves
    movers = generator.random(shape) if count > 1 else np.zeros(shape)
    evolve_together(search, draws, movers, num_pushes, num_lit, needed, joint)
    return search.best.reshape(count, -1)
