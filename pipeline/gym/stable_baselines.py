"""Flights side by side as Stable-Baselines3 steps them: no learner sees the step that starts an episode."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from gymnasium.vector import AutoresetMode
from numpy.typing import NDArray

from pipeline.gym.env import Observation
from pipeline.gym.normalized import normalised
from pipeline.gym.vector import InspectionVectorEnv

try:
    from stable_baselines3.common.vec_env import VecEnv
except ModuleNotFoundError:  # it brings torch; the steps below do without
    VecEnv = object


class FlightSteps(NamedTuple):
    """What a step of many flights gives, as Stable-Baselines3 has it."""

    #: what is observed now, (n, 19); where an episode ended, at the start of the next
    seen: Observation
    rewards: NDArray[np.float32]
    has_ended: NDArray[np.bool_]
    #: what is known of each flight beside that, at its end where it ended
    infos: list[dict[str, Any]]
    #: what is known of the flights that started, by their index
    started: dict[int, dict[str, Any]]


class SameStepFlights:
    """Flights side by side, of which an episode's last step starts the next.

    Parameters
    ----------
    num_envs : int
    is_normalized : bool
        Whether observations are divided by `pipeline.gym.episodes.Task.scales`.
    settings
        As of `pipeline.gym.vector.InspectionVectorEnv`.
    """

    def __init__(self, num_envs: int, *, is_normalized: bool, **settings: Any) -> None:
        self.many = InspectionVectorEnv(num_envs, **settings, autoreset_mode=AutoresetMode.SAME_STEP)
        self.space = self.many.single_observation_space
        self._scales = np.ones(self.space.shape or (), dtype=np.float32)
        if is_normalized:
            self._scales, self.space = normalised(self.many.task, self.space)

    def reset(self, seeds: Sequence[int | None]) -> tuple[Observation, list[dict[str, Any]]]:
        """Start all episodes; a seed of None goes on drawing."""
        seen, facts = self.many.reset(seed=seeds)
        return seen / self._scales, _by_flight(facts)

    def step(self, actions: NDArray[Any]) -> FlightSteps:
        """Fly to the next action in all.

        ``infos`` have ``TimeLimit.truncated``, and where an episode ended ``terminal_observation``.
        """
        seen, rewards, terminated, truncated, facts = self.many.step(actions)
        has_ended, now = terminated | truncated, _by_flight(facts)
        infos = _by_flight(facts["final_info"]) if "final_info" in facts else now
        for info, is_cut in zip(infos, (truncated & ~terminated).tolist(), strict=True):
            info["TimeLimit.truncated"] = is_cut
        started = {int(flight): now[flight] for flight in np.flatnonzero(has_ended)}
        for flight in started:
            infos[flight]["terminal_observation"] = facts["final_obs"][flight] / self._scales
        return FlightSteps(seen / self._scales, rewards.astype(np.float32), has_ended, infos, started)


def _by_flight(facts: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Return facts that vector environments have as an array each, as a dictionary of each flight."""
    names = [name for name in facts if not name.startswith("_") and not name.startswith("final_")]
    columns = (facts[name].astype(np.float64).tolist() for name in names)
    return [dict(zip(names, row, strict=True)) for row in zip(*columns, strict=True)]


class BaselinesVecEnv(VecEnv):
    """Flights side by side for a model of Stable-Baselines3: ``PPO("MlpPolicy", BaselinesVecEnv(64))``.

    Flight i of a seed is that of seed + i alone. A step that ends an episode gives the first observation of
    the next, and the last one as ``infos[i]["terminal_observation"]``; ``infos[i]["TimeLimit.truncated"]``
    says that time alone ended it. What is known beside observations stands in ``infos`` as
    `pipeline.gym.env.InspectionEnv` tells it. ``VecMonitor`` counts returns.

    Parameters
    ----------
    num_envs : int
    overrides : sequence of str
        Of the world, as on the command line.
    is_normalized : bool
        Whether observations are divided by `pipeline.gym.episodes.Task.scales`, so that they are about one.
    settings
        ``reward``, ``levels_n``, ``render_mode``, ``max_episode_steps`` and ``decision_period_s``, as of
        `pipeline.gym.vector.InspectionVectorEnv`.

    Raises
    ------
    ModuleNotFoundError
        Without Stable-Baselines3.
    ValueError
        As of `pipeline.gym.vector.InspectionVectorEnv`.
    """

    def __init__(
        self, num_envs: int = 1, overrides: Sequence[str] = (), *, is_normalized: bool = True, **settings: Any
    ) -> None:
        if VecEnv is object:
            raise ModuleNotFoundError(
                "BaselinesVecEnv needs Stable-Baselines3; install it: python -m pip install stable-baselines3"
            )
        self._flights = SameStepFlights(
            num_envs, overrides=overrides, is_normalized=is_normalized, **settings
        )
        self.task = self._flights.many.task
        super().__init__(num_envs, self._flights.space, self._flights.many.single_action_space)

    def reset(self) -> Observation:
        """Start all episodes, from the seeds of `seed` if they were not used yet."""
        if unknown := sorted({name for options in self._options for name in options}):
            raise ValueError(f"reset knows no option {unknown[0]!r}; it takes none")
        seen, self.reset_infos = self._flights.reset(self._seeds)
        self._reset_seeds()
        return seen

    def step_async(self, actions: NDArray[Any]) -> None:
        """Store the actions."""
        self._actions = actions

    def step_wait(self) -> tuple[Observation, NDArray[np.float32], NDArray[np.bool_], list[dict[str, Any]]]:
        """Fly them to the next."""
        steps = self._flights.step(self._actions)
        for flight, info in steps.started.items():
            self.reset_infos[flight] = info
        return steps.seen, steps.rewards, steps.has_ended, steps.infos

    def close(self) -> None:
        """Close the flights."""
        self._flights.many.close()

    def get_images(self) -> Sequence[NDArray[np.uint8] | None]:
        """Return a picture of each episode so far, where ``render_mode`` asks for it."""
        return self._flights.many.render() or [None] * self.num_envs

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        """Return what the flights have in common, for each of them."""
        value = getattr(self._flights.many, attr_name)
        return [value for _ in self._flight_numbers(indices)]

    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:
        """Refuse it: no flight has attributes of its own."""
        raise AttributeError(f"{attr_name} cannot be set: one call steps all flights; {self._cure}")

    def env_method(self, method_name: str, *args: Any, indices: Any = None, **kwargs: Any) -> list[Any]:
        """Refuse it: no flight has methods of its own."""
        raise AttributeError(f"{method_name} cannot be called: one call steps all flights; {self._cure}")

    #: where single environments are wanted
    _cure = "for environments apart from each other take make_vec_env"

    def env_is_wrapped(self, wrapper_class: Any, indices: Any = None) -> list[bool]:
        """Return, of each flight, that nothing wraps it."""
        return [False for _ in self._flight_numbers(indices)]

    def _flight_numbers(self, indices: Any) -> Iterable[int]:
        return list(self._get_indices(indices))
