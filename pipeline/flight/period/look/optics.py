"""Which points of the chief are lit, and which a camera sees: in the paper's world, and in others.

`optics` is None where light and camera are the paper's: then each answer is one line of
`pipeline.physics.sight`, and numba leaves out the rest. `optics.by_point` is None where no part of the chief
hides another and brightness does not matter, as in most worlds: a run-time check would slow flights by a
sixth. Points are processed eight at a time.

`lit_marks` and `seen_marks`, shape (P padded,), are working arrays: 1 where a point is lit, or seen.
"""

from math import cos, sin, sqrt
from typing import Any, NamedTuple

import numpy as np

from fis_tools.compiled.decorator import compiled
from fis_tools.compiled.three import Three, cross, dot, lane_of, load_at, three_of, times
from fis_tools.compiled.vectors import Mask, Vector, borrowed, count, load, select, some, store
from pipeline.array_types import Bytes, Floats
from pipeline.flight.period.look.guidance import POINTS
from pipeline.flight.state.arrays import FullOptics, Moment, World
from pipeline.flight.state.lanes import attitude_of
from pipeline.physics.attitude import desired_y
from pipeline.physics.illumination import is_bright
from pipeline.physics.orbit import sun_moved
from pipeline.physics.quaternion import to_hill
from pipeline.physics.sight import (
    HEIGHT,
    NORMAL,
    SQUARE,
    cell_of,
    fits_from,
    is_facing,
    is_free,
    is_in_cone,
    is_in_rectangle,
    is_lit,
    is_resolved,
    is_sunlit,
    sunlight,
)

#: cosine and sine of an angle
Pair = tuple[Vector, Vector]
#: strides of samples in the search for points not yet found lit: coarse first, as most are soon found
SPACINGS = (32, 8, 1)


class Beam(NamedTuple):
    """Sunlight at a sample."""

    sun: Three  # unit vector towards the Sun, Hill axes; zeros in the Earth's shadow
    shines: bool
    cell: int  # of the chief's occlusion, in the Sun's direction
    sample: int  # row of the chief's points, and of its surface


class Eye(NamedTuple):
    """A camera at a position r, m, that looks along b, Hill axes."""

    position: Three
    boresight: Three
    up: Three  # in its image; perpendicular to the boresight; zeros where that does not matter
    beam: Beam
    square: float  # ``|r|^2``
    along: float  # ``r . b``
    length: float  # ``|b|^2``
    sees_all: bool  # whether the whole chief is in its field of view
    is_blind: bool  # whether the Sun blinds it


@compiled(error_model="numpy", forceinline=True)
def turned_back(angle: Pair, turn: Pair) -> Pair:
    """Return cosine and sine of an angle less another: by the addition theorem, without library functions."""
    (x, y), (turned_cos, turned_sin) = angle, turn
    return x * turned_cos + y * turned_sin, y * turned_cos - x * turned_sin


@compiled(error_model="numpy", forceinline=True)
def sun_after(world: World, sun: Pair, height: Pair, k: int) -> tuple[Pair, Pair]:
    """Return cosines and sines of the Sun's angle and elevation at a sample from those at the start.

    About the Earth, Hill axes turn with the chief's orbit, as oblateness and eccentricity have it.
    """
    if world.course.is_on:
        at_start = Three(height[0] * sun[0], height[0] * sun[1], height[1])
        moved = sun_moved(world.course, k, at_start)
        x, y, z = times(world.course.axes[2 * world.course.num_steps * k], moved)
        flat = np.sqrt(x * x + y * y)
        return (x / flat, y / flat), (flat, z)
    angle = world.mean_motion * world.control_period * k
    return turned_back(sun, (cos(angle), sin(angle))), height


@compiled(error_model="numpy", forceinline=True)
def sun_ahead(now: Moment, lane: int, k: int) -> tuple[Pair, Pair]:
    """Return cosines and sines of the Sun's angle and elevation at a sample, as a true course has them."""
    lanes = now.state.lanes
    flat, high = lanes.height_at_start[0, lane], lanes.height_at_start[1, lane]
    at_start = Three(flat * lanes.sun_at_start[0, lane], flat * lanes.sun_at_start[1, lane], high)
    x, y, z = times(now.world.transitions.suns[k], at_start)
    flat = sqrt(x * x + y * y)
    return (x / flat, y / flat), (flat, z)


@compiled(error_model="numpy")
def cell_towards(world: World, sample: int, direction: Three) -> int:
    """Return the cell of the chief's occlusion that a direction in Hill axes falls into."""
    return cell_of(world.occlusion.edge, times(world.chief_axes[sample], direction))


@compiled(error_model="numpy", forceinline=True)
def least_height_at(world: World, k: int) -> float:
    """Return the least component of the Sun's direction along i with which it shines at sample k."""
    return float(world.least_heights[k]) if len(world.least_heights) > 0 else world.optics.least_height


