"""Environments of several deputies, for PettingZoo: they inspect one chief together, or dock at it.

AFRL's safe-autonomy-sims has both, with rules of its own; with ``as_published`` they hold here, too.
"""

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, ClassVar, Final

import numpy as np
from gymnasium.spaces import Space
from numpy.typing import NDArray

from pipeline.array_types import Booleans, Floats
from pipeline.flight.fly.six_dof import POSITION
from pipeline.flight.fly.stepped_fleet import SteppedFleet
from pipeline.flight.state.log import Scenario
from pipeline.gym.env import Observation, ReachEnv, ReachReward, check_priority, check_start, require_episode
from pipeline.gym.episodes import AFRL, Episodes, Reward, Task, obeyed, task_of
from pipeline.gym.six_dof import AFRL_SIX_DOF, AFRL_SIX_DOF_FLEET, SixDofInspectionEnv, SixDofReward
from pipeline.gym.suite import COLLISION_M, FLEETS, NUM_DEPUTIES, REWARDS
from pipeline.scenarios import PRIORITY, direction_of

try:
    from pettingzoo import ParallelEnv
except ModuleNotFoundError as error:
    raise ModuleNotFoundError(
        "pipeline.gym.parallel needs PettingZoo; install it: python -m pip install pettingzoo"
    ) from error

#: of each agent: observations, rewards, whether it terminated, was truncated, and what is known beside them
Stepped = tuple[
    dict[str, Observation], dict[str, float], dict[str, bool], dict[str, bool], dict[str, dict[str, Any]]
]
#: most deputies of a fleet
MOST_DEPUTIES: Final = 6
#: how long AFRL's inspection by several lasts, s: its time is over after 1,000 s, at the next step
PUBLISHED_S: Final = 1010.0


