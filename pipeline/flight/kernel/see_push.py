"""The push that would still show the deputies of all lanes what coasting misses and is soon dark for good.

Of every such point the cheapest look on the coasting path is sought; one regularised least-squares push
serves them all. The page on signals derives it. Written out plainly in `pipeline.flight.reference.see_push`.
"""

from math import cos, exp, sin, sqrt

import numpy as np
from numpy.typing import NDArray

from fis_tools.engines.compiled import compiled
from fis_tools.engines.kernel import LANES
from pipeline.flight.kernel.arrays import (
    COASTS,
    RX,
    RY,
    RZ,
    SUN_COS,
    SUN_SIN,
    VX,
    VY,
    VZ,
    Law,
    Workspace,
    World,
)
from pipeline.flight.preview import LEAST_SHORT_M, SQUARED_NEAR_M2
from pipeline.flight.signals import constant, slot
from pipeline.physics.motion import Place, drifted_place, place_of, slopes

Floats = NDArray[np.float64]

PUSH = slot("see_push_radial", "see_push_along_track", "see_push_cross_track")
AIM = slot("aim_radial", "aim_along_track", "aim_cross_track")
URGENT = slot("urgent_radial", "urgent_along_track", "urgent_cross_track")
URGENCY_TIME, SKIRT_DISTANCE = constant("urgency_time_s"), constant("skirt_distance_m")
SEE_HORIZON, SEE_DAMPING = constant("see_horizon_s"), constant("see_damping_ks2")
AIM_URGENT = constant("aim_urgent_m_s")

#: rows of `Workspace.looks`
COST, SHORT, SLOPE = 0, 1, 2
#: the square of a thousand seconds: a push of 1 m/s moves the deputy by about 1 km in that time
KS2 = 1e6


@compiled(error_model="numpy", forceinline=True, fastmath={"contract"})
def await_dark(work: Workspace, lane: int, now: float, horizon: float) -> float:
    """Mark the points unseen whose last light is still to come within the horizon; return how many."""
    count = 0.0
    for j in range(len(work.ahead)):
        last = work.deadlines[lane, j]
        waits = work.unseen[lane, j] if last > now else 0.0
        work.ahead[j] = waits if last <= now + horizon else 0.0
        work.looks[COST, j] = np.inf
        count += work.ahead[j]
    return count


# Sums over points may be taken in any order, as in `pipeline.flight.kernel.preview`.
@compiled(error_model="numpy", fastmath={"contract", "reassoc", "nsz"})
def look_from(
    points: Floats,
    sample: int,
    radius: float,
    ahead: Floats,
    looks: Floats,
    place: Place,
    rx: float,
    ry: float,
    rz: float,
    sx: float,
    sy: float,
    sun_threshold: float,
) -> None:
    """Strike out the points that a place of the path shows; of the others keep the cheapest look so far."""
    per_radius = 1.0 / radius
    near = LEAST_SHORT_M if rx * rx + ry * ry + rz * rz < SQUARED_NEAR_M2 else -np.inf
    for j in range(len(ahead)):
        px, py, pz = points[sample, 0, j], points[sample, 1, j], points[sample, 2, j]
        lit = ahead[j] if px * sx + py * sy > sun_threshold else 0.0
        px, py, pz = px * per_radius, py * per_radius, pz * per_radius
        short = radius - (px * rx + py * ry + pz * rz)
        short = short if short > near else near
        _, _, _, gx, gy, gz = slopes(place, px, py, pz)
        cost = short * short / (gx * gx + gy * gy + gz * gz)
        is_shown = lit if short <= 0.0 else 0.0
        ahead[j] -= is_shown
        is_better = lit > 0.0 and cost < looks[COST, j]
        looks[COST, j] = cost if is_better else looks[COST, j]
        looks[SHORT, j] = short if is_better else looks[SHORT, j]
        looks[SLOPE, j] = gx if is_better else looks[SLOPE, j]
        looks[SLOPE + 1, j] = gy if is_better else looks[SLOPE + 1, j]
        looks[SLOPE + 2, j] = gz if is_better else looks[SLOPE + 2, j]


