"""Navigation by fixes, in lanes: the estimates replace the true states while the deputies decide.

`pipeline.flight.cases.navigation` describes the filter. While a deputy senses, decides and aims,
`lanes.position` and `lanes.velocity` are its estimate; during inspection, evaluation and motion they are the
truth.
"""

from math import sqrt

import numpy as np
from numpy.typing import NDArray

from fis_tools.compiled.decorator import compiled
from fis_tools.compiled.vectors import Vector, load, select, splat, store, width_of
from pipeline.flight.period.look.sight import to_hill
from pipeline.flight.state.arrays import Workspace, World
from pipeline.flight.state.errors import Fixes
from pipeline.flight.state.lanes import four, three, write_four, write_three
from pipeline.flight.state.log import FlightLog
from pipeline.physics.motion import place_after, step_of, velocity_after

Floats = NDArray[np.float64]

#: factor by which a rejected fix widens the covariance: after a few in a row the filter, not the fix, is
#: assumed to be wrong, and fixes are accepted again
WIDER = 4.0


@compiled(error_model="numpy")
def entry(matrix: Floats, row: int, column: int) -> Vector:
    """Return an entry of the matrices of all lanes."""
    return load(matrix, (row, column, 0), width_of(matrix))


@compiled(error_model="numpy")
def spread_out(world: World, fixes: Fixes, covariance: Floats, period: int) -> None:
    """Propagate covariances through a control period: ``P <- Phi P Phi' + Q``."""
    width = width_of(fixes.lanes)
    phi, half = world.motion.transition, fixes.lanes.half
    f = load(fixes.acting, (period, 0, 0), width)
    g = load(fixes.acting, (period, 1, 0), width)
    h = load(fixes.acting, (period, 2, 0), width)
    square = f * f + g * g + h * h
    for row in range(6):
        for column in range(6):
            entries = splat(0.0, width)
            for i in range(6):
                entries += phi[0, row, i] * entry(covariance, i, column)
            store(half, (row, column, 0), entries)
    for row in range(6):
        for column in range(row, 6):
            entries = fixes.process[row, column] + fixes.process_per_force[row, column] * square
            for i in range(6):
                entries += entry(half, row, i) * phi[0, column, i]
            store(covariance, (row, column, 0), entries)
            store(covariance, (column, row, 0), entries)


@compiled(error_model="numpy")
def advance(world: World, fixes: Fixes, state: Floats, period: int) -> None:
    """Propagate an estimate through a control period under the commanded forces."""
    width = width_of(fixes.lanes)
    step = step_of(world.motion, 0)
    x, y, z = three(state)
    u, v, w = load(state, 3, width), load(state, 4, width), load(state, 5, width)
    f = load(fixes.acting, (period, 0, 0), width)
    g = load(fixes.acting, (period, 1, 0), width)
    h = load(fixes.acting, (period, 2, 0), width)
    px, py, pz = place_after(step, x, y, z, u, v, w, f, g, h)
    vx, vy, vz = velocity_after(step, x, z, u, v, w, f, g, h)
    write_three(state, 0, px, py, pz)
    write_three(state, 3, vx, vy, vz)


