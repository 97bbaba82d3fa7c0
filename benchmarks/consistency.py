"""Whether the filter knows how far it may be off: ``python -m benchmarks consistency``.

In each shipped world and with each option of navigation and thrusters by which a deputy navigates by fixes,
with late fixes, with each constant error that is 0 in it, and with a tank that empties: the mean square, over
flights, of the estimates' errors in the filter's own standard deviations (NEES), and of fixes' from the
position expected (NIS), at four samples. Errors that a flight keeps are as configured, and ten times as
large. Expected are 6 and 3, within the 95 % bands of chi-squared (Bar-Shalom, Li and Kirubarajan, Estimation
with applications to tracking and navigation, 2001, 5.4.2). The last line counts means within these bands, and
within wider ones: all means of the table together lie within those with 95 % (Bonferroni).
"""

import argparse
import multiprocessing
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import fields, replace

import numpy as np
from scipy.stats import chi2

from fis_tools.processors import num_processors
from pipeline.command_line.config import compose_experiment, conf_folder
from pipeline.controllers import source
from pipeline.flight.cases.navigation import considered
from pipeline.flight.control.controller import Controller
from pipeline.flight.fly.simulation import fly_logged
from pipeline.flight.state.log import FlightLog
from pipeline.scenarios import evaluation_scenarios
from pipeline.settings.checks import SettingError
from pipeline.settings.experiment import Experiment, Mission

#: a tank that is empty within the flight
TANK = ("actuators.specific_impulse_s=60", "actuators.propellant_kg=0.005")
#: what is set where a constant error is 0: one of its unit
ONE = 1.0
#: of a flight, after which estimates are judged
SHARES = (1 / 12, 1 / 3, 2 / 3, 1)


def squares(log: FlightLog) -> np.ndarray:
    """Return the squares of a flight's errors and innovations, shape (2, SHARES)."""
    samples = [round(share * (len(log.estimate) - 1)) for share in SHARES]
    off = log.estimate - np.hstack([log.position_m, log.velocity_m_s])
    errors = [off[k] @ np.linalg.solve(log.estimate_covariance[k], off[k]) for k in samples]
    return np.array([errors, log.innovation_square[samples]])


def options(group: str) -> list[str]:
    """Return the options of a group of settings that choose one."""
    return [f"{group}={path.stem}" for path in sorted((conf_folder() / group).glob("*.yaml"))]


def composed(overrides: Sequence[str]) -> Experiment:
    """Return an experiment of flights with some settings."""
    return compose_experiment(["+experiment=evaluate", *overrides]).experiment


def constant_errors(mission: Mission) -> dict[str, float]:
    """Return the settings of errors that a flight keeps and the filter considers, with their values."""
    before, errors = considered(mission), {}
    for group in ("navigation", "actuators"):
        settings = getattr(mission, group)
        for field in fields(settings):
            value = getattr(settings, field.name)
            if isinstance(value, float):
                with suppress(SettingError):  # a period must be a multiple of others; it is no error
                    other = replace(settings, **{field.name: 0.5 * value or ONE})
                    if np.any(considered(replace(mission, **{group: other})) != before):
                        errors[f"{group}.{field.name}"] = value
    return errors


def table() -> list[tuple[str, ...]]:
    """Return the settings of all rows, each mission once."""
    ways = [(), *((thrusters,) for thrusters in options("actuators"))]
    worlds = [(world, *way) for world in options("world") for way in ways]
    pairs = [(way, thrusters) for way in options("navigation") for thrusters in options("actuators")]
    chosen: dict[Mission, tuple[str, ...]] = {}
    for overrides in (*worlds, *pairs):
        mission = composed(overrides).mission
        if mission.navigation.mode != "fixes":
            continue
        chosen.setdefault(mission, overrides)
        more = [("navigation.delay_s=10",)]
        more += [(f"{name}={ONE:g}",) for name, value in constant_errors(mission).items() if value == 0.0]
        if mission.actuators.kind == "real":
            more.append(TANK)
        for changes in more:
            chosen.setdefault(composed((*overrides, *changes)).mission, (*overrides, *changes))
    return list(chosen.values())


def larger(experiment: Experiment, factor: float) -> Experiment:
    """Return it with errors that a flight keeps so many times as large."""
    mission = experiment.mission
    for name, value in constant_errors(mission).items():
        group, key = name.split(".")
        settings = replace(getattr(mission, group), **{key: factor * value})
        mission = replace(mission, **{group: settings})
    return replace(experiment, mission=mission)


def judged(experiment: Experiment, controller: Controller) -> np.ndarray:
    """Fly; return the mean squares at each sample, shape (2, SHARES)."""
    starts = evaluation_scenarios(experiment)
    return np.mean([squares(fly_logged(experiment.mission, controller, start)) for start in starts], axis=0)


def judged_row(overrides: Sequence[str]) -> list[tuple[float, np.ndarray]]:
    """Return the mean squares of a row of settings, by the factor on errors that a flight keeps."""
    configured = composed(overrides)
    controller = source.load(configured.controller, configured.mission)
    experiments = {factor: larger(configured, factor) for factor in (1.0, 10.0)}
    # no errors that a flight keeps: none larger
    return [
        (factor, judged(experiment, controller))
        for factor, experiment in experiments.items()
        if factor == 1.0 or experiment != configured
    ]


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


def main(words: Sequence[str] | None = None) -> int:
    """Print a row for each world, as configured and with errors ten times as large."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks consistency", description=__doc__)
    parser.add_argument("--flights", type=int, default=50, help="in each world")
    parser.add_argument("--seed", type=int, default=6, help="of their starts and errors")
    parser.add_argument("--controller", default="paper_champion", help="an option of conf/controller")
    parser.add_argument("--only", default="", help="worlds with this text in their overrides")
    parser.add_argument("--workers", type=int, help="processes; one a processor unless given")
    arguments = parser.parse_args(words)
    chosen = [overrides for overrides in table() if arguments.only in " ".join(overrides)]
    each, rows = bands(arguments.flights), list[tuple[float, np.ndarray]]()
    print(f"| settings | constant errors | {' | '.join(format_limits(each))} | inside |")
    print("|---|---|---|---|---|")
    more = [f"controller={arguments.controller}", f"monte_carlo.num_cases={arguments.flights}"]
    more.append(f"seed={arguments.seed}")
    flown = [(*overrides, *more) for overrides in chosen]
    with multiprocessing.get_context("fork").Pool(arguments.workers or num_processors()) as pool:
        for overrides, results in zip(chosen, pool.imap(judged_row, flown), strict=True):
            for factor, means in results:
                rows.append((factor, means))
                cells = (", ".join(f"{mean:.2f}" for mean in row) for row in means)
                share = f"{within(means, each)} of {means.size}"
                print(
                    f"| `{' '.join(overrides)}` | x {factor:g} | {' | '.join(cells)} | {share} |", flush=True
                )
    means = np.concatenate([row for _, row in rows], axis=1)
    together = bands(arguments.flights, means.size)
    print(
        f"\n{within(means, each)} of {means.size} means lie in their own bands; {within(means, together)} in "
        f"those that hold together: {'; '.join(format_limits(together))}"
    )
    for factor in dict.fromkeys(factor for factor, _ in rows):
        whole = [within(row, together) == row.size for other, row in rows if other == factor]
        print(
            f"constant errors x {factor:g}: all means of {sum(whole)} of {len(whole)} rows lie in the latter"
        )
    return 0
