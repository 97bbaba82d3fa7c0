"""Whether every start that may be drawn has a way out without thrust (docs/explanation/safety.md).

The set of starts is covered with cubes of positions, which are halved until, for each of them, a force that
the safety layer tries closes the ellipses of all its starts between the spheres. With a given radial
half-axis this force, and where the ellipse leads, are affine in the start. So no point of an ellipse is
farther from that of the start at the cube's centre than half a diagonal and the greatest speed, times gains.
"""

from itertools import product
from math import ceil, pi, sqrt

import numpy as np

from pipeline.array_types import Booleans, Floats
from pipeline.flight.period.act.way_out import SPARE, STEPS, affordable_at
from pipeline.flight.state.arrays import World
from pipeline.physics.motion import ORBIT_PARTS

#: edges of the first cubes and of the last, m
FIRST_EDGE, LAST_EDGE = 4.0, 0.5
#: most cubes that are left at any time, and those that are looked at together
MOST_CUBES, TOGETHER = 400_000, 20_000
#: angles at which gains are computed, and what they may be greater by in between
GAIN_ANGLES, IN_BETWEEN = 3600, 1.01


def start_without_way_out(world: World, shell: tuple[float, float, float]) -> Floats | None:
    """Return a position, (3,), m, near which starts may have no way out; None if all of a shell have one.

    The shell is the least and the greatest distance of starts, m, and their greatest speed, m/s.
    """
    near, far, speed = shell
    if near < world.guard.keep_out or far > world.guard.keep_in:
        return np.array([near if near < world.guard.keep_out else far, 0.0, 0.0])
    ways, edge = _WaysOut(world, speed), FIRST_EDGE
    axis = edge * (np.arange(-ceil(far / edge), ceil(far / edge)) + 0.5)
    centres = np.stack(np.meshgrid(axis, axis, axis), axis=-1).reshape(-1, 3)
    corners = np.array(list(product((-0.25, 0.25), repeat=3)))
    while True:
        half = 0.5 * sqrt(3.0) * edge
        distances = np.linalg.norm(centres, axis=1)
        centres = centres[(distances + half >= near) & (distances - half <= far)]
        parts = range(0, len(centres), TOGETHER)
        is_open = [ways.are_open(centres[first : first + TOGETHER], half) for first in parts]
        centres = centres[~np.concatenate(is_open)] if is_open else centres
        if len(centres) == 0:
            return None
        if edge <= LAST_EDGE or len(centres) > MOST_CUBES:
            return np.asarray(centres[np.abs(np.linalg.norm(centres, axis=1) - 0.5 * (near + far)).argmin()])
        centres = (centres[:, np.newaxis] + edge * corners).reshape(-1, 3)
        edge *= 0.5


