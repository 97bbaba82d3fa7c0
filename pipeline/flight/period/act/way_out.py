"""Run-time assurance, compiled: a way out that needs no thrust (docs/explanation/safety.md).

By Clohessy and Wiltshire's equations free motion is an ellipse about a centre that drifts by ``-3 pi x_c`` an
orbit, ``x_c = 4 x + 2 v/n``. Where ``x_c`` is zero the ellipse is closed, and is flown again and again
without thrust. Of a force held over a control period only the component along the track changes ``x_c``, so
that it follows which one closes the ellipse; radial ones, of which some are tried, choose its size and
place, and across the orbit plane the swing stays, or is shifted to a quarter of an orbit from the radial one
(e/i-vector separation; D'Amico and Montenbruck, Journal of Guidance, Control, and Dynamics 29, 2006).

A state *has a way out* if one such force leads onto a closed ellipse between the spheres of the safety layer.
Only forces are admitted after which the state has one again; the last control period ends on an ellipse.
Where the delta-v is limited, a force counts as a way out only if what is left of the limit pays for it.
"""

from math import cos, inf, pi, sin

import numpy as np

from fis_tools.compiled.decorator import compiled
from fis_tools.compiled.three import Three, lane_of, length, write_lane
from pipeline.flight.period.act.safety import Flying, free_state, next_state
from pipeline.flight.state.arrays import Moment, World
from pipeline.flight.state.log import DELTA_V, SAFE, WAY_OUT
from pipeline.physics.motion import ORBIT_PARTS, position_rows_of, propagator_of

#: half-axes that are tried each way, evenly up to the greatest that any ellipse inside the limits has
STEPS = 12
#: the radial speed as it is and those that are tried, each with the swing as it is and shifted
NUM_TRIED = 2 * (2 * STEPS + 2)
#: how far extremes lie beyond points that are parts of an orbit apart, see `lies_between`
BEYOND = 0.5 * (pi / ORBIT_PARTS) * (pi / ORBIT_PARTS)
#: what is spared between ellipses and spheres at the start, m; it falls to nothing at the end, so that
#: rounding from one period to the next takes no way out
SPARE = 1e-3
#: the same of the limit on the delta-v, m/s: a way out that has been taken is a force by rounding alone
SPARE_DELTA_V = 1e-6
#: greatest ``x_c`` of an ellipse that counts as closed, m
CLOSED = 1e-6
#: where the effect of a force on the swing's phase is smaller than this, m/N, it is left as it is
LEAST_EFFECT = 1e-9
#: bisection steps between the way out and a force that leaves none
HALVINGS = 20


@compiled(error_model="numpy")
def centre_of(world: World, ahead: Flying) -> float:
    """Return ``x_c``, the height of the centre of a state's ellipse over the chief, m."""
    height: float = 4.0 * ahead[0].x + 2.0 * ahead[1].y / world.mean_motion
    return height


