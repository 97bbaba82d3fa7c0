"""Signals of the motion of all lanes: where they are, the ellipse of their free motion, and turning aside.

Free motion is an ellipse, twice as long along the track as it is high, about a centre that drifts along the
track (Clohessy and Wiltshire, J. Aerospace Sci. 27, 1960).
"""

from math import cos, sin

import numpy as np

from fis_tools.compiled.decorator import compiled
from fis_tools.compiled.three import Three, dot, lane_of, length, load_three, store_three
from fis_tools.compiled.vectors import Vector, least, most, select, store
from pipeline.array_types import Floats
from pipeline.flight.period.look.guidance import MIN_PROJECTION_M
from pipeline.flight.period.look.hill import hill_rate
from pipeline.flight.state.arrays import Control, Moment, constant_of
from pipeline.flight.state.lanes import arctangent, load_pair, load_quaternion, store_pair
from pipeline.flight.state.signals import constant, slot
from pipeline.physics.motion import ORBIT_PARTS, drifted_position, position_rows_of
from pipeline.physics.quaternion import to_body

DISTANCE, LAMBDA_U, ETA_U = slot("distance"), slot("lambda_u"), slot("eta_u")
VELOCITY_BODY = slot("velocity_body_x", "velocity_body_y", "velocity_body_z")
POSITION_HILL = slot("position_radial", "position_along_track", "position_cross_track")
VELOCITY_HILL = slot("velocity_radial", "velocity_along_track", "velocity_cross_track")
CENTRE = slot("centre_radial", "centre_along_track")
PREDICTED_CENTRE, CLOSEST_APPROACH = slot("predicted_centre_along_track"), slot("closest_approach")
RING_ERROR = slot("ring_error_radial", "ring_error_along_track")
TARGET_DIRECTION = slot("target_radial", "target_along_track", "target_cross_track")
SUN_BEARING, TARGET_SETTING = slot("sun_alignment", "sun_ahead"), slot("target_setting")
RING_SIZE, RING_LEAD = constant("ring_size_m"), constant("ring_lead_rad")
PREDICTION_TIME = constant("prediction_time_s")


@compiled(error_model="numpy", forceinline=True)
def relative_angle(target_a: Vector, target_b: Vector, position_a: Vector, position_b: Vector) -> Vector:
    """Return the angle from the position's to the target's projection, in (-pi, pi]; 0 where one vanishes."""
    least_square = MIN_PROJECTION_M * MIN_PROJECTION_M
    has_both = target_a * target_a + target_b * target_b >= least_square
    has_both &= position_a * position_a + position_b * position_b >= least_square
    across = select(has_both, position_a * target_b - position_b * target_a, 0.0)
    along = select(has_both, position_a * target_a + position_b * target_b, 1.0)
    return arctangent(across, along)


@compiled(error_model="numpy", forceinline=True)
def sense_position(now: Moment, signals: Floats) -> None:
    """Write position and velocity of every lane, along Hill and body axes."""
    belief = now.state.belief
    position, velocity = load_three(belief.position, 0), load_three(belief.velocity, 0)
    store(signals, DISTANCE, length(position))
    store_three(signals, POSITION_HILL, position)
    store_three(signals, VELOCITY_HILL, velocity)
    store_three(signals, VELOCITY_BODY, to_body(load_quaternion(belief.attitude), velocity))


@compiled(error_model="numpy", forceinline=True)
def sense_angles(now: Moment, signals: Floats) -> None:
    """Write the angles from every lane to its target."""
    position, target = load_three(now.state.belief.position, 0), load_three(now.state.lanes.target, 0)
    store(signals, LAMBDA_U, relative_angle(target.x, target.y, position.x, position.y))
    store(signals, ETA_U, relative_angle(target.x, target.z, position.x, position.z))


