"""What several deputies spend and see together: ``python -m benchmarks fleet [key=value ...]``.

Fleets of one, two and three fly from the same starts, at rest and parked, by each way to share. Further keys
are those of an evaluation, such as ``navigation=fixes actuators=real`` or ``world=leo``.
"""

import argparse
from collections.abc import Sequence

import numpy as np

from pipeline.command_line.config import compose_experiment
from pipeline.controllers.source import load
from pipeline.evaluation.statistics import statistic
from pipeline.flight.fly.fleets import FleetOutcomes
from pipeline.flight.goals.flights import fly_all
from pipeline.scenarios import evaluation_scenarios
from pipeline.settings.fleet import SHARING

#: starts, with what they are called; nearer than this two deputies are too near, m
STARTS = (("at rest", ()), ("parked", ("monte_carlo.parked=true",)))
TOO_NEAR_M = 10.0
HEAD = (
    "start | deputies | they heed | total (m/s) | each | success | enough seen after (s) "
    "| nearest pair (m) | fleets with a pair within 10 m"
)


def row(words: Sequence[str], deputies: int) -> str:
    """Fly fleets; return their results as a row of the table."""
    experiment = compose_experiment(["+experiment=evaluate_fleet", f"fleet.deputies={deputies}", *words])
    mission, starts = experiment.experiment.mission, evaluation_scenarios(experiment.experiment)
    flown = fly_all(mission, load(experiment.experiment.controller, mission), starts)
    spent, is_ok = statistic(flown.delta_v_m_s, 95.0), flown.is_success(mission.inspection_threshold_percent)
    reach = 0.5 * ((spent.high or spent.mean) - (spent.low or spent.mean))
    cells = [f"{spent.mean:.3f} ± {reach:.3f}", f"{spent.mean / deputies:.3f}"]
    cells.append(f"{100.0 * np.mean(is_ok & ~flown.is_violated):.1f} %")
    if isinstance(flown, FleetOutcomes):
        pair = flown.nearest_pair_m
        cells += [f"{np.nanmean(flown.enough_s):.0f}", f"{pair.min():.1f}"]
        cells.append(f"{100.0 * np.mean(pair < TOO_NEAR_M):.1f} %")
    return " | ".join([*cells, *[""] * (6 - len(cells))])


def main(given: Sequence[str]) -> int:
    """Print a table of fleets."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks fleet", description=__doc__)
    parser.add_argument("--cases", type=int, default=300)
    parser.add_argument("--seed", type=int, default=843)
    parser.add_argument("--controller", default="champion_27")
    parser.add_argument("--deputies", type=int, nargs="+", default=[1, 2, 3])
    parser.add_argument("--sharing", nargs="+", default=SHARING, choices=SHARING)
    parser.add_argument("words", nargs="*", metavar="key=value", help="of an evaluation")
    options = parser.parse_args(given)
    shared = [f"seed={options.seed}", f"monte_carlo.num_cases={options.cases}", "sun=random"]
    shared += [f"controller={options.controller}", *options.words]
    print(HEAD)
    for start, keys in STARTS:
        for deputies in options.deputies:
            for sharing in options.sharing if deputies > 1 else ("",):
                heeded = [f"fleet.sharing={sharing}"] if sharing else []
                print(
                    start, deputies, sharing, row([*shared, *keys, *heeded], deputies), sep=" | ", flush=True
                )
    return 0
