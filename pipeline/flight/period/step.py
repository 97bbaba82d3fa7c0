"""Flights stepped one control period at a time, under external forces.

A period has the same parts, in the same order, as in `pipeline.flight.period.loop`, which decides on
forces itself and flies to the end. Every flight has the vectors to itself, in lane 0, since each is at
its own sample.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fis_tools.compiled.decorator import compiled
from fis_tools.compiled.vectors import borrowed, splat, store, width_of
from pipeline.flight.period.act.actuators import burn, fire
from pipeline.flight.period.act.aim import aim_at_once, aim_deputies
from pipeline.flight.period.act.attitude import turn_deputies
from pipeline.flight.period.act.command import note_command, recover_truth
from pipeline.flight.period.act.safety import assure
from pipeline.flight.period.act.two_body import move_about_earth
from pipeline.flight.period.look.navigation import believe, point_beside
from pipeline.flight.period.look.sight import sense
from pipeline.flight.period.loop import move, spend, start_lanes
from pipeline.flight.state.arrays import Beyond, Guard, Workspace, World
from pipeline.flight.state.errors import Firing, Fixes, ModelErrors
from pipeline.flight.state.lanes import clip, write_three
from pipeline.flight.state.log import FlightLog

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
Bytes = NDArray[np.uint8]

#: columns of an observation: vectors in Hill axes
POSITION, VELOCITY, TARGET, SUN, BORESIGHT = 0, 3, 6, 9, 12
NUM_INSPECTED, NUM_CANDIDATES, SPENT, LEFT = 15, 16, 17, 18
#: known to the truth only: points that count and are not inspected, how far outside, and the safety layer's
NUM_UNSEEN, OUTSIDE, NUM_ACTED, CORRECTED, NUM_OBSERVED = 19, 20, 21, 22, 23
#: the sample of a flight that is about to start
NOT_STARTED = -1


class Carried(NamedTuple):
    """What flights carry from one period to the next, a row each; see `Workspace`."""

    lanes: Any  # (n,) of `CARRIED`
    unseen: Floats  # (n, L, P padded)
    centres: Floats  # (n, L, C, 3)
    num_centres: Integers  # (n, L)
    clustered: Floats  # (n, L, P padded)


# These are inlined: a compiled function cannot return a tuple with a record in it.
@compiled(error_model="numpy", inline="always")
def workspace_of(work: Workspace, carried: Carried, flight: int) -> Workspace:
    """Return a workspace with the carried state of one flight in its place."""
    return Workspace(
        carried.lanes[flight],
        work.aims,
        work.passed,
        carried.unseen[flight],
        work.candidate,
        work.lit,
        work.seen,
        work.ahead,
        work.deadlines,
        work.looks,
        work.signals,
        work.scratch,
        work.candidates,
        carried.centres[flight],
        carried.num_centres[flight],
        carried.clustered[flight],
        work.labels,
        work.distances,
        work.sums,
        work.cuts,
    )


@compiled(error_model="numpy", inline="always")
def fixes_of(fixes: Fixes, flight: int) -> Fixes:
    """Return the navigation of one flight, from arrays with a row each."""
    return Fixes(
        fixes.is_on,
        fixes.stride,
        fixes.delay,
        fixes.start_covariance,
        fixes.process,
        fixes.process_per_force,
        fixes.fix,
        fixes.gate,
        fixes.range,
        fixes.bearing,
        fixes.at_start,
        fixes.of_fixes,
        fixes.of_sight,
        fixes.of_attitude,
        fixes.lanes[flight],
        fixes.fixes[flight],
        fixes.acting[flight],
    )


@compiled(error_model="numpy", inline="always")
def firing_of(firing: Firing, flight: int) -> Firing:
    """Return the thrusters of one flight, from arrays with a row each."""
    return Firing(
        firing.is_on,
        firing.delay,
        firing.step,
        firing.least,
        firing.exhaust_speed,
        firing.dry,
        firing.table,
        firing.layout,
        firing.matrices,
        firing.arms,
        firing.commands[flight],
        firing.lanes[flight],
        firing.thrust[flight],
    )


@compiled(error_model="numpy", forceinline=True)
def act(
    world: World,
    guard: Guard | None,
    model_errors: ModelErrors | None,
    work: Workspace,
    force: Floats,
    flight: int,
    k: int,
    silent: FlightLog,
) -> None:
    """Fly the control period after sample k with a force, N, Hill axes."""
    width = width_of(work.lanes)
    lanes = work.lanes
    for axis in range(3):
        asked = splat(force[axis], width)
        store(lanes.asked, axis, asked)
        store(lanes.force, axis, clip(asked, world.max_force))
    if guard is not None and guard.is_on:
        assure(world, work, 1, silent, k)
    aim_deputies(world, work, 1, k)
    if model_errors is not None and model_errors.fixes.is_on:
        own = fixes_of(model_errors.fixes, flight)
        note_command(own, firing_of(model_errors.firing, flight), work, k, world.num_controls)
        recover_truth(world, own, work, k, silent)
    if model_errors is not None and model_errors.firing.is_on:
        fire(world, firing_of(model_errors.firing, flight), work, flight, 1, k, silent)
    if not world.is_attitude_ideal:
        turn_deputies(world, work, 1)
    if model_errors is not None and model_errors.firing.is_on:
        burn(world, firing_of(model_errors.firing, flight), work, k, silent)
    spend(world, work)
    if model_errors is not None and model_errors.course.is_on:
        move_about_earth(world, model_errors.course, work, flight, 1, k)
    else:
        move(world, work)


@compiled(error_model="numpy", forceinline=True)
def look_about(
    world: World,
    optics: Beyond | None,
    clusters: bool | None,
    model_errors: ModelErrors | None,
    work: Workspace,
    flight: int,
    k: int,
    silent: FlightLog,
) -> None:
    """Inspect and navigate at sample k; the deputy's estimate then takes the place of the truth."""
    width = width_of(work.lanes)
    lanes = work.lanes
    if world.is_attitude_ideal:
        write_three(lanes.force, 0, splat(0.0, width), splat(0.0, width), splat(0.0, width))
        aim_at_once(world, work, 1, k)
        if model_errors is not None and model_errors.fixes.is_on:
            point_beside(fixes_of(model_errors.fixes, flight), work, flight, 1, k)
    sense(world, optics, clusters, work, 1, k, False)
    if model_errors is not None and model_errors.fixes.is_on:
        believe(world, fixes_of(model_errors.fixes, flight), work, flight, 1, k, silent)


