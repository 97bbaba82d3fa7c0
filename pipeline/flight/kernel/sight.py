"""What the deputies of all lanes see and sense: points inspected, targets chosen, signals for the controller.

All points are looked at at once, without branches. Written out plainly in `pipeline.flight.reference.loop`.
"""

from math import atan2, cos, pi, sin, sqrt

import numpy as np
from numpy.typing import NDArray

from fis_tools.engines.compiled import compiled
from fis_tools.engines.kernel import LANES
from pipeline.flight.guidance import MIN_PROJECTION_M, cluster_centres, nearest_centre
from pipeline.flight.kernel.arrays import (
    BEYOND,
    FARTHEST,
    LEFT,
    NEAREST,
    Q1,
    Q2,
    Q3,
    Q4,
    RX,
    RY,
    RZ,
    SUN_COS,
    SUN_SIN,
    TRAVELLED,
    VX,
    VY,
    VZ,
    Workspace,
    World,
)
from pipeline.flight.signals import slot

Floats = NDArray[np.float64]
Indices = NDArray[np.uint64]
Integers = NDArray[np.int64]

DISTANCE, LAMBDA_U, ETA_U = slot("distance"), slot("lambda_u"), slot("eta_u")
VELOCITY_BODY = slot("velocity_body_x", "velocity_body_y", "velocity_body_z")
TARGET_DIRECTION = slot("target_radial", "target_along_track", "target_cross_track")
#: position, then velocity
STATE_HILL = slot(
    "position_radial",
    "position_along_track",
    "position_cross_track",
    "velocity_radial",
    "velocity_along_track",
    "velocity_cross_track",
)


# Sums over points may be taken in any order: that is what lets them run on vector units.
@compiled(error_model="numpy", fastmath={"contract", "reassoc", "nsz"})
def look(
    points: Floats,
    sample: int,
    unseen: Floats,
    lane: int,
    candidate: Floats,
    rx: float,
    ry: float,
    rz: float,
    bx: float,
    by: float,
    bz: float,
    sx: float,
    sy: float,
    sun_threshold: float,
    horizon: float,
    cos2: float,
) -> tuple[float, float, float, float, float]:
    """Inspect what is lit and in view, then sum up what is lit and still to be seen.

    Returns the number of points not inspected yet, of candidates, and the sum of the candidates' positions.
    """
    unseen_count, count, cx, cy, cz = 0.0, 0.0, 0.0, 0.0, 0.0
    for j in range(len(candidate)):
        px, py, pz = points[sample, 0, j], points[sample, 1, j], points[sample, 2, j]
        dx, dy, dz = px - rx, py - ry, pz - rz
        towards = dx * bx + dy * by + dz * bz
        squared = dx * dx + dy * dy + dz * dz
        lit = unseen[lane, j] if px * sx + py * sy > sun_threshold else 0.0
        seen = lit if px * rx + py * ry + pz * rz >= horizon else 0.0
        seen = seen if towards > 0.0 else 0.0
        seen = seen if towards * towards >= cos2 * squared else 0.0
        unseen[lane, j] -= seen
        left = lit - seen
        candidate[j] = left
        unseen_count += unseen[lane, j]
        count += left
        cx += left * px
        cy += left * py
        cz += left * pz
    return unseen_count, count, cx, cy, cz


@compiled(error_model="numpy", forceinline=True, fastmath={"contract"})
def relative_angle(target_a: float, target_b: float, position_a: float, position_b: float) -> float:
    """Return the angle from the position's to the target's projection, in (-pi, pi]; 0 where one vanishes."""
    least = MIN_PROJECTION_M * MIN_PROJECTION_M
    if (
        target_a * target_a + target_b * target_b < least
        or position_a * position_a + position_b * position_b < least
    ):
        return 0.0
    angle = atan2(
        position_a * target_b - position_b * target_a, position_a * target_a + position_b * target_b
    )
    return pi if angle == -pi else angle


@compiled(error_model="numpy", fastmath={"contract", "reassoc", "nsz"})
def are_new(candidate: Floats, clustered: Floats, lane: int) -> bool:
    """Tell whether the candidates differ from those clustered last, and note them as clustered."""
    num_different = 0.0
    for j in range(len(candidate)):
        num_different += 1.0 if candidate[j] != clustered[lane, j] else 0.0
        clustered[lane, j] = candidate[j]
    return num_different > 0.0


@compiled(error_model="numpy")
def choose_cluster(
    points: Floats,
    sample: int,
    candidate: Floats,
    count: int,
    r: Floats,
    is_new: bool,
    candidates: Floats,
    centres: Floats,
    num_centres: int,
    labels: Integers,
    distances: Floats,
    sums: Floats,
) -> int:
    """Cluster the candidates of a sample, seen from `r`, where the chosen centre is left.

    Candidates that are not new leave the centres as they are. Returns the number of centres.
    """
    filled = 0
    for j in range(len(candidate) if is_new else 0):
        if candidate[j] != 0.0:
            for axis in range(3):
                candidates[axis, filled] = points[sample, axis, j]
            filled += 1
    if is_new:
        num_centres = cluster_centres(candidates, count, r, centres, num_centres, labels, distances, sums)
    chosen = nearest_centre(centres, num_centres, r)
    for axis in range(3):
        r[axis] = centres[chosen, axis]
    return num_centres


