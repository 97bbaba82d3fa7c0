"""From the deputies' commands to the forces that their thrusters fire; `pipeline.flight.cases.actuators`."""

from typing import Any

import numpy as np

from fis_tools.compiled.decorator import compiled
from fis_tools.compiled.three import (
    Three,
    load_at,
    load_three,
    same,
    store_at,
    store_three,
    three_of,
    write_lane,
)
from fis_tools.compiled.vectors import Vector, least, load, most, select, splat, store, width_of
from pipeline.array_types import Floats
from pipeline.flight.state.arrays import FlightState, Moment, World
from pipeline.flight.state.errors import Firing, ModelErrors, ThrustErrors, Thrusters
from pipeline.flight.state.lanes import (
    clip,
    clip_three,
    flight_of,
    load_quaternion,
    load_row,
    store_quaternion,
)
from pipeline.physics.quaternion import to_body, to_hill, turned

#: propellant, as a share of the mass at the start, that counts as none: what rounding leaves
EMPTY = 1e-12


@compiled(error_model="numpy", forceinline=True)
def in_impulses(force: Vector, step: float, least: float) -> Vector:
    """Round a force to multiples of a step; zero below the least."""
    rounded = np.rint(force / step) * step if step > 0.0 else force
    return select(abs(rounded) >= least, rounded, 0.0)


@compiled(error_model="numpy", forceinline=True)
def believed(thrusters: Thrusters, command: Vector, fired: Vector) -> Vector:
    """Return what a command amounts to, by impulses and whether thrusters fired along its axis.

    A command along whose axis nothing was fired is kept: turned, it pushes along the other axes.
    """
    force = in_impulses(command, thrusters.step, thrusters.least)
    smallest = max(thrusters.step, thrusters.least)
    one_impulse = select(command > 0.0, smallest, select(command < 0.0, -smallest, 0.0))
    return select((force == 0.0) & (fired != 0.0), one_impulse, force)


@compiled(error_model="numpy")
def note_fired(now: Moment, thrusters: Thrusters) -> None:
    """Correct the stored command of a period by whether thrusters fired along each axis, which they tell."""
    state, width = now.state, width_of(now.state.lanes)
    for axis in range(3):
        command, fired = load(state.acting, (now.k, axis, 0), width), load(state.lanes.force, axis, width)
        store(state.acting, (now.k, axis, 0), believed(thrusters, command, fired))
        store(state.has_fired, (now.k, axis, 0), select(fired == 0.0, 0.0, 1.0))


@compiled(error_model="numpy")
def turn_with_body(now: Moment, aims: Any) -> None:
    """Rotate thrust and aim by the error of the sensed attitude: thrusters turn with the true body."""
    world, state, lanes, turn = (
        now.world,
        now.state,
        now.state.lanes,
        load_quaternion(now.state.estimate.turn),
    )
    meant = to_body(load_quaternion(state.belief.attitude), load_three(lanes.force, 0))
    force = to_hill(load_quaternion(state.truth.attitude), meant)
    store_three(lanes.force, 0, clip_three(force, world.max_force))
    for j in range(world.num_attitude_steps):
        attitude = aims[j].attitude
        store_quaternion(attitude, turned(load_quaternion(attitude), turn, -1.0))


@compiled(error_model="numpy")
def note_errors(now: Moment, drawn: ThrustErrors) -> None:
    """Store the thruster errors of all lanes from now on."""
    state, lanes, is_first = now.state, now.state.lanes, now.k == now.world.first
    which = min(now.k, drawn.matrices.shape[1] - 1)
    for lane in range(width_of(lanes) if which == now.k or is_first else 0):
        case = flight_of(now, lane)
        for row in range(3):
            for column in range(3):
                state.thrusters.errors[3 * row + column, lane] = drawn.matrices[case, which, row, column]
        if is_first:
            write_lane(lanes.arm, 0, lane, three_of(drawn.arms[case]))
            write_lane(lanes.twist, 0, lane, Three(0.0, 0.0, 0.0))
            state.thrusters.mass[lane] = 1.0


@compiled(error_model="numpy")
def fire(now: Moment, firing: Firing) -> None:
    """Turn the commands of all lanes into the forces fired."""
    state, thrusters, k = now.state, firing.thrusters, now.k
    width, force = width_of(state.lanes), state.lanes.force
    note_errors(now, firing.errors)
    store_at(state.commands, k, 0, load_three(force, 0))
    requested = same(0.0, width)
    if k - now.world.first >= thrusters.delay:
        requested = load_at(state.commands, k - thrusters.delay, 0, 0, width)
    has_left = load_row(state.thrusters.mass) - thrusters.dry > EMPTY
    for axis in range(3):
        fired = turned_row(state.thrusters.errors, 3 * axis, requested)
        if len(thrusters.table) == 0:
            fired = clip(in_impulses(fired, thrusters.step, thrusters.least), now.world.max_force)
        store(force, axis, select(has_left, fired, 0.0))
    if len(thrusters.table) > 0:
        divide(thrusters, state)
    if burns(firing):
        stop_when_empty(now.world, thrusters, state)


