"""Train a policy by PPO, in an environment with Stable-Baselines3: ``python -m benchmarks.ppo FOLDER``.

Proximal policy optimization (Schulman et al., arXiv 1707.06347) of Stable-Baselines3 on the flights of
`pipeline.gym`, on one thread. The policy is written as ONNX, at the end and at intervals, for
``controller=PATH``; `training.json` beside it describes the training.
"""

import argparse
import json
import sys
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
import torch
from numpy.typing import NDArray
from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.monitor import Monitor
from stable_baselines3.common.vec_env import DummyVecEnv, VecEnv, VecNormalize

from benchmarks.networks import CLIP, TANH, write_policy
from pipeline.gym import (
    InspectionVectorEnv,
    NormalizedObservation,
    NormalizedVectorObservation,
    ReachEnv,
    Reward,
    Task,
    task_of,
)

#: what AFRL's two problems are trained with alike
_OF_BOTH: Final[Mapping[str, Any]] = {
    "n_epochs": 30,
    "gae_lambda": 0.928544,
    "learning_rate": 5e-5,
    "clip_range": 0.3,
    "vf_coef": 1.0,
    "layers": (256, 256),
    "log_std": 0.0,
}
#: AFRL's settings (safe-autonomy-sims 6d71f7e, `configs/translational-inspection` and `configs/docking`:
#: base files with what `task.yml` overrides, for 5 and 10 million steps) with RLlib's defaults for the rest;
#: and settings that learn more from few steps. `num_envs`, `layers` and `log_std` (of the initial noise, a
#: share of the largest force) are not `PPO`'s own.
SETTINGS: Final[Mapping[str, Mapping[str, Any]]] = {
    "afrl": {**_OF_BOTH, "num_envs": 1, "n_steps": 1500, "batch_size": 1500, "gamma": 0.99},
    "afrl_docking": {**_OF_BOTH, "num_envs": 18, "n_steps": 2000, "batch_size": 3600, "gamma": 0.968559},
    "ours": {
        "num_envs": 64,
        "n_steps": 128,
        "batch_size": 1024,
        "n_epochs": 10,
        "gamma": 0.995,
        "gae_lambda": 0.95,
        "learning_rate": 3e-4,
        "clip_range": 0.2,
        "vf_coef": 0.5,
        "layers": (64, 64),
        "log_std": -1.5,
    },
}
#: initial price of a m/s; it approaches a different final price geometrically between these shares of
#: the steps, so that something is inspected before fuel is saved
FIRST_PRICE: Final = 0.1
DEARER_FROM, DEARER_TO = 0.3, 0.9
#: offset between the seeds of the starts of two trainings
SEEDS_APART: Final = 100_000


class Flights(VecEnv):
    """Our flights as Stable-Baselines3 steps them.

    The step that restarts an episode counts as a step without reward: one in some hundreds. A time limit
    ends an episode, as the remaining time is observed.

    Parameters
    ----------
    many : InspectionVectorEnv
        Its reward must have no price of fuel.
    seed : int
    """

    def __init__(self, many: InspectionVectorEnv, seed: int) -> None:
        self.task, self._seed, self.price = many.task, seed, FIRST_PRICE
        self._many = NormalizedVectorObservation(many)
        self._ended = np.zeros(many.num_envs, dtype=np.bool_)
        self._spent, self._returns = np.zeros((2, many.num_envs))
        #: for the finished episodes: return, rate, delta-v, whether it succeeded, whether it ended outside
        self.ends: list[tuple[float, ...]] = []
        super().__init__(many.num_envs, self._many.single_observation_space, many.single_action_space)

    def reset(self) -> NDArray[np.float32]:
        """Start all episodes."""
        return self._many.reset(seed=self._seed * SEEDS_APART)[0]

    def step_async(self, actions: NDArray[Any]) -> None:
        """Store the actions."""
        self._actions = actions

    def step_wait(self) -> tuple[Any, ...]:
        """Execute them."""
        seen, rewards, terminated, truncated, info = self._many.step(self._actions)
        began, self._ended = self._ended, terminated | truncated
        spent, self._spent = info["delta_v_m_s"] - self._spent, info["delta_v_m_s"]
        rewards = rewards - self.price * np.where(began, 0.0, spent)
        self._returns += rewards
        infos: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        for flight in np.flatnonzero(self._ended | began):
            infos[flight]["terminal_observation"] = seen[flight]
        rates = info["num_inspected"] / info["num_inspectable"]
        facts = self._returns, rates, self._spent, info["is_success"], info["outside_m"] > 0.0
        self.ends += [tuple(float(fact[flight]) for fact in facts) for flight in np.flatnonzero(self._ended)]
        self._returns[self._ended] = 0.0
        return seen, rewards.astype(np.float32), self._ended | began, infos

    def close(self) -> None:
        """Do nothing: nothing is open."""

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        """Return nothing: there are no inner environments."""
        return [None] * self.num_envs

    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:
        """Do nothing."""

    def env_method(self, method_name: str, *args: Any, indices: Any = None, **kwargs: Any) -> list[Any]:
        """Return nothing."""
        return []

    def env_is_wrapped(self, wrapper_class: Any, indices: Any = None) -> list[bool]:
        """Return that nothing is wrapped."""
        return [False] * self.num_envs


