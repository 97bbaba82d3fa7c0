"""For all lanes, the push that parks: onto a closed ellipse inside the limits that still shows enough.

By Clohessy and Wiltshire's equations free motion is an ellipse whose centre drifts by ``-3 pi x_c`` an orbit;
the push ``-n x_c / 2`` along the track stops that. Its radial part, of which some are tried, chooses where
the ellipse lies and how large it is. Across the orbit plane the swing stays, or it is shifted to a quarter
of an orbit from the radial one: then the deputy never comes nearer than the smaller of both, wherever along
the track the ellipse lies (e/i-vector separation; D'Amico and Montenbruck, Journal of Guidance, Control, and
Dynamics 29, 2006).
"""

from math import inf, pi

from fis_tools.compiled.decorator import compiled
from fis_tools.compiled.three import Three, lane_of, write_lane
from pipeline.array_types import Floats
from pipeline.flight.period.decide.preview import coast_on, previewed_from
from pipeline.flight.state.arrays import Control, FullOptics, Moment, World, constant_of
from pipeline.flight.state.signals import constant, slot
from pipeline.physics.motion import ORBIT_PARTS, drifted_position, position_rows_of

PARK_PUSH = slot("park_push_radial", "park_push_along_track", "park_push_cross_track")
PARK_BELOW, PARK_REACH = constant("park_below_points"), constant("park_reach_m_s")
PARK_BEFORE, MARGIN = constant("park_before_s"), constant("coast_margin_m")
#: radial parts that are tried each way, evenly up to the reach
RADIAL_STEPS = 8
#: for no push, and for each radial part with the swing as it is and shifted
NUM_TRIED = 1 + 2 * (2 * RADIAL_STEPS + 1)
#: for which a path must stay inside the limits
ORBITS = 3
#: where half the way along the track to the ellipse's centre is shorter than this, m, no swing is shifted
LEAST_LENGTH_M = 1.0


@compiled(error_model="numpy")
def may_park(control: Control) -> bool:
    """Return whether a controller parks."""
    return constant_of(control, PARK_BELOW) > 0.0


@compiled(error_model="numpy")
def tried_push(mean_motion: float, reach: float, number: int, position: Three, velocity: Three) -> Three:
    """Return one of the pushes that are tried, m/s; the first is none."""
    radial = reach * ((number + 1) // 2 - 1 - RADIAL_STEPS) / RADIAL_STEPS
    across, half_way = 0.0, (velocity.x + radial) / mean_motion
    if number % 2 == 0 and abs(half_way) >= LEAST_LENGTH_M:
        across = -mean_motion * position.z * position.x / half_way - velocity.z
    along = -2.0 * mean_motion * position.x - velocity.y
    push = Three(radial, along, across)
    return push if number > 0 else Three(0.0, 0.0, 0.0)


@compiled(error_model="numpy")
def stays(world: World, margin: float, position: Three, velocity: Three) -> bool:
    """Return whether free motion stays inside the limits by a margin for `ORBITS`, at parts of an orbit.

    Between these it comes nearer by 0.0038 of the ellipse's length at most; see `sense_approach`.
    """
    least, most = world.min_distance + margin, world.max_distance - margin
    drift = -3.0 * pi * (4.0 * position.x + 2.0 * velocity.y / world.mean_motion)
    is_inside = True
    for part in range(ORBIT_PARTS):
        passed = drifted_position(position_rows_of(world.orbit_parts, part), position, velocity)
        level = passed.x * passed.x + passed.z * passed.z
        for orbit in range(ORBITS):
            along = passed.y + orbit * drift
            square = level + along * along
            is_inside = is_inside and square >= least * least and square <= most * most
    return is_inside


@compiled(error_model="numpy")
def sense_parking(
    now: Moment,
    optics: FullOptics | None,
    control: Control,
    ahead: Floats,
    lit_marks: Floats,
    seen_marks: Floats,
    signals: Floats,
) -> None:
    """Write for every lane the cheapest push that parks, m/s, and mark the lanes that have one."""
    world, lanes, belief = now.world, now.state.lanes, now.state.belief
    below, margin = constant_of(control, PARK_BELOW), constant_of(control, MARGIN)
    reach, most = constant_of(control, PARK_REACH), world.max_force * world.delta_v_per_force
    instants = previewed_from(world, now.k)
    is_late = (world.num_controls - now.k) * world.control_period <= constant_of(control, PARK_BEFORE)
    for lane in range(now.num_lanes):
        position, velocity = lane_of(belief.position, 0, lane), lane_of(belief.velocity, 0, lane)
        best, cheapest = Three(0.0, 0.0, 0.0), inf
        for number in range(NUM_TRIED):
            push = tried_push(world.mean_motion, reach, number, position, velocity)
            x, y, z = abs(push.x), abs(push.y), abs(push.z)
            cost, after = x + y + z, velocity + push
            is_better = cost < cheapest and max(x, y, z) <= most
            if is_better and stays(world, margin, position, after):
                missed = 0
                if not is_late:
                    missed, _, _ = coast_on(
                        now, optics, instants, lane, position, after, ahead, lit_marks, seen_marks
                    )
                if missed < below:
                    best, cheapest = push, cost
        lanes.parks[lane] = 1.0 if cheapest < inf else 0.0
        write_lane(signals, PARK_PUSH, lane, best)
