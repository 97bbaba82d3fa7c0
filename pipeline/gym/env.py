"""Environments of one flight: an inspection, and one towards a goal, whose rewards are those of AFRL's."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import gymnasium
import numpy as np
from gymnasium.error import ResetNeeded
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


#: of the fields of a start that are always given
START_SHAPES: Final[Mapping[str, tuple[int, ...]]] = {
    **{"position_m": (3,), "velocity_m_s": (3,)},
    **{"sun_angle_rad": (), "sun_elevation_rad": ()},
}


def checked_options(options: dict[str, Any] | None, known: Sequence[str]) -> dict[str, Any]:
    """Return the options of a reset.

    Raises
    ------
    ValueError
        If one is unknown, or cannot be flown.
    """
    options = options or {}
    if unknown := sorted(set(options) - set(known)):
        raise ValueError(f"reset knows no option {unknown[0]!r}; it takes {', '.join(known)}")
    check_start("scenario", options.get("scenario"))
    check_priority(options.get("priority"))
    return options


def check_start(name: str, start: Any) -> None:
    """Raise ValueError, naming the field, unless a start is one that can be flown; None stands for drawn."""
    if start is None:
        return
    if not isinstance(start, Scenario):
        raise ValueError(
            f"{name} is of type {type(start).__name__}; give a pipeline.flight.state.log.Scenario"
        )
    for field, shape in START_SHAPES.items():
        _check_finite(f"{name}.{field}", getattr(start, field), shape)
    if start.settings is not None:
        _check_finite(f"{name}.settings", start.settings, (len(start.settings),))
    for number, other in enumerate(start.others):
        check_start(f"{name}.others[{number}]", other)


def check_priority(priority: Any) -> None:
    """Raise ValueError unless a priority is a direction; None stands for drawn."""
    if priority is not None:
        _check_finite("priority", priority, (3,))
        if not np.any(priority):
            raise ValueError("priority is zero, which is no direction; give a vector that is not")


def _check_finite(name: str, value: Any, shape: tuple[int, ...]) -> None:
    """Raise ValueError unless a value is of finite numbers, in an array of a shape."""
    try:
        numbers = np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError):
        numbers = np.full(1, np.nan)
    if numbers.shape != shape or not np.isfinite(numbers).all():
        wanted = f"finite numbers, shape {shape}" if shape else "a finite number"
        raise ValueError(f"{name} is {value}; give {wanted}")


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
        self,
        overrides: Sequence[str] = ("problem=docking",),
        reward: ReachReward | None = None,
        render_mode: str | None = None,
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
        left = 1.0 - steps / max(1, mission.num_controls - 1)
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
