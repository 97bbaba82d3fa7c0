"""The player as a part of a page: its cases, the module that flies them, and flights that were recorded."""

import base64
import gzip
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from importlib.resources import files
from typing import Any

import numpy as np
from markupsafe import Markup
from numpy.typing import NDArray

from fis_tools.document.html import ScriptedPanel, read, template
from fis_tools.file_access import read_shipped
from fis_tools.model.thrust import COMPONENTS, REASONS
from fis_tools.plain_text import parse_json
from fis_tools.review import carried, transcribed
from pipeline.array_types import Booleans, Floats, Integers
from pipeline.flight.control.controller import Controller, RuleController
from pipeline.flight.control.law import rehearsed_pushes
from pipeline.flight.fly.plain import is_interpreted
from pipeline.flight.fly.replanning import foresees
from pipeline.flight.fly.tours import tour_images
from pipeline.flight.state.arrays import CASE
from pipeline.flight.state.log import Scenario
from pipeline.flight.world.pack import inspection_points
from pipeline.player.arguments import arguments_of
from pipeline.player.memory import Memory, types_of
from pipeline.player.motion import free_motion
from pipeline.player.snapshot import snapshot_of
from pipeline.settings.dispersions import distributions
from pipeline.settings.experiment import Mission

PACKAGE = "pipeline.player"
VIEW = f"{PACKAGE}.flight_view"
#: of the review of rules, which the player infers with
OF_REVIEW = ("elements", "scale", "carried", "inference", "shares", "memberships")
#: joined in this order
SCRIPTS = (
    *("module", "reasons", "flown", "saving", "plots", "points_map", "dots", "cases_table", "bouts"),
    *("inference_now", "player"),
)
#: fields of a log that a case's panels read
LOGGED = (
    *("position_m", "velocity_m_s", "force_hill_n", "force_asked_n", "safety_force_hill_n", "fis_input"),
    *("sun_angle_rad", "sun_elevation_rad", "delta_v_m_s", "is_inspected", "is_decided"),
)
HILL = "hill"


@dataclass(frozen=True)
class CaseColumn:
    """A number of each case: its name, its words with their unit, and its decimals."""

    name: str
    label: str
    decimals: int
    values: Floats


@dataclass(frozen=True)
class PlayedCases:
    """Cases of a run: numbers, (n,), whether each succeeds, (n,), starts of `CASE`, (n,), and columns."""

    numbers: Integers
    is_good: Booleans
    starts: NDArray[Any]
    columns: Sequence[CaseColumn]


@dataclass(frozen=True)
class PlayedRun:
    """What a player shows.

    Parameters
    ----------
    title : str
        Of a flight that is no case.
    file_name : str
        With which files that are saved begin, and by which an address names the run.
    mission : Mission
    controller : Controller
    command : str
        Which flies a case of the run, ``CASE`` standing for its number.
    cases : PlayedCases, optional
    first : int
        Row of the case that is shown first.
    recorded : mapping of int to mapping
        Flights that the page carries, by row, as `pipeline.report.scene` writes them.
    """

    title: str
    file_name: str
    mission: Mission
    controller: Controller
    command: str = ""
    cases: PlayedCases | None = None
    first: int = 0
    recorded: Mapping[int, Mapping[str, Any]] = field(default_factory=dict)


def why_recorded(mission: Mission, controller: Controller) -> str:
    """Return in words why no module flies a controller's cases; empty if one may."""
    is_rules = isinstance(controller, RuleController) and bool(controller.systems)
    is_ahead = is_rules and (
        foresees(controller) or bool(tour_images(controller)) or len(rehearsed_pushes(controller)) > 0
    )
    reasons = {
        "flights to a goal are not flown in a page": mission.problem.kind != "inspection",
        "flights in plain Python are not flown in a page": mission.flight == "reference"
        or is_interpreted(mission),
        "each case has a mission of its own": bool(distributions(mission.dispersions)),
        "only rules are flown in a page": not is_rules,
        "its pushes were chosen by flights ahead": is_ahead,
        "its rules push along the deputy's axes": controller.force_axes != HILL,
    }
    return next((words for words, applies in reasons.items() if applies), "")


def flown_in_page(run: PlayedRun) -> dict[str, Any] | str:
    """Return the snapshot by which the module flies a run's cases, or why it does not."""
    why = why_recorded(run.mission, run.controller)
    if why or run.cases is None:
        return why or "the page has no cases"
    start = run.cases.starts[0]
    angle, elevation = float(start["sun_angle"]), float(start["sun_elevation"])
    scenario = Scenario(np.array(start["position"]), np.array(start["velocity"]), angle, elevation)
    to_fly = arguments_of(run.mission, run.controller, [scenario])
    if to_fly is None:
        return "other light than the paper's, clusters and errors are not flown in a page"
    if types_of(to_fly.leaves(Memory())) != _types_of_module():
        return "this installation's arrays are of other types than the module's"
    shared = ("flights.cases", *(f"results.log.{field_name}" for field_name in LOGGED))
    return snapshot_of({"fly": to_fly}, shared, ("first", "last"))


def module() -> bytes:
    """Return the compiled module."""
    return (files(PACKAGE) / "modules" / "flight.wasm").read_bytes()  # file: a part of the package


