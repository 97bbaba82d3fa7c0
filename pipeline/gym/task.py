"""The task: what is observed, in which order and units; what may be commanded; what is rewarded."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from gymnasium.spaces import Box, MultiDiscrete
from numpy.typing import NDArray

from pipeline.array_types import Floats
from pipeline.command_line.config import compose_experiment
from pipeline.settings.experiment import Experiment, Mission

#: what is composed where nothing else is asked for: nothing of it is flown but the world
BASE: Final = ("+experiment=evaluate", "controller=coast")


@dataclass(frozen=True)
class Reward:
    """What a step is rewarded with.

    Parameters
    ----------
    per_point : float
        For each point newly inspected.
    per_delta_v : float
        Taken away for each m/s spent.
    success : float
        Once, when enough points are inspected.
    outside : float
        Taken away where the flight ends outside the distance limits.
    """

    per_point: float = 0.1
    per_delta_v: float = 0.1
    success: float = 1.0
    outside: float = 1.0


@dataclass(frozen=True)
class Task:
    """A world to learn in.

    Parameters
    ----------
    experiment : Experiment
        Whose mission, Sun and shell of starts are flown.
    config : dict
        The same as plain data, for recordings.
    reward : Reward
    levels_n : float, optional
        Commands are one of -levels_n, 0 and levels_n along each axis; by default any force up to the limit.
    """

    experiment: Experiment
    config: dict[str, Any]
    reward: Reward
    levels_n: float | None

    @property
    def mission(self) -> Mission:
        """What is flown."""
        return self.experiment.mission

    @property
    def is_tilted(self) -> bool:
        """Whether the Sun of some start is out of the orbit plane."""
        sun = self.experiment.sun
        return sun.elevation_range_deg is not None or sun.elevation_deg != 0.0

    @property
    def scales(self) -> Floats:
        """Amounts by which observations are divided to be about one, see `pipeline.flight.fly.stepping`."""
        mission = self.mission
        speed, points = 1.0, float(mission.chief.num_points)
        distance = mission.deputy.max_distance_m
        size = mission.chief.inspection_radius_m
        groups = (
            [distance] * 3,
            [speed] * 3,
            [size] * 3,
            [1.0] * 6,
            [points] * 2,
            [speed, mission.duration_s],
        )
        return np.concatenate([np.array(group) for group in groups])

    def observation_space(self) -> "Box[np.float32]":
        """Return the space of observations, in physical units; no flight can leave it."""
        mission, deputy = self.mission, self.mission.deputy
        # by thrust alone, and what gravity's gradient and navigation's errors add, by a wide margin
        speed = 100.0 + 10.0 * deputy.max_force_n / deputy.mass_kg * mission.duration_s
        distance = 10.0 * deputy.max_distance_m + speed * mission.control_period_s
        high = self.scales.copy()
        high[:9] = [*[distance] * 3, *[speed] * 3, *[distance] * 3]
        high[9:15] = 1.0 + 1e-6
        high[17] = 3.0 * deputy.max_force_n / deputy.mass_kg * mission.duration_s + 1.0
        low = np.where(np.arange(len(high)) < 15, -high, 0.0)
        return Box(low.astype(np.float32), high.astype(np.float32), dtype=np.float32)

    def action_space(self) -> "Box[np.float32] | MultiDiscrete":
        """Return the space of commands: three numbers from -1 to 1, or three words of which 1 is silence."""
        if self.levels_n is None:
            return Box(-1.0, 1.0, (3,), np.float32)
        return MultiDiscrete([3, 3, 3])

    def forces(self, actions: NDArray[Any]) -> Floats:
        """Return the forces of actions, shape (n, 3), N, Hill axes."""
        values = np.asarray(actions, dtype=np.float64).reshape(-1, 3)
        if self.levels_n is None:
            return np.asarray(np.clip(values, -1.0, 1.0) * self.mission.deputy.max_force_n)
        return np.asarray((values - 1.0) * self.levels_n)


def task_of(
    overrides: Sequence[str] = (), reward: Reward | None = None, levels_n: float | None = None
) -> Task:
    """Compose a task.

    Parameters
    ----------
    overrides : sequence of str
        As on the command line: ``world=leo``, ``safety=filter``, ``sun=random``.
    reward : Reward, optional
    levels_n : float, optional
        See `Task`.

    Raises
    ------
    ValueError
        If the overrides do not compose, or the level is beyond what the thruster can do.
    """
    composed = compose_experiment([*BASE, *overrides])
    most = composed.experiment.mission.deputy.max_force_n
    if levels_n is not None and not 0.0 < levels_n <= most:
        raise ValueError(
            f"levels_n is {levels_n}; it must be above 0 and at most {most} N, deputy.max_force_n"
        )
    return Task(composed.experiment, composed.config, reward or Reward(), levels_n)
