"""The compiled flight as a WebAssembly module for the pages: ``python -m docs.browser``.

What the browser flies is the product's own code: numba's of `fly_many` for `CONTROLLER` in the paper's world,
compiled for WebAssembly (`docs.webassembly`), and that of the rules' shares in a push. A page changes the
start, the Sun and the tables of the rules; `flight.json` says where each lies, and holds the rules in words.

It needs ``wasm-ld`` (``apt install lld-19``) and ``wasm-opt`` of binaryen 120 or later (``npm install
binaryen``) on the path; whoever builds or tests the pages does not, for the module is part of the repository.
"""

import json
import math
import os
import re
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from docs.home import CONTROLLER, FILE, FOLDER, NUM_STARTS, experiment
from docs.webassembly import Memory, target_machine, translate, write_module
from fis_tools.analysis.arrays import FIRED
from fis_tools.analysis.coalitions import by_level, weighted_coalitions
from fis_tools.analysis.shapley import conclude_subsets
from fis_tools.compiled.decorator import compiled
from fis_tools.engines import packing
from fis_tools.engines.kernel import fuzzify
from fis_tools.formats.serialize import load
from fis_tools.model import FuzzySystem, Term, Triangular, Variable, conjunctions
from fis_tools.words.text import sentence
from pipeline.controllers import source
from pipeline.flight.cases.starts import cases_of
from pipeline.flight.control.law import law_of
from pipeline.flight.fly.many import Results, fly_many
from pipeline.flight.fly.population import flights_of
from pipeline.flight.fly.replanning import foresees
from pipeline.flight.fly.workspace import make_state, make_workspace
from pipeline.flight.state import arrays
from pipeline.flight.state.arrays import NUM_OUTCOMES, NUM_TRACKED
from pipeline.flight.state.log import empty_log
from pipeline.flight.world.pack import pack_world
from pipeline.physics.motion import state_transition
from pipeline.scenarios import evaluation_scenarios

#: code for any processor, not yet optimised for this one; numba reads this when it is imported
PORTABLE = {"NUMBA_OPT": "0", "NUMBA_CPU_NAME": "generic", "NUMBA_CPU_FEATURES": ""}
#: flights side by side: WebAssembly's vectors hold two numbers
LANES = 2
#: samples of one orbit of free motion
NUM_COASTED = 97
#: arrays that a page reads or writes, by the names of the arguments
SHARED = (
    "flights.law.layout",
    "flights.values",
    "flights.rules",
    "flights.cases",
    "flights.world.points",
    "work.scratch",
    "results.outcomes",
    "results.tracks",
    *(
        f"results.log.{name}"
        for name in (
            "position_m",
            "velocity_m_s",
            "force_hill_n",
            "is_inspected",
            "sun_angle_rad",
            "fis_input",
            "is_decided",
            "delta_v_m_s",
            "num_candidates",
        )
    ),
    "free_motion",
    "shares",
)


@compiled(nogil=True, error_model="numpy")
def rule_shares(
    values: Any, rules: Any, layout: Any, index: int, scratch: Any, members: Any, weights: Any, shares: Any
) -> None:
    """Write what each packed rule of a system adds to its output for the inputs of the first lane.

    Parameters
    ----------
    members, weights : (k + 1, 2**k, k), (k + 1, k, 2**k)
        The coalitions of up to k players, and their weights in the players' shares.
    """
    system, room = layout[index], scratch[0]
    fuzzify(values, system, room)
    terms, bounds = system.output_terms, system.rules + system.output_terms
    slots, num_rules = bounds + terms + 1, rules[bounds + terms]
    strengths, strongest = np.ones(num_rules), 0.0
    for rule in range(num_rules):
        for column in range(system.num_inputs):
            slot = rules[slots + system.num_inputs * rule + column]
            strengths[rule] = min(strengths[rule], room.memberships[slot, 0])
        strongest = max(strongest, strengths[rule])
    always, firing = np.zeros((1, terms)), np.empty((1, num_rules))
    players, term_of, count = np.empty(num_rules, np.int64), np.empty((1, num_rules), np.int64), 0
    for term in range(terms):
        for rule in range(rules[bounds + term], rules[bounds + term + 1]):
            shares[rule] = 0.0
            if strengths[rule] > 0.0 and strengths[rule] >= min(FIRED, strongest):
                players[count], term_of[0, count], firing[0, count] = rule, term, strengths[rule]
                count += 1
            else:
                always[0, term] = max(always[0, term], strengths[rule])
    size = 1 << count
    worth, packed = np.empty((size, 1)), (values, rules, layout[index : index + 1])
    conclude_subsets(
        packed, (always, term_of[:, :count], firing[:, :count]), members[count, :size, :count], scratch, worth
    )
    worth[0] = values[system.output_values + packing.DEFAULT]
    for player in range(count):
        for coalition in range(size):
            shares[players[player]] += weights[count, player, coalition] * worth[coalition, 0]