@compiled(error_model="numpy", forceinline=True)
def beam_from(world: World, optics: FullOptics | None, k: int, sun: Pair, height: Pair) -> Beam:
    """Return the sunlight at sample k from cosines and sines of the Sun's angle and elevation."""
    sample, cell = (k if len(world.points) > 1 else 0), 0
    if optics is None:
        return Beam(Three(sun[0], sun[1], 0.0), True, cell, sample)
    towards = sunlight(least_height_at(world, k), sun[0], sun[1], height[0], height[1])
    if optics.by_point is not None and world.occlusion.edge > 0:
        cell = cell_towards(world, sample, towards)
    return Beam(towards, dot(towards, towards) > 0.0, cell, sample)


@compiled(error_model="numpy", forceinline=True)
def beam_now(now: Moment, optics: FullOptics | None, lane: int) -> Beam:
    """Return the sunlight of a lane now."""
    sun, height = now.state.lanes.sun, now.state.lanes.sun_height
    high = height[0, lane], height[1, lane]
    return beam_from(now.world, optics, now.k, (sun[0, lane], sun[1, lane]), high)


@compiled(error_model="numpy")
def level(optics: FullOptics, boresight: Three) -> Three:
    """Return what is up in the image of a camera held as desired: the orbit normal, made perpendicular."""
    if optics.by_point is None:
        return Three(0.0, 0.0, 0.0)
    away = -1.0 * boresight
    return cross(away, desired_y(away, Three(0.0, 1.0, 0.0)))


@compiled(error_model="numpy", forceinline=True)
def up_now(now: Moment, optics: FullOptics | None, lane: int) -> Three:
    """Return what is up in the image of a lane's camera now, Hill axes."""
    if optics is None or optics.by_point is None:
        return Three(0.0, 0.0, 0.0)
    return to_hill(attitude_of(now.state.truth.attitude, lane), three_of(now.world.up))


@compiled(error_model="numpy", forceinline=True)
def eye_at(
    world: World, optics: FullOptics | None, beam: Beam, position: Three, boresight: Three, up: Three
) -> Eye:
    """Return the camera at a position, with unit vectors as boresight and as what is up in its image."""
    is_blind = optics is not None and dot(boresight, beam.sun) > world.optics.most_sunward
    along = dot(position, boresight)
    return Eye(position, boresight, up, beam, dot(position, position), along, 1.0, False, is_blind)


@compiled(error_model="numpy", forceinline=True)
def eye_on_chief(world: World, optics: FullOptics | None, beam: Beam, position: Three) -> Eye:
    """Return the camera at a position, aimed at the chief's centre."""
    square = dot(position, position)
    if optics is not None:
        boresight = (-1.0 / sqrt(square)) * position
        return eye_at(world, optics, beam, position, boresight, level(optics, boresight))
    # any length of the boresight will do
    sees_all, up = square >= fits_from(world.sight), Three(0.0, 0.0, 0.0)
    return Eye(position, -1.0 * position, up, beam, square, -square, square, sees_all, False)


@compiled(error_model="numpy", forceinline=True)
def lit_points(
    world: World,
    optics: FullOptics | None,
    lit_marks: Floats,
    j: int,
    points: Three,
    wanted: Mask,
    beam: Beam,
) -> Mask:
    """Return which of the wanted points from j on are lit."""
    if optics is None:
        return wanted & is_lit(world.sight, points.x, points.y, beam.sun.x, beam.sun.y)
    along = dot(beam.sun, load_at(world.surface, beam.sample, NORMAL, j, POINTS))
    along += world.optics.past_terminator if beam.shines else 0.0
    lit = wanted & is_sunlit(along, load(world.surface, (beam.sample, HEIGHT, j), POINTS))
    if optics.by_point is not None and world.occlusion.edge > 0:
        store(lit_marks, j, select(lit, 1.0, 0.0))
        for i in range(j, min(j + POINTS, world.num_points)):
            lit_marks[i] *= is_free(world.occlusion, beam.cell, i)
        lit = load(lit_marks, j, POINTS) > 0.0
    return lit


@compiled(error_model="numpy", forceinline=True)
def seen_points(
    world: World, optics: FullOptics | None, seen_marks: Floats, j: int, points: Three, lit: Mask, eye: Eye
) -> Mask:
    """Return which of the lit points from j on a camera sees."""
    along, towards = dot(points, eye.position), dot(points, eye.boresight) - eye.along
    if optics is None:
        # for points on the sphere of the horizon, |p - r|^2 = |p|^2 + |r|^2 - 2 p . r
        squared = (world.sight.horizon + eye.square - 2.0 * along) * eye.length
        seen = lit & is_facing(world.sight, along)
        return seen if eye.sees_all else seen & is_in_cone(world.sight, towards, squared)
    above = dot(eye.position, load_at(world.surface, eye.beam.sample, NORMAL, j, POINTS))
    above -= load(world.surface, (eye.beam.sample, HEIGHT, j), POINTS)
    squared = load(world.surface, (eye.beam.sample, SQUARE, j), POINTS) + eye.square
    squared -= 2.0 * along
    seen = lit & is_resolved(world.optics, above, towards, squared)
    if optics.by_point is not None:
        store(seen_marks, j, select(seen, 1.0, 0.0))
        if world.occlusion.edge > 0 or world.reflection.is_on or world.optics.tan_across < np.inf:
            leave_out_hidden_and_dim(world, seen_marks, j, eye)
        seen = load(seen_marks, j, POINTS) > 0.0
    return seen


