"""Where one push would do for ever: ``python -m benchmarks way_out [CONTROLLER...] [key=value...]``.

The safety layer's way out is to stop and to hold, for which thrusters must go on. A push onto a closed
ellipse inside the limits needs nothing more. For each controller this prints at what share of samples the
thrusters can fire one; where they err, and air and an oblate planet disturb, after what share of such pushes
silence keeps the deputy within the limits for an orbit.
"""

import argparse
from collections.abc import Sequence
from functools import lru_cache

import numpy as np

from pipeline.array_types import Floats
from pipeline.command_line.config import compose_experiment
from pipeline.controllers import source
from pipeline.evaluation.monte_carlo import fly_tracked
from pipeline.flight.world.coasting import FreeMotion
from pipeline.physics.motion import state_transition
from pipeline.scenarios import evaluation_scenarios
from pipeline.settings.equipment import RealActuators
from pipeline.settings.experiment import Mission

#: control periods between the samples that are looked at, and looks at an ellipse
EVERY, LOOKS = 12, 72
#: radial speeds that are tried, m/s, and what the limits are kept by, m, as the safety layer's filter does
RADIAL, KEEP_OUT_M, KEEP_IN_M = np.linspace(-0.2, 0.2, 41), 1.0, 2.0


def main(arguments: Sequence[str]) -> int:
    """Print a line for each controller."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks way_out", description=__doc__)
    parser.add_argument("words", nargs="+", help="controllers and keys")
    parser.add_argument("--cases", type=int, default=60, help="flights of each controller")
    parser.add_argument("--seed", type=int, default=4040, help="of the starts")
    options = parser.parse_args(arguments)
    changes = [word for word in options.words if "=" in word]
    words = [f"seed={options.seed}", f"monte_carlo.num_cases={options.cases}", "sun=random", *changes]
    experiment = compose_experiment(["+experiment=evaluate", *words]).experiment
    mission, generator = experiment.mission, np.random.default_rng(options.seed)
    for name in (word for word in options.words if "=" not in word):
        starts = evaluation_scenarios(experiment)
        _, tracks = fly_tracked(mission, source.named(name, mission), starts, None)
        num_seen, num_open, kept = 0, 0, list[bool]()
        for k in range(0, mission.num_controls + 1, EVERY):
            for state in tracks[:, k, :6].astype(np.float64):
                push = way_out(mission, state)
                num_seen, num_open = num_seen + 1, num_open + (push is not None)
                if push is not None and isinstance(mission.actuators, RealActuators):
                    kept.append(stays(mission, k, state, fired(mission.actuators, push, generator)))
        silent = f"; then silence keeps {100 * np.mean(kept):.1f} % within them for an orbit" if kept else ""
        print(f"{name}: a way out at {100 * num_open / num_seen:.1f} % of {num_seen:,} samples{silent}")
    return 0


@lru_cache(maxsize=1)
def looks_at(n: float) -> Floats:
    """Return what leads from a state to positions all along a closed ellipse, (LOOKS, 3, 6)."""
    times = 2.0 * np.pi / n * np.arange(LOOKS) / LOOKS
    return np.array([state_transition(n, time)[:3] for time in times.tolist()])


def way_out(mission: Mission, state: Floats) -> Floats | None:
    """Return the cheapest push onto a closed ellipse inside the limits, (3,), m/s; None if there is none."""
    x, _, z, _, _, w = state
    n, deputy = mission.orbit.mean_motion_rad_s, mission.deputy
    tilted = -(n**2) * x * z / np.where(np.abs(RADIAL) < n, np.inf, RADIAL)  # e/i-vector separation
    across = np.concatenate([np.full_like(RADIAL, w), np.zeros_like(RADIAL), tilted])
    after = np.tile(state, (len(across), 1))
    after[:, 3:] = np.column_stack([np.tile(RADIAL, 3), np.full_like(across, -2.0 * n * x), across])
    distances = np.linalg.norm(np.einsum("jab,ib->jia", looks_at(n), after), axis=2)
    pushes = after[:, 3:] - state[3:]
    most = mission.braking_force_n * mission.control_period_s / deputy.mass_kg
    is_open = (distances.min(axis=0) >= deputy.min_distance_m + KEEP_OUT_M) & (
        distances.max(axis=0) <= deputy.max_distance_m - KEEP_IN_M
    )
    is_open &= np.abs(pushes).max(axis=1) <= most
    costs = np.where(is_open, np.abs(pushes).sum(axis=1), np.inf)
    return np.asarray(pushes[costs.argmin()]) if is_open.any() else None


def fired(actuators: RealActuators, push: Floats, generator: np.random.Generator) -> Floats:
    """Return what thrusters that err make of a push, m/s."""
    turn = np.radians(actuators.misalignment_deg) * generator.standard_normal(3)
    return push * (1.0 + actuators.scale_error * generator.standard_normal(3)) + np.cross(turn, push)


def stays(mission: Mission, sample: int, state: Floats, push: Floats) -> bool:
    """Return whether free motion after a push stays within the limits for an orbit."""
    after, orbit_s = state + np.r_[np.zeros(3), push], 2.0 * np.pi / mission.orbit.mean_motion_rad_s
    motion, deputy = FreeMotion(mission, orbit_s), mission.deputy
    nearest, farthest = motion.distances(after[np.newaxis, np.newaxis], orbit_s, sample=sample)
    return bool(nearest[0, 0] >= deputy.min_distance_m and farthest[0, 0] <= deputy.max_distance_m)