class Goals(DummyVecEnv):
    """Flights towards a goal, one after the other, with AFRL's rewards and its price of fuel."""

    def __init__(self, num_envs: int, words: Sequence[str], seed: int) -> None:
        super().__init__([lambda: Monitor(NormalizedObservation(ReachEnv(words)))] * num_envs)
        self.seed(seed * SEEDS_APART)
        self.task: Task = task_of(words)
        self.price = 0.0
        #: as of `Flights`; the rate is the success
        self.ends: list[tuple[float, ...]] = []

    def step_wait(self) -> tuple[Any, ...]:
        """Step them."""
        stepped = super().step_wait()
        for facts in stepped[3]:
            if "episode" in facts:
                success, spent = facts["is_success"], facts["delta_v_m_s"]
                self.ends.append((facts["episode"]["r"], success, spent, success, facts["outside_m"] > 0.0))
        return stepped


def layers_of(model: PPO, flights: Flights | Goals, normal: VecNormalize) -> list[tuple[Any, Any]]:
    """Return a policy's weights and biases, from observations in their units to shares of the force.

    The scaling of the observations, and that of the training, is merged into the first layer.
    """
    linear = [part for part in model.policy.mlp_extractor.policy_net if isinstance(part, torch.nn.Linear)]
    linear.append(model.policy.action_net)
    layers = [
        (part.weight.detach().numpy().astype(np.float64), part.bias.detach().numpy().astype(np.float64))
        for part in linear
    ]
    weights, added = layers[0]
    weights = weights / np.sqrt(normal.obs_rms.var + normal.epsilon)
    layers[0] = weights / flights.task.scales, added - weights @ normal.obs_rms.mean
    return layers


def write(model: PPO, flights: Flights | Goals, normal: VecNormalize, path: Path) -> None:
    """Write the noise-free policy as ONNX, from observations to a force in N, Hill axes.

    The description of the training, `training.json`, is included in the file.
    """
    layers = layers_of(model, flights, normal)
    kinds = [*[TANH] * (len(layers) - 1), CLIP]
    training = json.loads((path.parent / "training.json").read_text(encoding="utf-8"))
    training = json.dumps({**training, "done": model.num_timesteps})
    write_policy(layers, kinds, flights.task.mission.deputy.max_force_n, path, {"training": training})


class TrainingProgress(BaseCallback):
    """Gradually raises the price of fuel, and regularly prints a line and writes the policy."""

    def __init__(
        self, flights: Flights | Goals, normal: VecNormalize, folder: Path, options: argparse.Namespace
    ) -> None:
        super().__init__()
        self._flights, self._normal, self._folder, self._options = flights, normal, folder, options
        self._due, self._started = options.every, time.monotonic()

    def _on_step(self) -> bool:
        return True

    def _on_rollout_start(self) -> None:
        done = self.num_timesteps / self._options.steps
        share = np.clip((done - DEARER_FROM) / (DEARER_TO - DEARER_FROM), 0.0, 1.0)
        self._flights.price = FIRST_PRICE * (self._options.price / FIRST_PRICE) ** share

    def _on_rollout_end(self) -> None:
        if self.num_timesteps < self._due:
            return
        self._due += self._options.every
        ends = np.array(self._flights.ends).reshape(-1, 5)
        self._flights.ends.clear()
        line = "none ended"
        if len(ends):
            line = "return {:.2f}, rate {:.3f}, {:.2f} m/s, success {:.2f}, outside {:.2f}".format(
                *ends.mean(axis=0)
            )
        seconds = time.monotonic() - self._started
        print(
            f"{self.num_timesteps:,} steps, {seconds:.0f} s, {len(ends)} episodes with noise: {line}",
            flush=True,
        )
        write(self.model, self._flights, self._normal, self._folder / f"{self.num_timesteps}.onnx")


def main(arguments: Sequence[str]) -> int:
    """Train one policy."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.ppo", description=__doc__)
    parser.add_argument("folder", type=Path, help="where the policy is written")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--steps", type=int, default=1_000_000)
    parser.add_argument("--every", type=int, default=100_000, help="steps between two that are written")
    parser.add_argument("--settings", choices=list(SETTINGS), default="ours")
    parser.add_argument("--price", type=float, default=1.0, help="of a m/s in the end; a point is worth 0.1")
    parser.add_argument("--outside", type=float, default=10.0, help="taken away outside the limits")
    parser.add_argument("words", nargs="*", help="of the world, such as world=afrl deputy.max_force_n=0.02")
    options = parser.parse_args(arguments)
    torch.set_num_threads(1)
    chosen = dict(SETTINGS[options.settings])
    options.folder.mkdir(parents=True, exist_ok=True)
    settings = {name: value for name, value in vars(options).items() if name != "folder"}
    text = json.dumps({**settings, "settings": {"name": options.settings, **chosen}}, indent=1)
    (options.folder / "training.json").write_text(text + "\n", encoding="utf-8")
    num_envs, layers, log_std = (chosen.pop(name) for name in ("num_envs", "layers", "log_std"))
    flights: Flights | Goals
    if task_of(options.words).mission.problem.kind == "reach":
        flights = Goals(num_envs, options.words, options.seed)
    else:
        reward = Reward(per_delta_v=0.0, outside=options.outside)
        flights = Flights(InspectionVectorEnv(num_envs, options.words, reward), options.seed)
    normal = VecNormalize(flights, norm_reward=False, clip_obs=np.inf)
    shape = {"net_arch": list(layers), "activation_fn": torch.nn.Tanh, "log_std_init": log_std}
    model = PPO("MlpPolicy", normal, seed=options.seed, device="cpu", policy_kwargs=shape, **chosen)
    model.learn(options.steps, callback=TrainingProgress(flights, normal, options.folder, options))
    write(model, flights, normal, options.folder / "policy.onnx")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
