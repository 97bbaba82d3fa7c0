"""Whether the filter knows how far it may be off: ``python -m benchmarks consistency``.

In each shipped world and navigation with fixes, with the errors that a flight keeps as configured and ten
times as large: the mean square, over flights, of the estimates' errors in the filter's own standard
deviations (NEES) at some samples. Expected is 6, within the 95 % band of chi-squared (Bar-Shalom, Li and
Kirubarajan, Estimation with applications to tracking and navigation, 2001, 5.4.2).
"""

import argparse
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.stats import chi2

from pipeline.command_line.config import compose_experiment
from pipeline.controllers.source import named
from pipeline.flight.cases.starts import evaluation_scenarios
from pipeline.flight.control.controller import Controller
from pipeline.flight.fly.simulation import fly_logged
from pipeline.flight.state.log import FlightLog
from pipeline.settings.experiment import Experiment

WORLDS = (("world=leo",), ("navigation=fixes",), ("navigation=range_bearing",))
#: at which estimates are judged, in control periods
SAMPLES = (30, 60, 90, 120)


def squares(log: FlightLog) -> list[float]:
    """Return the squares of a flight's errors at the samples."""
    off = log.estimate - np.hstack([log.position_m, log.velocity_m_s])
    return [float(off[k] @ np.linalg.solve(log.estimate_covariance[k], off[k])) for k in SAMPLES]


def larger(experiment: Experiment, factor: float) -> Experiment:
    """Return it with errors that a flight keeps so many times as large."""
    mission = experiment.mission
    navigation, actuators = mission.navigation, mission.actuators
    navigation = replace(
        navigation,
        bias_m=factor * navigation.bias_m,
        attitude_bias_deg=factor * navigation.attitude_bias_deg,
    )
    actuators = replace(
        actuators,
        scale_error=factor * actuators.scale_error,
        misalignment_deg=factor * actuators.misalignment_deg,
    )
    return replace(experiment, mission=replace(mission, navigation=navigation, actuators=actuators))


def judged(experiment: Experiment, controller: Controller) -> np.ndarray:
    """Fly; return the mean square at each sample."""
    starts = evaluation_scenarios(experiment.monte_carlo, experiment.sun, experiment.seed)
    return np.mean([squares(fly_logged(experiment.mission, controller, start)) for start in starts], axis=0)


def main(arguments: Sequence[str] | None = None) -> int:
    """Print a row for each world, as configured and with errors ten times as large."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks consistency", description=__doc__)
    parser.add_argument("--flights", type=int, default=50, help="in each world")
    parser.add_argument("--controller", default="paper_champion", help="an option of conf/controller")
    parser.add_argument("--only", default="", help="worlds with this text in their overrides")
    options = parser.parse_args(arguments)
    low, high = chi2.ppf([0.025, 0.975], 6 * options.flights) / options.flights
    samples = ", ".join(str(k) for k in SAMPLES)
    print(f"| settings | constant errors | NEES at samples {samples} | within {low:.2f} to {high:.2f} |")
    print("|---|---|---|---|")
    for overrides in WORLDS:
        if options.only not in " ".join(overrides):
            continue
        more = [f"controller={options.controller}", f"monte_carlo.num_cases={options.flights}", "seed=6"]
        composed = compose_experiment(["+experiment=evaluate", *overrides, *more]).experiment
        controller = named(options.controller, composed.mission)
        for factor in (1.0, 10.0):
            means = judged(larger(composed, factor), controller)
            inside = np.count_nonzero((low <= means) & (means <= high))
            told = ", ".join(f"{mean:.1f}" for mean in means)
            print(
                f"| `{' '.join(overrides)}` | x {factor:g} | {told} | {inside} of {len(means)} |", flush=True
            )
    return 0