@compiled(error_model="numpy", fastmath={"contract"})
def fitted_push(
    work: Workspace, lane: int, now: float, rate: float, damping: float
) -> tuple[float, float, float]:
    """Return the push, m/s, that brings all looks sought nearest to showing their points, damped.

    Solves ``(damping I + sum w g g^T) dv = sum w g short`` by Cramer's rule.
    """
    xx, yy, zz, xy, xz, yz = damping * KS2, damping * KS2, damping * KS2, 0.0, 0.0, 0.0
    bx, by, bz = 0.0, 0.0, 0.0
    for j in range(len(work.ahead)):
        if work.ahead[j] == 0.0 or work.looks[COST, j] == np.inf:
            continue
        weight = exp((now - work.deadlines[lane, j]) * rate)
        gx, gy, gz = work.looks[SLOPE, j], work.looks[SLOPE + 1, j], work.looks[SLOPE + 2, j]
        wx, wy, wz = weight * gx, weight * gy, weight * gz
        xx, yy, zz = xx + wx * gx, yy + wy * gy, zz + wz * gz
        xy, xz, yz = xy + wx * gy, xz + wx * gz, yz + wy * gz
        short = work.looks[SHORT, j]
        bx, by, bz = bx + wx * short, by + wy * short, bz + wz * short
    cxx, cyy, czz = yy * zz - yz * yz, xx * zz - xz * xz, xx * yy - xy * xy
    cxy, cxz, cyz = xz * yz - xy * zz, xy * yz - xz * yy, xy * xz - xx * yz
    inverse = 1.0 / (xx * cxx + xy * cxy + xz * cxz)
    return (
        (cxx * bx + cxy * by + cxz * bz) * inverse,
        (cxy * bx + cyy * by + cyz * bz) * inverse,
        (cxz * bx + cyz * by + czz * bz) * inverse,
    )


@compiled(error_model="numpy", fastmath={"contract"})
def sense_push(
    world: World, law: Law, values: Floats, work: Workspace, num_lanes: int, k: int, is_logged: bool
) -> None:
    """Write the push that shows what sets, and the aim, of lanes that may fire; of all where it is logged."""
    signals, now, n = work.signals, world.control_period * k, world.mean_motion
    turned_cos, turned_sin = cos(n * now), sin(n * now)
    look_turn = n * world.control_period * world.look_stride
    look_cos, look_sin = cos(look_turn), sin(look_turn)
    rate = 1.0 / values[law.constants + URGENCY_TIME]
    horizon, damping = values[law.constants + SEE_HORIZON], values[law.constants + SEE_DAMPING]
    skirt, urgent = values[law.constants + SKIRT_DISTANCE], values[law.constants + AIM_URGENT]
    radius = sqrt(world.horizon)
    is_turning = len(world.points) > 1
    farthest = int(horizon / (world.control_period * world.look_stride) + 1e-9)
    num_looks = min(farthest, (world.num_controls - k) // world.look_stride)
    for lane in range(num_lanes):
        dx, dy, dz = 0.0, 0.0, 0.0
        is_idle = work.lanes[COASTS + lane] > 0.0 and not is_logged
        if not is_idle and await_dark(work, lane, now, horizon) > 0.0:
            sx = work.lanes[SUN_COS + lane] * turned_cos + work.lanes[SUN_SIN + lane] * turned_sin
            sy = work.lanes[SUN_SIN + lane] * turned_cos - work.lanes[SUN_COS + lane] * turned_sin
            rx, ry, rz = work.lanes[RX + lane], work.lanes[RY + lane], work.lanes[RZ + lane]
            vx, vy, vz = work.lanes[VX + lane], work.lanes[VY + lane], work.lanes[VZ + lane]
            for look in range(1, num_looks + 1):
                sx, sy = sx * look_cos + sy * look_sin, sy * look_cos - sx * look_sin
                place = place_of(world.looks, look)
                px, py, pz = drifted_place(place, rx, ry, rz, vx, vy, vz)
                sample = k + look * world.look_stride if is_turning else 0
                look_from(
                    world.points,
                    sample,
                    radius,
                    work.ahead,
                    work.looks,
                    place,
                    px,
                    py,
                    pz,
                    sx,
                    sy,
                    world.sun_threshold,
                )
            dx, dy, dz = fitted_push(work, lane, now, rate, damping)
            distance = sqrt(rx * rx + ry * ry + rz * rz)
            if distance < skirt and skirt > world.min_distance:
                inward = max(0.0, -(dx * rx + dy * ry + dz * rz) / distance)
                nearness = min(1.0, (skirt - distance) / (skirt - world.min_distance))
                turned_away = 2.0 * nearness * inward / distance
                dx, dy, dz = dx + turned_away * rx, dy + turned_away * ry, dz + turned_away * rz
        signals[LANES * PUSH + lane] = dx
        signals[LANES * (PUSH + 1) + lane] = dy
        signals[LANES * (PUSH + 2) + lane] = dz
        for component in range(3):
            signals[LANES * (AIM + component) + lane] = (
                signals[LANES * (PUSH + component) + lane]
                + urgent * signals[LANES * (URGENT + component) + lane]
            )
