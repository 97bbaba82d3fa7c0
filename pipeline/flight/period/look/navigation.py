"""Navigation by fixes, in lanes: what the deputies believe, from what is so.

`pipeline.flight.cases.navigation` describes the filter.
"""

from math import sqrt

from fis_tools.compiled.decorator import compiled
from fis_tools.compiled.three import (
    Three,
    cross,
    dot,
    lane_of,
    length,
    load_at,
    load_three,
    minus,
    plus,
    scaled,
    store_three,
    three_of,
    write_lane,
)
from fis_tools.compiled.vectors import Vector, load, select, splat, store, width_of
from pipeline.array_types import Floats
from pipeline.flight.state.arrays import Moment, State
from pipeline.flight.state.errors import Errors, Filter, Fixes
from pipeline.flight.state.lanes import flight_of, four, to_hill, turned, write_four
from pipeline.flight.state.log import FlightLog
from pipeline.physics.motion import place_after, step_of, velocity_after

#: factor by which a rejected fix widens the covariance: after a few in a row the filter, not the fix, is
#: assumed to be wrong, and fixes are accepted again
WIDER = 4.0


@compiled(error_model="numpy")
def entry(matrix: Floats, row: int, column: int) -> Vector:
    """Return an entry of the matrices of all lanes."""
    return load(matrix, (row, column, 0), width_of(matrix))


@compiled(error_model="numpy")
def propagate_covariance(now: Moment, law: Filter, covariance: Floats, period: int) -> None:
    """Propagate covariances through a control period: ``P <- Phi P Phi' + Q``."""
    width = width_of(now.state.estimate)
    phi, half = now.world.motion.transition, now.state.estimate.half
    force = load_at(now.state.acting, period, width)
    square = dot(force, force)
    for row in range(6):
        for column in range(6):
            entries = splat(0.0, width)
            for i in range(6):
                entries += phi[0, row, i] * entry(covariance, i, column)
            store(half, (row, column, 0), entries)
    for row in range(6):
        for column in range(row, 6):
            entries = law.process[row, column] + law.process_per_force[row, column] * square
            for i in range(6):
                entries += entry(half, row, i) * phi[0, column, i]
            store(covariance, (row, column, 0), entries)
            store(covariance, (column, row, 0), entries)


@compiled(error_model="numpy")
def advance(now: Moment, estimate: Floats, period: int) -> None:
    """Propagate an estimate, shape (6, L), through a control period under the commanded forces."""
    step, force = step_of(now.world.motion, 0), load_at(now.state.acting, period, width_of(estimate))
    place, velocity = load_three(estimate, 0), load_three(estimate, 3)
    store_three(estimate, 0, place_after(step, place, velocity, force))
    store_three(estimate, 3, velocity_after(step, place, velocity, force))


@compiled(error_model="numpy")
def correct(law: Filter, state: State, which: int) -> None:
    """Correct the filtered state by a fix, unless the fix is beyond the gate: ``K = P H' S^-1``."""
    filtered, p, gain = state.estimate.filtered, state.estimate.covariance, state.estimate.half
    x, y, z = load_three(filtered, 0)
    dx, dy, dz = minus(load_at(state.fixes, which, width_of(filtered)), Three(x, y, z))
    # the inverse of S, which is symmetric, by cofactors; a fix has one variance across the line of sight and
    # another along it
    square = x * x + y * y + z * z
    across = law.fix + law.bearing * square
    more = (law.range - law.bearing * square) / square
    a, b = entry(p, 0, 0) + across + more * x * x, entry(p, 0, 1) + more * x * y
    c, d = entry(p, 0, 2) + more * x * z, entry(p, 1, 1) + across + more * y * y
    e, f = entry(p, 1, 2) + more * y * z, entry(p, 2, 2) + across + more * z * z
    aa, ab, ac = d * f - e * e, c * e - b * f, b * e - c * d
    bb, bc, cc = a * f - c * c, b * c - a * e, a * d - b * b
    scale = 1.0 / (a * aa + b * ab + c * ac)
    # S^-1 times the difference
    wx = (aa * dx + ab * dy + ac * dz) * scale
    wy = (ab * dx + bb * dy + bc * dz) * scale
    wz = (ac * dx + bc * dy + cc * dz) * scale
    is_believed = wx * dx + wy * dy + wz * dz <= law.gate
    for row in range(6):
        px, py, pz = entry(p, row, 0), entry(p, row, 1), entry(p, row, 2)
        before = load(filtered, row, width_of(filtered))
        store(filtered, row, select(is_believed, before + (px * wx + py * wy + pz * wz), before))
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
def measured(state: State, errors: Floats, lane: int, place: Three) -> Three:
    """Return a lane's fix from a range and a bearing with errors, a row of `Errors.of_sight`."""
    turned_by = plus(Three(errors[1], errors[2], errors[3]), lane_of(state.estimate.tilt, 0, lane))
    towards = plus(place, cross(turned_by, place))
    scale = (length(place) + errors[0]) / length(towards)
    return scaled(scale, towards)


