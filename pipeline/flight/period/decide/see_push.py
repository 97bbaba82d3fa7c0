"""For all lanes, the push that would show points that coasting misses and that soon go dark for good.

For each such point the cheapest look from the coasting path is found; one regularised least-squares push
serves them all. The page on signals derives it. Plain version in `pipeline.flight.reference.see_push`.
"""

from math import cos, sin, sqrt

import numpy as np
from numpy.typing import NDArray

from fis_tools.compiled.decorator import compiled
from fis_tools.compiled.vectors import count, load, select, some, splat, store, total
from pipeline.flight.period.look.guidance import POINTS
from pipeline.flight.period.look.optics import beam_at, eye_on_chief, lit_through, seen_through
from pipeline.flight.state.arrays import Beyond, Law, Workspace, World
from pipeline.flight.state.elementary import exponential
from pipeline.flight.state.preview import LEAST_SHORT_M, SQUARED_NEAR_M2
from pipeline.flight.state.signals import constant, slot
from pipeline.physics.motion import Place, drifted_place, place_of, slopes
from pipeline.physics.sight import HEIGHT, NORMAL, is_lit

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


@compiled(error_model="numpy", forceinline=True)
def await_dark(work: Workspace, lane: int, now: float, horizon: float) -> int:
    """Mark the points unseen whose last light is still to come within the horizon; return how many."""
    num_waiting = 0
    for j in range(0, len(work.ahead), POINTS):
        last = load(work.deadlines, (lane, j), POINTS)
        waits = (load(work.unseen, (lane, j), POINTS) > 0.0) & (last > now) & (last <= now + horizon)
        store(work.ahead, j, select(waits, 1.0, 0.0))
        store(work.looks, (COST, j), splat(np.inf, POINTS))
        num_waiting += count(waits)
    return num_waiting


@compiled(error_model="numpy", forceinline=True)
def look_from(
    world: World,
    work: Workspace,
    sample: int,
    place: Place,
    rx: float,
    ry: float,
    rz: float,
    sun_x: float,
    sun_y: float,
) -> None:
    """Remove the points visible from a place of the path; for the others keep the cheapest look so far."""
    points, ahead, looks, sight = world.points, work.ahead, work.looks, world.sight
    radius = sqrt(sight.horizon)
    per_radius = 1.0 / radius
    near = LEAST_SHORT_M if rx * rx + ry * ry + rz * rz < SQUARED_NEAR_M2 else -np.inf
    for j in range(0, len(ahead), POINTS):
        before = load(ahead, j, POINTS)
        if not some(before > 0.0):
            continue
        px, py = load(points, (sample, 0, j), POINTS), load(points, (sample, 1, j), POINTS)
        pz = load(points, (sample, 2, j), POINTS)
        lit = (before > 0.0) & is_lit(sight, px, py, sun_x, sun_y)
        if not some(lit):
            continue
        px, py, pz = px * per_radius, py * per_radius, pz * per_radius
        short = radius - (px * rx + py * ry + pz * rz)
        short = select(short > near, short, near)
        _, _, _, gx, gy, gz = slopes(place, px, py, pz)
        cost = short * short / (gx * gx + gy * gy + gz * gz)
        cheapest = load(looks, (COST, j), POINTS)
        is_better = lit & (cost < cheapest)
        store(ahead, j, select(lit & (short <= 0.0), 0.0, before))
        store(looks, (COST, j), select(is_better, cost, cheapest))
        store(looks, (SHORT, j), select(is_better, short, load(looks, (SHORT, j), POINTS)))
        store(looks, (SLOPE, j), select(is_better, gx, load(looks, (SLOPE, j), POINTS)))
        store(looks, (SLOPE + 1, j), select(is_better, gy, load(looks, (SLOPE + 1, j), POINTS)))
        store(looks, (SLOPE + 2, j), select(is_better, gz, load(looks, (SLOPE + 2, j), POINTS)))


