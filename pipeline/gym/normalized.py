"""Observations divided by their scales, so that they are about one: of one flight, and of many."""

from typing import Any

import gymnasium
import numpy as np
from gymnasium.spaces import Box
from gymnasium.vector import VectorEnv
from gymnasium.wrappers import TransformObservation
from gymnasium.wrappers.vector import TransformObservation as TransformVectorObservation
from numpy.typing import NDArray

from pipeline.gym.env import Observation
from pipeline.gym.episodes import Task


class _Divide:
    """Divides observations by scales; unlike a function in a function it can be pickled."""

    def __init__(self, scales: Observation) -> None:
        self._scales = scales

    def __call__(self, observations: Observation) -> Observation:
        return observations / self._scales


def normalised(task: Task | None, space: Any) -> tuple[Observation, "Box[np.float32]"]:
    """Return the scales to divide observations by, and the space of the divided ones.

    Raises
    ------
    ValueError
        If the observations of the space are not those of the task.
    """
    scales = np.zeros(0) if task is None else task.scales
    if not (isinstance(space, Box) and space.shape == scales.shape):
        raise ValueError(
            "only observations of Inspection-v0 and Reach-v0, as they are, can be divided by their scales; "
            "wrap such an environment before others change what is observed"
        )
    divided = Box(
        (space.low / scales).astype(np.float32), (space.high / scales).astype(np.float32), dtype=np.float32
    )
    return scales.astype(np.float32), divided


class NormalizedObservation(TransformObservation):
    """Divides observations by `pipeline.gym.episodes.Task.scales`.

    Raises
    ------
    ValueError
        If the environment, or what it wraps, does not observe those quantities.
    """

    def __init__(self, env: gymnasium.Env[Observation, NDArray[Any]]) -> None:
        scales, space = normalised(getattr(env.unwrapped, "task", None), env.observation_space)
        super().__init__(env, _Divide(scales), space)


class NormalizedVectorObservation(TransformVectorObservation):
    """The same for many flights, stepped by one call or each by its own environment.

    Raises
    ------
    ValueError
        If the environments do not observe those quantities.
    """

    def __init__(self, env: VectorEnv[Observation, NDArray[Any], NDArray[Any]]) -> None:
        many: Any = env.unwrapped
        task = many.task if hasattr(many, "task") else _common_task(many)
        scales, space = normalised(task, env.single_observation_space)
        super().__init__(env, _Divide(scales), single_observation_space=space)


def _common_task(many: Any) -> Task | None:
    """Return the task of Gymnasium's own vector environment, which holds single ones."""
    try:
        return next((task for task in many.get_attr("task") if isinstance(task, Task)), None)
    except AttributeError:
        return None
