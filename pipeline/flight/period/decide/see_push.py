"""For all lanes, the push that would show points that coasting misses and that soon go dark for good.

For each such point the cheapest look from the coasting path is found; one regularised least-squares push
serves them all. The page on signals derives it.
"""

from math import cos, sin, sqrt
from typing import NamedTuple

import numpy as np

from fis_tools.compiled.decorator import compiled
from fis_tools.compiled.elementary import exponential
from fis_tools.compiled.three import (
    Three,
    chosen,
    cofactors,
    dot,
    lane_of,
    length,
    load_at,
    load_from,
    same,
    totals,
    write_lane,
)
from fis_tools.compiled.vectors import Mask, Vector, count, load, select, some, splat, store
from pipeline.array_types import Floats
from pipeline.flight.period.decide.motion import turned_aside
from pipeline.flight.period.decide.urgency import URGENCY_TIME, URGENT
from pipeline.flight.period.look.guidance import POINTS
from pipeline.flight.period.look.optics import (
    Eye,
    Pair,
    beam_from,
    eye_on_chief,
    lit_points,
    seen_points,
    sun_ahead,
    turned_back,
)
from pipeline.flight.state.arrays import Control, FullOptics, Moment, World, constant_of
from pipeline.flight.state.signals import constant, slot
from pipeline.physics.motion import PositionRows, drifted_position, position_gradients, position_rows_of
from pipeline.physics.sight import HEIGHT, NORMAL
from pipeline.physics.transitions import constants_at, effect_of_push, follows_course, position_at

PUSH = slot("see_push_radial", "see_push_along_track", "see_push_cross_track")
AIM = slot("aim_radial", "aim_along_track", "aim_cross_track")
SEE_HORIZON, SEE_DAMPING = constant("see_horizon_s"), constant("see_damping_ks2")
AIM_URGENT = constant("aim_urgent_m_s")
SEE_NEAR, SEE_SHORT = constant("see_near_m"), constant("see_short_m")

#: rows of `looks`, (5, P padded)
COST, SHORT, SLOPE = 0, 1, 2
#: the square of a thousand seconds: a push of 1 m/s moves the deputy by about 1 km in that time
KS2 = 1e6


class Doubt(NamedTuple):
    """Looks that may not show a point, as near the chief its rim is out of view."""

    squared_near: (
        float  # of the distance within which looks are such in the paper's world, m^2; all are in others
    )
    short: float  # what they fall short by at least, m


@compiled(error_model="numpy", forceinline=True)
def await_dark(
    now: Moment, lane: int, horizon: float, deadlines: Floats, setting: Floats, looks: Floats
) -> int:
    """Mark in `setting` the unseen points whose last light comes within the horizon, s; return how many."""
    state, time = now.state, now.world.control_period * now.k
    num_waiting = 0
    for j in range(0, len(setting), POINTS):
        last = load(deadlines, (lane, j), POINTS)
        waits = (load(state.unseen, (lane, j), POINTS) > 0.0) & (last > time) & (last <= time + horizon)
        store(setting, j, select(waits, 1.0, 0.0))
        store(looks, (COST, j), splat(np.inf, POINTS))
        num_waiting += count(waits)
    return num_waiting


@compiled(error_model="numpy", forceinline=True)
def shortfall(
    world: World, optics: FullOptics | None, doubt: Doubt, j: int, points: Three, eye: Eye
) -> tuple[Vector, Three]:
    """Return how far a position is from seeing the points from j on, m, and the direction to move in.

    That is the negative gradient of the shortfall. In the paper's world the shortfall is that of the height
    above the horizon. In others it is the larger of two: how much too low the position is for the incidence
    limit at its distance, and how far beyond the camera's range it is.
    """
    if optics is None:
        radius = sqrt(world.sight.horizon)
        direction = (1.0 / radius) * points
        near = doubt.short if eye.square < doubt.squared_near else -np.inf
        short = radius - dot(direction, eye.position)
        return select(short > near, short, near), direction
    cosine, reach = sqrt(world.optics.incidence_squared), sqrt(world.optics.range_squared)
    sample = eye.beam.sample
    normal = load_at(world.surface, sample, NORMAL, j, POINTS)
    d = eye.position - points
    distance = length(d)
    per_m = 1.0 / distance
    above = dot(normal, eye.position) - load(world.surface, (sample, HEIGHT, j), POINTS)
    short, far = cosine * distance - above, distance - reach
    is_far, lean = far > short, cosine * per_m
    short = select(is_far, far, short)
    return select(short > doubt.short, short, doubt.short), chosen(is_far, -per_m * d, normal - lean * d)


