"""Navigation by fixes, in lanes: the deputies' estimates, from their true states.

`pipeline.flight.cases.navigation` describes the filter.
"""

from math import sqrt

import numpy as np

from fis_tools.compiled.decorator import compiled
from fis_tools.compiled.three import (
    Three,
    cofactors,
    cross,
    dot,
    lane_of,
    length,
    load_at,
    load_three,
    same,
    store_at,
    store_three,
    three_of,
    write_lane,
)
from fis_tools.compiled.vectors import Vector, load, most, select, splat, store, width_of
from pipeline.array_types import Floats
from pipeline.flight.state.arrays import FlightState, Moment
from pipeline.flight.state.errors import (
    OF_ATTITUDE,
    OF_FIXES,
    OF_ROTATION,
    OF_SHORTENED,
    OF_SQUARES,
    Filter,
    Fixes,
    NavigationErrors,
)
from pipeline.flight.state.lanes import flight_of, load_quaternion, store_quaternion, write_row
from pipeline.flight.state.log import FlightLog
from pipeline.physics.motion import position_after, propagator_of, velocity_after
from pipeline.physics.quaternion import to_hill, turned
from pipeline.physics.transitions import follows_course, state_after

#: factor by which a rejected fix widens the covariance: after a few in a row the filter, not the fix, is
#: assumed to be wrong, and fixes are accepted again
WIDER = 4.0


@compiled(error_model="numpy")
def entry(matrix: Floats, row: int, column: int) -> Vector:
    """Return an entry of the matrices of all lanes."""
    return load(matrix, (row, column, 0), width_of(matrix))


@compiled(error_model="numpy", forceinline=True)
def column_of(matrix: Floats, column: int) -> Three:
    """Return the first three entries of a column of the matrices of all lanes."""
    return Three(entry(matrix, 0, column), entry(matrix, 1, column), entry(matrix, 2, column))


@compiled(error_model="numpy", forceinline=True)
def unit(axis: int) -> Three:
    """Return the unit vector of an axis, of numbers."""
    return Three(1.0 * (axis == 0), 1.0 * (axis == 1), 1.0 * (axis == 2))


@compiled(error_model="numpy", forceinline=True)
def fired_part(state: FlightState, period: int, force: Three) -> Three:
    """Return what remains of a force in a control period: nothing along axes on which nothing was fired."""
    has_fired = load_at(state.has_fired, period, 0, 0, width_of(state.estimate))
    return Three(force.x * has_fired.x, force.y * has_fired.y, force.z * has_fired.z)


@compiled(error_model="numpy")
def force_of(law: Filter, state: FlightState, index: int, force: Three, period: int) -> Three:
    """Return the force that a unit of a constant error adds in a control period, to first order, N."""
    width, error = width_of(state.estimate), law.constants[index]
    if error >= OF_ATTITUDE:
        # thrusters turn with the true body
        sensed = 3 * max(0, period - law.command_delay)
        if error >= OF_SHORTENED:
            along = load_at(state.sensed, sensed + error - OF_SHORTENED, 0, 0, width)
            return dot(along, force) * along
        return cross(force, load_at(state.sensed, sensed + error - OF_ATTITUDE, 0, 0, width))
    axis = unit(error % 3)
    if error >= OF_ROTATION:
        return cross(splat(1.0, width) * axis, force)
    return Three(axis.x * force.x, axis.y * force.y, axis.z * force.z)


@compiled(error_model="numpy")
def shift_of(law: Filter, state: FlightState, index: int, fix: int, position: Three) -> Three:
    """Return how far a unit of a constant error moves a fix, m, for the error's index in the filter."""
    width, error = width_of(state.estimate), law.constants[index]
    if error >= OF_SHORTENED:
        return same(0.0, width)
    if error >= OF_SQUARES:
        axis = load_at(state.sensed, 3 * fix * law.stride + error - OF_SQUARES, 0, 0, width)
        return length(position) * axis
    if error >= OF_FIXES:
        return same(0.0, width) + unit(error - OF_FIXES)
    if error >= OF_ATTITUDE and law.is_sight:
        return cross(load_at(state.sensed, 3 * fix * law.stride + error - OF_ATTITUDE, 0, 0, width), position)
    return same(0.0, width)


