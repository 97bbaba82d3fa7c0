"""Make the table beside this file from AFRL's own docking environment: ``python make_table.py SIMS``.

SIMS is a copy of https://github.com/act3-ace/safe-autonomy-sims, see `../afrl/make_tables.py`. Episodes start
from their `reset`, by seed. Of ten with a script, six are flown to the dock, two are too fast there, two stay
away to the end of time; ten more have random forces.
"""

import sys
from pathlib import Path

import numpy as np

HERE = Path(__file__).parent
NUM_EPISODES = 10
#: positions are kept of each tenth step, and of the last
EVERY = 10
#: of the wanted speed: share of the limit at the distance
SHARES = [0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 1.02, 1.02, 0.001, 0.001]


def scripted(env, episode: int, k: int) -> np.ndarray:
    """Return the force of a law that comes in at a share of the limit, N, Hill axes."""
    place, velocity = env.deputy.position, env.deputy.velocity
    distance = np.linalg.norm(place)
    wanted = -place / distance * SHARES[episode] * (0.2 + 0.002054 * (distance - 0.5))
    force = 12.0 * 0.4 * (wanted - velocity)
    return (np.round(1024.0 * np.clip(force, -1.0, 1.0)) / 1024.0).astype(np.float32)


def randomly(env, episode: int, k: int) -> np.ndarray:
    """Return a random force, N."""
    drawn = np.random.default_rng([episode, k]).uniform(-1.0, 1.0, 3)
    return (np.round(1024.0 * drawn) / 1024.0).astype(np.float32)


def main() -> None:
    """Write the table."""
    sys.path.insert(0, sys.argv[1])
    from safe_autonomy_sims.gym.docking import docking_v0  # noqa: PLC0415 - found only now

    rows = []
    for law in (scripted, randomly):
        for episode in range(NUM_EPISODES):
            env = docking_v0.DockingEnv()
            env.reset(seed=episode)
            start = np.concatenate([env.deputy.position, env.deputy.velocity])
            actions, rewards, places, is_over = [], [], [env.deputy.position.copy()], False
            while not is_over:
                actions.append(law(env, episode, len(actions)))
                _, reward, terminated, truncated, _ = env.step(actions[-1])
                rewards.append(reward)
                places.append(env.deputy.position.copy())
                is_over = terminated or truncated
            kept = np.array([*places[:-1:EVERY], places[-1]])
            rows.append((start, np.array(actions), np.array(rewards), kept, env.status))
    starts, actions, rewards, places, statuses = zip(*rows, strict=True)
    np.savez_compressed(
        HERE / "docking.npz",
        start=np.array(starts),
        actions=np.round(1024.0 * np.concatenate(actions)).astype(np.int16),
        rewards=np.concatenate(rewards),
        places=np.concatenate(places),
        status=np.array(statuses),
        length=np.array([len(one) for one in actions]),
    )


if __name__ == "__main__":
    main()
