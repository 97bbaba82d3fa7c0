"""The desired attitudes of all lanes at the instants of a control period.

Positions at the instants of the attitude clock come from the closed form. With azimuth a and elevation e of a
position, ``q* = (sin a/2 sin e/2, -cos a/2 sin e/2, sin a/2 cos e/2, cos a/2 cos e/2)``, half angles from
square roots.
"""

import numpy as np

from fis_tools.compiled.decorator import compiled
from fis_tools.compiled.vectors import most, select, some, splat, store, width_of
from pipeline.flight.state.arrays import Workspace, World
from pipeline.flight.state.lanes import four, one, three, write_four, write_three
from pipeline.physics.attitude_control import POLE, blended_y, desired_dcm, desired_y
from pipeline.physics.motion import place_after, step_of
from pipeline.physics.quaternion import from_dcm


@compiled(error_model="numpy", forceinline=True)
def aim(world: World, work: Workspace, last: int) -> None:
    """Write the desired attitudes of all lanes at the instants of a control period before `last`.

    Marks the lanes that come too close to a pole for the position to define y*.
    """
    width = width_of(work.lanes)
    rx, ry, rz = three(work.lanes.position)
    vx, vy, vz = three(work.lanes.velocity)
    fx, fy, fz = three(work.lanes.force)
    is_near = splat(0.0, width) > 0.0
    for j in range(last):
        x, y, z = place_after(step_of(world.instants, j), rx, ry, rz, vx, vy, vz, fx, fy, fz)
        flat_square = x * x + y * y
        square = flat_square + z * z
        is_near |= flat_square < POLE * POLE * square
        flat, distance = np.sqrt(most(flat_square, 1e-200)), np.sqrt(most(square, 1e-200))
        # by tangents, tan(a/2) = y/(flat + x) and tan(e/2) = z/(distance + flat); for negative x that of
        # the complement of a/2, to avoid cancellation
        side, up = flat + abs(x), distance + flat
        scale = 1.0 / np.sqrt(4.0 * (flat * distance) * (side * up))
        cos_a, sin_a = select(x >= 0.0, side, y) * scale, select(x >= 0.0, y, side) * scale
        write_four(work.aims[j].attitude, sin_a * z, -(cos_a * z), sin_a * up, cos_a * up)
    store(work.lanes.is_near_pole, 0, select(is_near, 1.0, 0.0))


@compiled(error_model="numpy")
def aim_plainly(world: World, work: Workspace, lane: int, last: int, is_start: bool) -> None:
    """Write one lane's desired attitudes at the instants before `last` in turn, with the rules for poles.

    Slower than `aim`, for the cases that it does not cover; `y_before` is carried along.
    """
    r, v, f = work.lanes.position, work.lanes.velocity, work.lanes.force
    y = np.empty(3)
    for i in range(3):
        y[i] = work.lanes.y_before[i, lane]
    for j in range(last):
        step = step_of(world.instants, j)
        place = np.array(
            place_after(
                step,
                r[0, lane],
                r[1, lane],
                r[2, lane],
                v[0, lane],
                v[1, lane],
                v[2, lane],
                f[0, lane],
                f[1, lane],
                f[2, lane],
            )
        )
        if world.has_pole_blending and not is_start:
            y = blended_y(place, y, world.attitude_period)
        else:
            y = desired_y(place, y)
        is_start = False
        quaternion = from_dcm(desired_dcm(place, y))
        for i in range(4):
            work.aims[j].attitude[i, lane] = quaternion[i]
    for i in range(3):
        work.lanes.y_before[i, lane] = y[i]


@compiled(error_model="numpy", forceinline=True)
def aim_by_rules(world: World, work: Workspace, num_lanes: int, last: int, is_start: bool) -> None:
    """Aim lanes near a pole again by the rules for poles, and store y* of all at the last instant."""
    width = width_of(work.lanes)
    lanes = work.lanes
    # where the position defines the attitude, y* is (k x r)/|k x r|
    a1, a2, a3, a4 = four(work.aims[last - 1].attitude)
    last_x, last_y = 2.0 * (a1 * a2 - a3 * a4), -a1 * a1 + a2 * a2 - a3 * a3 + a4 * a4
    follows = one(lanes.is_near_pole) > 0.0
    if not (some(follows) or world.has_pole_blending):
        write_three(lanes.y_before, 0, last_x, last_y, splat(0.0, width))
        return
    for lane in range(num_lanes):
        if lanes.is_near_pole[lane] > 0.0 or world.has_pole_blending:
            aim_plainly(world, work, lane, last, is_start)
    if not world.has_pole_blending:
        x, y, z = three(lanes.y_before)
        write_three(
            lanes.y_before, 0, select(follows, x, last_x), select(follows, y, last_y), select(follows, z, 0.0)
        )


@compiled(error_model="numpy", forceinline=True)
def aim_deputies(world: World, work: Workspace, num_lanes: int, k: int) -> None:
    """Write the desired attitudes of all lanes over the control period that follows sample k."""
    aim(world, work, world.num_attitude_steps)
    aim_by_rules(world, work, num_lanes, world.num_attitude_steps, k == 0)


@compiled(error_model="numpy", forceinline=True)
def aim_at_once(world: World, work: Workspace, num_lanes: int, k: int) -> None:
    """Set the attitudes of all lanes to the desired ones at sample k, for ideal pointing.

    `aim_deputies` starts at this sample again, from the estimated positions: y* keeps its earlier value.
    """
    before = three(work.lanes.y_before)
    aim(world, work, 1)
    aim_by_rules(world, work, num_lanes, 1, k == 0)
    write_three(work.lanes.y_before, 0, *before)
    q1, q2, q3, q4 = four(work.aims[0].attitude)
    write_four(work.lanes.attitude, q1, q2, q3, q4)
