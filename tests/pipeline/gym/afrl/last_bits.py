"""Print how far AFRL's own motion with six degrees of freedom parts from itself: ``python last_bits.py``.

The random episodes of `afrl_six_dof.npz` are flown again by ``safe_autonomy_simulation`` alone, as they are
and with each thrust changed in its last bit: its Runge-Kutta steps are chosen by an error of the size of
rounding, and a step that ends later passes the limit of the rate by more.
"""

import sys
from pathlib import Path

import numpy as np
from safe_autonomy_simulation.sims.spacecraft.sixdof_model import SixDOFDynamics

NUM_SCRIPTED = 20


def flown(start: np.ndarray, actions: np.ndarray) -> np.ndarray:
    """Return the positions at each step, m, of a deputy that starts along Hill axes, at rest."""
    inertia, limits = 0.0573 * np.eye(3), {"ang_vel_limit": [0.034907] * 3, "ang_acc_limit": [0.017453] * 3}
    dynamics = SixDOFDynamics(m=12.0, inertia_matrix=inertia, n=0.001027, **limits)
    states = [np.array([*start, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0])]
    for action in actions:
        states.append(dynamics.step(10.0, states[-1], action)[0])
    return np.array(states)[:, :3]


def main() -> None:
    """Print the largest distance in each episode, sorted."""
    table = np.load(Path(__file__).parent / "afrl_six_dof.npz")
    ends, apart = np.cumsum(table["length"]), []
    for episode in range(NUM_SCRIPTED, len(ends)):
        actions = table["actions"][ends[episode - 1] : ends[episode]].astype(np.float64)
        start, changed = table["start"][episode][:6], actions.copy()
        changed[:, :3] = np.nextafter(actions[:, :3], np.inf)
        apart.append(np.abs(flown(start, changed) - flown(start, actions)).max())
    sys.stdout.write(" ".join(f"{gap:.1e}" for gap in sorted(apart, reverse=True)) + " m\n")


if __name__ == "__main__":
    main()
