"""Sight and sensing of all lanes: points inspected, targets chosen, signals for controllers.

Points are processed eight at a time. Plain version in `pipeline.flight.reference.loop`.
"""

from math import cos, sin

import numpy as np
from numpy.typing import NDArray

from fis_tools.compiled.decorator import compiled
from fis_tools.compiled.vectors import Vector, count, least, load, most, select, some, splat, store, total
from pipeline.flight.period.look.guidance import MIN_PROJECTION_M, POINTS, cluster_centres, nearest_centre
from pipeline.flight.period.look.optics import beam_at, eye_at, lit_through, seen_through
from pipeline.flight.state.arrays import Beyond, Workspace, World
from pipeline.flight.state.elementary import arctangent
from pipeline.flight.state.lanes import four, one, three, two, write_three, write_two
from pipeline.flight.state.signals import slot
from pipeline.physics.sight import is_facing, is_in_cone, is_lit

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

DISTANCE, LAMBDA_U, ETA_U = slot("distance"), slot("lambda_u"), slot("eta_u")
VELOCITY_BODY = slot("velocity_body_x", "velocity_body_y", "velocity_body_z")
POSITION_HILL = slot("position_radial", "position_along_track", "position_cross_track")
VELOCITY_HILL = slot("velocity_radial", "velocity_along_track", "velocity_cross_track")


@compiled(error_model="numpy", forceinline=True)
def turn_suns(world: World, work: Workspace, k: int) -> None:
    """Write the Sun's direction at a sample in every lane."""
    turned = world.mean_motion * world.control_period * k
    turned_cos, turned_sin = cos(turned), sin(turned)
    # by the addition theorem, so that no lane calls library functions
    sun_cos, sun_sin = two(work.lanes.sun_at_start)
    sun_x = sun_cos * turned_cos + sun_sin * turned_sin
    write_two(work.lanes.sun, 0, sun_x, sun_sin * turned_cos - sun_cos * turned_sin)


@compiled(error_model="numpy", forceinline=True)
def look(world: World, work: Workspace, lane: int, sample: int) -> None:
    """Inspect what is lit and in view of a lane's camera; the target is the mean of the other lit points."""
    lanes, sight, points = work.lanes, world.sight, world.points
    rx, ry, rz = lanes.position[0, lane], lanes.position[1, lane], lanes.position[2, lane]
    bx, by, bz = lanes.boresight[0, lane], lanes.boresight[1, lane], lanes.boresight[2, lane]
    sun_x, sun_y = lanes.sun[0, lane], lanes.sun[1, lane]
    # for points on the sphere of the horizon, |p - r|^2 = |p|^2 + |r|^2 - 2 p . r
    squares = sight.horizon + (rx * rx + ry * ry + rz * rz)
    along_boresight = rx * bx + ry * by + rz * bz
    num_seen, num_left = 0, 0
    nothing = splat(0.0, POINTS)
    cx, cy, cz = nothing, nothing, nothing
    for j in range(0, points.shape[2], POINTS):
        before = load(work.unseen, (lane, j), POINTS)
        is_unseen = before > 0.0
        if not some(is_unseen):
            store(work.candidate, j, nothing)
            continue
        px, py = load(points, (sample, 0, j), POINTS), load(points, (sample, 1, j), POINTS)
        lit = is_unseen & is_lit(sight, px, py, sun_x, sun_y)
        if not some(lit):
            store(work.candidate, j, nothing)
            continue
        pz = load(points, (sample, 2, j), POINTS)
        along = px * rx + py * ry + pz * rz
        towards = (px * bx + py * by + pz * bz) - along_boresight
        seen = lit & is_facing(sight, along) & is_in_cone(sight, towards, squares - 2.0 * along)
        left = lit ^ seen
        store(work.unseen, (lane, j), select(seen, nothing, before))
        store(work.candidate, j, select(left, 1.0, nothing))
        num_seen += count(seen)
        num_left += count(left)
        cx += select(left, px, nothing)
        cy += select(left, py, nothing)
        cz += select(left, pz, nothing)
    lanes.num_unseen[lane] -= num_seen
    lanes.num_candidates[lane] = num_left
    divisor = max(num_left, 1)
    lanes.target[0, lane] = total(cx) / divisor
    lanes.target[1, lane] = total(cy) / divisor
    lanes.target[2, lane] = total(cz) / divisor


