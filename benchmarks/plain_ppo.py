"""Train a network by plain PPO that decides once a minute: ``python -m benchmarks.plain_ppo``, with PyTorch.

Proximal policy optimization (Schulman et al., arXiv 1707.06347) with generalized advantages, on one thread,
on the flights of `pipeline.gym`: a network of two layers of 64, and the 19 observations. It chooses a force
for the first control period of six and fires nothing in the other five. In the end it flies, without noise,
from starts that no training used.
"""

import argparse
import sys
import time
from collections.abc import Sequence
from typing import Any, Final, NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray
from torch import nn

from pipeline.evaluation.statistics import fraction
from pipeline.gym import InspectionVectorEnv, Reward

Floats = NDArray[np.float32]

#: control periods from one decision to the next
HELD: Final = 6
WORLD: Final = ("deputy.max_force_n=0.3",)
NUM_FLIGHTS, NUM_DECISIONS = 512, 32
PASSES, BATCH = 6, 2048
DISCOUNT, TRACE, CLIPPED = 0.995, 0.95, 0.2
LEARNING_RATE, LAST_RATE_SHARE = 5e-4, 0.1
#: a share of the force that is too small to fire, by which every force is less: so silence is easily learned
SILENT: Final = 0.02
FIRST_LOG_NOISE: Final = -2.0
#: of a m/s of fuel; it rises geometrically between two shares of the training. A point is worth 0.1.
FIRST_PRICE, DEARER_FROM, DEARER_TO = 0.3, 0.15, 0.65
REWARD: Final = Reward(per_delta_v=0.0, outside=10.0, success=2.0)
#: share of the training in which the observations' means and spreads are still estimated
ESTIMATED: Final = 0.3
#: seeds of the starts of two trainings are as far apart
SEEDS_APART: Final = 1_000_000
#: first seed of the starts of the last evaluation
FRESH: Final = 990_000


class Collected(NamedTuple):
    """What one round of flights gives; first axis: decisions."""

    seen: Floats
    actions: Floats
    log_probabilities: Floats
    rewards: Floats
    is_last: NDArray[np.bool_]
    values: Floats


def fired(actions: Floats) -> Floats:
    """Return shares of the greatest force: none where little is asked for."""
    return np.sign(actions) * np.maximum(np.abs(actions) - SILENT, 0.0)


def network(num_outputs: int, gain: float) -> nn.Sequential:
    """Return two layers of 64 with orthogonal weights, and one whose gain is given."""
    layers = [nn.Linear(19, 64), nn.Tanh(), nn.Linear(64, 64), nn.Tanh(), nn.Linear(64, num_outputs)]
    for layer in layers[::2]:
        nn.init.orthogonal_(layer.weight, 2.0**0.5)
        nn.init.zeros_(layer.bias)
    nn.init.orthogonal_(layers[-1].weight, gain)
    return nn.Sequential(*layers)