@compiled(error_model="numpy")
def propagate_covariance(now: Moment, law: Filter, covariance: Floats, period: int) -> None:
    """Propagate covariances through a control period.

    With G the pushes of constant errors of variances V on the state, ``C <- Phi C + G V`` and
    ``P <- Phi P Phi' + Phi C_before G' + G C' + Q``. The acceleration in Q grows with the distance, see
    `pipeline.flight.world.estimates.process_noise`.
    """
    state, phi, gamma = now.state, now.world.motion.transition[0], now.world.motion.control[0]
    if follows_course(now.world.transitions):
        phi, gamma = now.world.transitions.steps[period], now.world.transitions.pushes[period]
    width, half, pushes = width_of(state.estimate), state.estimate.half, state.estimate.pushes
    requested = load_at(state.acting, period, 0, 0, width)
    force = fired_part(state, period, requested)
    count = 6 + len(law.constants)
    square = dot(force, force)
    position = load_three(state.estimate.filtered, 0)
    share = law.nearest / law.farthest
    square_share = most(dot(position, position) / (law.farthest * law.farthest), share * share)
    growth = law.growth[0] + law.growth[1] * np.sqrt(square_share) + law.growth[2] * square_share
    growth = growth * growth
    for row in range(6):
        for column in range(count):
            entries = splat(0.0, width)
            for i in range(6):
                entries += phi[row, i] * entry(covariance, i, column)
            store(half, (row, column, 0), entries)
    for index in range(len(law.constants)):
        felt = same(0.0, width)
        if law.constants[index] < OF_FIXES or law.constants[index] >= OF_SHORTENED:
            felt = fired_part(state, period, force_of(law, state, index, requested, period))
        for row in range(6):
            push = dot(three_of(gamma[row]), felt)
            store(pushes, (row, index, 0), push)
            more = entry(half, row, 6 + index) + law.variances[index] * push
            store(covariance, (row, 6 + index, 0), more)
    for row in range(6):
        for column in range(row, 6):
            entries = law.process[row, column] * growth + law.process_per_force[row, column] * square
            for i in range(6):
                entries += entry(half, row, i) * phi[column, i]
            for index in range(len(law.constants)):
                entries += entry(half, row, 6 + index) * entry(pushes, column, index)
                entries += entry(pushes, row, index) * entry(covariance, column, 6 + index)
            store(covariance, (row, column, 0), entries)
            store(covariance, (column, row, 0), entries)


@compiled(error_model="numpy")
def advance(now: Moment, law: Filter, estimate: Floats, period: int) -> None:
    """Propagate an estimate, shape (6, L), through a control period under the commanded forces."""
    step, state = propagator_of(now.world.motion, 0), now.state
    force = law.kept * fired_part(state, period, load_at(state.acting, period, 0, 0, width_of(estimate)))
    position, velocity = load_three(estimate, 0), load_three(estimate, 3)
    if follows_course(now.world.transitions):
        position, velocity = state_after(now.world.transitions, period, position, velocity, force)
        store_three(estimate, 0, position)
        store_three(estimate, 3, velocity)
        return
    store_three(estimate, 0, position_after(step, position, velocity, force))
    store_three(estimate, 3, velocity_after(step, position, velocity, force))