@compiled(error_model="numpy")
def leave_out_hidden_and_dim(world: World, seen_marks: Floats, j: int, eye: Eye) -> None:
    """Remove from `seen_marks`, from j on, points outside a rectangle, hidden, too dim or too bright."""
    sample = eye.beam.sample
    for i in range(j, min(j + POINTS, world.num_points)):
        if seen_marks[i] == 0.0:
            continue
        to_camera = eye.position - lane_of(world.points[sample], 0, i)
        if world.optics.tan_across < np.inf and not is_in_rectangle(
            world.optics, to_camera, eye.boresight, eye.up
        ):
            seen_marks[i] = 0.0
            continue
        if world.occlusion.edge > 0:
            seen_marks[i] = is_free(world.occlusion, cell_towards(world, sample, to_camera), i)
        if world.reflection.is_on:
            normal = lane_of(world.surface[sample], NORMAL, i)
            if not is_bright(world.reflection, normal, eye.beam.sun, to_camera):
                seen_marks[i] = 0.0


@compiled(error_model="numpy", forceinline=True)
def strike_out_seen(
    world: World,
    optics: FullOptics | None,
    ahead: Floats,
    lit_marks: Floats,
    seen_marks: Floats,
    points: Floats,
    beam: Beam,
    position: Three,
) -> int:
    """Remove the points that a camera aimed at the chief's centre sees from `ahead`; return how many.

    `points` are in the order of `ahead`. Vectors with none left are skipped.
    """
    num_seen = 0
    eye = eye_on_chief(world, optics, beam, position)
    if beam.shines and not eye.is_blind:
        for j in range(0, len(ahead), POINTS):
            before = load(ahead, j, POINTS)
            wanted = before > 0.0
            if some(wanted):
                near = load_at(points, beam.sample, 0, j, POINTS)
                lit = lit_points(world, optics, lit_marks, j, near, wanted, beam)
                if optics is None or some(lit):
                    seen = seen_points(world, optics, seen_marks, j, near, lit, eye)
                    store(ahead, j, select(seen, 0.0, before))
                    num_seen += count(seen)
    return num_seen


@compiled(error_model="numpy", forceinline=True)
def want_all(world: World, ahead: Floats) -> None:
    """Mark all points of the chief as wanted."""
    for j in range(len(ahead)):
        ahead[j] = 1.0 if j < world.num_points else 0.0


@compiled(error_model="numpy", forceinline=True)
def beam_of_case(world: World, optics: FullOptics | None, case: Any, k: int) -> Beam:
    """Return the sunlight of a start, of `CASE`, at sample k."""
    at_start = (cos(case.sun_angle), sin(case.sun_angle)), (cos(case.sun_elevation), sin(case.sun_elevation))
    sun, height = sun_after(world, at_start[0], at_start[1], k)
    return beam_from(world, optics, k, sun, height)


@compiled(error_model="numpy", forceinline=True)
def note_lit(world: World, optics: FullOptics | None, ahead: Floats, lit_marks: Floats, beam: Beam) -> int:
    """Mark in `lit_marks` the points of `ahead` that are lit, and remove them from `ahead`.

    Returns the number of vectors of points with some left.
    """
    num_left = 0
    for j in range(0, len(ahead), POINTS):
        wanted = load(ahead, j, POINTS) > 0.0
        points = load_at(world.points, beam.sample, 0, j, POINTS)
        lit = lit_points(world, optics, lit_marks, j, points, wanted, beam)
        left = wanted ^ lit
        store(lit_marks, j, select(lit, 1.0, 0.0))
        store(ahead, j, select(left, 1.0, 0.0))
        num_left += 1 if some(left) else 0
    return num_left


@compiled(nogil=True, error_model="numpy")
def note_inspectable(
    world: World, optics: FullOptics | None, ahead: Floats, lit_marks: Floats, cases: Any, inspectable: Bytes
) -> None:
    """Write which points are lit at some sample of each case's flight, shape (m, P padded) of 0 or 1."""
    world, ahead, lit_marks, cases, inspectable = borrowed((world, ahead, lit_marks, cases, inspectable))
    for row in range(len(cases)):
        num_left = 1
        want_all(world, ahead)
        for spacing in SPACINGS:
            for k in range(0, world.num_controls + 1 if num_left > 0 else 0, spacing):
                num_left = note_lit(
                    world, optics, ahead, lit_marks, beam_of_case(world, optics, cases[row], k)
                )
                if num_left == 0:
                    break
        for j in range(len(ahead)):
            inspectable[row, j] = 1 if j < world.num_points and ahead[j] == 0.0 else 0
