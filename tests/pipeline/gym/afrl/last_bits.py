"""How far AFRL's own motion with six degrees of freedom changes when last bits do.

Its Runge-Kutta steps are chosen by an error of the size of rounding, and a step that ends later passes the
limit of the rate by more. Code that does the same sums in another order changes such bits.
"""

from typing import Any

import numpy as np

NUM_TRIES = 20
#: where a slope has what thrust and torque make
ACCELERATIONS = [3, 4, 5, 10, 11, 12]


def flown(dynamics: Any, start: np.ndarray, actions: np.ndarray) -> np.ndarray:
    """Return the positions at each step, m, of a deputy that starts along Hill axes, at rest."""
    states = [np.array([*start[:6], 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0])]
    for action in actions:
        states.append(dynamics.step(10.0, states[-1], action)[0])
    return np.array(states)[:, :3]


def own_change(dynamics: Any, start: np.ndarray, actions: np.ndarray) -> float:
    """Return how far positions change at most, m, in tries with other last bits of thrust and torque.

    Each acceleration that they make goes up or down by a bit, at random, each time the integrator asks.
    """
    generator, slopes = np.random.default_rng(1), dynamics.compute_state_dot

    def changed(*arguments: Any) -> np.ndarray:
        slope = slopes(*arguments)
        slope[ACCELERATIONS] = np.nextafter(slope[ACCELERATIONS], generator.choice([-np.inf, np.inf], 6))
        return slope

    as_it_is = flown(dynamics, start, actions)
    dynamics.compute_state_dot = changed
    return max(float(np.abs(flown(dynamics, start, actions) - as_it_is).max()) for _ in range(NUM_TRIES))
