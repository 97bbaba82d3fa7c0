"""One flight towards a goal, as an environment, with the rewards of AFRL's problem of that kind."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.flight.fly.stepping import POSITION, SPENT, VELOCITY
from pipeline.flight.goals.reach import limit_at
from pipeline.gym.env import InspectionEnv, Observation


@dataclass(frozen=True)
class ReachReward:
    """What flying towards a goal is paid; by default as in safe-autonomy-sims 4.2.3.

    Parameters
    ----------
    approach : float
        Times the change of ``0.5^(distance / halved_m)``.
    halved_m : float
    per_delta_v : float
        Taken away, of a thrust's force over its mass (N/kg, as theirs) for each step.
    per_excess : float
        Taken away for each m/s above the limit on the speed, at each step.
    success, failure : float
        Given at the goal, with as much again for the share of the time that is left, the last period not
        counted; taken away where the deputy is too fast there or too far away, and where the time is over.
    """

    approach: float = 2.0
    halved_m: float = 100.0
    per_delta_v: float = 0.01
    per_excess: float = 1.0
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
        self._used = 0.0

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Start an episode; see `pipeline.gym.env.InspectionEnv.reset`."""
        start = super().reset(seed=seed, options=options)
        self._used = 0.0
        return start

    def step(self, action: NDArray[Any]) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Fly a control period."""
        mission, paid = self.task.mission, self._paid
        problem, (before, _, spent_before) = mission.problem, self._state()
        observation, *_, info = super().step(action)
        distance, speed, spent = self._state()
        steps = self._episodes.num_samples(0) - 1
        is_late = steps == mission.num_controls
        excess = max(speed - float(limit_at(problem, np.array(distance))), 0.0)
        self._used += excess
        is_there, is_far = distance <= problem.goal_radius_m, distance > mission.deputy.max_distance_m
        is_docked = is_there and speed <= problem.goal_speed_m_s
        is_failed = (is_there and not is_docked) or is_far or is_late
        nearer = 0.5 ** (distance / paid.halved_m) - 0.5 ** (before / paid.halved_m)
        left = 1.0 - steps / (mission.num_controls - 1)
        reward = (
            paid.approach * nearer
            - paid.per_delta_v * (spent - spent_before) / mission.control_period_s
            - paid.per_excess * excess
            + is_docked * paid.success * (1.0 + left)
            - is_failed * paid.failure
        )
        is_cut = is_far or is_late or self._used > problem.most_excess_m_s
        is_success = is_docked and self._used <= problem.most_excess_m_s
        progress = {"is_success": float(is_success), "excess_m_s": excess, "excess_used_m_s": self._used}
        return observation, reward, is_there, is_cut, info | progress

    def _state(self) -> tuple[float, float, float]:
        """Return distance (m), speed and delta-v (m/s)."""
        now = self._episodes.known[0]
        place, velocity = (np.linalg.norm(now[first : first + 3]) for first in (POSITION, VELOCITY))
        return float(place), float(velocity), float(now[SPENT])
