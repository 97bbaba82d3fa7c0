"""The push that would show a deputy of the readable reference the points that set for good."""

from math import exp

import numpy as np
from numpy.typing import NDArray

from fis_tools.compiled.decorator import compiled
from pipeline.flight.reference.sight import lit_points, seen_points, sun_at
from pipeline.flight.reference.world import PlainWorld, turn_chief
from pipeline.flight.state.preview import LEAST_SHORT_M, SQUARED_NEAR_M2
from pipeline.physics.motion import place_of, propagate, slopes
from pipeline.physics.quaternion import dcm_b_from_h
from pipeline.physics.vectors import dot, norm

Floats = NDArray[np.float64]
Booleans = NDArray[np.bool_]

#: the square of a thousand seconds
KS2 = 1e6


@compiled
def lacking(world: PlainWorld, point_h: Floats, normal_h: Floats, position_h: Floats) -> tuple[float, Floats]:
    """Return a look's largest shortfall, m, and the direction in which it shrinks.

    It is of height above the point's tangent plane, where the incidence limit needs a share of the distance,
    or of nearness; if neither is lacking, of something that no push along a line can fix, counted as
    `LEAST_SHORT_M`.
    """
    apart = position_h - point_h
    distance = norm(apart)
    short = world.cos_max_incidence * distance - dot(normal_h, apart)
    towards = normal_h - world.cos_max_incidence * apart / distance
    if distance - world.max_range > short:
        short, towards = distance - world.max_range, -apart / distance
    return max(short, LEAST_SHORT_M), towards


@compiled
def cheapest_looks(
    world: PlainWorld,
    state: Floats,
    k: int,
    sun_at_start: Floats,
    quaternion_c_from_h: Floats,
    chief_rate_c: Floats,
    is_sought: Booleans,
    horizon: float,
) -> Floats:
    """Return for each wanted point the shortfall of the cheapest look and how a push reduces it.

    Looks are taken every `look_stride` control periods of free motion, at lit points. A look at a point from
    a place falls short of the point's horizon by ``R - u r``, with u the point's direction; a push changes it
    by the slopes g. The cheapest look needs the least push, ``short / |g|``.

    Parameters
    ----------
    world : PlainWorld
    state : array, shape (6,)
        At sample k, m and m/s, Hill axes.
    k : int
    sun_at_start : array, shape (2,)
        Angle and elevation at k = 0, rad.
    quaternion_c_from_h, chief_rate_c : array, shape (4,), (3,)
        Of the chief at sample k.
    is_sought : array of bool, shape (P,)
        Not inspected, and dark for good within the horizon.
    horizon : float
        How far ahead to look, s.

    Returns
    -------
    array, shape (P, 4)
        Shortfall, m, and slopes along the Hill axes, m per m/s; zeros for points that need no push, because
        they are not sought or free motion shows them, and for those that are not lit at any look.
    """
    knows_optics = not world.is_papers_sight or sun_at_start[1] != 0.0
    looks = np.zeros((len(is_sought), 4))
    cost = np.full(len(is_sought), np.inf)
    is_shown = ~is_sought
    no_force, radius = np.zeros(3), world.points_radius
    stride_s = world.control_period * world.look_stride
    last = min(world.num_controls, k + int(horizon / stride_s + 1e-9) * world.look_stride)
    for sample in range(k + 1, last + 1):
        state = propagate(world.motion, state, no_force)
        quaternion_c_from_h, chief_rate_c = turn_chief(world, quaternion_c_from_h, chief_rate_c)
        if (sample - k) % world.look_stride != 0:
            continue
        position = state[:3].copy()
        points_h = world.points_c @ dcm_b_from_h(quaternion_c_from_h)
        sun_h = sun_at(world, sun_at_start, sample)
        is_lit = lit_points(world, quaternion_c_from_h, sun_h)
        is_sure = is_lit & ~is_shown
        if knows_optics:
            boresight_h = -position / norm(position)
            is_sure = seen_points(world, quaternion_c_from_h, position, boresight_h, sun_h, is_sure)
        normals_h = world.normals_c @ dcm_b_from_h(quaternion_c_from_h)
        place = place_of(world.looks, (sample - k) // world.look_stride)
        is_near = dot(position, position) < SQUARED_NEAR_M2
        for i in range(len(points_h)):
            if is_shown[i] or not is_lit[i]:
                continue
            if knows_optics:
                is_shown[i] = is_sure[i]
                short, towards = lacking(world, points_h[i], normals_h[i], position)
            else:
                towards = points_h[i] / radius
                short = radius - dot(towards, position)
                if is_near:
                    short = max(short, LEAST_SHORT_M)
                is_shown[i] = short <= 0.0
            if is_shown[i]:
                continue
            _, _, _, gx, gy, gz = slopes(place, towards[0], towards[1], towards[2])
            if short**2 / (gx**2 + gy**2 + gz**2) < cost[i]:
                cost[i] = short**2 / (gx**2 + gy**2 + gz**2)
                looks[i] = np.array((short, gx, gy, gz))
    for i in range(len(looks)):
        if is_shown[i]:
            looks[i] = 0.0
    return looks


@compiled
def push_of(looks: Floats, last_lit: Floats, time: float, urgency_time: float, damping: float) -> Floats:
    """Return the damped least-squares push that brings all looks closest to showing their points.

    Parameters
    ----------
    looks : array, shape (P, 4)
        Of `cheapest_looks`.
    last_lit : array, shape (P,)
        When each point is lit for the last time, s.
    time, urgency_time : float
        s.
    damping : float
        1e6 s^2, above zero.

    Returns
    -------
    array, shape (3,)
        m/s, Hill axes.
    """
    matrix, right = damping * KS2 * np.eye(3), np.zeros(3)
    for i in range(len(looks)):
        short, slope = looks[i, 0], looks[i, 1:].copy()
        if short > 0.0:
            weight = exp(-(last_lit[i] - time) / urgency_time)
            matrix += weight * np.outer(slope, slope)
            right += weight * short * slope
    return np.linalg.solve(matrix, right).astype(np.float64)