class DeputiesEnv(ParallelEnv[str, Observation, NDArray[Any]], ABC):  # type: ignore[misc]
    """What environments of several deputies have in common: agents, starts, and one end for all.

    An end of one deputy ends the episode of all, and so does a collision: two deputies nearer to each other
    than a distance.

    Parameters
    ----------
    num_deputies : int
        From 1 to 6; they are called ``deputy_0``, ``deputy_1`` and so on.
    collision_m : float
    as_published : bool
        Whether an episode's end tells every agent both that it terminated and that it was truncated.

    Raises
    ------
    ValueError
        If there are none or too many.
    """

    metadata: ClassVar[dict[str, Any]] = {"render_modes": []}
    #: set by each environment
    task: Task

    def __init__(self, num_deputies: int, collision_m: float, *, as_published: bool) -> None:
        if not 1 <= num_deputies <= MOST_DEPUTIES:
            raise ValueError(f"num_deputies is {num_deputies}; it must be from 1 to {MOST_DEPUTIES}")
        self.possible_agents = [f"deputy_{number}" for number in range(num_deputies)]
        self.agents: list[str] = []
        self.render_mode = None
        self.collision_m, self._as_published = collision_m, as_published
        self._generator = np.random.default_rng()
        self._is_over: bool | None = None  # before the first episode

    def observation_space(self, agent: str) -> Space[Any]:
        """Return what an agent observes: that of one deputy, see `pipeline.gym.env`."""
        return self._observed[agent]

    def action_space(self, agent: str) -> Space[Any]:
        """Return what an agent commands: that of one deputy, see `pipeline.gym.env`."""
        return self._commanded[agent]

    def _set_spaces(self) -> None:
        # the same object at each call, as PettingZoo asks: a space that is sampled from has a generator
        self._observed: dict[str, Space[Any]] = {
            agent: self.task.observation_space() for agent in self.possible_agents
        }
        self._commanded: dict[str, Space[Any]] = {
            agent: self.task.action_space() for agent in self.possible_agents
        }

    def reset(
        self, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, Observation], dict[str, dict[str, Any]]]:
        """Start an episode: drawn, each deputy apart from the others, under one Sun.

        Parameters
        ----------
        seed : int, optional
        options : dict, optional
            ``scenarios``, of each deputy (`pipeline.flight.state.log.Scenario`); ``priority``, a direction,
            shape (3,), for worlds where points have a priority. Others are passed over, as PettingZoo's
            tests ask.
        """
        options = options or {}
        if seed is not None:
            self._generator = np.random.default_rng(seed)
        starts = options.get("scenarios") or self._drawn()
        if len(starts) != len(self.possible_agents):
            raise ValueError(f"{len(starts)} starts were given for {len(self.possible_agents)} deputies")
        for number, start in enumerate(starts):
            check_start(f"scenarios[{number}]", start)
        check_priority(options.get("priority"))
        self._start(starts, options.get("priority"))
        self.agents, self._is_over = self.possible_agents[:], False
        return self._seen(), self._infos()

    def _drawn(self) -> list[Scenario]:
        """Draw a start for each deputy; their Sun is the first's."""
        first, *others = (self.task.draw(self._generator) for _ in self.possible_agents)
        sun = {name: getattr(first, name) for name in ("sun_angle_rad", "sun_elevation_rad")}
        return [first, *(replace(start, **sun) for start in others)]

    def step(self, actions: Mapping[str, NDArray[Any]]) -> Stepped:
        """Fly all deputies to their next action.

        Raises
        ------
        ValueError
            If an agent's action is missing, or outside its space.
        """
        require_episode(self._is_over)
        if set(actions) != set(self.agents):
            raise ValueError(
                f"actions are of {', '.join(sorted(actions)) or 'no agent'}; each of "
                f"{', '.join(self.agents)} needs one"
            )
        rewards, terminated, truncated = self._fly(np.array([actions[agent] for agent in self.agents]))
        has_ended, is_cut = bool(terminated.any() or self._has_collided), bool(truncated.any())
        if self._as_published:
            has_ended = is_cut = has_ended or is_cut
        agents = self.agents
        if has_ended or is_cut:
            self.agents, self._is_over = [], True
        return (
            self._seen(),
            dict(zip(agents, rewards.tolist(), strict=True)),
            dict.fromkeys(agents, has_ended),
            dict.fromkeys(agents, is_cut and (self._as_published or not has_ended)),
            self._infos(),
        )

    @property
    def nearest_pair_m(self) -> float:
        """The least distance between two deputies now; infinite where there is one."""
        positions = self._positions
        apart = np.linalg.norm(positions[:, np.newaxis] - positions, axis=2)
        return float(apart[np.triu_indices(len(positions), 1)].min(initial=np.inf))

    @property
    def _has_collided(self) -> bool:
        return self.nearest_pair_m < self.collision_m

    def _seen(self) -> dict[str, Observation]:
        return dict(zip(self.possible_agents, self._observations, strict=True))

    def _infos(self) -> dict[str, dict[str, Any]]:
        """Return each deputy's facts, and those of the fleet."""
        fleet = {"nearest_pair_m": self.nearest_pair_m, "has_collided": self._has_collided}
        return {
            agent: facts | fleet for agent, facts in zip(self.possible_agents, self._facts(), strict=True)
        }

    @property
    @abstractmethod
    def _positions(self) -> Floats:
        """True positions, (D, 3), m, Hill axes."""

    @property
    @abstractmethod
    def _observations(self) -> Sequence[Observation]:
        """What each deputy observes now."""

    @abstractmethod
    def _facts(self) -> Sequence[dict[str, Any]]:
        """Return what is known of each deputy beside that."""

    @abstractmethod
    def _start(self, starts: Sequence[Scenario], priority: Floats | None) -> None:
        """Put the deputies at starts; the priority, (3,), is drawn unless given."""

    @abstractmethod
    def _fly(self, actions: NDArray[Any]) -> tuple[Floats, Booleans, Booleans]:
        """Fly to the next action; return each deputy's reward, and whether it terminated or was truncated."""