@compiled(error_model="numpy", forceinline=True)
def consumed(world: World, thrusters: Thrusters, state: FlightState) -> tuple[Vector, Vector]:
    """Return the propellant that firing takes in a control period, as a share of the mass at the start.

    And by how much the sum of what thrusters fire exceeds the components of the force, N.
    """
    force, width = load_three(state.lanes.force, 0), width_of(state.lanes)
    along_axes = abs(force.x) + abs(force.y) + abs(force.z)
    fired = along_axes
    if len(thrusters.table) > 0:
        fired = splat(0.0, width)
        for i in range(len(thrusters.table)):
            fired += load(state.thrust, (i, 0), width)
    return fired * (world.delta_v_per_force / thrusters.exhaust_speed), fired - along_axes


@compiled(error_model="numpy")
def stop_when_empty(world: World, thrusters: Thrusters, state: FlightState) -> None:
    """Shorten the last burn to what the tank holds: the force held over the period is that much weaker."""
    lanes, width = state.lanes, width_of(state.lanes)
    used, left = consumed(world, thrusters, state)[0], load_row(state.thrusters.mass) - thrusters.dry
    share = select(used > left, left / most(used, left), 1.0)
    store_three(lanes.force, 0, share * load_three(lanes.force, 0))
    store_three(lanes.twist, 0, share * load_three(lanes.twist, 0))
    for i in range(len(thrusters.table)):
        store(state.thrust, (i, 0), share * load(state.thrust, (i, 0), width))


@compiled(error_model="numpy", forceinline=True)
def turned_row(errors: Floats, first: int, a: Three) -> Vector:
    """Return a row of the matrix of errors, which begins at row `first` of its entries, times a vector."""
    width = width_of(errors)
    across = load(errors, first + 1, width) * a.y + load(errors, first + 2, width) * a.z
    return load(errors, first, width) * a.x + across


@compiled(error_model="numpy")
def divide(thrusters: Thrusters, state: FlightState) -> None:
    """Allocate forces to the thrusters of a layout, and let these fire."""
    width = width_of(state.lanes)
    lanes, layout, table = state.lanes, thrusters.layout, thrusters.table
    q = load_quaternion(state.truth.attitude)
    x, y, z = to_body(q, load_three(lanes.force, 0))
    share = splat(1.0, width)
    for i in range(len(table)):
        thrust = most(x, 0.0) * table[i, 0] + most(y, 0.0) * table[i, 1] + most(z, 0.0) * table[i, 2]
        thrust += most(-x, 0.0) * table[i, 3] + most(-y, 0.0) * table[i, 4] + most(-z, 0.0) * table[i, 5]
        store(state.thrust, (i, 0), thrust)
        share = least(share, layout[i, 6] / most(thrust, layout[i, 6]))
    force, moment = same(0.0, width), same(0.0, width)
    for i in range(len(table)):
        thrust = in_impulses(load(state.thrust, (i, 0), width) * share, thrusters.step, thrusters.least)
        store(state.thrust, (i, 0), thrust)
        force += thrust * three_of(layout[i])
        moment += thrust * three_of(layout[i, 3:])
    store_three(lanes.force, 0, to_hill(q, force))
    store_three(lanes.twist, 0, moment)


@compiled(error_model="numpy")
def carry_out(now: Moment, aims: Any, errors: ModelErrors) -> None:
    """Turn commands into forces fired, where the deputies' knowledge or their thrusters are not exact."""
    state, k, delay = now.state, now.k, errors.firing.thrusters.delay
    if errors.fixes.is_on:
        # the command in the period in which it acts, as the force of ideal thrusters
        if k - now.world.first < delay:
            store_at(state.acting, k, 0, same(0.0, width_of(state.lanes)))
        if k + delay < now.world.num_controls:
            store_at(state.acting, k + delay, 0, load_three(state.lanes.commanded, 0))
        if errors.fixes.errors.of_attitude.shape[1] > 0:
            turn_with_body(now, aims)
    if errors.firing.is_on:
        fire(now, errors.firing)
        if errors.fixes.is_on and len(errors.firing.thrusters.table) == 0:
            note_fired(now, errors.firing.thrusters)


@compiled(error_model="numpy")
def burns(firing: Firing) -> bool:
    """Return whether thrusters consume propellant, or spend otherwise than the force tells."""
    return firing.is_on and (firing.thrusters.exhaust_speed < np.inf or len(firing.thrusters.table) > 0)


@compiled(error_model="numpy")
def burn(world: World, firing: Firing, state: FlightState) -> Three:
    """Consume propellant; return the forces that would accelerate the mass at the start as much, N.

    Thrusters of a layout spend what they fire, which the force alone does not tell.
    """
    lanes, force = state.lanes, load_three(state.lanes.force, 0)
    if not burns(firing):
        return force
    (used, more), before = consumed(world, firing.thrusters, state), load_row(state.thrusters.mass)
    per_mass: float = 1.0 / (before - 0.5 * used)
    store(lanes.spent, 0, load_row(lanes.spent) + more * (per_mass * world.delta_v_per_force))
    store(state.thrusters.mass, 0, before - used)
    return per_mass * force
