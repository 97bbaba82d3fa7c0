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
    same,
    scaled,
    store_at,
    store_three,
    three_of,
    write_lane,
)
from fis_tools.compiled.vectors import Vector, load, select, splat, store, width_of
from pipeline.array_types import Floats
from pipeline.flight.state.arrays import Moment, State
from pipeline.flight.state.errors import OF_ATTITUDE, OF_FIXES, OF_ROTATION, OF_SQUARES, Errors, Filter, Fixes
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


@compiled(error_model="numpy", forceinline=True)
def unit(axis: int) -> Three:
    """Return the unit vector of an axis, of numbers."""
    return Three(1.0 * (axis == 0), 1.0 * (axis == 1), 1.0 * (axis == 2))


@compiled(error_model="numpy")
def force_of(law: Filter, state: State, which: int, force: Three, period: int) -> Three:
    """Return the force of a unit constant error in a control period, to first order, N."""
    width, error = width_of(state.estimate), law.constants[which]
    if error >= OF_ATTITUDE:
        # thrusters turn with the true body
        sensed = 3 * max(0, period - law.command_delay)
        return cross(force, load_at(state.sensed, sensed + error - OF_ATTITUDE, width))
    axis = unit(error % 3)
    if error >= OF_ROTATION:
        return cross(scaled(splat(1.0, width), axis), force)
    return Three(axis.x * force.x, axis.y * force.y, axis.z * force.z)


@compiled(error_model="numpy")
def shift_of(law: Filter, state: State, which: int, fix: int, place: Three) -> Three:
    """Return how far a unit constant error shifts a fix, m."""
    width, error = width_of(state.estimate), law.constants[which]
    if error >= OF_SQUARES:
        axis = load_at(state.sensed, 3 * fix * law.stride + error - OF_SQUARES, width)
        return scaled(length(place), axis)
    if error >= OF_FIXES:
        return scaled(splat(1.0, width), unit(error - OF_FIXES))
    if error >= OF_ATTITUDE and law.is_sight:
        return cross(load_at(state.sensed, 3 * fix * law.stride + error - OF_ATTITUDE, width), place)
    return same(0.0, width)


@compiled(error_model="numpy")
def propagate_covariance(now: Moment, law: Filter, covariance: Floats, period: int) -> None:
    """Propagate covariances through a control period.

    With G the pushes of constant errors of variances V on the state, ``C <- Phi C + G V`` and
    ``P <- Phi P Phi' + Phi C_before G' + G C' + Q``.
    """
    state, phi, gamma = now.state, now.world.motion.transition[0], now.world.motion.control[0]
    width, half, pushes = width_of(state.estimate), state.estimate.half, state.estimate.pushes
    force, has_fired = load_at(state.acting, period, width), load_at(state.has_fired, period, width)
    count = 6 + len(law.constants)
    square = dot(force, force)
    for row in range(6):
        for column in range(count):
            entries = splat(0.0, width)
            for i in range(6):
                entries += phi[row, i] * entry(covariance, i, column)
            store(half, (row, column, 0), entries)
    for which in range(len(law.constants)):
        x, y, z = same(0.0, width)
        if law.constants[which] < OF_FIXES:
            x, y, z = force_of(law, state, which, force, period)
            x, y, z = x * has_fired.x, y * has_fired.y, z * has_fired.z
        for row in range(6):
            push = gamma[row, 0] * x + gamma[row, 1] * y + gamma[row, 2] * z
            store(pushes, (row, which, 0), push)
            more = entry(half, row, 6 + which) + law.variances[which] * push
            store(covariance, (row, 6 + which, 0), more)
    for row in range(6):
        for column in range(row, 6):
            entries = law.process[row, column] + law.process_per_force[row, column] * square
            for i in range(6):
                entries += entry(half, row, i) * phi[column, i]
            for which in range(len(law.constants)):
                entries += entry(half, row, 6 + which) * entry(pushes, column, which)
                entries += entry(pushes, row, which) * entry(covariance, column, 6 + which)
            store(covariance, (row, column, 0), entries)
            store(covariance, (column, row, 0), entries)


@compiled(error_model="numpy")
def advance(now: Moment, estimate: Floats, period: int) -> None:
    """Propagate an estimate, shape (6, L), through a control period under the commanded forces."""
    step, force = step_of(now.world.motion, 0), load_at(now.state.acting, period, width_of(estimate))
    place, velocity = load_three(estimate, 0), load_three(estimate, 3)
    store_three(estimate, 0, place_after(step, place, velocity, force))
    store_three(estimate, 3, velocity_after(step, place, velocity, force))


@compiled(error_model="numpy", forceinline=True)
def inverse(first: Three, second: Three, third: Three) -> tuple[Three, Three, Three]:
    """Return the rows of the inverse of a symmetric matrix, by cofactors."""
    x, y, z = cross(second, third), cross(third, first), cross(first, second)
    scale = 1.0 / dot(first, x)
    return scaled(scale, x), scaled(scale, y), scaled(scale, z)


