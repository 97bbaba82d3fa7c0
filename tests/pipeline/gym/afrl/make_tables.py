"""Make the tables here and in `../docking` from AFRL's own environments: ``python make_tables.py SIMS``.

SIMS is a copy of https://github.com/act3-ace/safe-autonomy-sims; its ``safe_autonomy_simulation`` is
installed with pip, ``--no-deps`` as it asks for an older NumPy, and what both import: Gymnasium, PettingZoo,
SciPy, scikit-learn, diffrax, pint. `made_with.json` says which versions made the tables. Episodes start from
their `reset`, by seed. Of each twenty, twelve are flown to success, two to the end of time, three into the
chief, three out of bounds; twenty more have random forces. Their weighted classes leave out the placement
that their configurations name, Fibonacci's; it is put back here. Their chief with six degrees of freedom is
at rest among the stars, so that one side of it is always dark: success is at 0.45 of the weight. Random
episodes are flown there until twenty repeat when last bits change (`last_bits.py`); all are kept. Of ten of
docking with a script, six are flown to the dock, two are too fast there, two stay away to the end of time;
ten more have random forces.
"""

import functools
import itertools
import json
import sys
from collections.abc import Callable, Sequence
from importlib.metadata import version
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
from last_bits import own_change
from scipy.spatial.transform import Rotation

HERE = Path(__file__).parent
NUM_EPISODES = 20
#: positions are kept of each tenth step, and of the last
EVERY = 10
#: an episode repeats if its positions change by less, m, when last bits do
REPEATED_M = 1e-5
#: of docking's wanted speeds: share of the limit at the distance
SHARES = [0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 1.02, 1.02, 0.001, 0.001]
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


def scripted_turning(env: Any, episode: int, k: int) -> np.ndarray:
    """Return that force along body axes, N, and the torque of a law that faces the chief, N m."""
    body = Rotation.from_quat(env.deputy.orientation).inv()
    gone = body.apply(-env.deputy.position) / np.linalg.norm(env.deputy.position)
    torque = 0.0573 * (0.0016 * np.cross([1.0, 0.0, 0.0], gone) - 0.06 * env.deputy.angular_velocity)
    torque = np.round(2.0**20 * np.clip(torque, -0.00099, 0.00099)) / 2.0**20
    force = np.round(256.0 * np.clip(body.apply(scripted(env, episode, k)), -1.0, 1.0)) / 256.0
    return np.concatenate([force, torque])


def randomly(env: Any, episode: int, k: int) -> np.ndarray:
    """Return a random action: a force, N, and a torque, N m."""
    drawn = np.random.default_rng([episode, k]).uniform(-1.0, 1.0, env.action_space.shape)
    return (drawn * env.action_space.high).astype(np.float32)


def flown(
    env: Any, law: Callable[[int], np.ndarray], observe: Callable[[], Any]
) -> tuple[Any, Any, list[Any]]:
    """Fly an episode to its end; return actions, rewards and what is told at each sample."""
    actions, rewards, rows, is_over = [], [], [observe()], False
    while not is_over:
        actions.append(law(len(actions)))
        _, reward, terminated, truncated, _ = env.step(actions[-1])
        rewards.append(reward)
        rows.append(observe())
        is_over = terminated or truncated
    return np.array(actions), np.array(rewards), rows


def kept(samples: Sequence[np.ndarray]) -> np.ndarray:
    """Return each tenth sample, and the last."""
    return np.array([*samples[:-1:EVERY], samples[-1]])


def inspected(env: Any, seed: int, act: Callable[[int], np.ndarray]) -> dict[str, Any]:
    """Fly an episode of inspection; return what happened."""
    env._get_obs = lambda: np.zeros(1)  # theirs finds clusters, which takes most of the time
    env.reset(seed=seed)
    deputy, points = env.deputy, env.chief.inspection_points
    start = np.array((*deputy.position, *deputy.velocity, env.sun.theta, *points.priority_vector))

    def observe() -> tuple[int, float, np.ndarray, np.ndarray]:
        seen = points.get_num_points_inspected(), points.get_total_weight_inspected()
        return *seen, deputy.position.copy(), deputy.orientation.copy()

    actions, rewards, rows = flown(env, act, observe)
    counts, weights, positions, turns = zip(*rows, strict=True)
    return {
        "start": start, "actions": actions, "counts": np.array(counts, dtype=np.uint8),
        "weights": np.array(weights), "rewards": rewards, "places": kept(positions), "turns": kept(turns),
        "status": env.status,
    }  # fmt: skip


