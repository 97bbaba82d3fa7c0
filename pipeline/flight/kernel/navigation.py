"""Navigation by fixes on lanes: what the deputies believe takes the place of the truth while they decide.

`pipeline.flight.navigation` has the filter's law. While a deputy senses, decides and aims, `lanes.position`
and `lanes.velocity` are its estimate; while it is seen, judged and moved, they are the truth.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fis_tools.engines.compiled import compiled
from fis_tools.engines.kernel import LANES
from fis_tools.engines.vectors import load, select, splat, store
from pipeline.flight.kernel.arrays import Workspace, World
from pipeline.flight.kernel.lanes import three, write_three
from pipeline.flight.log import FlightLog
from pipeline.physics.motion import place_after, step_of, velocity_after

Floats = NDArray[np.float64]


class Fixes(NamedTuple):
    """Navigation of some flights: see `pipeline.flight.navigation.Filter` and `Errors`."""

    stride: int
    delay: int
    gains: Floats
    weights: Floats
    gate: float
    at_start: Floats
    of_fixes: Floats
    filtered: Floats  # (6, LANES) what the filter made of the fixes up to `delay` periods ago
    known: Floats  # (6, LANES) that, brought to now
    truth: Floats  # (6, LANES) while the estimate stands in its place
    fixes: Floats  # (F, 3, LANES) measured so far
    acting: Floats  # (K, 3, LANES) commanded forces, in the periods in which they act


@compiled(error_model="numpy", fastmath={"contract"})
def advance(world: World, fixes: Fixes, state: Floats, period: int) -> None:
    """Move an estimate through a control period under what was commanded."""
    step = step_of(world.motion, 0)
    x, y, z = three(state)
    u, v, w = load(state, 3, LANES), load(state, 4, LANES), load(state, 5, LANES)
    f = load(fixes.acting, (period, 0, 0), LANES)
    g = load(fixes.acting, (period, 1, 0), LANES)
    h = load(fixes.acting, (period, 2, 0), LANES)
    px, py, pz = place_after(step, x, y, z, u, v, w, f, g, h)
    vx, vy, vz = velocity_after(step, x, z, u, v, w, f, g, h)
    write_three(state, 0, px, py, pz)
    write_three(state, 3, vx, vy, vz)


@compiled(error_model="numpy", fastmath={"contract"})
def correct(fixes: Fixes, which: int) -> None:
    """Correct the filtered state by a fix, unless it lies beyond the gate."""
    state, gain, weight = fixes.filtered, fixes.gains[which], fixes.weights[which]
    x, y, z = three(state)
    dx = load(fixes.fixes, (which, 0, 0), LANES) - x
    dy = load(fixes.fixes, (which, 1, 0), LANES) - y
    dz = load(fixes.fixes, (which, 2, 0), LANES) - z
    square = (weight[0, 0] * dx + weight[0, 1] * dy + weight[0, 2] * dz) * dx
    square += (weight[1, 0] * dx + weight[1, 1] * dy + weight[1, 2] * dz) * dy
    square += (weight[2, 0] * dx + weight[2, 1] * dy + weight[2, 2] * dz) * dz
    is_believed = square <= fixes.gate
    for row in range(6):
        before = load(state, row, LANES)
        change = gain[row, 0] * dx + gain[row, 1] * dy + gain[row, 2] * dz
        store(state, row, select(is_believed, before + change, before))


@compiled(error_model="numpy", fastmath={"contract"})
def believe(
    world: World, fixes: Fixes, work: Workspace, first: int, num_lanes: int, k: int, log: FlightLog
) -> None:
    """Measure, filter, and put what is known in the place of the truth, until `recover_truth`."""
    lanes = work.lanes
    for lane in range(LANES):
        case = first + min(lane, num_lanes - 1)
        for axis in range(3):
            place, speed = lanes.position[axis, lane], lanes.velocity[axis, lane]
            fixes.truth[axis, lane], fixes.truth[3 + axis, lane] = place, speed
            if k == 0:
                fixes.filtered[axis, lane] = place + fixes.at_start[case, axis]
                fixes.filtered[3 + axis, lane] = speed + fixes.at_start[case, 3 + axis]
            if k % fixes.stride == 0:
                which = k // fixes.stride
                fixes.fixes[which, axis, lane] = place + fixes.of_fixes[case, which, axis]
    of_filter = k - fixes.delay  # the sample up to which fixes are there
    if of_filter > 0:
        advance(world, fixes, fixes.filtered, of_filter - 1)
    if of_filter >= 0 and of_filter % fixes.stride == 0:
        correct(fixes, of_filter // fixes.stride)
    for row in range(6):
        store(fixes.known, row, load(fixes.filtered, row, LANES))
    for period in range(max(of_filter, 0), k):
        advance(world, fixes, fixes.known, period)
    for row in range(3):
        store(lanes.position, row, load(fixes.known, row, LANES))
        store(lanes.velocity, row, load(fixes.known, 3 + row, LANES))
    if len(log.position_m) > 0:
        for axis in range(3):
            log.estimated_position_m[k, axis] = fixes.known[axis, 0]
            log.estimated_velocity_m_s[k, axis] = fixes.known[3 + axis, 0]


@compiled(error_model="numpy", fastmath={"contract"})
def recover_truth(fixes: Fixes, work: Workspace) -> None:
    """Put the truth back."""
    for row in range(3):
        store(work.lanes.position, row, load(fixes.truth, row, LANES))
        store(work.lanes.velocity, row, load(fixes.truth, 3 + row, LANES))


@compiled(error_model="numpy", fastmath={"contract"})
def note_command(fixes: Fixes, work: Workspace, k: int, delay: int, num_controls: int) -> None:
    """Note when the command of a sample acts, as the deputy knows it."""
    if k < delay:
        for axis in range(3):
            store(fixes.acting, (k, axis, 0), splat(0.0, LANES))
    if k + delay < num_controls:
        for axis in range(3):
            store(fixes.acting, (k + delay, axis, 0), load(work.lanes.force, axis, LANES))
