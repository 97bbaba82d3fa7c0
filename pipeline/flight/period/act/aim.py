"""The desired attitudes of all lanes at the instants of a control period.

Positions at the instants of the attitude clock come from the closed form. With azimuth a and elevation e of a
position, ``q* = (sin a/2 sin e/2, -cos a/2 sin e/2, sin a/2 cos e/2, cos a/2 cos e/2)``, half angles from
square roots.
"""

import numpy as np

from fis_tools.compiled.decorator import compiled
from fis_tools.compiled.three import Three, chosen, lane_of, load_three, same, store_three
from fis_tools.compiled.vectors import most, select, some, splat, store, width_of
from pipeline.array_types import Floats
from pipeline.flight.state.arrays import Moment, Plans
from pipeline.flight.state.lanes import four, one, write_four
from pipeline.physics.attitude import POLE, blended_y, desired_dcm, desired_y
from pipeline.physics.motion import place_after, step_of
from pipeline.physics.quaternion import from_dcm


@compiled(error_model="numpy", forceinline=True)
def aim(now: Moment, place: Three, velocity: Three, force: Three, last: int) -> None:
    """Write the desired attitudes of all lanes at the instants of a control period before `last`.

    `place`, `velocity` and `force` are those at its start, m, m/s and N, Hill axes. Marks the lanes that come
    too close to a pole for the position to define y*.
    """
    state = now.state
    is_near = splat(0.0, width_of(state.lanes)) > 0.0
    for j in range(last):
        x, y, z = place_after(step_of(now.world.instants, j), place, velocity, force)
        flat_square = x * x + y * y
        square = flat_square + z * z
        is_near |= flat_square < POLE * POLE * square
        flat, distance = np.sqrt(most(flat_square, 1e-200)), np.sqrt(most(square, 1e-200))
        # by tangents, tan(a/2) = y/(flat + x) and tan(e/2) = z/(distance + flat); for negative x that of
        # the complement of a/2, to avoid cancellation
        side, up = flat + abs(x), distance + flat
        scale = 1.0 / np.sqrt(4.0 * (flat * distance) * (side * up))
        cos_a, sin_a = select(x >= 0.0, side, y) * scale, select(x >= 0.0, y, side) * scale
        write_four(now.work.aims[j].attitude, (sin_a * z, -(cos_a * z), sin_a * up, cos_a * up))
    store(state.lanes.is_near_pole, 0, select(is_near, 1.0, 0.0))


@compiled(error_model="numpy")
def aim_plainly(
    now: Moment, place: Three, velocity: Three, force: Three, lane: int, last: int, is_start: bool
) -> None:
    """Write one lane's desired attitudes at the instants before `last` in turn, with the rules for poles.

    Slower than `aim`, for the cases that it does not cover; `y_before` is carried along.
    """
    world, state, y = now.world, now.state, np.empty(3)
    for i in range(3):
        y[i] = state.lanes.y_before[i, lane]
    for j in range(last):
        at = np.array(place_after(step_of(world.instants, j), place, velocity, force))
        if world.has_pole_blending and not is_start:
            y = blended_y(at, y, world.attitude_period)
        else:
            y = desired_y(at, y)
        is_start = False
        quaternion = from_dcm(desired_dcm(at, y))
        for i in range(4):
            now.work.aims[j].attitude[i, lane] = quaternion[i]
    for i in range(3):
        state.lanes.y_before[i, lane] = y[i]


@compiled(error_model="numpy", forceinline=True)
def aim_by_rules(now: Moment, position: Floats, velocity: Floats, force: Floats, last: int) -> None:
    """Aim lanes near a pole again by the rules for poles, and store y* of all at the last instant."""
    world, lanes, width = now.world, now.state.lanes, width_of(now.state.lanes)
    # where the position defines the attitude, y* is (k x r)/|k x r|
    a1, a2, a3, a4 = four(now.work.aims[last - 1].attitude)
    level = Three(2.0 * (a1 * a2 - a3 * a4), -a1 * a1 + a2 * a2 - a3 * a3 + a4 * a4, splat(0.0, width))
    follows = one(lanes.is_near_pole) > 0.0
    if not (some(follows) or world.has_pole_blending):
        store_three(lanes.y_before, 0, level)
        return
    for lane in range(now.num_lanes):
        if lanes.is_near_pole[lane] > 0.0 or world.has_pole_blending:
            at, moving = lane_of(position, 0, lane), lane_of(velocity, 0, lane)
            aim_plainly(now, at, moving, lane_of(force, 0, lane), lane, last, now.k == 0)
    if not world.has_pole_blending:
        store_three(lanes.y_before, 0, chosen(follows, load_three(lanes.y_before, 0), level))


@compiled(error_model="numpy", forceinline=True)
def aim_deputies(now: Moment, plans: Plans) -> None:
    """Write the desired attitudes of all lanes over the control period that follows sample k."""
    last, belief, force = now.world.num_attitude_steps, now.state.belief, now.state.lanes.commanded
    place, velocity = load_three(belief.position, 0), load_three(belief.velocity, 0)
    aim(now, place, velocity, load_three(force, 0), last)
    aim_by_rules(now, belief.position, belief.velocity, force, last)
    play_attitudes(now, plans, last)


@compiled(error_model="numpy", forceinline=True)
def play_attitudes(now: Moment, plans: Plans, last: int) -> None:
    """Put played attitudes, if there are some, in the place of those aimed at."""
    for j in range(last if len(plans.turns.attitudes) > 0 else 0):
        for i in range(4):
            aims, played = (
                now.work.aims[j].attitude,
                plans.turns.attitudes[min(now.k, len(plans.turns.attitudes) - 1), i],
            )
            store(aims, i, splat(played, width_of(aims)))


@compiled(error_model="numpy", forceinline=True)
def aim_at_once(now: Moment, plans: Plans) -> None:
    """Set the attitudes of all lanes to the desired ones at sample k, for ideal pointing.

    `aim_deputies` starts at this sample again, from what the deputies believe: y* keeps its earlier value.
    """
    lanes, truth = now.state.lanes, now.state.truth
    before, nothing = load_three(lanes.y_before, 0), same(0.0, width_of(lanes))
    store_three(lanes.force, 0, nothing)
    aim(now, load_three(truth.position, 0), load_three(truth.velocity, 0), nothing, 1)
    aim_by_rules(now, truth.position, truth.velocity, lanes.force, 1)
    store_three(lanes.y_before, 0, before)
    play_attitudes(now, plans, 1)
    write_four(truth.attitude, four(now.work.aims[0].attitude))