@compiled(error_model="numpy")
def lies_between(world: World, k: int, state: Flying, spare: float) -> bool:
    """Return whether the ellipse of a state at sample k lies between the spheres, with some to spare, m.

    It is taken for closed. The square of the distance is a trigonometric polynomial of degree two, a_1 and
    a_2 being the amplitudes of its harmonics. So its extremes lie beyond those at points an angle h apart by
    at most ``(h/2)^2 (a_1 + 4 a_2)/2``. The points are fixed in time, so that the answer is the same for all
    states of an ellipse.
    """
    position, velocity = state
    n, z = world.mean_motion, position.z
    p, q, w = -3.0 * position.x - 2.0 * velocity.y / n, velocity.x / n, velocity.z / n
    along = position.y - 2.0 * q
    mean = along * along + 2.5 * (p * p + q * q) + 0.5 * (z * z + w * w)
    cosine_1, sine_1 = 4.0 * along * q, -4.0 * along * p
    cosine_2, sine_2 = 1.5 * (q * q - p * p) + 0.5 * (z * z - w * w), z * w - 3.0 * p * q
    bend = np.sqrt(cosine_1 * cosine_1 + sine_1 * sine_1)
    bend += 4.0 * np.sqrt(cosine_2 * cosine_2 + sine_2 * sine_2)
    angle = n * world.control_period * k
    c, s = cos(angle), sin(angle)
    cosine_1, sine_1 = c * cosine_1 - s * sine_1, s * cosine_1 + c * sine_1
    c, s = c * c - s * s, 2.0 * c * s
    cosine_2, sine_2 = c * cosine_2 - s * sine_2, s * cosine_2 + c * sine_2
    least, most = inf, 0.0
    for part in range(ORBIT_PARTS):
        rows = position_rows_of(world.orbit_parts, part)
        cosine, sine = rows.zz, n * rows.zw
        square = mean + cosine_1 * cosine + sine_1 * sine
        square += cosine_2 * (cosine * cosine - sine * sine) + 2.0 * sine_2 * cosine * sine
        least, most = min(least, square), max(most, square)
    beyond = BEYOND * bend
    near, far = world.guard.keep_out + spare, world.guard.keep_in - spare
    return bool(least - beyond >= near * near and most + beyond <= far * far)


@compiled(error_model="numpy")
def tried_force(world: World, k: int, number: int, free: Flying) -> Three:
    """Return one of the forces that close the ellipse, N, from the state after the period without a force."""
    n, step = world.mean_motion, propagator_of(world.motion, 0)
    (_, higher, _, _, swung), (faster, drawn, _, ahead, lifted) = step.pushed_position, step.pushed_velocity
    closing = -centre_of(world, free) / (4.0 * higher + 2.0 * ahead / n)
    rank, radial = number // 2, 0.0
    if rank > 0:
        half_axis = 0.5 * world.guard.keep_in * (rank - 1 - STEPS) / STEPS
        radial = (n * half_axis - free[1].x - drawn * closing) / faster
    force = Three(radial, closing, 0.0)
    if number % 2 == 1:
        position, velocity = next_state(world, k, free, force)
        p, q = -3.0 * position.x - 2.0 * velocity.y / n, velocity.x / n
        effect = swung * p + lifted * q / n
        if abs(effect) > LEAST_EFFECT:
            force = Three(radial, closing, -(position.z * p + velocity.z * q / n) / effect)
    return force


@compiled(error_model="numpy")
def way_out(
    world: World, k: int, free: Flying, spare: float, affordable: float, is_any: bool
) -> tuple[bool, Three]:
    """Return whether a force at sample k leads onto a closed ellipse between the spheres, and the cheapest.

    The state after the period without a force is given, and the greatest sum of a force's components, N, that
    the flight can afford. Any such force will do if `is_any`.
    """
    best, cheapest = Three(0.0, 0.0, 0.0), inf
    for number in range(NUM_TRIED):
        force = tried_force(world, k, number, free)
        x, y, z = abs(force.x), abs(force.y), abs(force.z)
        cost = x + y + z
        if max(x, y, z) > world.guard.braking_force or not cost < cheapest or cost > affordable:
            continue
        if lies_between(world, k + 1, next_state(world, k, free, force), spare):
            best, cheapest = force, cost
            if is_any:
                break
    return cheapest < inf, best


@compiled(error_model="numpy")
def spare_at(world: World, k: int) -> float:
    """Return what ways out that are fired or admitted at sample k spare, m."""
    return SPARE * (world.num_controls - k) / world.num_controls


@compiled(error_model="numpy")
def limit_on_delta_v(way_out: float | None) -> float:
    """Return `Guard.way_out`, a number in code that is compiled and never run, too, m/s."""
    return inf if way_out is None else way_out


