"""From the deputies' commands to the forces that their thrusters fire; `pipeline.flight.cases.actuators`."""

import numpy as np

from fis_tools.compiled.decorator import compiled
from fis_tools.compiled.three import (
    Three,
    load_at,
    load_three,
    plus,
    same,
    scaled,
    store_at,
    store_three,
    three_of,
    write_lane,
)
from fis_tools.compiled.vectors import Vector, least, load, most, select, splat, store, width_of
from pipeline.array_types import Floats
from pipeline.flight.state.arrays import State, Workspace, World
from pipeline.flight.state.errors import Firing, Fixes, ModelErrors
from pipeline.flight.state.lanes import clip_three, four, one, to_body, to_hill, turned, write_four

#: propellant, as a share of the mass at the start, that counts as none: what rounding leaves
EMPTY = 1e-12


@compiled(error_model="numpy", forceinline=True)
def in_impulses(force: Vector, step: float, least: float) -> Vector:
    """Round a force to multiples of a step; zero below the least."""
    rounded = np.rint(force / step) * step if step > 0.0 else force
    return select(abs(rounded) >= least, rounded, 0.0)


@compiled(error_model="numpy", forceinline=True)
def three_in_impulses(firing: Firing, force: Three) -> Three:
    """Do so with each component."""
    step, least = firing.step, firing.least
    return Three(
        in_impulses(force.x, step, least),
        in_impulses(force.y, step, least),
        in_impulses(force.z, step, least),
    )


@compiled(error_model="numpy")
def note_command(firing: Firing, state: State, k: int, num_controls: int) -> None:
    """Store the command of a sample for the period in which it acts, as the force of ideal thrusters."""
    width, force = width_of(state.lanes), load_three(state.lanes.commanded, 0)
    if firing.is_on and len(firing.table) == 0:
        force = three_in_impulses(firing, force)
    if k < firing.delay:
        store_at(state.acting, k, same(0.0, width))
    if k + firing.delay < num_controls:
        store_at(state.acting, k + firing.delay, force)


@compiled(error_model="numpy")
def turn_with_body(world: World, fixes: Fixes, state: State, work: Workspace) -> None:
    """Rotate thrust and aim by the error of the sensed attitude: thrusters turn with the true body."""
    lanes, turn = state.lanes, four(state.estimate.turn)
    meant = to_body(four(state.belief.attitude), load_three(lanes.force, 0))
    force = to_hill(four(state.truth.attitude), meant)
    store_three(lanes.force, 0, clip_three(force, world.max_force))
    for j in range(world.num_attitude_steps):
        attitude = work.aims[j].attitude
        write_four(attitude, turned(four(attitude), turn, -1.0))


@compiled(error_model="numpy")
def note_errors(firing: Firing, state: State, first: int, num_lanes: int, k: int) -> None:
    """Store the thruster errors from now on of all lanes, which are flights from `first` on."""
    errors, lanes, width = state.thrusters.errors, state.lanes, width_of(state.lanes)
    for lane in range(width if k < firing.matrices.shape[1] else 0):
        case = first + min(lane, num_lanes - 1)
        for row in range(3):
            for column in range(3):
                errors[3 * row + column, lane] = firing.matrices[case, k, row, column]
        if k == 0:
            write_lane(lanes.arm, 0, lane, three_of(firing.arms[case]))
            write_lane(lanes.twist, 0, lane, Three(0.0, 0.0, 0.0))
            state.thrusters.mass[lane] = 1.0


@compiled(error_model="numpy")
def fire(world: World, firing: Firing, state: State, first: int, num_lanes: int, k: int) -> None:
    """Turn the commands of all lanes into the forces fired."""
    width, force = width_of(state.lanes), state.lanes.force
    note_errors(firing, state, first, num_lanes, k)
    store_at(state.commands, k, load_three(force, 0))
    asked = same(0.0, width)
    if k >= firing.delay:
        asked = load_at(state.commands, k - firing.delay, width)
    e = state.thrusters.errors
    fired = Three(turned_row(e, 0, asked), turned_row(e, 3, asked), turned_row(e, 6, asked))
    if len(firing.table) == 0:
        fired = clip_three(three_in_impulses(firing, fired), world.max_force)
    has_left = one(state.thrusters.mass) - firing.dry > EMPTY
    store(force, 0, select(has_left, fired.x, 0.0))
    store(force, 1, select(has_left, fired.y, 0.0))
    store(force, 2, select(has_left, fired.z, 0.0))
    if len(firing.table) > 0:
        divide(firing, state)
    if burns(firing):
        stop_when_empty(world, firing, state)


