"""AFRL's docking, step for step: the same actions, and what their own code makes of them.

`afrl/make_tables.py` made the table, of safe-autonomy-sims (https://github.com/act3-ace/safe-autonomy-sims).
"""

import numpy as np
import pytest

from pipeline.flight.control.controller import open_loop
from pipeline.flight.goals.flights import fly_all
from pipeline.flight.state.log import Scenario
from pipeline.gym import ReachEnv
from tests.pipeline.gym.test_against_afrl import episodes, table

#: theirs integrates with a tolerance of 1e-3
CLOSE_M = 1e-4


@pytest.fixture(scope="module")
def flown():
    columns = table("docking/docking")
    return episodes(columns | {"actions": columns["actions"] / 1024.0})


def status_of(info: dict[str, float], is_terminated: bool, steps: int) -> str:
    """Return their word for how an episode ended."""
    if is_terminated:
        return "Success" if info["is_success"] else "Crash"
    return "Timeout" if steps == 2001 else "Max Velocity Violation"


def test_an_episode_of_one_control_period_ends():
    env = ReachEnv(["problem=docking", "duration_s=10", "control_period_s=10"])
    env.reset(seed=1)
    _, reward, is_terminated, is_truncated, _ = env.step(np.zeros(3))
    assert np.isfinite(reward)
    assert is_terminated or is_truncated


@pytest.mark.slow
def test_episodes_pass_as_in_afrls_environment(flown):
    env = ReachEnv(["problem=docking"])
    for episode in flown:
        scenario = Scenario(episode.start[:3], episode.start[3:], 0.0)
        env.reset(options={"scenario": scenario})
        positions, paid = [scenario.position_m], []
        for step, action in enumerate(episode.actions, 1):
            seen, reward, is_terminated, is_truncated, info = env.step(action)
            paid.append(reward)
            if step % 10 == 0 or step == len(episode.actions):
                positions.append(seen[:3])
            assert (is_terminated or is_truncated) == (step == len(episode.actions))
        assert status_of(info, is_terminated, len(episode.actions)) == episode.status
        np.testing.assert_allclose(positions, episode.positions, rtol=0.0, atol=CLOSE_M)
        np.testing.assert_allclose(paid, episode.rewards, rtol=0.0, atol=1e-6)
    assert {episode.status for episode in flown} == {"Success", "Crash", "Timeout", "Max Velocity Violation"}


def test_flights_end_as_in_afrls_environment(flown):
    mission = ReachEnv(["problem=docking"]).task.mission
    for episode in flown:
        start = Scenario(episode.start[:3], episode.start[3:], 0.0)
        outcomes = fly_all(mission, open_loop("theirs", episode.actions), [start])
        assert outcomes.end_s[0] == (len(episode.actions) if episode.status != "Timeout" else 2001)
        assert bool(outcomes.is_success(100.0)[0] and not outcomes.is_violated[0]) == (
            episode.status == "Success"
        )


def test_flights_without_a_goal_are_refused():
    with pytest.raises(ValueError, match="no flight with a goal"):
        ReachEnv(["safety=filter"])
