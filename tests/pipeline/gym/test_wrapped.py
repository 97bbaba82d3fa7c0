"""The environments as `gymnasium.make` and other libraries use them: wrapped, masked, pickled, recorded."""

import copy
import pickle
import sys
from importlib.util import find_spec
from types import SimpleNamespace

import gymnasium
import numpy as np
import pytest
from gymnasium.error import ResetNeeded
from gymnasium.vector import AutoresetMode, SyncVectorEnv
from gymnasium.wrappers import (
    ClipAction,
    FlattenObservation,
    NormalizeObservation,
    NormalizeReward,
    RecordEpisodeStatistics,
    RecordVideo,
    TimeLimit,
    TransformObservation,
    TransformReward,
)
from gymnasium.wrappers import vector as vector_wrappers
from PIL import Image

from pipeline.gym import (
    InspectionEnv,
    InspectionVectorEnv,
    NormalizedObservation,
    NormalizedVectorObservation,
)
from pipeline.gym.six_dof import SixDofInspectionEnv

ID = "pipeline.gym:Inspection-v0"
SHORT = {"overrides": ["duration_s=100"]}  # ten steps
SIX_DOF = ["world=afrl_six_dof", "duration_s=100"]


def actions(*shape: int) -> np.ndarray:
    return np.random.default_rng(5).uniform(-1.0, 1.0, shape).astype(np.float32)


def fly(env, steps):
    """What an environment gives for the same actions, step by step."""
    return [env.step(action) for action in actions(steps, *env.action_space.shape)]


def assert_equal(steps, other):
    """Observations, rewards and ends are the same to the last bit."""
    for step, again in zip(steps, other, strict=True):
        for part, part_again in zip(step[:4], again[:4], strict=True):
            np.testing.assert_array_equal(part, part_again)


@pytest.mark.slow
def test_observations_are_normalised_through_any_wrapper():
    plain = InspectionEnv(**SHORT)
    expected = plain.reset(seed=4)[0] / plain.task.scales.astype(np.float32)
    made = gymnasium.make(ID, **SHORT)
    for env in (made, RecordEpisodeStatistics(TimeLimit(made, 5))):
        np.testing.assert_array_equal(NormalizedObservation(env).reset(seed=4)[0], expected)
    for kind in ("vector_entry_point", "sync"):
        many = gymnasium.make_vec(ID, num_envs=2, vectorization_mode=kind, **SHORT)
        for envs in (many, vector_wrappers.RecordEpisodeStatistics(many)):
            seen, _ = NormalizedVectorObservation(envs).reset(seed=4)
            np.testing.assert_array_equal(seen[0], expected)
            assert NormalizedVectorObservation(envs).single_observation_space.contains(seen[1])


def test_what_has_no_such_observations_is_not_normalised():
    refusal = "only observations of Inspection-v0 and Reach-v0, as they are, can be divided"
    for env in (SixDofInspectionEnv(SIX_DOF), gymnasium.make("CartPole-v1")):
        with pytest.raises(ValueError, match=refusal):
            NormalizedObservation(env)
    with pytest.raises(ValueError, match=refusal):
        NormalizedVectorObservation(gymnasium.make_vec("CartPole-v1", num_envs=2))


@pytest.mark.slow
def test_a_mask_resets_the_flights_that_it_names_as_gymnasiums_own_environments_do():
    many = gymnasium.make_vec(ID, num_envs=3, **SHORT)
    theirs = gymnasium.make_vec(ID, num_envs=3, vectorization_mode="sync", **SHORT)
    mask = np.array([False, True, False])
    results = []
    for envs in (many, theirs):
        envs.reset(seed=2)
        fly(envs, 3)
        seen, _ = envs.reset(seed=[None, 9, None], options={"reset_mask": mask.copy()})
        results.append([(seen, np.zeros(3), mask, mask), *fly(envs, 12)])
    assert_equal(*results)
    assert results[0][0][0][:, 18].tolist() == [70.0, 100.0, 70.0]  # time left, s
    for wrong in ([True, False, True], np.ones(2, bool), np.ones(3)):
        with pytest.raises(ValueError, match=r"reset_mask must be an array of bool, shape \(3,\)"):
            many.reset(options={"reset_mask": wrong})
    with pytest.raises(ValueError, match="reset_mask selects no flight"):
        many.reset(options={"reset_mask": np.zeros(3, bool)})
    with pytest.raises(ResetNeeded, match="reset all of them first"):
        InspectionVectorEnv(3, **SHORT).reset(options={"reset_mask": mask})


