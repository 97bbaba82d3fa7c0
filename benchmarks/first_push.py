"""What plans teach rules about the first push: ``python -m benchmarks first_push``.

A plane is fitted to the first pushes of foresight, over the start's position and the Sun's direction, on half
of the starts. From the other half the rules fly after no push, after the plan's, and after the plane's; they
fire nothing for a while, or go on at once.
"""

import argparse
from collections.abc import Sequence

import numpy as np

from benchmarks.foresight import SMALL, tally
from benchmarks.missions import RANDOM_SUN
from pipeline.array_types import Floats
from pipeline.command_line.config import compose_experiment
from pipeline.controllers.source import named
from pipeline.flight.cases.starts import cases_of
from pipeline.flight.control.controller import RuleController
from pipeline.flight.control.law import law_of
from pipeline.flight.fly.lesser_controllers import finishing
from pipeline.flight.fly.population import fly_population
from pipeline.flight.fly.replanning import foresee
from pipeline.flight.state.log import Outcomes, Scenario
from pipeline.flight.world.pack import pack_world
from pipeline.scenarios import evaluation_scenarios
from pipeline.settings.experiment import Mission
from pipeline.training.similarity import HOME

#: seconds after the first push in which nothing is fired, and starts that are planned together
WAITS, TOGETHER = (0.0, 300.0, 900.0), 50


def features(scenario: Scenario) -> list[float]:
    """Return what the plane goes over: 1, the position, m, and the Sun's direction in the orbit plane."""
    angle = scenario.sun_angle_rad
    return [1.0, *scenario.position_m, np.cos(angle), np.sin(angle)]


def fly_after(
    mission: Mission, rules: RuleController, starts: list[Scenario], forces: Floats, wait_s: float
) -> Outcomes:
    """Fly the rules from some starts after first forces, (m, 3), N, and a time without any, arrays (m,)."""
    openings = np.zeros((len(starts), 1 + round(wait_s / mission.control_period_s), 4))
    openings[:, 0, :3], openings[..., 3] = forces, 1.0
    law, cases = law_of(rules, mission), cases_of(mission, starts)
    flown = fly_population(pack_world(mission), law, rules.numbers, cases, 1, openings=openings)
    return flown.each(lambda values: values[0])


def main(given: Sequence[str]) -> int:
    """Print how well a plane has the first push, and what rules burn after it."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks first_push", description=__doc__)
    parser.add_argument("--cases", type=int, default=800)
    parser.add_argument("--seed", type=int, default=6210)
    options = parser.parse_args(given)
    settings = [f"seed={options.seed}", f"monte_carlo.num_cases={options.cases}"]
    experiment = compose_experiment(["+experiment=evaluate", RANDOM_SUN, *settings]).experiment
    mission, starts = experiment.mission, evaluation_scenarios(experiment)
    planning = named(SMALL, HOME)
    assert isinstance(planning, RuleController)
    parts = [starts[first : first + TOGETHER] for first in range(0, len(starts), TOGETHER)]
    planned = np.concatenate([foresee(mission, planning, part).openings[:, 0, :3] for part in parts])
    over, half = np.array([features(start) for start in starts]), options.cases // 2
    plane = over @ np.linalg.lstsq(over[:half], planned[:half], rcond=None)[0]
    left, rest = (planned - plane)[half:], planned[half:]
    explained = 1.0 - np.sum(left**2, axis=0) / np.sum((rest - rest.mean(axis=0)) ** 2, axis=0)
    print("share of the variance that the plane explains, radial, along, cross:", explained.round(2))
    rules, later = finishing(planning), starts[half:]
    none = fly_population(
        *(pack_world(mission), law_of(rules, mission), rules.numbers, cases_of(mission, later), 1)
    )
    print("first push | silent after it (s) | m/s | success | outside")
    print("the rules' | 0 |", tally(mission, none.each(lambda values: values[0])))
    for name, forces in (("the plan's", rest), ("the plane's", plane[half:])):
        for wait_s in WAITS:
            print(
                name,
                f"{wait_s:g}",
                tally(mission, fly_after(mission, rules, later, forces, wait_s)),
                sep=" | ",
            )
    return 0
