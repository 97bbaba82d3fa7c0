"""Motion of all lanes over a control period: linear in Hill axes, or about the Earth."""

from fis_tools.compiled.decorator import compiled
from fis_tools.compiled.three import Three, dot, length, load_three, same, store_three, three_of, write_lane
from fis_tools.compiled.vectors import store, width_of
from pipeline.array_types import Floats
from pipeline.flight.state.arrays import FlightState, Moment, World
from pipeline.flight.state.lanes import flight_of, load_pair
from pipeline.physics.illumination import visible_share
from pipeline.physics.motion import position_after, propagator_of, velocity_after
from pipeline.physics.orbit import Course, sun_moved
from pipeline.physics.two_body import hill_from_inertial, inertial_from_hill, stepped


@compiled(error_model="numpy", forceinline=True)
def move(world: World, state: FlightState, force: Three) -> None:
    """Move all lanes by a control period under forces, N, Hill axes."""
    truth, step = state.truth, propagator_of(world.motion, 0)
    position, velocity = load_three(truth.position, 0), load_three(truth.velocity, 0)
    store_three(truth.position, 0, position_after(step, position, velocity, force))
    store_three(truth.velocity, 0, velocity_after(step, position, velocity, force))


@compiled(error_model="numpy", forceinline=True)
def suns(course: Course, state: FlightState, k: int) -> Three:
    """Return the unit vectors towards the Sun in all lanes at sample k, axes of the course."""
    cosine, sine = load_pair(state.lanes.sun_at_start)
    flat, high = load_pair(state.lanes.height_at_start)
    return sun_moved(course, k, Three(flat * cosine, flat * sine, high))


@compiled(error_model="numpy")
def note_sunshine(course: Course, state: FlightState, sun: Three, row: int, shines: Floats) -> None:
    """Write the visible share of the Sun's disc at the three rows of a step from `row` on, (3, L)."""
    width = width_of(state.lanes)
    if course.radiation == 0.0 or not course.has_shadow:
        store_three(shines, 0, same(1.0, width))
        return
    for part in range(3):
        store(shines, part, dot(three_of(course.axes[row + part, 0]), sun))
        radius = course.earths * length(three_of(course.positions[row + part]))
        for lane in range(width):
            shines[part, lane] = visible_share(shines[part, lane], radius)


@compiled(error_model="numpy")
def move_about_earth(now: Moment, course: Course, force: Three) -> None:
    """Move all lanes by a control period under forces, N, Hill axes."""
    state, lanes, truth, row = now.state, now.state.lanes, now.state.truth, 2 * course.num_steps * now.k
    position, velocity = inertial_from_hill(
        course, row, load_three(truth.position, 0), load_three(truth.velocity, 0)
    )
    pull = now.world.acceleration_per_force * force
    if len(course.varying) > 0:
        for lane in range(width_of(lanes)):
            write_lane(lanes.drag, 0, lane, three_of(course.varying[flight_of(now, lane), now.k]))
        pull += load_three(lanes.drag, 0)
    sun = suns(course, state, now.k)
    light = -course.radiation * sun
    for _ in range(course.num_steps):
        note_sunshine(course, state, sun, row, lanes.shine)
        position, velocity = stepped(course, row, position, velocity, pull, light, load_three(lanes.shine, 0))
        row += 2
    position, velocity = hill_from_inertial(course, row, position, velocity)
    store_three(truth.position, 0, position)
    store_three(truth.velocity, 0, velocity)