def games(most: int) -> tuple[Any, Any]:
    """Return the coalitions of up to so many players, and their weights, as `rule_shares` takes them."""
    members, weights = np.zeros((most + 1, 2**most, most), np.bool_), np.zeros((most + 1, most, 2**most))
    for count in range(1, most + 1):
        some_members, some_weights = weighted_coalitions((by_level((1,)),) * count)
        members[count, : 2**count, :count] = some_members
        weights[count, :count, : 2**count] = some_weights
    return members, weights


def most_firing(systems: Sequence[FuzzySystem]) -> int:
    """Return how many rules of a system can fire together, wherever the peaks of its terms are moved."""
    most = 1
    for system in systems:
        overlaps = [
            max(sum(other.left <= shape.left < other.right for other in shapes) for shape in shapes)
            for shapes in ([triangle(term) for term in variable.terms] for variable in system.inputs)
        ]
        most = max(most, math.prod(overlaps))
    return most


def build(folder: Path) -> None:
    """Write ``flight.wasm`` and ``flight.json`` into a folder."""
    flown = experiment()
    mission, starts = flown.mission, evaluation_scenarios(flown)
    controller = source.named(CONTROLLER, mission)
    if foresees(controller):
        sys.exit(f"{CONTROLLER} plans its pushes ahead, which the page's flight does not; choose rules alone")
    world, cases = pack_world(mission), cases_of(mission, starts)
    law, numbers = law_of(controller, mission), controller.numbers
    parts, flights, _ = flights_of(world, law, numbers, cases)
    log = empty_log(mission.num_controls, mission.num_attitude_steps, world.num_points, len(law.axes))
    tracks = np.zeros((NUM_STARTS, mission.num_controls + 1, NUM_TRACKED), np.float32)
    results = Results(np.zeros((NUM_STARTS, NUM_OUTCOMES)), log, tracks=tracks)
    state, work = make_state(world, parts[-1], LANES), make_workspace(world, LANES)

    memory = Memory()
    values, rules = flights.values[0, 0], flights.rules[0]
    to_fly = (*parts, flights, state, work, results, 0, 0)
    fly_names = (
        "optics",
        "guard",
        "clusters",
        "pushes",
        "errors",
        "flights",
        "state",
        "work",
        "results",
        "",
        "",
    )
    systems = load(FILE).systems
    shares = np.zeros(max(len(system.rules) for system in systems))
    to_share = (values, rules, law.layout, 0, work.scratch, *games(most_firing(systems)), shares)
    share_names = ("values", "rules", "layout", "", "scratch", "members", "weights", "shares")

    target = target_machine()
    translated = [
        translate(memory, target, name, function, arguments, names, chosen)
        for name, function, arguments, names, chosen in (
            ("fly", fly_many, to_fly, fly_names, ("first", "last", "logged", "tracked")),
            ("share", rule_shares, to_share, share_names, ("system",)),
        )
    ]
    memory.add("free_motion", free_motion(mission.orbit.mean_motion_rad_s))
    folder.mkdir(parents=True, exist_ok=True)
    write_module(folder / "flight.wasm", target, memory, translated)
    content = tables(memory, mission, world.num_points, work.scratch.dtype)
    (folder / "flight.json").write_text(json.dumps(content, separators=(",", ":")), encoding="utf-8")


