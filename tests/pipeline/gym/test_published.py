"""Observations number for number as AFRL's environments give them.

`afrl/make_observations.py` made the table, of safe-autonomy-sims (https://github.com/act3-ace/safe-autonomy-sims).
"""

from typing import Any

import numpy as np
import pytest

from pipeline.flight.state.log import Scenario
from pipeline.gym import AFRL, AFRL_WEIGHTED, InspectionEnv, ReachEnv, SixDofInspectionEnv
from pipeline.gym.published import PublishedObservation
from tests.pipeline.gym.test_against_afrl import GREATEST, table

ENVS: dict[str, Any] = {
    "afrl": lambda: InspectionEnv(["world=afrl"], AFRL),
    "afrl_weighted": lambda: InspectionEnv(["world=afrl_weighted"], AFRL_WEIGHTED),
    "afrl_six_dof": lambda: SixDofInspectionEnv(
        ["world=afrl_six_dof", "chief.initial_angular_velocity_rad_s=[0,0,0]"]
    ),
}


@pytest.mark.parametrize("world", ENVS)
@pytest.mark.parametrize("episode", range(4))
def test_observations_are_theirs(world: str, episode: int) -> None:
    """Theirs integrates with a tolerance of 1e-3; a single precision holds five digits of positions."""
    columns = table("afrl/observations")
    names = ("start", "sun", "priority", "actions", "observations")
    start, sun, priority, actions, expected = (columns[f"{world}_{episode}_{name}"] for name in names)
    env = PublishedObservation(ENVS[world](), np.random.RandomState(episode))
    scenario = Scenario(start[:3], start[3:], -float(sun))
    seen = [env.reset(options={"scenario": scenario, "priority": priority})[0]]
    for action in actions / GREATEST[: actions.shape[1]]:
        seen.append(env.step(action)[0])
        assert env.observation_space.contains(seen[-1])
    np.testing.assert_allclose(seen, expected, rtol=1e-6, atol=2e-4)
    assert len(np.unique(expected[:, -3:].round(3), axis=0)) > 3


def test_what_inspects_nothing_is_refused() -> None:
    with pytest.raises(ValueError, match="ReachEnv is none that inspects"):
        PublishedObservation(ReachEnv(["problem=docking"]))