class Learner:
    """A policy, its critic, and what scales their observations."""

    def __init__(self, scales: NDArray[np.float64]) -> None:
        self.policy, self.critic = network(3, 0.01), network(1, 1.0)
        self.log_noise = nn.Parameter(torch.full((3,), FIRST_LOG_NOISE))
        self._parameters = [*self.policy.parameters(), *self.critic.parameters(), self.log_noise]
        self._optimizer = torch.optim.Adam(self._parameters, LEARNING_RATE, eps=1e-5)
        self._scales, self._count = scales, 1e-4
        self._mean, self._variance = np.zeros(19), np.ones(19)

    def scaled(self, seen: Floats) -> torch.Tensor:
        """Return observations of mean zero and spread one."""
        spread = np.sqrt(self._variance + 1e-8)
        return torch.from_numpy(((seen / self._scales - self._mean) / spread).astype(np.float32))

    def forces(self, seen: Floats) -> Floats:
        """Return what is fired without noise."""
        with torch.no_grad():
            return fired(self.policy(self.scaled(seen)).numpy())

    def distribution(self, scaled: torch.Tensor) -> torch.distributions.Normal:
        """Return that of the actions."""
        return torch.distributions.Normal(self.policy(scaled), self.log_noise.exp())

    def estimate(self, seen: Floats) -> None:
        """Take observations, (n, 19), into the means and variances."""
        new = seen.astype(np.float64) / self._scales
        away, total = new.mean(axis=0) - self._mean, self._count + len(new)
        inner = self._variance * self._count + new.var(axis=0) * len(new)
        self._variance = (inner + away**2 * self._count * len(new) / total) / total
        self._mean = self._mean + away * len(new) / total
        self._count = min(total, 2e6)

    def learn(self, round_: Collected, share_done: float) -> None:
        """Improve policy and critic by one round."""
        gains, following = np.zeros_like(round_.rewards), np.zeros(NUM_FLIGHTS, np.float32)
        for k in reversed(range(NUM_DECISIONS)):
            goes_on = ~round_.is_last[k]
            surprise = round_.rewards[k] + DISCOUNT * round_.values[k + 1] * goes_on - round_.values[k]
            gains[k] = following = surprise + DISCOUNT * TRACE * goes_on * following
        seen = self.scaled(round_.seen.reshape(-1, 19))
        actions = torch.from_numpy(round_.actions.reshape(-1, 3))
        before = torch.from_numpy(round_.log_probabilities.reshape(-1))
        returns = torch.from_numpy((gains + round_.values[:-1]).reshape(-1))
        gained = torch.from_numpy(gains.reshape(-1))
        gained = (gained - gained.mean()) / (gained.std() + 1e-8)
        for group in self._optimizer.param_groups:
            group["lr"] = LEARNING_RATE * (1.0 - (1.0 - LAST_RATE_SHARE) * share_done)
        for _ in range(PASSES):
            for batch in torch.randperm(len(seen)).split(BATCH):
                now = self.distribution(seen[batch]).log_prob(actions[batch]).sum(dim=1)
                ratio = (now - before[batch]).exp()
                clipped = ratio.clamp(1.0 - CLIPPED, 1.0 + CLIPPED)
                gain = torch.min(ratio * gained[batch], clipped * gained[batch]).mean()
                error = (self.critic(seen[batch])[:, 0] - returns[batch]).square().mean()
                self._optimizer.zero_grad()
                (0.5 * error - gain).backward()
                nn.utils.clip_grad_norm_(self._parameters, 0.5)
                self._optimizer.step()


class Flights:
    """Flights side by side that take a force once in `HELD` control periods."""

    def __init__(self, seed: int) -> None:
        self.env = InspectionVectorEnv(NUM_FLIGHTS, WORLD, REWARD)
        self.seen, _ = self.env.reset(seed=seed)
        self.num_flights = self.num_periods = 0
        self._spent = np.zeros(NUM_FLIGHTS)

    def decide(self, forces: Floats, price: float) -> tuple[Floats, NDArray[np.bool_], dict[str, Any]]:
        """Fly to the next decision; return rewards, which flights ended, and what was said at their ends."""
        is_over, rewards = np.zeros(NUM_FLIGHTS, np.bool_), np.zeros(NUM_FLIGHTS)
        ends: dict[str, Any] = {}
        for period in range(HELD):
            asked = forces if period == 0 else np.zeros_like(forces)
            self.seen, reward, terminated, truncated, info = self.env.step(asked)
            burnt, self._spent = info["delta_v_m_s"] - self._spent, info["delta_v_m_s"].copy()
            rewards += np.where(is_over, 0.0, reward - price * burnt)
            is_new = (terminated | truncated) & ~is_over
            for name in ("num_inspected", "num_inspectable", "delta_v_m_s", "is_success", "outside_m"):
                ends.setdefault(name, np.zeros(NUM_FLIGHTS))[is_new] = info[name][is_new]
            self.num_periods += int((~is_over).sum())
            is_over |= is_new
        self.num_flights += int(is_over.sum())
        is_at_end = terminated | truncated  # the others have started anew
        if is_at_end.any():
            self.seen, _ = self.env.reset(options={"reset_mask": is_at_end})
            self._spent[is_at_end] = 0.0
        return rewards.astype(np.float32), is_over, ends


