"""The cost of making a learned policy readable: ``python -m benchmarks imitated POLICY.onnx sun=random``.

Fuzzy systems, one for each force, learn from the policy's actions on its own flights, and then also on theirs
(Ross, Gordon and Bagnell, AISTATS 2011: otherwise they meet states that the policy never visited). They
choose their inputs among the signals that follow from the policy's observations. Policy and systems fly from
the same other starts.
"""

import argparse
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from benchmarks.policies import row
from fis_tools.engines.compiler import compile
from fis_tools.formats import serialize
from fis_tools.learning import learn
from fis_tools.model import FuzzyController
from pipeline.command_line.config import compose_experiment
from pipeline.controllers.learned import Policy, answer
from pipeline.controllers.source import named
from pipeline.flight.control.controller import Controller, from_fuzzy
from pipeline.flight.fly.simulation import fly_all
from pipeline.flight.fly.stepping import NUM_SEEN, NUM_UNSEEN, POSITION, SUN, TARGET, VELOCITY, SteppedFlights
from pipeline.flight.state.arrays import NUM_TRACKED, TRACK_FORCE
from pipeline.flight.state.log import Scenario
from pipeline.scenarios import evaluation_scenarios, validation_scenarios
from pipeline.settings.experiment import Mission

Floats = NDArray[np.float64]

FORCES: Final = ("force_x", "force_y", "force_z")
AXES: Final = ("radial", "along_track", "cross_track")
#: one sample in this many is learned from
EVERY: Final = 5


def signals(seen: Floats, mean_motion: float) -> Mapping[str, Floats]:
    """Return the signals of flights that follow from the observations, with their units."""
    position, velocity = seen[:, POSITION : POSITION + 3].T, seen[:, VELOCITY : VELOCITY + 3].T
    target, sun = seen[:, TARGET : TARGET + 3].T, seen[:, SUN : SUN + 3].T
    reach = np.maximum(np.hypot(position[0], position[1]), 1e-6)
    length = np.maximum(np.linalg.norm(target, axis=0), 1e-6)
    return {
        **{f"position_{axis} (m)": position[index] for index, axis in enumerate(AXES)},
        **{f"velocity_{axis} (m/s)": velocity[index] for index, axis in enumerate(AXES)},
        **{f"target_{axis}": target[index] / length for index, axis in enumerate(AXES)},
        "centre_radial (m)": 4.0 * position[0] + 2.0 * velocity[1] / mean_motion,
        "centre_along_track (m)": position[1] - 2.0 * velocity[0] / mean_motion,
        "sun_alignment": (position[0] * sun[0] + position[1] * sun[1]) / reach,
        "sun_ahead": (position[0] * sun[1] - position[1] * sun[0]) / reach,
        "distance (m)": np.linalg.norm(position, axis=0),
    }


def sensed_along(
    policy: Policy, mission: Mission, starts: list[Scenario], forces: Floats
) -> tuple[Floats, Floats]:
    """Return the observations in flights under forces, (m, K, 3), and the policy's actions, as rows."""
    is_tilted = any(start.sun_elevation_rad != 0.0 for start in starts)
    flights = SteppedFlights(mission, len(starts), is_tilted=is_tilted)
    for flight, start in enumerate(starts):
        flights.start(flight, start)
    work, commanded = np.zeros((2, policy.network.widths.max())), np.zeros((len(starts), 3))
    seen, answers = [], []
    flights.step(commanded)
    for k in range(mission.num_controls):
        # once all is seen nothing is fired, whatever the policy's action
        is_asked = flights.observed[:, NUM_UNSEEN] > 0.0
        if k % EVERY == 0:
            answer(policy.network, flights.seen.astype(np.float64), work, commanded)
            seen.append(flights.observed[is_asked, :NUM_SEEN])
            answers.append(commanded[is_asked])
        flights.step(forces[:, k])
    return np.concatenate(seen), np.concatenate(answers)


