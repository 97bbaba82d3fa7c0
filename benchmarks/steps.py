"""Time of a control step: by part, and for every shipped controller, relative to a yardstick.

The yardstick is a short compiled loop that never changes. How many of its rounds a step takes says more about
the code than nanoseconds do, which depend on the machine and its other users.
"""

import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numba
import numpy as np
from llvmlite import binding

from benchmarks.timing import best_cpu_seconds, fuel_by_rules, line
from pipeline.command_line.config import compose_experiment
from pipeline.controllers import source
from pipeline.flight.cases.starts import cases_of
from pipeline.flight.control.law import rehearsed_pushes
from pipeline.flight.fly.population import fly_population
from pipeline.flight.fly.rehearsals import rehearsed_openings
from pipeline.flight.fly.simulation import fly_all, law_for
from pipeline.flight.world.pack import pack_world
from pipeline.scenarios import evaluation_scenarios

#: by type of processor, as they differ
STORED = Path(__file__).with_name("ratios.json")
#: a ratio above the stored one by more than this share is reported
TOLERANCE = 0.05
#: what seems slower is timed again, up to so often in all: single times vary by more than the tolerance
MOST_TIMES = 4
#: rounds of the yardstick; it is timed next to each controller, as other users of the machine slow it down
#: within seconds
ROUNDS = 2_000_000
#: the shipped controllers, each with the Sun or in the world that it was trained for
CONTROLLERS = (
    ("controller=paper_champion",),
    ("controller=paper_octants",),
    ("controller=champion_27", "sun=random"),
    ("controller=champion_27_fixed_sun",),
    ("controller=champion_27_one_push", "sun=random"),
    ("controller=champion_81", "sun=random"),
    ("controller=champion_any_sun", "sun=random"),
    ("controller=champion_fixed_sun",),
    ("controller=champion_leo", "world=leo"),
    ("controller=lqr", "sun=random"),
)
#: variants of each flight: both guidances, without and with the safety layer
WAYS = ((), ("guidance=clusters",), ("safety=filter",), ("guidance=clusters", "safety=filter"))
FLIGHTS = tuple((*controller, *way) for controller in CONTROLLERS for way in WAYS)


def run(num_flights: int, *, stores: bool = False) -> list[str]:
    """Print all figures; return the flights that became slower than stored, relative to the yardstick.

    Stored are the least of `MOST_TIMES` turns through all flights, so that one noisy moment counts for none.
    """
    print(f"Steps: one thread, {num_flights} flights each, no coasting when complete")
    print_parts(num_flights)
    kept, processor = json.loads(STORED.read_text(encoding="utf-8")), binding.get_host_cpu_name()
    stored = kept.get(processor, {})
    if not stored:
        print(f"  no ratios are stored for a {processor}; --store keeps those of this run")
    ratios: dict[str, float] = {}
    slower, faster = [], []
    for overrides in FLIGHTS * (MOST_TIMES if stores else 1):
        name = " ".join(overrides)
        most = (1.0 + TOLERANCE) * stored.get(name, np.inf)
        for _ in range(1 if stores else MOST_TIMES):
            before, seconds, after = round_seconds(), step_seconds(overrides, num_flights), round_seconds()
            ratio = round(seconds / min(before, after), 1)
            ratios[name] = min(ratio, ratios.get(name, np.inf))
            if ratios[name] <= most:
                break
        text = f"{1e9 * seconds:,.0f} ns, {ratio:.1f} rounds of the yardstick"
        if name in stored:
            text += f" (stored: {stored[name]:.1f})"
            if ratios[name] > most:
                slower.append(name)
            elif ratios[name] < (1.0 - TOLERANCE) * stored[name]:
                faster.append(name)
        line(name, text + share_of(overrides))
    if stores:
        kept = {**kept, processor: ratios}
        STORED.write_text(json.dumps(kept, indent=2, sort_keys=True) + "\n", encoding="utf-8")
    for name in faster:
        print(f"  faster by more than {100 * TOLERANCE:.0f} %, so store it anew: {name}")
    for name in slower:
        print(f"  slower by more than {100 * TOLERANCE:.0f} %: {name}")
    return slower


def print_parts(num_flights: int) -> None:
    """Print the time of the parts of a step, as differences between flights with and without them."""
    moved = step_seconds(("controller=coast", "attitude=ideal", "chief.num_points=4"), num_flights)
    sensed = step_seconds(("controller=coast", "attitude=ideal"), num_flights)
    turned = step_seconds(("controller=coast",), num_flights)
    inferred = step_seconds(("controller=paper_champion",), num_flights)
    guided = step_seconds(("controller=paper_champion", "guidance=clusters"), num_flights)
    guarded = step_seconds(("controller=paper_champion", "safety=filter"), num_flights)
    for words, seconds in (
        ("move (coast, pointing ideally, 4 points)", moved),
        ("sense 99 points, and guide by their centroid", sensed - moved),
        ("turn", turned - sensed),
        ("infer 75 rules (paper_champion)", inferred - turned),
        ("guide by clusters in place of the centroid", guided - inferred),
        ("keep to the safety layer", guarded - inferred),
    ):
        line(words, f"{1e9 * seconds:,.0f} ns, {100 * seconds / inferred:.0f} % of a step of paper_champion")


def share_of(overrides: Sequence[str]) -> str:
    """Return the share of fuel that rules fire, in words, from some starts; nothing if they fire all."""
    experiment = compose_experiment(["+experiment=evaluate", *overrides]).experiment
    controller = source.load(experiment.controller, experiment.mission)
    if not len(rehearsed_pushes(controller)):
        return ""
    return fuel_by_rules(
        fly_all(experiment.mission, controller, evaluation_scenarios(experiment, range(100)), 1)
    )


def step_seconds(overrides: Sequence[str], num_flights: int) -> float:
    """Return the processor time of a control step on one thread, the best of several repeats, s."""
    experiment = compose_experiment(
        ["+experiment=evaluate", "coast_when_complete=false", *overrides]
    ).experiment
    mission = experiment.mission
    controller = source.load(experiment.controller, mission)
    # a rehearsal flies each start some hundred times before the flight itself
    num_flights = max(1, num_flights // (1 + len(rehearsed_pushes(controller))))
    cases = replace(experiment.monte_carlo, num_cases=num_flights)
    scenarios = evaluation_scenarios(replace(experiment, monte_carlo=cases))
    world, law = pack_world(mission), law_for(controller, mission, scenarios)
    numbers, flown = controller.numbers, cases_of(mission, scenarios)

    def fly_them() -> None:
        openings, _ = rehearsed_openings(mission, controller, scenarios, 1)
        fly_population(world, law, numbers, flown, 1, openings=openings)

    seconds = best_cpu_seconds(fly_them, repeats=8)
    return seconds / (num_flights * mission.num_controls)


@numba.njit
def yardstick(rounds: int) -> float:
    """Turn and stretch a vector of eight floats, over and over."""
    x = np.linspace(0.1, 0.8, 8)
    for _ in range(rounds):
        for i in range(8):
            x[i] = np.sqrt(x[i] * x[(i + 1) % 8] + 0.25) / (1.0 + x[i] * x[i])
    return float(x.sum())


def round_seconds() -> float:
    """Return the processor time of a round of the yardstick, s."""
    return best_cpu_seconds(lambda: yardstick(ROUNDS), repeats=2) / ROUNDS