@compiled(error_model="numpy")
def sense_orbit(now: Moment, control: Control, signals: Floats) -> None:
    """Write the signals of free motion of every lane.

    On a true course they are those of a circle at the rate at which Hill axes turn now.
    """
    state, n = now.state, hill_rate(now.world, now.k).z
    size, lead = constant_of(control, RING_SIZE), constant_of(control, RING_LEAD)
    drift = 1.5 * n * constant_of(control, PREDICTION_TIME)
    along, across = size * cos(lead), size * sin(lead)
    sun_cos, sun_sin = load_pair(state.lanes.sun)
    rx, ry, _ = load_three(state.belief.position, 0)
    vx, vy, _ = load_three(state.belief.velocity, 0)
    ahead = 2.0 * vy / n
    centre_x, centre_y = 4.0 * rx + ahead, ry - 2.0 * vx / n
    store_pair(signals, CENTRE, centre_x, centre_y)
    store(signals, PREDICTED_CENTRE, centre_y - drift * centre_x)
    reach = most(np.sqrt(rx * rx + ry * ry), MIN_PROJECTION_M)
    bearing_along, bearing_across = rx * sun_cos + ry * sun_sin, rx * sun_sin - ry * sun_cos
    store_pair(signals, SUN_BEARING, bearing_along / reach, bearing_across / reach)
    target = load_three(state.lanes.target, 0)
    far = most(length(target), MIN_PROJECTION_M)
    store_three(signals, TARGET_DIRECTION, target / far)
    store(signals, TARGET_SETTING, (sun_cos * target.y - sun_sin * target.x) / far)
    ring_cos, ring_sin = sun_cos * along + sun_sin * across, sun_sin * along - sun_cos * across
    store_pair(signals, RING_ERROR, -3.0 * rx - ahead - ring_cos, vx / n - ring_sin)


@compiled(error_model="numpy")
def sense_approach(now: Moment, signals: Floats) -> None:
    """Write every lane's closest approach to the chief within an orbit of free drift.

    The path is divided at every ``360 / ORBIT_PARTS`` degrees of the orbit, and each part taken as straight.
    A chord deviates from a curve by at most an eighth of the largest acceleration times the part's duration
    squared (the error of linear interpolation), and accelerations of free motion are at most
    ``n^2 sqrt(4 b^2 + c^2)``, with b the ellipse's height and c the cross-track amplitude: the distance
    is accurate to ``(2 pi / ORBIT_PARTS)^2 / 8 = 0.0038`` of ``sqrt(4 b^2 + c^2)``.
    """
    belief = now.state.belief
    position, velocity = load_three(belief.position, 0), load_three(belief.velocity, 0)
    before, nearest = position, dot(position, position)
    for part in range(ORBIT_PARTS):
        after = drifted_position(position_rows_of(now.world.orbit_parts, part), position, velocity)
        chord = after - before
        square = dot(chord, chord)
        share = -dot(before, chord) / select(square > 0.0, square, 1.0)
        passed = before + least(most(share, 0.0), 1.0) * chord
        nearest = least(dot(passed, passed), nearest)
        before = after
    store(signals, CLOSEST_APPROACH, np.sqrt(nearest))


SKIRT_DISTANCE = constant("skirt_distance_m")


@compiled(error_model="numpy", forceinline=True)
def turned_aside(now: Moment, control: Control, lane: int, push: Three, scale: float) -> Three:
    """Return ``push / scale`` of a lane, Hill axes, turned outwards nearer to the chief than the skirt.

    At the skirt nothing changes; at the least distance and below, the part of the push that leads inwards is
    reversed; in between, as much of it as the distance is on its way from one to the other. With a skirt up
    to the least distance nothing is turned.
    """
    position, skirt = lane_of(now.state.belief.position, 0, lane), constant_of(control, SKIRT_DISTANCE)
    wanted, min_distance, distance = push / scale, now.world.min_distance, length(position)
    if not min_distance < skirt or not distance < skirt:
        return wanted
    inward = max(0.0, -dot(push, position) / (scale * distance))
    nearness = min(1.0, (skirt - distance) / (skirt - min_distance))
    return wanted + (2.0 * nearness * inward / distance) * position