@compiled(error_model="numpy")
def correct(fixes: Fixes, which: int) -> None:
    """Correct the filtered state by a fix, unless the fix is beyond the gate: ``K = P H' S^-1``."""
    width = width_of(fixes.lanes)
    state, p, gain = fixes.lanes.filtered, fixes.lanes.covariance, fixes.lanes.half
    x, y, z = three(state)
    dx = load(fixes.fixes, (which, 0, 0), width) - x
    dy = load(fixes.fixes, (which, 1, 0), width) - y
    dz = load(fixes.fixes, (which, 2, 0), width) - z
    # the inverse of S, which is symmetric, by cofactors; a fix has one variance across the line of sight and
    # another along it
    square = x * x + y * y + z * z
    across = fixes.fix + fixes.bearing * square
    more = (fixes.range - fixes.bearing * square) / square
    a, b, c = (
        entry(p, 0, 0) + across + more * x * x,
        entry(p, 0, 1) + more * x * y,
        entry(p, 0, 2) + more * x * z,
    )
    d, e = entry(p, 1, 1) + across + more * y * y, entry(p, 1, 2) + more * y * z
    f = entry(p, 2, 2) + across + more * z * z
    aa, ab, ac = d * f - e * e, c * e - b * f, b * e - c * d
    bb, bc, cc = a * f - c * c, b * c - a * e, a * d - b * b
    scale = 1.0 / (a * aa + b * ab + c * ac)
    # S^-1 times the difference
    wx = (aa * dx + ab * dy + ac * dz) * scale
    wy = (ab * dx + bb * dy + bc * dz) * scale
    wz = (ac * dx + bc * dy + cc * dz) * scale
    is_believed = wx * dx + wy * dy + wz * dz <= fixes.gate
    for row in range(6):
        px, py, pz = entry(p, row, 0), entry(p, row, 1), entry(p, row, 2)
        before = load(state, row, width)
        store(state, row, select(is_believed, before + (px * wx + py * wy + pz * wz), before))
        store(gain, (row, 0, 0), (px * aa + py * ab + pz * ac) * scale)
        store(gain, (row, 1, 0), (px * ab + py * bb + pz * bc) * scale)
        store(gain, (row, 2, 0), (px * ac + py * bc + pz * cc) * scale)
    # P <- P - K H P, below the diagonal by symmetry
    for row in range(5, -1, -1):
        kx, ky, kz = entry(gain, row, 0), entry(gain, row, 1), entry(gain, row, 2)
        for column in range(row + 1):
            before = entry(p, column, row)
            less = kx * entry(p, 0, column) + ky * entry(p, min(1, column), max(1, column))
            less += kz * entry(p, min(2, column), max(2, column))
            store(p, (row, column, 0), select(is_believed, before - less, WIDER * before))
    for row in range(6):
        for column in range(row):
            store(p, (column, row, 0), entry(p, row, column))


@compiled(error_model="numpy")
def measured(
    fixes: Fixes, which: int, case: int, lane: int, x: float, y: float, z: float
) -> tuple[float, float, float]:
    """Return the fix of a lane from range and bearing, as `pipeline.flight.cases.navigation.measured`."""
    tilt, errors = fixes.lanes.tilt, fixes.of_sight[case, which]
    wx, wy, wz = errors[1] + tilt[0, lane], errors[2] + tilt[1, lane], errors[3] + tilt[2, lane]
    tx, ty, tz = x + (wy * z - wz * y), y + (wz * x - wx * z), z + (wx * y - wy * x)
    scale = (sqrt(x * x + y * y + z * z) + errors[0]) / sqrt(tx * tx + ty * ty + tz * tz)
    return tx * scale, ty * scale, tz * scale


@compiled(error_model="numpy", forceinline=True)
def times_turn(
    q: tuple[Vector, Vector, Vector, Vector], turn: tuple[Vector, Vector, Vector, Vector], way: float
) -> tuple[Vector, Vector, Vector, Vector]:
    """Return attitudes turned about their body axes, or turned back if way is -1."""
    q1, q2, q3, q4 = q
    a, b, c, d = way * turn[0], way * turn[1], way * turn[2], turn[3]
    return (
        q4 * a + q1 * d + q2 * c - q3 * b,
        q4 * b + q2 * d + q3 * a - q1 * c,
        q4 * c + q3 * d + q1 * b - q2 * a,
        q4 * d - q1 * a - q2 * b - q3 * c,
    )


@compiled(error_model="numpy")
def note_turn(fixes: Fixes, first: int, num_lanes: int, k: int) -> None:
    """Store the rotation from the true attitudes to the sensed ones from sample k on."""
    width = width_of(fixes.lanes)
    for lane in range(width):
        error = fixes.of_attitude[first + min(lane, num_lanes - 1), k]
        scale = 1.0 / sqrt(1.0 + 0.25 * (error[0] * error[0] + error[1] * error[1] + error[2] * error[2]))
        for axis in range(3):
            fixes.lanes.turn[axis, lane] = 0.5 * error[axis] * scale
        fixes.lanes.turn[3, lane] = scale


@compiled(error_model="numpy")
def point_beside(fixes: Fixes, work: Workspace, first: int, num_lanes: int, k: int) -> None:
    """Set the attitudes of ideally pointing deputies, with the sensing error."""
    if fixes.of_attitude.shape[1] > 0:
        note_turn(fixes, first, num_lanes, k)
        turned = times_turn(four(work.lanes.attitude), four(fixes.lanes.turn), -1.0)
        write_four(work.lanes.attitude, *turned)


