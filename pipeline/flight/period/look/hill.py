"""How Hill axes turn in a control period: uniformly about k, or as the chief's true course has it."""

from math import cos, sin, sqrt

from fis_tools.compiled.decorator import compiled
from fis_tools.compiled.three import Three, dot, three_of
from pipeline.flight.state.arrays import World
from pipeline.physics.quaternion import Quaternion


@compiled(error_model="numpy", forceinline=True)
def is_true(world: World) -> bool:
    """Return whether Hill axes turn as a true course has it, and not uniformly."""
    return len(world.hill_rates) > 1


@compiled(error_model="numpy", forceinline=True)
def hill_rate(world: World, k: int) -> Three:
    """Return the rate of Hill axes in control period k, rad/s, Hill axes."""
    return three_of(world.hill_rates[k if len(world.hill_rates) > 1 else 0])


@compiled(error_model="numpy", forceinline=True)
def hill_turn(world: World, k: int, time: float) -> Quaternion:
    """Return by what Hill axes turn in a part of control period k, scalar last."""
    rate = hill_rate(world, k)
    if not is_true(world):
        half = 0.5 * rate.z * time
        return 0.0, 0.0, sin(half), cos(half)
    speed = sqrt(dot(rate, rate))
    half = 0.5 * speed * time
    scale = sin(half) / speed
    return scale * rate.x, scale * rate.y, scale * rate.z, cos(half)
