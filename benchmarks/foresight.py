"""Rules alone and with foresight in many worlds: ``python -m benchmarks foresight [NAME ...]``.

A row is a world: delta-v and success by the rules alone, and with foresight, and the share of its fuel that
rules fire, as on the page; below the table flights outside the limits, and processor time a start, once all
is compiled. The missions are those of `benchmarks.missions`, for which controllers are scaled to the chief's
size. With ``--turns N`` the processor time of one thread is measured against that of rehearsals instead, both
from the same starts by turns. With ``--on-board`` controllers with foresight, or those that ``--only``
names, are flown as they plan on board and as they plan in simulation, without errors or in the named worlds;
the last column is processor time, s.
"""

import argparse
import time
from collections.abc import Sequence
from typing import Final

import numpy as np

from benchmarks.missions import MISSIONS, RANDOM_SUN
from pipeline.command_line.config import compose_experiment
from pipeline.controllers.source import named
from pipeline.evaluation.statistics import percent_ahead, statistic
from pipeline.flight.control.controller import RuleController, from_fuzzy
from pipeline.flight.fly.lesser_controllers import bare, rules_alone
from pipeline.flight.fly.replanning import foresees
from pipeline.flight.fly.simulation import fly_all
from pipeline.flight.state.log import Outcomes
from pipeline.scenarios import evaluation_scenarios
from pipeline.settings.experiment import Mission
from pipeline.settings.places import conf_folder
from pipeline.training.similarity import HOME, Similarity

SMALL, LARGE, CONFIDENCE = "champion_27_rehearsed", "champion_leo_rehearsed", 95.0
REAL: Final = ("navigation=fixes", "actuators=real")
#: controllers, and the settings of their worlds
WORLDS: Final = {
    "Sun anywhere": (SMALL, (RANDOM_SUN,)),
    "Sun fixed": (SMALL, ("sun=fixed",)),
    "two-body motion": (SMALL, (RANDOM_SUN, "dynamics=two_body")),
    "fixes, real thrusters": (SMALL, (RANDOM_SUN, *REAL)),
    "fixes, real thrusters, 20 s late": (
        SMALL,
        (RANDOM_SUN, *REAL, "actuators.delay_s=10", "navigation.delay_s=10"),
    ),
    "fixes, real thrusters, mass dispersed by 5 %": (
        SMALL,
        (RANDOM_SUN, *REAL, "+dispersions.deputy.mass_kg={kind:normal,mean:12.0,std:0.6}"),
    ),
    "low orbit, safety=robust": (LARGE, ("world=leo", "safety=robust")),
    "low orbit, 20 s late": (LARGE, ("world=leo", "actuators.delay_s=10")),
} | {name: (LARGE, (RANDOM_SUN, *words)) for name, (_, words) in MISSIONS.items()}

#: worlds that are not in the table unless named: the page has them from more starts
FROM_MORE_STARTS: Final = ("Sun anywhere", "low orbit, safety=robust")
#: worlds in which processor time is measured, with the controller that only rehearses
REHEARSED: Final = {
    "Sun anywhere": "champion_27_one_push",
    "fixes, real thrusters": "champion_27_one_push",
    "low orbit, safety=robust": "champion_leo_one_push",
}


def scaled(controller: RuleController, mission: Mission, name: str) -> RuleController:
    """Return a controller at the size of a mission's chief; in worlds of its own it stays as it is."""
    if name not in MISSIONS or controller.fuzzy is None:
        return controller
    size = mission.chief.inspection_radius_m / HOME.chief.inspection_radius_m
    return from_fuzzy(Similarity(mission, size).controller(controller.fuzzy))


def tally(mission: Mission, flown: Outcomes, *, with_interval: bool) -> str:
    """Return the cell of some flights: delta-v (m/s), with its interval if wanted, and success (%)."""
    delta_v = statistic(flown.delta_v_m_s, CONFIDENCE)
    is_success = flown.is_success(mission.inspection_threshold_percent) & ~flown.is_violated
    interval = f" ({delta_v.low:.3f}–{delta_v.high:.3f})" if with_interval else ""
    return f"{delta_v.mean:.3f}{interval}, {100 * is_success.mean():.0f}"


def print_row(name: str, num_cases: int, seed: int) -> str:
    """Print the row of a world; return its flights outside the limits, and processor time, in words."""
    controller, words = WORLDS[name]
    settings = [f"seed={seed}", f"monte_carlo.num_cases={num_cases}"]
    experiment = compose_experiment(["+experiment=evaluate", *words, *settings]).experiment
    mission, starts = experiment.mission, evaluation_scenarios(experiment)
    planning = named(controller, HOME)
    assert isinstance(planning, RuleController)
    planning = scaled(planning, mission, name)
    alone = fly_all(mission, rules_alone(planning), starts, 1)
    fly_all(mission, planning, starts[:1], 1)
    began = time.process_time()
    flown = fly_all(mission, planning, starts, 1)
    seconds = (time.process_time() - began) / num_cases
    by_rules = 100.0 - percent_ahead(flown.delta_v_m_s, flown.ahead_delta_v_m_s)
    world = f"`{name}`" if name in MISSIONS else name
    cells = tally(mission, alone, with_interval=False), tally(mission, flown, with_interval=True)
    print(f"| {' | '.join([world, *cells, f'{by_rules:.1f}'])} |", flush=True)
    outside = " and ".join(str(flights.is_violated.sum()) for flights in (alone, flown))
    return f"{name}: {outside} outside by the rules alone and with foresight, {seconds:.2f} s a start"


