"""Observations as AFRL's environments give them, so that what was trained there flies here."""

from math import pi
from typing import Any

import gymnasium
import numpy as np
from gymnasium.spaces import Box
from numpy.typing import NDArray

from pipeline.array_types import Floats
from pipeline.flight.fly.published import NUM_OF_PRIORITY, PublishedView
from pipeline.flight.fly.six_dof import RATE
from pipeline.flight.world.surface import surface_of
from pipeline.gym.env import InspectionEnv
from pipeline.gym.six_dof import SixDofInspectionEnv


class PublishedObservation(gymnasium.Wrapper[NDArray[np.float64], NDArray[Any], Any, NDArray[Any]]):
    """Observes as safe-autonomy-sims 4.2.3 does, see `pipeline.flight.fly.published.PublishedView`.

    Parameters
    ----------
    env : InspectionEnv or SixDofInspectionEnv
        Or wrappers that observe nothing else.
    random : numpy.random.Generator or numpy.random.RandomState, optional
        Draws where clusters begin; theirs is NumPy's global generator.

    Raises
    ------
    ValueError
        If the environment is another, or has its Sun out of the orbit plane.
    """

    def __init__(self, env: gymnasium.Env[Any, Any], random: Any = None) -> None:
        super().__init__(env)
        inner: Any = env.unwrapped
        if type(inner) not in (InspectionEnv, SixDofInspectionEnv):
            raise ValueError(
                f"{type(inner).__name__} is none that inspects; AFRL's observations are of InspectionEnv and "
                "SixDofInspectionEnv"
            )
        if inner.task.is_tilted:
            raise ValueError("AFRL's agents observe no Sun out of the orbit plane; leave its elevation out")
        mission = inner.task.mission
        space: Any = inner.observation_space
        self._inner, self._view = inner, PublishedView(mission, random or np.random.default_rng())
        turning = [*space.high[RATE], *[2.0] * 4] if isinstance(inner, SixDofInspectionEnv) else []
        most = 2.0 * pi + mission.orbit.mean_motion_rad_s * mission.duration_s
        high = [*space.high[:6], *turning, most, float(len(surface_of(mission).points)), *[1.0] * 3]
        high += [1.0] * (NUM_OF_PRIORITY if mission.chief.weights == "priority" else 0)
        low = -np.array(high)
        low[6 + len(turning) : 8 + len(turning)] = 0.0
        self.observation_space = Box(low, np.array(high), dtype=np.float64)

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> Any:
        """Start an episode."""
        _, info = self.env.reset(seed=seed, options=options)
        self._view.begin()
        return self._seen(), info

    def step(self, action: NDArray[Any]) -> Any:
        """Fly to the next action."""
        _, reward, terminated, truncated, info = self.env.step(action)
        return self._seen(), reward, terminated, truncated, info

    def _seen(self) -> Floats:
        """Return the observation now."""
        inner = self._inner
        return self._view.seen(
            inner.num_flown, inner.state, inner.scenario.sun_angle_rad, inner.is_inspected, inner.priority
        )
