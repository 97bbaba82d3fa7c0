"""Preview for all lanes: the points that coasting to the flight's end would show.

Positions are previewed every `pipeline.flight.world.pack.PREVIEW_PERIOD_S`, with the camera aimed at the
chief's centre.
"""

from math import cos, sin, sqrt
from typing import NamedTuple

from fis_tools.compiled.decorator import compiled
from fis_tools.compiled.three import Three, dot, lane_of
from pipeline.array_types import Floats
from pipeline.flight.period.look.optics import Pair, beam_from, strike_out_seen, sun_ahead, turned_back
from pipeline.flight.state.arrays import FullOptics, Moment, World
from pipeline.flight.state.signals import slot
from pipeline.physics.motion import drifted_position, drifted_velocity, propagator_of
from pipeline.physics.transitions import constants_at, follows_course, position_at

MISSED, NEAREST, FARTHEST = slot("missed"), slot("coasting_nearest"), slot("coasting_farthest")


class Previewed(NamedTuple):
    """The instants that previews look at from a sample on, and how the Sun turns between them."""

    first: int  # control periods to the first of them
    first_turn: Pair  # cosine and sine of the angle by which Hill axes turn until then
    stride_turn: Pair  # the same from each to the next


@compiled(error_model="numpy", forceinline=True)
def previewed_from(world: World, k: int) -> Previewed:
    """Return the instants to preview from sample k on, the same for every lane."""
    # they are the same at every preview, counted back from the end
    first = (world.num_controls - k - 1) % world.preview_stride + 1
    turn = world.mean_motion * world.control_period
    return Previewed(
        first,
        (cos(turn * first), sin(turn * first)),
        (cos(turn * world.preview_stride), sin(turn * world.preview_stride)),
    )


@compiled(error_model="numpy")
def coast_on(
    now: Moment,
    optics: FullOptics | None,
    instants: Previewed,
    lane: int,
    position: Three,
    velocity: Three,
    ahead: Floats,
    lit_marks: Floats,
    seen_marks: Floats,
) -> tuple[int, float, float]:
    """Return how many points coasting from a state misses, and its least and greatest distance squared, m^2.

    Leaves in `ahead`, (P padded,), 1 for each of these points.
    """
    # compiled twice, so that the loop over instants does not branch
    if follows_course(now.world.transitions):
        return coast_along(
            now, optics, instants, lane, position, velocity, ahead, lit_marks, seen_marks, is_true=True
        )
    return coast_along(
        now, optics, instants, lane, position, velocity, ahead, lit_marks, seen_marks, is_true=False
    )


@compiled(error_model="numpy", forceinline=True)
def coast_along(
    now: Moment,
    optics: FullOptics | None,
    instants: Previewed,
    lane: int,
    position: Three,
    velocity: Three,
    ahead: Floats,
    lit_marks: Floats,
    seen_marks: Floats,
    is_true: bool,
) -> tuple[int, float, float]:
    """Coast on a circle, or on a true course; see `coast_on`."""
    world, state, lanes, k = now.world, now.state, now.state.lanes, now.k
    # neighbours are seen shortly after one another: in the paper's world, in the order of patches
    points = world.patches if optics is None else world.points
    num_left = int(lanes.num_unseen[lane])
    sun = lanes.sun[0, lane], lanes.sun[1, lane]
    nearest = dot(position, position)
    farthest = nearest
    for j in range(len(ahead) if num_left > 0 else 0):
        ahead[j] = state.unseen[lane, j if optics is not None else world.order[j]]
    step, sun_turn = instants.first, instants.first_turn
    sample, height = k, (lanes.sun_height[0, lane], lanes.sun_height[1, lane])
    constants = position, velocity
    if is_true:
        constants = constants_at(world.transitions, k, position, velocity)
    while sample < world.num_controls:
        sample += step
        if is_true:
            position = position_at(world.transitions, sample, constants)
            sun, height = sun_ahead(now, lane, sample)
        else:
            leap = propagator_of(world.strides, step)
            moved = drifted_position(leap.position, position, velocity)
            position, velocity = moved, drifted_velocity(leap, position, velocity)
            sun = turned_back(sun, sun_turn)
        step, sun_turn = world.preview_stride, instants.stride_turn
        square = dot(position, position)
        nearest, farthest = min(nearest, square), max(farthest, square)
        if num_left > 0:
            beam = beam_from(world, optics, sample, sun, height)
            num_left -= strike_out_seen(world, optics, ahead, lit_marks, seen_marks, points, beam, position)
    return num_left, nearest, farthest


@compiled(error_model="numpy")
def preview(
    now: Moment,
    optics: FullOptics | None,
    ahead: Floats,
    lit_marks: Floats,
    seen_marks: Floats,
    signals: Floats,
) -> None:
    """Write for every lane the points missed by coasting, and the least and greatest distance on the way.

    Leaves in `ahead`, (P padded,), 1 for each point missed by the last lane.
    """
    belief, instants = now.state.belief, previewed_from(now.world, now.k)
    for lane in range(now.num_lanes):
        position, velocity = lane_of(belief.position, 0, lane), lane_of(belief.velocity, 0, lane)
        num_left, nearest, farthest = coast_on(
            now, optics, instants, lane, position, velocity, ahead, lit_marks, seen_marks
        )
        signals[MISSED, lane] = num_left
        signals[NEAREST, lane] = sqrt(nearest)
        signals[FARTHEST, lane] = sqrt(farthest)
