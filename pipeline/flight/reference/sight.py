"""Illumination and visibility in the readable reference, law by law."""

import numpy as np
from numpy.typing import NDArray

from fis_tools.compiled.decorator import compiled
from fis_tools.compiled.vectors import borrowed
from pipeline.flight.reference.world import PlainWorld, turn_chief
from pipeline.physics.illumination import (
    ASTRONOMICAL_UNIT_M,
    is_illuminated,
    sun_angle,
    sun_direction_h,
    visible_share,
)
from pipeline.physics.occlusion import Occlusion, cell_of
from pipeline.physics.quaternion import dcm_b_from_h
from pipeline.physics.reflection import intensities
from pipeline.physics.vectors import dot, norm, times, transposed_times
from pipeline.physics.visibility import is_in_view, is_resolved

Floats = NDArray[np.float64]
Booleans = NDArray[np.bool_]


@compiled
def is_free(occlusion: Occlusion, point: int, dcm_c_from_h: Floats, direction_h: Floats) -> bool:
    """Return whether no part of a mesh obstructs a point in a direction."""
    direction = times(dcm_c_from_h, direction_h)
    cell = cell_of(occlusion.edge, direction[0], direction[1], direction[2])
    return bool(occlusion.is_free[cell, point] > 0)


@compiled
def lit_points(world: PlainWorld, quaternion_c_from_h: Floats, sun_h: Floats) -> Booleans:
    """Return which points the Sun lights, shape (P,): none while the Earth hides too much of its disc."""
    return lit_among(world, quaternion_c_from_h, sun_h, np.ones(len(world.points_c), dtype=np.bool_))


@compiled
def lit_among(world: PlainWorld, quaternion_c_from_h: Floats, sun_h: Floats, is_sought: Booleans) -> Booleans:
    """Return which of the points sought the Sun lights, shape (P,); see `lit_points`."""
    is_lit = np.zeros(len(is_sought), dtype=np.bool_)
    if world.has_shadow and visible_share(sun_h, world.orbit_radius) < world.min_sun_share:
        return is_lit
    dcm_c_from_h = dcm_b_from_h(quaternion_c_from_h)
    for i in range(len(is_lit)):
        if not is_sought[i]:
            continue
        point_h = transposed_times(dcm_c_from_h, world.points_c[i])
        if world.is_mesh:
            normal_h = transposed_times(dcm_c_from_h, world.normals_c[i])
            is_lit[i] = dot(normal_h, point_h - ASTRONOMICAL_UNIT_M * sun_h) < 0.0
        else:
            is_lit[i] = is_illuminated(point_h, sun_h)
        if world.past_terminator > 0.0:
            outward = transposed_times(dcm_c_from_h, world.normals_c[i])
            towards = sun_h - point_h / ASTRONOMICAL_UNIT_M
            is_lit[i] = is_lit[i] or dot(outward, towards) > -world.past_terminator
        is_lit[i] = is_lit[i] and (not world.is_mesh or is_free(world.occlusion, i, dcm_c_from_h, sun_h))
    return is_lit


