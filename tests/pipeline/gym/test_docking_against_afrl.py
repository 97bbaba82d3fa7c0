"""AFRL's docking, step for step: the same actions, and what their own code makes of them.

`docking/make_table.py` made the table, of safe-autonomy-sims (https://github.com/act3-ace/safe-autonomy-sims).
"""

import numpy as np
import pytest

from pipeline.flight.control.controller import open_loop
from pipeline.flight.goals.flights import fly_all
from pipeline.flight.state.log import Scenario
from pipeline.gym import ReachEnv
from tests.places import PROJECT

#: theirs integrates with a tolerance of 1e-3
CLOSE_M = 1e-4


@pytest.fixture(scope="module")
def episodes():
    with np.load(PROJECT / "tests" / "pipeline" / "gym" / "docking" / "docking.npz") as table:
        columns = dict(table)
    starts = [Scenario(start[:3], start[3:], 0.0) for start in columns["start"]]
    steps, kept = (np.cumsum(n)[:-1] for n in (columns["length"], -(-columns["length"] // 10) + 1))
    actions, rewards = (np.split(columns[name], steps) for name in ("actions", "rewards"))
    places = np.split(columns["places"], kept)
    statuses = map(str, columns["status"])
    return list(zip(starts, [one / 1024.0 for one in actions], rewards, places, statuses, strict=True))


def told(info: dict[str, float], is_terminated: bool, steps: int) -> str:
    """Return their word for how an episode ended."""
    if is_terminated:
        return "Success" if info["is_success"] else "Crash"
    return "Timeout" if steps == 2001 else "Max Velocity Violation"


@pytest.mark.slow
def test_episodes_pass_as_in_afrls_environment(episodes):
    env, statuses = ReachEnv(["problem=docking"]), set()
    for scenario, actions, rewards, places, status in episodes:
        env.reset(options={"scenario": scenario})
        flown, paid = [scenario.position_m], []
        for step, action in enumerate(actions, 1):
            seen, reward, is_terminated, is_truncated, info = env.step(action)
            paid.append(reward)
            if step % 10 == 0 or step == len(actions):
                flown.append(seen[:3])
            assert (is_terminated or is_truncated) == (step == len(actions))
        assert told(info, is_terminated, len(actions)) == status
        np.testing.assert_allclose(flown, places, rtol=0.0, atol=CLOSE_M)
        np.testing.assert_allclose(paid, rewards, rtol=0.0, atol=1e-6)
        statuses.add(status)
    assert statuses == {"Success", "Crash", "Timeout", "Max Velocity Violation"}


def test_flights_end_as_in_afrls_environment(episodes):
    mission = ReachEnv(["problem=docking"]).task.mission
    for scenario, actions, _, _, status in episodes:
        found = fly_all(mission, open_loop("theirs", actions), [scenario])
        assert found.end_s[0] == (len(actions) if status != "Timeout" else 2001)
        assert bool(found.is_success(100.0)[0] and not found.is_violated[0]) == (status == "Success")


def test_flights_without_a_goal_are_refused():
    with pytest.raises(ValueError, match="no flight with a goal"):
        ReachEnv(["safety=filter"])