@pytest.mark.slow
def test_options_that_are_unknown_are_refused():
    envs = [InspectionEnv(**SHORT), SixDofInspectionEnv(SIX_DOF), InspectionVectorEnv(2, **SHORT)]
    for env in envs:
        with pytest.raises(ValueError, match="reset knows no option 'nonsense'; it takes "):
            env.reset(options={"nonsense": 1})
        env.reset(options={})
    with pytest.raises(ValueError, match="num_envs is 0; it must be at least 1"):
        gymnasium.make_vec(ID, num_envs=0, **SHORT)
    with pytest.raises(ValueError, match="3 seeds were given for 2 flights"):
        envs[2].reset(seed=[1, 2, 3])


@pytest.mark.slow
@pytest.mark.parametrize("make", [lambda: InspectionEnv(**SHORT), lambda: SixDofInspectionEnv(SIX_DOF)])
def test_a_step_before_the_start_or_after_the_end_is_refused(make):
    env = make()
    with pytest.raises(ResetNeeded, match="call reset first"):
        fly(env, 1)
    env.reset(seed=1)
    assert [truncated for *_, truncated, _ in fly(env, 10)] == [False] * 9 + [True]
    with pytest.raises(ResetNeeded, match="call reset for the next"):
        fly(env, 1)
    env.reset(seed=1)
    fly(env, 1)


@pytest.mark.slow
@pytest.mark.parametrize("copied", [copy.deepcopy, lambda env: pickle.loads(pickle.dumps(env))])  # noqa: S301
@pytest.mark.parametrize(
    "make",
    [
        lambda: InspectionEnv(["world=leo", "duration_s=100"]),
        lambda: SixDofInspectionEnv(SIX_DOF),
        lambda: NormalizedObservation(gymnasium.make(ID, **SHORT)),
        lambda: InspectionVectorEnv(2, **SHORT),
    ],
)
def test_a_copy_goes_on_as_the_original_does(make, copied):
    env = make()
    env.reset(seed=8)
    fly(env, 4)
    other = copied(env)
    assert_equal(fly(env, 6), fly(other, 6))
    np.testing.assert_array_equal(env.reset()[0], other.reset()[0])


@pytest.mark.slow
def test_statistics_of_episodes_are_recorded_with_one_flight_and_with_many():
    single = RecordEpisodeStatistics(gymnasium.make(ID, **SHORT))
    single.reset(seed=6)
    steps = fly(single, 10)
    episode = steps[-1][4]["episode"]
    assert episode["l"] == 10
    assert episode["r"] == pytest.approx(sum(reward for _, reward, *_ in steps))
    many = vector_wrappers.RecordEpisodeStatistics(gymnasium.make_vec(ID, num_envs=2, **SHORT))
    many.reset(seed=6)
    steps = fly(many, 10)
    episode = steps[-1][4]["episode"]
    assert episode["l"].tolist() == [10, 10]
    np.testing.assert_allclose(episode["r"], sum(rewards for _, rewards, *_ in steps))


@pytest.mark.slow
@pytest.mark.parametrize("mode", list(AutoresetMode))
def test_cleanrls_loop_runs(mode):
    """The wrappers and the loop of its continuous actions, with a linear law for a network."""

    def make():
        env = FlattenObservation(gymnasium.make(ID, render_mode="rgb_array", **SHORT))
        env = NormalizeObservation(ClipAction(RecordEpisodeStatistics(env)))
        env = TransformObservation(env, lambda seen: np.clip(seen, -10, 10), env.observation_space)
        return TransformReward(NormalizeReward(env, gamma=0.99), lambda reward: np.clip(reward, -10, 10))

    envs = SyncVectorEnv([make, make], autoreset_mode=mode)
    law = np.random.default_rng(1).normal(0.0, 0.005, (19, 3)).astype(np.float32)
    seen, _ = envs.reset(seed=1)
    lengths = []
    for _ in range(25):
        seen, rewards, terminated, truncated, infos = envs.step(seen @ law)
        assert np.isfinite(seen).all()
        assert np.isfinite(rewards).all()
        has_ended = terminated | truncated
        if has_ended.any():
            ended = infos["final_info"] if mode == AutoresetMode.SAME_STEP else infos
            lengths += ended["episode"]["l"].tolist()
            if mode == AutoresetMode.DISABLED:
                seen, _ = envs.reset(options={"reset_mask": has_ended})
    assert lengths == [10] * 4


