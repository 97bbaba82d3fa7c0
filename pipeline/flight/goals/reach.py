"""Flights that must reach the chief, and never be faster than a limit that falls with the distance.

The limit at a distance is ``limit_base_m_s + limit_slope_per_s (distance - limit_offset_m)``. A flight ends
at the first sample within ``goal_radius_m`` of the chief, or with more than ``most_excess_m_s`` of speeds
above the limit, summed over samples 1, 2, ...; what it does afterwards does not count. It has reached its
goal if it ends there no faster than ``goal_speed_m_s``. The start is given, so its own speed is not judged.
"""

from dataclasses import dataclass
from typing import get_type_hints

import numpy as np
from numpy.typing import NDArray

from pipeline.array_types import Booleans, Floats
from pipeline.flight.state.arrays import TRACK_SPENT
from pipeline.flight.state.log import FlightLog, Outcomes
from pipeline.settings.experiment import Mission
from pipeline.settings.mission import Problem


@dataclass(frozen=True)
class ReachOutcomes(Outcomes):
    """Results of flights towards a goal, all up to where they end.

    The goal stands for one point: `inspected_count` is 1 if it is reached, and otherwise the share of the way
    that is done, in the logarithm of the distance. `outside_m` is what is above a limit, m/s.
    """

    end_s: Floats
    end_speed_m_s: Floats
    excess_m_s: Floats  # of the speed over its limit, the greatest at a sample; zero where it is held


def limit_at(problem: Problem, distance: Floats) -> Floats:
    """Return the limit on the speed, m/s, at distances from the chief, m."""
    return problem.limit_base_m_s + problem.limit_slope_per_s * (distance - problem.limit_offset_m)


def flight_ends(problem: Problem, distance: Floats, speed: Floats) -> tuple[Floats, Booleans, Floats]:
    """Return the samples at which flights end, whether at the goal, and the excesses summed so far.

    Distances from the chief (m), speeds relative to Hill (m/s) and the sums of excesses (m/s) have the shape
    (n, K+1), the samples of the end, from 0, and whether they are at the goal (n,).
    """
    excess = np.maximum(speed - limit_at(problem, distance), 0.0)
    excess[:, 0] = 0.0
    used = np.cumsum(excess, axis=1)
    is_there = distance <= problem.goal_radius_m
    is_over = is_there | (used > problem.most_excess_m_s)
    is_over[:, -1] = True
    last = is_over.argmax(axis=1)
    return last, is_there[np.arange(len(last)), last], used


def ended(mission: Mission, log: FlightLog) -> tuple[int, str]:
    """Return the sample at which a logged flight ends, and what went wrong, in words; empty if nothing."""
    problem = mission.problem
    # as tracks hold them
    distance, speed = (
        np.linalg.norm(vectors.astype(np.float32), axis=1)[np.newaxis].astype(np.float64)
        for vectors in (log.position_m, log.velocity_m_s)
    )
    ends_at, is_there, used = flight_ends(problem, distance, speed)
    last = int(ends_at[0])
    if used[0, last] > problem.most_excess_m_s:
        return last, "too fast for too long"
    if not is_there[0]:
        return last, "not arrived in time"
    return last, "" if speed[0, last] <= problem.goal_speed_m_s else "a crash"


def until_end(mission: Mission, log: FlightLog) -> FlightLog:
    """Return a flight's log up to where it ends; all of it in a mission without a goal to reach."""
    if mission.problem.kind != "reach":
        return log
    last, _ = ended(mission, log)
    lengths = {"K+1": last + 1, "K": last}
    kept = {}
    for name, hint in get_type_hints(FlightLog, include_extras=True).items():
        rows = next(iter(getattr(hint, "__metadata__", ())), "")
        if rows in lengths:
            kept[name] = getattr(log, name)[: lengths[rows]]
    return log._replace(**kept)


def judged(mission: Mission, outcomes: Outcomes, tracks: NDArray[np.floating]) -> ReachOutcomes:
    """Judge flights by their tracks, (n, K+1, 15), see `pipeline.flight.fly.population.fly_population`.

    The outcomes, (n,), are as flown to the end of time.
    """
    problem, rows = mission.problem, np.arange(len(tracks))
    distance = np.linalg.norm(tracks[..., :3], axis=-1).astype(np.float64)
    speed = np.linalg.norm(tracks[..., 3:6], axis=-1).astype(np.float64)
    last, is_there, used = flight_ends(problem, distance, speed)
    is_flown = np.arange(distance.shape[1]) <= last[:, np.newaxis]
    nearest = np.where(is_flown, distance, np.inf).min(axis=1)
    end_speed = speed[rows, last]
    too_fast = np.where(is_there, np.maximum(end_speed - problem.goal_speed_m_s, 0.0), 0.0)
    outside = too_fast + np.maximum(used[rows, last] - problem.most_excess_m_s, 0.0)
    log_start = np.log(np.maximum(distance[:, 0], 2.0 * problem.goal_radius_m) / problem.goal_radius_m)
    share_left = np.clip(np.log(np.maximum(nearest, 1e-9) / problem.goal_radius_m) / log_start, 1e-9, 1.0)
    of_outcomes = vars(outcomes) | {
        "delta_v_m_s": tracks[rows, last, TRACK_SPENT].astype(np.float64),
        "inspected_count": np.where(is_there & (outside == 0.0), 1.0, 1.0 - share_left),
        "inspectable_count": np.ones(len(tracks), dtype=np.int64),
        "mean_distance_m": np.where(is_flown, distance, 0.0).sum(axis=1) / (last + 1),
        "min_distance_m": nearest,
        "max_distance_m": np.where(is_flown, distance, 0.0).max(axis=1),
        "outside_m": outside,
    }
    return ReachOutcomes(
        **of_outcomes,
        end_s=last * mission.control_period_s,
        end_speed_m_s=end_speed,
        excess_m_s=np.where(is_flown, np.diff(used, axis=1, prepend=0.0), 0.0).max(axis=1),
    )
