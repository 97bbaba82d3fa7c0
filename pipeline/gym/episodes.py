"""Episodes side by side: drawn, flown, rewarded and ended, and recorded once they have been."""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.array_types import Floats
from pipeline.flight.cases.starts import draw
from pipeline.flight.control.controller import open_loop
from pipeline.flight.fly.simulation import fly_logged
from pipeline.flight.fly.stepping import (
    CORRECTED,
    NUM_ACTED,
    NUM_INSPECTED,
    NUM_UNSEEN,
    OUTSIDE,
    SPENT,
    Flights,
)
from pipeline.flight.state.log import FlightLog, Scenario, points_needed
from pipeline.gym.task import Task
from pipeline.recording.recorder import FlightRecorder

Truths = NDArray[np.bool_]

#: first part of the spawn key of starts, beside those of `pipeline.flight.cases.starts`
EPISODES = 1 << 22
#: seeds of starts are drawn below this
MOST_SEED = 1 << 31


class Episodes:
    """Some episodes of a task, each at a step of its own.

    Parameters
    ----------
    task : Task
    num_episodes : int
    """

    def __init__(self, task: Task, num_episodes: int) -> None:
        self.task = task
        self._flights = Flights(task.mission, num_episodes, is_tilted=task.is_tilted)
        self._scenarios: list[Scenario | None] = [None] * num_episodes
        self._forces = np.zeros((num_episodes, task.mission.num_controls, 3))
        self._needed = np.zeros(num_episodes, dtype=np.int64)
        self._before = self._flights.observed.copy()

    def draw(self, generator: np.random.Generator) -> Scenario:
        """Draw a start, as an evaluation does."""
        cases, sun = self.task.experiment.monte_carlo, self.task.experiment.sun
        shell = cases.min_distance_m, cases.max_distance_m
        return draw(int(generator.integers(MOST_SEED)), EPISODES, 0, shell, sun, cases.max_speed_m_s)

    def start(self, episode: int, scenario: Scenario) -> None:
        """Put an episode at a start; the next step brings it to its first sample."""
        self._flights.start(episode, scenario)
        self._scenarios[episode] = scenario
        threshold = self.task.mission.inspection_threshold_percent
        self._needed[episode] = points_needed(int(self._flights.inspectable[episode]), threshold)

    def step(self, actions: NDArray[np.float64] | None) -> tuple[Floats, Truths, Truths]:
        """Fly all by a control period; without actions only those that are started move.

        Returns
        -------
        rewards : (n,) array
            Zero of those that were started.
        terminated : (n,) array of bool
            Outside the distance limits, or every point that counts is inspected.
        truncated : (n,) array of bool
            The flight's time is over.
        """
        flights, reward = self._flights, self.task.reward
        forces = np.zeros((len(flights.samples), 3)) if actions is None else self.task.forces(actions)
        is_begun = flights.samples >= 0
        rows = np.flatnonzero(is_begun)
        self._forces[rows, flights.samples[rows]] = forces[rows]
        self._before[:] = flights.observed
        flights.step(forces)
        now, before = flights.observed, self._before
        is_outside = now[:, OUTSIDE] > 0.0
        succeeds = now[:, NUM_INSPECTED] >= self._needed
        succeeds &= before[:, NUM_INSPECTED] < self._needed
        rewards = reward.per_point * (now[:, NUM_INSPECTED] - before[:, NUM_INSPECTED])
        rewards -= reward.per_delta_v * (now[:, SPENT] - before[:, SPENT])
        rewards += reward.success * succeeds - reward.outside * is_outside
        terminated = is_begun & (is_outside | (now[:, NUM_UNSEEN] == 0.0))
        truncated = is_begun & ~terminated & (flights.samples == self.task.mission.num_controls)
        return np.where(is_begun, rewards, 0.0), terminated, truncated

    @property
    def observations(self) -> NDArray[np.float32]:
        """What is observed now, see `pipeline.flight.fly.stepping.Flights.seen`."""
        return self._flights.seen

    @property
    def facts(self) -> dict[str, NDArray[Any]]:
        """What is told beside observations: see `pipeline.flight.fly.stepping`."""
        now = self._flights.observed
        return {
            "delta_v_m_s": now[:, SPENT].copy(),
            "num_inspected": now[:, NUM_INSPECTED].copy(),
            "num_inspectable": self._flights.inspectable.copy(),
            "is_success": now[:, NUM_INSPECTED] >= self._needed,
            "outside_m": now[:, OUTSIDE].copy(),
            "safety_periods": now[:, NUM_ACTED].copy(),
            "safety_delta_v_m_s": now[:, CORRECTED].copy(),
        }

    def log(self, episode: int) -> tuple[Scenario, FlightLog]:
        """Fly an episode again with the forces that were commanded, and without force from then on."""
        scenario, mission = self._scenarios[episode], self.task.mission
        if scenario is None:
            raise ValueError("there is no episode yet; call reset first")
        return scenario, fly_logged(mission, open_loop("episode", self._played(episode)), scenario)

    def record(self, episode: int, path: Path) -> None:
        """Record an episode as every flight is, see `telemetry`."""
        scenario, log = self.log(episode)
        experiment = self.task.experiment
        recorder = FlightRecorder(
            self.task.mission,
            open_loop("episode", self._played(episode)),
            seed=scenario.noise[0],
            config=self.task.config,
            near_limit_m=experiment.telemetry.near_limit_m,
        )
        recorder.record(path, scenario, log, "episode")

    def _played(self, episode: int) -> Floats:
        """Return the forces of an episode so far, one row a control period, N, Hill axes."""
        flown = max(0, int(self._flights.samples[episode]))
        return self._forces[episode, :flown].copy()
