"""Environments: one flight, many at once stepped by one call, the same normalised, and one towards a goal.

The rewards of the latter are those of AFRL's problem of that kind.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
from gymnasium.error import ResetNeeded
from gymnasium.spaces import Box
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from gymnasium.wrappers import TransformObservation
from gymnasium.wrappers.vector import TransformObservation as TransformVectorObservation
from numpy.typing import NDArray

from pipeline.array_types import Booleans, Floats
from pipeline.flight.fly.stepping import POSITION, SPENT, VELOCITY
from pipeline.flight.goals.reach import limit_at
from pipeline.flight.state.log import FlightLog, Scenario
from pipeline.gym.episodes import Episodes, Reward, Task, obeyed, task_of

Observation = NDArray[np.float32]
#: what is observed at the start of an episode, and what is known beside it
Started = tuple[Observation, dict[str, Any]]


def picture(episodes: Episodes, episode: int) -> NDArray[np.uint8]:
    """Draw an episode so far, (height, width, 3)."""
    # slower to import than many flights
    from pipeline.report.figures.style import PALETTE, pixels  # noqa: PLC0415
    from pipeline.report.figures.trajectories import Tracks, trajectories  # noqa: PLC0415

    facts = {name: float(values[episode]) for name, values in episodes.facts.items()}
    positions = episodes.log(episode)[1].position_m[: episodes.num_samples(episode)]
    if len(positions) == 1:  # a line has two ends
        positions = np.repeat(positions, 2, axis=0)
    words, colour = f"{facts['num_inspected']:.0f} points, {facts['delta_v_m_s']:.3f} m/s", PALETTE[0]
    tracks = Tracks(positions[np.newaxis], [colour], {words: colour})
    return pixels(trajectories(tracks, episodes.task.mission))


class InspectionEnv(gymnasium.Env[Observation, NDArray[Any]]):
    """Inspect the chief: command a force each control period, in Hill axes.

    Observations are physical, in the order of `pipeline.flight.fly.stepping.OBSERVED`. An episode terminates
    outside the distance limits and when every point that counts is inspected; it is truncated when its time
    is over. With ``after_s`` it lasts until then, and is outside if free motion leads there within that time.

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
    decision_period_s : float, optional
        Time between actions, a multiple of the control period: each is fired in the first control period,
        nothing in the others. By default there is an action in each.
    """

    metadata = {"render_modes": ["rgb_array"], "render_fps": 10}  # noqa: RUF012 - as Gymnasium declares it

    def __init__(
        self,
        overrides: Sequence[str] = (),
        reward: Reward | None = None,
        levels_n: float | None = None,
        render_mode: str | None = None,
        decision_period_s: float | None = None,
    ) -> None:
        self.task: Task = task_of(obeyed(overrides), reward, levels_n, decision_period_s)
        self.observation_space = self.task.observation_space()
        self.action_space = self.task.action_space()
        self._episodes = Episodes(self.task, 1)
        self._is_over: bool | None = None  # before the first episode
        self.render_mode = render_mode

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> Started:
        """Start an episode: drawn, or ``options["scenario"]`` (`pipeline.flight.state.log.Scenario`).

        ``options["priority"]`` is a direction, shape (3,), for worlds where points have a priority.
        """
        options = checked_options(options, ("scenario", "priority"))
        super().reset(seed=seed)
        scenario = options.get("scenario") or self.task.draw(self.np_random)
        self._episodes.start(0, scenario, options.get("priority"))
        self._episodes.begin()
        self._is_over = False
        return self._episodes.flights.seen[0], self._info()

    def step(self, action: NDArray[Any]) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Fly to the next action under an action, (3,); after the last, the observation is the final one."""
        require_episode(self._is_over)
        rewards, terminated, truncated = self._episodes.step(np.asarray(action)[np.newaxis])
        self._is_over = bool(terminated[0] or truncated[0])
        observation = self._episodes.flights.seen[0]
        return observation, float(rewards[0]), bool(terminated[0]), bool(truncated[0]), self._info()

    def _info(self) -> dict[str, Any]:
        return {name: float(values[0]) for name, values in self._episodes.facts.items()}

    @property
    def scenario(self) -> Scenario:
        """The start of the episode."""
        return self._episodes.scenario(0)

    @property
    def num_flown(self) -> int:
        """Control periods of the episode so far."""
        return self._episodes.num_samples(0) - 1

    @property
    def state(self) -> Floats:
        """Position (m) and velocity (m/s) as the deputy knows them, shape (6,), Hill axes."""
        return self._episodes.flights.observed[0, : VELOCITY + 3].copy()

    @property
    def is_inspected(self) -> Booleans:
        """Which points are inspected, (P,)."""
        return self._episodes.flights.is_inspected[0]

    @property
    def weight_inspected(self) -> float:
        """The weight of these points, or their number where all count alike."""
        return float(self._episodes.inspected[0])

    @property
    def priority(self) -> Floats:
        """The direction of the priority, (3,); zero where points have none."""
        return self._episodes.priorities[0].copy()

    @property
    def position_m(self) -> Floats:
        """The true position now, shape (3,), Hill axes."""
        return np.asarray(self._episodes.flights.positions[0])

    def render(self) -> NDArray[np.uint8] | None:
        """Return a picture of the episode so far, (height, width, 3), where `render_mode` asks for it."""
        return None if self.render_mode is None else picture(self._episodes, 0)

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
    render_mode : str, optional
        ``rgb_array``, for `render`.
    max_episode_steps : int, optional
        Episodes are truncated after so many, or at the end of their flight.
    decision_period_s : float, optional
        As for one.
    """

    metadata = {  # noqa: RUF012 - as above
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
    ) -> None:
        for name, count in (("num_envs", num_envs), ("max_episode_steps", max_episode_steps)):
            if count is not None and count < 1:
                raise ValueError(f"{name} is {count}; it must be at least 1")
        self.num_envs, self.render_mode, self._most_steps = num_envs, render_mode, max_episode_steps
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
        """Fly to the next action in all, or start the next episode of those that ended with the last step."""
        require_episode(None if not self._generators else False)
        for flight in np.flatnonzero(self._has_ended):
            self._start(int(flight))
        rewards, terminated, truncated = self._episodes.step(actions)
        if self._most_steps is not None:
            truncated |= ~terminated & (
                self._episodes.flights.samples >= self._most_steps * self.task.num_periods
            )
        self._has_ended = terminated | truncated
        return self._episodes.flights.seen, rewards, terminated, truncated, self._infos()

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


class _Divide:
    """Divides observations by scales; unlike a function in a function it can be pickled."""

    def __init__(self, scales: Observation) -> None:
        self._scales = scales

    def __call__(self, observations: Observation) -> Observation:
        return observations / self._scales


def _normalised(task: Task | None, space: Any) -> tuple[_Divide, "Box[np.float32]"]:
    """Return the scales to divide observations by, and the space of the divided ones."""
    scales = np.zeros(0) if task is None else task.scales
    if not (isinstance(space, Box) and space.shape == scales.shape):
        raise ValueError(
            "only observations of Inspection-v0 and Reach-v0, as they are, can be divided by their scales; "
            "wrap such an environment before others change what is observed"
        )
    divided = Box(
        (space.low / scales).astype(np.float32), (space.high / scales).astype(np.float32), dtype=np.float32
    )
    return _Divide(scales.astype(np.float32)), divided


class NormalizedObservation(TransformObservation):
    """Divides observations by `pipeline.gym.episodes.Task.scales`.

    Raises
    ------
    ValueError
        If the environment, or what it wraps, does not observe those quantities.
    """

    def __init__(self, env: gymnasium.Env[Observation, NDArray[Any]]) -> None:
        super().__init__(env, *_normalised(getattr(env.unwrapped, "task", None), env.observation_space))


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
        divide, space = _normalised(task, env.single_observation_space)
        super().__init__(env, divide, single_observation_space=space)


def _common_task(many: Any) -> Task | None:
    """Return the task of Gymnasium's own vector environment, which holds single ones."""
    try:
        return next((task for task in many.get_attr("task") if isinstance(task, Task)), None)
    except AttributeError:
        return None