@compiled(error_model="numpy", forceinline=True)
def look_through_from(
    world: World,
    beyond: Beyond,
    work: Workspace,
    lane: int,
    k: int,
    place: Place,
    rx: float,
    ry: float,
    rz: float,
    sun_x: float,
    sun_y: float,
) -> None:
    """Do what `look_from` does where light or camera are not the paper's.

    A look's shortfall is its largest deficit: of the height that the incidence limit needs at its distance,
    or of nearness. It is linearised about the previewed place.
    """
    points, surface, ahead, looks, optics = (
        world.points,
        world.surface,
        work.ahead,
        work.looks,
        world.optics,
    )
    sample, cosine, reach = (
        (k if len(points) > 1 else 0),
        sqrt(optics.incidence_squared),
        sqrt(optics.range_squared),
    )
    beam = beam_at(world, beyond.closely, work, lane, k, sun_x, sun_y)
    eye = eye_on_chief(world, beam, rx, ry, rz)
    for j in range(0, len(ahead) if beam.shines else 0, POINTS):
        before = load(ahead, j, POINTS)
        wanted = before > 0.0
        if not some(wanted):
            continue
        lit = lit_through(world, beyond.closely, work, sample, j, wanted, beam)
        if not some(lit):
            continue
        nx, ny = (
            load(surface, (sample, NORMAL, j), POINTS),
            load(surface, (sample, NORMAL + 1, j), POINTS),
        )
        nz = load(surface, (sample, NORMAL + 2, j), POINTS)
        dx, dy = rx - load(points, (sample, 0, j), POINTS), ry - load(points, (sample, 1, j), POINTS)
        dz = rz - load(points, (sample, 2, j), POINTS)
        distance = np.sqrt(dx * dx + dy * dy + dz * dz)
        per = 1.0 / distance
        above = nx * rx + ny * ry + nz * rz - load(surface, (sample, HEIGHT, j), POINTS)
        short, far = cosine * distance - above, distance - reach
        is_far, lean = far > short, cosine * per
        wx = select(is_far, -dx * per, nx - lean * dx)
        wy = select(is_far, -dy * per, ny - lean * dy)
        wz = select(is_far, -dz * per, nz - lean * dz)
        short = select(is_far, far, short)
        short = select(short > LEAST_SHORT_M, short, LEAST_SHORT_M)
        _, _, _, gx, gy, gz = slopes(place, wx, wy, wz)
        cost = short * short / (gx * gx + gy * gy + gz * gz)
        cheapest = load(looks, (COST, j), POINTS)
        is_better = lit & (cost < cheapest)
        if not eye.is_blind:
            seen = seen_through(world, beyond.closely, work, sample, j, lit, eye)
            store(ahead, j, select(seen, 0.0, before))
        store(looks, (COST, j), select(is_better, cost, cheapest))
        store(looks, (SHORT, j), select(is_better, short, load(looks, (SHORT, j), POINTS)))
        store(looks, (SLOPE, j), select(is_better, gx, load(looks, (SLOPE, j), POINTS)))
        store(looks, (SLOPE + 1, j), select(is_better, gy, load(looks, (SLOPE + 1, j), POINTS)))
        store(looks, (SLOPE + 2, j), select(is_better, gz, load(looks, (SLOPE + 2, j), POINTS)))


@compiled(error_model="numpy")
def fitted_push(
    work: Workspace, lane: int, now: float, rate: float, damping: float
) -> tuple[float, float, float]:
    """Return the damped push, m/s, that brings all looks closest to showing their points.

    Solves ``(damping I + sum w g g^T) dv = sum w g short`` by Cramer's rule.
    """
    nothing = splat(0.0, POINTS)
    sum_xx, sum_yy, sum_zz, sum_xy, sum_xz, sum_yz = nothing, nothing, nothing, nothing, nothing, nothing
    sum_x, sum_y, sum_z = nothing, nothing, nothing
    for j in range(0, len(work.ahead), POINTS):
        counts = load(work.ahead, j, POINTS) > 0.0
        counts &= load(work.looks, (COST, j), POINTS) < np.inf
        if some(counts):
            weight = exponential((now - load(work.deadlines, (lane, j), POINTS)) * rate)
            weight = select(counts, weight, 0.0)
            gx, gy = load(work.looks, (SLOPE, j), POINTS), load(work.looks, (SLOPE + 1, j), POINTS)
            gz, short = load(work.looks, (SLOPE + 2, j), POINTS), load(work.looks, (SHORT, j), POINTS)
            gx, gy, gz = select(counts, gx, 0.0), select(counts, gy, 0.0), select(counts, gz, 0.0)
            wx, wy, wz = weight * gx, weight * gy, weight * gz
            short = select(counts, short, 0.0)
            sum_xx, sum_yy, sum_zz = sum_xx + wx * gx, sum_yy + wy * gy, sum_zz + wz * gz
            sum_xy, sum_xz, sum_yz = sum_xy + wx * gy, sum_xz + wx * gz, sum_yz + wy * gz
            sum_x, sum_y, sum_z = sum_x + wx * short, sum_y + wy * short, sum_z + wz * short
    least = damping * KS2
    xx, yy, zz = least + total(sum_xx), least + total(sum_yy), least + total(sum_zz)
    xy, xz, yz = total(sum_xy), total(sum_xz), total(sum_yz)
    bx, by, bz = total(sum_x), total(sum_y), total(sum_z)
    cxx, cyy, czz = yy * zz - yz * yz, xx * zz - xz * xz, xx * yy - xy * xy
    cxy, cxz, cyz = xz * yz - xy * zz, xy * yz - xz * yy, xy * xz - xx * yz
    inverse = 1.0 / (xx * cxx + xy * cxy + xz * cxz)
    return (
        (cxx * bx + cxy * by + cxz * bz) * inverse,
        (cxy * bx + cyy * by + cyz * bz) * inverse,
        (cxz * bx + cyz * by + czz * bz) * inverse,
    )


