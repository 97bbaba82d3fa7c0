"""Lit and visible points where light or camera are not the paper's: shadow, incidence, range, a mesh.

For the paper's, `pipeline.physics.sight` is one line, and nothing here is compiled.
`closely` is None where no part of the chief hides another and brightness does not matter, as in
most worlds: a run-time check would slow flights by a sixth. Plain version in
`pipeline.flight.reference.sight`.
"""

from math import cos, sin, sqrt
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fis_tools.compiled.decorator import compiled
from fis_tools.compiled.vectors import Mask, Vector, borrowed, count, load, select, some, store
from pipeline.flight.period.look.guidance import POINTS
from pipeline.flight.state.arrays import Beyond, Workspace, World
from pipeline.physics.occlusion import cell_of
from pipeline.physics.reflection import is_bright
from pipeline.physics.sight import HEIGHT, NORMAL, SQUARE, is_lit, is_resolved, is_sunlit, sunlight

Floats = NDArray[np.float64]
Bytes = NDArray[np.uint8]

#: strides of samples in the search for points not yet found lit: coarse first, as most are soon found
SPACINGS = (32, 8, 1)


class Beam(NamedTuple):
    """Sunlight at a sample: its direction in Hill axes, and the matching cell of the chief's occlusion."""

    x: float
    y: float
    z: float
    cell: int
    shines: bool


class Eye(NamedTuple):
    """A camera: its place (m), unit vectors along its boresight and to the Sun, and whether it is blinded."""

    x: float
    y: float
    z: float
    bx: float
    by: float
    bz: float
    sun_x: float
    sun_y: float
    sun_z: float
    is_blind: bool


@compiled(error_model="numpy")
def cell_towards(world: World, sample: int, x: float, y: float, z: float) -> int:
    """Return the cell of the chief's occlusion that a direction in Hill axes falls into."""
    axes = world.chief_axes
    return cell_of(
        world.num_edge_cells,
        axes[sample, 0, 0] * x + axes[sample, 0, 1] * y + axes[sample, 0, 2] * z,
        axes[sample, 1, 0] * x + axes[sample, 1, 1] * y + axes[sample, 1, 2] * z,
        axes[sample, 2, 0] * x + axes[sample, 2, 1] * y + axes[sample, 2, 2] * z,
    )


@compiled(error_model="numpy", forceinline=True)
def beam_from(
    world: World,
    closely: bool | None,
    k: int,
    sun_x: float,
    sun_y: float,
    cos_elevation: float,
    sin_elevation: float,
) -> Beam:
    """Return the sunlight at sample k from the Sun's direction in the plane and its elevation."""
    x, y, z = sunlight(world.optics, sun_x, sun_y, cos_elevation, sin_elevation)
    cell = 0
    if closely is not None and world.num_edge_cells > 0:
        cell = cell_towards(world, k if len(world.points) > 1 else 0, x, y, z)
    return Beam(x, y, z, cell, x * x + y * y + z * z > 0.0)


@compiled(error_model="numpy", forceinline=True)
def beam_at(
    world: World, closely: bool | None, work: Workspace, lane: int, k: int, sun_x: float, sun_y: float
) -> Beam:
    """Return the sunlight of a lane at sample k from the Sun's direction in the plane."""
    lanes = work.lanes
    return beam_from(world, closely, k, sun_x, sun_y, lanes.sun_height[0, lane], lanes.sun_height[1, lane])


@compiled(error_model="numpy", forceinline=True)
def eye_at(world: World, beam: Beam, x: float, y: float, z: float, bx: float, by: float, bz: float) -> Eye:
    """Return the camera at a place, with a unit vector as boresight."""
    is_blind = bx * beam.x + by * beam.y + bz * beam.z > world.optics.most_sunward
    return Eye(x, y, z, bx, by, bz, beam.x, beam.y, beam.z, is_blind)


@compiled(error_model="numpy", forceinline=True)
def eye_on_chief(world: World, beam: Beam, x: float, y: float, z: float) -> Eye:
    """Return the camera at a place, aimed at the chief's centre."""
    per_distance = -1.0 / sqrt(x * x + y * y + z * z)
    return eye_at(world, beam, x, y, z, per_distance * x, per_distance * y, per_distance * z)


@compiled(error_model="numpy", forceinline=True)
def lit_through(
    world: World, closely: bool | None, work: Workspace, sample: int, j: int, wanted: Mask, beam: Beam
) -> Mask:
    """Return which of the wanted points from j on are lit."""
    surface = world.surface
    along = beam.x * load(surface, (sample, NORMAL, j), POINTS)
    along += beam.y * load(surface, (sample, NORMAL + 1, j), POINTS)
    along += beam.z * load(surface, (sample, NORMAL + 2, j), POINTS)
    along += world.optics.past_terminator if beam.shines else 0.0
    lit = wanted & is_sunlit(along, load(surface, (sample, HEIGHT, j), POINTS))
    if closely is not None and world.num_edge_cells > 0:
        store(work.lit, j, select(lit, 1.0, 0.0))
        for i in range(j, min(j + POINTS, world.num_points)):
            work.lit[i] *= world.is_free[beam.cell, i]
        lit = load(work.lit, j, POINTS) > 0.0
    return lit