class _WaysOut:
    """The ways out from starts up to a speed, m/s: a force in the first control period, by half-axis."""

    def __init__(self, world: World, speed: float) -> None:
        n, guard, self.speed = world.mean_motion, world.guard, speed
        phi, gamma = world.motion.transition[0], world.motion.control[0]
        centre = np.array([4.0, 0.0, 0.0, 0.0, 2.0 / n, 0.0])
        # what closes the ellipse, then what makes the radial speed zero, and the state after both
        closing = -(centre @ phi) / (centre @ gamma)[1]
        radial = -(phi[3] + gamma[3, 1] * closing) / gamma[3, 0]
        self.force = np.stack([radial, closing])
        self.after = phi + gamma[:, :2] @ self.force
        self.half_axes = 0.5 * guard.keep_in * np.arange(-STEPS, STEPS + 1) / STEPS
        self.most, self.spheres = guard.braking_force, (guard.keep_out + SPARE, guard.keep_in - SPARE)
        self.affordable = affordable_at(world, 0, 0.0)
        self.per_half_axis = n * gamma[:, 0] / gamma[3, 0], n / gamma[3, 0]
        #: rows of radial half-axis, of the centre along the track, and of swing and its quarter
        self.elements = np.zeros((5, 6))
        self.elements[0, 0], self.elements[0, 4], self.elements[1, 3] = -3.0, -2.0 / n, 1.0 / n
        self.elements[2, 1], self.elements[2, 3] = 1.0, -2.0 / n
        self.elements[3, 2], self.elements[4, 5] = 1.0, 1.0 / n
        self.looks = _looks(2.0 * pi * np.arange(ORBIT_PARTS) / ORBIT_PARTS - n * world.control_period)
        looks = _looks(2.0 * pi * np.arange(GAIN_ANGLES) / GAIN_ANGLES)
        paths = looks.transpose(2, 0, 1) @ self.elements @ self.after
        #: of positions by position, and by velocity, s
        self.gains = [
            IN_BETWEEN * float(np.linalg.norm(paths[:, :, part], ord=2, axis=(1, 2)).max())
            for part in (np.s_[:3], np.s_[3:])
        ]

    def are_open(self, centres: Floats, half: float) -> Booleans:
        """Return whether all starts up to half a diagonal away from each centre, (m, 3), have a way out."""
        open_now = np.zeros(len(centres), dtype=np.bool_)
        for half_axis in sorted(self.half_axes, key=abs):
            left = np.flatnonzero(~open_now)
            open_now[left] = self._are_by(half_axis, centres[left], half)
        return open_now

    def _are_by(self, half_axis: float, centres: Floats, half: float) -> Booleans:
        """Return whether the force that makes a radial half-axis, m, is a way out of each cube."""
        forces = centres @ self.force[:, :3].T + half_axis * np.array([self.per_half_axis[1], 0.0])
        spreads = half * np.linalg.norm(self.force[:, :3], axis=1)
        spreads += self.speed * np.linalg.norm(self.force[:, 3:], axis=1)
        greatest = np.abs(forces) + spreads
        is_open = (greatest <= self.most).all(axis=1) & (greatest.sum(axis=1) <= self.affordable)
        # paths are dear, and often few cubes can pay
        is_open[is_open] = self._stay_between(half_axis, centres[is_open], half)
        return np.asarray(is_open)

    def _stay_between(self, half_axis: float, centres: Floats, half: float) -> Booleans:
        """Return whether all ellipses of each cube, of one radial half-axis, m, stay between the spheres."""
        elements = (centres @ self.after[:, :3].T + half_axis * self.per_half_axis[0]) @ self.elements.T
        x, y, z = elements @ self.looks
        squares = x * x + y * y + z * z
        spread = self.gains[0] * half + self.gains[1] * self.speed
        size = np.hypot(elements[:, 0], elements[:, 1]) + spread
        swing = np.hypot(elements[:, 3], elements[:, 4]) + spread
        bend = 4.0 * size * (np.abs(elements[:, 2]) + spread) + 4.0 * (1.5 * size**2 + 0.5 * swing**2)
        beyond = 0.5 * (pi / ORBIT_PARTS) ** 2 * bend
        near = np.maximum(np.sqrt(squares.min(axis=1)) - spread, 0.0)
        far = np.sqrt(squares.max(axis=1)) + spread
        is_between = (near**2 - beyond >= self.spheres[0] ** 2) & (far**2 + beyond <= self.spheres[1] ** 2)
        return np.asarray(is_between)


def _looks(angles: Floats) -> Floats:
    """Return, (3, 5, m), what elements of closed ellipses count for in each coordinate at angles, rad."""
    cosine, sine = np.cos(angles), np.sin(angles)
    looks = np.zeros((3, 5, len(angles)))
    looks[0, 0], looks[0, 1] = cosine, sine
    looks[1, 0], looks[1, 1], looks[1, 2] = -2.0 * sine, 2.0 * cosine, 1.0
    looks[2, 3], looks[2, 4] = cosine, sine
    return looks