@compiled(error_model="numpy", forceinline=True)
def look_through(world: World, optics: Beyond, work: Workspace, lane: int, k: int) -> None:
    """Do what `look` does where light or camera are not the paper's."""
    lanes, points = work.lanes, world.points
    sample = k if len(points) > 1 else 0
    beam = beam_at(world, optics.closely, work, lane, k, lanes.sun[0, lane], lanes.sun[1, lane])
    eye = eye_at(
        world,
        beam,
        lanes.position[0, lane],
        lanes.position[1, lane],
        lanes.position[2, lane],
        lanes.boresight[0, lane],
        lanes.boresight[1, lane],
        lanes.boresight[2, lane],
    )
    num_seen, num_left = 0, 0
    nothing = splat(0.0, POINTS)
    cx, cy, cz = nothing, nothing, nothing
    for j in range(0, points.shape[2], POINTS):
        before = load(work.unseen, (lane, j), POINTS)
        wanted = before > 0.0
        if not (beam.shines and some(wanted)):
            store(work.candidate, j, nothing)
            continue
        left = lit_through(world, optics.closely, work, sample, j, wanted, beam)
        if not eye.is_blind:
            seen = seen_through(world, optics.closely, work, sample, j, left, eye)
            left = left ^ seen
            store(work.unseen, (lane, j), select(seen, nothing, before))
            num_seen += count(seen)
        store(work.candidate, j, select(left, 1.0, nothing))
        num_left += count(left)
        cx += select(left, load(points, (sample, 0, j), POINTS), nothing)
        cy += select(left, load(points, (sample, 1, j), POINTS), nothing)
        cz += select(left, load(points, (sample, 2, j), POINTS), nothing)
    lanes.num_unseen[lane] -= num_seen
    lanes.num_candidates[lane] = num_left
    divisor = max(num_left, 1)
    lanes.target[0, lane] = total(cx) / divisor
    lanes.target[1, lane] = total(cy) / divisor
    lanes.target[2, lane] = total(cz) / divisor


@compiled(error_model="numpy", forceinline=True)
def relative_angle(target_a: Vector, target_b: Vector, position_a: Vector, position_b: Vector) -> Vector:
    """Return the angle from the position's to the target's projection, in (-pi, pi]; 0 where one vanishes."""
    least_square = MIN_PROJECTION_M * MIN_PROJECTION_M
    has_both = (target_a * target_a + target_b * target_b >= least_square) & (
        position_a * position_a + position_b * position_b >= least_square
    )
    across = select(has_both, position_a * target_b - position_b * target_a, 0.0)
    along = select(has_both, position_a * target_a + position_b * target_b, 1.0)
    return arctangent(across, along)


@compiled(error_model="numpy", forceinline=True)
def are_new(work: Workspace, lane: int) -> bool:
    """Return whether the candidates differ from those clustered last, and store them as clustered."""
    num_different = 0
    for j in range(0, len(work.candidate), POINTS):
        now = load(work.candidate, j, POINTS)
        num_different += count(now != load(work.clustered, (lane, j), POINTS))
        store(work.clustered, (lane, j), now)
    return num_different > 0


@compiled(error_model="numpy")
def choose_cluster(world: World, work: Workspace, lane: int, sample: int) -> None:
    """Cluster the candidates of a lane, and make the centre nearest to the deputy its target.

    Centres stay unchanged if the candidates are not new.
    """
    lanes, position, centres = work.lanes, np.empty(3), work.centres[lane]
    num_candidates = int(lanes.num_candidates[lane])
    if num_candidates == 0:
        work.num_centres[lane] = 0
        work.clustered[lane, 0] = -1.0  # so that the next candidates are new
        return
    for axis in range(3):
        position[axis] = lanes.position[axis, lane]
    if are_new(work, lane) or len(world.points) > 1:
        filled = 0
        for j in range(world.num_points):  # without a branch, which processors cannot predict
            for axis in range(3):
                work.candidates[axis, filled] = world.points[sample, axis, j]
            filled += int(work.candidate[j])
        work.num_centres[lane] = cluster_centres(
            work.candidates,
            num_candidates,
            position,
            centres,
            work.num_centres[lane],
            work.labels,
            work.distances,
            work.sums,
        )
    chosen = nearest_centre(centres, work.num_centres[lane], position)
    for axis in range(3):
        lanes.target[axis, lane] = centres[chosen, axis]


@compiled(error_model="numpy", forceinline=True)
def dcm_of(q1: Vector, q2: Vector, q3: Vector, q4: Vector) -> tuple[Vector, ...]:
    """Return the direction cosines of attitudes, Hill to body, by rows."""
    return (
        q1 * q1 - q2 * q2 - q3 * q3 + q4 * q4,
        2 * (q1 * q2 + q3 * q4),
        2 * (q1 * q3 - q2 * q4),
        2 * (q1 * q2 - q3 * q4),
        -q1 * q1 + q2 * q2 - q3 * q3 + q4 * q4,
        2 * (q2 * q3 + q1 * q4),
        2 * (q1 * q3 + q2 * q4),
        2 * (q2 * q3 - q1 * q4),
        -q1 * q1 - q2 * q2 + q3 * q3 + q4 * q4,
    )


