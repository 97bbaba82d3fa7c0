"""Train a policy by PPO or SAC, with Stable-Baselines3 installed: ``python -m benchmarks.ppo FOLDER``.

Proximal policy optimization (Schulman et al., arXiv 1707.06347), or with ``--settings sac`` the soft
actor-critic (Haarnoja et al., arXiv 1812.05905), of Stable-Baselines3 on the flights of `pipeline.gym`, on
one thread. The policy is written as ONNX, at the end and at intervals, for
``controller=PATH``; `training.json` beside it describes the training.
"""

import argparse
import json
import sys
import time
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any, Final

import numpy as np
import torch
from numpy.typing import NDArray
from stable_baselines3 import PPO, SAC
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.monitor import Monitor
from stable_baselines3.common.vec_env import DummyVecEnv, VecEnvWrapper, VecNormalize

from benchmarks.acting import MINUTE, OUTSIDE, SEEDS_APART, Acting
from benchmarks.networks import CLIP, TANH, Layer, note_time, silenced, write_policy
from pipeline.gym import NormalizedObservation, ReachEnv, Reward, Task, task_of
from pipeline.gym.stable_baselines import BaselinesVecEnv


@dataclass(frozen=True)
class Settings(Acting):
    """How a policy is trained.

    Parameters
    ----------
    model : mapping
        Of the algorithm.
    algorithm : str
        ``PPO`` or ``SAC``.
    layers : tuple of int
        Widths of those that are hidden.
    log_std : float
        Of the initial noise, a share of the greatest force; of PPO.
    last_rate : float
        Share of the learning rate that is left in the end, to which it falls linearly.
    estimated : float
        Share of the steps in which the means and spreads of observations are estimated.
    """

    num_envs: int
    model: Mapping[str, Any]
    algorithm: str = "PPO"
    layers: tuple[int, ...] = (64, 64)
    log_std: float = -1.5
    last_rate: float = 1.0
    estimated: float = 1.0

    @property
    def steps_of_round(self) -> int:
        """Steps that are taken at least, and between two updates."""
        if self.algorithm == "SAC":
            return int(self.num_envs * self.model["train_freq"])
        return int(self.num_envs * self.model["n_steps"])


#: what AFRL's two problems are trained with alike
_OF_BOTH: Final[Mapping[str, Any]] = {
    "n_epochs": 30,
    "gae_lambda": 0.928544,
    "learning_rate": 5e-5,
    "clip_range": 0.3,
    "vf_coef": 1.0,
}
_WIDE: Final[Mapping[str, Any]] = {"layers": (256, 256), "log_std": 0.0}
#: AFRL's settings (safe-autonomy-sims 6d71f7e, `configs/translational-inspection` and `configs/docking`:
#: base files with what `task.yml` overrides, for 5 and 10 million steps) with RLlib's defaults for the rest;
SETTINGS: Final[Mapping[str, Settings]] = {
    "afrl": Settings(1, {**_OF_BOTH, "n_steps": 1500, "batch_size": 1500, "gamma": 0.99}, **_WIDE),
    "afrl_docking": Settings(
        18, {**_OF_BOTH, "n_steps": 2000, "batch_size": 3600, "gamma": 0.968559}, **_WIDE
    ),
    "ours": Settings(
        64,
        {
            "n_steps": 128,
            "batch_size": 1024,
            "n_epochs": 10,
            "gamma": 0.995,
            "gae_lambda": 0.95,
            "learning_rate": 3e-4,
        },
    ),
    "minute": Settings(
        512,
        {
            "n_steps": 32,
            "batch_size": 2048,
            "n_epochs": 6,
            "gamma": 0.995,
            "gae_lambda": 0.95,
            "learning_rate": 5e-4,
        },
        log_std=-2.0,
        last_rate=0.1,
        estimated=0.3,
        **MINUTE,
    ),
    "sac": Settings(
        64,
        {
            "train_freq": 1,
            "gradient_steps": 4,
            "batch_size": 256,
            "buffer_size": 200_000,
            "learning_starts": 12_800,
            "gamma": 0.98,
            "tau": 0.005,
            "learning_rate": 5e-4,
        },
        algorithm="SAC",
        last_rate=0.1,
        estimated=0.3,
        **MINUTE,
    ),
}


ALGORITHMS: Final[Mapping[str, Any]] = {"PPO": PPO, "SAC": SAC}


