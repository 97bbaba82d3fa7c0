"""Preview for all lanes: the points that coasting to the flight's end would show.

Places are previewed every `pipeline.flight.state.preview.PREVIEW_PERIOD_S`, with the camera aimed at the
chief's centre. Plain version in `pipeline.flight.reference.preview`.
"""

from math import cos, sin, sqrt

import numpy as np
from numpy.typing import NDArray

from fis_tools.compiled.decorator import compiled
from fis_tools.compiled.vectors import count, load, select, some, store
from pipeline.flight.period.look.guidance import POINTS
from pipeline.flight.period.look.optics import beam_at, strike_out_seen
from pipeline.flight.state.arrays import Beyond, Workspace, World
from pipeline.flight.state.signals import slot
from pipeline.physics.motion import drifted_place, drifted_velocity, step_of
from pipeline.physics.sight import fits_from, is_facing, is_in_cone, is_lit

Floats = NDArray[np.float64]

MISSED = slot("missed")
COASTING_NEAREST, COASTING_FARTHEST = slot("coasting_nearest"), slot("coasting_farthest")


@compiled(error_model="numpy", forceinline=True)
def strike_out(
    world: World,
    ahead: Floats,
    sample: int,
    rx: float,
    ry: float,
    rz: float,
    sun_x: float,
    sun_y: float,
    is_near: bool,
) -> int:
    """Remove the points that are lit and in view of a place; return how many are left.

    They are in the order of `world.patches`: neighbours are seen shortly after one another, and
    vectors with none left are skipped.

    `is_near` where the chief does not fit into the field of view of a camera aimed at its centre.
    """
    sight, points = world.sight, world.patches
    squared_range = rx * rx + ry * ry + rz * rz
    num_left = 0
    for j in range(0, len(ahead), POINTS):
        before = load(ahead, j, POINTS)
        is_left = before > 0.0
        if not some(is_left):
            continue
        px, py = load(points, (sample, 0, j), POINTS), load(points, (sample, 1, j), POINTS)
        along = px * rx + py * ry + load(points, (sample, 2, j), POINTS) * rz
        seen = is_left & is_lit(sight, px, py, sun_x, sun_y) & is_facing(sight, along)
        if is_near:
            # the boresight is -r; on the sphere of the horizon, |p - r|^2 = |p|^2 + |r|^2 - 2 p . r
            squared = (sight.horizon + squared_range - 2.0 * along) * squared_range
            seen &= is_in_cone(sight, squared_range - along, squared)
        store(ahead, j, select(seen, 0.0, before))
        num_left += count(is_left ^ seen)
    return num_left


@compiled(error_model="numpy")
def preview(world: World, optics: Beyond | None, work: Workspace, num_lanes: int, k: int) -> None:
    """Write for every lane the points missed by coasting, and the least and greatest distance on the way."""
    lanes, signals, ahead = work.lanes, work.signals, work.ahead
    stride = world.preview_stride
    # the places fall on the same instants at every preview, counted back from the end
    first = (world.num_controls - k - 1) % stride + 1
    turn = world.mean_motion * world.control_period
    first_cos, first_sin = cos(turn * first), sin(turn * first)
    stride_cos, stride_sin = cos(turn * stride), sin(turn * stride)
    fits = fits_from(world.sight)
    for lane in range(num_lanes):
        num_left = int(lanes.num_unseen[lane])
        sun_x, sun_y = lanes.sun[0, lane], lanes.sun[1, lane]
        rx, ry, rz = lanes.position[0, lane], lanes.position[1, lane], lanes.position[2, lane]
        vx, vy, vz = lanes.velocity[0, lane], lanes.velocity[1, lane], lanes.velocity[2, lane]
        nearest = rx * rx + ry * ry + rz * rz
        farthest = nearest
        for j in range(len(ahead) if num_left > 0 else 0):
            ahead[j] = work.unseen[lane, j if optics is not None else world.order[j]]
        step, turn_cos, turn_sin = first, first_cos, first_sin
        sample = k
        while sample < world.num_controls:
            sample += step
            leap = step_of(world.strides, step)
            px, py, pz = drifted_place(leap.place, rx, ry, rz, vx, vy, vz)
            vx, vy, vz = drifted_velocity(leap, rx, rz, vx, vy, vz)
            rx, ry, rz = px, py, pz
            sun_x, sun_y = sun_x * turn_cos + sun_y * turn_sin, sun_y * turn_cos - sun_x * turn_sin
            step, turn_cos, turn_sin = stride, stride_cos, stride_sin
            squared = rx * rx + ry * ry + rz * rz
            nearest, farthest = min(nearest, squared), max(farthest, squared)
            if num_left == 0:
                continue
            row = sample if len(world.points) > 1 else 0
            if optics is not None:
                beam = beam_at(world, optics.closely, work, lane, sample, sun_x, sun_y)
                num_left -= strike_out_seen(world, optics, work, sample, beam, rx, ry, rz)
            elif squared >= fits:
                num_left = strike_out(world, ahead, row, rx, ry, rz, sun_x, sun_y, False)
            else:
                num_left = strike_out(world, ahead, row, rx, ry, rz, sun_x, sun_y, True)
        signals[MISSED, lane] = num_left
        signals[COASTING_NEAREST, lane] = sqrt(nearest)
        signals[COASTING_FARTHEST, lane] = sqrt(farthest)
