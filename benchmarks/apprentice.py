"""Train a policy to imitate plans: ``python -m benchmarks.apprentice FOLDER``.

Rounds of DAgger (Ross, Gordon and Bagnell, AISTATS 2011), whose teacher takes over (Ross and Bagnell, arXiv
1406.5979): the policy flies to a decision that is drawn, and plans of `benchmarks.teacher` fly the rest. So a
plan is made once a flight, from where the policy has come to. What plans fire at the decisions that they
made is learned by the multilayer perceptron of scikit-learn; the policy is written as ONNX for
``controller=PATH``, after each round and at the end.
"""

import argparse
import json
import sys
import time
import warnings
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from sklearn.exceptions import ConvergenceWarning
from sklearn.neural_network import MLPRegressor

from benchmarks.acting import MINUTE, SEEDS_APART, Acting
from benchmarks.imitated import FORCES, flown_forces, signals
from benchmarks.networks import CLIP, TANH, note_time, silenced, write_policy
from benchmarks.teacher import Teacher
from benchmarks.training import Training
from fis_tools.formats import serialize
from fis_tools.learning import learn
from fis_tools.model import FuzzyController
from pipeline.controllers.source import named
from pipeline.flight.fly.stepping import NUM_SEEN, NUM_UNSEEN, SteppedFlights
from pipeline.flight.state.log import Scenario
from pipeline.gym.episodes import Task, task_of
from pipeline.settings.experiment import Mission
from plain_files.file_access import write_text

Floats = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class Settings(Acting):
    """How a policy learns from plans.

    Parameters
    ----------
    layers : tuple of int
        Widths of those that are hidden.
    rounds : int
        Of flights; all of those so far are learned from after each.
    slack_m_s, margin_m : float
        As of `benchmarks.teacher.Teacher`.
    first_share : float
        Of a round's flights, those that plans fly from the start; the others' decisions are drawn.
    epochs : int
        How often each round learns from all rows; of networks.
    weight : float
        Of a decision at which something is fired, where one of silence has 1; of networks.
    """

    layers: tuple[int, ...] = (128, 128)
    rounds: int = 5
    slack_m_s: float = 0.01
    margin_m: float = 4.1
    first_share: float = 0.3
    epochs: int = 30
    weight: float = 10.0


NETWORK: Final = Settings(**{**MINUTE, "silent": 0.005})
#: how rules were trained, beside their file
TOLD: Final = "training.json"
#: decisions at which plans may take over are so many; more make smaller groups of flights
NUM_SWITCHES: Final = 12


def observed_at_decisions(
    mission: Mission, starts: list[Scenario], forces: Floats, period: int
) -> tuple[Floats, NDArray[np.bool_]]:
    """Return what flights under forces observe at decisions, (n, D, 19), and whether points are left."""
    is_tilted = any(start.sun_elevation_rad != 0.0 for start in starts)
    flights = SteppedFlights(mission, len(starts), is_tilted=is_tilted)
    for flight, start in enumerate(starts):
        flights.start(flight, start)
    flights.step(np.zeros((len(starts), 3)))
    seen, is_left = [], []
    for k in range(mission.num_controls):
        if k % period == 0:
            seen.append(flights.seen.astype(np.float64))
            is_left.append(flights.observed[:, NUM_UNSEEN] > 0.0)
        flights.step(forces[:, k])
    return np.stack(seen, axis=1), np.stack(is_left, axis=1)


@dataclass(frozen=True)
class Apprenticeship(Training[Settings], ABC):
    """A training by what plans answer."""

    @cached_property
    def task(self) -> Task:
        """What is flown; nothing is paid."""
        return task_of(self.every_word, decision_period_s=self.settings.decision_period_s)

    def run(self) -> Path:
        """Train, and return the file of the policy.

        Raises
        ------
        ValueError
            If the budget is less than a flight a round.
        """
        settings, task, mission = self.settings, self.task, self.task.mission
        count = self.budget // mission.num_controls // settings.rounds
        if count < 1:
            raise ValueError(
                f"a budget of {self.budget} control periods is less than {settings.rounds} flights of "
                f"{mission.num_controls}; give a greater one"
            )
        self.folder.mkdir(parents=True, exist_ok=True)
        teacher = Teacher(mission, task.num_periods, settings.slack_m_s, settings.margin_m)
        generator = np.random.default_rng(self.seed * SEEDS_APART)
        rows, answers, path = np.zeros((0, NUM_SEEN)), np.zeros((0, 3)), None
        for number in range(settings.rounds):
            starts = [task.draw(generator) for _ in range(count)]
            flown, switches = np.zeros((count, mission.num_controls, 3)), np.zeros(count, dtype=np.int64)
            if path is not None:
                flown = flown_forces(mission, named(str(path), mission), starts)
                switches = self._switches(generator, count)
            forces = teacher.finish(
                starts, flown, switches, self.seed * SEEDS_APART + number, heeds=path is not None
            )
            seen, is_left = observed_at_decisions(mission, starts, forces, task.num_periods)
            due = np.arange(0, mission.num_controls, task.num_periods)
            is_taught = is_left & (due >= switches[:, np.newaxis])
            rows = np.concatenate([rows, seen[is_taught]])
            answers = np.concatenate([answers, forces[:, due][is_taught] / mission.deputy.max_force_n])
            flights = count * (number + 1)
            is_last = number == settings.rounds - 1
            path = self.learn(
                rows, answers, flights, "policy" if is_last else f"{flights * mission.num_controls}"
            )
            print(f"round {number + 1}: {flights:,} flights, {len(rows):,} rows", flush=True)
        assert path is not None
        return path

    def _switches(self, generator: np.random.Generator, count: int) -> NDArray[np.int64]:
        """Draw the samples at which plans take over."""
        decisions = self.task.mission.num_controls // self.task.num_periods
        drawn = generator.choice(decisions, min(NUM_SWITCHES, decisions), replace=False)
        chosen = generator.choice(drawn, count) * self.task.num_periods
        return np.where(generator.random(count) < self.settings.first_share, 0, chosen)

    def _told(self, flights: int) -> dict[str, Any]:
        return self.told(flights * self.task.mission.num_controls, flights)

    @abstractmethod
    def learn(self, rows: Floats, answers: Floats, flights: int, name: str) -> Path:
        """Learn shares of the greatest force, (n, 3), from observations, (n, 19); return the file."""