@compiled(error_model="numpy", forceinline=True)
def write_observed(world: World, work: Workspace, k: int, row: Floats) -> None:
    """Write the observation of a flight at sample k."""
    lanes = work.lanes
    for axis in range(3):
        row[POSITION + axis] = lanes.position[axis, 0]
        row[VELOCITY + axis] = lanes.velocity[axis, 0]
        row[TARGET + axis] = lanes.target[axis, 0]
        row[BORESIGHT + axis] = lanes.boresight[axis, 0]
    flat = lanes.sun_height[0, 0]
    row[SUN], row[SUN + 1], row[SUN + 2] = (
        flat * lanes.sun[0, 0],
        flat * lanes.sun[1, 0],
        lanes.sun_height[1, 0],
    )
    row[NUM_INSPECTED] = lanes.num_counted[0] - lanes.num_unseen[0]
    row[NUM_CANDIDATES] = lanes.num_candidates[0]
    row[SPENT] = lanes.spent[0]
    row[LEFT] = (world.num_controls - k) * world.control_period
    row[NUM_UNSEEN] = lanes.num_unseen[0]
    row[OUTSIDE] = lanes.beyond[0]
    row[NUM_ACTED] = lanes.num_acted[0]
    row[CORRECTED] = lanes.corrected[0]


@compiled(nogil=True, error_model="numpy")
def step_many(
    world: World,
    optics: Beyond | None,
    guard: Guard | None,
    clusters: bool | None,
    model_errors: ModelErrors | None,
    cases: Any,
    counted: Bytes,
    work: Workspace,
    carried: Carried,
    samples: Integers,
    forces: Floats,
    silent: FlightLog,
    observed: Floats,
) -> None:
    """Fly every flight by a control period, or start it; see `fly_many` for what may be None.

    Parameters
    ----------
    cases : (n,) starts, of `CASE`
    counted : (n, P padded) 1 for the points that a flight is about
    samples : (n,) sample of each flight, `NOT_STARTED` for those to be started; incremented
    forces : (n, 3) N, Hill axes
    observed : (n, NUM_OBSERVED), filled
    """
    world, cases, counted, work, carried = borrowed((world, cases, counted, work, carried))
    for flight in range(len(samples)):
        own, k = workspace_of(work, carried, flight), samples[flight]
        if k == NOT_STARTED:
            start_lanes(world, own, cases, counted, flight, 1)
        else:
            act(world, guard, model_errors, own, forces[flight], flight, k, silent)
        k += 1
        look_about(world, optics, clusters, model_errors, own, flight, k, silent)
        write_observed(world, own, k, observed[flight])
        samples[flight] = k
