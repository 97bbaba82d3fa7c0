"""For all lanes, the push that leads onto the tour: a closed path as a function of the Sun's angle."""

from math import atan2, cos, pi, sin, sqrt

from fis_tools.compiled.decorator import compiled
from fis_tools.compiled.elementary import whole_within
from fis_tools.compiled.three import Three, lane_of, write_lane
from fis_tools.compiled.vectors import width_of
from pipeline.array_types import Floats
from pipeline.flight.period.decide.motion import turned_aside
from pipeline.flight.period.decide.urgency import URGENT
from pipeline.flight.period.look.optics import Pair, least_height_at, sun_ahead, turned_back
from pipeline.flight.state.arrays import Control, Moment, constant_of
from pipeline.flight.state.signals import constant, slot
from pipeline.physics.motion import drifted_position, position_rows_over, push_by
from pipeline.physics.transitions import constants_at, follows_course, position_at, push_that_shifts

TOUR_PUSH = slot("tour_push_radial", "tour_push_along_track", "tour_push_cross_track")
TOUR_TIME, TOUR_WAIT, TOUR_LEAN = constant("tour_time_s"), constant("tour_wait_s"), constant("tour_lean_m")
RADIAL, ALONG_TRACK = constant("tour_radial_mean_m"), constant("tour_along_track_mean_m")
CROSS_TRACK, LIFT = constant("tour_cross_track_mean_m"), constant("tour_lift_mean_m")


@compiled(error_model="numpy", forceinline=True)
def waves(control: Control, first: int, c: float, s: float) -> float:
    """Return a component of the tour from its constants and the cosine and sine of the Sun's angle."""
    values, first = control.values, control.law.constants + first
    first_harmonic: float = values[first] + values[first + 1] * c + values[first + 2] * s
    # cosine and sine of twice the angle
    second_harmonic: float = values[first + 3] * (c * c - s * s) + values[first + 4] * (2.0 * c * s)
    return first_harmonic + second_harmonic


@compiled(error_model="numpy", forceinline=True)
def tour_at(control: Control, c: float, s: float, height: float) -> Three:
    """Return the position on the tour, m, Hill axes, by the Sun's angle (cosine, sine) and its height."""
    lifted = waves(control, CROSS_TRACK, c, s) + height * waves(control, LIFT, c, s)
    return Three(waves(control, RADIAL, c, s), waves(control, ALONG_TRACK, c, s), lifted)


@compiled(error_model="numpy", inline="always")
def time_ahead(
    least_height: float, mean_motion: float, time: float, wait: float, sun: Pair, level: float
) -> float:
    """Return the time until a lane is to be on the tour, s; zero if it need not move yet.

    If it would be dark after `time`, the arrival is when the shadow ends, unless that is later than `wait`;
    with a `wait` of zero darkness is ignored. `level` is the cosine of the Sun's elevation; it is dark where
    the component of the Sun's direction along i is below the least height.
    """
    angle = mean_motion * time
    if wait == 0.0 or turned_back(sun, (cos(angle), sin(angle)))[0] * level >= least_height:
        return time
    # end of the shadow
    end_cos = least_height / level
    end_sin = sqrt(1.0 - end_cos * end_cos)
    along, across = turned_back(sun, (end_cos, end_sin))
    turn = atan2(across, along)
    ahead = (turn if turn > 0.0 else turn + 2.0 * pi) / mean_motion
    return ahead if ahead <= wait else 0.0


@compiled(error_model="numpy")
def arrival(now: Moment, control: Control, lane: int) -> int:
    """Return the sample at which a lane is to be on the tour, on a true course; now if it need not move yet.

    As `time_ahead`; neither looks beyond the last sample that is predicted.
    """
    world, last = now.world, len(now.world.transitions.onward) - 1
    time, wait = constant_of(control, TOUR_TIME), constant_of(control, TOUR_WAIT)
    ahead = whole_within(time / world.control_period + 0.5, last)
    patience = whole_within(wait / world.control_period + 0.5, last)
    sample, latest = min(last, now.k + max(1, ahead)), min(last, now.k + patience)
    is_dark = wait > 0.0
    while is_dark and sample <= latest:
        sun, height = sun_ahead(now, lane, sample)
        is_dark = height[0] * sun[0] < least_height_at(world, sample)
        sample += 1 if is_dark else 0
    return now.k if is_dark else min(last, sample)


@compiled(error_model="numpy")
def true_tour_push(now: Moment, control: Control, signals: Floats, lane: int) -> Three:
    """Return the push, m/s, that brings a lane onto the tour on a true course."""
    motion, belief, arrives = now.world.transitions, now.state.belief, arrival(now, control, lane)
    sample = max(arrives, now.k + 1)
    sun, height = sun_ahead(now, lane, sample)
    target = tour_at(control, sun[0], sun[1], height[1])
    target += constant_of(control, TOUR_LEAN) * lane_of(signals, URGENT, lane)
    position, velocity = lane_of(belief.position, 0, lane), lane_of(belief.velocity, 0, lane)
    coasted = position_at(motion, sample, constants_at(motion, now.k, position, velocity))
    push = push_that_shifts(motion, now.k, sample, target - coasted)
    push = turned_aside(now, control, lane, push, 1.0)
    return push if arrives > now.k else Three(0.0, 0.0, 0.0)


@compiled(error_model="numpy")
def sense_tour(now: Moment, control: Control, signals: Floats) -> None:
    """Write the push, m/s, that brings every lane onto the tour, the closed path around the chief.

    The path leans towards the urgent direction, which `signals` must hold.
    """
    lanes, belief, n = now.state.lanes, now.state.belief, now.world.mean_motion
    wait, least_height = constant_of(control, TOUR_WAIT), now.world.optics.least_height
    for lane in range(width_of(lanes)):
        if follows_course(now.world.transitions):
            write_lane(signals, TOUR_PUSH, lane, true_tour_push(now, control, signals, lane))
            continue
        sun = lanes.sun[0, lane], lanes.sun[1, lane]
        level, height = lanes.sun_height[0, lane], lanes.sun_height[1, lane]
        time = time_ahead(least_height, n, constant_of(control, TOUR_TIME), wait, sun, level)
        if time == 0.0:
            write_lane(signals, TOUR_PUSH, lane, Three(0.0, 0.0, 0.0))
            continue
        c, s = turned_back(sun, (cos(n * time), sin(n * time)))
        target = tour_at(control, c, s, height)
        target += constant_of(control, TOUR_LEAN) * lane_of(signals, URGENT, lane)
        position, velocity = lane_of(belief.position, 0, lane), lane_of(belief.velocity, 0, lane)
        phi_rows = position_rows_over(n, time)
        push = push_by(phi_rows, target - drifted_position(phi_rows, position, velocity))
        write_lane(signals, TOUR_PUSH, lane, turned_aside(now, control, lane, push, 1.0))
