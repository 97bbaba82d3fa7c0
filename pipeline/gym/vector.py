"""Many flights at once as one environment, stepped by one call."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from gymnasium.error import ResetNeeded
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from pipeline.gym.env import Observation, Started, checked_options, picture, require_episode
from pipeline.gym.episodes import Episodes, Reward, Task, obeyed, task_of


class InspectionVectorEnv(VectorEnv[Observation, NDArray[Any], NDArray[Any]]):
    """Flights side by side, see `pipeline.gym.env.InspectionEnv`.

    Flight i of a seed is that of seed + i alone.
    Observations are of shape (num_envs, 19), in physical units; actions (num_envs, 3), in Hill axes.

    Parameters
    ----------
    num_envs : int
    overrides, reward, levels_n
        As for one.
    render_mode : str, optional
        ``rgb_array``, for `render`.
    max_episode_steps : int, optional
        Episodes are truncated after so many, or at the end of their flight.
    decision_period_s : float, optional
        As for one.
    autoreset_mode : gymnasium.vector.AutoresetMode
        ``NEXT_STEP``: the step after an episode's last starts the next; its action is ignored, its reward
        zero. ``SAME_STEP``: the last step does, and gives ``final_obs`` and ``final_info`` beside it.
        ``DISABLED``: `reset` does, of those in ``reset_mask``.

    Raises
    ------
    ValueError
        If there is no flight or no step, or as `pipeline.gym.episodes.task_of` raises it.
    """

    metadata = {  # noqa: RUF012 - as Gymnasium declares it
        "autoreset_mode": AutoresetMode.NEXT_STEP,
        "render_modes": ["rgb_array"],
        "render_fps": 10,
    }

    def __init__(
        self,
        num_envs: int = 1,
        overrides: Sequence[str] = (),
        reward: Reward | None = None,
        levels_n: float | None = None,
        render_mode: str | None = None,
        max_episode_steps: int | None = None,
        decision_period_s: float | None = None,
        autoreset_mode: AutoresetMode = AutoresetMode.NEXT_STEP,
    ) -> None:
        for name, count in (("num_envs", num_envs), ("max_episode_steps", max_episode_steps)):
            if count is not None and count < 1:
                raise ValueError(f"{name} is {count}; it must be at least 1")
        self.num_envs, self.render_mode, self._most_steps = num_envs, render_mode, max_episode_steps
        self.autoreset_mode = AutoresetMode(autoreset_mode)
        self.metadata = {**self.metadata, "autoreset_mode": self.autoreset_mode}
        self.task: Task = task_of(obeyed(overrides), reward, levels_n, decision_period_s)
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
    ) -> Started:
        """Start all episodes, or those of ``options["reset_mask"]``, shape (num_envs,) of bool."""
        options = checked_options(options, ("reset_mask",))
        is_reset = self._checked_mask(options["reset_mask"]) if "reset_mask" in options else self._all
        seeds = range(seed, seed + self.num_envs) if isinstance(seed, int) else seed
        if seeds is not None and len(seeds) != self.num_envs:
            raise ValueError(f"{len(seeds)} seeds were given for {self.num_envs} flights; give one for each")
        if not self._generators:
            if not is_reset.all():
                raise ResetNeeded("some flights have no episode yet; reset all of them first")
            self._generators = [np.random.default_rng() for _ in range(self.num_envs)]
        for flight in map(int, np.flatnonzero(is_reset)):
            if seeds is not None and seeds[flight] is not None:
                self._generators[flight] = np.random.default_rng(seeds[flight])
            self._start(flight)
        self._has_ended[is_reset] = False
        self._episodes.begin()
        return self._episodes.flights.seen, self._infos()

    def _checked_mask(self, mask: Any) -> NDArray[np.bool_]:
        """Return the mask if it is an array that selects flights."""
        if not (isinstance(mask, np.ndarray) and mask.dtype == np.bool_ and mask.shape == (self.num_envs,)):
            raise ValueError(f"reset_mask must be an array of bool, shape ({self.num_envs},)")
        if not mask.any():
            raise ValueError("reset_mask selects no flight; set at least one of its elements")
        return mask

    def _start(self, flight: int) -> None:
        self._episodes.start(flight, self.task.draw(self._generators[flight]))

    def step(
        self, actions: NDArray[Any]
    ) -> tuple[Observation, NDArray[np.float64], NDArray[np.bool_], NDArray[np.bool_], dict[str, Any]]:
        """Fly to the next action in all; `autoreset_mode` says when an episode follows one that ended."""
        require_episode(
            None
            if not self._generators
            else self.autoreset_mode == AutoresetMode.DISABLED and bool(self._has_ended.any())
        )
        if self.autoreset_mode == AutoresetMode.NEXT_STEP:
            self._start_all(self._has_ended)
        rewards, terminated, truncated = self._episodes.step(actions)
        if self._most_steps is not None:
            truncated |= ~terminated & (
                self._episodes.flights.samples >= self._most_steps * self.task.num_periods
            )
        self._has_ended = terminated | truncated
        last: dict[str, Any] = {}
        if self.autoreset_mode == AutoresetMode.SAME_STEP and self._has_ended.any():
            last = self._last()
            self._start_all(self._has_ended)
            self._episodes.begin()
        return self._episodes.flights.seen, rewards, terminated, truncated, self._infos() | last

    def _start_all(self, is_started: NDArray[np.bool_]) -> None:
        """Put some flights at a new start."""
        for flight in map(int, np.flatnonzero(is_started)):
            self._start(flight)

    def _last(self) -> dict[str, Any]:
        """Return what was observed and known at the end of the episodes that ended, as Gymnasium tells it."""
        seen, ended = self._episodes.flights.seen, self._has_ended.copy()
        final_obs = np.full(self.num_envs, None, dtype=object)
        for flight in np.flatnonzero(ended):
            final_obs[flight] = seen[flight]
        facts: dict[str, Any] = {}
        for name, values in self._episodes.facts.items():
            facts |= {name: values, f"_{name}": ended}
        return {"final_obs": final_obs, "_final_obs": ended, "final_info": facts, "_final_info": ended}

    def _infos(self) -> dict[str, NDArray[Any]]:
        """Return facts as vector environments have them: an array each, and a mask of where it is known."""
        facts = self._episodes.facts
        return facts | {f"_{name}": self._all for name in facts}

    def render(self) -> tuple[NDArray[np.uint8], ...] | None:
        """Return a picture of each episode so far, where `render_mode` asks for it."""
        if self.render_mode is None:
            return None
        return tuple(picture(self._episodes, flight) for flight in range(self.num_envs))

    def record(self, flight: int, path: Path) -> None:
        """Record the episode of a flight so far as MCAP."""
        self._episodes.record(flight, Path(path))
