"""Thrusters with errors, in lanes; the model is in `pipeline.flight.cases.actuators`."""

import numpy as np
from numpy.typing import NDArray

from fis_tools.compiled.decorator import compiled
from fis_tools.compiled.vectors import Vector, least, load, most, select, splat, store, width_of
from pipeline.flight.period.look.sight import to_body, to_hill
from pipeline.flight.state.arrays import Workspace, World
from pipeline.flight.state.errors import Firing
from pipeline.flight.state.lanes import clip, four, one, three, write_three
from pipeline.flight.state.log import FlightLog

Floats = NDArray[np.float64]


@compiled(error_model="numpy", forceinline=True)
def in_impulses(force: Vector, step: float, least: float) -> Vector:
    """Round a force to multiples of a step; zero below the least."""
    rounded = np.rint(force / step) * step if step > 0.0 else force
    return select(abs(rounded) >= least, rounded, 0.0)


@compiled(error_model="numpy")
def note_errors(firing: Firing, work: Workspace, first: int, num_lanes: int, k: int) -> None:
    """Store the thruster errors from now on of all lanes, which are flights from `first` on."""
    width = width_of(work.lanes)
    for lane in range(width if k < firing.matrices.shape[1] else 0):
        case = first + min(lane, num_lanes - 1)
        for row in range(3):
            for column in range(3):
                firing.lanes.errors[3 * row + column, lane] = firing.matrices[case, k, row, column]
            if k == 0:
                work.lanes.arm[row, lane], work.lanes.twist[row, lane] = firing.arms[case, row], 0.0
        if k == 0:
            firing.lanes.mass[lane] = 1.0


@compiled(error_model="numpy")
def fire(
    world: World, firing: Firing, work: Workspace, first: int, num_lanes: int, k: int, log: FlightLog
) -> None:
    """Turn the commands of all lanes into the forces fired."""
    width = width_of(work.lanes)
    force = work.lanes.force
    note_errors(firing, work, first, num_lanes, k)
    for axis in range(3):
        store(firing.commands, (k, axis, 0), load(force, axis, width))
    fx, fy, fz = splat(0.0, width), splat(0.0, width), splat(0.0, width)
    if k >= firing.delay:
        then = k - firing.delay
        fx, fy = load(firing.commands, (then, 0, 0), width), load(firing.commands, (then, 1, 0), width)
        fz = load(firing.commands, (then, 2, 0), width)
    for axis in range(3):
        turned = load(firing.lanes.errors, 3 * axis, width) * fx
        turned += (
            load(firing.lanes.errors, 3 * axis + 1, width) * fy
            + load(firing.lanes.errors, 3 * axis + 2, width) * fz
        )
        if len(firing.table) == 0:
            turned = clip(in_impulses(turned, firing.step, firing.least), world.max_force)
        store(force, axis, select(one(firing.lanes.mass) > firing.dry, turned, 0.0))
    if len(firing.table) > 0:
        divide(firing, work)
    if len(log.position_m) > 0:
        for axis in range(3):
            log.force_hill_n[k, axis] = force[axis, 0]


@compiled(error_model="numpy")
def divide(firing: Firing, work: Workspace) -> None:
    """Allocate forces to the thrusters of a layout, and let these fire."""
    width = width_of(work.lanes)
    lanes, layout, table, nothing = work.lanes, firing.layout, firing.table, splat(0.0, width)
    q = four(lanes.attitude)
    x, y, z = to_body(q, three(lanes.force))
    share = splat(1.0, width)
    for i in range(len(table)):
        thrust = most(x, 0.0) * table[i, 0] + most(y, 0.0) * table[i, 1] + most(z, 0.0) * table[i, 2]
        thrust += most(-x, 0.0) * table[i, 3] + most(-y, 0.0) * table[i, 4] + most(-z, 0.0) * table[i, 5]
        store(firing.thrust, (i, 0), thrust)
        share = least(share, layout[i, 6] / most(thrust, layout[i, 6]))
    fx, fy, fz, mx, my, mz = nothing, nothing, nothing, nothing, nothing, nothing
    for i in range(len(table)):
        thrust = in_impulses(load(firing.thrust, (i, 0), width) * share, firing.step, firing.least)
        store(firing.thrust, (i, 0), thrust)
        fx, fy, fz = fx + layout[i, 0] * thrust, fy + layout[i, 1] * thrust, fz + layout[i, 2] * thrust
        mx, my, mz = mx + layout[i, 3] * thrust, my + layout[i, 4] * thrust, mz + layout[i, 5] * thrust
    write_three(lanes.force, 0, *to_hill(q, (fx, fy, fz)))
    write_three(lanes.twist, 0, mx, my, mz)


@compiled(error_model="numpy")
def burn(world: World, firing: Firing, work: Workspace, k: int, log: FlightLog) -> None:
    """Consume propellant, and scale forces to their equivalent with the mass at the start.

    Thrusters of a layout spend what they fire, which `spend` does not cover.
    """
    width = width_of(work.lanes)
    if firing.exhaust_speed == np.inf and len(firing.table) == 0:
        return
    lanes = work.lanes
    fx, fy, fz = three(lanes.force)
    along_axes = abs(fx) + abs(fy) + abs(fz)
    fired = along_axes
    if len(firing.table) > 0:
        fired = splat(0.0, width)
        for i in range(len(firing.table)):
            fired += load(firing.thrust, (i, 0), width)
    spent_per_force = world.control_period * world.acceleration_per_force
    used = fired * (spent_per_force / firing.exhaust_speed)
    before = one(firing.lanes.mass)
    per_mass = 1.0 / (before - 0.5 * used)
    store(lanes.spent, 0, one(lanes.spent) + (fired - along_axes) * (per_mass * spent_per_force))
    write_three(lanes.force, 0, fx * per_mass, fy * per_mass, fz * per_mass)
    store(firing.lanes.mass, 0, before - used)
    if len(log.position_m) > 0:
        log.mass_kg[k + 1] = firing.lanes.mass[0] / world.acceleration_per_force
