"""What a champion does, and where it fails: ``python -m benchmarks champion CONTROLLER [--sun random]``."""

import argparse
import math
import sys
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fis_tools.analysis.contribution import contributions
from fis_tools.engines.compiler import compile as compile_system
from fis_tools.model import FuzzySystem, rule_table, table_cells
from fis_tools.words.text import antecedent_words, sentence
from pipeline.command_line.config import compose_experiment
from pipeline.controllers import source
from pipeline.evaluation.monte_carlo import SUCCESS, episode_columns, summarise
from pipeline.flight.control.controller import Controller, open_loop
from pipeline.flight.fly.simulation import fly_all, fly_logged
from pipeline.flight.state.log import FlightLog, Scenario
from pipeline.flight.world.pack import inspection_points
from pipeline.optimum.solved import Solved, solved_for
from pipeline.report.figures.style import PALETTE, save, style
from pipeline.report.figures.trajectories import Tracks, trajectories
from pipeline.scenarios import evaluation_scenarios
from pipeline.settings.experiment import Experiment, Mission

Floats = NDArray[np.float64]
Columns = dict[str, NDArray[np.generic]]

#: width of the bins of azimuth, and of those for the few solved cases, deg
BIN_DEG = 30
SECTOR_DEG = 90
#: time up to which delta-v is reported, min
UNTIL_MIN = (1, 5, 10, 20, 30, 40, 50, 60)
#: rules reported per system
TOLD_RULES = 6
#: a rule decides at a sample if leaving it out moves the output by more than this share of its range
DECIDES = 0.05
AXES = "xyz"
#: control periods without force that separate two burns
PAUSE = 6
PICTURE_DPI = 110


def main(arguments: Sequence[str]) -> None:
    """Print Markdown tables."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks champion", description=__doc__)
    parser.add_argument("controller", help="as in controller=NAME, or a file")
    parser.add_argument("--sun", choices=("fixed", "random"), default="fixed")
    parser.add_argument("--seed", type=int, default=777, help="of the starts")
    parser.add_argument("--cases", type=int, default=1000, help="flights of the Monte Carlo")
    parser.add_argument("--logged", type=int, default=100, help="flights whose rules are looked at")
    parser.add_argument("--without", action="store_true", help="fly without each rule, and nothing else")
    parser.add_argument("--case", type=int, help="tell this solved case's burns, and nothing else")
    parser.add_argument("--world", default="paper", help="as in world=NAME; all but paper draw their own Sun")
    parser.add_argument("--picture", type=Path, help="with --case or --flights: where to, a PNG")
    parser.add_argument("--flights", type=int, choices=range(1, 9), help="draw so many, and nothing else")
    options = parser.parse_args(arguments)
    if options.flights is not None and options.picture is None:
        parser.error("--flights draws a picture; add --picture FILE.png")
    overrides = [f"seed={options.seed}", f"monte_carlo.num_cases={options.cases}", f"world={options.world}"]
    overrides += [f"sun={options.sun}"] if options.world == "paper" else []
    experiment, guarded = (
        compose_experiment(["+experiment=evaluate", *overrides, f"safety={safety}"]).experiment
        for safety in ("none", "filter")
    )
    controller = source.named(options.controller, experiment.mission)
    if options.case is not None:
        return print_flight(experiment, controller, options.case, options.picture)
    scenarios = evaluation_scenarios(replace(experiment, seed=options.seed))
    if options.flights is not None:
        return draw_flights(guarded.mission, controller, scenarios[: options.flights], options.picture)
    if options.without:
        return print_without(experiment.mission, controller, scenarios)
    episodes = fly(experiment.mission, controller, scenarios)
    print_outcome({"none": episodes, "filter": fly(guarded.mission, controller, scenarios)})
    print_by_azimuth(episodes)
    print_exits(experiment.mission, controller, scenarios, episodes)
    logs = [fly_logged(experiment.mission, controller, start) for start in scenarios[: options.logged]]
    below = [start for start, is_enough in zip(scenarios, episodes["success"], strict=True) if not is_enough]
    print_missed(experiment.mission, scenarios[: options.logged], logs)
    if below:
        print("\nBelow 95 points:", end="")
        flown = [fly_logged(experiment.mission, controller, start) for start in below]
        print_missed(experiment.mission, below, flown)
    print_leans(controller)
    print_rules(controller, logs)
    return print_spent(experiment, controller)


def fly(mission: Mission, controller: Controller, scenarios: list[Scenario]) -> Columns:
    """Return the columns of an evaluation's episodes."""
    return dict(episode_columns(mission, scenarios, fly_all(mission, controller, scenarios)))


