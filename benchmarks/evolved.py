"""Train a policy by evolution: ``python -m benchmarks.evolved FOLDER``.

The covariance matrix adaptation evolution strategy (Hansen and Ostermeier, Evolutionary Computation 9, 2001)
of DEAP over all weights of a small network. Candidates of a generation fly from the same new starts, side by
side; the better their mean return, the more they count. The policy is their mean, written as ONNX, at the end
and at intervals, for ``controller=PATH``.
"""

import argparse
import json
import sys
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from pathlib import Path
from typing import Final

import numpy as np
from deap import cma
from numpy.typing import NDArray

from benchmarks.acting import MINUTE, OUTSIDE, SEEDS_APART, Acting
from benchmarks.networks import CLIP, TANH, Layer, note_time, silenced, write_policy
from benchmarks.training import Training
from pipeline.flight.fly.stepping import NUM_SEEN
from pipeline.gym.episodes import Episodes, Reward, Task, task_of

Floats = NDArray[np.float64]
#: axes of a force
NUM_FORCES: Final = 3
#: flights without force, by which observations are scaled
NUM_SCALED: Final = 64
#: mean and spread of observations before that
UNSCALED: Final = (np.zeros(NUM_SEEN), np.ones(NUM_SEEN))


@dataclass(frozen=True, kw_only=True)
class Settings(Acting):
    """How a policy evolves.

    Parameters
    ----------
    hidden : int
        Width of the only hidden layer; 0: none.
    step : float
        Initial standard deviation of each weight.
    num_starts : int
        From which each candidate of a generation flies.
    """

    hidden: int = 0
    step: float = 0.1
    num_starts: int = 16


SETTINGS: Final[Mapping[str, Settings]] = {"minute": Settings(**MINUTE)}


class Candidate(list[float]):
    """A candidate's weights, with its mean return, the more the better."""

    fitness: float = -np.inf


def sizes_of(hidden: int) -> list[int]:
    """Return the widths of what a network observes, its hidden layer, and what it gives."""
    return [NUM_SEEN, *([hidden] if hidden else []), NUM_FORCES]


def num_weights(hidden: int) -> int:
    """Return how many numbers a network has."""
    return sum((num_in + 1) * num_out for num_in, num_out in pairwise(sizes_of(hidden)))


def layers_of(weights: Floats, hidden: int) -> list[Layer]:
    """Return the layers of candidates, each of (n, outputs, inputs) and (n, outputs), from (n, W)."""
    layers, first = [], 0
    for num_in, num_out in pairwise(sizes_of(hidden)):
        last = first + num_in * num_out
        matrix, added = weights[:, first:last], weights[:, last : last + num_out]
        layers.append((matrix.reshape(-1, num_out, num_in) / np.sqrt(num_in), added))
        first = last + num_out
    return layers


def shares(layers: Sequence[Layer], seen: Floats, silent: float) -> Floats:
    """Return shares of the greatest force, (n, m, 3), of n candidates that observe (n, m, 19)."""
    values = seen
    for index, (matrix, added) in enumerate(layers):
        values = values @ matrix.transpose(0, 2, 1) + added[:, np.newaxis]
        values = np.tanh(values) if index < len(layers) - 1 else np.clip(values, -1.0, 1.0)
    return np.sign(values) * np.maximum(np.abs(values) - silent, 0.0)


class Flights:
    """Candidates' flights side by side, with what they are paid.

    Parameters
    ----------
    task : Task
        Whose reward has no price of fuel.
    settings : Settings
    num_candidates, num_starts : int
    """

    def __init__(self, task: Task, settings: Settings, num_candidates: int, num_starts: int) -> None:
        self.task, self._silent, self._shape = task, settings.silent, (num_candidates, num_starts)
        self._episodes = Episodes(task, num_candidates * num_starts)
        #: how many control periods have been flown, and flights
        self.num_periods = self.num_flights = 0

    def __len__(self) -> int:
        return len(self._episodes.needed)

    def fly(
        self, layers: Sequence[Layer], scaling: tuple[Floats, Floats], seed: int, price: float
    ) -> tuple[Floats, Floats]:
        """Fly all candidates from the starts of a seed; return returns, (n, m), and what is observed."""
        episodes, (mean, spread) = self._episodes, scaling
        flights, generator = episodes.flights, np.random.default_rng(seed)
        starts = [self.task.draw(generator) for _ in range(self._shape[1])]
        for flight in range(len(self)):
            episodes.start(flight, starts[flight % len(starts)])
        episodes.begin()
        returns = np.zeros(len(self))
        is_flown, seen = np.ones(len(self), dtype=np.bool_), []
        while is_flown.any():
            now = flights.seen.astype(np.float64)
            seen.append(now[is_flown])
            observed = ((now - mean) / spread).reshape(*self._shape, -1)
            acts = shares(layers, observed, self._silent).reshape(-1, NUM_FORCES)
            with flights.resting(~is_flown):
                rewards, terminated, truncated = episodes.step(acts)
            returns += rewards
            is_flown &= ~(terminated | truncated)
        spent = episodes.facts["delta_v_m_s"]
        self.num_periods += int(flights.samples.sum())
        self.num_flights += len(self)
        return (returns - price * spent).reshape(self._shape), np.concatenate(seen)