def free_motion(mean_motion: float) -> Any:
    """Return what leads from a state to positions of free motion over one orbit, (NUM_COASTED, 3, 6)."""
    times = np.linspace(0.0, 2.0 * np.pi / mean_motion, NUM_COASTED)
    return np.array([np.asarray(state_transition(mean_motion, time_s))[:3] for time_s in times])


def tables(memory: Memory, mission: Any, num_points: int, scratch: Any) -> dict[str, Any]:
    """Return what a page needs besides the module: the controller in words, and where arrays lie."""
    controller = load(FILE)
    return {
        "controller": controller.name,
        "purpose": controller.purpose,
        "systems": [_system(system) for system in controller.systems],
        "attributes": dict(controller.attributes),
        "num_points": num_points,
        "num_starts": NUM_STARTS,
        "num_controls": mission.num_controls,
        "control_period_s": mission.control_period_s,
        "radius_m": mission.chief.inspection_radius_m,
        "min_distance_m": mission.deputy.min_distance_m,
        "max_distance_m": mission.deputy.max_distance_m,
        "threshold_percent": mission.inspection_threshold_percent,
        "outcomes": {"delta_v": arrays.DELTA_V, "inspected": arrays.INSPECTED, "outside": arrays.OUTSIDE},
        "file": edited_file(),
        "arrays": {name: memory.arrays[name] for name in SHARED},
        "inputs": scratch.fields["inputs"][1],
    }


def edited_file() -> str:
    """Return the file that a page saves: the controller's under a name of its own, without its history."""
    text = FILE.read_text(encoding="utf-8").partition("---\n")[2]
    text = re.sub(r"^name: .*$", f'name: "{CONTROLLER}, edited"', text, flags=re.MULTILINE)
    text = re.sub(
        r"^purpose: .*$",
        f'purpose: "{CONTROLLER} with rules edited on a page; not measured"',
        text,
        flags=re.MULTILINE,
    )
    return re.sub(r"^provenance:\n(?:  .*\n)+", "", text, flags=re.MULTILINE)


def _system(system: FuzzySystem) -> dict[str, Any]:
    rules = conjunctions(system)
    if rules is None:
        raise ValueError(f"rules of {system.name} are no plain conjunctions, which the page cannot change")
    (output,) = system.outputs
    return {
        "name": system.name,
        "inputs": [_variable(variable) for variable in system.inputs],
        "output": _variable(output) | {"default": output.default or 0.0},
        "rules": [
            {"if": [int(term) for term in row], "then": int(term)} for row, term in zip(*rules, strict=True)
        ],
        "sentences": [sentence(rule).rpartition(" then ")[0] for rule in system.rules],
    }


def _variable(variable: Variable) -> dict[str, Any]:
    terms = [{"name": term.name} | asdict(triangle(term)) for term in variable.terms]
    described = {"name": variable.name, "unit": variable.unit, "description": variable.description}
    return described | {
        "range": [variable.minimum, variable.maximum],
        "points": variable.num_points,
        "terms": terms,
    }


def triangle(term: Term) -> Triangular:
    """Return the shape of a term, which must be a triangle."""
    if not isinstance(term.membership, Triangular):
        raise ValueError(f"term {term.name} is no triangle, which the page cannot change")
    return term.membership


def main() -> None:
    """Write the module and its table into `FOLDER`, in a process of its own."""
    if PORTABLE.items() <= os.environ.items():
        build(FOLDER)
        return
    command = [sys.executable, "-m", "docs.browser"]
    sys.exit(subprocess.run(command, env=os.environ | PORTABLE, check=False).returncode)  # noqa: S603


if __name__ == "__main__":
    main()
