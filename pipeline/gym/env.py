"""One flight as an environment."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
from numpy.typing import NDArray

from pipeline.flight.state.log import FlightLog
from pipeline.gym.episodes import Episodes
from pipeline.gym.task import Reward, Task, task_of

Observation = NDArray[np.float32]


class InspectionEnv(gymnasium.Env[Observation, NDArray[Any]]):
    """Inspect the chief: command a force each control period, in Hill axes.

    Observations are physical, in the order of `pipeline.flight.fly.stepping.OBSERVED`. An episode terminates
    outside the distance limits and when every point that counts is inspected; it is truncated when its time
    is over.

    Parameters
    ----------
    overrides : sequence of str
        Of the world, as on the command line: ``world=leo``, ``safety=filter``.
    reward : Reward, optional
    levels_n : float, optional
        For commands of three levels along each axis, -levels_n, 0, levels_n (actions 0, 1, 2); by default an
        action is a share, from -1 to 1, of ``deputy.max_force_n``.
    """

    metadata = {"render_modes": []}  # noqa: RUF012 - as Gymnasium declares it

    def __init__(
        self, overrides: Sequence[str] = (), reward: Reward | None = None, levels_n: float | None = None
    ) -> None:
        self.task: Task = task_of(overrides, reward, levels_n)
        self.observation_space = self.task.observation_space()
        self.action_space = self.task.action_space()
        self._episodes = Episodes(self.task, 1)
        self.render_mode = None

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Start an episode: drawn, or ``options["scenario"]`` (`pipeline.flight.state.log.Scenario`)."""
        super().reset(seed=seed)
        scenario = (options or {}).get("scenario") or self._episodes.draw(self.np_random)
        self._episodes.start(0, scenario)
        self._episodes.step(None)
        return self._episodes.observations[0], self._info()

    def step(self, action: NDArray[Any]) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Fly a control period."""
        rewards, terminated, truncated = self._episodes.step(np.asarray(action)[np.newaxis])
        told = self._episodes.observations[0]
        return told, float(rewards[0]), bool(terminated[0]), bool(truncated[0]), self._info()

    def _info(self) -> dict[str, Any]:
        return {name: float(values[0]) for name, values in self._episodes.facts.items()}

    def log(self) -> FlightLog:
        """Return everything that happened in the episode so far; what is left is flown without force."""
        return self._episodes.log(0)[1]

    def record(self, path: Path) -> None:
        """Record the episode so far as MCAP; what is left of its time is flown without force."""
        self._episodes.record(0, Path(path))
