"""The push that leads a deputy of the readable reference onto the tour."""

import numpy as np
from numpy.typing import NDArray

from pipeline.flight.reference.world import PlainWorld
from pipeline.flight.state.signals import TOUR_PARTS, TOUR_WAVES, constant
from pipeline.physics.clohessy_wiltshire import state_transition
from pipeline.physics.illumination import least_sun_height, sun_direction_h, visible_share

Floats = NDArray[np.float64]

TOUR_TIME, TOUR_WAIT, TOUR_LEAN = constant("tour_time_s"), constant("tour_wait_s"), constant("tour_lean_m")
MEANS = {part: constant(f"tour_{part}_mean_m") for part in TOUR_PARTS}


def tour_place(constants: Floats, sun_angle: float, sun_elevation: float) -> Floats:
    """Return the place of the tour at a direction of the Sun, shape (3,), m, Hill axes.

    Each component is ``mean + sum of cos_m cos(m angle) + sin_m sin(m angle)`` for m = 1 and 2; the lift,
    another such sum, times the sine of the elevation adds to the last.
    """
    multiples = np.arange(1, 1 + len(TOUR_WAVES) // 2) * sun_angle
    waves = np.concatenate(([1.0], np.column_stack((np.cos(multiples), np.sin(multiples))).ravel()))
    x, y, z, lift = (waves @ constants[mean : mean + len(TOUR_WAVES)] for mean in MEANS.values())
    return np.array((x, y, z + np.sin(sun_elevation) * lift))


def time_ahead(world: PlainWorld, time: float, wait: float, sun: tuple[float, float]) -> float:
    """Return the time, s, until a deputy is to be on the tour; zero if it need not move yet.

    The arrival is after `time`, or, if it is dark then, when the shadow ends, unless that is later than
    `wait`; with a `wait` of zero darkness is ignored. `sun` is the Sun's angle and elevation now.
    """
    angle, elevation = sun
    later = sun_direction_h(angle - world.mean_motion * time, elevation)
    is_dark = world.has_shadow and visible_share(later, world.orbit_radius) < world.min_sun_share
    if wait == 0.0 or not is_dark:
        return time
    # the Sun's angle decreases: of the two at which it is so high, it reaches the positive one last
    at_end = np.arccos(least_sun_height(world.orbit_radius, world.min_sun_share) / np.cos(elevation))
    ahead = float(np.mod(angle - at_end, 2.0 * np.pi)) / world.mean_motion
    return ahead if ahead <= wait else 0.0


def push_to(place_h: Floats, state: Floats, mean_motion: float, time: float) -> Floats:
    """Return the push that leads a state of shape (6,) by free motion to a place after a time, m/s."""
    transition = state_transition(mean_motion, time)
    return np.linalg.solve(transition[:3, 3:], place_h - transition[:3] @ state).astype(np.float64)


def push_onto_tour(
    world: PlainWorld, constants: Floats, state: Floats, sun: tuple[float, float], urgent: Floats
) -> Floats:
    """Return the push that leads onto the tour, leaning towards what is urgent, (3,), m/s, Hill axes."""
    ahead = time_ahead(world, constants[TOUR_TIME], constants[TOUR_WAIT], sun)
    if ahead == 0.0:
        return np.zeros(3)
    place = tour_place(constants, sun[0] - world.mean_motion * ahead, sun[1]) + constants[TOUR_LEAN] * urgent
    return push_to(place, state, world.mean_motion, ahead)