@compiled(error_model="numpy")
def sense_push(
    world: World,
    optics: Beyond | None,
    law: Law,
    values: Floats,
    work: Workspace,
    num_lanes: int,
    k: int,
    is_logged: bool,
) -> None:
    """Write the push that shows setting points, and the aim, of lanes that may fire; of all if logged."""
    lanes, signals, now = work.lanes, work.signals, world.control_period * k
    look_turn = world.mean_motion * world.control_period * world.look_stride
    look_cos, look_sin = cos(look_turn), sin(look_turn)
    rate = 1.0 / values[law.constants + URGENCY_TIME]
    horizon, damping = values[law.constants + SEE_HORIZON], values[law.constants + SEE_DAMPING]
    skirt, urgent = values[law.constants + SKIRT_DISTANCE], values[law.constants + AIM_URGENT]
    farthest = int(horizon / (world.control_period * world.look_stride) + 1e-9)
    num_looks = min(farthest, (world.num_controls - k) // world.look_stride)
    for lane in range(num_lanes):
        dx, dy, dz = 0.0, 0.0, 0.0
        is_idle = lanes.coasts[lane] > 0.0 and not is_logged
        if not is_idle and await_dark(work, lane, now, horizon) > 0:
            sun_x, sun_y = lanes.sun[0, lane], lanes.sun[1, lane]
            rx, ry, rz = lanes.position[0, lane], lanes.position[1, lane], lanes.position[2, lane]
            vx, vy, vz = lanes.velocity[0, lane], lanes.velocity[1, lane], lanes.velocity[2, lane]
            for look in range(1, num_looks + 1):
                sun_x, sun_y = sun_x * look_cos + sun_y * look_sin, sun_y * look_cos - sun_x * look_sin
                place = place_of(world.looks, look)
                px, py, pz = drifted_place(place, rx, ry, rz, vx, vy, vz)
                then = k + look * world.look_stride
                if optics is not None:
                    look_through_from(world, optics, work, lane, then, place, px, py, pz, sun_x, sun_y)
                    continue
                sample = then if len(world.points) > 1 else 0
                look_from(world, work, sample, place, px, py, pz, sun_x, sun_y)
            dx, dy, dz = fitted_push(work, lane, now, rate, damping)
            distance = sqrt(rx * rx + ry * ry + rz * rz)
            if distance < skirt and skirt > world.min_distance:
                inward = max(0.0, -(dx * rx + dy * ry + dz * rz) / distance)
                nearness = min(1.0, (skirt - distance) / (skirt - world.min_distance))
                turned_away = 2.0 * nearness * inward / distance
                dx, dy, dz = dx + turned_away * rx, dy + turned_away * ry, dz + turned_away * rz
        signals[PUSH, lane], signals[PUSH + 1, lane], signals[PUSH + 2, lane] = dx, dy, dz
        for component in range(3):
            pushed, urged = signals[PUSH + component, lane], signals[URGENT + component, lane]
            signals[AIM + component, lane] = pushed + urgent * urged
