"""The task and its episodes side by side: drawn, flown, rewarded, ended and recorded.

The task says what is observed, in which order and units; what may be commanded; what is rewarded.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import ceil, pi
from pathlib import Path
from typing import Any, Final

import numpy as np
from gymnasium.spaces import Box, MultiDiscrete
from numpy.typing import NDArray

from pipeline.array_types import Booleans, Floats
from pipeline.command_line.config import compose_experiment
from pipeline.command_line.overrides import parse
from pipeline.flight.control.controller import open_loop
from pipeline.flight.fly import stepping
from pipeline.flight.fly.published import priority_weights
from pipeline.flight.fly.simulation import fly_logged
from pipeline.flight.state.log import FlightLog, Scenario, points_needed
from pipeline.flight.world.pack import inspection_points
from pipeline.physics.motion import HasMass, HasMeanMotion, free_path, motion_over
from pipeline.recording.recorder import FlightRecorder
from pipeline.scenarios import PRIORITY, direction_of, draw, started
from pipeline.settings.experiment import Experiment, Mission
from pipeline.settings.groups import names_of

#: what is composed where nothing else is asked for: nothing of it is flown but the world
BASE: Final = ("+experiment=evaluate", "controller=coast")
#: keys of the starts that are drawn, in the group monte_carlo
DRAWN: Final = ("min_distance_m", "max_distance_m", "max_speed_m_s", "directions", "box", "parked")
#: groups and keys of the configuration that episodes depend on
OBEYED: Final = {"world", "sun", *names_of(Mission), *(f"monte_carlo.{name}" for name in DRAWN)}
#: first part of the spawn key of starts, beside those of `pipeline.scenarios`
EPISODES = 1 << 22
#: shares beyond 1 by no more are rounded, as float32 does
ROUNDED = 1e-6
#: seeds of starts are drawn below this
MOST_SEED = 1 << 31


@dataclass(frozen=True)
class Reward:
    """The reward of a step, by its parts.

    Parameters
    ----------
    per_point : float
        For each point newly inspected; for their weight, where points have a priority.
    per_delta_v : float
        Taken away for each m/s spent.
    success : float
        Once, when enough points are inspected; where a mission asks for what follows (``after_s``), at the
        end of its time.
    outside : float
        Taken away where the flight ends outside the distance limits.
    too_far : float, optional
        The same beyond the greatest distance; by default as `outside`.
    as_afrl : bool
        Whether, as in AFRL's environments, the first step pays for the points seen at the start, success ends
        an episode, too great a distance truncates it, and, where points have a priority, success is paid
        only if free flight stays outside the least distance for an orbit, and else taken away.
    """

    per_point: float = 0.1
    per_delta_v: float = 0.1
    success: float = 1.0
    outside: float = 1.0
    too_far: float | None = None
    as_afrl: bool = False


#: of AFRL's InspectionEnv and WeightedInspectionEnv (safe-autonomy-sims 4.2.3)
AFRL: Final = Reward(per_point=0.01, per_delta_v=0.001, too_far=0.0, as_afrl=True)
AFRL_WEIGHTED: Final = replace(AFRL, per_point=1.0)


def nearest_in_orbit(orbit: HasMeanMotion, deputy: HasMass, state: Floats) -> float:
    """Return the least distance of free motion from a state, (6,), sampled each second of an orbit, m."""
    num_seconds = ceil(2.0 * pi / orbit.mean_motion_rad_s)
    path = free_path(motion_over(orbit, deputy, (1.0,)), state, num_seconds)
    return float(np.linalg.norm(path[:, :3], axis=1).min())


def shaped(actions: NDArray[Any], shape: tuple[int, ...]) -> Floats:
    """Return actions as numbers.

    Raises
    ------
    ValueError
        If they have another shape.
    """
    values = np.asarray(actions, dtype=np.float64)
    if values.shape != shape:
        raise ValueError(f"actions have the shape {values.shape}; it must be {shape}")
    return values


def shares_of(actions: NDArray[Any], shape: tuple[int, ...]) -> Floats:
    """Return actions that are shares of what can be commanded.

    Raises
    ------
    ValueError
        If they have another shape, or one is not from -1 to 1.
    """
    values = shaped(actions, shape)
    if not np.all(np.abs(values) <= 1.0 + ROUNDED):
        raise ValueError(
            f"an action is {_farthest(values, 0.0):g}; each number is a share of what can be commanded and "
            "must be from -1 to 1 (gymnasium.wrappers.ClipAction clips them)"
        )
    return np.asarray(np.clip(values, -1.0, 1.0))


def _farthest(values: Floats, middle: float) -> float:
    """Return the number that is farthest from the middle, or is none."""
    return float(values.flat[np.argmax(np.nan_to_num(np.abs(values - middle), nan=np.inf))])


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
    num_periods : int
        Control periods of a step: in the first the command is fired, in the others nothing.
    """

    experiment: Experiment
    config: dict[str, Any]
    reward: Reward
    levels_n: float | None
    num_periods: int = 1

    @property
    def mission(self) -> Mission:
        """The mission that is flown."""
        return self.experiment.mission

    @property
    def is_tilted(self) -> bool:
        """Whether the Sun of some start is out of the orbit plane."""
        return self.experiment.sun.elevations_deg != (0.0, 0.0)

    @property
    def scales(self) -> Floats:
        """Amounts by which observations are divided to be about one, see `pipeline.flight.fly.stepping`."""
        return stepping.observation_scales(self.mission)

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

    def draw(self, generator: np.random.Generator) -> Scenario:
        """Draw a start, as an evaluation does."""
        seed = int(generator.integers(MOST_SEED))
        cases = self.experiment.monte_carlo
        return started(self.experiment, cases, draw(seed, EPISODES, 0, cases, self.experiment.sun))

    def forces(self, actions: NDArray[Any], num_flights: int) -> Floats:
        """Return the forces of actions, shape (n, 3), N, Hill axes.

        Raises
        ------
        ValueError
            If they have another shape, or are outside `action_space`.
        """
        if self.levels_n is None:
            return shares_of(actions, (num_flights, 3)) * self.mission.deputy.max_force_n
        values = shaped(actions, (num_flights, 3))
        if not np.isin(values, (0.0, 1.0, 2.0)).all():
            raise ValueError(
                f"an action is {_farthest(values, 1.0):g}; each number must be 0, 1 or 2, of which 1 fires "
                "nothing"
            )
        return np.asarray((values - 1.0) * self.levels_n)


