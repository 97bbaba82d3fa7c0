"""Make the tables beside this file from AFRL's own environments: ``python make_tables.py SIMS``.

SIMS is a copy of https://github.com/act3-ace/safe-autonomy-sims; its ``safe_autonomy_simulation`` is
installed with pip, and Gymnasium with it. `made_with.json` says which versions made the tables. Episodes
start from their `reset`, by seed. Of each twenty, twelve are flown to success, two to the end of time, three
into the chief, three out of bounds; twenty more have random forces. Their weighted classes leave out the
placement that their configurations name, Fibonacci's; it is put back here.
"""

import functools
import json
import sys
from collections.abc import Callable
from importlib.metadata import version
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np

HERE = Path(__file__).parent
NUM_EPISODES = 20
#: positions are kept of each tenth step, and of the last
EVERY = 10
RADII = [40.0] * 12 + [60.0] * 2 + [1.0] * 3 + [900.0] * 3


def place_to_be(env: Any, radius: float, k: int) -> np.ndarray:
    """Return a place on the sunlit side that sweeps from pole to pole, or stays over one."""
    if radius == 60.0:
        return np.array([0.0, 0.0, radius])
    height = np.sin(0.02 * k) * 1.3
    sun = -env.sun.theta
    flat = np.array([np.cos(sun) * np.cos(height), np.sin(sun) * np.cos(height), np.sin(height)])
    return radius * flat


def scripted(env: Any, episode: int, k: int) -> np.ndarray:
    """Return the force of a law that goes to that place, N, Hill axes."""
    gone = env.deputy.position - place_to_be(env, RADII[episode], k)
    force = 12.0 * (-2.5e-4 * gone - 0.03 * env.deputy.velocity)
    return (np.round(256.0 * np.clip(force, -1.0, 1.0)) / 256.0).astype(np.float32)


def randomly(env: Any, episode: int, k: int) -> np.ndarray:
    """Return a random force, N."""
    return np.random.default_rng([episode, k]).uniform(-1.0, 1.0, 3).astype(np.float32)


def flown(env: Any, seed: int, act: Callable[[int], np.ndarray]) -> dict[str, Any]:
    """Fly an episode to its end; return what happened."""
    env._get_obs = lambda: np.zeros(1)  # theirs finds clusters, which takes most of the time
    env.reset(seed=seed)
    points = env.chief.inspection_points
    start = (*env.deputy.position, *env.deputy.velocity, env.sun.theta, *points.priority_vector)
    rows = [(points.get_num_points_inspected(), points.get_total_weight_inspected(), 0.0)]
    places, actions, is_over = [env.deputy.position.copy()], [], False
    while not is_over:
        actions.append(act(len(actions)))
        _, reward, terminated, truncated, told = env.step(actions[-1])
        rows.append((points.get_num_points_inspected(), points.get_total_weight_inspected(), reward))
        places.append(env.deputy.position.copy())
        is_over = terminated or truncated
    counts, weights, rewards = np.array(rows).T
    kept = [*places[:-1:EVERY], places[-1]]
    return {
        "start": np.array(start), "actions": np.array(actions), "counts": counts.astype(np.uint8),
        "weights": weights, "rewards": rewards[1:], "places": np.array(kept), "status": told["status"],
    }  # fmt: skip


def make(name: str, kind: Callable[[], Any]) -> None:
    """Write the table of one of their environments."""
    columns: dict[str, list[Any]] = {}
    for law in (scripted, randomly):
        for episode in range(NUM_EPISODES):
            env = kind()
            one = flown(env, episode, functools.partial(law, env, episode))
            for key, value in one.items():
                columns.setdefault(key, []).append(value)
    lengths = [len(actions) for actions in columns["actions"]]
    joined = {
        key: np.concatenate(values)
        for key, values in columns.items()
        if key in ("actions", "counts", "rewards", "places")
    }
    if name != "afrl":
        joined["weights"] = np.concatenate(columns["weights"])
    arrays = joined | {"start": columns["start"], "status": columns["status"], "length": lengths}
    np.savez_compressed(HERE / f"{name}.npz", **{key: np.asarray(value) for key, value in arrays.items()})


def main() -> None:
    """Write the tables, and what made them."""
    sys.path.insert(0, sys.argv[1])
    from safe_autonomy_sims.gym import inspection  # noqa: PLC0415 - found only now
    from safe_autonomy_simulation.sims.inspection import target  # noqa: PLC0415 - as above

    make("afrl", inspection.InspectionEnv)
    placed = functools.partial(target.p.InspectionPointSet, points_algorithm="fibonacci")
    target.p = SimpleNamespace(InspectionPointSet=placed)
    make("afrl_weighted", inspection.WeightedInspectionEnv)
    sims = (Path(sys.argv[1]) / "VERSION").read_text(encoding="utf-8").strip()
    made = {"safe_autonomy_sims": sims} | {
        package: version(package) for package in ("safe-autonomy-simulation", "numpy", "scipy", "gymnasium")
    }
    (HERE / "made_with.json").write_text(json.dumps(made, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