@compiled(error_model="numpy")
def correct(law: Filter, state: FlightState, fix: int) -> None:
    """Correct the filtered state by a fix, unless the fix is beyond the gate.

    With N the shifts of a fix by constant errors, ``L = P H' + C N'``, ``M = H C + N V``,
    ``S = H L + N M' + R`` and ``K = L S^-1``: ``P <- P - K L'`` and ``C <- C - K M``.
    """
    estimate, count = state.estimate, len(law.constants)
    filtered, p, work, width = estimate.filtered, estimate.covariance, estimate.half, width_of(estimate)
    position = load_three(filtered, 0)
    residual = load_at(state.fixes, fix, 0, 0, width) - law.seen * position
    for row in range(6):
        store_at(work, row, 0, load_at(p, row, 0, 0, width))
    # a fix has one variance across the line of sight and another along it
    square = dot(position, position)
    across = law.fix + law.bearing * square
    more = (law.range - law.bearing * square) / square
    first = across * unit(0) + more * position.x * position
    second = across * unit(1) + more * position.y * position
    third = across * unit(2) + more * position.z * position
    for which in range(count):
        n = shift_of(law, state, which, fix, position)
        for row in range(6):
            common = entry(p, row, 6 + which) * n
            store_at(work, row, 0, load_at(work, row, 0, 0, width) + common)
        m = column_of(p, 6 + which) + law.variances[which] * n
        store(work, (0, 6 + which, 0), m.x)
        store(work, (1, 6 + which, 0), m.y)
        store(work, (2, 6 + which, 0), m.z)
        first, second, third = first + n.x * m, second + n.y * m, third + n.z * m
    first += load_at(work, 0, 0, 0, width)
    second += load_at(work, 1, 0, 0, width)
    third += load_at(work, 2, 0, 0, width)
    # symmetric, but for rounding
    second, third = Three(first.y, second.y, second.z), Three(first.z, second.z, third.z)
    x, y, z = cofactors(first, second, third)
    scale = 1.0 / dot(first, x)
    first, second, third = scale * x, scale * y, scale * z
    w = Three(dot(first, residual), dot(second, residual), dot(third, residual))
    distance = dot(w, residual)
    is_believed = distance <= law.gate
    store_three(estimate.innovation, 0, residual)
    store(estimate.innovation, 3, distance)
    for row in range(6):
        left, before = load_at(work, row, 0, 0, width), load(filtered, row, width)
        store(filtered, row, select(is_believed, before + dot(left, w), before))
        store_at(work, row, 3, Three(dot(left, first), dot(left, second), dot(left, third)))
    for row in range(6):
        k = load_at(work, row, 3, 0, width)
        for column in range(row, 6):
            before = entry(p, row, column)
            less = dot(k, load_at(work, column, 0, 0, width))
            after = select(is_believed, before - less, WIDER * before)
            store(p, (row, column, 0), after)
            store(p, (column, row, 0), after)
        for column in range(6, 6 + count):
            before = entry(p, row, column)
            less = dot(k, column_of(work, column))
            store(p, (row, column, 0), select(is_believed, before - less, before))


@compiled(error_model="numpy")
def note_turn(now: Moment, errors: NavigationErrors) -> None:
    """Store the rotation from the true attitudes to the sensed ones from sample k on."""
    turn = now.state.estimate.turn
    for lane in range(width_of(now.state.estimate)):
        error = three_of(errors.of_attitude[flight_of(now, lane), now.k])
        scale = 1.0 / sqrt(1.0 + 0.25 * dot(error, error))
        write_lane(turn, 0, lane, scale * (0.5 * error))
        turn[3, lane] = scale


@compiled(error_model="numpy")
def turn_by_sensing_error(now: Moment, errors: NavigationErrors) -> None:
    """Turn ideally pointing deputies by the error of the sensed attitude, which is then the desired one."""
    if errors.of_attitude.shape[1] > 0:
        note_turn(now, errors)
        attitude = now.state.truth.attitude
        store_quaternion(
            attitude, turned(load_quaternion(attitude), load_quaternion(now.state.estimate.turn), -1.0)
        )


@compiled(error_model="numpy")
def sense_attitude(now: Moment, errors: NavigationErrors, tilt: Floats) -> None:
    """Write the sensed attitude and boresight (Hill axes) into the belief.

    Its error goes into `state.estimate.turn`, a rotation about body axes, and `tilt`, (3, L), its small
    angles in Hill axes, rad; both stay as they are where there is none.
    """
    state, belief = now.state, now.state.belief
    q = load_quaternion(state.truth.attitude)
    if errors.of_attitude.shape[1] == 0:
        store_quaternion(belief.attitude, q)
        store_three(belief.boresight, 0, load_three(state.truth.boresight, 0))
        return
    note_turn(now, errors)
    a, b, c, d = load_quaternion(state.estimate.turn)
    sensed = turned(q, (a, b, c, d), 1.0)
    store_quaternion(belief.attitude, sensed)
    store_three(belief.boresight, 0, to_hill(sensed, three_of(now.world.boresight)))
    # angles are twice the ratio of the quaternion's components
    store_three(tilt, 0, to_hill(q, 2.0 * Three(a, b, c) / d))


@compiled(error_model="numpy")
def start_estimate(now: Moment, fixes: Fixes) -> None:
    """Make the first estimates, and their covariances."""
    state = now.state
    filtered, width = state.estimate.filtered, width_of(state.estimate)
    for lane in range(width):
        error = fixes.errors.at_start[flight_of(now, lane)]
        position, velocity = lane_of(state.truth.position, 0, lane), lane_of(state.truth.velocity, 0, lane)
        write_lane(filtered, 0, lane, position + three_of(error))
        write_lane(filtered, 3, lane, velocity + three_of(error[3:]))
    for row in range(6):
        for column in range(6 + len(fixes.law.constants)):
            covariance = splat(fixes.law.at_start[row, column] if column < 6 else 0.0, width)
            store(state.estimate.covariance, (row, column, 0), covariance)


