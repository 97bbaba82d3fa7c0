"""What the deputies of a fleet tell one another in a control period, and which points each leaves to others.

The deputies of a fleet are neighbouring lanes, and fleets lie side by side. In each control period a deputy
tells which points it has seen, which of the others coasting to the flight's end would show it, and where it
believes to be; `pipeline.flight.state.link` brings it to the others. It leaves points only while its
own coasting stays within its limits: with nothing left to do it coasts.
"""

from math import sqrt
from typing import Annotated, NamedTuple

import numpy as np

from fis_tools.compiled.decorator import compiled
from fis_tools.compiled.three import (
    Three,
    chosen,
    lane_of,
    length,
    load_at,
    load_three,
    same,
    totals,
    write_lane,
)
from fis_tools.compiled.vectors import Vector, count, least, load, select, some, splat, store
from pipeline.array_types import Floats, Integers
from pipeline.flight.period.decide.preview import coast_on, previewed_from
from pipeline.flight.period.decide.thrust import COAST_MARGIN, is_decision
from pipeline.flight.period.look.guidance import POINTS
from pipeline.flight.period.look.optics import beam_now, lit_points
from pipeline.flight.period.look.sight import choose_cluster
from pipeline.flight.state.arrays import Control, FullOptics, Moment, Workspace, World, constant_of
from pipeline.flight.state.link import Link, hear_promises, hear_seen, tell_seen
from pipeline.physics.motion import drifted_position, drifted_velocity, propagator_of
from pipeline.physics.transitions import constants_at, follows_course, position_at

#: how much deputies heed, in the order of `pipeline.settings.fleet.SHARING`
NOTHING, MASK, LEAVE, NEARER = range(4)
NOBODY = -1


class Exchange(NamedTuple):
    """What F fleets side by side know together; L lanes and P points, padded."""

    deputies: int  # of a fleet
    first: int  # number in its fleet of the deputy in the first lane, from 0 on
    sharing: int
    link: Link
    unseen: Annotated[Floats, "F", "P"]  # 1 where a point counts and no deputy has seen it
    seen_by: Annotated[Integers, "F", "P"]  # the first deputy that saw a point, or `NOBODY`
    known: Annotated[Floats, "L", "P"]  # 1 where a point counts and none has seen it that a deputy knows of
    ahead: Annotated[Floats, "L", "P"]  # 1 where coasting would not show a deputy such a point either
    left_to: Annotated[Integers, "L", "P"]  # the deputy that a point is left to, or `NOBODY`
    # least distance inside the limits while coasting to the end, m; negative outside
    room: Annotated[Floats, 1, "L"]


