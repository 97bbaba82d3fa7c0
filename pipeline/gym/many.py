"""Many flights as one environment, stepped by one compiled call."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from pipeline.gym.episodes import Episodes
from pipeline.gym.task import Reward, Task, task_of

Observations = NDArray[np.float32]
Numbers = NDArray[np.float64]


class InspectionVectorEnv(VectorEnv[Observations, NDArray[Any], NDArray[Any]]):
    """Flights side by side, see `pipeline.gym.env.InspectionEnv`.

    Flight i of a seed is that of seed + i alone.
    The step after an episode's last starts the next: its action is ignored, its reward zero
    (`AutoresetMode.NEXT_STEP`).

    Parameters
    ----------
    num_envs : int
    overrides, reward, levels_n
        As for one.
    """

    metadata = {"autoreset_mode": AutoresetMode.NEXT_STEP, "render_modes": []}  # noqa: RUF012 - as above

    def __init__(
        self,
        num_envs: int = 1,
        overrides: Sequence[str] = (),
        reward: Reward | None = None,
        levels_n: float | None = None,
    ) -> None:
        self.num_envs = num_envs
        self.task: Task = task_of(overrides, reward, levels_n)
        self.single_observation_space = self.task.observation_space()
        self.single_action_space = self.task.action_space()
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self._episodes = Episodes(self.task, num_envs)
        self._generators: list[np.random.Generator] = []
        self._has_ended = np.zeros(num_envs, dtype=np.bool_)
        self._all = np.ones(num_envs, dtype=np.bool_)

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observations, dict[str, Any]]:
        """Start all episodes."""
        if seed is not None or not self._generators:
            seeds = [seed] * self.num_envs if seed is None else seed
            if isinstance(seeds, int):
                seeds = range(seeds, seeds + self.num_envs)
            self._generators = [np.random.default_rng(one) for one in seeds]
        for flight in range(self.num_envs):
            self._start(flight)
        self._has_ended[:] = False
        self._episodes.step(None)
        return self._episodes.observations, self._told()

    def _start(self, flight: int) -> None:
        self._episodes.start(flight, self._episodes.draw(self._generators[flight]))

    def step(
        self, actions: NDArray[Any]
    ) -> tuple[Observations, Numbers, NDArray[np.bool_], NDArray[np.bool_], dict[str, Any]]:
        """Fly a control period in all, or start the next episode of those that ended with the last step."""
        for flight in np.flatnonzero(self._has_ended):
            self._start(int(flight))
        rewards, terminated, truncated = self._episodes.step(actions)
        self._has_ended = terminated | truncated
        return self._episodes.observations, rewards, terminated, truncated, self._told()

    def _told(self) -> dict[str, NDArray[Any]]:
        """Return facts as vector environments tell them: an array each, and where it is known."""
        facts = self._episodes.facts
        return facts | {f"_{name}": self._all for name in facts}

    def record(self, flight: int, path: Path) -> None:
        """Record the episode of a flight so far as MCAP."""
        self._episodes.record(flight, Path(path))
