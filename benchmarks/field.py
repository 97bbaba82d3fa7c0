"""Controllers in the worlds of AFRL and bsk_rl, as these count: ``python -m benchmarks field``.

An episode ends, as in safe-autonomy-sims, at success, out of bounds, in the chief or with its time; fuel and
points are those up to there. *Their* success is all points, or 0.95 of the weight and then an orbit of free
flight outside 15 m, or in bsk_rl 0.9 of the points lit so far; *ours* is 95 % (90 %) of the points that are
lit at some time, and all of the time within the limits. Interquartile means have intervals by the bootstrap
over starts, as in `benchmarks.policies`.
"""

import argparse
from collections.abc import Sequence
from typing import Any, Final, NamedTuple

import numpy as np

from benchmarks.policies import interquartile_mean, resampled
from pipeline.array_types import Booleans
from pipeline.command_line.config import compose_experiment
from pipeline.controllers.source import load, named
from pipeline.evaluation.statistics import fraction
from pipeline.flight.cases.starts import starts_of
from pipeline.flight.fly.foresight import lit_at_samples
from pipeline.flight.fly.published import priority_weights
from pipeline.flight.fly.simulation import fly_logged
from pipeline.flight.state.log import FlightLog, Scenario, points_needed
from pipeline.flight.world.pack import inspection_points, pack_world
from pipeline.gym.episodes import nearest_in_orbit
from pipeline.scenarios import PRIORITY, direction_of, evaluation_scenarios
from pipeline.settings.experiment import Mission

AFRL: Final = (
    "champion_27",
    "champion_27 controller.attributes.coast_below_points=1.0",
    "champion_27_fixed_sun controller.attributes.coast_below_points=1.0",
    *("champion_afrl", "champion_afrl_weighted", "champion_afrl_six_dof", "champion_27_fixed_sun"),
    *("champion_81", "champion_any_sun", "champion_leo"),
    *("paper_champion", "lqr", "natural_motion", "coast", "receding_horizon"),
)
#: a command in `world=rso` lasts 60 s
RSO: Final = (
    *("champion_27_fixed_sun controller.attributes.decision_period_s=60", "champion_any_sun", "champion_leo"),
    *("champion_rso", "lqr", "natural_motion", "coast"),
)
WORLDS: Final = {"afrl": AFRL, "afrl_weighted": AFRL, "afrl_six_dof": AFRL, "rso": RSO}
#: of those that take seconds a flight
SLOW: Final = {"receding_horizon": 100}
OUR_PERCENT: Final = 95.0
#: bsk_rl judges as soon as so many of the points have been lit, or an orbit has passed
FIRST_LIT_PERCENT: Final = 40.0


class Judged(NamedTuple):
    """An episode as the world's authors count, and whether it is a success as we count."""

    delta_v_m_s: float
    points_percent: float
    is_success: bool
    is_outside: bool
    is_our_success: bool


def is_enough_in_rso(mission: Mission, scenario: Scenario, log: FlightLog) -> Booleans:
    """Return at which samples bsk_rl says that enough is seen, from which on it pays its bonus."""
    lit = np.logical_or.accumulate(lit_at_samples(pack_world(mission), starts_of([scenario])))
    lit_count, seen_count = lit.sum(axis=1), log.is_inspected.sum(axis=1)
    time = mission.control_period_s * np.arange(len(lit))
    is_judged = 100.0 * lit.mean(axis=1) >= FIRST_LIT_PERCENT
    is_judged |= time > 2.0 * np.pi / mission.orbit.mean_motion_rad_s
    return np.asarray(is_judged & (100.0 * seen_count >= mission.inspection_threshold_percent * lit_count))


def is_enough_in_afrl(mission: Mission, scenario: Scenario, log: FlightLog) -> Booleans:
    """Return at which samples AFRL says that enough is seen."""
    points = inspection_points(mission)
    direction = direction_of(scenario.generator(PRIORITY))
    is_weighted = mission.chief.weights == "priority"
    weights = priority_weights(points, direction) if is_weighted else np.ones(len(points))
    needed = mission.inspection_threshold_percent / 100.0 * weights.sum()
    return np.asarray(log.is_inspected @ weights >= needed - 1e-9)


