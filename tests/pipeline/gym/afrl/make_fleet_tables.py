"""Make the tables of several deputies from AFRL's own environments: ``python make_fleet_tables.py SIMS``.

SIMS and what is installed are as for `make_tables.py`. Of each ten episodes, of two and three deputies, four
have random forces; in two the deputies sweep the sunlit side, in one they meet, in one one of them comes to
the chief, in two one leaves. Those that dock come in at a share of the limit on their speed.
"""

import functools
import sys
from collections.abc import Callable, Sequence
from importlib import import_module
from types import SimpleNamespace
from typing import Any

import numpy as np
from make_tables import HERE, kept
from scipy.spatial.transform import Rotation

#: number of deputies, what they do, and at most how many s, of inspection
INSPECTIONS = [(2, "random", 1000), (3, "random", 1000), (2, "random", 1000), (3, "random", 1000)]
INSPECTIONS += [(2, "sweep", 1000), (3, "sweep", 1000), (2, "meet", 1000), (3, "chief", 1000)]
INSPECTIONS += [(2, "leave", 1000), (3, "leave", 1000)]
#: and of docking, with the share of the limit on the speed at which the first comes in
DOCKINGS = [(2, "random", 0.0), (3, "random", 0.0), (2, "random", 0.0), (3, "random", 0.0)]
DOCKINGS += [
    (2, "in", 0.6),
    (3, "in", 0.7),
    (2, "in", 1.02),
    (3, "in", 0.001),
    (2, "meet", 0.5),
    (2, "in", 0.8),
]


def towards(deputy: Any, goal: np.ndarray) -> np.ndarray:
    """Return the force of a law that goes to a goal, N, Hill axes."""
    return 12.0 * (-4e-4 * (deputy.position - goal) - 0.03 * deputy.velocity)


def inspecting(env: Any, what: str, episode: int, k: int, number: int, deputy: Any) -> np.ndarray:
    """Return the force of a deputy that inspects, N, Hill axes."""
    if what == "random":
        return np.random.default_rng([episode, k, number]).uniform(-1.0, 1.0, 3)
    if what == "meet":
        return towards(deputy, np.array([30.0, 0.0, 4.0 * number]))
    if what == "chief" and number == 0:
        return towards(deputy, np.zeros(3))
    if what == "leave" and number == 1:
        return np.sign(deputy.position)
    height, sun = 1.3 * np.sin(0.02 * k + 2.0 * number), -env.sun.theta
    flat = np.array([np.cos(sun) * np.cos(height), np.sin(sun) * np.cos(height), np.sin(height)])
    return towards(deputy, 40.0 * flat + np.array([0.0, 0.0, 25.0 * number]))


def turning(env: Any, what: str, episode: int, k: int, number: int, deputy: Any) -> np.ndarray:
    """Return that force along body axes, N, and the torque of a law that faces the chief, N m."""
    body = Rotation.from_quat(deputy.orientation).inv()
    gone = body.apply(-deputy.position) / np.linalg.norm(deputy.position)
    torque = 0.0573 * (0.0016 * np.cross([1.0, 0.0, 0.0], gone) - 0.06 * deputy.angular_velocity)
    return np.concatenate([body.apply(inspecting(env, what, episode, k, number, deputy)), torque])


def rounded(actions: Sequence[np.ndarray]) -> np.ndarray:
    """Return actions within their limits that single precision holds: forces, N, and torques, N m, if any."""
    forces, torques = np.split(np.asarray(actions), [3], axis=1)
    forces = np.round(1024.0 * np.clip(forces, -1.0, 1.0)) / 1024.0
    torques = np.round(2.0**20 * np.clip(torques, -0.00099, 0.00099)) / 2.0**20
    return np.hstack([forces, torques]).astype(np.float32)


def docking(env: Any, what: str, episode: int, k: int, number: int, deputy: Any, share: float) -> np.ndarray:
    """Return the force of a deputy that docks, N, Hill axes."""
    if what == "random":
        return np.random.default_rng([episode, k, number]).uniform(-1.0, 1.0, 3)
    goal = np.array([20.0, 0.0, 0.0]) if what == "meet" else np.zeros(3)
    gone = goal - deputy.position
    distance = np.linalg.norm(gone)
    slower = share * 0.5**number * (0.2 + 0.002054 * max(distance - 0.5, 0.0))
    return 12.0 * 0.4 * (gone / max(distance, 1e-9) * slower - deputy.velocity)