class PricedFlights(VecEnvWrapper):
    """Flights whose fuel has a price that may change, and which fire nothing where little is asked for.

    A time limit ends an episode, as the remaining time is observed.

    Parameters
    ----------
    flights : BaselinesVecEnv
        Its reward must have no price of fuel.
    settings : Settings
    """

    def __init__(self, flights: BaselinesVecEnv, settings: Settings) -> None:
        super().__init__(flights)
        self.task, self.price = flights.task, settings.first_price
        self._silent = settings.silent
        self._spent, self._returns = np.zeros((2, flights.num_envs))
        #: for the finished episodes: return, rate, delta-v, whether it succeeded, whether it ended outside
        self.ends: list[tuple[float, ...]] = []
        self.num_ended = 0

    def reset(self) -> NDArray[np.float32]:
        """Start all episodes."""
        self._spent[:] = self._returns[:] = 0.0
        return self.venv.reset()

    def step_async(self, actions: NDArray[Any]) -> None:
        """Store what is left of the actions."""
        fired = np.sign(actions) * np.maximum(np.abs(actions) - self._silent, 0.0)
        self.venv.step_async(fired)

    def step_wait(self) -> tuple[Any, ...]:
        """Execute it."""
        seen, rewards, has_ended, infos = self.venv.step_wait()
        spent = np.array([info["delta_v_m_s"] for info in infos])
        rewards = rewards - self.price * (spent - self._spent)
        self._returns += rewards
        for flight in np.flatnonzero(has_ended):
            facts = infos[flight]
            facts["TimeLimit.truncated"] = False
            rate, is_outside = facts["num_inspected"] / facts["num_inspectable"], facts["outside_m"] > 0.0
            each = self._returns[flight], rate, facts["delta_v_m_s"], facts["is_success"], is_outside
            self.ends.append(tuple(map(float, each)))
        self.num_ended += int(has_ended.sum())
        self._spent = np.where(has_ended, 0.0, spent)
        self._returns[has_ended] = 0.0
        return seen, rewards.astype(np.float32), has_ended, infos


class Goals(DummyVecEnv):
    """Flights towards a goal, one after the other, with AFRL's rewards and its price of fuel."""

    def __init__(self, num_envs: int, words: Sequence[str], seed: int) -> None:
        super().__init__([lambda: Monitor(NormalizedObservation(ReachEnv(words)))] * num_envs)
        self.seed(seed * SEEDS_APART)
        self.task: Task = task_of(words)
        self.price = 0.0
        #: as of `PricedFlights`; the rate is the success
        self.ends: list[tuple[float, ...]] = []
        self.num_ended = 0

    def step_wait(self) -> tuple[Any, ...]:
        """Step them."""
        stepped = super().step_wait()
        for facts in stepped[3]:
            if "episode" in facts:
                success, spent = facts["is_success"], facts["delta_v_m_s"]
                self.ends.append((facts["episode"]["r"], success, spent, success, facts["outside_m"] > 0.0))
                self.num_ended += 1
        return stepped


@dataclass(frozen=True)
class Training:
    """One training, and what it is about.

    Parameters
    ----------
    folder : Path
        Where policies are written.
    settings : Settings
    seed, steps : int
    words : tuple of str
        Of the world, after those of the settings.
    outside : float
        Taken away outside the limits.
    every : int, optional
        Steps between two policies that are written; none before the last unless given.
    """

    folder: Path
    settings: Settings
    seed: int = 1
    steps: int = 1_000_000
    words: tuple[str, ...] = ()
    outside: float = OUTSIDE
    every: int | None = None
    #: when it began, s
    begun: float = field(default_factory=time.process_time)

    def run(self) -> Path:
        """Train, and return the file of the policy."""
        return write(*self.learn(), self, "policy")

    def learn(self) -> tuple[PPO | SAC, PricedFlights | Goals, VecNormalize]:
        """Train, and return the model with what it flew, and how its observations are scaled."""
        torch.set_num_threads(1)
        settings, words = self.settings, [*self.settings.words, *self.words]
        self.folder.mkdir(parents=True, exist_ok=True)
        flights: PricedFlights | Goals
        if task_of(words).mission.problem.kind == "reach":
            flights = Goals(settings.num_envs, words, self.seed)
        else:
            reward = Reward(per_delta_v=0.0, outside=self.outside, success=settings.success)
            period = settings.decision_period_s
            many = BaselinesVecEnv(settings.num_envs, words, reward=reward, decision_period_s=period)
            flights = PricedFlights(many, settings)
        normal = VecNormalize(flights, norm_reward=False, clip_obs=np.inf)
        options = dict(settings.model)
        rate, least = options.pop("learning_rate"), settings.last_rate
        shape = {"net_arch": list(settings.layers), "activation_fn": torch.nn.Tanh}
        if settings.algorithm == "PPO":
            shape["log_std_init"] = settings.log_std
        model = ALGORITHMS[settings.algorithm](
            "MlpPolicy",
            normal,
            learning_rate=lambda left: rate * (least + (1.0 - least) * left),
            seed=self.seed,
            device="cpu",
            policy_kwargs=shape,
            **options,
        )
        flights.seed(self.seed * SEEDS_APART)
        model.learn(self.steps, callback=TrainingProgress(flights, normal, self))
        return model, flights, normal