class NetworkTraining(Apprenticeship):
    """The training of a network."""

    @cached_property
    def _network(self) -> MLPRegressor:
        """The network, which goes on learning."""
        return MLPRegressor(
            hidden_layer_sizes=self.settings.layers,
            activation="tanh",
            max_iter=self.settings.epochs,
            warm_start=True,
            random_state=self.seed,
        )

    def learn(self, rows: Floats, answers: Floats, flights: int, name: str) -> Path:
        """Learn from all rows, and write the network as ONNX, from observations to a force in N, Hill axes.

        Silence lessens each share afterwards, so that much more is learned of those that fire.
        """
        mean, spread = rows.mean(axis=0), rows.std(axis=0)
        spread = np.where(spread > 0.0, spread, 1.0)
        loud = answers + self.settings.silent * np.sign(answers)
        scale = loud.std(axis=0)
        scale = np.where(scale > 0.0, scale, 1.0)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", ConvergenceWarning)  # epochs are few, as is said
            weights = np.where(answers.any(axis=1), self.settings.weight, 1.0)
            self._network.fit((rows - mean) / spread, loud / scale, weights)
        network = self._network
        layers = [
            (matrix.T, added) for matrix, added in zip(network.coefs_, network.intercepts_, strict=True)
        ]
        first, added = layers[0]
        layers[0] = first / spread, added - (first / spread) @ mean
        last, added = layers[-1]
        layers[-1] = last * scale[:, np.newaxis], added * scale
        layers, kinds = silenced(layers, [*[TANH] * (len(layers) - 1), CLIP], self.settings.silent)
        mission = self.task.mission
        facts = {
            "training": json.dumps(self._told(flights)),
            "decision_period_s": f"{self.task.num_periods * mission.control_period_s:g}",
        }
        path = self.folder / f"{name}.onnx"
        write_policy(layers, kinds, mission.deputy.max_force_n, path, facts)
        note_time(path, self.begun)
        return path


class RulesTraining(Apprenticeship):
    """The training of 27 rules: for each force nine, of two signals with three terms each.

    The signals are those, of the ones that follow from observations, that lower the expected error most
    (`fis_tools.learning`). Rules decide as seldom as networks, and fire nothing that is as small.
    """

    def learn(self, rows: Floats, answers: Floats, flights: int, name: str) -> Path:
        """Learn from all rows, and write the rules as JSON."""
        mission = self.task.mission
        inputs, most = signals(rows, mission.orbit.mean_motion_rad_s), mission.deputy.max_force_n
        systems = [
            learn(
                {**inputs, f"{force} (N)": most * answers[:, column]},
                f"{force} (N)",
                consequents="sets",  # as flights compile them
                terms=3,
                max_inputs=2,
            )
            for column, force in enumerate(FORCES)
        ]
        least = f"{self.settings.silent * most:g}"
        attributes = {
            "force_axes": "hill",
            "decision_period_s": f"{self.task.num_periods * mission.control_period_s:g}",
            **{f"dead_band_{force}_n": least for force in FORCES},
        }
        fuzzy = FuzzyController("imitating", tuple(systems), tuple(attributes.items()))
        path = self.folder / f"{name}.json"
        write_text(path, serialize.dump_json(fuzzy) + "\n")
        told = self._told(flights) | {"processor_s": time.process_time() - self.begun}
        write_text(self.folder / TOLD, json.dumps(told, indent=1) + "\n")
        return path


#: what learns, and how unless other settings are given
KINDS: Final[Mapping[str, tuple[type[Apprenticeship], Settings]]] = {
    "network": (NetworkTraining, NETWORK),
    "rules": (RulesTraining, replace(NETWORK, slack_m_s=0.03)),
}


def main(arguments: Sequence[str]) -> int:
    """Train one policy."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.apprentice", description=__doc__)
    parser.add_argument("folder", type=Path, help="where the policy is written")
    parser.add_argument("--kind", choices=KINDS, default="network", help="what learns")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--budget", type=float, default=1e6, help="control periods")
    parser.add_argument("--rounds", type=int, default=NETWORK.rounds, help="of flights")
    parser.add_argument("words", nargs="*", help="of the world, such as sun=random")
    options = parser.parse_args(arguments)
    training, settings = KINDS[options.kind]
    settings = replace(settings, rounds=options.rounds)
    training(options.folder, settings, options.seed, int(options.budget), tuple(options.words)).run()
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