def draw_flights(mission: Mission, controller: Controller, scenarios: list[Scenario], picture: Path) -> None:
    """Draw flights around the chief, with their numbers at the starts, as a PNG."""
    paths = np.array([fly_logged(mission, controller, start).position_m for start in scenarios])
    tracks = Tracks(paths, PALETTE[: len(scenarios)], {})
    with style():
        picture.write_bytes(save(trajectories(tracks, mission), picture.stem, PICTURE_DPI).png)


def print_outcome(by_safety: dict[str, Columns]) -> None:
    """Print the results of flights without and with the safety layer."""
    print("| safety | delta-v (m/s) | rate (%) | 95 points | all 99 | outside | layer acted |")
    print("|---|---|---|---|---|---|---|")
    for safety, episodes in by_safety.items():
        stats = summarise(episodes, 95.0)
        all_seen = np.mean(episodes["inspected_count"] == np.max(episodes["inspected_count"]))
        print(
            f"| {safety} | {stats['delta_v_m_s']['mean']:.3f} "
            f"| {stats['inspection_rate_percent']['mean']:.2f} "
            f"| {100.0 * stats['success']['fraction']:.1f} % | {100.0 * all_seen:.1f} % "
            f"| {np.sum(episodes['violated'])} | {100.0 * stats['safety_acted']['fraction']:.1f} % |"
        )


def print_without(mission: Mission, controller: Controller, scenarios: list[Scenario]) -> None:
    """Print the results of flights without each single rule, and without all corners of the tables."""
    print("| without | if | then | delta-v (m/s) | rate (%) | success | outside |")
    print("|---|---|---|---|---|---|---|")
    print_row("nothing", mission, controller, scenarios)
    for index, system in enumerate(controller.systems):
        for number, rule in enumerate(system.rules):
            fewer = replace(system, rules=system.rules[:number] + system.rules[number + 1 :])
            systems = (*controller.systems[:index], fewer, *controller.systems[index + 1 :])
            words = f"{system.name} {number + 1} | {antecedent_words(rule.antecedent)} | "
            words += rule.consequents[0].term.replace("_", " ")
            print_row(words, mission, replace(controller, systems=systems), scenarios)
    without = replace(controller, systems=tuple(map(without_corners, controller.systems)))
    left = sum(len(system.rules) for system in without.systems)
    print_row(f"all corners: {left} rules", mission, without, scenarios)


def without_corners(system: FuzzySystem) -> FuzzySystem:
    """Return a rule table's system without the rules in which every input is at one of its ends."""
    ends = np.array([len(variable.terms) - 1 for variable in system.inputs])
    cells = table_cells(system.inputs)
    is_corner = ((cells == 0) | (cells == ends)).all(axis=1)
    return replace(system, rules=tuple(np.array(system.rules, dtype=object)[~is_corner]))


def print_row(words: str, mission: Mission, controller: Controller, scenarios: list[Scenario]) -> None:
    """Print the results of one controller's flights."""
    stats = summarise(fly(mission, controller, scenarios), 95.0)
    cells = words if "|" in words else f"{words} | | "
    print(
        f"| {cells} | {stats['delta_v_m_s']['mean']:.3f} | {stats['inspection_rate_percent']['mean']:.2f} "
        f"| {100.0 * stats[SUCCESS]['fraction']:.1f} % | {stats['violated']['count']} |"
    )


def azimuths(starts: Mapping[str, NDArray[Any]]) -> Floats:
    """Return the azimuths of starts in the orbit plane, from the Sun's, deg, in [0, 360)."""
    azimuth = np.arctan2(starts["position_y_m"], starts["position_x_m"]) - starts["sun_angle_rad"]
    return np.asarray(np.degrees(azimuth) % 360.0)


def print_by_azimuth(episodes: Columns) -> None:
    """Print the results of flights by the start's azimuth in the orbit plane, from the Sun's."""
    ahead = azimuths(episodes)
    print(
        "\n| azimuth from the Sun (deg) | cases | delta-v (m/s) | points | below 95 |\n|---|---|---|---|---|"
    )
    for first in range(0, 360, BIN_DEG):
        here = (ahead >= first) & (ahead < first + BIN_DEG)
        if here.any():
            print(
                f"| {first}-{first + BIN_DEG} | {here.sum()} | {episodes['delta_v_m_s'][here].mean():.3f} "
                f"| {episodes['inspected_count'][here].mean():.2f} "
                f"| {100.0 * np.mean(~episodes['success'][here].astype(bool)):.0f} % |"
            )