def flights(kind: Callable[[], Any], law: Callable[..., Any], may_change: bool) -> list[dict[str, Any]]:
    """Fly twenty episodes; where last bits may change them, as many as it takes for twenty to repeat."""
    episodes: list[dict[str, Any]] = []
    while sum(episode["own_change"] < REPEATED_M for episode in episodes) < NUM_EPISODES:
        env, seed, change = kind(), len(episodes), 0.0
        episode = inspected(env, seed, functools.partial(law, env, seed))
        if may_change:
            change = own_change(env.deputy.dynamics, episode["start"], episode["actions"])
        episodes.append(episode | {"own_change": change})
    return episodes


def make(name: str, kind: Callable[[], Any], script: Callable[..., np.ndarray] = scripted) -> None:
    """Write the table of one of their environments."""
    is_turning = name == "afrl_six_dof"
    columns: dict[str, list[Any]] = {}
    for episode in [
        *flights(kind, script, may_change=False),
        *flights(kind, randomly, may_change=is_turning),
    ]:
        for key, value in episode.items():
            columns.setdefault(key, []).append(value)
    lengths = [len(actions) for actions in columns["actions"]]
    joined = {
        key: np.concatenate(values)
        for key, values in columns.items()
        if key in ("actions", "counts", "rewards", "places")
    }
    if name != "afrl":
        joined["weights"] = np.concatenate(columns["weights"])
    if is_turning:
        joined["turns"] = np.concatenate(columns["turns"])
        joined["own_change"] = np.array(columns["own_change"][NUM_EPISODES:])
    arrays = joined | {"start": columns["start"], "status": columns["status"], "length": lengths}
    np.savez_compressed(HERE / f"{name}.npz", **{key: np.asarray(value) for key, value in arrays.items()})


def docking(env: Any, episode: int, k: int) -> np.ndarray:
    """Return the force of a law that comes in at a share of the limit, N, Hill axes."""
    position, velocity = env.deputy.position, env.deputy.velocity
    distance = np.linalg.norm(position)
    wanted = -position / distance * SHARES[episode] * (0.2 + 0.002054 * (distance - 0.5))
    force = 12.0 * 0.4 * (wanted - velocity)
    return (np.round(1024.0 * np.clip(force, -1.0, 1.0)) / 1024.0).astype(np.float32)


def docking_randomly(env: Any, episode: int, k: int) -> np.ndarray:
    """Return a random force, N."""
    drawn = np.random.default_rng([episode, k]).uniform(-1.0, 1.0, 3)
    return (np.round(1024.0 * drawn) / 1024.0).astype(np.float32)


def make_docking(kind: Callable[[], Any]) -> None:
    """Write the table of docking, each episode with the script, then each with random forces."""
    rows = []
    for law, episode in itertools.product((docking, docking_randomly), range(len(SHARES))):
        env = kind()
        env.reset(seed=episode)
        start = np.concatenate([env.deputy.position, env.deputy.velocity])
        act = functools.partial(law, env, episode)
        actions, rewards, positions = flown(env, act, lambda env=env: env.deputy.position.copy())
        rows.append((start, actions, rewards, kept(positions), env.status))
    starts, actions, rewards, positions, statuses = zip(*rows, strict=True)
    np.savez_compressed(
        HERE.parent / "docking" / "docking.npz",
        start=np.array(starts),
        actions=np.round(1024.0 * np.concatenate(actions)).astype(np.int16),
        rewards=np.concatenate(rewards),
        places=np.concatenate(positions),
        status=np.array(statuses),
        length=np.array([len(flight) for flight in actions]),
    )


def main() -> None:
    """Write the tables, and what made them."""
    sys.path.insert(0, sys.argv[1])
    from safe_autonomy_sims.gym import inspection  # noqa: PLC0415 - found only now
    from safe_autonomy_sims.gym.docking import docking_v0  # noqa: PLC0415 - as above
    from safe_autonomy_simulation.sims.inspection import target  # noqa: PLC0415 - as above

    make_docking(docking_v0.DockingEnv)
    make("afrl", inspection.InspectionEnv)
    placed = functools.partial(target.p.InspectionPointSet, points_algorithm="fibonacci")
    target.p = SimpleNamespace(InspectionPointSet=placed)
    make("afrl_weighted", inspection.WeightedInspectionEnv)
    turning = functools.partial(inspection.WeightedSixDofInspectionEnv, success_threshold=0.45)
    make("afrl_six_dof", turning, scripted_turning)
    sims = (Path(sys.argv[1]) / "VERSION").read_text(encoding="utf-8").strip()
    made = {"safe_autonomy_sims": sims} | {
        package: version(package) for package in ("safe-autonomy-simulation", "numpy", "scipy", "gymnasium")
    }
    (HERE / "made_with.json").write_text(json.dumps(made, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
