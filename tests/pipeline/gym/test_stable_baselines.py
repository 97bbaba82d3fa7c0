"""What Stable-Baselines3 is given: each step of single environments, and none of those that only start one.

It brings torch, of 200 MB and more; where it is not installed, its own classes are left out, by name.
"""

from dataclasses import replace

import numpy as np
import pytest

from pipeline.controllers.learned import answer
from pipeline.controllers.policies import read_policy
from pipeline.gym import InspectionEnv, NormalizedObservation
from pipeline.gym.stable_baselines import BaselinesVecEnv, SameStepFlights

#: ten steps, in which some leave the limits
SHORT = ["duration_s=100", "deputy.max_force_n=2"]
STEPS, FLIGHTS, SEED = 35, 4, 21


def actions(step):
    return np.random.default_rng(step).uniform(-1.0, 1.0, (FLIGHTS, 3)).astype(np.float32)


def by_hand(is_normalized):
    """Each step of each flight, flown alone: observation, reward, end, facts; and what follows an end."""
    steps = []
    for flight in range(FLIGHTS):
        env = InspectionEnv(SHORT)
        scales = env.task.scales.astype(np.float32) if is_normalized else np.float32(1.0)
        seen, _ = env.reset(seed=SEED + flight)
        rows = [seen / scales]
        for step in range(STEPS):
            seen, reward, terminated, truncated, facts = env.step(actions(step)[flight])
            facts["TimeLimit.truncated"] = truncated
            first = None
            if terminated or truncated:
                facts["terminal_observation"] = seen / scales
                seen, first = env.reset()
            rows.append((seen / scales, np.float32(reward), terminated or truncated, facts, first))
        steps.append(rows)
    return steps


def assert_same(facts, expected):
    assert facts.keys() == expected.keys()
    for name, value in expected.items():
        np.testing.assert_array_equal(facts[name], value, err_msg=name)


@pytest.mark.slow
@pytest.mark.parametrize("is_normalized", [True, False])
def test_steps_are_those_of_single_environments_that_start_anew_by_hand(is_normalized):
    flights, expected = (
        SameStepFlights(FLIGHTS, overrides=SHORT, is_normalized=is_normalized),
        by_hand(is_normalized),
    )
    seen, _ = flights.reset(range(SEED, SEED + FLIGHTS))
    np.testing.assert_array_equal(seen, [rows[0] for rows in expected])
    ends = {"cut": 0, "terminated": 0}
    for step in range(STEPS):
        stepped = flights.step(actions(step))
        for flight, rows in enumerate(expected):
            seen, reward, has_ended, facts, first = rows[step + 1]
            np.testing.assert_array_equal(stepped.seen[flight], seen)
            assert stepped.rewards[flight] == reward
            assert stepped.has_ended[flight] == has_ended == (flight in stepped.started)
            assert_same(stepped.infos[flight], facts)
            if has_ended:
                assert_same(stepped.started[flight], first)
                ends["cut" if facts["TimeLimit.truncated"] else "terminated"] += 1
    assert min(ends.values()) > 2, ends
    assert flights.space.contains(stepped.seen[0])


def test_without_it_the_cure_is_told(monkeypatch):
    monkeypatch.setattr("pipeline.gym.stable_baselines.VecEnv", object)
    with pytest.raises(ModuleNotFoundError, match="install it: python -m pip install stable-baselines3"):
        BaselinesVecEnv(2)


@pytest.fixture(scope="module")
def baselines():
    return pytest.importorskip("stable_baselines3", reason="Stable-Baselines3 brings torch, of 200 MB")


@pytest.mark.slow
def test_its_own_environment_of_single_ones_gives_the_same(baselines):
    from stable_baselines3.common.vec_env import DummyVecEnv  # noqa: PLC0415

    theirs = DummyVecEnv([lambda: NormalizedObservation(InspectionEnv(SHORT))] * FLIGHTS)
    ours = BaselinesVecEnv(FLIGHTS, SHORT)
    assert ours.observation_space == theirs.observation_space
    assert ours.action_space == theirs.action_space
    for each in (ours, theirs):
        each.seed(SEED)
    np.testing.assert_array_equal(ours.reset(), theirs.reset())
    for step in range(STEPS):
        (*parts, infos), (*parts_there, infos_there) = ours.step(actions(step)), theirs.step(actions(step))
        for part, part_there in zip(parts, parts_there, strict=True):
            np.testing.assert_array_equal(part, part_there)
            assert part.dtype == part_there.dtype
        for facts, facts_there in zip(infos, infos_there, strict=True):
            assert_same(facts, facts_there)
        for facts, facts_there in zip(ours.reset_infos, theirs.reset_infos, strict=True):
            assert_same(facts, facts_there)