def layers_of(model: PPO | SAC, flights: PricedFlights | Goals, normal: VecNormalize) -> list[Layer]:
    """Return a policy's weights and biases, from observations in their units to shares of the force.

    The scaling of the observations, and that of the training, is merged into the first layer.
    """
    policy: Any = model.policy
    if isinstance(model, SAC):
        parts, last = policy.actor.latent_pi, policy.actor.mu
    else:
        parts, last = policy.mlp_extractor.policy_net, policy.action_net
    linear = [*(part for part in parts if isinstance(part, torch.nn.Linear)), last]
    layers = [
        (part.weight.detach().numpy().astype(np.float64), part.bias.detach().numpy().astype(np.float64))
        for part in linear
    ]
    weights, added = layers[0]
    weights = weights / np.sqrt(normal.obs_rms.var + normal.epsilon)
    layers[0] = weights / flights.task.scales, added - weights @ normal.obs_rms.mean
    return layers


def write(
    model: PPO | SAC, flights: PricedFlights | Goals, normal: VecNormalize, training: Training, name: str
) -> Path:
    """Write the noise-free policy as ONNX, from observations to a force in N, Hill axes.

    The description of the training, `training.json`, is included in the file.
    """
    settings, task = training.settings, flights.task
    layers = layers_of(model, flights, normal)
    # what SAC's network gives is squashed, what PPO's gives is clipped
    kinds = [*[TANH] * (len(layers) - 1), TANH if isinstance(model, SAC) else CLIP]
    layers, kinds = silenced(layers, kinds, settings.silent)
    described = {
        "seed": training.seed,
        "steps": training.steps,
        "words": [*settings.words, *training.words],
        "outside": training.outside,
        "settings": asdict(settings),
        "done": model.num_timesteps * task.num_periods,
        "flights": flights.num_ended,
    }
    text = json.dumps(described, indent=1)
    (training.folder / "training.json").write_text(text + "\n", encoding="utf-8")
    facts = {"training": json.dumps(described)}
    if settings.decision_period_s is not None:
        facts["decision_period_s"] = f"{settings.decision_period_s:g}"
    path = training.folder / f"{name}.onnx"
    write_policy(layers, kinds, task.mission.deputy.max_force_n, path, facts)
    note_time(path, training.begun)
    return path


class TrainingProgress(BaseCallback):
    """Gradually raises the price of fuel, and regularly prints a line and writes the policy."""

    def __init__(self, flights: PricedFlights | Goals, normal: VecNormalize, training: Training) -> None:
        super().__init__()
        self._flights, self._normal, self._training = flights, normal, training
        self._due = training.every or training.steps

    def _on_step(self) -> bool:
        return True

    def _on_rollout_start(self) -> None:
        done = self.num_timesteps / self._training.steps
        self._flights.price = self._training.settings.price(done)
        self._normal.training = done < self._training.settings.estimated

    def _on_rollout_end(self) -> None:
        if self.num_timesteps < self._due:
            return
        self._due += self._training.every or self._training.steps
        ends = np.array(self._flights.ends).reshape(-1, 5)
        self._flights.ends.clear()
        line = "none ended"
        if len(ends):
            line = "return {:.2f}, rate {:.3f}, {:.2f} m/s, success {:.2f}, outside {:.2f}".format(
                *ends.mean(axis=0)
            )
        seconds = time.process_time() - self._training.begun
        print(
            f"{self.num_timesteps:,} steps, {seconds:.0f} s, {len(ends)} episodes with noise: {line}",
            flush=True,
        )
        if self._training.every:
            write(self.model, self._flights, self._normal, self._training, f"{self.num_timesteps}")


def main(arguments: Sequence[str]) -> int:
    """Train one policy."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.ppo", description=__doc__)
    parser.add_argument("folder", type=Path, help="where the policy is written")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--steps", type=int, default=1_000_000)
    parser.add_argument("--every", type=int, default=100_000, help="steps between two that are written")
    parser.add_argument("--settings", choices=list(SETTINGS), default="ours")
    parser.add_argument("--price", type=float, help="of a m/s in the end; a point is worth 0.1")
    parser.add_argument("--outside", type=float, default=OUTSIDE, help="taken away outside the limits")
    parser.add_argument("words", nargs="*", help="of the world, such as world=afrl deputy.max_force_n=0.02")
    options = parser.parse_args(arguments)
    settings = SETTINGS[options.settings]
    if options.price is not None:
        settings = replace(settings, last_price=options.price)
    words = tuple(options.words)
    Training(
        options.folder, settings, options.seed, options.steps, words, options.outside, options.every
    ).run()
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
