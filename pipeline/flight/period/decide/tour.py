"""For all lanes, the push that leads onto the tour: a closed path as a function of the Sun's angle."""

from math import atan2, cos, pi, sin, sqrt

from fis_tools.compiled.decorator import compiled
from fis_tools.compiled.three import Three, lane_of, minus, plus, scaled, write_lane
from fis_tools.compiled.vectors import width_of
from pipeline.array_types import Floats
from pipeline.flight.period.decide.chief import turned_aside
from pipeline.flight.state.arrays import Law, State, Workspace, World
from pipeline.flight.state.signals import constant, slot
from pipeline.physics.motion import drifted_place, place_over, push_by

TOUR_PUSH = slot("tour_push_radial", "tour_push_along_track", "tour_push_cross_track")
URGENT = slot("urgent_radial", "urgent_along_track", "urgent_cross_track")
TOUR_TIME, TOUR_WAIT, TOUR_LEAN = constant("tour_time_s"), constant("tour_wait_s"), constant("tour_lean_m")
SKIRT_DISTANCE = constant("skirt_distance_m")
RADIAL, ALONG_TRACK = constant("tour_radial_mean_m"), constant("tour_along_track_mean_m")
CROSS_TRACK, LIFT = constant("tour_cross_track_mean_m"), constant("tour_lift_mean_m")


@compiled(error_model="numpy", forceinline=True)
def waves(values: Floats, first: int, c: float, s: float) -> float:
    """Return a component of the tour from its constants and the cosine and sine of the Sun's angle."""
    once: float = values[first] + values[first + 1] * c + values[first + 2] * s
    # cosine and sine of twice the angle
    twice: float = values[first + 3] * (c * c - s * s) + values[first + 4] * (2.0 * c * s)
    return once + twice


@compiled(error_model="numpy", forceinline=True)
def tour_at(values: Floats, own: int, c: float, s: float, height: float) -> Three:
    """Return the place on the tour, m, Hill axes, by cosine and sine of the Sun's angle and its height."""
    lifted = waves(values, own + CROSS_TRACK, c, s) + height * waves(values, own + LIFT, c, s)
    return Three(waves(values, own + RADIAL, c, s), waves(values, own + ALONG_TRACK, c, s), lifted)


@compiled(error_model="numpy", inline="always")
def time_ahead(
    least_height: float, mean_motion: float, time: float, wait: float, x: float, y: float, level: float
) -> float:
    """Return the time until a lane is to be on the tour, s; zero if it need not move yet.

    If it would be dark after `time`, the arrival is when the shadow ends, unless that is later than `wait`.

    Parameters
    ----------
    least_height : float
        Component of the Sun's direction along i below which it is dark.
    mean_motion, time, wait : float
        rad/s, s, s; with a `wait` of zero darkness is ignored.
    x, y, level : float
        Cosine and sine of the Sun's angle, and cosine of its elevation.
    """
    turned_cos, turned_sin = cos(mean_motion * time), sin(mean_motion * time)
    if wait == 0.0 or (x * turned_cos + y * turned_sin) * level >= least_height:
        return time
    # end of the shadow
    end_cos = least_height / level
    end_sin = sqrt(1.0 - end_cos * end_cos)
    turn = atan2(y * end_cos - x * end_sin, x * end_cos + y * end_sin)
    ahead = (turn if turn > 0.0 else turn + 2.0 * pi) / mean_motion
    return ahead if ahead <= wait else 0.0


@compiled(error_model="numpy")
def sense_tour(world: World, law: Law, values: Floats, state: State, work: Workspace) -> None:
    """Write the push that leads every lane onto the tour."""
    lanes, belief, signals, own = state.lanes, state.belief, work.signals, law.constants
    lean, skirt = values[own + TOUR_LEAN], values[own + SKIRT_DISTANCE]
    wait, n = values[own + TOUR_WAIT], world.mean_motion
    for lane in range(width_of(lanes)):
        x, y = lanes.sun[0, lane], lanes.sun[1, lane]
        level, height = lanes.sun_height[0, lane], lanes.sun_height[1, lane]
        time = time_ahead(world.optics.least_height, n, values[own + TOUR_TIME], wait, x, y, level)
        if time == 0.0:
            write_lane(signals, TOUR_PUSH, lane, Three(0.0, 0.0, 0.0))
            continue
        turned_cos, turned_sin = cos(n * time), sin(n * time)
        wanted = tour_at(
            values, own, x * turned_cos + y * turned_sin, y * turned_cos - x * turned_sin, height
        )
        wanted = plus(wanted, scaled(lean, lane_of(signals, URGENT, lane)))
        place, velocity = lane_of(belief.position, 0, lane), lane_of(belief.velocity, 0, lane)
        then = place_over(n, time)
        push = push_by(then, minus(wanted, drifted_place(then, place, velocity)))
        write_lane(signals, TOUR_PUSH, lane, turned_aside(push, 1.0, place, skirt, world.min_distance))