@dataclass(frozen=True)
class Evolution(Training[Settings]):
    """A training by evolution.

    Parameters
    ----------
    every : int, optional
        Control periods between two policies that are written; none before the last unless given.
    """

    every: int | None = None

    @cached_property
    def task(self) -> Task:
        """What is flown, with no price of fuel, as that changes."""
        settings = self.settings
        reward = Reward(per_delta_v=0.0, outside=OUTSIDE, success=settings.success)
        return task_of(self.every_word, reward, decision_period_s=settings.decision_period_s)

    def run(self) -> Path:
        """Train, and return the file of the policy."""
        settings, task = self.settings, self.task
        self.folder.mkdir(parents=True, exist_ok=True)
        drifting = Flights(task, settings, 1, NUM_SCALED)
        rest = np.zeros((1, num_weights(settings.hidden)))
        seen = drifting.fly(layers_of(rest, settings.hidden), UNSCALED, self.seed * SEEDS_APART, 0.0)[1]
        spread = seen.std(axis=0)
        scaling = seen.mean(axis=0), np.where(spread > 0.0, spread, 1.0)
        np.random.seed(self.seed)  # noqa: NPY002 - DEAP draws from it
        strategy = cma.Strategy(centroid=rest[0], sigma=settings.step)
        flights = Flights(task, settings, strategy.lambda_, settings.num_starts)
        flights.num_periods, flights.num_flights = drifting.num_periods, drifting.num_flights
        most = len(flights) * task.mission.num_controls
        generation, due = 0, self.every or self.budget
        while flights.num_periods + most <= self.budget:
            generation += 1
            candidates = strategy.generate(Candidate)
            layers = layers_of(np.array(candidates), settings.hidden)
            price = settings.price(flights.num_periods / self.budget)
            returns, _ = flights.fly(layers, scaling, self.seed * SEEDS_APART + generation, price)
            for candidate, paid in zip(candidates, returns.mean(axis=1).tolist(), strict=True):
                candidate.fitness = paid
            strategy.update(candidates)
            if flights.num_periods >= due:
                due += self.every or self.budget
                self._print(flights, generation, returns)
                if self.every:
                    self.write(strategy.centroid, scaling, flights, f"{flights.num_periods}")
        return self.write(strategy.centroid, scaling, flights, "policy")

    def _print(self, flights: Flights, generation: int, returns: Floats) -> None:
        seconds, best = time.process_time() - self.begun, returns.mean(axis=1).max()
        print(
            f"{flights.num_periods:,} control periods, {seconds:.0f} s, generation {generation}: "
            f"mean return {returns.mean():.2f}, of the best {best:.2f}",
            flush=True,
        )

    def write(self, weights: Floats, scaling: tuple[Floats, Floats], flights: Flights, name: str) -> Path:
        """Write a network as ONNX, from observations to a force in N, Hill axes."""
        settings, (mean, spread) = self.settings, scaling
        layers = [(matrix[0], added[0]) for matrix, added in layers_of(weights[np.newaxis], settings.hidden)]
        matrix = layers[0][0] / spread
        layers[0] = matrix, layers[0][1] - matrix @ mean
        layers, kinds = silenced(layers, [*[TANH] * (len(layers) - 1), CLIP], settings.silent)
        facts = {"training": json.dumps(self.told(flights.num_periods, flights.num_flights))}
        if settings.decision_period_s is not None:
            facts["decision_period_s"] = f"{settings.decision_period_s:g}"
        path = self.folder / f"{name}.onnx"
        write_policy(layers, kinds, flights.task.mission.deputy.max_force_n, path, facts)
        note_time(path, self.begun)
        return path


def main(arguments: Sequence[str]) -> int:
    """Train one policy."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.evolved", description=__doc__)
    parser.add_argument("folder", type=Path, help="where the policy is written")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--budget", type=float, default=1e6, help="control periods")
    parser.add_argument("--every", type=float, help="control periods between two that are written")
    parser.add_argument("--hidden", type=int, help="width of the hidden layer; 0: none")
    parser.add_argument("--step", type=float, help="initial standard deviation of each weight")
    parser.add_argument("--starts", type=int, help="from which each candidate of a generation flies")
    parser.add_argument("words", nargs="*", help="of the world, such as sun=random")
    options = parser.parse_args(arguments)
    given = {"hidden": options.hidden, "step": options.step, "num_starts": options.starts}
    settings = replace(
        SETTINGS["minute"], **{name: value for name, value in given.items() if value is not None}
    )
    every = None if options.every is None else int(options.every)
    Evolution(
        options.folder, settings, options.seed, int(options.budget), tuple(options.words), every=every
    ).run()
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