@compiled(error_model="numpy")
def correct(law: Filter, state: State, fix: int) -> None:
    """Correct the filtered state by a fix, unless the fix is beyond the gate.

    With N the shifts of a fix by constant errors, ``L = P H' + C N'``, ``M = H C + N V``,
    ``S = H L + N M' + R`` and ``K = L S^-1``: ``P <- P - K L'`` and ``C <- C - K M``.
    """
    estimate, count = state.estimate, len(law.constants)
    filtered, p, work, width = estimate.filtered, estimate.covariance, estimate.half, width_of(estimate)
    place = load_three(filtered, 0)
    x, y, z = place
    off = minus(load_at(state.fixes, fix, width), place)
    for row in range(6):
        for axis in range(3):
            store(work, (row, axis, 0), entry(p, row, axis))
    # a fix has one variance across the line of sight and another along it
    square = x * x + y * y + z * z
    across = law.fix + law.bearing * square
    more = (law.range - law.bearing * square) / square
    a, b, c = across + more * x * x, more * x * y, more * x * z
    d, e, f = across + more * y * y, more * y * z, across + more * z * z
    for which in range(count):
        nx, ny, nz = shift_of(law, state, which, fix, place)
        for row in range(6):
            common = entry(p, row, 6 + which)
            store(work, (row, 0, 0), entry(work, row, 0) + common * nx)
            store(work, (row, 1, 0), entry(work, row, 1) + common * ny)
            store(work, (row, 2, 0), entry(work, row, 2) + common * nz)
        mx = entry(p, 0, 6 + which) + law.variances[which] * nx
        my = entry(p, 1, 6 + which) + law.variances[which] * ny
        mz = entry(p, 2, 6 + which) + law.variances[which] * nz
        store(work, (0, 6 + which, 0), mx)
        store(work, (1, 6 + which, 0), my)
        store(work, (2, 6 + which, 0), mz)
        a, b, c = a + nx * mx, b + nx * my, c + nx * mz
        d, e, f = d + ny * my, e + ny * mz, f + nz * mz
    a, b, c = a + entry(work, 0, 0), b + entry(work, 0, 1), c + entry(work, 0, 2)
    d, e, f = d + entry(work, 1, 1), e + entry(work, 1, 2), f + entry(work, 2, 2)
    first, second, third = inverse(Three(a, b, c), Three(b, d, e), Three(c, e, f))
    wx, wy, wz = dot(first, off), dot(second, off), dot(third, off)
    distance = wx * off.x + wy * off.y + wz * off.z
    is_believed = distance <= law.gate
    store_three(estimate.innovation, 0, off)
    store(estimate.innovation, 3, distance)
    for row in range(6):
        left = Three(entry(work, row, 0), entry(work, row, 1), entry(work, row, 2))
        before = load(filtered, row, width)
        store(filtered, row, select(is_believed, before + (left.x * wx + left.y * wy + left.z * wz), before))
        store(work, (row, 3, 0), dot(left, first))
        store(work, (row, 4, 0), dot(left, second))
        store(work, (row, 5, 0), dot(left, third))
    for row in range(6):
        kx, ky, kz = entry(work, row, 3), entry(work, row, 4), entry(work, row, 5)
        for column in range(row, 6):
            before = entry(p, row, column)
            less = kx * entry(work, column, 0) + ky * entry(work, column, 1) + kz * entry(work, column, 2)
            after = select(is_believed, before - less, WIDER * before)
            store(p, (row, column, 0), after)
            store(p, (column, row, 0), after)
        for column in range(6, 6 + count):
            before = entry(p, row, column)
            less = kx * entry(work, 0, column) + ky * entry(work, 1, column) + kz * entry(work, 2, column)
            store(p, (row, column, 0), select(is_believed, before - less, before))


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
        for column in range(6 + len(fixes.law.constants)):
            covariance = splat(fixes.law.at_start[row, column] if column < 6 else 0.0, width)
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


@compiled(error_model="numpy", forceinline=True)
def is_corrected(law: Filter, k: int) -> bool:
    """Return whether the filter takes a fix at sample k: one of `delay` periods before."""
    return k >= law.delay and (k - law.delay) % law.stride == 0


@compiled(error_model="numpy")
def write_estimate(now: Moment, law: Filter, log: FlightLog) -> None:
    """Log lane 0's estimate and its covariance, and the fix that comes into use."""
    estimate, k = now.state.estimate, now.k
    if is_corrected(law, k):
        for axis in range(3):
            log.fix_m[k, axis] = now.state.fixes[(k - law.delay) // law.stride, axis, 0]
            log.innovation_m[k, axis] = estimate.innovation[axis, 0]
        log.innovation_square[k] = estimate.innovation[3, 0]
    for row in range(6):
        for column in range(6 + len(law.constants)):
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
    for axis in range(3):
        store_at(state.sensed, 3 * k + axis, to_hill(four(state.belief.attitude), unit(axis)))
    if k == 0:
        start_estimate(now, fixes)
    if k % law.stride == 0:
        measure(now, fixes.errors, k // law.stride)
    filtered_to = k - law.delay
    if filtered_to > 0:
        advance(now, estimate.filtered, filtered_to - 1)
        propagate_covariance(now, law, estimate.covariance, filtered_to - 1)
    if is_corrected(law, k):
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