@compiled(error_model="numpy")
def begin(now: Moment, exchange: Exchange) -> None:
    """Begin fleets at their starts, where nothing is seen."""
    for lane in range(now.num_lanes):
        if lane % exchange.deputies == 0:
            exchange.unseen[lane // exchange.deputies] = now.state.unseen[lane]
        exchange.known[lane] = now.state.unseen[lane]
        exchange.ahead[lane] = 1.0
    exchange.seen_by[:] = NOBODY


@compiled(error_model="numpy")
def heed(now: Moment, exchange: Exchange) -> None:
    """Leave every deputy what no deputy of its fleet has seen that it knows of."""
    state = now.state
    for lane in range(now.num_lanes if exchange.sharing > NOTHING else 0):
        known, num_unseen = exchange.known[lane], 0.0
        for j in range(now.world.num_points):
            state.unseen[lane, j] = known[j]
            num_unseen += known[j]
        state.lanes.num_unseen[lane] = num_unseen


@compiled(error_model="numpy")
def pool(now: Moment, exchange: Exchange) -> None:
    """Gather what the deputies have seen at a sample, and let them heed what they hear of it.

    A point is the first deputy's that saw it; at one sample the first of the fleet's.
    """
    deputies, link = exchange.deputies, exchange.link
    tell_seen(now, link)
    for lane in range(now.num_lanes):
        unseen, seen_by = exchange.unseen[lane // deputies], exchange.seen_by[lane // deputies]
        for j in range(now.world.num_points):
            if unseen[j] > 0.0 and now.state.unseen[lane, j] == 0.0:
                unseen[j], seen_by[j] = 0.0, lane % deputies
    for lane in range(now.num_lanes):
        exchange.known[lane] = now.state.unseen[lane]
        if exchange.sharing > NOTHING:
            hear_seen(now, link, lane, deputies, exchange.known[lane])
    heed(now, exchange)


@compiled(error_model="numpy")
def room_at(world: World, sample: int, position: Three) -> Vector:
    """Return how far positions at a sample are inside the limits, m."""
    distance = length(position)
    room = least(distance - world.min_distance, world.max_distance - distance)
    spheres = world.keep_out[sample if len(world.keep_out) > 1 else 0]
    for row in range(len(spheres)):
        centre = Three(spheres[row, 0], spheres[row, 1], spheres[row, 2])
        room = least(room, length(position - centre) - spheres[row, 3])
    return room


@compiled(error_model="numpy")
def sense_room(now: Moment, exchange: Exchange) -> None:
    """Write for every lane how far coasting to the flight's end stays inside the limits, at all samples."""
    world, belief, k = now.world, now.state.belief, now.k
    position, velocity = load_three(belief.position, 0), load_three(belief.velocity, 0)
    is_true, constants = follows_course(world.transitions), (position, velocity)
    if is_true:
        constants = constants_at(world.transitions, k, position, velocity)
    leap = propagator_of(world.strides, 1)
    room = room_at(world, k, position)
    for sample in range(k + 1, world.num_controls + 1):
        if is_true:
            position = position_at(world.transitions, sample, constants)
        else:
            moved = drifted_position(leap.position, position, velocity)
            position, velocity = moved, drifted_velocity(leap, position, velocity)
        room = least(room, room_at(world, sample, position))
    store(exchange.room, 0, room)


@compiled(error_model="numpy")
def promise(
    now: Moment,
    optics: FullOptics | None,
    exchange: Exchange,
    margin: float,
    missed: Floats,
    lit_marks: Floats,
    seen_marks: Floats,
) -> None:
    """Note what coasting to the end would show each deputy; nothing where that leads near the limits."""
    world, state, instants = now.world, now.state, previewed_from(now.world, now.k)
    sense_room(now, exchange)
    for lane in range(now.num_lanes):
        ahead = exchange.ahead[lane]
        for j in range(world.num_points):
            ahead[j] = exchange.known[lane, j]
        if exchange.room[0, lane] >= margin and state.lanes.num_unseen[lane] > 0.0:
            position = lane_of(state.belief.position, 0, lane)
            velocity = lane_of(state.belief.velocity, 0, lane)
            coast_on(now, optics, instants, lane, position, velocity, missed, lit_marks, seen_marks)
            for j in range(world.num_points):
                ahead[j if optics is not None else world.order[j]] = missed[j]


@compiled(error_model="numpy")
def shower(exchange: Exchange, lane: int, deputy: int, point: int) -> int:
    """Return the first other deputy whose coasting will show a point, as a lane heard, or `NOBODY`."""
    first = NOBODY
    for other in range(exchange.deputies):
        will_show = exchange.link.heard_ahead[lane, other, point] == 0.0
        if first == NOBODY and other != deputy and will_show:
            first = other
    return first


@compiled(error_model="numpy")
def nearest_other(now: Moment, exchange: Exchange, lane: int, deputy: int, point: int) -> int:
    """Return the deputy that is nearest to a point by direction, as a lane heard; `NOBODY` for its own."""
    points = now.world.points[now.k if len(now.world.points) > 1 else 0]
    nearest, greatest = deputy, -np.inf
    for other in range(exchange.deputies):
        along, square = 0.0, 0.0
        for axis in range(3):
            component = exchange.link.heard_positions[lane, other, axis]
            if other == deputy:
                component = now.state.belief.position[axis, lane]
            along += component * points[axis, point]
            square += component * component
        if along > greatest * sqrt(square):
            nearest, greatest = other, along / sqrt(square)
    return nearest if nearest != deputy else NOBODY


@compiled(error_model="numpy")
def taker(now: Moment, exchange: Exchange, lane: int, point: int) -> int:
    """Return the deputy of its fleet that a lane leaves a point to, or `NOBODY`."""
    deputy = (exchange.first + lane) % exchange.deputies
    other = shower(exchange, lane, deputy, point)
    if other == NOBODY and exchange.sharing >= NEARER and exchange.ahead[lane, point] != 0.0:
        other = nearest_other(now, exchange, lane, deputy, point)
    return other


@compiled(error_model="numpy")
def leave(now: Moment, exchange: Exchange, margin: float) -> None:
    """Strike from each deputy's mask what it leaves; it leaves nothing if its coasting nears the limits."""
    state = now.state
    for lane in range(now.num_lanes):
        for j in range(now.world.num_points):
            is_open = exchange.room[0, lane] >= margin and exchange.known[lane, j] > 0.0
            other = taker(now, exchange, lane, j) if is_open else NOBODY
            exchange.left_to[lane, j] = other
            if other != NOBODY:
                state.unseen[lane, j] = 0.0
                state.lanes.num_unseen[lane] -= 1.0


@compiled(error_model="numpy")
def choose_target(
    now: Moment, optics: FullOptics | None, lane: int, marks: Floats, lit_marks: Floats
) -> None:
    """Mark the points of a lane's mask that are lit, and make their mean its target.

    As `pipeline.flight.period.look.sight.inspect`, without a camera.
    """
    world, state = now.world, now.state
    beam, num_left = beam_now(now, optics, lane), 0
    zeros, centre = splat(0.0, POINTS), same(0.0, POINTS)
    for j in range(0, world.points.shape[2], POINTS):
        wanted = load(state.unseen, (lane, j), POINTS) > 0.0
        if not (beam.shines and some(wanted)):
            store(marks, j, zeros)
            continue
        points = load_at(world.points, beam.sample, 0, j, POINTS)
        left = lit_points(world, optics, lit_marks, j, points, wanted, beam)
        store(marks, j, select(left, 1.0, zeros))
        num_left += count(left)
        centre += chosen(left, points, same(0.0, POINTS))
    state.lanes.num_candidates[lane] = num_left
    write_lane(state.lanes.target, 0, lane, totals(centre) / max(num_left, 1))


@compiled(error_model="numpy")
def share_out(
    now: Moment,
    work: Workspace,
    exchange: Exchange,
    optics: FullOptics | None,
    clusters: bool | None,
    control: Control,
) -> None:
    """Leave points to one another where a force is decided on, and choose targets among what is left."""
    exchange.left_to[:] = NOBODY
    if exchange.sharing >= LEAVE:
        margin, link = constant_of(control, COAST_MARGIN), exchange.link
        is_due = is_decision(control.law, now.k)
        if is_due:
            promise(now, optics, exchange, margin, work.ahead, work.lit, work.seen)
        link.ahead[now.k % len(link.ahead)] = exchange.ahead
        for lane in range(now.num_lanes):
            hear_promises(now, link, lane, exchange.deputies)
        if is_due:
            leave(now, exchange, margin)
    for lane in range(now.num_lanes):
        choose_lane_target(now, work, optics, clusters, lane)


@compiled(error_model="numpy")
def choose_lane_target(
    now: Moment, work: Workspace, optics: FullOptics | None, clusters: bool | None, lane: int
) -> None:
    """Choose the target of a lane among what its mask holds."""
    choose_target(now, optics, lane, work.candidate_marks, work.lit)
    if clusters is not None:
        choose_cluster(
            now, lane, work.candidate_marks, work.candidates, work.labels, work.distances, work.sums
        )