@compiled
def seen_points(
    world: PlainWorld,
    quaternion_c_from_h: Floats,
    position_h: Floats,
    boresight_h: Floats,
    sun_h: Floats,
    is_sought: Booleans,
) -> Booleans:
    """Return which wanted points a camera sees from a place, along a boresight, shape (P,)."""
    is_seen = np.zeros(len(is_sought), dtype=np.bool_)
    dcm_c_from_h = dcm_b_from_h(quaternion_c_from_h)
    for i in range(len(is_sought)):
        if not is_sought[i]:
            continue
        point_h = transposed_times(dcm_c_from_h, world.points_c[i])
        if world.is_mesh:
            normal_h = transposed_times(dcm_c_from_h, world.normals_c[i])
            sight = point_h - position_h
            is_facing = dot(normal_h, sight) <= 0.0 and is_free(world.occlusion, i, dcm_c_from_h, -sight)
            is_seen[i] = is_facing and dot(sight, boresight_h) >= world.cos_half_angle * norm(sight)
        else:
            is_seen[i] = is_in_view(
                point_h, position_h, boresight_h, world.cos_half_angle, world.points_radius
            )
        if not is_seen[i]:
            continue
        normal_h = transposed_times(dcm_c_from_h, world.normals_c[i])
        if world.has_camera_limits:
            is_seen[i] = is_resolved(
                point_h,
                normal_h,
                position_h,
                boresight_h,
                sun_h,
                world.cos_max_incidence,
                world.max_range,
                world.cos_min_sun_angle,
            )
        if world.reflection.is_on and is_seen[i]:
            to_camera = (position_h - point_h) / norm(position_h - point_h)
            bright = intensities(world.reflection, normal_h, sun_h, to_camera)
            for colour in range(3):
                limits = world.reflection.least[colour], world.reflection.greatest[colour]
                is_seen[i] = is_seen[i] and limits[0] < bright[colour] < limits[1]
    return is_seen


@compiled
def lit_and_seen_points(
    world: PlainWorld,
    quaternions_c_from_h: Floats,
    quaternions_b_from_h: Floats,
    positions_h: Floats,
    suns_at: Floats,
    is_left: Booleans,
) -> tuple[Booleans, Booleans]:
    """Return which points are lit, and which lit ones a camera sees, at the samples of a flight.

    Parameters
    ----------
    world : PlainWorld
    quaternions_c_from_h, quaternions_b_from_h : (K+1, 4)
        Attitudes of chief and deputy.
    positions_h : (K+1, 3)
        Of the deputy, m, Hill axes.
    suns_at : (K+1, 2)
        Angle and elevation of the Sun, rad.
    is_left : (K+1, P)
        The wanted points.

    Returns
    -------
    (K+1, P), (K+1, P)
    """
    is_lit, is_seen = np.zeros_like(is_left), np.zeros_like(is_left)
    world = borrowed(world)
    for k in range(len(positions_h)):
        sun_h = sun_direction_h(suns_at[k, 0], suns_at[k, 1])
        boresight_h = transposed_times(dcm_b_from_h(quaternions_b_from_h[k]), world.boresight_b)
        lit = lit_among(world, quaternions_c_from_h[k], sun_h, is_left[k])
        is_dark = is_left[k] & ~lit
        seen = seen_points(world, quaternions_c_from_h[k], positions_h[k], boresight_h, sun_h, is_dark)
        for i in range(len(lit)):
            is_lit[k, i], is_seen[k, i] = lit[i], seen[i]
    return is_lit, is_seen


@compiled
def sun_at(world: PlainWorld, sun_at_start: Floats, sample: int) -> Floats:
    """Return the unit vector towards the Sun at a sample, from its angle and elevation at the start, rad."""
    angle = sun_angle(sun_at_start[0], world.mean_motion, sample * world.control_period)
    return sun_direction_h(angle, sun_at_start[1])


@compiled
def times_lit(world: PlainWorld, sun_at_start: Floats) -> tuple[Floats, Booleans]:
    """Return when each point is lit for the last time, and whether it ever is, shape (P,).

    The time is in s, zero for points that are never lit after the start.
    """
    quaternion_c_from_h, chief_rate_c = np.array([0.0, 0.0, 0.0, 1.0]), world.chief_rate
    last_lit, is_ever = np.zeros(len(world.points_c)), np.zeros(len(world.points_c), dtype=np.bool_)
    for k in range(world.num_controls + 1):
        if k > 0:
            quaternion_c_from_h, chief_rate_c = turn_chief(world, quaternion_c_from_h, chief_rate_c)
        is_lit = lit_points(world, quaternion_c_from_h, sun_at(world, sun_at_start, k))
        for i in range(len(is_lit)):
            if is_lit[i]:
                last_lit[i], is_ever[i] = k * world.control_period, True
    return last_lit, is_ever
