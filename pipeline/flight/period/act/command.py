"""What becomes of a command where the deputy knows little: noted for its filter, then carried out."""

from fis_tools.compiled.decorator import compiled
from fis_tools.compiled.vectors import load, splat, store, width_of
from pipeline.flight.period.act.actuators import in_impulses
from pipeline.flight.period.look.navigation import times_turn
from pipeline.flight.period.look.sight import to_body, to_hill
from pipeline.flight.state.arrays import Workspace, World
from pipeline.flight.state.errors import Firing, Fixes
from pipeline.flight.state.lanes import clip, four, three, write_four, write_three
from pipeline.flight.state.log import FlightLog


@compiled(error_model="numpy")
def turn_out_so(world: World, fixes: Fixes, work: Workspace, k: int, log: FlightLog) -> None:
    """Restore the true attitude, shift the aim by the sensing error, and rotate the thrust."""
    lanes, turn = work.lanes, four(fixes.lanes.turn)
    true, meant = four(fixes.lanes.attitude), to_body(four(lanes.attitude), three(lanes.force))
    fx, fy, fz = to_hill(true, meant)
    limit = world.max_force
    write_three(lanes.force, 0, clip(fx, limit), clip(fy, limit), clip(fz, limit))
    write_four(lanes.attitude, *true)
    for j in range(world.num_attitude_steps):
        write_four(work.aims[j].attitude, *times_turn(four(work.aims[j].attitude), turn, -1.0))
    if len(log.position_m) > 0:
        for axis in range(3):
            log.force_hill_n[k, axis] = lanes.force[axis, 0]


@compiled(error_model="numpy")
def recover_truth(world: World, fixes: Fixes, work: Workspace, k: int, log: FlightLog) -> None:
    """Restore the truth, once the deputy is aimed and its command is stored."""
    width = width_of(work.lanes)
    for row in range(3):
        store(work.lanes.position, row, load(fixes.lanes.truth, row, width))
        store(work.lanes.velocity, row, load(fixes.lanes.truth, 3 + row, width))
    if fixes.of_attitude.shape[1] > 0:
        turn_out_so(world, fixes, work, k, log)


@compiled(error_model="numpy")
def note_command(fixes: Fixes, firing: Firing, work: Workspace, k: int, num_controls: int) -> None:
    """Store the command of a sample for the period in which it acts, as the force of ideal thrusters."""
    width = width_of(work.lanes)
    delay = firing.delay
    for axis in range(3):
        force = load(work.lanes.force, axis, width)
        if firing.is_on and len(firing.table) == 0:
            force = in_impulses(force, firing.step, firing.least)
        if k < delay:
            store(fixes.acting, (k, axis, 0), splat(0.0, width))
        if k + delay < num_controls:
            store(fixes.acting, (k + delay, axis, 0), force)