class MultiInspectionEnv(DeputiesEnv):
    """Inspect the chief together: each deputy commands a force each control period, in Hill axes.

    Every deputy knows which points any has inspected: its observations, those of
    `pipeline.gym.env.InspectionEnv`, count them, and its target is among the others. A point that is new to
    the fleet pays each deputy, and so does success; each pays for its own fuel and its own way out of the
    limits. ``info`` tells how many points a deputy saw first.

    Parameters
    ----------
    overrides : sequence of str
        Of the world, as on the command line.
    num_deputies : int
    reward : Reward
        By default AFRL's; `pipeline.gym.AFRL_WEIGHTED` is that of ``world=afrl_weighted``.
    collision_m : float
        Nearer than that to each other, deputies collide, which ends the episode and costs nothing.
    as_published : bool
        As in safe-autonomy-sims 4.2.3: an episode's end, of whatever kind, tells that it terminated *and*
        that it was truncated; it lasts 1,000 s; where all points count alike, success asks for one point more
        than there are.
    levels_n, decision_period_s : float, optional
        As for one.
    """

    metadata: ClassVar[dict[str, Any]] = {"name": "multi_inspection_v0", "render_modes": []}

    def __init__(
        self,
        overrides: Sequence[str] = ("world=afrl",),
        num_deputies: int = 2,
        reward: Reward = AFRL,
        collision_m: float = COLLISION_M,
        *,
        as_published: bool = False,
        levels_n: float | None = None,
        decision_period_s: float | None = None,
    ) -> None:
        super().__init__(num_deputies, collision_m, as_published=as_published)
        lasting = [f"duration_s={PUBLISHED_S}"] if as_published else []
        self.task = task_of([*obeyed(overrides), *lasting], reward, levels_n, decision_period_s)
        self._flights = SteppedFleet(self.task.mission, num_deputies, is_tilted=self.task.is_tilted)
        self._episodes = Episodes(self.task, num_deputies, self._flights)
        self._asks_too_much = as_published and self.task.mission.chief.weights != "priority"
        self._set_spaces()

    def _start(self, starts: Sequence[Scenario], priority: Floats | None) -> None:
        if priority is None:
            priority = direction_of(starts[0].generator(PRIORITY))
        for deputy, start in enumerate(starts):
            self._episodes.start(deputy, start, priority)
        self._episodes.begin()
        if self._asks_too_much:
            self._episodes.needed += 1.0

    def _fly(self, actions: NDArray[Any]) -> tuple[Floats, Booleans, Booleans]:
        return self._episodes.step(actions)

    @property
    def _positions(self) -> Floats:
        return self._flights.positions

    @property
    def _observations(self) -> Sequence[Observation]:
        return list(self._flights.seen)

    def _facts(self) -> Sequence[dict[str, Any]]:
        facts = self._episodes.facts | {"num_seen_first": self._flights.seen_first}
        each = range(len(self.possible_agents))
        return [{name: float(values[deputy]) for name, values in facts.items()} for deputy in each]


def parallel_env(task: str = "fleet") -> MultiInspectionEnv:
    """Make the environment of a fleet's task, whose held-out starts `pipeline.gym.judge` flies.

    Parameters
    ----------
    task : str
        Of `pipeline.gym.suite.FLEETS`.

    Raises
    ------
    ValueError
        If there is no such task of fleets.
    """
    if task not in FLEETS:
        raise ValueError(
            f"{task!r} is no task of fleets; those are {', '.join(FLEETS)}. gymnasium.make makes the others"
        )
    return MultiInspectionEnv(FLEETS[task], NUM_DEPUTIES, REWARDS.get(task, Reward()))


#: of AFRL's docking by several: too much speed costs a hundredth of what it does for one, and a bit more
PUBLISHED_REACH: Final = ReachReward(per_excess=0.01, for_excess=0.01, counts_pay=True)


class MultiReachEnv(DeputiesEnv):
    """Reach the chief, each deputy by itself, without meeting the others; see `pipeline.gym.env.ReachEnv`.

    The first deputy at the goal ends the episode of all.

    Parameters
    ----------
    overrides : sequence of str
        Of the problem, as on the command line.
    num_deputies : int
    reward : ReachReward, optional
    collision_m : float
        Nearer than that to each other, deputies collide, which ends the episode and costs nothing.
    as_published : bool
        As in safe-autonomy-sims 4.2.3: an episode's end, of whatever kind, tells that it terminated *and*
        that it was truncated; its time is over a step earlier; being too fast costs, and uses up of what is
        allowed, a hundredth of what it does for one deputy, and 0.01 at each step.
    """

    metadata: ClassVar[dict[str, Any]] = {"name": "multi_reach_v0", "render_modes": []}

    def __init__(
        self,
        overrides: Sequence[str] = ("problem=docking",),
        num_deputies: int = 2,
        reward: ReachReward | None = None,
        collision_m: float = 0.5,
        *,
        as_published: bool = False,
    ) -> None:
        super().__init__(num_deputies, collision_m, as_published=as_published)
        if as_published and reward is None:
            reward = PUBLISHED_REACH
        self._envs = [ReachEnv(overrides, reward) for _ in self.possible_agents]
        self.task = self._envs[0].task
        for env in self._envs:
            env.most_steps -= as_published
        self._set_spaces()
        self._told: list[tuple[Observation, dict[str, Any]]] = []

    def _start(self, starts: Sequence[Scenario], priority: Floats | None) -> None:
        if priority is not None:
            raise ValueError("priority: no point of this problem has one; leave it out")
        each = zip(self._envs, starts, strict=True)
        self._told = [env.reset(options={"scenario": start}) for env, start in each]

    def _fly(self, actions: NDArray[Any]) -> tuple[Floats, Booleans, Booleans]:
        steps = [env.step(action) for env, action in zip(self._envs, actions, strict=True)]
        self._told = [(observation, info) for observation, *_, info in steps]
        _, rewards, terminated, truncated, _ = zip(*steps, strict=True)
        return np.array(rewards), np.array(terminated), np.array(truncated)

    @property
    def _positions(self) -> Floats:
        return np.array([env.position_m for env in self._envs])

    @property
    def _observations(self) -> Sequence[Observation]:
        return [observation for observation, _ in self._told]

    def _facts(self) -> Sequence[dict[str, Any]]:
        return [info for _, info in self._told]