@pytest.mark.slow
@pytest.mark.parametrize("levels_n", [None, 0.1])
def test_models_train_on_it(baselines, levels_n):
    from stable_baselines3.common.evaluation import evaluate_policy  # noqa: PLC0415
    from stable_baselines3.common.vec_env import VecMonitor  # noqa: PLC0415

    many = VecMonitor(
        BaselinesVecEnv(FLIGHTS, ["duration_s=100", "deputy.max_force_n=0.1"], levels_n=levels_n)
    )
    model = baselines.PPO("MlpPolicy", many, n_steps=16, batch_size=32, n_epochs=1, seed=1, device="cpu")
    model.learn(128)
    assert {episode["l"] for episode in model.ep_info_buffer} == {10}
    mean, _ = evaluate_policy(model, many, n_eval_episodes=FLIGHTS)
    assert np.isfinite(mean)
    if levels_n is None:
        model = baselines.SAC("MlpPolicy", many, learning_starts=10, train_freq=4, seed=1, device="cpu")
        model.learn(64)
        assert model.replay_buffer.timeouts.sum() == model.replay_buffer.dones.sum() == FLIGHTS


@pytest.mark.slow
def test_what_flights_do_not_have_is_refused(baselines):
    many = BaselinesVecEnv(2, ["duration_s=100"], render_mode="rgb_array")
    many.seed(1)
    many.reset()
    assert many.render().ndim == 3
    assert many.get_attr("num_envs") == [2, 2]
    assert many.env_is_wrapped(NormalizedObservation, 0) == [False]
    for refused in (lambda: many.set_attr("price", 1.0), lambda: many.env_method("record", "a.mcap")):
        with pytest.raises(AttributeError, match=r"one call steps all flights; .* take make_vec_env"):
            refused()
    many.set_options({"scenario": None})
    with pytest.raises(ValueError, match="reset knows no option 'scenario'; it takes none"):
        many.reset()


@pytest.mark.slow
@pytest.mark.parametrize("silent", [0.0, 0.02])
def test_a_policy_that_the_benchmark_writes_fires_what_its_model_does(baselines, silent, tmp_path):
    from stable_baselines3.common.vec_env import VecNormalize  # noqa: PLC0415

    from benchmarks import ppo  # noqa: PLC0415 - as it imports torch

    options = {"n_steps": 16, "batch_size": 32}
    settings = ppo.Settings(FLIGHTS, options, decision_period_s=20.0, silent=silent)
    many = BaselinesVecEnv(FLIGHTS, SHORT, decision_period_s=20.0)
    flights = ppo.PricedFlights(many, settings)
    normal = VecNormalize(flights, norm_reward=False, clip_obs=np.inf)
    shape = {"net_arch": [8], "activation_fn": baselines.common.torch_layers.nn.Tanh}
    model = baselines.PPO("MlpPolicy", normal, seed=2, device="cpu", policy_kwargs=shape, **options)
    model.learn(64)
    model.policy.action_net.bias.data[0] = 3.0  # beyond the greatest force
    path = ppo.write(model, flights, normal, ppo.Training(tmp_path, settings), "policy")
    pilot = read_policy(path).pilot
    assert '"processor_s"' in path.with_suffix(".json").read_text(encoding="utf-8")
    assert pilot.units.decision_period_s == 20.0
    seen = many.reset()
    physical = (seen * flights.task.scales).astype(np.float64)
    forces = np.empty((FLIGHTS, 3))
    answer(pilot.network, physical, np.zeros((2, 19)), forces)
    shares = np.clip(model.predict(normal.normalize_obs(seen), deterministic=True)[0], -1.0, 1.0)
    expected = np.sign(shares) * np.maximum(np.abs(shares) - silent, 0.0)
    np.testing.assert_allclose(forces, expected * flights.task.mission.deputy.max_force_n, atol=1e-5)
    assert forces[:, 0] == pytest.approx(2.0 * (1.0 - silent))
    assert '"flights"' in (tmp_path / "training.json").read_text(encoding="utf-8")


@pytest.mark.slow
def test_a_policy_of_sac_fires_what_its_model_does_and_is_the_same_again(baselines, tmp_path):
    from benchmarks import ppo  # noqa: PLC0415 - as it imports torch

    basis = ppo.SETTINGS["sac"]
    settings = replace(basis, num_envs=FLIGHTS, model={**basis.model, "learning_starts": 16}, words=())
    files = []
    for folder in (tmp_path / "one", tmp_path / "two"):
        training = ppo.Training(folder, settings, seed=2, steps=64, words=tuple(SHORT))
        model, flights, normal = training.learn()
        files.append(ppo.write(model, flights, normal, training, "policy"))
    assert files[0].read_bytes() == files[1].read_bytes()
    seen = flights.venv.reset()
    pilot, forces = read_policy(files[0]).pilot, np.empty((FLIGHTS, 3))
    answer(pilot.network, (seen * flights.task.scales).astype(np.float64), np.zeros((2, 64)), forces)
    shares = model.predict(normal.normalize_obs(seen), deterministic=True)[0]
    expected = np.sign(shares) * np.maximum(np.abs(shares) - settings.silent, 0.0)
    np.testing.assert_allclose(forces, expected * flights.task.mission.deputy.max_force_n, atol=1e-5)