def obeyed(overrides: Sequence[str]) -> Sequence[str]:
    """Return the overrides of an environment, on each of which its episodes depend.

    Raises
    ------
    ValueError
        If one is of something else, such as the controller or a fleet.
    """
    for override in parse(overrides):
        key = override.key_or_group
        if key.partition(".")[0] == "fleet":
            raise ValueError(
                f"{override.input_line} is of fleets; leave it out, and for several deputies take "
                "pipeline.gym.parallel.MultiInspectionEnv(num_deputies=...)"
            )
        if OBEYED.isdisjoint((key, key.partition(".")[0])):
            raise ValueError(
                f"{override.input_line} changes no episode; leave it out: only the world, the Sun and the "
                "shell of starts count, and reset takes a seed"
            )
    return overrides


def task_of(
    overrides: Sequence[str] = (),
    reward: Reward | None = None,
    levels_n: float | None = None,
    decision_period_s: float | None = None,
) -> Task:
    """Compose a task.

    Parameters
    ----------
    overrides : sequence of str
        As on the command line: ``world=leo``, ``safety=filter``, ``sun=random``.
    reward : Reward, optional
    levels_n : float, optional
        See `Task`.
    decision_period_s : float, optional
        Time between commands, a multiple of the control period, which it is unless given.

    Raises
    ------
    ValueError
        If the overrides do not compose, the level is beyond what the thruster can do, the time between
        commands is no multiple, or the reward looks at no end that the mission asks for.
    """
    composed = compose_experiment([*BASE, *overrides])
    composed.experiment.mission.require_one_deputy("pipeline.gym")
    most = composed.experiment.mission.deputy.max_force_n
    if levels_n is not None and not 0.0 < levels_n <= most:
        raise ValueError(
            f"levels_n is {levels_n}; it must be above 0 and at most {most} N, deputy.max_force_n"
        )
    after_s = composed.experiment.mission.after_s
    if reward is not None and reward.as_afrl and after_s > 0.0:
        raise ValueError(
            f"after_s is {after_s:g}, and AFRL's episodes end as soon as enough is seen; leave it out, or "
            "give another reward"
        )
    num_periods = stepping.periods_between(composed.experiment.mission, decision_period_s)
    return Task(composed.experiment, composed.config, reward or Reward(), levels_n, num_periods)


