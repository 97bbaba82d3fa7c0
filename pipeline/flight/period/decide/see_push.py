"""For all lanes, the push that would show points that coasting misses and that soon go dark for good.

For each such point the cheapest look from the coasting path is found; one regularised least-squares push
serves them all. The page on signals derives it.
"""

from math import cos, sin, sqrt

import numpy as np

from fis_tools.compiled.decorator import compiled
from fis_tools.compiled.three import (
    Three,
    chosen,
    dot,
    lane_of,
    length,
    minus,
    plus,
    same,
    scaled,
    write_lane,
)
from fis_tools.compiled.vectors import Mask, Vector, count, load, select, some, splat, store, total
from pipeline.array_types import Floats
from pipeline.flight.period.decide.chief import turned_aside
from pipeline.flight.period.look.guidance import POINTS
from pipeline.flight.period.look.optics import (
    Eye,
    beam_at,
    eye_on_chief,
    lit_points,
    points_at,
    seen_points,
    surface_at,
)
from pipeline.flight.state.arrays import Beyond, Law, State, Workspace, World
from pipeline.flight.state.elementary import exponential
from pipeline.flight.state.preview import LEAST_SHORT_M, SQUARED_NEAR_M2
from pipeline.flight.state.signals import constant, slot
from pipeline.physics.motion import Place, drifted_place, place_of, slopes
from pipeline.physics.sight import HEIGHT, NORMAL

PUSH = slot("see_push_radial", "see_push_along_track", "see_push_cross_track")
AIM = slot("aim_radial", "aim_along_track", "aim_cross_track")
URGENT = slot("urgent_radial", "urgent_along_track", "urgent_cross_track")
URGENCY_TIME, SKIRT_DISTANCE = constant("urgency_time_s"), constant("skirt_distance_m")
SEE_HORIZON, SEE_DAMPING = constant("see_horizon_s"), constant("see_damping_ks2")
AIM_URGENT = constant("aim_urgent_m_s")

#: rows of `Workspace.looks`
COST, SHORT, SLOPE = 0, 1, 2
#: the square of a thousand seconds: a push of 1 m/s moves the deputy by about 1 km in that time
KS2 = 1e6


@compiled(error_model="numpy", forceinline=True)
def await_dark(state: State, work: Workspace, lane: int, now: float, horizon: float) -> int:
    """Mark the points unseen whose last light is still to come within the horizon; return how many."""
    num_waiting = 0
    for j in range(0, len(work.ahead), POINTS):
        last = load(work.deadlines, (lane, j), POINTS)
        waits = (load(state.unseen, (lane, j), POINTS) > 0.0) & (last > now) & (last <= now + horizon)
        store(work.ahead, j, select(waits, 1.0, 0.0))
        store(work.looks, (COST, j), splat(np.inf, POINTS))
        num_waiting += count(waits)
    return num_waiting


@compiled(error_model="numpy", forceinline=True)
def shortfall(
    world: World, optics: Beyond | None, sample: int, j: int, points: Three, eye: Eye
) -> tuple[Vector, Three]:
    """Return by how many metres a place falls short of showing the points from j on, and the way to them.

    The way is the gradient of the shortfall, reversed, with respect to the place. In the paper's world the
    shortfall is that of the height above the horizon; in others it is the largest deficit, of the
    height that the incidence limit needs at its distance or of nearness, linearised about the place.
    """
    if optics is None:
        radius = sqrt(world.sight.horizon)
        way = scaled(1.0 / radius, points)
        near = LEAST_SHORT_M if eye.square < SQUARED_NEAR_M2 else -np.inf
        short = radius - dot(way, eye.place)
        return select(short > near, short, near), way
    cosine, reach = sqrt(world.optics.incidence_squared), sqrt(world.optics.range_squared)
    normal = surface_at(world, sample, NORMAL, j)
    d = minus(eye.place, points)
    distance = length(d)
    per = 1.0 / distance
    above = dot(normal, eye.place) - load(world.surface, (sample, HEIGHT, j), POINTS)
    short, far = cosine * distance - above, distance - reach
    is_far, lean = far > short, cosine * per
    nearer = Three(-d.x * per, -d.y * per, -d.z * per)
    higher = Three(normal.x - lean * d.x, normal.y - lean * d.y, normal.z - lean * d.z)
    short = select(is_far, far, short)
    return select(short > LEAST_SHORT_M, short, LEAST_SHORT_M), chosen(is_far, nearer, higher)


@compiled(error_model="numpy", forceinline=True)
def keep_cheapest(work: Workspace, j: int, lit: Mask, short: Vector, slope: Three) -> None:
    """Keep the cheapest looks so far at the lit points from j on."""
    looks = work.looks
    cost = short * short / dot(slope, slope)
    is_better = lit & (cost < load(looks, (COST, j), POINTS))
    store(looks, (COST, j), select(is_better, cost, load(looks, (COST, j), POINTS)))
    store(looks, (SHORT, j), select(is_better, short, load(looks, (SHORT, j), POINTS)))
    store(looks, (SLOPE, j), select(is_better, slope.x, load(looks, (SLOPE, j), POINTS)))
    store(looks, (SLOPE + 1, j), select(is_better, slope.y, load(looks, (SLOPE + 1, j), POINTS)))
    store(looks, (SLOPE + 2, j), select(is_better, slope.z, load(looks, (SLOPE + 2, j), POINTS)))