@compiled(error_model="numpy", forceinline=True)
def to_hill(
    q: tuple[Vector, Vector, Vector, Vector], v: tuple[Vector, Vector, Vector]
) -> tuple[Vector, Vector, Vector]:
    """Return vectors in body axes in Hill axes."""
    c11, c12, c13, c21, c22, c23, c31, c32, c33 = dcm_of(*q)
    x, y, z = v
    return c11 * x + c21 * y + c31 * z, c12 * x + c22 * y + c32 * z, c13 * x + c23 * y + c33 * z


@compiled(error_model="numpy", forceinline=True)
def to_body(
    q: tuple[Vector, Vector, Vector, Vector], v: tuple[Vector, Vector, Vector]
) -> tuple[Vector, Vector, Vector]:
    """Return vectors in Hill axes in body axes."""
    c11, c12, c13, c21, c22, c23, c31, c32, c33 = dcm_of(*q)
    x, y, z = v
    return c11 * x + c12 * y + c13 * z, c21 * x + c22 * y + c23 * z, c31 * x + c32 * y + c33 * z


@compiled(error_model="numpy", forceinline=True)
def write_signals(
    work: Workspace,
    place: tuple[Vector, Vector, Vector],
    velocity: tuple[Vector, Vector, Vector],
    distance: Vector,
    dcm: tuple[Vector, ...],
    needs_angles: bool,
) -> None:
    """Write the signals of position and velocity of every lane."""
    lanes, signals = work.lanes, work.signals
    rx, ry, rz = place
    vx, vy, vz = velocity
    c11, c12, c13, c21, c22, c23, c31, c32, c33 = dcm
    store(signals, DISTANCE, distance)
    write_three(signals, POSITION_HILL, rx, ry, rz)
    write_three(signals, VELOCITY_HILL, vx, vy, vz)
    write_three(
        signals,
        VELOCITY_BODY,
        c11 * vx + c12 * vy + c13 * vz,
        c21 * vx + c22 * vy + c23 * vz,
        c31 * vx + c32 * vy + c33 * vz,
    )
    if needs_angles:
        tx, ty, tz = three(lanes.target)
        store(signals, LAMBDA_U, relative_angle(tx, ty, rx, ry))
        store(signals, ETA_U, relative_angle(tx, tz, rx, rz))


@compiled(error_model="numpy")
def sense_again(work: Workspace, needs_angles: bool) -> None:
    """Recompute the signals of position and velocity from the estimates in place of the truth."""
    place, velocity = three(work.lanes.position), three(work.lanes.velocity)
    rx, ry, rz = place
    q1, q2, q3, q4 = four(work.lanes.attitude)
    distance = np.sqrt(rx * rx + ry * ry + rz * rz)
    write_signals(work, place, velocity, distance, dcm_of(q1, q2, q3, q4), needs_angles)


@compiled(error_model="numpy", forceinline=True)
def sense(
    world: World,
    optics: Beyond | None,
    clusters: bool | None,
    work: Workspace,
    num_lanes: int,
    k: int,
    needs_angles: bool,
) -> None:
    """Inspect, choose the target and write the signals of every lane."""
    lanes = work.lanes
    turn_suns(world, work, k)
    rx, ry, rz = three(lanes.position)
    vx, vy, vz = three(lanes.velocity)
    q1, q2, q3, q4 = four(lanes.attitude)
    distance = np.sqrt(rx * rx + ry * ry + rz * rz)
    store(lanes.travelled, 0, one(lanes.travelled) + distance)
    store(lanes.nearest, 0, least(distance, one(lanes.nearest)))
    store(lanes.farthest, 0, most(distance, one(lanes.farthest)))
    if k > 0:
        beyond = most(world.min_distance - distance, distance - world.max_distance)
        store(lanes.beyond, 0, most(beyond, one(lanes.beyond)))

    dcm = dcm_of(q1, q2, q3, q4)
    c11, c12, c13, c21, c22, c23, c31, c32, c33 = dcm
    b1, b2, b3 = world.boresight[0], world.boresight[1], world.boresight[2]
    write_three(
        lanes.boresight,
        0,
        c11 * b1 + c21 * b2 + c31 * b3,
        c12 * b1 + c22 * b2 + c32 * b3,
        c13 * b1 + c23 * b2 + c33 * b3,
    )
    sample = k if len(world.points) > 1 else 0
    for lane in range(num_lanes):
        if optics is None:
            look(world, work, lane, sample)
        else:
            look_through(world, optics, work, lane, k)
        if clusters is not None:
            choose_cluster(world, work, lane, sample)
    write_signals(work, (rx, ry, rz), (vx, vy, vz), distance, dcm, needs_angles)
