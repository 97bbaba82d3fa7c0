"""From the deputies' commands to the forces that their thrusters fire.

`pipeline.flight.cases.actuators` describes thrusters and their errors. Forces are in N, in Hill axes unless
a name says otherwise. What a layout fires is computed one deputy, or lane, after another; thrusters along
Hill axes are in vectors, as one deputy after another would take a flight in `world=leo` 15 % longer.
"""

from typing import Any

import numpy as np

from fis_tools.compiled.decorator import compiled
from fis_tools.compiled.three import (
    Three,
    chosen,
    lane_of,
    load_at,
    load_three,
    same,
    store_three,
    three_of,
    write_lane,
)
from fis_tools.compiled.vectors import Vector, least, load, most, select, splat, store, width_of
from pipeline.array_types import Floats
from pipeline.flight.state.arrays import FlightState, Moment, World
from pipeline.flight.state.errors import Firing, ModelErrors, ThrustErrors, Thrusters
from pipeline.flight.state.lanes import (
    attitude_of,
    clip_three,
    flight_of,
    load_quaternion,
    load_row,
    write_attitude,
)
from pipeline.physics.quaternion import to_body, to_hill, turned

#: propellant, as a share of the mass at the start, that counts as none: what rounding leaves
EMPTY = 1e-12


@compiled(error_model="numpy")
def carry_out(now: Moment, aims: Any, errors: ModelErrors) -> None:
    """Turn commands into forces fired, where the deputies' knowledge or their thrusters are not exact."""
    state, thrusters = now.state, errors.firing.thrusters
    if errors.fixes.is_on:
        store_commands(now, thrusters.delay)
        if errors.fixes.errors.of_attitude.shape[1] > 0:
            for lane in range(width_of(state.lanes)):
                turn_with_body(now, aims, lane)
    if errors.firing.is_on:
        fire(now, errors.firing, errors.fixes.is_on)


@compiled(error_model="numpy")
def store_commands(now: Moment, delay: int) -> None:
    """Store what the filter propagates with: the commands, in the control period in which they act."""
    state, k = now.state, now.k
    if k - now.world.first < delay:
        store_three(state.acting[k], 0, same(0.0, width_of(state.lanes)))
    if k + delay < now.world.num_controls:
        store_three(state.acting[k + delay], 0, load_three(state.lanes.commanded, 0))


@compiled(error_model="numpy")
def turn_with_body(now: Moment, aims: Any, lane: int) -> None:
    """Rotate thrust and aim by the error of the sensed attitude: thrusters turn with the true body."""
    state, force = now.state, now.state.lanes.force
    force_b = to_body(attitude_of(state.belief.attitude, lane), lane_of(force, 0, lane))
    turned_force = to_hill(attitude_of(state.truth.attitude, lane), force_b)
    write_lane(force, 0, lane, clip_three(turned_force, now.world.max_force))
    turn = attitude_of(state.estimate.turn, lane)
    for j in range(now.world.num_attitude_steps):
        aim = aims[j].attitude
        write_attitude(aim, lane, turned(attitude_of(aim, lane), turn, -1.0))


@compiled(error_model="numpy")
def fire(now: Moment, firing: Firing, is_reporting: bool) -> None:
    """Turn the commands of all lanes into the forces fired: delayed, turned, rounded and limited.

    The forces of a layout's thrusters are turned after they are rounded, as those are bolted on; what they
    fired is reported to the filter before.
    """
    state, thrusters, k = now.state, firing.thrusters, now.k
    width, lanes = width_of(state.lanes), state.lanes
    load_errors(now, firing.errors)
    store_three(state.commands[k], 0, load_three(lanes.force, 0))
    command = same(0.0, width)
    if k - now.world.first >= thrusters.delay:
        command = load_at(state.commands, k - thrusters.delay, 0, 0, width)
    is_layout, force = len(thrusters.table) > 0, command
    if not is_layout:
        force = in_impulses(thrusters, with_errors(state.thrusters.errors, command))
        force = clip_three(force, now.world.max_force)
    has_left = load_row(state.thrusters.mass) - thrusters.dry > EMPTY
    store_three(lanes.force, 0, chosen(has_left, force, same(0.0, width)))
    if is_layout:
        for lane in range(width):
            fire_layout(state, thrusters, lane, k)
    share = splat(1.0, width)
    if needs_burn(firing):
        share = stop_when_empty(now.world, thrusters, state)
    if is_reporting and is_layout:
        report_layout(state, thrusters, k)
    elif is_reporting:
        report_axes(state, thrusters, k, share)
    if is_layout:
        store_three(lanes.force, 0, with_errors(state.thrusters.errors, load_three(lanes.force, 0)))