@pytest.mark.slow
def test_the_last_step_of_an_episode_starts_the_next_where_asked_as_with_gymnasiums_own():
    mode = AutoresetMode.SAME_STEP
    many = gymnasium.make_vec(ID, num_envs=2, autoreset_mode=mode, **SHORT)
    theirs = SyncVectorEnv([lambda: InspectionEnv(**SHORT)] * 2, autoreset_mode=mode)
    for envs in (many, theirs):
        envs.reset(seed=2)
    for number in range(12):
        (seen, rewards, *ends, infos), (seen_there, rewards_there, *ends_there, infos_there) = (
            envs.step(np.full((2, 3), 0.1, dtype=np.float32)) for envs in (many, theirs)
        )
        np.testing.assert_array_equal(seen, seen_there)
        np.testing.assert_array_equal(rewards, rewards_there)
        np.testing.assert_array_equal(ends, ends_there)
        assert ("final_obs" in infos) == ("final_obs" in infos_there) == (number == 9)
        if number == 9:
            for name in ("final_obs", "_final_obs", "_final_info"):
                np.testing.assert_array_equal(list(infos[name]), list(infos_there[name]))
            for name, values in infos_there["final_info"].items():
                np.testing.assert_array_equal(infos["final_info"][name], values)


@pytest.mark.slow
def test_no_episode_follows_by_itself_where_asked():
    many = gymnasium.make_vec(ID, num_envs=2, autoreset_mode=AutoresetMode.DISABLED, **SHORT)
    many.reset(seed=1)
    ended = [step[2] | step[3] for step in fly(many, 10)]
    assert ended[-1].all()
    assert not any(each.any() for each in ended[:-1])
    with pytest.raises(ResetNeeded, match="call reset for the next"):
        fly(many, 1)
    many.reset(options={"reset_mask": np.ones(2, dtype=np.bool_)})
    ((*_, terminated, truncated, _),) = fly(many, 1)
    assert not (terminated | truncated).any()


def test_stable_baselines3_trains(tmp_path):
    """As its documentation begins; left out where it, and torch with it, is not installed."""
    baselines = pytest.importorskip("stable_baselines3", reason="Stable-Baselines3 brings torch, of 200 MB")
    from stable_baselines3.common.env_util import make_vec_env  # noqa: PLC0415
    from stable_baselines3.common.evaluation import evaluate_policy  # noqa: PLC0415

    many = make_vec_env(ID, n_envs=2, seed=1, env_kwargs=SHORT, wrapper_class=NormalizedObservation)
    model = baselines.PPO("MlpPolicy", many, n_steps=16, batch_size=8, n_epochs=1, seed=1, device="cpu")
    model.learn(64)
    assert model.ep_info_buffer[-1]["l"] == 10
    mean, _ = evaluate_policy(model, many, n_eval_episodes=2)
    assert np.isfinite(mean)


class Clip:
    """What RecordVideo asks of moviepy, which wants an older Pillow, and brings 70 MB of ffmpeg."""

    def __init__(self, frames, fps):
        self.frames, self.duration_ms = frames, 1000 / fps

    def write_videofile(self, path, logger=None):
        first, *others = map(Image.fromarray, self.frames)
        first.save(path, "WEBP", save_all=True, append_images=others, duration=self.duration_ms)


@pytest.mark.slow
def test_a_video_is_recorded(tmp_path, monkeypatch):
    """Of two episodes, as the wrapper counts them; by moviepy where it is installed."""
    if not (has_moviepy := find_spec("moviepy") is not None):
        for name in ("moviepy", "moviepy.video", "moviepy.video.io", "moviepy.video.io.ImageSequenceClip"):
            monkeypatch.setitem(sys.modules, name, SimpleNamespace(ImageSequenceClip=Clip))
    made = gymnasium.make(ID, render_mode="rgb_array", overrides=["duration_s=30"])
    env = RecordVideo(made, str(tmp_path / "videos"), episode_trigger=lambda _: True)
    for seed in (1, 2):
        env.reset(seed=seed)
        fly(env, 3)
    height, width, _ = made.render().shape
    env.close()
    videos = sorted((tmp_path / "videos").iterdir())
    assert [path.stat().st_size > 1000 for path in videos] == [True, True]
    for path in [] if has_moviepy else videos:
        with Image.open(path) as video:
            assert (video.n_frames, video.size) == (4, (width, height))
