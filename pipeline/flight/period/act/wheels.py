"""Reaction wheels along the body axes, each of which holds so much angular momentum.

With L the momentum of body and wheels together, which external torques alone change, wheels hold
``h = L - J w``, and the torque m that they give to the body turns that into ``h' = -m - w x h`` (Markley and
Crassidis, Fundamentals of Spacecraft Attitude Determination and Control, 2014, 3.3.3). A wheel that is full
keeps its speed: along its axis the body then feels ``-(w x h)`` alone.
"""

from math import cos, sin

from fis_tools.compiled.decorator import compiled
from fis_tools.compiled.three import Three, cross, times
from pipeline.flight.period.look.hill import hill_turn, is_true
from pipeline.flight.state.arrays import World
from pipeline.physics.quaternion import Quaternion, to_body, to_hill


@compiled(error_model="numpy")
def wheel_momentum(world: World, q: Quaternion, rate: Three, total: Three) -> Three:
    """Return the momentum of the wheels, N m s, body axes.

    `total` is that of body and wheels together, N m s, Hill axes.
    """
    return to_body(q, total) - times(world.inertia, rate)


@compiled(error_model="numpy")
def torque_of_wheels(world: World, rate: Three, held: Three, torque: Three) -> Three:
    """Return the torque nearest to a wanted one with which no wheel holds too much afterwards, N m.

    `held` is the momentum of the wheels, N m s; all are along body axes.
    """
    kept, h, limit = cross(rate, held), world.attitude_period, world.max_momentum
    return Three(
        min(max(torque.x, (held.x - limit) / h - kept.x), (held.x + limit) / h - kept.x),
        min(max(torque.y, (held.y - limit) / h - kept.y), (held.y + limit) / h - kept.y),
        min(max(torque.z, (held.z - limit) / h - kept.z), (held.z + limit) / h - kept.z),
    )


@compiled(error_model="numpy")
def momentum_after(world: World, k: int, q: Quaternion, total: Three, external: Three) -> Three:
    """Return the momentum of body and wheels, Hill axes, an attitude period of control period k later.

    `total` is that before, N m s, Hill axes, and `external` the torque from outside, N m, body axes.
    """
    h = world.attitude_period
    x, y, z = total + h * to_hill(q, external)
    if is_true(world):
        return to_body(hill_turn(world, k, h), Three(x, y, z))
    s, c = sin(world.mean_motion * h), cos(world.mean_motion * h)
    return Three(c * x + s * y, c * y - s * x, z)