@compiled(error_model="numpy")
def load_errors(now: Moment, drawn: ThrustErrors) -> None:
    """Write the thruster errors of all lanes from now on."""
    state, lanes, is_first = now.state, now.state.lanes, now.k == now.world.first
    period = min(now.k, drawn.matrices.shape[1] - 1)
    for lane in range(width_of(lanes) if period == now.k or is_first else 0):
        case = flight_of(now, lane)
        for row in range(3):
            write_lane(state.thrusters.errors, 3 * row, lane, three_of(drawn.matrices[case, period, row]))
        if is_first:
            write_lane(lanes.arm, 0, lane, three_of(drawn.arms[case]))
            write_lane(lanes.twist, 0, lane, Three(0.0, 0.0, 0.0))
            state.thrusters.mass[lane] = 1.0


@compiled(error_model="numpy", forceinline=True)
def with_errors(errors: Floats, a: Three) -> Three:
    """Return the matrices of errors, shape (9, L) by rows, times commands."""
    x, y, z = load_three(errors, 0), load_three(errors, 3), load_three(errors, 6)
    return Three(
        x.x * a.x + (x.y * a.y + x.z * a.z),
        y.x * a.x + (y.y * a.y + y.z * a.z),
        z.x * a.x + (z.y * a.y + z.z * a.z),
    )


@compiled(error_model="numpy", forceinline=True)
def in_whole_impulses(thrusters: Thrusters, force: Vector) -> Vector:
    """Round forces to multiples of the step; zero below the least."""
    rounded = np.rint(force / thrusters.step) * thrusters.step if thrusters.step > 0.0 else force
    return select(abs(rounded) >= thrusters.least, rounded, 0.0)


@compiled(error_model="numpy", forceinline=True)
def in_impulses(thrusters: Thrusters, a: Three) -> Three:
    """Round the components of forces to impulses, see `in_whole_impulses`."""
    x, y, z = a.x, a.y, a.z
    return Three(
        in_whole_impulses(thrusters, x), in_whole_impulses(thrusters, y), in_whole_impulses(thrusters, z)
    )


@compiled(error_model="numpy")
def fire_layout(state: FlightState, thrusters: Thrusters, lane: int, k: int) -> None:
    """Divide a lane's force among the thrusters of a layout, and let these fire.

    Where one thruster is not enough, all are reduced by the same share. One that has failed fires nothing.
    """
    table, layout, thrusts = thrusters.table, thrusters.layout, state.thrust
    attitude, share = attitude_of(state.truth.attitude, lane), 1.0
    x, y, z = to_body(attitude, lane_of(state.lanes.force, 0, lane))
    for i in range(len(table)):
        thrust = most(x, 0.0) * table[i, 0] + most(y, 0.0) * table[i, 1] + most(z, 0.0) * table[i, 2]
        thrust += most(-x, 0.0) * table[i, 3] + most(-y, 0.0) * table[i, 4] + most(-z, 0.0) * table[i, 5]
        thrusts[i, lane] = thrust
        share = least(share, layout[i, 6] / most(thrust, layout[i, 6]))
    force_b, moment_b = Three(0.0, 0.0, 0.0), Three(0.0, 0.0, 0.0)
    for i in range(len(table)):
        thrust = in_whole_impulses(thrusters, thrusts[i, lane] * share)
        if i == thrusters.failed and k >= thrusters.fails_at:
            thrust = 0.0
        thrusts[i, lane] = thrust
        force_b += thrust * three_of(layout[i])
        moment_b += thrust * three_of(layout[i, 3:])
    write_lane(state.lanes.force, 0, lane, to_hill(attitude, force_b))
    write_lane(state.lanes.twist, 0, lane, moment_b)