def collected(flights: Flights, learner: Learner, price: float) -> Collected:
    """Fly one round with noise."""
    rows: list[tuple[Any, ...]] = []
    for _ in range(NUM_DECISIONS):
        seen = flights.seen.copy()
        with torch.no_grad():
            scaled = learner.scaled(seen)
            distribution = learner.distribution(scaled)
            action = distribution.sample()
            likely, value = distribution.log_prob(action).sum(dim=1), learner.critic(scaled)[:, 0]
        rewards, is_over, _ = flights.decide(fired(action.numpy()), price)
        rows.append((seen, action.numpy(), likely.numpy(), rewards, is_over, value.numpy()))
    *columns, values = (np.array(column) for column in zip(*rows, strict=True))
    with torch.no_grad():
        last = learner.critic(learner.scaled(flights.seen))[:, 0].numpy()
    return Collected(*columns, np.concatenate((values, last[np.newaxis])))


def evaluated(learner: Learner, seed: int) -> str:
    """Fly once from each of `NUM_FLIGHTS` starts without noise, and say how."""
    flights, is_over = Flights(seed), np.zeros(NUM_FLIGHTS, np.bool_)
    ended: dict[str, NDArray[np.float64]] = {}
    while not is_over.all():
        _, is_new, ends = flights.decide(learner.forces(flights.seen), 0.0)
        is_new &= ~is_over
        for name, values in ends.items():
            ended.setdefault(name, np.zeros(NUM_FLIGHTS))[is_new] = values[is_new]
        is_over |= is_new
    shares = [fraction(ended["is_success"] > 0.0, 95.0), fraction(ended["outside_m"] > 0.0, 95.0)]
    words = [
        f"{100 * each.fraction:.1f} % ({100 * each.low:.1f} to {100 * each.high:.1f})" for each in shares
    ]
    spent, rate = ended["delta_v_m_s"], ended["num_inspected"] / ended["num_inspectable"]
    fuel = f"{spent.mean():.3f} m/s (standard deviation {spent.std(ddof=1):.3f})"
    return f"{fuel}, {100 * rate.mean():.2f} % of the points, success {words[0]}, outside {words[1]}"


def main(arguments: Sequence[str]) -> int:
    """Train one policy and fly it."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.plain_ppo", description=__doc__)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--rounds", type=int, default=2500, help="each of 98,304 control periods")
    parser.add_argument("--price", type=float, default=3.0, help="of a m/s in the end; a point is worth 0.1")
    options = parser.parse_args(arguments)
    torch.set_num_threads(1)
    torch.manual_seed(options.seed)
    flights = Flights(SEEDS_APART * options.seed)
    learner = Learner(flights.env.task.scales)
    for index in range(options.rounds):
        done = index / options.rounds
        share = float(np.clip((done - DEARER_FROM) / (DEARER_TO - DEARER_FROM), 0.0, 1.0))
        round_ = collected(flights, learner, FIRST_PRICE * (options.price / FIRST_PRICE) ** share)
        learner.learn(round_, done)
        if done < ESTIMATED:
            learner.estimate(round_.seen.reshape(-1, 19))
        if (index + 1) % max(1, options.rounds // 10) == 0:
            budget = f"{flights.num_periods:,} periods, {flights.num_flights:,} flights"
            print(f"{budget}, {time.process_time():.0f} s: {evaluated(learner, 77)}", flush=True)
    print(f"from other starts: {evaluated(learner, FRESH)}")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