def checked_options(options: dict[str, Any] | None, known: Sequence[str]) -> dict[str, Any]:
    """Return the options of a reset.

    Raises
    ------
    ValueError
        If one is unknown.
    """
    options = options or {}
    if unknown := sorted(set(options) - set(known)):
        raise ValueError(f"reset knows no option {unknown[0]!r}; it takes {', '.join(known)}")
    return options


def require_episode(is_over: bool | None) -> None:
    """Raise ResetNeeded if the episode is over, or none has begun (None)."""
    if is_over is None:
        raise ResetNeeded("there is no episode yet; call reset first")
    if is_over:
        raise ResetNeeded("the episode is over; call reset for the next")


@dataclass(frozen=True)
class ReachReward:
    """The reward of flights towards a goal; by default that of safe-autonomy-sims 4.2.3.

    Parameters
    ----------
    approach : float
        Times the change of ``0.5^(distance / halved_m)``.
    halved_m : float
    per_delta_v : float
        Taken away, of a thrust's force over its mass (N/kg, as theirs) for each step.
    per_excess : float
        Taken away for each m/s above the limit on the speed, at each step.
    for_excess : float
        Taken away at each step above that limit.
    counts_pay : bool
        Whether what is so taken away, and not the excess, uses up ``problem.most_excess_m_s``.
    success, failure : float
        Given at the goal, with as much again for the share of the time that is left, the last period not
        counted; taken away where the deputy is too fast there or too far away, and where the time is over.
    """

    approach: float = 2.0
    halved_m: float = 100.0
    per_delta_v: float = 0.01
    per_excess: float = 1.0
    for_excess: float = 0.0
    counts_pay: bool = False
    success: float = 1.0
    failure: float = 1.0


