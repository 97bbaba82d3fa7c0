"""Observations about one: each divided by an amount that the world says."""

import gymnasium
import numpy as np
from gymnasium.spaces import Box
from gymnasium.vector import VectorObservationWrapper
from numpy.typing import NDArray

from pipeline.gym.env import InspectionEnv
from pipeline.gym.many import InspectionVectorEnv
from pipeline.gym.task import Task

Observation = NDArray[np.float32]


def _scaled(space: "Box[np.float32]", scales: NDArray[np.float32]) -> "Box[np.float32]":
    return Box(space.low / scales, space.high / scales, dtype=np.float32)


def _scales(task: Task) -> NDArray[np.float32]:
    return task.scales.astype(np.float32)


class NormalizedObservation(gymnasium.ObservationWrapper):
    """Divides observations by `pipeline.gym.task.Task.scales`."""

    def __init__(self, env: InspectionEnv) -> None:
        super().__init__(env)
        self._scales = _scales(env.task)
        self.observation_space = _scaled(env.task.observation_space(), self._scales)

    def observation(self, observation: Observation) -> Observation:
        """Return an observation, divided."""
        return observation / self._scales


class NormalizedVectorObservation(VectorObservationWrapper):
    """The same for many flights."""

    def __init__(self, env: InspectionVectorEnv) -> None:
        super().__init__(env)
        self._scales = _scales(env.task)
        self.single_observation_space = _scaled(env.task.observation_space(), self._scales)
        self.observation_space = gymnasium.vector.utils.batch_space(
            self.single_observation_space, env.num_envs
        )

    def observations(self, observations: Observation) -> Observation:
        """Return observations, divided."""
        return observations / self._scales
