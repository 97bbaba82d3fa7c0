"""The desired attitudes of all lanes at the instants of a control period.

Positions at the instants of the attitude clock come from the closed form. With azimuth a and elevation e of a
position, ``q* = (sin a/2 sin e/2, -cos a/2 sin e/2, sin a/2 cos e/2, cos a/2 cos e/2)``, half angles from
square roots.
"""

from typing import Any

import numpy as np

from fis_tools.compiled.decorator import compiled
from fis_tools.compiled.three import Three, chosen, lane_of, load_three, same, store_three, write_lane
from fis_tools.compiled.vectors import Mask, most, select, some, splat, store, width_of
from pipeline.array_types import Floats
from pipeline.flight.state.arrays import Moment, Plans
from pipeline.flight.state.lanes import load_quaternion, store_quaternion, write_attitude
from pipeline.physics.attitude import POLE, blended_y, desired_dcm, desired_y
from pipeline.physics.motion import position_after, propagator_of
from pipeline.physics.quaternion import axes_of, from_dcm


@compiled(error_model="numpy", forceinline=True)
def aim(now: Moment, aims: Any, position: Three, velocity: Three, force: Three, last: int) -> Mask:
    """Write into `aims` the desired attitudes of all lanes at the instants before `last`.

    `position` and `velocity` are those at the first instant, m and m/s, and `force` is held, N; Hill axes.
    Returns the lanes that come too close to a pole for the position to define y*.
    """
    is_near = splat(0.0, width_of(now.state.lanes)) > 0.0
    for j in range(last):
        x, y, z = position_after(propagator_of(now.world.instants, j), position, velocity, force)
        flat_square = x * x + y * y
        square = flat_square + z * z
        is_near |= flat_square < POLE * POLE * square
        flat, distance = np.sqrt(most(flat_square, 1e-200)), np.sqrt(most(square, 1e-200))
        # by tangents, tan(a/2) = y/(flat + x) and tan(e/2) = z/(distance + flat); for negative x that of
        # the complement of a/2, to avoid cancellation
        side, up = flat + abs(x), distance + flat
        scale = 1.0 / np.sqrt(4.0 * (flat * distance) * (side * up))
        cos_a, sin_a = select(x >= 0.0, side, y) * scale, select(x >= 0.0, y, side) * scale
        store_quaternion(aims[j].attitude, (sin_a * z, -(cos_a * z), sin_a * up, cos_a * up))
    return is_near


@compiled(error_model="numpy")
def aim_lane(
    now: Moment, aims: Any, position: Three, velocity: Three, force: Three, lane: int, last: int
) -> None:
    """Write into `aims` one lane's desired attitudes at the instants before `last`, near a pole too.

    Slower than `aim`, for the cases that it does not cover: each y* follows from the one before, the first
    from the lane's `y_before`, in which the last is stored.
    """
    world, y_before = now.world, now.state.lanes.y_before
    y = lane_of(y_before, 0, lane)
    for j in range(last):
        at = position_after(propagator_of(world.instants, j), position, velocity, force)
        if world.has_pole_blending and now.k + j > world.first:
            y = blended_y(at, y, world.attitude_period)
        else:
            y = desired_y(at, y)
        write_attitude(aims[j].attitude, lane, from_dcm(desired_dcm(at, y)))
    write_lane(y_before, 0, lane, y)


@compiled(error_model="numpy", forceinline=True)
def aim_near_poles(now: Moment, aims: Any, moving: Any, force: Floats, last: int, is_near: Mask) -> None:
    """Aim the lanes near a pole again, one by one, and store y* of all lanes at the last instant."""
    world, lanes, width = now.world, now.state.lanes, width_of(now.state.lanes)
    # where the position defines the attitude, y* is (k x r)/|k x r|
    y = axes_of(load_quaternion(aims[last - 1].attitude))[1]
    level = Three(y.x, y.y, splat(0.0, width))
    if not (some(is_near) or world.has_pole_blending):
        store_three(lanes.y_before, 0, level)
        return
    store(lanes.is_near_pole, 0, select(is_near, 1.0, 0.0))  # to be read lane by lane
    for lane in range(now.num_lanes):
        if lanes.is_near_pole[lane] > 0.0 or world.has_pole_blending:
            position, velocity = lane_of(moving.position, 0, lane), lane_of(moving.velocity, 0, lane)
            aim_lane(now, aims, position, velocity, lane_of(force, 0, lane), lane, last)
    if not world.has_pole_blending:
        store_three(lanes.y_before, 0, chosen(is_near, load_three(lanes.y_before, 0), level))


@compiled(error_model="numpy", forceinline=True)
def aim_over(now: Moment, aims: Any, plans: Plans, moving: Any, force: Floats, last: int) -> None:
    """Write into `aims` the desired attitudes of all lanes at the instants before `last`.

    They look at the chief from the path that begins with `moving`, a record of `MOVING`, under a held force,
    (3, L), N, Hill axes. Attitudes of `plans`, if any, replace them.
    """
    position, velocity = load_three(moving.position, 0), load_three(moving.velocity, 0)
    is_near = aim(now, aims, position, velocity, load_three(force, 0), last)
    aim_near_poles(now, aims, moving, force, last, is_near)
    attitudes = plans.turns.attitudes
    for j in range(last if len(attitudes) > 0 else 0):
        for i in range(4):
            desired = aims[j].attitude
            store(desired, i, splat(attitudes[min(now.k, len(attitudes) - 1), i], width_of(desired)))


@compiled(error_model="numpy", forceinline=True)
def aim_at_once(now: Moment, aims: Any, plans: Plans) -> None:
    """Set the attitudes of all lanes to the desired ones at sample k, for ideal pointing.

    `aim_over` starts at this sample again, from what the deputies believe: y* keeps its earlier value. No
    force acts yet; `act` writes `lanes.force` anew.
    """
    lanes, truth = now.state.lanes, now.state.truth
    before = load_three(lanes.y_before, 0)
    store_three(lanes.force, 0, same(0.0, width_of(lanes)))
    aim_over(now, aims, plans, truth, lanes.force, 1)
    store_three(lanes.y_before, 0, before)
    store_quaternion(truth.attitude, load_quaternion(aims[0].attitude))