class ReachEnv(InspectionEnv):
    """Reach the chief: command a force each control period, in Hill axes.

    Observations and actions are those of `pipeline.gym.env.InspectionEnv`. An episode terminates at the goal;
    it is truncated beyond the greatest distance, with more excess of speed than ``problem.most_excess_m_s``,
    and when its time is over.

    Parameters
    ----------
    overrides : sequence of str
        Of the problem, as on the command line.
    reward : ReachReward, optional
    render_mode : str, optional
        As of `pipeline.gym.env.InspectionEnv`.

    Attributes
    ----------
    most_steps : int
        Control periods after which the time is over; by default those of a flight.

    Raises
    ------
    ValueError
        If the overrides are of flights without a goal.
    """

    def __init__(
        self, overrides: Sequence[str], reward: ReachReward | None = None, render_mode: str | None = None
    ) -> None:
        super().__init__(overrides, render_mode=render_mode)
        if self.task.mission.problem.kind != "reach":
            raise ValueError("overrides compose no flight with a goal; choose one by problem=NAME")
        self._paid = reward or ReachReward()
        self.most_steps: int = self.task.mission.num_controls
        self._used = 0.0

    def step(self, action: NDArray[Any]) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Fly a control period."""
        mission, paid = self.task.mission, self._paid
        problem, (before, _, spent_before) = mission.problem, self._state()
        observation, *_, info = super().step(action)
        distance, speed, spent = self._state()
        steps = self._episodes.num_samples(0) - 1
        is_late = steps == self.most_steps
        excess = max(speed - float(limit_at(problem, np.array(distance))), 0.0)
        for_speed = paid.per_excess * excess + paid.for_excess * (excess > 0.0)
        used = for_speed if paid.counts_pay else excess
        self._used = used if steps == 1 else self._used + used
        is_there, is_far = distance <= problem.goal_radius_m, distance > mission.deputy.max_distance_m
        is_docked = is_there and speed <= problem.goal_speed_m_s
        is_failed = (is_there and not is_docked) or is_far or is_late
        nearer = 0.5 ** (distance / paid.halved_m) - 0.5 ** (before / paid.halved_m)
        left = 1.0 - steps / (mission.num_controls - 1)
        reward = (
            paid.approach * nearer
            - paid.per_delta_v * (spent - spent_before) / mission.control_period_s
            - for_speed
            + is_docked * paid.success * (1.0 + left)
            - is_failed * paid.failure
        )
        is_cut = is_far or is_late or self._used > problem.most_excess_m_s
        is_success = is_docked and self._used <= problem.most_excess_m_s
        progress = {"is_success": float(is_success), "excess_m_s": excess, "excess_used_m_s": self._used}
        self._is_over = is_there or is_cut
        return observation, reward, is_there, is_cut, info | progress

    def _state(self) -> tuple[float, float, float]:
        """Return distance (m), speed and delta-v (m/s)."""
        now = self._episodes.flights.observed[0]
        distance, velocity = (np.linalg.norm(now[first : first + 3]) for first in (POSITION, VELOCITY))
        return float(distance), float(velocity), float(now[SPENT])