@compiled(error_model="numpy")
def sense_attitude(world: World, fixes: Fixes, work: Workspace, first: int, num_lanes: int, k: int) -> None:
    """Set the true attitude aside and put the sensed one in its place."""
    width = width_of(work.lanes)
    note_turn(fixes, first, num_lanes, k)
    q = four(work.lanes.attitude)
    write_four(fixes.lanes.attitude, *q)
    sensed = times_turn(q, four(fixes.lanes.turn), 1.0)
    write_four(work.lanes.attitude, *sensed)
    b1, b2, b3 = world.boresight[0], world.boresight[1], world.boresight[2]
    boresight = splat(b1, width), splat(b2, width), splat(b3, width)
    write_three(work.lanes.boresight, 0, *to_hill(sensed, boresight))
    a, b, c, d = four(fixes.lanes.turn)
    # angles are twice the ratio of the quaternion's components
    write_three(fixes.lanes.tilt, 0, *to_hill(q, (2.0 * a / d, 2.0 * b / d, 2.0 * c / d)))


@compiled(error_model="numpy")
def measure(fixes: Fixes, work: Workspace, first: int, num_lanes: int, k: int) -> None:
    """Set the truth aside, and measure it where a fix is due; at the start, make the first estimates."""
    width = width_of(work.lanes)
    lanes = work.lanes
    for lane in range(width):
        case = first + min(lane, num_lanes - 1)
        for axis in range(3):
            place, speed = lanes.position[axis, lane], lanes.velocity[axis, lane]
            fixes.lanes.truth[axis, lane], fixes.lanes.truth[3 + axis, lane] = place, speed
            if k == 0:
                fixes.lanes.filtered[axis, lane] = place + fixes.at_start[case, axis]
                fixes.lanes.filtered[3 + axis, lane] = speed + fixes.at_start[case, 3 + axis]
            if k % fixes.stride == 0:
                which = k // fixes.stride
                fixes.fixes[which, axis, lane] = place + fixes.of_fixes[case, which, axis]
        if k % fixes.stride == 0 and fixes.of_sight.shape[1] > 0:
            which = k // fixes.stride
            x, y, z = lanes.position[0, lane], lanes.position[1, lane], lanes.position[2, lane]
            x, y, z = measured(fixes, which, case, lane, x, y, z)
            fixes.fixes[which, 0, lane] = x + fixes.of_fixes[case, which, 0]
            fixes.fixes[which, 1, lane] = y + fixes.of_fixes[case, which, 1]
            fixes.fixes[which, 2, lane] = z + fixes.of_fixes[case, which, 2]
    if k == 0:
        for row in range(6):
            for column in range(6):
                store(
                    fixes.lanes.covariance,
                    (row, column, 0),
                    splat(fixes.start_covariance[row, column], width),
                )


@compiled(error_model="numpy")
def write_estimate(world: World, fixes: Fixes, work: Workspace, k: int, log: FlightLog) -> None:
    """Log lane 0's estimate and its covariance."""
    for row in range(6):
        for column in range(6):
            store(fixes.lanes.now, (row, column, 0), entry(fixes.lanes.covariance, row, column))
    for period in range(max(k - fixes.delay, 0), k):
        spread_out(world, fixes, fixes.lanes.now, period)
    for component in range(4):
        log.sensed_quaternion_b_from_h[k, component] = work.lanes.attitude[component, 0]
    for row in range(6):
        log.estimate[k, row] = fixes.lanes.known[row, 0]
        for column in range(6):
            log.estimate_covariance[k, row, column] = fixes.lanes.now[row, column, 0]


@compiled(error_model="numpy")
def believe(
    world: World, fixes: Fixes, work: Workspace, first: int, num_lanes: int, k: int, log: FlightLog
) -> None:
    """Measure, filter, and put the estimate in the place of the truth, until `recover_truth`."""
    width = width_of(work.lanes)
    if fixes.of_attitude.shape[1] > 0:
        sense_attitude(world, fixes, work, first, num_lanes, k)
    measure(fixes, work, first, num_lanes, k)
    filtered_to = k - fixes.delay
    if filtered_to > 0:
        advance(world, fixes, fixes.lanes.filtered, filtered_to - 1)
        spread_out(world, fixes, fixes.lanes.covariance, filtered_to - 1)
    if filtered_to >= 0 and filtered_to % fixes.stride == 0:
        correct(fixes, filtered_to // fixes.stride)
    for row in range(6):
        store(fixes.lanes.known, row, load(fixes.lanes.filtered, row, width))
    for period in range(max(filtered_to, 0), k):
        advance(world, fixes, fixes.lanes.known, period)
    for row in range(3):
        store(work.lanes.position, row, load(fixes.lanes.known, row, width))
        store(work.lanes.velocity, row, load(fixes.lanes.known, 3 + row, width))
    if len(log.position_m) > 0:
        write_estimate(world, fixes, work, k, log)
