"""Make the tables of what AFRL's agents observe: ``python make_observations.py SIMS``, as `make_tables.py`.

Of each environment four episodes of at most sixty steps, two by the script and two with random forces. Where
their clusters grow in number, they start at points drawn by NumPy's global generator, which is seeded here.
"""

import functools
import sys
from importlib import import_module
from types import SimpleNamespace
from typing import Any

import numpy as np
from make_tables import HERE, randomly, scripted, scripted_turning

NUM_STEPS = 60


def observed(env: Any, episode: int, script: Any) -> dict[str, Any]:
    """Fly an episode; return its start, actions and observations."""
    law = randomly if episode >= 2 else script
    observations = [env.reset(seed=episode)[0]]
    np.random.seed(episode)  # noqa: NPY002 - theirs draws from it
    start = np.array((*env.deputy.position, *env.deputy.velocity))
    sun, priority, actions, is_over = env.sun.theta, env.chief.inspection_points.priority_vector, [], False
    while not is_over and len(actions) < NUM_STEPS:
        actions.append(law(env, episode, len(actions)))
        observation, _, terminated, truncated, _ = env.step(actions[-1])
        observations.append(observation)
        is_over = terminated or truncated
    return {
        "start": start, "sun": sun, "priority": priority, "actions": np.array(actions, dtype=np.float32),
        "observations": np.array(observations),
    }  # fmt: skip


def main() -> None:
    """Write the table."""
    sys.path.insert(0, sys.argv[1])
    inspection = import_module("safe_autonomy_sims.gym.inspection")
    target = import_module("safe_autonomy_simulation.sims.inspection.target")
    columns: dict[str, Any] = {}

    def add(world: str, kind: Any, script: Any) -> None:
        for episode in range(4):
            for name, values in observed(kind(), episode, script).items():
                columns[f"{world}_{episode}_{name}"] = values

    add("afrl", inspection.InspectionEnv, scripted)
    placed = functools.partial(target.p.InspectionPointSet, points_algorithm="fibonacci")
    target.p = SimpleNamespace(InspectionPointSet=placed)
    add("afrl_weighted", inspection.WeightedInspectionEnv, scripted)
    add("afrl_six_dof", inspection.WeightedSixDofInspectionEnv, scripted_turning)
    np.savez_compressed(HERE / "observations.npz", **columns)


if __name__ == "__main__":
    main()
