"""Plans as they are made on board: from a state alone, sum by sum, so that C gives the same bits.

A controller with `foresight_bare` plans in this way: no flight is flown ahead, and the camera is taken to be
aimed at the chief. Here is where it would drift, what will be lit, how many points it must see, and what a
plan fires when. `pipeline.onboard` translates these functions.
"""

from fis_tools.compiled.decorator import compiled
from fis_tools.compiled.three import Three, load_at
from fis_tools.compiled.vectors import load, select, store
from pipeline.array_types import Bytes, Floats
from pipeline.flight.fly.foresight import Outlook, num_periods, sample_of
from pipeline.flight.fly.prices import fired
from pipeline.flight.fly.pushes import LATEST, LATEST_OF_ENDS, PlanSearch, begin
from pipeline.flight.period.look.guidance import POINTS
from pipeline.flight.period.look.optics import beam_from, lit_points, sun_after
from pipeline.flight.state.arrays import FullOptics, World
from pipeline.physics.motion import position_after, propagator_of, velocity_after


@compiled(error_model="numpy")
def note_products(rows: Floats, state: Floats, products: Floats) -> None:
    """Write the products of rows of six numbers, (n, m, 6), with a state, (6,)."""
    for row in range(len(products)):
        for axis in range(products.shape[1]):
            total = rows[row, axis, 0] * state[0]
            for q in range(1, 6):
                total = total + rows[row, axis, q] * state[q]
            products[row, axis] = total


@compiled(error_model="numpy")
def predict(world: World, state: Floats, force: Three, periods: int) -> None:
    """Move a state (6,), m and m/s, by control periods; a force, N, is held over the first."""
    step, held = propagator_of(world.motion, 0), force
    for _ in range(min(periods, world.num_controls)):
        position, velocity = Three(state[0], state[1], state[2]), Three(state[3], state[4], state[5])
        moved, after = (
            position_after(step, position, velocity, held),
            velocity_after(step, position, velocity, held),
        )
        state[0], state[1], state[2] = moved.x, moved.y, moved.z
        state[3], state[4], state[5] = after.x, after.y, after.z
        held = Three(0.0, 0.0, 0.0)


@compiled(error_model="numpy")
def note_light(
    world: World,
    optics: FullOptics | None,
    lit_marks: Floats,
    sun_at_start: Floats,
    height_at_start: Floats,
    wanted: Floats,
    ever: Floats,
    first: int,
    step: int,
    is_lit: Bytes,
) -> int:
    """Write which of the wanted points are lit at samples `step` control periods apart, (S, P), 1 or 0.

    Parameters
    ----------
    world, optics, lit_marks
        As `lit_points` takes them.
    sun_at_start, height_at_start : (2, 1)
        Cosine and sine of the Sun's angle and elevation at the flight's start.
    wanted : (P padded,)
        1 for points to inspect.
    ever : (P padded,)
        Working space.
    first, step : int
        Control periods.
    is_lit : (S, P)
        Filled.

    Returns
    -------
    int
        How many of the wanted points are lit at any time in the flight.
    """
    sample, due, num_ever = 0, first, 0
    sun = sun_at_start[0, 0], sun_at_start[1, 0]
    height = height_at_start[0, 0], height_at_start[1, 0]
    for j in range(world.points.shape[2]):
        ever[j] = 0.0
    for k in range(world.num_controls + 1):
        sun_then, height_then = sun_after(world, sun, height, k)
        beam = beam_from(world, optics, k, sun_then, height_then)
        for j in range(0, world.points.shape[2], POINTS):
            points, before = load_at(world.points, beam.sample, 0, j, POINTS), load(ever, j, POINTS)
            lit = lit_points(world, optics, lit_marks, j, points, load(wanted, j, POINTS) > 0.0, beam)
            store(lit_marks, j, select(lit, 1.0, 0.0))
            store(ever, j, select(lit, 1.0, before))
        if k == due and sample < len(is_lit):
            for j in range(world.num_points):
                is_lit[sample, j] = 1 if lit_marks[j] > 0.0 else 0
            sample += 1
            due += step
    for j in range(world.num_points):
        num_ever += ever[j] > 0.0
    return num_ever


@compiled(error_model="numpy")
def num_needed(num_left: int, num_lit: int, missed: int) -> int:
    """Return how many points a plan must see that may miss so many of those left, of those lit in time."""
    return max(0, min(num_left - missed, num_lit))


@compiled(error_model="numpy")
def note_bounds(search: PlanSearch, num_pushes: int, reach: float, num_samples: int, is_tailed: bool) -> None:
    """Write the bounds of genes, see `price_pushes`: of components up to `reach`, N."""
    latest = max(1.0, (LATEST_OF_ENDS if is_tailed else LATEST) * (num_samples - 1))
    for gene in range(search.plans.shape[1]):
        is_force = gene < 3 * num_pushes
        search.lowest[gene] = -reach if is_force else 0.0
        search.highest[gene] = reach if is_force else latest


@compiled(error_model="numpy")
def scatter(search: PlanSearch, draws: Floats) -> None:
    """Write the first plans, from numbers from 0 to 1, (G, n)."""
    for gene in range(search.plans.shape[1]):
        drawn = draws[gene]
        for plan in range(len(search.plans)):
            across = search.highest[gene] - search.lowest[gene]
            search.plans[plan, gene] = search.lowest[gene] + across * drawn[plan]
    begin(search)


@compiled(error_model="numpy")
def give(
    genes: Floats, num_pushes: int, outlook: Outlook, most_force: float, period: int, given: Floats
) -> None:
    """Write what a plan fires so many control periods after it begins, N, and 1 where it is over, (4,).

    Thrusters fire at most `most_force`, N, along each axis: larger pushes take several control periods.
    """
    end = 0
    for column in range(4):
        given[column] = 0.0
    for component in range(3 * num_pushes):
        part = fired(genes, component, outlook.least_force)
        if part != 0.0:
            first = outlook.step * sample_of(genes, num_pushes, component // 3, len(outlook.free))
            count = num_periods(part, most_force)
            end = max(end, first + count)
            if first <= period < first + count:
                given[component % 3] += part / count
    if period >= end:
        given[3] = 1.0
