"""AFRL's inspection, step for step: the same actions, and what their own code makes of them.

`afrl/make_tables.py` made the tables, of safe-autonomy-sims (https://github.com/act3-ace/safe-autonomy-sims).
"""

from itertools import compress
from typing import Any, NamedTuple

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from pipeline.flight.control.controller import coast
from pipeline.flight.fly.simulation import fly_logged
from pipeline.flight.fly.six_dof import POSITION
from pipeline.flight.state.log import Scenario
from pipeline.flight.world.pack import inspection_points
from pipeline.gym import AFRL, AFRL_WEIGHTED, InspectionEnv, SixDofInspectionEnv, task_of
from pipeline.scenarios import evaluation_scenarios
from tests.places import PROJECT

pytestmark = pytest.mark.slow

#: of those, positions are kept
EVERY = 10
#: their greatest forces, N, and torques, N m
GREATEST = [1.0, 1.0, 1.0, 0.001, 0.001, 0.001]
#: theirs integrates with a tolerance of 1e-3 and takes forces in single precision
CLOSE_M = 1e-4
#: random episodes count in which their own positions change by less when last bits do
REPEATED_M = 1e-5
ENDS = {"Success", "Crash", "Out of Bounds", "Timeout"}
WORLDS = {"afrl": AFRL, "afrl_weighted": AFRL_WEIGHTED}


class Episode(NamedTuple):
    """An episode of theirs of K steps."""

    start: NDArray[np.float64]  # position (m), velocity (m/s), the Sun's angle (rad), priority
    actions: NDArray[np.float32]  # (K, 3)
    counts: NDArray[np.uint8]  # (K+1,) points inspected
    weights: NDArray[np.float64]  # (K+1,) their weight; no rows where all count alike
    rewards: NDArray[np.float64]  # (K,)
    positions: NDArray[np.float64]  # after each tenth step, from 0, and the last, m
    turns: NDArray[np.float64]  # attitudes where positions are kept; no rows where they are not flown
    status: str


def table(name: str) -> dict[str, NDArray[Any]]:
    """Read the columns of a table."""
    with np.load(PROJECT / "tests" / "pipeline" / "gym" / f"{name}.npz") as columns:
        return dict(columns)