@compiled(error_model="numpy")
def measure(now: Moment, errors: NavigationErrors, tilt: Floats, fix: int) -> None:
    """Take a fix of the true positions; bearings err by the `tilt` of the sensed attitude, rad, as well."""
    state = now.state
    for lane in range(width_of(state.estimate)):
        case, position = flight_of(now, lane), lane_of(state.truth.position, 0, lane)
        if errors.of_sight.shape[1] > 0:  # by a range and a bearing
            error = errors.of_sight[case, fix]
            turned_by = three_of(error[1:]) + lane_of(tilt, 0, lane)
            towards = position + cross(turned_by, position)
            position = ((length(position) + error[0]) / length(towards)) * towards
        write_lane(state.fixes[fix], 0, lane, position + three_of(errors.of_fixes[case, fix]))


@compiled(error_model="numpy", forceinline=True)
def is_corrected(now: Moment, law: Filter) -> bool:
    """Return whether the filter takes a fix at this sample: one of `delay` periods before."""
    sample = now.k - law.delay
    return sample >= now.world.first and sample % law.stride == 0


@compiled(error_model="numpy")
def write_estimate(now: Moment, law: Filter, log: FlightLog) -> None:
    """Log lane 0's estimate and its covariance, and the fix that comes into use."""
    estimate, k = now.state.estimate, now.k
    if is_corrected(now, law):
        write_row(log.fix_m[k], now.state.fixes[(k - law.delay) // law.stride], 0)
        write_row(log.innovation_m[k], estimate.innovation, 0)
        log.innovation_square[k] = estimate.innovation[3, 0]
    update_covariance(now, law)
    write_row(log.estimate[k], estimate.known, 0)
    for row in range(6):
        write_row(log.estimate_covariance[k, row], estimate.now[row], 0)


@compiled(error_model="numpy")
def update_covariance(now: Moment, law: Filter) -> None:
    """Bring the covariance of the last fix in use up to this sample, in `estimate.now`."""
    estimate = now.state.estimate
    for row in range(6):
        for column in range(6 + len(law.constants)):
            store(estimate.now, (row, column, 0), entry(estimate.covariance, row, column))
    for period in range(max(now.k - law.delay, now.world.first), now.k):
        propagate_covariance(now, law, estimate.now, period)


@compiled(error_model="numpy")
def navigate(now: Moment, fixes: Fixes) -> None:
    """Measure, filter, and write what the deputies believe at sample k."""
    state, law, k, first = now.state, fixes.law, now.k, now.world.first
    estimate, width = state.estimate, width_of(state.estimate)
    sense_attitude(now, fixes.errors, estimate.tilt)
    for axis in range(3):
        store_at(state.sensed, 3 * k + axis, 0, to_hill(load_quaternion(state.belief.attitude), unit(axis)))
    if k == first:
        start_estimate(now, fixes)
    if k % law.stride == 0:
        measure(now, fixes.errors, estimate.tilt, k // law.stride)
    filtered_to = k - law.delay
    if filtered_to > first:
        propagate_covariance(now, law, estimate.covariance, filtered_to - 1)
        advance(now, law, estimate.filtered, filtered_to - 1)
    if is_corrected(now, law):
        correct(law, state, filtered_to // law.stride)
    for row in range(6):
        store(estimate.known, row, load(estimate.filtered, row, width))
    for period in range(max(filtered_to, first), k):
        advance(now, law, estimate.known, period)
    store_three(state.belief.position, 0, load_three(estimate.known, 0))
    store_three(state.belief.velocity, 0, load_three(estimate.known, 3))


@compiled(error_model="numpy", forceinline=True)
def believe_truth(state: FlightState) -> None:
    """Write the true states as the deputies' estimates: navigation is exact."""
    store_three(state.belief.position, 0, load_three(state.truth.position, 0))
    store_three(state.belief.velocity, 0, load_three(state.truth.velocity, 0))
    store_three(state.belief.boresight, 0, load_three(state.truth.boresight, 0))
    store_quaternion(state.belief.attitude, load_quaternion(state.truth.attitude))