def flown_forces(mission: Mission, controller: Controller, starts: list[Scenario]) -> Floats:
    """Return the forces that a controller fires, (m, K, 3), N, Hill axes."""
    tracks = np.empty((len(starts), mission.num_controls + 1, NUM_TRACKED), dtype=np.float32)
    fly_all(mission, controller, starts, tracks=tracks)
    return tracks[:, :-1, TRACK_FORCE : TRACK_FORCE + 3].astype(np.float64)


def learned(rows: Floats, answers: Floats, mission: Mission, terms: int, name: str) -> FuzzyController:
    """Learn a system for each force."""
    inputs = signals(rows, mission.orbit.mean_motion_rad_s)
    systems = [
        learn({**inputs, f"{force} (N)": answers[:, column]}, f"{force} (N)", consequents="sets", terms=terms)
        for column, force in enumerate(FORCES)
    ]
    return FuzzyController(name, tuple(systems), (("force_axes", "hill"),))


def explained(fuzzy: FuzzyController, rows: Floats, answers: Floats, mission: Mission) -> float:
    """Return the share of the variance of the policy's actions that the systems explain."""
    inputs = {
        label.partition(" (")[0]: values
        for label, values in signals(rows, mission.orbit.mean_motion_rad_s).items()
    }
    given = np.column_stack(
        [
            compile(system)(np.column_stack([inputs[variable.name] for variable in system.inputs]))[:, 0]
            for system in fuzzy.systems
        ]
    )
    return float(1.0 - np.square(given - answers).sum() / np.square(answers - answers.mean(axis=0)).sum())


def main(arguments: Sequence[str]) -> int:
    """Imitate, round by round, and fly."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks imitated", description=__doc__)
    parser.add_argument("--terms", type=int, default=3, help="of each input")
    parser.add_argument("--rounds", type=int, default=3, help="of learning, each with more flights")
    parser.add_argument("--starts", type=int, default=40, help="flights of a round")
    parser.add_argument("--cases", type=int, default=300, help="flights to judge by")
    parser.add_argument("--seed", type=int, default=6, help="of the starts")
    parser.add_argument("--out", type=Path, help="file for the last controller (.json)")
    parser.add_argument("policy", help="an ONNX file")
    parser.add_argument("words", nargs="*", help="of the world")
    options = parser.parse_args(arguments)
    base = [*options.words, f"monte_carlo.num_cases={options.cases}", f"seed={options.seed}"]
    experiment: Any = compose_experiment(["+experiment=train_paper", *base]).experiment
    mission, controller = experiment.mission, named(options.policy, experiment.mission)
    policy: Any = controller.pilot
    judged = evaluation_scenarios(experiment)
    flown, threshold = controller, mission.inspection_threshold_percent
    rows, answers = np.zeros((0, NUM_SEEN)), np.zeros((0, 3))
    lines = [row("the policy", [fly_all(mission, controller, judged)], threshold)]
    starts = validation_scenarios(experiment, options.starts * (options.rounds + 1))
    for number in range(1, options.rounds + 1):
        chosen = starts[(number - 1) * options.starts : number * options.starts]
        seen, done = sensed_along(policy, mission, chosen, flown_forces(mission, flown, chosen))
        rows, answers = np.concatenate([rows, seen]), np.concatenate([answers, done])
        fuzzy = learned(rows, answers, mission, options.terms, f"imitated_{options.terms}")
        flown = from_fuzzy(fuzzy)
        last = starts[-options.starts :]
        share = explained(
            fuzzy, *sensed_along(policy, mission, last, flown_forces(mission, controller, last)), mission
        )
        rules = sum(len(system.rules) for system in fuzzy.systems)
        label = f"{rules} rules, round {number}, variance explained {share:.2f}"
        lines.append(row(label, [fly_all(mission, flown, judged)], threshold))
        for system in fuzzy.systems:
            senses = ", ".join(variable.name for variable in system.inputs)
            print(f"  {system.outputs[0].name}: {senses}", file=sys.stderr, flush=True)
    if options.out:
        options.out.write_text(serialize.dump_json(fuzzy) + "\n", encoding="utf-8")
    print("| controller | delta-v (m/s) | inspection rate (%) | success rate | outside the limits |")
    print("|---|---|---|---|---|", *lines, sep="\n")
    return 0