def flown(env: Any, law: Callable[..., np.ndarray], seed: int, observe: Callable[[], Any]) -> dict[str, Any]:
    """Fly an episode to its end."""
    env.reset(seed=seed)
    agents = list(env.agents)
    state = [[*env.deputies[agent].position, *env.deputies[agent].velocity] for agent in agents]
    actions, rewards, rows = [], [], [observe(agents)]
    positions = [np.array(state)[:, :3]]
    while env.agents:
        wanted = [law(len(actions), number, env.deputies[agent]) for number, agent in enumerate(agents)]
        actions.append(rounded(wanted))
        _, paid, terminated, truncated, _ = env.step(dict(zip(agents, actions[-1], strict=True)))
        rewards.append([paid[agent] for agent in agents])
        rows.append(observe(agents))
        positions.append(np.array([env.deputies[agent].position for agent in agents]))
    assert set(terminated.values()) == set(truncated.values()) == {True}
    columns = zip(("counts", "own", "weights"), zip(*rows, strict=True), strict=False)
    return {
        "start": np.array(state), "actions": np.array(actions),
        "rewards": np.array(rewards), "places": kept(positions),
        "status": np.array([env.status[agent] for agent in agents]),
    } | {name: np.array(values) for name, values in columns}  # fmt: skip


def inspected(
    kind: Callable[..., Any], episode: int, law: Callable[..., np.ndarray] = inspecting
) -> dict[str, Any]:
    """Fly an episode of inspection."""
    deputies, what, seconds = INSPECTIONS[episode]
    env = kind(num_agents=deputies, max_time=seconds)
    env._get_obs = lambda agent: np.zeros(1)  # theirs finds clusters, which takes most of the time

    def observe(agents: list[str]) -> tuple[Any, ...]:
        points = env.chief.inspection_points
        counts = [points.get_num_points_inspected(inspector_entity=env.deputies[agent]) for agent in agents]
        return points.get_num_points_inspected(), counts, points.get_total_weight_inspected()

    env.reset(seed=episode)  # the Sun moves on in flight
    sun, priority = env.sun.theta, env.chief.inspection_points.priority_vector
    flight = flown(env, functools.partial(law, env, what, episode), episode, observe)
    return flight | {"sun": sun, "priority": priority}


def docked(kind: Callable[..., Any], episode: int) -> dict[str, Any]:
    """Fly an episode of docking."""
    deputies, what, share = DOCKINGS[episode]
    env = kind(num_agents=deputies)
    law = functools.partial(docking, env, what, episode, share=share)
    return flown(env, law, episode, lambda agents: ())


def write(name: str, flights: list[dict[str, Any]]) -> None:
    """Write the table of one of their environments."""
    columns = {
        f"{number}_{key}": value for number, flight in enumerate(flights) for key, value in flight.items()
    }
    np.savez_compressed(HERE / f"{name}.npz", **columns)
    for flight in flights:
        sys.stdout.write(f"{name} {len(flight['actions'])} {flight['status'].tolist()}\n")


def main() -> None:
    """Write all tables."""
    sys.path.insert(0, sys.argv[1])
    theirs = "safe_autonomy_sims.pettingzoo."
    docks = import_module(theirs + "docking.multidocking_v0")
    plain = import_module(theirs + "inspection.multi_inspection_v0")
    weighted = import_module(theirs + "inspection.weighted_multi_inspection_v0")
    turned = import_module(theirs + "inspection.sixdof_multi_inspection_v0")
    target = import_module("safe_autonomy_simulation.sims.inspection.target")

    write("fleet_docking", [docked(docks.MultiDockingEnv, number) for number in range(10)])
    write("fleet", [inspected(plain.MultiInspectionEnv, number) for number in range(10)])
    placed = functools.partial(target.p.InspectionPointSet, points_algorithm="fibonacci")
    target.p = SimpleNamespace(InspectionPointSet=placed)
    kind = functools.partial(weighted.WeightedMultiInspectionEnv, success_threshold=0.5)
    write("fleet_weighted", [inspected(kind, number) for number in range(10)])
    kind = functools.partial(turned.WeightedSixDofMultiInspectionEnv, success_threshold=0.45)
    write("fleet_six_dof", [inspected(kind, number, turning) for number in range(10)])


if __name__ == "__main__":
    main()