@compiled(error_model="numpy", forceinline=True)
def sums_of_thrusts(thrusters: Thrusters, state: FlightState) -> tuple[Vector, Vector]:
    """Return the sums of what all thrusters fire, and of the forces' components, N."""
    force, width = load_three(state.lanes.force, 0), width_of(state.lanes)
    along_axes = abs(force.x) + abs(force.y) + abs(force.z)
    if len(thrusters.table) == 0:
        return along_axes, along_axes
    thrusts = splat(0.0, width)
    for i in range(len(thrusters.table)):
        thrusts += load(state.thrust, i, width)
    return thrusts, along_axes


@compiled(error_model="numpy")
def stop_when_empty(world: World, thrusters: Thrusters, state: FlightState) -> Vector:
    """Shorten the last burn to what the tank holds, and return by which shares the forces are weaker."""
    lanes, width = state.lanes, width_of(state.lanes)
    used = sums_of_thrusts(thrusters, state)[0] * (world.delta_v_per_force / thrusters.exhaust_speed)
    left = load_row(state.thrusters.mass) - thrusters.dry
    share = select(used > left, left / most(used, left), 1.0)
    store_three(lanes.force, 0, share * load_three(lanes.force, 0))
    store_three(lanes.twist, 0, share * load_three(lanes.twist, 0))
    for i in range(len(thrusters.table)):
        store(state.thrust, i, share * load(state.thrust, i, width))
    return share


@compiled(error_model="numpy")
def report_layout(state: FlightState, thrusters: Thrusters, k: int) -> None:
    """Store what a layout's thrusters report to have fired, as the force on the mass at the start.

    It is in Hill axes by the sensed attitude.
    """
    force_b = to_body(load_quaternion(state.truth.attitude), load_three(state.lanes.force, 0))
    force = to_hill(load_quaternion(state.belief.attitude), force_b)
    if thrusters.exhaust_speed < np.inf:
        force = force / load_row(state.thrusters.mass)
    store_three(state.acting[k], 0, force)
    store_three(state.has_fired[k], 0, same(1.0, width_of(state.lanes)))


@compiled(error_model="numpy")
def report_axes(state: FlightState, thrusters: Thrusters, k: int, share: Vector) -> None:
    """Correct stored commands by whether thrusters fired along each axis, which they report.

    A command along whose axis nothing was fired is kept: turned, it pushes along the other axes. Forces are
    those on the mass at the start; `share` is that of the burn which the tank held.
    """
    width, smallest = width_of(state.lanes), max(thrusters.step, thrusters.least)
    for axis in range(3):
        command, fired = load(state.acting[k], axis, width), load(state.lanes.force, axis, width)
        force = in_whole_impulses(thrusters, command)
        impulse = select(command > 0.0, smallest, select(command < 0.0, -smallest, 0.0))
        force = select((force == 0.0) & (fired != 0.0), impulse, force)
        if thrusters.exhaust_speed < np.inf:
            force = share * force / load_row(state.thrusters.mass)
        store(state.acting[k], axis, force)
        store(state.has_fired[k], axis, select(fired == 0.0, 0.0, 1.0))


@compiled(error_model="numpy")
def needs_burn(firing: Firing) -> bool:
    """Return whether thrusters consume propellant, or spend more than the force tells, as a layout's do."""
    return firing.is_on and (firing.thrusters.exhaust_speed < np.inf or len(firing.thrusters.table) > 0)


@compiled(error_model="numpy")
def burn(world: World, firing: Firing, state: FlightState) -> Three:
    """Consume propellant; return the forces that would accelerate the mass at the start as much.

    Thrusters of a layout spend what they fire, which the force alone does not tell.
    """
    lanes, thrusters, force = state.lanes, firing.thrusters, load_three(state.lanes.force, 0)
    if not needs_burn(firing):
        return force
    thrusts, along_axes = sums_of_thrusts(thrusters, state)
    mass, used = load_row(state.thrusters.mass), thrusts * (world.delta_v_per_force / thrusters.exhaust_speed)
    per_mass: float = 1.0 / (mass - 0.5 * used)
    more = (thrusts - along_axes) * (per_mass * world.delta_v_per_force)
    store(lanes.spent, 0, load_row(lanes.spent) + more)
    store(state.thrusters.mass, 0, mass - used)
    return per_mass * force