@compiled(error_model="numpy")
def affordable_at(world: World, k: int, spent: float) -> float:
    """Return the greatest sum of a force's components, N, that may be fired at sample k, having spent m/s."""
    spare = SPARE_DELTA_V * (world.num_controls - k) / world.num_controls
    force: float = (limit_on_delta_v(world.guard.way_out) - spare - spent) / world.delta_v_per_force
    return force


@compiled(error_model="numpy")
def is_open(world: World, k: int, known: Flying, spent: float) -> bool:
    """Return whether a state at sample k lies between the spheres and has a way out, having spent m/s."""
    distance, guard = length(known[0]), world.guard
    is_between = guard.keep_out <= distance <= guard.keep_in
    free, affordable = free_state(world, k, known), affordable_at(world, k, spent)
    return is_between and way_out(world, k, free, spare_at(world, k), affordable, True)[0]


@compiled(error_model="numpy")
def stays_open(world: World, k: int, free: Flying, force: Three, spent: float) -> bool:
    """Return whether a force at sample k is admitted: the state after it has a way out, or at the end is out.

    The state after the period without a force is given, and the delta-v spent before it, m/s.
    """
    ahead, guard, spare = next_state(world, k, free, force), world.guard, spare_at(world, k)
    distance = length(ahead[0])
    if not guard.keep_out + spare <= distance <= guard.keep_in - spare:
        return False
    cost = abs(force.x) + abs(force.y) + abs(force.z)
    if cost > affordable_at(world, k, spent):
        return False
    if k + 1 == world.num_controls:
        return abs(centre_of(world, ahead)) <= CLOSED and lies_between(world, k + 1, ahead, spare)
    affordable = affordable_at(world, k, spent + cost * world.delta_v_per_force)
    return way_out(world, k + 1, free_state(world, k + 1, ahead), spare, affordable, True)[0]


@compiled(error_model="numpy")
def admitted_force(world: World, k: int, known: Flying, requested: Three, spent: float) -> tuple[Three, int]:
    """Return the force, N, that replaces one after which there is no way out, and for which limit.

    Any other stays as it is. It is as far from the way out towards what is requested as bisection finds. From
    a state without a way out nothing is promised, and the force stays.
    """
    free = free_state(world, k, known)
    if stays_open(world, k, free, requested, spent):
        return requested, SAFE
    affordable = affordable_at(world, k, spent)
    is_left, force = way_out(world, k, free, spare_at(world, k), affordable, False)
    if not is_left:
        return requested, SAFE
    correction, low, high = requested - force, 0.0, 1.0
    for _ in range(HALVINGS if k + 1 < world.num_controls else 0):
        share = 0.5 * (low + high)
        if stays_open(world, k, free, force + share * correction, spent):
            low = share
        else:
            high = share
    # but for what it costs it is admitted
    is_spent = stays_open(world, k, free, requested, -inf)
    return force + low * correction, DELTA_V if is_spent else WAY_OUT


@compiled(error_model="numpy")
def keep_way_out(now: Moment) -> None:
    """Correct the commands, safe as the layer left them, of the lanes that they leave no way out."""
    world, lanes, belief = now.world, now.state.lanes, now.state.belief
    for lane in range(now.num_lanes):
        known = lane_of(belief.position, 0, lane), lane_of(belief.velocity, 0, lane)
        requested = lane_of(lanes.commanded, 0, lane)
        force, limit = admitted_force(world, now.k, known, requested, lanes.spent[lane])
        more = force - requested
        if max(abs(more.x), abs(more.y), abs(more.z)) == 0.0:
            continue
        if lanes.limit[lane] == SAFE:
            lanes.num_acted[lane] += 1.0
        lanes.limit[lane] = limit
        earlier = lane_of(lanes.change, 0, lane)
        change = earlier + more
        for axis in range(3):
            lanes.corrected[lane] += (abs(change[axis]) - abs(earlier[axis])) * world.delta_v_per_force
        write_lane(lanes.change, 0, lane, change)
        write_lane(lanes.commanded, 0, lane, force)