@compiled(error_model="numpy", forceinline=True)
def look_from(
    world: World,
    optics: Beyond | None,
    state: State,
    work: Workspace,
    lane: int,
    k: int,
    then: Place,
    place: Three,
    sun: tuple[float, float],
) -> None:
    """Remove the points visible from a place of the path; for the others keep the cheapest look so far."""
    sample, ahead = (k if len(world.points) > 1 else 0), work.ahead
    beam = beam_at(world, optics, state, lane, k, sun)
    eye = eye_on_chief(world, optics, beam, place)
    for j in range(0, len(ahead) if beam.shines else 0, POINTS):
        before = load(ahead, j, POINTS)
        if not some(before > 0.0):
            continue
        points = points_at(world.points, sample, j)
        lit = lit_points(world, optics, work, sample, j, points, before > 0.0, beam)
        if not some(lit):
            continue
        short, way = shortfall(world, optics, sample, j, points, eye)
        if optics is None:
            store(ahead, j, select(lit & (short <= 0.0), 0.0, before))
        elif not eye.is_blind:
            store(
                ahead, j, select(seen_points(world, optics, work, sample, j, points, lit, eye), 0.0, before)
            )
        keep_cheapest(work, j, lit, short, slopes(then, way)[1])


@compiled(error_model="numpy")
def fitted_push(work: Workspace, lane: int, now: float, rate: float, damping: float) -> Three:
    """Return the damped push, m/s, that brings all looks closest to showing their points.

    Solves ``(damping I + sum w g g^T) dv = sum w g short`` by Cramer's rule.
    """
    nothing = same(0.0, POINTS)
    squares, products, sums = nothing, nothing, nothing  # sums of xx, yy, zz; xy, xz, yz; and w g short
    for j in range(0, len(work.ahead), POINTS):
        counts = load(work.ahead, j, POINTS) > 0.0
        counts &= load(work.looks, (COST, j), POINTS) < np.inf
        if some(counts):
            weight = exponential((now - load(work.deadlines, (lane, j), POINTS)) * rate)
            weight = select(counts, weight, 0.0)
            gx, gy = load(work.looks, (SLOPE, j), POINTS), load(work.looks, (SLOPE + 1, j), POINTS)
            gz, short = load(work.looks, (SLOPE + 2, j), POINTS), load(work.looks, (SHORT, j), POINTS)
            gx, gy, gz = select(counts, gx, 0.0), select(counts, gy, 0.0), select(counts, gz, 0.0)
            w = scaled(weight, Three(gx, gy, gz))
            squares = plus(squares, Three(w.x * gx, w.y * gy, w.z * gz))
            products = plus(products, Three(w.x * gy, w.x * gz, w.y * gz))
            sums = plus(sums, scaled(select(counts, short, 0.0), w))
    least = damping * KS2
    xx, yy, zz = least + total(squares.x), least + total(squares.y), least + total(squares.z)
    xy, xz, yz = total(products.x), total(products.y), total(products.z)
    cxx, cyy, czz = yy * zz - yz * yz, xx * zz - xz * xz, xx * yy - xy * xy
    cxy, cxz, cyz = xz * yz - xy * zz, xy * yz - xz * yy, xy * xz - xx * yz
    inverse = 1.0 / (xx * cxx + xy * cxy + xz * cxz)
    b = Three(total(sums.x), total(sums.y), total(sums.z))
    found = Three(dot(Three(cxx, cxy, cxz), b), dot(Three(cxy, cyy, cyz), b), dot(Three(cxz, cyz, czz), b))
    return scaled(inverse, found)


@compiled(error_model="numpy")
def sense_push(
    world: World,
    optics: Beyond | None,
    law: Law,
    values: Floats,
    state: State,
    work: Workspace,
    num_lanes: int,
    k: int,
) -> None:
    """Write the push that shows setting points, and the aim, of lanes that may fire."""
    lanes, belief, signals, now = state.lanes, state.belief, work.signals, world.control_period * k
    look_turn = world.mean_motion * world.control_period * world.look_stride
    look_cos, look_sin = cos(look_turn), sin(look_turn)
    rate = 1.0 / values[law.constants + URGENCY_TIME]
    horizon, damping = values[law.constants + SEE_HORIZON], values[law.constants + SEE_DAMPING]
    skirt, urgent = values[law.constants + SKIRT_DISTANCE], values[law.constants + AIM_URGENT]
    farthest = int(horizon / (world.control_period * world.look_stride) + 1e-9)
    num_looks = min(farthest, (world.num_controls - k) // world.look_stride)
    for lane in range(num_lanes):
        push = Three(0.0, 0.0, 0.0)
        if lanes.coasts[lane] == 0.0 and await_dark(state, work, lane, now, horizon) > 0:
            sun_x, sun_y = lanes.sun[0, lane], lanes.sun[1, lane]
            place, velocity = lane_of(belief.position, 0, lane), lane_of(belief.velocity, 0, lane)
            for look in range(1, num_looks + 1):
                sun_x, sun_y = sun_x * look_cos + sun_y * look_sin, sun_y * look_cos - sun_x * look_sin
                then = place_of(world.looks, look)
                at = drifted_place(then, place, velocity)
                sample = k + look * world.look_stride
                look_from(world, optics, state, work, lane, sample, then, at, (sun_x, sun_y))
            push = fitted_push(work, lane, now, rate, damping)
            push = turned_aside(push, 1.0, place, skirt, world.min_distance)
        write_lane(signals, PUSH, lane, push)
        write_lane(signals, AIM, lane, plus(push, scaled(urgent, lane_of(signals, URGENT, lane))))
