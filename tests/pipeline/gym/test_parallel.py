"""Several deputies: PettingZoo's own tests, and AFRL's environments step for step.

`afrl/make_fleet_tables.py` made the tables, of safe-autonomy-sims (https://github.com/act3-ace/safe-autonomy-sims).
"""

import pickle
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from pipeline.command_line.config import compose_experiment
from pipeline.flight.control.controller import open_loop
from pipeline.flight.fly.fleets import room_for_messages
from pipeline.flight.fly.fleets_ahead import fly_all_fleets
from pipeline.flight.state.log import Scenario
from pipeline.gym import AFRL_WEIGHTED, InspectionEnv, Reward
from pipeline.gym.parallel import MultiInspectionEnv, MultiReachEnv, MultiSixDofInspectionEnv
from tests.pipeline.gym.test_against_afrl import CLOSE_M, EVERY, GREATEST, table

pytestmark = pytest.mark.slow

#: as their chief is
AT_REST = "chief.initial_angular_velocity_rad_s=[0,0,0]"
#: their environments' tables, with ours
PUBLISHED: dict[str, Any] = {
    "fleet": lambda number: MultiInspectionEnv(num_deputies=number, as_published=True),
    "fleet_weighted": lambda number: MultiInspectionEnv(
        ["world=afrl_weighted", "inspection_threshold_percent=50"], number, AFRL_WEIGHTED, as_published=True
    ),
    "fleet_six_dof": lambda number: MultiSixDofInspectionEnv(
        ["world=afrl_six_dof", AT_REST, "inspection_threshold_percent=45"], number, as_published=True
    ),
    "fleet_docking": lambda number: MultiReachEnv(num_deputies=number, as_published=True),
}


def of_episode(columns: dict[str, Any], number: int) -> dict[str, Any]:
    """Return an episode of a table."""
    first = f"{number}_"
    return {name.removeprefix(first): value for name, value in columns.items() if name.startswith(first)}


@pytest.mark.parametrize("name", PUBLISHED)
def test_the_same_actions_give_the_same_episode(name: str) -> None:
    columns, ends = table(f"afrl/{name}"), set()
    for number in range(10):
        theirs = of_episode(columns, number)
        env = PUBLISHED[name](len(theirs["start"]))
        sun = -float(theirs.get("sun", 0.0))  # their Sun's angle is counted from +i towards -j
        starts = [Scenario(state[:3], state[3:], sun) for state in theirs["start"]]
        options = {"scenarios": starts} | ({"priority": theirs["priority"]} if "priority" in theirs else {})
        _, infos = env.reset(options=options)
        positions, rows, rewards = [theirs["start"][:, :3]], [infos], []
        for step, forces in enumerate(theirs["actions"] / GREATEST[: theirs["actions"].shape[2]], 1):
            is_last = step == len(theirs["actions"])
            actions = dict(zip(env.agents, forces, strict=True))
            _, paid, terminated, truncated, infos = env.step(actions)
            assert set(terminated.values()) == set(truncated.values()) == {is_last}
            rewards.append(list(paid.values()))
            rows.append(infos)
            if step % EVERY == 0 or is_last:
                positions.append(env._positions)
        assert not env.agents
        np.testing.assert_allclose(positions, theirs["places"], rtol=0.0, atol=CLOSE_M)
        np.testing.assert_allclose(rewards, theirs["rewards"], rtol=0.0, atol=1e-6)
        each = [[list(infos.values()) for infos in rows][k] for k in range(len(rows))]
        if "own" in theirs:
            assert [[info["num_seen_first"] for info in row] for row in each] == theirs["own"].tolist()
            assert [row[0]["num_inspected"] for row in each] == theirs["counts"].tolist()
        if name in ("fleet_weighted", "fleet_six_dof"):
            weights = [row[-1]["weight_inspected"] for row in each]
            np.testing.assert_allclose(weights, theirs["weights"], rtol=0.0, atol=1e-12)
        assert rows[-1]["deputy_0"]["has_collided"] == ("Collision" in theirs["status"])
        ends |= set(theirs["status"].tolist())
    assert ends >= {"Running", "Timeout", "Collision", "Crash"}
    assert len(ends & {"Success", "Out of Bounds", "Max Velocity Violation"}) >= (1 if name == "fleet" else 2)


