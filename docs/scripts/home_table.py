"""What the first page computes with: a snapshot of its flights, and the controller in words and numbers."""

import re
from dataclasses import asdict
from typing import Any

from docs.scripts.home import CONTROLLER, FILE, NUM_STARTS, experiment
from fis_tools.formats.serialize import load
from fis_tools.model import FuzzySystem, Variable, conjunctions
from fis_tools.model.thrust import REASONS
from fis_tools.words.text import sentence
from pipeline.controllers import source
from pipeline.flight.state import arrays
from pipeline.player.arguments import PLAIN, arguments_of
from pipeline.player.motion import free_motion
from pipeline.player.shares import arguments_of_shares, triangle
from pipeline.player.snapshot import snapshot_of
from pipeline.scenarios import evaluation_scenarios

#: fields of a flight's log that the page reads
LOGGED = (
    *("position_m", "velocity_m_s", "force_hill_n", "force_asked_n", "safety_force_hill_n", "is_inspected"),
    *("sun_angle_rad", "fis_input", "is_decided", "delta_v_m_s", "num_candidates"),
)
#: arrays that the page reads or writes
SHARED = (
    *("flights.law.layout", "flights.values", "flights.rules", "flights.cases", "flights.world.points"),
    *("work.scratch", "results.outcomes", "results.tracks", "shares"),
    *(f"results.log.{name}" for name in LOGGED),
)
#: numbers that a call chooses: which flights, whether one is logged, whether all are tracked, and a system
CHOSEN = ("first", "last", "results.log.position_m:length0", "results.tracks:length0", "system")


def table() -> dict[str, Any]:
    """Return what the page's script is given.

    Raises
    ------
    ValueError
        If the controller plans its pushes ahead or is not rules of triangles, which the page does not fly.
    """
    flown = experiment()
    mission, controller = flown.mission, source.named(CONTROLLER, flown.mission)
    starts = evaluation_scenarios(flown)
    module, to_fly = arguments_of(mission, controller, starts, num_tracked=NUM_STARTS)
    if module != PLAIN:
        raise ValueError(f"another module flies {CONTROLLER} in the page's world than the page carries")
    to_share = arguments_of_shares(to_fly, controller.systems)
    coasted = free_motion(mission.orbit.mean_motion_rad_s)
    functions = {"fly": to_fly, "share": to_share}
    snapshot = snapshot_of(functions, SHARED, CHOSEN, freeMotion=coasted)
    scratch, file = to_share.named("scratch").dtype, load(FILE)
    return {
        "snapshot": snapshot,
        "controller": file.name,
        "purpose": file.purpose,
        "systems": [_system(system) for system in file.systems],
        "attributes": dict(file.attributes),
        "reasons": REASONS,
        "num_points": to_fly.named("flights").world.num_points,
        "num_starts": NUM_STARTS,
        "num_controls": mission.num_controls,
        "control_period_s": mission.control_period_s,
        "radius_m": mission.chief.inspection_radius_m,
        "min_distance_m": mission.deputy.min_distance_m,
        "max_distance_m": mission.deputy.max_distance_m,
        "max_force_n": mission.deputy.max_force_n,
        "coasts_when_complete": mission.coast_when_complete,
        "threshold_percent": mission.inspection_threshold_percent,
        "outcomes": {"delta_v": arrays.DELTA_V, "inspected": arrays.INSPECTED, "outside": arrays.OUTSIDE},
        "file": edited_file(),
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