def judged(world: str, mission: Mission, scenario: Scenario, log: FlightLog) -> Judged:
    """Judge a flight."""
    deputy, seen, is_rso = mission.deputy, log.is_inspected, world == "rso"
    distance = np.linalg.norm(log.position_m, axis=1)
    is_outside = (distance < deputy.min_distance_m) | (distance > deputy.max_distance_m)
    is_outside[0] = False  # AFRL looks after the first step, too
    is_enough = (is_enough_in_rso if is_rso else is_enough_in_afrl)(mission, scenario, log)
    is_enough[0] = False
    ends = is_outside | is_enough
    end = int(ends.argmax()) if ends.any() else len(ends) - 1
    is_success = bool(is_enough[end] and not is_outside[end])
    if is_success and mission.chief.weights == "priority":
        state = np.concatenate((log.position_m[end], log.velocity_m_s[end]))
        is_success = nearest_in_orbit(mission.orbit, deputy, state) >= deputy.min_distance_m
    num_lit = int(log.is_inspectable.sum())
    our_percent = mission.inspection_threshold_percent if is_rso else OUR_PERCENT
    return Judged(
        float(log.delta_v_m_s[end]),
        100.0 * float(seen[end].sum()) / num_lit,
        is_success,
        bool(is_outside[end]),
        bool(seen[-1].sum() >= points_needed(num_lit, our_percent) and not is_outside.any()),
    )


def row(name: str, flown: Sequence[Judged], num_cases: int) -> str:
    """Return a row of the table, which says where fewer starts were flown than asked for."""

    def mean(values: Sequence[float], digits: int) -> str:
        array = np.array([values])
        low, high = resampled(array)
        return f"{interquartile_mean(array):.{digits}f} ({low:.{digits}f}–{high:.{digits}f})"

    def share(values: Sequence[bool]) -> str:
        met = fraction(np.array(values), 95.0)
        return f"{100 * met.fraction:.1f} % ({100 * met.low:.1f}–{100 * met.high:.1f})"

    spent, seen, successes, outside, ours = zip(*flown, strict=True)
    starts = "" if len(flown) == num_cases else f", {len(flown)} starts"
    cells = f"`{name}`{starts}", mean(seen, 2), mean(spent, 3), share(successes), share(ours), share(outside)
    return f"| {' | '.join(cells)} |"


def main(arguments: Sequence[str]) -> int:
    """Fly all of them in all worlds, and print a table of each."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks field", description=__doc__)
    parser.add_argument(
        "-c", "--controller", action="append", help="of conf/controller, and what differs; or a file"
    )
    parser.add_argument("-w", "--world", action="append", help=f"of {', '.join(WORLDS)}; all unless given")
    parser.add_argument("--cases", type=int, default=1000, help="starts; no more than 100 for a slow one")
    parser.add_argument("--seed", type=int, default=6, help="of the starts")
    parser.add_argument(
        "--speed", type=float, help="greatest speed of the starts, m/s; the world's unless given"
    )
    options = parser.parse_args(arguments)
    for world in options.world or WORLDS:
        words = [f"world={world}", f"monte_carlo.num_cases={options.cases}", f"seed={options.seed}"]
        if options.speed is not None:
            words.append(f"monte_carlo.max_speed_m_s={options.speed}")
        print(f"\n`{' '.join(words)}`\n")
        print("| controller | points (%) | delta-v (m/s) | their success | our success | out of bounds |")
        print("|---|---|---|---|---|---|", flush=True)
        for name in options.controller or WORLDS[world]:
            first, *rest = name.split()
            is_file = "/" in first
            option = "coast" if is_file else first
            command = ["+experiment=evaluate", f"controller={option}", *rest, *words]
            experiment: Any = compose_experiment(command).experiment
            mission, starts = experiment.mission, evaluation_scenarios(experiment)
            controller = named(first, mission) if is_file else load(experiment.controller, mission)
            flown = [
                judged(world, mission, start, fly_logged(mission, controller, start))
                for start in starts[: SLOW.get(name, options.cases)]
            ]
            print(row(name, flown, options.cases), flush=True)
    return 0