@compiled(error_model="numpy")
def leave_out_hidden(world: World, work: Workspace, sample: int, j: int, eye: Eye) -> None:
    """Remove from `work.seen`, from j on, the points that the chief hides from a camera."""
    points = world.points
    for i in range(j, min(j + POINTS, world.num_points)):
        if work.seen[i] > 0.0:
            x, y, z = eye.x - points[sample, 0, i], eye.y - points[sample, 1, i], eye.z - points[sample, 2, i]
            work.seen[i] = world.is_free[cell_towards(world, sample, x, y, z), i]


@compiled(error_model="numpy")
def leave_out_dim(world: World, work: Workspace, sample: int, j: int, eye: Eye) -> None:
    """Remove from `work.seen`, from j on, the points that are too dim or too bright for a camera."""
    surface, points = world.surface, world.points
    for i in range(j, min(j + POINTS, world.num_points)):
        if work.seen[i] > 0.0 and not is_bright(
            world.reflection,
            surface[sample, NORMAL, i],
            surface[sample, NORMAL + 1, i],
            surface[sample, NORMAL + 2, i],
            eye.sun_x,
            eye.sun_y,
            eye.sun_z,
            eye.x - points[sample, 0, i],
            eye.y - points[sample, 1, i],
            eye.z - points[sample, 2, i],
        ):
            work.seen[i] = 0.0


@compiled(error_model="numpy", forceinline=True)
def seen_through(
    world: World,
    closely: bool | None,
    work: Workspace,
    sample: int,
    j: int,
    lit: Mask,
    eye: Eye,
) -> Mask:
    """Return which of the lit points from j on a camera sees."""
    optics, points = world.optics, world.points
    surface, x, y, z = world.surface, eye.x, eye.y, eye.z
    px, py = load(points, (sample, 0, j), POINTS), load(points, (sample, 1, j), POINTS)
    pz = load(points, (sample, 2, j), POINTS)
    above = x * load(surface, (sample, NORMAL, j), POINTS)
    above += y * load(surface, (sample, NORMAL + 1, j), POINTS)
    above += z * load(surface, (sample, NORMAL + 2, j), POINTS)
    above -= load(surface, (sample, HEIGHT, j), POINTS)
    towards = (px * eye.bx + py * eye.by + pz * eye.bz) - (x * eye.bx + y * eye.by + z * eye.bz)
    squared = load(surface, (sample, SQUARE, j), POINTS) + (x * x + y * y + z * z)
    squared -= 2.0 * (px * x + py * y + pz * z)
    seen = lit & is_resolved(optics, above, towards, squared)
    if closely is not None:
        store(work.seen, j, select(seen, 1.0, 0.0))
        if world.num_edge_cells > 0:
            leave_out_hidden(world, work, sample, j, eye)
        if world.reflection.is_on:
            leave_out_dim(world, work, sample, j, eye)
        seen = load(work.seen, j, POINTS) > 0.0
    return seen


@compiled(error_model="numpy", forceinline=True)
def strike_out_seen(
    world: World, optics: Beyond, work: Workspace, k: int, beam: Beam, x: float, y: float, z: float
) -> int:
    """Remove lit points that a camera aimed at the chief's centre sees from `work.ahead`; return how many."""
    sample, num_seen, eye = (k if len(world.points) > 1 else 0), 0, eye_on_chief(world, beam, x, y, z)
    if beam.shines and not eye.is_blind:
        for j in range(0, len(work.ahead), POINTS):
            before = load(work.ahead, j, POINTS)
            wanted = before > 0.0
            if some(wanted):
                lit = lit_through(world, optics.closely, work, sample, j, wanted, beam)
                if some(lit):
                    seen = seen_through(world, optics.closely, work, sample, j, lit, eye)
                    store(work.ahead, j, select(seen, 0.0, before))
                    num_seen += count(seen)
    return num_seen


@compiled(error_model="numpy", forceinline=True)
def lit_points(
    world: World,
    optics: Beyond | None,
    work: Workspace,
    sample: int,
    j: int,
    wanted: Mask,
    px: Vector,
    py: Vector,
    sun_x: float,
    sun_y: float,
    beam: Beam,
) -> Mask:
    """Return which of the wanted points from j on are lit, in the paper's world or in another."""
    if optics is None:
        return wanted & is_lit(world.sight, px, py, sun_x, sun_y)
    return lit_through(world, optics.closely, work, sample, j, wanted, beam)