def print_turns(name: str, num_turns: int, num_cases: int, seed: int) -> None:
    """Print how much processor time foresight takes, in a world, as multiples of that of rehearsals."""
    planning, words = WORLDS[name]
    settings = [f"seed={seed}", f"monte_carlo.num_cases={num_turns * num_cases}"]
    experiment = compose_experiment(["+experiment=evaluate", *words, *settings]).experiment
    mission, starts = experiment.mission, evaluation_scenarios(experiment)
    controllers = [named(each, HOME) for each in (REHEARSED[name], planning)]
    for controller in controllers:
        fly_all(mission, controller, starts[:1], 1)
    spent = np.empty((num_turns, 2))
    for turn in range(num_turns):
        for index in (0, 1) if turn % 2 else (1, 0):
            began = time.process_time()
            fly_all(mission, controllers[index], starts[turn * num_cases : (turn + 1) * num_cases], 1)
            spent[turn, index] = (time.process_time() - began) / num_cases
    ratios, (rehearsed, planned) = spent[:, 1] / spent[:, 0], spent.mean(axis=0)
    print(
        f"{name}: {planned:.3f} s a start, {REHEARSED[name]} {rehearsed:.3f} s;"
        f" {planned / rehearsed:.2f} times,"
    )
    print(f"  {num_turns} turns of {num_cases} starts: {ratios.min():.2f} to {ratios.max():.2f}", flush=True)


def print_on_board(num_cases: int, seed: int, only: Sequence[str], names: Sequence[str]) -> None:
    """Print how controllers fly as they plan on board, beside how they fly as they plan in simulation."""
    print("| controller | planned in simulation | planned on board | on board minus simulation (m/s) | s |")
    print("|---|---|---|---|---|")
    stems = sorted(path.stem for path in (conf_folder() / "controller").glob("*champion*.yaml"))
    rows = [WORLDS[name] for name in names] or [(stem, (RANDOM_SUN,)) for stem in stems]
    for stem, words in rows:
        if only and stem not in only:
            continue
        settings = [*words, f"seed={seed}", f"monte_carlo.num_cases={num_cases}", f"controller={stem}"]
        job = compose_experiment(["+experiment=evaluate", *settings]).experiment
        mission, starts = job.mission, list(evaluation_scenarios(job))
        controller = named(stem, mission)
        if not (isinstance(controller, RuleController) and foresees(controller)):
            continue
        began = time.process_time()
        flown = [fly_all(mission, each, starts) for each in (controller, bare(controller))]
        seconds = time.process_time() - began
        off = flown[1].delta_v_m_s - flown[0].delta_v_m_s
        half = 1.96 * off.std(ddof=1) / np.sqrt(len(off))
        tallies = " | ".join(tally(mission, each, with_interval=False) for each in flown)
        world = " ".join(f"`{word}`" for word in (stem, *words))
        print(f"| {world} | {tallies} | {off.mean():+.4f} ± {half:.4f} | {seconds:.0f} |", flush=True)


def main(given: Sequence[str]) -> int:
    """Print a row for each world."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks foresight", description=__doc__)
    worlds = ", ".join(WORLDS)
    parser.add_argument(
        "names", nargs="*", metavar="NAME", help=f"of {worlds.replace('%', '%%')}; all unless given"
    )
    parser.add_argument("--cases", type=int, default=48, help="starts in each world")
    parser.add_argument("--seed", type=int, default=62)
    parser.add_argument("--turns", type=int, help="measure processor time by so many turns")
    parser.add_argument("--on-board", action="store_true", help="compare plans on board with simulated ones")
    parser.add_argument(
        "--only", nargs="*", default=[], metavar="CONTROLLER", help="with --on-board: of these"
    )
    options = parser.parse_args(given)
    if unknown := set(options.names) - set(WORLDS):
        parser.error(f"no world {sorted(unknown)[0]!r}; they are {worlds}")
    if options.on_board:
        print_on_board(options.cases, options.seed, options.only, options.names)
        return 0
    if options.turns:
        for name in options.names or REHEARSED:
            print_turns(name, options.turns, options.cases, options.seed)
        return 0
    heads = (
        *(f"{by}: delta-v (m/s), success (%)" for by in ("rules alone", "with foresight")),
        "share of fuel burnt by pushes that rules fire (%)",
    )
    print(f"| world | {' | '.join(heads)} |\n|---|---|---|---|")
    names = options.names or [name for name in WORLDS if name not in FROM_MORE_STARTS]
    print("\n".join([print_row(name, options.cases, options.seed) for name in names]))
    return 0
