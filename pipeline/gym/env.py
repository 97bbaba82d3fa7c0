"""Environments: one flight, many at once stepped by one compiled call, and the same normalised."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
from gymnasium.spaces import Box
from gymnasium.vector import AutoresetMode, VectorEnv, VectorObservationWrapper
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from pipeline.flight.state.log import FlightLog
from pipeline.gym.episodes import Episodes, Reward, Task, task_of

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
    render_mode : str, optional
        ``rgb_array``, for `render`.
    """

    metadata = {"render_modes": ["rgb_array"], "render_fps": 10}  # noqa: RUF012 - as Gymnasium declares it

    def __init__(
        self,
        overrides: Sequence[str] = (),
        reward: Reward | None = None,
        levels_n: float | None = None,
        render_mode: str | None = None,
    ) -> None:
        self.task: Task = task_of(overrides, reward, levels_n)
        self.observation_space = self.task.observation_space()
        self.action_space = self.task.action_space()
        self._episodes = Episodes(self.task, 1)
        self.render_mode = render_mode

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Start an episode: drawn, or ``options["scenario"]`` (`pipeline.flight.state.log.Scenario`).

        ``options["priority"]`` is a direction, shape (3,), for worlds where points have a priority.
        """
        super().reset(seed=seed)
        given = options or {}
        scenario = given.get("scenario") or self.task.draw(self.np_random)
        self._episodes.start(0, scenario, given.get("priority"))
        self._episodes.step(None)
        return self._episodes.observations[0], self._info()

    def step(self, action: NDArray[Any]) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Fly a control period."""
        rewards, terminated, truncated = self._episodes.step(np.asarray(action)[np.newaxis])
        observation = self._episodes.observations[0]
        return observation, float(rewards[0]), bool(terminated[0]), bool(truncated[0]), self._info()

    def _info(self) -> dict[str, Any]:
        return {name: float(values[0]) for name, values in self._episodes.facts.items()}

    def render(self) -> NDArray[np.uint8] | None:
        """Return a picture of the episode so far, (height, width, 3), where `render_mode` asks for it."""
        if self.render_mode is None:
            return None
        # slower to import than many flights
        from pipeline.report.figures.style import PALETTE, pixels  # noqa: PLC0415
        from pipeline.report.figures.trajectories import Tracks, trajectories  # noqa: PLC0415

        info, places = self._info(), self.log().position_m[: self._episodes.num_samples(0)]
        if len(places) == 1:  # a line has two ends
            places = np.repeat(places, 2, axis=0)
        words = f"{info['num_inspected']:.0f} points, {info['delta_v_m_s']:.3f} m/s"
        colour = PALETTE[0]
        return pixels(trajectories(Tracks(places[np.newaxis], [colour], {words: colour}), self.task.mission))

    def log(self) -> FlightLog:
        """Return everything that happened in the episode so far; what is left is flown without force."""
        return self._episodes.log(0)[1]

    def record(self, path: Path) -> None:
        """Record the episode so far as MCAP; what is left of its time is flown without force."""
        self._episodes.record(0, Path(path))


class InspectionVectorEnv(VectorEnv[Observation, NDArray[Any], NDArray[Any]]):
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
    ) -> tuple[Observation, dict[str, Any]]:
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
        self._episodes.start(flight, self.task.draw(self._generators[flight]))

    def step(
        self, actions: NDArray[Any]
    ) -> tuple[Observation, NDArray[np.float64], NDArray[np.bool_], NDArray[np.bool_], dict[str, Any]]:
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


def _scaled(space: "Box[np.float32]", scales: NDArray[np.float32]) -> "Box[np.float32]":
    return Box(space.low / scales, space.high / scales, dtype=np.float32)


class NormalizedObservation(gymnasium.ObservationWrapper):
    """Divides observations by `pipeline.gym.episodes.Task.scales`."""

    def __init__(self, env: InspectionEnv) -> None:
        super().__init__(env)
        self._scales = env.task.scales.astype(np.float32)
        self.observation_space = _scaled(env.task.observation_space(), self._scales)

    def observation(self, observation: Observation) -> Observation:
        """Return an observation, divided."""
        return observation / self._scales


class NormalizedVectorObservation(VectorObservationWrapper):
    """The same for many flights."""

    def __init__(self, env: InspectionVectorEnv) -> None:
        super().__init__(env)
        self._scales = env.task.scales.astype(np.float32)
        self.single_observation_space = _scaled(env.task.observation_space(), self._scales)
        self.observation_space = batch_space(self.single_observation_space, env.num_envs)

    def observations(self, observations: Observation) -> Observation:
        """Return observations, divided."""
        return observations / self._scales