def episodes(columns: dict[str, NDArray[Any]]) -> list[Episode]:
    """Part a table into its episodes."""
    lengths = columns["length"]
    steps, samples, kept = (np.cumsum(n)[:-1] for n in (lengths, lengths + 1, -(-lengths // EVERY) + 1))
    ends = {"actions": steps, "counts": samples, "weights": samples, "rewards": steps}
    ends |= {"places": kept, "turns": kept}
    none = [np.zeros(0)] * len(lengths)
    parts = [np.split(columns[name], each) if name in columns else none for name, each in ends.items()]
    rows = zip(columns["start"], *parts, map(str, columns["status"]), strict=True)
    return [Episode(*row) for row in rows]


def started(env: InspectionEnv | SixDofInspectionEnv, episode: Episode) -> dict[str, Any]:
    """Start an episode as theirs; return what is told."""
    position, velocity, (sun,), priority = np.split(episode.start, [3, 6, 7])
    scenario = Scenario(position, velocity, -sun)  # their Sun's angle is counted from +i towards -j
    return env.reset(options={"scenario": scenario, "priority": priority})[1]


def apart(positions: list[NDArray[np.float64]], episode: Episode) -> float:
    """Return how far places are off at most, m."""
    return float(np.abs(np.array([*positions[:-1:EVERY], positions[-1]]) - episode.positions).max())


def agreed(env: InspectionEnv | SixDofInspectionEnv, episode: Episode) -> float:
    """Fly an episode with its actions; return how far off places are at most, m.

    At every step points, their weight and the reward are the same, and so is the end; attitudes are close.
    """
    info, position = started(env, episode), episode.start[:3]
    positions, turns, rewards, rows, is_over = [position], [np.array([0.0, 0.0, 0.0, 1.0])], [], [info], False
    for action in episode.actions:
        assert not is_over
        if isinstance(env, SixDofInspectionEnv):
            _, reward, terminated, truncated, info = env.step(action / GREATEST)
            position, turn = np.split(env.state[[0, 1, 2, 6, 7, 8, 9]], [3])
            turns.append(turn)
        else:
            _, reward, terminated, truncated, info = env.step(action)
            position = env._episodes.flights.observed[0, :3].copy()
        positions.append(position)
        rewards.append(reward)
        rows.append(info)
        is_over = terminated or truncated
    assert terminated == (episode.status in ("Success", "Crash"))
    assert truncated == (episode.status in ("Out of Bounds", "Timeout"))
    assert [row["is_success"] for row in rows] == [False] * len(rows[1:]) + [episode.status == "Success"]
    assert [info["num_inspected"] for info in rows] == episode.counts.tolist()
    if len(episode.weights):
        weights = [info["weight_inspected"] for info in rows]
        np.testing.assert_allclose(weights, episode.weights, rtol=0, atol=1e-12)
    np.testing.assert_allclose(rewards, episode.rewards, rtol=0, atol=1e-6)
    if len(episode.turns):
        np.testing.assert_allclose([*turns[:-1:EVERY], turns[-1]], episode.turns, rtol=0, atol=1e-3)
    return apart(positions, episode)


def moved(env: SixDofInspectionEnv, episode: Episode) -> float:
    """Fly an episode with its actions, whatever it shows; return how far off places are at most, m."""
    started(env, episode)
    positions = [env.state[POSITION]]
    for action in episode.actions:
        env._is_over = False  # theirs is flown past an end of ours
        env.step(action / GREATEST)
        positions.append(env.state[POSITION])
    return apart(positions, episode)


@pytest.mark.parametrize("world", WORLDS)
def test_the_same_actions_give_the_same_episode(world: str) -> None:
    """Half of the episodes are random."""
    env = InspectionEnv([f"world={world}"], WORLDS[world])
    theirs = episodes(table(f"afrl/{world}"))
    assert max(agreed(env, episode) for episode in theirs) < CLOSE_M
    assert len(theirs) == 40
    assert {episode.status for episode in theirs} == ENDS


def test_the_same_actions_turn_the_deputy_as_theirs() -> None:
    """Random torques meet the limit of the rate, where their integrator makes much of rounding.

    As many random episodes are flown as it takes for twenty that theirs repeats when last bits change.
    """
    theirs = "chief.initial_angular_velocity_rad_s=[0,0,0]", "inspection_threshold_percent=45"
    env = SixDofInspectionEnv(["world=afrl_six_dof", *theirs])
    columns = table("afrl/afrl_six_dof")
    flown_by_them, own_change = episodes(columns), columns["own_change"]
    scripted, drawn, is_repeated = flown_by_them[:20], flown_by_them[20:], own_change < REPEATED_M
    assert {episode.status for episode in scripted} == ENDS
    assert is_repeated.sum() == 20
    assert is_repeated[-1]
    assert max(agreed(env, episode) for episode in [*scripted, *compress(drawn, is_repeated)]) < CLOSE_M
    off = [moved(env, episode) for episode in compress(drawn, ~is_repeated)]
    assert len(off) == 15
    assert max(off) < own_change.max()


def test_a_camera_of_60_degrees_sees_what_theirs_would() -> None:
    """Their law, from where the deputy is and how it is turned; the torques stay within 1 mN m."""
    task = task_of(["world=afrl_six_dof", "seed=3"])
    mission, experiment = task.mission, task.experiment
    start = evaluation_scenarios(experiment, [0])[0]
    log, points = fly_logged(mission, coast(), start), inspection_points(mission)
    seen, closest = np.zeros(100, dtype=bool), []
    for k, (position, quaternion) in enumerate(zip(log.position_m, log.quaternion_b_from_h, strict=True)):
        axis, distance = Rotation.from_quat(quaternion).apply([-1.0, 0.0, 0.0]), np.linalg.norm(position)
        closest.append(np.degrees(np.arccos(-axis @ position / distance)))
        gone = points - position
        is_in_field = gone @ axis >= np.cos(np.radians(30.0)) * np.linalg.norm(gone, axis=1)
        sun = start.sun_angle_rad - mission.orbit.mean_motion_rad_s * 10.0 * k
        beam = np.array([np.cos(sun), np.sin(sun), 0.0])
        # a ray from 1e-5 m above the sphere of 10 m passes it
        is_lit = points @ beam / 10.0 > -np.sqrt(1.0 - (10.0 / (10.0 + 1e-5)) ** 2)
        seen |= is_in_field & is_lit & (points @ position >= 100.0)
        assert log.is_inspected[k].tolist() == seen.tolist()
    assert closest[0] > 30.0
    assert max(closest[30:]) < 5.0
    assert 20 < seen.sum() < 100
    assert np.abs(log.torque_b_n_m).max() == pytest.approx(0.001)