@compiled(error_model="numpy", forceinline=True, fastmath={"contract"})
def sense(
    world: World,
    clusters: bool | None,
    work: Workspace,
    num_lanes: int,
    k: int,
    needs_angles: bool,
    target: Floats,
) -> int:
    """Inspect, choose the target and write the signals of every lane.

    Leaves the last lane's target in `target` where there are candidates, and returns how many it has.
    """
    lanes = work.lanes
    turned = world.mean_motion * world.control_period * k
    turned_cos, turned_sin = cos(turned), sin(turned)
    count = 0.0
    for lane in range(num_lanes):
        # by the addition theorem, so that no lane calls the library's functions
        sun_cos = lanes[SUN_COS + lane] * turned_cos + lanes[SUN_SIN + lane] * turned_sin
        sun_sin = lanes[SUN_SIN + lane] * turned_cos - lanes[SUN_COS + lane] * turned_sin
        rx, ry, rz = lanes[RX + lane], lanes[RY + lane], lanes[RZ + lane]
        vx, vy, vz = lanes[VX + lane], lanes[VY + lane], lanes[VZ + lane]
        q1, q2, q3, q4 = lanes[Q1 + lane], lanes[Q2 + lane], lanes[Q3 + lane], lanes[Q4 + lane]
        distance = sqrt(rx * rx + ry * ry + rz * rz)
        lanes[TRAVELLED + lane] += distance
        lanes[NEAREST + lane] = min(lanes[NEAREST + lane], distance)
        lanes[FARTHEST + lane] = max(lanes[FARTHEST + lane], distance)
        if k > 0:
            beyond = max(world.min_distance - distance, distance - world.max_distance)
            lanes[BEYOND + lane] = max(lanes[BEYOND + lane], beyond)

        c11, c12, c13 = (
            q1 * q1 - q2 * q2 - q3 * q3 + q4 * q4,
            2 * (q1 * q2 + q3 * q4),
            2 * (q1 * q3 - q2 * q4),
        )
        c21, c22, c23 = (
            2 * (q1 * q2 - q3 * q4),
            -q1 * q1 + q2 * q2 - q3 * q3 + q4 * q4,
            2 * (q2 * q3 + q1 * q4),
        )
        c31, c32, c33 = (
            2 * (q1 * q3 + q2 * q4),
            2 * (q2 * q3 - q1 * q4),
            -q1 * q1 - q2 * q2 + q3 * q3 + q4 * q4,
        )
        sample = k if len(world.points) > 1 else 0
        b = world.boresight
        unseen_count, count, tx, ty, tz = look(
            world.points,
            sample,
            work.unseen,
            lane,
            work.candidate,
            rx,
            ry,
            rz,
            c11 * b[0] + c21 * b[1] + c31 * b[2],
            c12 * b[0] + c22 * b[1] + c32 * b[2],
            c13 * b[0] + c23 * b[1] + c33 * b[2],
            sun_cos,
            sun_sin,
            world.sun_threshold,
            world.horizon,
            world.cos_half_angle_squared,
        )
        lanes[LEFT + lane] = unseen_count

        lambda_u, eta_u = 0.0, 0.0
        if count > 0.0:
            target[0], target[1], target[2] = tx / count, ty / count, tz / count
            if clusters is not None:
                target[0], target[1], target[2] = rx, ry, rz
                is_new = are_new(work.candidate, work.clustered, lane) or len(world.points) > 1
                num_centres = choose_cluster(
                    world.points,
                    sample,
                    work.candidate,
                    int(count),
                    target,
                    is_new,
                    work.candidates,
                    work.centres[lane],
                    work.num_centres[lane],
                    work.labels,
                    work.distances,
                    work.sums,
                )
                work.num_centres[lane] = num_centres
            if needs_angles:
                lambda_u = relative_angle(target[0], target[1], rx, ry)
                eta_u = relative_angle(target[0], target[2], rx, rz)
        else:
            work.num_centres[lane] = 0
            work.clustered[lane, 0] = -1.0  # whatever comes next is new

        signals = work.signals
        for component in range(
            3
        ):  # a position yet; `pipeline.flight.kernel.free_motion` makes it a direction
            signals[LANES * (TARGET_DIRECTION + component) + lane] = target[component] if count > 0.0 else 0.0
        signals[LANES * DISTANCE + lane] = distance
        signals[LANES * VELOCITY_BODY + lane] = c11 * vx + c12 * vy + c13 * vz
        signals[LANES * (VELOCITY_BODY + 1) + lane] = c21 * vx + c22 * vy + c23 * vz
        signals[LANES * (VELOCITY_BODY + 2) + lane] = c31 * vx + c32 * vy + c33 * vz
        signals[LANES * LAMBDA_U + lane] = lambda_u
        signals[LANES * ETA_U + lane] = eta_u
        for component in range(6):
            signals[LANES * (STATE_HILL + component) + lane] = lanes[RX + LANES * component + lane]
    return int(count)