@compiled(error_model="numpy", forceinline=True)
def keep_cheapest(looks: Floats, j: int, lit: Mask, short: Vector, slope: Three) -> None:
    """Store a look at points from j on wherever it costs less than the cheapest look so far."""
    cost = short * short / dot(slope, slope)
    is_better = lit & (cost < load(looks, (COST, j), POINTS))
    kept = chosen(is_better, slope, load_from(looks, SLOPE, j, POINTS))
    store(looks, (COST, j), select(is_better, cost, load(looks, (COST, j), POINTS)))
    store(looks, (SHORT, j), select(is_better, short, load(looks, (SHORT, j), POINTS)))
    store(looks, (SLOPE, j), kept.x)
    store(looks, (SLOPE + 1, j), kept.y)
    store(looks, (SLOPE + 2, j), kept.z)


@compiled(error_model="numpy", forceinline=True)
def look_from(
    now: Moment,
    optics: FullOptics | None,
    doubt: Doubt,
    lane: int,
    k: int,
    phi_rows: PositionRows,
    effect: tuple[Three, Three, Three],
    position: Three,
    sun: Pair,
    height: Pair,
    setting: Floats,
    looks: Floats,
    lit_marks: Floats,
    seen_marks: Floats,
    is_true: bool,
) -> None:
    """Look from a position of the coasting path, m, at sample k, with the Sun as it is then.

    Points that are seen from there leave `setting`; of the others `looks` keeps the cheapest look so far.
    On a true course `effect` is what a push now does to that position, else `phi_rows` tell it.
    """
    world = now.world
    beam = beam_from(world, optics, k, sun, height)
    eye = eye_on_chief(world, optics, beam, position)
    for j in range(0, len(setting) if beam.shines else 0, POINTS):
        before = load(setting, j, POINTS)
        if not some(before > 0.0):
            continue
        points = load_at(world.points, beam.sample, 0, j, POINTS)
        lit = lit_points(world, optics, lit_marks, j, points, before > 0.0, beam)
        if not some(lit):
            continue
        short, direction = shortfall(world, optics, doubt, j, points, eye)
        if optics is None:
            store(setting, j, select(lit & (short <= 0.0), 0.0, before))
        elif not eye.is_blind:
            seen = seen_points(world, optics, seen_marks, j, points, lit, eye)
            store(setting, j, select(seen, 0.0, before))
        slope = position_gradients(phi_rows, direction)[1]
        if is_true:
            slope = Three(dot(effect[0], direction), dot(effect[1], direction), dot(effect[2], direction))
        keep_cheapest(looks, j, lit, short, slope)


@compiled(error_model="numpy", forceinline=True)
def look_along(
    now: Moment,
    optics: FullOptics | None,
    doubt: Doubt,
    lane: int,
    num_looks: int,
    look_turn: Pair,
    setting: Floats,
    looks: Floats,
    lit_marks: Floats,
    seen_marks: Floats,
    is_true: bool,
) -> None:
    """Look from the positions of the coasting path of a lane, on a circle or on a true course."""
    world, lanes, belief, k = now.world, now.state.lanes, now.state.belief, now.k
    sun = lanes.sun[0, lane], lanes.sun[1, lane]
    height = lanes.sun_height[0, lane], lanes.sun_height[1, lane]
    position, velocity = lane_of(belief.position, 0, lane), lane_of(belief.velocity, 0, lane)
    nothing = Three(0.0, 0.0, 0.0)
    constants, effect = (position, velocity), (nothing, nothing, nothing)
    if is_true:
        constants = constants_at(world.transitions, k, position, velocity)
    for look in range(1, num_looks + 1):
        sample = k + look * world.look_stride
        phi_rows = position_rows_of(world.looks, look)
        if is_true:
            sun, height = sun_ahead(now, lane, sample)
            coasted = position_at(world.transitions, sample, constants)
            effect = effect_of_push(world.transitions, k, sample)
        else:
            sun = turned_back(sun, look_turn)
            coasted = drifted_position(phi_rows, position, velocity)
        look_from(
            now,
            optics,
            doubt,
            lane,
            sample,
            phi_rows,
            effect,
            coasted,
            sun,
            height,
            setting,
            looks,
            lit_marks,
            seen_marks,
            is_true,
        )