def print_exits(
    mission: Mission, controller: Controller, scenarios: list[Scenario], episodes: Columns
) -> None:
    """Print the flights that left the limits."""
    print("\n| outside: case | azimuth from the Sun (deg) | closest (m), at (min) | farthest (m) | points |")
    print(f"|---|{'---|' * 4}")
    ahead = azimuths(episodes)
    for case in np.flatnonzero(episodes["violated"]):
        distances = np.linalg.norm(fly_logged(mission, controller, scenarios[case]).position_m, axis=1)
        minutes = distances.argmin() * mission.control_period_s / 60.0
        print(
            f"| {case} | {ahead[case]:.0f} | {distances.min():.1f}, {minutes:.0f} "
            f"| {distances.max():.1f} | {episodes['inspected_count'][case]} |"
        )


def print_missed(mission: Mission, starts: list[Scenario], logs: list[FlightLog], most: int = 6) -> None:
    """Print the positions of missed points: latitude, and longitude from the Sun's at the start."""
    points = inspection_points(mission)
    latitude = np.degrees(np.arcsin(points[:, 2] / np.linalg.norm(points, axis=1)))
    longitude = np.degrees(np.arctan2(points[:, 1], points[:, 0]))
    shares: dict[tuple[int, int], float] = {}
    missed = [~log.is_inspected[-1] for log in logs]
    for start, is_missed in zip(starts, missed, strict=True):
        ahead = (longitude - math.degrees(start.sun_angle_rad)) % 360.0
        for point in np.flatnonzero(is_missed):
            cell = (BIN_DEG * int(latitude[point] // BIN_DEG), BIN_DEG * int(ahead[point] // BIN_DEG))
            shares[cell] = shares.get(cell, 0.0) + 1.0 / np.sum(missed)
    print(f"\nOf {len(logs)} flights, where the {np.sum(missed)} missed points lie:\n")
    print("| latitude (deg) | longitude from the Sun's at the start (deg) | share |\n|---|---|---|")
    for (north, east), share in sorted(shares.items(), key=lambda item: -item[1])[:most]:
        print(f"| {north} to {north + BIN_DEG} | {east}-{east + BIN_DEG} | {100.0 * share:.0f} % |")


def print_leans(controller: Controller) -> None:
    """Print the mean slopes of rule tables: steps of output terms per step of an input's terms."""
    print("\nLean of the rule tables, terms of the output for one term of an input (least squares):\n")
    for system in controller.systems:
        table = rule_table(system)
        if table is None:
            continue
        steps = table_cells(system.inputs).astype(np.float64)
        steps -= steps.mean(axis=0)
        leans = (steps * (table - table.mean())[:, np.newaxis]).sum(axis=0) / (steps**2).sum(axis=0)
        words = [f"{lean:+.2f} {variable.name}" for lean, variable in zip(leans, system.inputs, strict=True)]
        print(f"- {system.name}: {', '.join(words)}")


def print_rules(controller: Controller, logs: list[FlightLog]) -> None:
    """Print the rules that move each force most when it is fired, and how many ever decide."""
    print(f"\nRules where a force is fired, {len(logs)} flights:\n")
    print("| system | share | mean push (mN) | rule | if | then |\n|---|---|---|---|---|---|")
    closing = []
    for index, system in enumerate(controller.systems):
        axis = AXES.index(system.outputs[0].name[-1])
        fired = [log.force_hill_n[:, axis] != 0.0 for log in logs]
        width = len(system.inputs)
        inputs = np.concatenate(
            [log.fis_input[is_fired, index, :width] for log, is_fired in zip(logs, fired, strict=True)]
        )
        moved = contributions(compile_system(system), inputs)[:, :, 0]
        total, output = np.abs(moved).sum(axis=0), system.outputs[0]
        order = np.argsort(-total)
        for rule in order[:TOLD_RULES]:
            words = system.rules[rule]
            moves = moved[np.abs(moved[:, rule]) > 0.0, rule]
            print(
                f"| {system.name} | {100.0 * total[rule] / total.sum():.1f} % | {1000.0 * moves.mean():+.1f} "
                f"| {rule + 1} | {antecedent_words(words.antecedent)} | {words.consequents[0].term} |"
            )
        decides = np.any(np.abs(moved) > DECIDES * (output.maximum - output.minimum), axis=0)
        needed = int(np.searchsorted(np.cumsum(total[order]) / total.sum(), 0.9)) + 1
        closing.append(
            f"{system.name}: fired in {len(inputs) / len(logs):.0f} periods a flight; {needed} rules do 90 % "
            f"of the moving, {decides.sum()} of {len(system.rules)} ever move the force by more than "
            f"{100.0 * DECIDES:.0f} % of its range"
        )
    print("\n" + "\n".join(closing))


def print_spent(experiment: Experiment, controller: Controller) -> None:
    """Print when and along which axis the solved cases burn, and their plans do."""
    mission, solved = experiment.mission, solved_for(experiment)
    flown = {
        "controller": [fly_logged(mission, controller, start) for start in solved.scenarios],
        "plan": [
            fly_logged(mission, open_loop("plan", solved.plan(row, mission)), start)
            for row, start in enumerate(solved.scenarios)
        ],
    }
    period = mission.control_period_s
    print_times(solved, np.array([log.delta_v_m_s[-1] for log in flown["controller"]]))
    print(f"\nDelta-v (m/s) up to a time, mean of {len(solved.scenarios)} solved cases:\n")
    print(f"| | {' | '.join(f'{minutes} min' for minutes in UNTIL_MIN)} |\n|---|{'---|' * len(UNTIL_MIN)}")
    for name, logs in flown.items():
        spent = np.mean([log.delta_v_m_s for log in logs], axis=0)
        print(f"| {name} | {' | '.join(f'{spent[round(60 * m / period)]:.3f}' for m in UNTIL_MIN)} |")
    print("\n| | radial | along-track | across | periods with a force | last force (min), median |")
    print(f"|---|{'---|' * 5}")
    for name, logs in flown.items():
        forces = np.abs([log.force_hill_n for log in logs])
        axes = forces.sum(axis=1).mean(axis=0) * period / mission.deputy.mass_kg
        is_on = forces.sum(axis=2) > 0.0
        last = [np.flatnonzero(is_firing)[-1] * period / 60.0 for is_firing in is_on if is_firing.any()]
        print(
            f"| {name} | {' | '.join(f'{value:.3f}' for value in axes)} "
            f"| {is_on.sum(axis=1).mean():.0f} | {np.median(last):.0f} |"
        )


def print_times(solved: Solved, spent: Floats) -> None:
    """Print the solved cases' ratios of fuel to their plans', by the start's azimuth from the Sun."""
    least, times = solved.cases["delta_v_m_s"], spent / solved.cases["delta_v_m_s"]
    order = solved.cases["case"][np.argsort(times)]
    print(f"\nTimes the optimum: mean {times.mean():.2f}, median {np.median(times):.2f}; least in cases")
    print(f"{order[:3]}, in the middle {order[len(order) // 2]}, most in {order[-3:]}\n")
    print("| azimuth from the Sun (deg) | solved cases | delta-v (m/s) | plan (m/s) |\n|---|---|---|---|")
    ahead = azimuths(solved.cases)
    for first in range(0, 360, SECTOR_DEG):
        is_in_sector = (ahead >= first) & (ahead < first + SECTOR_DEG)
        print(
            f"| {first}-{first + SECTOR_DEG} | {is_in_sector.sum()} | {spent[is_in_sector].mean():.3f} "
            f"| {least[is_in_sector].mean():.3f} |"
        )


def print_flight(experiment: Experiment, controller: Controller, case: int, picture: Path | None) -> None:
    """Print a solved case's burns, force by force: when, how much, by which rule."""
    mission, solved = experiment.mission, solved_for(experiment)
    row = int(np.flatnonzero(solved.cases["case"] == case)[0])
    start = solved.scenarios[row]
    log = fly_logged(mission, controller, start)
    if picture is not None:
        plan = fly_logged(mission, open_loop("plan", solved.plan(row, mission)), start)
        colours = dict(zip(("controller", "plan of least fuel"), PALETTE, strict=False))
        tracks = Tracks(np.stack([log.position_m, plan.position_m]), list(colours.values()), colours)
        with style():
            picture.write_bytes(save(trajectories(tracks, mission), picture.stem, PICTURE_DPI).png)
    print("| force | from (min) | to | delta-v (m/s) | points at the end | rule that pushes most |")
    print(f"|---|{'---|' * 5}")
    for index, system in enumerate(controller.systems):
        axis = AXES.index(system.outputs[0].name[-1])
        force, period = log.force_hill_n[:, axis], mission.control_period_s
        fired = np.flatnonzero(force != 0.0)
        ends = np.flatnonzero((np.diff(fired) > PAUSE) | (np.diff(np.sign(force[fired])) != 0.0)) + 1
        compiled = compile_system(system)
        for burn in np.split(fired, ends):
            inputs = log.fis_input[burn, index, : len(system.inputs)]
            # in the burn's direction: other rules, perhaps stronger ones, oppose it
            moved = np.sign(force[burn[0]]) * contributions(compiled, inputs)[:, :, 0].sum(axis=0)
            print(
                f"| {system.name} | {burn[0] * period / 60.0:.1f} | {(burn[-1] + 1) * period / 60.0:.1f} "
                f"| {force[burn].sum() * period / mission.deputy.mass_kg:+.4f} "
                f"| {log.is_inspected[burn[-1] + 1].sum()} "
                f"| {int(moved.argmax()) + 1}: {sentence(system.rules[int(moved.argmax())])} |"
            )
    print(f"\n{log.delta_v_m_s[-1]:.3f} m/s, {log.is_inspected[-1].sum()} points")


if __name__ == "__main__":
    main(sys.argv[1:])