@compiled(error_model="numpy")
def note_turn(now: Moment, errors: Errors) -> None:
    """Store the rotation from the true attitudes to the sensed ones from sample k on."""
    turn = now.state.estimate.turn
    for lane in range(width_of(now.state.estimate)):
        error = three_of(errors.of_attitude[flight_of(now, lane), now.k])
        scale = 1.0 / sqrt(1.0 + 0.25 * dot(error, error))
        write_lane(turn, 0, lane, Three(0.5 * error.x * scale, 0.5 * error.y * scale, 0.5 * error.z * scale))
        turn[3, lane] = scale


@compiled(error_model="numpy")
def point_beside(now: Moment, errors: Errors) -> None:
    """Set the attitudes of ideally pointing deputies, with the sensing error."""
    if errors.of_attitude.shape[1] > 0:
        note_turn(now, errors)
        attitude = now.state.truth.attitude
        write_four(attitude, turned(four(attitude), four(now.state.estimate.turn), -1.0))


@compiled(error_model="numpy")
def sense_attitude(now: Moment, errors: Errors) -> None:
    """Write the sensed attitude and boresight."""
    state, belief = now.state, now.state.belief
    q = four(state.truth.attitude)
    if errors.of_attitude.shape[1] == 0:
        write_four(belief.attitude, q)
        store_three(belief.boresight, 0, load_three(state.truth.boresight, 0))
        return
    note_turn(now, errors)
    a, b, c, d = four(state.estimate.turn)
    sensed = turned(q, (a, b, c, d), 1.0)
    write_four(belief.attitude, sensed)
    store_three(belief.boresight, 0, to_hill(sensed, three_of(now.world.boresight)))
    # angles are twice the ratio of the quaternion's components
    store_three(state.estimate.tilt, 0, to_hill(q, Three(2.0 * a / d, 2.0 * b / d, 2.0 * c / d)))


@compiled(error_model="numpy")
def start_estimate(now: Moment, fixes: Fixes) -> None:
    """Make the first estimates, and their covariances."""
    state = now.state
    filtered, width = state.estimate.filtered, width_of(state.estimate)
    for lane in range(width):
        error = fixes.errors.at_start[flight_of(now, lane)]
        for axis in range(3):
            filtered[axis, lane] = state.truth.position[axis, lane] + error[axis]
            filtered[3 + axis, lane] = state.truth.velocity[axis, lane] + error[3 + axis]
    for row in range(6):
        for column in range(6):
            covariance = splat(fixes.law.at_start[row, column], width)
            store(state.estimate.covariance, (row, column, 0), covariance)


@compiled(error_model="numpy")
def measure(now: Moment, errors: Errors, which: int) -> None:
    """Take a fix of the true positions."""
    state = now.state
    for lane in range(width_of(state.estimate)):
        case, place = flight_of(now, lane), lane_of(state.truth.position, 0, lane)
        if errors.of_sight.shape[1] > 0:
            place = measured(state, errors.of_sight[case, which], lane, place)
        write_lane(state.fixes[which], 0, lane, plus(place, three_of(errors.of_fixes[case, which])))


@compiled(error_model="numpy")
def write_estimate(now: Moment, law: Filter, log: FlightLog) -> None:
    """Log lane 0's estimate and its covariance."""
    estimate, k = now.state.estimate, now.k
    for row in range(6):
        for column in range(6):
            store(estimate.now, (row, column, 0), entry(estimate.covariance, row, column))
    for period in range(max(k - law.delay, 0), k):
        propagate_covariance(now, law, estimate.now, period)
    for row in range(6):
        log.estimate[k, row] = estimate.known[row, 0]
        for column in range(6):
            log.estimate_covariance[k, row, column] = estimate.now[row, column, 0]


@compiled(error_model="numpy")
def navigate(now: Moment, fixes: Fixes) -> None:
    """Measure, filter, and write what the deputies believe at sample k."""
    state, law, k = now.state, fixes.law, now.k
    estimate, width = state.estimate, width_of(state.estimate)
    sense_attitude(now, fixes.errors)
    if k == 0:
        start_estimate(now, fixes)
    if k % law.stride == 0:
        measure(now, fixes.errors, k // law.stride)
    filtered_to = k - law.delay
    if filtered_to > 0:
        advance(now, estimate.filtered, filtered_to - 1)
        propagate_covariance(now, law, estimate.covariance, filtered_to - 1)
    if filtered_to >= 0 and filtered_to % law.stride == 0:
        correct(law, state, filtered_to // law.stride)
    for row in range(6):
        store(estimate.known, row, load(estimate.filtered, row, width))
    for period in range(max(filtered_to, 0), k):
        advance(now, estimate.known, period)
    store_three(state.belief.position, 0, load_three(estimate.known, 0))
    store_three(state.belief.velocity, 0, load_three(estimate.known, 3))


@compiled(error_model="numpy", forceinline=True)
def know_all(state: State) -> None:
    """Write what is so as what the deputies believe."""
    store_three(state.belief.position, 0, load_three(state.truth.position, 0))
    store_three(state.belief.velocity, 0, load_three(state.truth.velocity, 0))
    store_three(state.belief.boresight, 0, load_three(state.truth.boresight, 0))
    write_four(state.belief.attitude, four(state.truth.attitude))