def _types_of_module() -> int:
    return int(parse_json(read_shipped(files(PACKAGE) / "modules" / "types.json"))["fly"])


def panel(run: PlayedRun) -> ScriptedPanel:
    """Return the player of a run."""
    chosen = flown_in_page(run)
    flown = chosen if isinstance(chosen, dict) else None
    # such as weighted averages, which scripts do not infer
    systems = [] if any(system.weighed for system in run.controller.systems) else run.controller.systems
    data = [carried.system_data(system) | {"axis": _axis_of(system.outputs[0].name)} for system in systems]
    page = {
        "title": run.title,
        "fileName": run.file_name,
        "command": run.command,
        "why": "" if flown else chosen,
        "flight": _flight(run, is_plain=flown is not None),
        "words": REASONS,
        "systems": data,
        "quadrature": carried.quadrature_data(systems) if systems else ["", ""],
        "cases": _cases(run.cases) if run.cases else None,
        "first": run.first,
        "recorded": dict(run.recorded),
        "module": _packed(module()) if flown else "",
        "snapshot": flown,
        "worker": "".join(_as_script(read(f"scripts/{name}.js", PACKAGE)) for name in ("module", "worker")),
        "starts": _packed(run.cases.starts.tobytes()) if flown and run.cases else "",
    }
    of_player = [read(f"scripts/{name}.js", PACKAGE) for name in SCRIPTS]
    of_view = [read(f"{name}.js", VIEW) for name in ("view", "recorded")]
    of_review = [read(f"scripts/{name}.js", "fis_tools.review") for name in OF_REVIEW]
    code = _as_script(
        "\n".join([transcribed.script(data) if data else NO_INFERENCE, *of_review, *of_view, *of_player])
    )
    body = template("pipeline", "player", "player.html").render(
        frame=Markup(read("frame.html", VIEW)),  # noqa: S704 - of this package
        has_cases=run.cases is not None,
    )
    style = Markup(read("view.css", VIEW) + read("player.css", PACKAGE))  # noqa: S704 - likewise
    # files of our packages, and JSON that cannot end a script
    script = Markup(f'"use strict";(() => {{\nconst PLAYER = {carried.as_json(page)};\n{code}\n}})();')  # noqa: S704
    return ScriptedPanel(run.title, style, Markup(body), script)  # noqa: S704 - escaped by the template


#: where no system is inferred
NO_INFERENCE = "const TRANSCRIBED = { FUZZY: {}, SHAPES: {}, DEFUZZIFIERS: {} };"


def _as_script(code: str) -> str:
    """Make a script of modules."""
    lines = [line for line in code.split("\n") if not line.startswith("import ")]
    return "\n".join(line.removeprefix("export ") for line in lines)


def _axis_of(name: str) -> int:
    return COMPONENTS.index(name) if name in COMPONENTS else -1


def _flight(run: PlayedRun, *, is_plain: bool) -> dict[str, Any]:
    """Return what all flights of a run share."""
    mission, controller = run.mission, run.controller
    points = inspection_points(mission)
    is_linear = mission.dynamics.model == "cw"
    mean_motion = mission.orbit.mean_motion_rad_s
    period = dict(controller.fuzzy.attributes).get("decision_period_s") if controller.fuzzy else None
    stride = max(1, round(float(period) / mission.control_period_s)) if period else 1
    return {
        "numSamples": mission.num_controls + 1,
        "periodS": mission.control_period_s,
        "meanMotion": mean_motion,
        "radius": float(np.linalg.norm(points, axis=1).max()),
        "isSphere": mission.chief.shape == "sphere",
        "limits": [mission.deputy.min_distance_m, mission.deputy.max_distance_m],
        "numPoints": len(points),
        "numCounted": len(points),
        "points": _text(points, "<f4"),
        "freeMotion": _text(free_motion(mean_motion), "<f4") if is_linear else "",
        "maxForce": mission.deputy.max_force_n,
        "coastsWhenComplete": mission.coast_when_complete,
        "stride": stride,
        "numSystems": len(controller.systems),
        "isPlain": is_plain,
    }


def _cases(cases: PlayedCases) -> dict[str, Any]:
    columns = [
        {
            "name": each.name,
            "label": each.label,
            "decimals": each.decimals,
            "values": _text(each.values, "<f4"),
        }
        for each in cases.columns
    ]
    good = np.packbits(cases.is_good, bitorder="little")
    return {"numbers": _text(cases.numbers, "<i4"), "isGood": _text(good, "u1"), "columns": columns}


def starts_of(columns: Mapping[str, Floats], names: Mapping[str, str]) -> NDArray[Any]:
    """Return starts from columns of numbers; `names` says which part each is, such as ``position.0``."""
    starts = np.zeros(len(next(iter(columns.values()))), CASE)
    for name, values in columns.items():
        where = names[name]
        part, _, index = where.partition(".")
        target = starts[part]
        if index:
            target[:, int(index)] = values
        else:
            target[:] = values
    return starts


def _text(values: Any, kind: str) -> str:
    return base64.b64encode(np.ascontiguousarray(values, dtype=kind).tobytes()).decode("ascii")


def _packed(content: bytes) -> str:
    return base64.b64encode(gzip.compress(content, 9, mtime=0)).decode("ascii")
