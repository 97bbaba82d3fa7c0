"""Whether the filter knows how far it may be off: ``python -m benchmarks consistency``.

In each shipped world and navigation with fixes, with the errors that a flight keeps as configured and ten
times as large: the mean square, over flights, of the estimates' errors in the filter's own standard
deviations (NEES), and of fixes' from the place expected (NIS), at four samples. Expected are 6 and 3, within
the 95 % bands of chi-squared (Bar-Shalom, Li and Kirubarajan, Estimation with applications to tracking and
navigation, 2001, 5.4.2). The last line counts means within these bands, and within wider ones: all means of
the table together lie within those with 95 % (Bonferroni).
"""

import argparse
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.stats import chi2

from pipeline.command_line.config import compose_experiment
from pipeline.controllers.source import named
from pipeline.flight.control.controller import Controller
from pipeline.flight.fly.simulation import fly_logged
from pipeline.flight.state.log import FlightLog
from pipeline.scenarios import evaluation_scenarios
from pipeline.settings.experiment import Experiment

WORLDS = (
    ("world=leo",),
    ("navigation=fixes",),
    ("navigation=fixes", "navigation.bias_m=1"),
    ("navigation=range_bearing",),
    ("navigation=range_bearing", "navigation.delay_s=10"),
)
#: of a flight, after which estimates are judged
SHARES = (1 / 12, 1 / 3, 2 / 3, 1)


def squares(log: FlightLog) -> np.ndarray:
    """Return the squares of a flight's errors and innovations, shape (2, SHARES)."""
    samples = [round(share * (len(log.estimate) - 1)) for share in SHARES]
    off = log.estimate - np.hstack([log.position_m, log.velocity_m_s])
    errors = [off[k] @ np.linalg.solve(log.estimate_covariance[k], off[k]) for k in samples]
    return np.array([errors, log.innovation_square[samples]])


def larger(experiment: Experiment, factor: float) -> Experiment:
    """Return it with errors that a flight keeps so many times as large."""
    mission = experiment.mission
    navigation, actuators = mission.navigation, mission.actuators
    navigation = replace(
        navigation, bias_m=factor * navigation.bias_m, attitude_bias_deg=factor * navigation.attitude_bias_deg
    )
    if actuators.kind == "real":
        off = factor * actuators.scale_error, factor * actuators.misalignment_deg
        actuators = replace(actuators, scale_error=off[0], misalignment_deg=off[1])
    return replace(experiment, mission=replace(mission, navigation=navigation, actuators=actuators))


def judged(experiment: Experiment, controller: Controller) -> np.ndarray:
    """Fly; return the mean squares at each sample, shape (2, SHARES)."""
    starts = evaluation_scenarios(experiment)
    return np.mean([squares(fly_logged(experiment.mission, controller, start)) for start in starts], axis=0)


def bands(num_flights: int, num_means: int = 1) -> np.ndarray:
    """Return the least and the greatest mean square that are likely, of NEES and of NIS, shape (2, 2).

    With 95 %, so many means lie within them together.
    """
    tail = 0.025 / num_means
    return np.array([chi2.ppf([tail, 1.0 - tail], size * num_flights) / num_flights for size in (6, 3)])


def format_limits(limits: np.ndarray) -> list[str]:
    """Return bands in words."""
    return [
        f"{name}, {low:.2f} to {high:.2f}" for name, (low, high) in zip(("NEES", "NIS"), limits, strict=True)
    ]


def within(means: np.ndarray, limits: np.ndarray) -> int:
    """Return how many means, shape (2, n), are within their bands."""
    return int(np.count_nonzero((limits[:, :1] <= means) & (means <= limits[:, 1:])))


def main(arguments: Sequence[str] | None = None) -> int:
    """Print a row for each world, as configured and with errors ten times as large."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks consistency", description=__doc__)
    parser.add_argument("--flights", type=int, default=50, help="in each world")
    parser.add_argument("--seed", type=int, default=6, help="of their starts and errors")
    parser.add_argument("--controller", default="paper_champion", help="an option of conf/controller")
    parser.add_argument("--only", default="", help="worlds with this text in their overrides")
    options = parser.parse_args(arguments)
    worlds = [overrides for overrides in WORLDS if options.only in " ".join(overrides)]
    each, rows = bands(options.flights), []
    print(f"| settings | constant errors | {' | '.join(format_limits(each))} | inside |")
    print("|---|---|---|---|---|")
    for overrides in worlds:
        more = [f"controller={options.controller}", f"monte_carlo.num_cases={options.flights}"]
        more.append(f"seed={options.seed}")
        composed = compose_experiment(["+experiment=evaluate", *overrides, *more]).experiment
        controller = named(options.controller, composed.mission)
        for factor in (1.0, 10.0):
            experiment = larger(composed, factor)
            if factor != 1.0 and experiment == composed:
                continue  # no errors that a flight keeps
            means = judged(experiment, controller)
            rows.append(means)
            words = (", ".join(f"{mean:.2f}" for mean in row) for row in means)
            share = f"{within(means, each)} of {means.size}"
            print(f"| `{' '.join(overrides)}` | x {factor:g} | {' | '.join(words)} | {share} |", flush=True)
    means = np.concatenate(rows, axis=1)
    together = bands(options.flights, means.size)
    print(
        f"\n{within(means, each)} of {means.size} means lie in their own bands; {within(means, together)} in "
        f"those that hold together: {'; '.join(format_limits(together))}"
    )
    return 0