@compiled(error_model="numpy")
def fitted_push(
    now: Moment, lane: int, rate: float, damping: float, deadlines: Floats, setting: Floats, looks: Floats
) -> Three:
    """Return the damped push, m/s, that brings all looks closest to showing their points.

    Solves ``(damping I + sum w g g^T) dv = sum w g short`` by Cramer's rule.
    """
    time, zeros = now.world.control_period * now.k, same(0.0, POINTS)
    squares, products, sums = zeros, zeros, zeros  # sums of xx, yy, zz; xy, xz, yz; and w g short
    for j in range(0, len(setting), POINTS):
        counts = load(setting, j, POINTS) > 0.0
        counts &= load(looks, (COST, j), POINTS) < np.inf
        if some(counts):
            weight = exponential((time - load(deadlines, (lane, j), POINTS)) * rate)
            weight = select(counts, weight, 0.0)
            short = load(looks, (SHORT, j), POINTS)
            g = chosen(counts, load_from(looks, SLOPE, j, POINTS), same(0.0, POINTS))
            w = weight * g
            squares += Three(w.x * g.x, w.y * g.y, w.z * g.z)
            products += Three(w.x * g.y, w.x * g.z, w.y * g.z)
            sums += select(counts, short, 0.0) * w
    least, square, product = damping * KS2, totals(squares), totals(products)
    first = Three(least + square.x, product.x, product.y)
    second = Three(product.x, least + square.y, product.z)
    x, y, z = cofactors(first, second, Three(product.y, product.z, least + square.z))
    b = totals(sums)
    return (1.0 / dot(first, x)) * Three(dot(x, b), dot(y, b), dot(z, b))


@compiled(error_model="numpy")
def sense_push(
    now: Moment,
    optics: FullOptics | None,
    control: Control,
    deadlines: Floats,
    setting: Floats,
    looks: Floats,
    lit_marks: Floats,
    seen_marks: Floats,
    signals: Floats,
) -> None:
    """Write the push that would still show points before they go dark, and the aim, for lanes that may fire.

    The aim adds the urgent direction, which `signals` must hold. `setting` and `looks` are overwritten.
    """
    world, lanes, k = now.world, now.state.lanes, now.k
    look_angle = world.mean_motion * world.control_period * world.look_stride
    look_turn = cos(look_angle), sin(look_angle)
    rate, damping = 1.0 / constant_of(control, URGENCY_TIME), constant_of(control, SEE_DAMPING)
    horizon, urgent = constant_of(control, SEE_HORIZON), constant_of(control, AIM_URGENT)
    near = constant_of(control, SEE_NEAR)
    doubt = Doubt(near * near, constant_of(control, SEE_SHORT))
    farthest = int(horizon / (world.control_period * world.look_stride) + 1e-9)
    num_looks = min(farthest, (world.num_controls - k) // world.look_stride)
    for lane in range(now.num_lanes):
        push = Three(0.0, 0.0, 0.0)
        if lanes.coasts[lane] == 0.0 and await_dark(now, lane, horizon, deadlines, setting, looks) > 0:
            # compiled twice, so that the loop over looks does not branch
            if follows_course(world.transitions):
                look_along(
                    now,
                    optics,
                    doubt,
                    lane,
                    num_looks,
                    look_turn,
                    setting,
                    looks,
                    lit_marks,
                    seen_marks,
                    True,
                )
            else:
                look_along(
                    now,
                    optics,
                    doubt,
                    lane,
                    num_looks,
                    look_turn,
                    setting,
                    looks,
                    lit_marks,
                    seen_marks,
                    False,
                )
            push = fitted_push(now, lane, rate, damping, deadlines, setting, looks)
            push = turned_aside(now, control, lane, push, 1.0)
        write_lane(signals, PUSH, lane, push)
        write_lane(signals, AIM, lane, push + urgent * lane_of(signals, URGENT, lane))
