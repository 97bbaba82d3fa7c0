"""Thrusters with errors on lanes, by the law of `pipeline.flight.actuators`."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fis_tools.engines.compiled import compiled
from fis_tools.engines.kernel import LANES
from fis_tools.engines.vectors import Vector, load, select, splat, store
from pipeline.flight.kernel.arrays import Workspace, World
from pipeline.flight.kernel.attitude import clip
from pipeline.flight.kernel.lanes import one, three, write_three
from pipeline.flight.log import FlightLog

Floats = NDArray[np.float64]


class Firing(NamedTuple):
    """Thrusters of some flights: see `pipeline.flight.actuators.Thrusters` and `thrust_errors`."""

    delay: int
    step: float
    least: float
    exhaust_speed: float
    dry: float
    matrices: Floats
    arms: Floats
    commands: Floats  # (K, 3, LANES) so far
    errors: Floats  # (9, LANES) of the flights that are flown, by rows
    mass: Floats  # (LANES,) of that at the start


@compiled(error_model="numpy", forceinline=True)
def in_impulses(force: Vector, step: float, least: float) -> Vector:
    """Round a force to multiples of a step, and leave out what is less than the least."""
    rounded = np.rint(force / step) * step if step > 0.0 else force
    return select(abs(rounded) >= least, rounded, 0.0)


@compiled(error_model="numpy")
def fire(
    world: World, firing: Firing, work: Workspace, first: int, num_lanes: int, k: int, log: FlightLog
) -> None:
    """Turn the commands of all lanes into what they fire."""
    force = work.lanes.force
    if k == 0:
        for lane in range(LANES):
            case = first + min(lane, num_lanes - 1)
            firing.mass[lane] = 1.0
            for row in range(3):
                work.lanes.arm[row, lane] = firing.arms[case, row]
                for column in range(3):
                    firing.errors[3 * row + column, lane] = firing.matrices[case, row, column]
    for axis in range(3):
        store(firing.commands, (k, axis, 0), load(force, axis, LANES))
    fx, fy, fz = splat(0.0, LANES), splat(0.0, LANES), splat(0.0, LANES)
    if k >= firing.delay:
        then = k - firing.delay
        fx, fy = load(firing.commands, (then, 0, 0), LANES), load(firing.commands, (then, 1, 0), LANES)
        fz = load(firing.commands, (then, 2, 0), LANES)
    for axis in range(3):
        turned = load(firing.errors, 3 * axis, LANES) * fx
        turned += (
            load(firing.errors, 3 * axis + 1, LANES) * fy + load(firing.errors, 3 * axis + 2, LANES) * fz
        )
        turned = clip(in_impulses(turned, firing.step, firing.least), world.max_force)
        store(force, axis, select(one(firing.mass) > firing.dry, turned, 0.0))
    if len(log.position_m) > 0:
        for axis in range(3):
            log.force_hill_n[k, axis] = force[axis, 0]


@compiled(error_model="numpy")
def burn(world: World, firing: Firing, work: Workspace, k: int, log: FlightLog) -> None:
    """Use up propellant, and scale forces to what they would be with the mass at the start."""
    if firing.exhaust_speed == np.inf:
        return
    fx, fy, fz = three(work.lanes.force)
    used = (abs(fx) + abs(fy) + abs(fz)) * (
        world.control_period * world.acceleration_per_force / firing.exhaust_speed
    )
    before = one(firing.mass)
    per_mass = 1.0 / (before - 0.5 * used)
    write_three(work.lanes.force, 0, fx * per_mass, fy * per_mass, fz * per_mass)
    store(firing.mass, 0, before - used)
    if len(log.position_m) > 0:
        log.mass_kg[k + 1] = firing.mass[0] / world.acceleration_per_force