@compiled(error_model="numpy", forceinline=True)
def any_beam(
    world: World, optics: Beyond | None, work: Workspace, lane: int, k: int, sun_x: float, sun_y: float
) -> Beam:
    """Return the sunlight in the form that `lit_points` takes; in the paper's world it is not used."""
    if optics is None:
        return Beam(0.0, 0.0, 0.0, 0, True)
    return beam_at(world, optics.closely, work, lane, k, sun_x, sun_y)


@compiled(error_model="numpy", forceinline=True)
def sun_after(world: World, start_x: float, start_y: float, k: int) -> tuple[float, float]:
    """Return cosine and sine of the Sun's angle at a sample from those at the start."""
    turned = world.mean_motion * world.control_period * k
    turned_x, turned_y = cos(turned), sin(turned)
    return start_x * turned_x + start_y * turned_y, start_y * turned_x - start_x * turned_y


@compiled(error_model="numpy", forceinline=True)
def want_all(world: World, work: Workspace) -> None:
    """Mark all points in `work.ahead`."""
    for j in range(len(work.ahead)):
        work.ahead[j] = 1.0 if j < world.num_points else 0.0


@compiled(error_model="numpy", forceinline=True)
def note_lit(
    world: World, optics: Beyond | None, work: Workspace, case: Any, start_x: float, start_y: float, k: int
) -> int:
    """Mark in `work.lit` the points of `work.ahead` lit at a sample of a case, and remove them there.

    Returns the number of vectors of points with some left.
    """
    points = world.points
    sample, num_left = (k if len(points) > 1 else 0), 0
    sun_x, sun_y = sun_after(world, start_x, start_y, k)
    beam = Beam(0.0, 0.0, 0.0, 0, True)
    if optics is not None:
        beam = beam_from(
            world, optics.closely, k, sun_x, sun_y, cos(case.sun_elevation), sin(case.sun_elevation)
        )
    for j in range(0, len(work.ahead), POINTS):
        wanted = load(work.ahead, j, POINTS) > 0.0
        px, py = load(points, (sample, 0, j), POINTS), load(points, (sample, 1, j), POINTS)
        lit = lit_points(world, optics, work, sample, j, wanted, px, py, sun_x, sun_y, beam)
        left = wanted ^ lit
        store(work.lit, j, select(lit, 1.0, 0.0))
        store(work.ahead, j, select(left, 1.0, 0.0))
        num_left += 1 if some(left) else 0
    return num_left


@compiled(nogil=True, error_model="numpy")
def note_inspectable(world: World, optics: Beyond | None, work: Workspace, cases: Any, found: Bytes) -> None:
    """Write which points are lit at some sample of each case's flight, shape (m, P padded) of 0 or 1."""
    world, work, cases, found = borrowed((world, work, cases, found))
    for row in range(len(cases)):
        case, num_left = cases[row], 1
        start_x, start_y = cos(case.sun_angle), sin(case.sun_angle)
        want_all(world, work)
        for spacing in SPACINGS:
            for k in range(0, world.num_controls + 1 if num_left > 0 else 0, spacing):
                num_left = note_lit(world, optics, work, case, start_x, start_y, k)
                if num_left == 0:
                    break
        for j in range(len(work.ahead)):
            found[row, j] = 1 if j < world.num_points and work.ahead[j] == 0.0 else 0


@compiled(nogil=True, error_model="numpy")
def note_lit_at_samples(
    world: World, optics: Beyond | None, work: Workspace, cases: Any, found: Bytes
) -> None:
    """Write which points are lit at each sample of the first case's flight, shape (K+1, P padded), 0 or 1."""
    case = cases[0]
    start_x, start_y = cos(case.sun_angle), sin(case.sun_angle)
    for k in range(len(found)):
        want_all(world, work)
        note_lit(world, optics, work, case, start_x, start_y, k)
        for j in range(len(work.lit)):
            found[k, j] = work.lit[j] > 0.0


@compiled(nogil=True, error_model="numpy")
def note_seen_along(
    world: World,
    optics: Beyond,
    work: Workspace,
    cases: Any,
    paths: Floats,
    stride: int,
    counts: NDArray[np.int64],
) -> None:
    """Write the number of points that a camera aimed at the chief inspects along paths, (n, samples, 3), m.

    Places are `stride` control periods apart, from the first case's start on.
    """
    world, work, cases, paths, counts = borrowed((world, work, cases, paths, counts))
    case = cases[0]
    start_x, start_y = cos(case.sun_angle), sin(case.sun_angle)
    high, low = cos(case.sun_elevation), sin(case.sun_elevation)
    for path in range(len(paths)):
        want_all(world, work)
        for place in range(paths.shape[1]):
            k = place * stride
            sun_x, sun_y = sun_after(world, start_x, start_y, k)
            beam = beam_from(world, optics.closely, k, sun_x, sun_y, high, low)
            x, y, z = paths[path, place, 0], paths[path, place, 1], paths[path, place, 2]
            counts[path] += strike_out_seen(world, optics, work, k, beam, x, y, z)
