"""Every environment that is registered, and every fleet, as those who check environments check them.

A warning of theirs fails a test. Stable-Baselines3 brings torch; where it is not installed, its checks are
left out, by name.
"""

from functools import partial

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from pettingzoo.test import parallel_api_test, parallel_seed_test

import pipeline.gym  # noqa: F401 - registers them
from pipeline.gym import (
    InspectionEnv,
    InspectionVectorEnv,
    NormalizedObservation,
    SixDofInspectionEnv,
    parallel,
)
from pipeline.gym.published import PublishedObservation
from pipeline.gym.suite import FLEETS, TASKS, id_of

pytestmark = pytest.mark.slow

SPECS = {
    name: spec
    for name, spec in gymnasium.registry.items()
    if isinstance(spec.entry_point, str) and spec.entry_point.startswith("pipeline.gym")
}
MANY = [name for name, spec in SPECS.items() if spec.vector_entry_point is not None]
KINDS = [kind for kind in vars(parallel).values() if parallel.DeputiesEnv in getattr(kind, "__bases__", ())]
#: from afar to the end of a flight, with full thrust
NUM_STEPS = 30


def test_each_task_of_one_deputy_is_registered():
    assert {id_of(task) for task in TASKS if task not in FLEETS} < SPECS.keys()
    assert len(KINDS) >= 3


@pytest.mark.parametrize("name", SPECS)
def test_gymnasium_has_no_fault_to_find(name):
    env = gymnasium.make(f"pipeline.gym:{name}").unwrapped
    check_env(env)
    env.reset(seed=1)
    for sign in (1.0, -1.0) * NUM_STEPS:
        seen, _, terminated, truncated, _ = env.step(np.full(env.action_space.shape, sign, dtype=np.float32))
        assert env.observation_space.contains(seen)
        if terminated or truncated:
            env.reset()


@pytest.mark.parametrize("name", SPECS)
def test_stable_baselines3_finds_no_fault(name):
    pytest.importorskip("stable_baselines3", reason="Stable-Baselines3 brings torch, of 200 MB")
    from stable_baselines3.common.env_checker import check_env as check  # noqa: PLC0415

    check(gymnasium.make(f"pipeline.gym:{name}"))


@pytest.mark.parametrize("words", [{"levels_n": 0.1}, {"decision_period_s": 60.0}], ids=str)
def test_each_kind_of_action_is_without_fault(words):
    env = gymnasium.make("pipeline.gym:Inspection-v0", **words)
    check_env(env.unwrapped)
    pytest.importorskip("stable_baselines3", reason="Stable-Baselines3 brings torch, of 200 MB")
    from stable_baselines3.common.env_checker import check_env as check  # noqa: PLC0415

    check(NormalizedObservation(env))


@pytest.mark.parametrize("name", MANY)
def test_many_of_each_fly_what_is_registered(name):
    many = gymnasium.make_vec(f"pipeline.gym:{name}", num_envs=2)
    env = gymnasium.make(f"pipeline.gym:{name}")
    assert isinstance(many.unwrapped, InspectionVectorEnv)
    assert many.unwrapped.task.mission == env.unwrapped.task.mission
    assert many.unwrapped.task.reward == env.unwrapped.task.reward
    np.testing.assert_array_equal(many.reset(seed=3)[0][0], env.reset(seed=3)[0])


@pytest.mark.filterwarnings(
    "ignore:.*is different from the unwrapped version", "ignore:.*does not have a spec"
)
@pytest.mark.parametrize("make", [lambda: InspectionEnv(["world=afrl"]), SixDofInspectionEnv])
def test_what_afrls_agents_observe_is_without_fault(make):
    check_env(PublishedObservation(make()), skip_render_check=True)


PARALLEL = {
    **{
        f"{kind.__name__}, {number}": partial(kind, num_deputies=number)
        for kind in KINDS
        for number in (1, 3)
    },
    **{task: partial(parallel.parallel_env, task) for task in FLEETS},
}


@pytest.mark.parametrize("make", PARALLEL.values(), ids=PARALLEL)
def test_pettingzoos_own_tests_pass(make):
    """They raise; what is observed of a start is in its space, and another seed starts elsewhere."""
    parallel_api_test(env := make(), num_cycles=200)
    parallel_seed_test(make, num_cycles=20)
    seen, again, other = (env.reset(seed=seed)[0] for seed in (1, 1, 2))
    assert set(seen) == set(env.possible_agents)
    for agent, observation in seen.items():
        assert env.observation_space(agent).contains(observation)
        np.testing.assert_array_equal(observation, again[agent])
        assert not np.array_equal(observation, other[agent])
