"""The safety layer's way out that needs no thrust (docs/explanation/safety.md, a way out without thrust)."""

from collections.abc import Iterator

import numpy as np

from pipeline.array_types import Floats
from pipeline.flight.reference.safety import SafetyLayer

#: half-axes that are tried each way; looks at an ellipse; bisections towards the way out
STEPS, LOOKS, HALVINGS = 12, 36, 20
#: what is spared at the start, falling to nothing at the end: m, and m/s of the limit on the delta-v
SPARE, SPARE_DELTA_V = 1e-3, 1e-6
#: the height of the centre of a closed ellipse, m
CLOSED = 1e-6


class WayOut:
    """Admits the forces after which one force still leads onto a closed ellipse between the spheres.

    At the end of a flight only those that lead onto one. That force counts only if what is `left` of a limit
    on the delta-v, m/s, pays it.
    """

    def __init__(
        self, layer: SafetyLayer, mean_motion: float, k: int, num_controls: int, left: float = np.inf
    ) -> None:
        self.layer, self.n, self.k, self.is_last = layer, mean_motion, k, k + 1 == num_controls
        self.spare = SPARE * (1.0 - k / num_controls)
        self.left = left - SPARE_DELTA_V * (1.0 - k / num_controls)
        #: from a state to the height of the centre of its ellipse, and to its radial half-axes
        self.centre = np.array([4.0, 0.0, 0.0, 0.0, 2.0 / mean_motion, 0.0])
        self.high = np.array([-3.0, 0.0, 0.0, 0.0, -2.0 / mean_motion, 0.0])
        self.aside = np.array([0.0, 0.0, 0.0, 1.0 / mean_motion, 0.0, 0.0])

    def admitted(self, state: Floats, requested: Floats) -> tuple[Floats, str | None]:
        """Return the requested force, or as much of it beyond the way out as leaves one, with the limit."""
        if self.stays_open(state, requested, self.left):
            return requested, None
        forces = list(self.ways_out(state, self.k, self.left))
        if not forces:
            return requested, None
        out = min(forces, key=lambda force: float(np.abs(force).sum()))
        low, high = 0.0, 1.0
        for _ in range(0 if self.is_last else HALVINGS):
            share = 0.5 * (low + high)
            if self.stays_open(state, out + share * (requested - out), self.left):
                low = share
            else:
                high = share
        limit = "delta_v" if self.stays_open(state, requested, np.inf) else "way_out"
        return np.asarray(out + low * (requested - out)), limit

    def stays_open(self, state: Floats, force: Floats, left: float) -> bool:
        """Return whether the state after a period with a force lies between the spheres and has a way out.

        Force and way out must cost no more than is left, m/s.
        """
        left -= self.cost(force)
        if left < 0.0:
            return False
        ahead = self.layer.phi @ state + self.layer.gamma @ force
        if not self.layer.out + self.spare <= np.linalg.norm(ahead[:3]) <= self.layer.far - self.spare:
            return False
        if self.is_last:
            return bool(abs(self.centre @ ahead) <= CLOSED and self.lies_between(ahead, self.k + 1))
        return any(True for _ in self.ways_out(ahead, self.k + 1, left))

    def cost(self, force: Floats) -> float:
        """Return the delta-v of a force held over a period, m/s."""
        return float(np.abs(force).sum() * self.layer.period / self.layer.mass)

    def ways_out(self, state: Floats, k: int, left: float) -> Iterator[Floats]:
        """Yield the tried forces, N, that lead from sample k onto a closed ellipse between the spheres.

        They cost no more than is left, m/s.
        """
        free, gamma = self.layer.phi @ state, self.layer.gamma
        for force in self.tried(free):
            is_weak = np.abs(force).max() <= self.layer.braking and self.cost(force) <= left
            if is_weak and self.lies_between(free + gamma @ force, k + 1):
                yield force

    def tried(self, free: Floats) -> Iterator[Floats]:
        """Yield forces that close the ellipse, from the state after the period without one."""
        gamma = self.layer.gamma
        closing = -(self.centre @ free) / (self.centre @ gamma)[1]
        aside = 0.5 * self.layer.far * np.linspace(-1.0, 1.0, 2 * STEPS + 1)
        moved = self.aside @ free + (self.aside @ gamma)[1] * closing
        for radial in [0.0, *(aside - moved) / (self.aside @ gamma)[0]]:
            force = np.array([radial, closing, 0.0])
            yield force
            ahead = free + gamma @ force
            # of the swing and its speed: none at the ellipse's highest point
            phase = np.array([self.high @ ahead, self.aside @ ahead / self.n])
            effect = phase @ gamma[[2, 5], 2]
            if abs(effect) > 1e-9:
                yield force - np.array([0.0, 0.0, phase @ ahead[[2, 5]] / effect])

    def lies_between(self, state: Floats, k: int) -> bool:
        """Return whether the ellipse of a state at sample k, taken for closed, is between the spheres.

        Between looks, which are fixed in time, its squared distance goes on by no more than its harmonics,
        the first two, allow.
        """
        angles = 2.0 * np.pi * np.arange(LOOKS) / LOOKS - self.n * self.layer.period * k
        cosine, sine, high, aside = np.cos(angles), np.sin(angles), self.high @ state, self.aside @ state
        radial = high * cosine + aside * sine
        along = state[1] - 2.0 * aside + 2.0 * (aside * cosine - high * sine)
        squares = radial**2 + along**2 + (state[2] * cosine + state[5] / self.n * sine) ** 2
        first, second = 2.0 / LOOKS * np.abs(np.fft.rfft(squares)[1:3])
        beyond = 0.5 * (np.pi / LOOKS) ** 2 * (first + 4.0 * second)
        near, far = self.layer.out + self.spare, self.layer.far - self.spare
        return bool(squares.min() - beyond >= near**2 and squares.max() + beyond <= far**2)