@pytest.mark.parametrize("world", ["world=paper", "world=leo"])
def test_the_fleet_flies_as_those_of_an_evaluation_do(world: str) -> None:
    """The same forces from the same starts: each path, and who has seen which point first."""
    overrides = [world, "sun=random"]
    env = MultiInspectionEnv(overrides, 3, Reward())
    env.reset(seed=5)
    words = [
        "+experiment=evaluate_fleet",
        "controller=coast",
        *overrides,
        "fleet.deputies=3",
        "fleet.sharing=mask",
    ]
    mission = compose_experiment(words).experiment.mission
    first, *others = starts_drawn(env, 5)
    forces = 0.02 * np.random.default_rng(1).uniform(-1.0, 1.0, (mission.num_controls, 3))
    tracks = np.zeros((1, 3, mission.num_controls + 1, 3), dtype=np.float32)
    messages = room_for_messages(mission, 1)
    controller = open_loop("played", forces)
    fly_all_fleets(
        mission, controller, [replace(first, others=tuple(others))], tracks=tracks, messages=messages
    )
    share, k = forces / mission.deputy.max_force_n, 0
    while env.agents:
        _, _, _, _, infos = env.step(dict.fromkeys(env.agents, share[k]))
        k += 1
        np.testing.assert_allclose(env._positions, tracks[0, :, k], rtol=0.0, atol=1e-4)
        seen_first = [(messages.seen_by[0, k] == number).sum() for number in (1, 2, 3)]
        assert [info["num_seen_first"] for info in infos.values()] == seen_first
    assert k > 50
    assert sum(count > 0 for count in seen_first) >= 2


def starts_drawn(env: MultiInspectionEnv, seed: int) -> list[Scenario]:
    """Return the starts that a seed draws: each its own, under the Sun of the first."""
    generator = np.random.default_rng(seed)
    starts = [env.task.draw(generator) for _ in env.possible_agents]
    sun = starts[0].sun_angle_rad, starts[0].sun_elevation_rad
    return [replace(start, sun_angle_rad=sun[0], sun_elevation_rad=sun[1]) for start in starts]


def test_a_copy_goes_on_as_the_original_does() -> None:
    env = MultiInspectionEnv(num_deputies=2)
    env.reset(seed=3)
    force = dict.fromkeys(env.agents, np.array([0.2, -0.1, 0.3]))
    for _ in range(5):
        env.step(force)
    copy = pickle.loads(pickle.dumps(env))  # noqa: S301 - of our own
    for original, copied in zip(env.step(force)[:2], copy.step(force)[:2], strict=True):
        for agent in env.agents:
            np.testing.assert_array_equal(original[agent], copied[agent])


def test_what_cannot_be_is_refused() -> None:
    with pytest.raises(ValueError, match="num_deputies is 7; it must be from 1 to 6"):
        MultiInspectionEnv(num_deputies=7)
    with pytest.raises(ValueError, match=r"fleet.deputies=2 is of fleets; leave it out"):
        InspectionEnv(["fleet.deputies=2"])
    env = MultiInspectionEnv(num_deputies=2)
    env.reset(seed=1)
    with pytest.raises(ValueError, match="actions are of deputy_0; each of deputy_0, deputy_1 needs one"):
        env.step({"deputy_0": np.zeros(3)})
    with pytest.raises(ValueError, match="1 starts were given for 2 deputies"):
        env.reset(options={"scenarios": [env.task.draw(np.random.default_rng(1))]})