@compiled(error_model="numpy")
def stop_when_empty(world: World, firing: Firing, state: State) -> None:
    """Shorten the last burn to what the tank holds: the force held over the period is that much weaker."""
    lanes, width = state.lanes, width_of(state.lanes)
    used, left = propellant_used(world, firing, state), one(state.thrusters.mass) - firing.dry
    share = select(used > left, left / most(used, left), 1.0)
    store_three(lanes.force, 0, scaled(share, load_three(lanes.force, 0)))
    store_three(lanes.twist, 0, scaled(share, load_three(lanes.twist, 0)))
    for i in range(len(firing.table)):
        store(state.thrust, (i, 0), share * load(state.thrust, (i, 0), width))


@compiled(error_model="numpy", forceinline=True)
def fired_along_axes(firing: Firing, state: State) -> tuple[Vector, Vector]:
    """Return the sum of what is fired, N: by the thrusters, and as components of the force alone."""
    force, width = load_three(state.lanes.force, 0), width_of(state.lanes)
    along_axes = abs(force.x) + abs(force.y) + abs(force.z)
    fired = along_axes
    if len(firing.table) > 0:
        fired = splat(0.0, width)
        for i in range(len(firing.table)):
            fired += load(state.thrust, (i, 0), width)
    return fired, along_axes


@compiled(error_model="numpy", forceinline=True)
def propellant_used(world: World, firing: Firing, state: State) -> Vector:
    """Return the propellant that firing takes in a control period, as a share of the mass at the start."""
    spent_per_force = world.control_period * world.acceleration_per_force
    return fired_along_axes(firing, state)[0] * (spent_per_force / firing.exhaust_speed)


@compiled(error_model="numpy", forceinline=True)
def turned_row(errors: Floats, first: int, a: Three) -> Vector:
    """Return a row of the matrix of errors, which begins at row `first` of its entries, times a vector."""
    width = width_of(errors)
    across = load(errors, first + 1, width) * a.y + load(errors, first + 2, width) * a.z
    return load(errors, first, width) * a.x + across


@compiled(error_model="numpy")
def divide(firing: Firing, state: State) -> None:
    """Allocate forces to the thrusters of a layout, and let these fire."""
    width = width_of(state.lanes)
    lanes, layout, table = state.lanes, firing.layout, firing.table
    q = four(state.truth.attitude)
    x, y, z = to_body(q, load_three(lanes.force, 0))
    share = splat(1.0, width)
    for i in range(len(table)):
        thrust = most(x, 0.0) * table[i, 0] + most(y, 0.0) * table[i, 1] + most(z, 0.0) * table[i, 2]
        thrust += most(-x, 0.0) * table[i, 3] + most(-y, 0.0) * table[i, 4] + most(-z, 0.0) * table[i, 5]
        store(state.thrust, (i, 0), thrust)
        share = least(share, layout[i, 6] / most(thrust, layout[i, 6]))
    force, moment = same(0.0, width), same(0.0, width)
    for i in range(len(table)):
        thrust = in_impulses(load(state.thrust, (i, 0), width) * share, firing.step, firing.least)
        store(state.thrust, (i, 0), thrust)
        force = plus(force, scaled(thrust, three_of(layout[i])))
        moment = plus(moment, scaled(thrust, three_of(layout[i, 3:])))
    store_three(lanes.force, 0, to_hill(q, force))
    store_three(lanes.twist, 0, moment)


@compiled(error_model="numpy")
def carry_out(
    world: World, errors: ModelErrors, state: State, work: Workspace, first: int, num_lanes: int, k: int
) -> None:
    """Turn commands into forces fired, where the deputies' knowledge or their thrusters are not exact."""
    fixes, firing = errors.fixes, errors.firing
    if fixes.is_on:
        note_command(firing, state, k, world.num_controls)
        if fixes.of_attitude.shape[1] > 0:
            turn_with_body(world, fixes, state, work)
    if firing.is_on:
        fire(world, firing, state, first, num_lanes, k)


@compiled(error_model="numpy")
def burns(firing: Firing) -> bool:
    """Return whether thrusters consume propellant, or spend otherwise than the force tells."""
    return firing.is_on and (firing.exhaust_speed < np.inf or len(firing.table) > 0)


@compiled(error_model="numpy")
def burn(world: World, firing: Firing, state: State) -> Three:
    """Consume propellant; return the forces that would accelerate the mass at the start as much, N.

    Thrusters of a layout spend what they fire, which the force alone does not tell.
    """
    lanes, force = state.lanes, load_three(state.lanes.force, 0)
    if not burns(firing):
        return force
    fired, along_axes = fired_along_axes(firing, state)
    spent_per_force = world.control_period * world.acceleration_per_force
    used, before = propellant_used(world, firing, state), one(state.thrusters.mass)
    per_mass = 1.0 / (before - 0.5 * used)
    store(lanes.spent, 0, one(lanes.spent) + (fired - along_axes) * (per_mass * spent_per_force))
    store(state.thrusters.mass, 0, before - used)
    return scaled(per_mass, force)
