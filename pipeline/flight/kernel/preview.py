"""What the deputies of all lanes would see if they fired no more: free motion followed to the flight's end.

Places are foreseen every `pipeline.flight.preview.PREVIEW_PERIOD_S`, with the camera on the chief's centre.
Written out plainly in `pipeline.flight.reference.preview`.
"""

from math import cos, sin, sqrt

import numpy as np
from numpy.typing import NDArray

from fis_tools.engines.compiled import compiled
from fis_tools.engines.kernel import LANES
from pipeline.flight.kernel.arrays import (
    LEFT,
    RX,
    RY,
    RZ,
    SUN_COS,
    SUN_SIN,
    VX,
    VY,
    VZ,
    Workspace,
    World,
)
from pipeline.flight.signals import slot
from pipeline.physics.motion import drifted_place, drifted_velocity, step_of

Floats = NDArray[np.float64]

MISSED = slot("missed")
COASTING_NEAREST, COASTING_FARTHEST = slot("coasting_nearest"), slot("coasting_farthest")


# Sums over points may be taken in any order: that is what lets them run on vector units. Near and far have a
# loop each, with no flag to ask inside, so that from afar nobody pays for the test of the cone.
@compiled(error_model="numpy", fastmath={"contract", "reassoc", "nsz"})
def strike_out(
    points: Floats,
    sample: int,
    ahead: Floats,
    rx: float,
    ry: float,
    rz: float,
    sx: float,
    sy: float,
    sun_threshold: float,
    horizon: float,
) -> float:
    """Strike out the points that are lit and above the horizon of a place; return how many are left."""
    count = 0.0
    for j in range(len(ahead)):
        px, py, pz = points[sample, 0, j], points[sample, 1, j], points[sample, 2, j]
        seen = ahead[j] if px * sx + py * sy > sun_threshold else 0.0
        seen = seen if px * rx + py * ry + pz * rz >= horizon else 0.0
        ahead[j] -= seen
        count += ahead[j]
    return count


@compiled(error_model="numpy", fastmath={"contract", "reassoc", "nsz"})
def strike_out_near(
    points: Floats,
    sample: int,
    ahead: Floats,
    rx: float,
    ry: float,
    rz: float,
    sx: float,
    sy: float,
    sun_threshold: float,
    horizon: float,
    cos2: float,
) -> float:
    """Do the same where the chief does not fit into the camera's view, whose axis meets its centre."""
    squared_range = rx * rx + ry * ry + rz * rz
    count = 0.0
    for j in range(len(ahead)):
        px, py, pz = points[sample, 0, j], points[sample, 1, j], points[sample, 2, j]
        along = px * rx + py * ry + pz * rz
        dx, dy, dz = px - rx, py - ry, pz - rz
        towards = squared_range - along
        seen = ahead[j] if px * sx + py * sy > sun_threshold else 0.0
        seen = seen if along >= horizon else 0.0
        seen = seen if towards > 0.0 else 0.0
        seen = seen if towards * towards >= cos2 * squared_range * (dx * dx + dy * dy + dz * dz) else 0.0
        ahead[j] -= seen
        count += ahead[j]
    return count


@compiled(error_model="numpy", fastmath={"contract"})
def preview(world: World, work: Workspace, num_lanes: int, k: int) -> None:
    """Write how many points every lane would miss by coasting, and between which distances it would be."""
    lanes, signals, ahead = work.lanes, work.signals, work.ahead
    n, stride = world.mean_motion, world.preview_stride
    turned = n * world.control_period * k
    turned_cos, turned_sin = cos(turned), sin(turned)
    # the places lie on the same instants whenever they are foreseen, counted back from the end
    first = (world.num_controls - k - 1) % stride + 1
    turns = (n * world.control_period * first, n * world.control_period * stride)
    first_cos, first_sin, stride_cos, stride_sin = cos(turns[0]), sin(turns[0]), cos(turns[1]), sin(turns[1])
    is_turning = len(world.points) > 1
    # from here on the chief, a sphere, fits into the cone of view: sin(half angle) >= radius / distance
    squared_fit = world.horizon / (1.0 - world.cos_half_angle_squared)
    for lane in range(num_lanes):
        count = lanes[LEFT + lane]
        sx = lanes[SUN_COS + lane] * turned_cos + lanes[SUN_SIN + lane] * turned_sin
        sy = lanes[SUN_SIN + lane] * turned_cos - lanes[SUN_COS + lane] * turned_sin
        rx, ry, rz = lanes[RX + lane], lanes[RY + lane], lanes[RZ + lane]
        vx, vy, vz = lanes[VX + lane], lanes[VY + lane], lanes[VZ + lane]
        nearest = rx * rx + ry * ry + rz * rz
        farthest = nearest
        for j in range(len(ahead)):
            ahead[j] = work.unseen[lane, j]
        step, turn_cos, turn_sin = first, first_cos, first_sin
        sample = k
        while sample < world.num_controls:
            sample += step
            leap = step_of(world.strides, step)
            px, py, pz = drifted_place(leap.place, rx, ry, rz, vx, vy, vz)
            vx, vy, vz = drifted_velocity(leap, rx, rz, vx, vy, vz)
            rx, ry, rz = px, py, pz
            sx, sy = sx * turn_cos + sy * turn_sin, sy * turn_cos - sx * turn_sin
            step, turn_cos, turn_sin = stride, stride_cos, stride_sin
            squared = rx * rx + ry * ry + rz * rz
            nearest, farthest = min(nearest, squared), max(farthest, squared)
            if count == 0.0:
                continue
            row = sample if is_turning else 0
            if squared >= squared_fit:
                count = strike_out(
                    world.points, row, ahead, rx, ry, rz, sx, sy, world.sun_threshold, world.horizon
                )
            else:
                count = strike_out_near(
                    world.points,
                    row,
                    ahead,
                    rx,
                    ry,
                    rz,
                    sx,
                    sy,
                    world.sun_threshold,
                    world.horizon,
                    world.cos_half_angle_squared,
                )
        signals[LANES * MISSED + lane] = count
        signals[LANES * COASTING_NEAREST + lane] = sqrt(nearest)
        signals[LANES * COASTING_FARTHEST + lane] = sqrt(farthest)