class Episodes:
    """Episodes of a task side by side, each at its own step.

    Parameters
    ----------
    task : Task
    num_episodes : int
    flights : pipeline.flight.fly.stepping.SteppedFlights, optional
        By default each flies alone; in a fleet, each counts what all have inspected.

    Attributes
    ----------
    flights : pipeline.flight.fly.stepping.SteppedFlights
        With what is observed and what is known now.
    needed : (num_episodes,) array
        Points, or their weight, that are enough.
    """

    def __init__(self, task: Task, num_episodes: int, flights: stepping.SteppedFlights | None = None) -> None:
        self.task = task
        self.flights = flights or stepping.SteppedFlights(
            task.mission, num_episodes, is_tilted=task.is_tilted
        )
        self._scenarios: list[Scenario | None] = [None] * num_episodes
        self._forces = np.zeros((num_episodes, task.mission.num_controls, 3))
        self.needed = np.zeros(num_episodes)
        self._spent = np.zeros(num_episodes)
        #: points that are paid for, or their weight
        self._paid = np.zeros(num_episodes)
        self._points = inspection_points(task.mission)
        self._weights: Floats | None = None
        #: directions of the priority, where points have one
        self.priorities = np.zeros((num_episodes, 3))
        if task.mission.chief.weights == "priority":
            self._weights = np.zeros((num_episodes, len(self._points)))

    def start(self, episode: int, scenario: Scenario, priority: Floats | None = None) -> None:
        """Put an episode at a start; the next step brings it to its first sample.

        Where points have a priority, its direction, shape (3,), is drawn with the start, unless given.
        """
        self.flights.start(episode, scenario)
        self._scenarios[episode] = scenario
        threshold = self.task.mission.inspection_threshold_percent
        self.needed[episode] = points_needed(int(self.flights.inspectable[episode]), threshold)
        if self._weights is not None:
            direction = direction_of(scenario.generator(PRIORITY)) if priority is None else priority
            self.priorities[episode] = direction
            self._weights[episode] = priority_weights(self._points, direction)
            self.needed[episode] = threshold / 100.0

    def begin(self) -> None:
        """Bring the episodes that were put at a start to their first sample; the others rest."""
        is_new = self.flights.samples == stepping.NOT_STARTED
        self.flights.step_started()
        self._spent[is_new] = self.flights.observed[is_new, stepping.SPENT]
        self._paid[is_new] = 0.0 if self.task.reward.as_afrl else self.inspected[is_new]

    def step(self, actions: NDArray[Any]) -> tuple[Floats, Booleans, Booleans]:
        """Fly all to their next action, or bring those that were put at a start to their first sample.

        Returns
        -------
        rewards : (n,) array
            Zero of those that were started.
        terminated : (n,) array of bool
            Outside the distance limits, or every point that counts is inspected. Where a mission asks for
            what follows, it ends with its time, outside if free motion leads there.
        truncated : (n,) array of bool
            The flight's time is over. See `Reward` for AFRL's ends.
        """
        forces = self.task.forces(actions, len(self.needed))
        is_over = self.flights.samples < 0  # what is started in this step waits for the next one
        rewards, terminated, truncated = self._step(forces)
        for _ in range(self.task.num_periods - 1):
            is_over |= terminated | truncated
            if is_over.all():
                break
            with self.flights.resting(is_over):
                further, has_ended, is_cut = self._step(np.zeros_like(forces))
            rewards, terminated, truncated = rewards + further, terminated | has_ended, truncated | is_cut
        return rewards, terminated, truncated

    def _step(self, forces: Floats) -> tuple[Floats, Booleans, Booleans]:
        """Fly by a control period, but what rests; see `step`."""
        flights, reward = self.flights, self.task.reward
        is_begun = flights.samples >= 0
        rows = np.flatnonzero(is_begun)
        self._forces[rows, flights.samples[rows]] = forces[rows]
        flights.step(forces)
        now, inspected = flights.observed, self.inspected
        is_outside = now[:, stepping.OUTSIDE] > 0.0
        deputy = self.task.mission.deputy
        middle_m = 0.5 * (deputy.min_distance_m + deputy.max_distance_m)
        is_far = is_outside & (np.linalg.norm(now[:, : stepping.VELOCITY], axis=1) > middle_m)
        is_enough = inspected >= self.needed
        rewards = reward.per_point * (inspected - self._paid)
        rewards -= reward.per_delta_v * (now[:, stepping.SPENT] - self._spent)
        is_last, goes_on = flights.samples == self.task.mission.num_controls, self.task.mission.after_s > 0.0
        is_due = is_last & ~is_outside if goes_on else self._paid < self.needed
        rewards += reward.success * self._succeeds(is_begun & is_enough & is_due)
        too_far = reward.outside if reward.too_far is None else reward.too_far
        rewards -= np.where(is_far, too_far, reward.outside * is_outside)
        is_complete = (now[:, stepping.NUM_UNSEEN] == 0.0) & (not goes_on)
        terminated = is_begun & (is_outside | is_complete)
        truncated = is_begun & ~terminated & is_last
        if reward.as_afrl:
            terminated = is_begun & (is_outside & ~is_far | is_enough)
            truncated |= is_begun & is_far
        self._spent[:] = now[:, stepping.SPENT]
        self._paid[:] = np.where(is_begun, inspected, 0.0) if reward.as_afrl else inspected
        return np.where(is_begun, rewards, 0.0), terminated, truncated

    @property
    def inspected(self) -> Floats:
        """Points that each episode has inspected, as a number or as their weight."""
        if self._weights is None:
            return self.flights.observed[:, stepping.NUM_INSPECTED].copy()
        return np.asarray(np.sum(self._weights * self.flights.is_inspected, axis=1))

    def _succeeds(self, has_enough: Booleans) -> Floats:
        """Return 1 for each episode that succeeds in this step, -1 where AFRL penalises it, else 0."""
        signs = has_enough.astype(np.float64)
        mission = self.task.mission
        if self.task.reward.as_afrl and self._weights is not None:
            for row in np.flatnonzero(has_enough):
                nearest = nearest_in_orbit(
                    mission.orbit, mission.deputy, self.flights.observed[row, : stepping.TARGET]
                )
                signs[row] = 1.0 if nearest >= mission.deputy.min_distance_m else -1.0
        return signs

    @property
    def facts(self) -> dict[str, NDArray[Any]]:
        """Facts of each episode beside its observations, by name, for Gymnasium's ``info``."""
        now = self.flights.observed
        return {
            "delta_v_m_s": now[:, stepping.SPENT].copy(),
            "num_inspected": now[:, stepping.NUM_INSPECTED].copy(),
            "num_inspectable": self.flights.inspectable.copy(),
            "is_success": (self.inspected >= self.needed) & (now[:, stepping.OUTSIDE] == 0.0),
            "outside_m": now[:, stepping.OUTSIDE].copy(),
            "safety_periods": now[:, stepping.NUM_ACTED].copy(),
            "safety_delta_v_m_s": now[:, stepping.CORRECTED].copy(),
        } | ({} if self._weights is None else {"weight_inspected": self.inspected})

    def num_samples(self, episode: int) -> int:
        """Return the number of samples of an episode so far."""
        return int(self.flights.samples[episode]) + 1

    def scenario(self, episode: int) -> Scenario:
        """Return the start of an episode."""
        scenario = self._scenarios[episode]
        if scenario is None:
            raise ValueError("there is no episode yet; call reset first")
        return scenario

    def log(self, episode: int) -> tuple[Scenario, FlightLog]:
        """Fly an episode again with the forces that were commanded, and without force from then on."""
        scenario, mission = self.scenario(episode), self.task.mission
        return scenario, fly_logged(mission, open_loop("episode", self._played(episode)), scenario)

    def record(self, episode: int, path: Path) -> None:
        """Record an episode as every flight is, see `telemetry`."""
        scenario, log = self.log(episode)
        controller = open_loop("episode", self._played(episode))
        experiment = replace(self.task.experiment, seed=scenario.noise[0])
        recorder = FlightRecorder(experiment, controller, self.task.config)
        recorder.record(path, scenario, log, "episode")

    def _played(self, episode: int) -> Floats:
        """Return the forces of an episode so far, one row a control period, N, Hill axes."""
        flown = max(0, int(self.flights.samples[episode]))
        return self._forces[episode, :flown].copy()
