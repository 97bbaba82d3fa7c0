"""Motion about the Earth, in lanes, by `pipeline.physics.two_body`."""

from fis_tools.compiled.decorator import compiled
from fis_tools.compiled.vectors import splat, store, width_of
from pipeline.flight.state.arrays import Workspace, World
from pipeline.flight.state.lanes import three, two, write_three
from pipeline.physics.illumination import share_at
from pipeline.physics.orbit import Course
from pipeline.physics.two_body import Three, entered, left, stepped
from pipeline.physics.vectors import norm


@compiled(error_model="numpy", forceinline=True)
def suns(work: Workspace) -> Three:
    """Return the directions towards the Suns of all lanes, axes of the course."""
    cosine, sine = two(work.lanes.sun_at_start)
    flat, high = two(work.lanes.sun_height)
    return flat * cosine, flat * sine, high


@compiled(error_model="numpy")
def note_sunshine(course: Course, work: Workspace, row: int) -> None:
    """Write the visible share of the Sun's disc in each lane at the three rows of a step."""
    width = width_of(work.lanes)
    shines = work.lanes.shine
    if course.radiation == 0.0 or not course.has_shadow:
        for part in range(3):
            store(shines, part, splat(1.0, width))
        return
    sx, sy, sz = suns(work)
    for part in range(3):
        upward = course.axes[row + part, 0]
        store(shines, part, upward[0] * sx + upward[1] * sy + upward[2] * sz)
        radius = norm(course.places[row + part])
        for lane in range(width):
            shines[part, lane] = share_at(shines[part, lane], radius)


@compiled(error_model="numpy")
def move_about_earth(
    world: World, course: Course, work: Workspace, first: int, num_lanes: int, k: int
) -> None:
    """Move all lanes, which are flights from `first` on, by a control period."""
    width = width_of(work.lanes)
    lanes, row = work.lanes, 2 * course.num_steps * k
    place, velocity = entered(course, row, three(lanes.position), three(lanes.velocity))
    fx, fy, fz = three(lanes.force)
    per_force, push_of_sun = world.acceleration_per_force, -course.radiation
    force = fx * per_force, fy * per_force, fz * per_force
    if len(course.varying) > 0:
        for lane in range(width):
            for axis in range(3):
                lanes.drag[axis, lane] = course.varying[first + min(lane, num_lanes - 1), k, axis]
        dx, dy, dz = three(lanes.drag)
        force = force[0] + dx, force[1] + dy, force[2] + dz
    sx, sy, sz = suns(work)
    light = push_of_sun * sx, push_of_sun * sy, push_of_sun * sz
    for _ in range(course.num_steps):
        note_sunshine(course, work, row)
        place, velocity = stepped(course, row, place, velocity, force, light, three(lanes.shine))
        row += 2
    place, velocity = left(course, row, place, velocity)
    write_three(lanes.position, 0, place[0], place[1], place[2])
    write_three(lanes.velocity, 0, velocity[0], velocity[1], velocity[2])