class MultiSixDofInspectionEnv(DeputiesEnv):
    """Inspect the chief together, each deputy turning itself; see `pipeline.gym.six_dof.SixDofInspectionEnv`.

    As in `MultiInspectionEnv`, all know which points any has inspected; a point that is new to the fleet pays
    each deputy, and so does success, but for a deputy whose free motion would then lead into the chief.

    Parameters
    ----------
    overrides : sequence of str
        Of the world, as on the command line.
    num_deputies : int
    reward : SixDofReward, optional
        By default AFRL's of one deputy, and as published that of several.
    collision_m : float
        Nearer than that to each other, deputies collide, which ends the episode and costs nothing.
    as_published : bool
        As in safe-autonomy-sims 4.2.3: an episode's end, of whatever kind, tells that it terminated *and*
        that it was truncated; it lasts 1,000 s; the attitude's Euler angles stand for the camera's direction
        where facing the chief is paid.
    """

    metadata: ClassVar[dict[str, Any]] = {"name": "multi_six_dof_inspection_v0", "render_modes": []}

    def __init__(
        self,
        overrides: Sequence[str] = ("world=afrl_six_dof",),
        num_deputies: int = 2,
        reward: SixDofReward | None = None,
        collision_m: float = 10.0,
        *,
        as_published: bool = False,
    ) -> None:
        super().__init__(num_deputies, collision_m, as_published=as_published)
        lasting = [f"duration_s={PUBLISHED_S}"] if as_published else []
        paid = reward or (AFRL_SIX_DOF_FLEET if as_published else AFRL_SIX_DOF)
        self._envs = [SixDofInspectionEnv([*overrides, *lasting], paid) for _ in self.possible_agents]
        self.task = self._envs[0].task
        self._set_spaces()

    def _set_spaces(self) -> None:
        self._observed = dict.fromkeys(self.possible_agents, self._envs[0].observation_space)
        self._commanded = dict.fromkeys(self.possible_agents, self._envs[0].action_space)

    def _start(self, starts: Sequence[Scenario], priority: Floats | None) -> None:
        if priority is None:
            priority = direction_of(starts[0].generator(PRIORITY))
        for env, start in zip(self._envs, starts, strict=True):
            env.reset(options={"scenario": start, "priority": priority})
        self._seen_by = np.full(len(self._envs[0].is_inspected), -1)
        self._exchange()

    def _fly(self, actions: NDArray[Any]) -> tuple[Floats, Booleans, Booleans]:
        for env, action in zip(self._envs, actions, strict=True):
            env.fly(action)
        self._exchange()
        rewards, terminated, truncated = zip(*(env.judge() for env in self._envs), strict=True)
        return np.array(rewards), np.array(terminated), np.array(truncated)

    def _exchange(self) -> None:
        """Tell all what any has inspected; a point is the first deputy's that saw it."""
        for deputy, env in enumerate(self._envs):
            self._seen_by[(self._seen_by < 0) & env.is_inspected] = deputy
        for env in self._envs:
            env.is_inspected[:] = self._seen_by >= 0

    @property
    def _positions(self) -> Floats:
        return np.array([env.state[POSITION] for env in self._envs])

    @property
    def _observations(self) -> Sequence[Observation]:
        return [env.observation for env in self._envs]

    def _facts(self) -> Sequence[dict[str, Any]]:
        first = [
            {"num_seen_first": float((self._seen_by == deputy).sum())} for deputy in range(len(self._envs))
        ]
        return [env.facts | of_it for env, of_it in zip(self._envs, first, strict=True)]
