"""The player as a part of a page: its cases, the modules that fly them, and flights that were recorded."""

from typing import Any

import numpy as np

from fis_tools.model.thrust import COMPONENTS, REASONS
from fis_tools.review import carried, transcribed
from pipeline.flight.world.chief import chief_attitudes
from pipeline.flight.world.pack import inspection_points
from pipeline.player.arguments import LIT
from pipeline.player.flown import PACKAGE, as_text, module, tells_reasons
from pipeline.player.motion import motion_data
from pipeline.player.runs import Carried, PlayedCases, PlayedPage, PlayedRun
from plain_files.document.html import ScriptedPanel, read
from telemetry.page import panel as recorded

#: of the review of rules, which the player infers with
OF_REVIEW = ("systems", "inference", "shares", "memberships")
SCRIPTS = ("reasons", "flown", "inference_now")
#: decimals of a column beyond those that are shown
MORE = 2
#: where no system is inferred
NO_INFERENCE = "const TRANSCRIBED = { FUZZY: {}, SHAPES: {}, DEFUZZIFIERS: {} };"


def panel(page: PlayedPage) -> ScriptedPanel:
    """Return the player of a page."""
    systems = [system for run, _ in page.runs for system in _inferred(run)]
    data = [carried.system_data(system) for system in systems]
    runs = [_run(run, of_run) for run, of_run in page.runs]
    modules = dict.fromkeys(run["module"] for run in runs if run["module"])
    arrays = read("scripts/arrays.js", recorded.PACKAGE)
    worker = [arrays, *(read(f"scripts/{name}.js", PACKAGE) for name in ("module", "worker"))]
    content = {
        "title": page.title,
        "fileName": page.file_name,
        "runs": runs,
        "words": REASONS,
        "quadrature": carried.quadrature_data(systems) if systems else ["", ""],
        "cases": _cases(page.cases) if page.cases else None,
        "first": page.first,
        "fleets": list(page.fleets) or [1] * len(runs),
        "modules": {name: recorded.packed(module(name)) for name in modules},
        "worker": recorded.as_script("\n".join(worker)) if modules else "",
    }
    code = [transcribed.script(data) if data else NO_INFERENCE]
    code += [read(f"scripts/{name}.js", "fis_tools.review") for name in OF_REVIEW]
    code += [read(f"scripts/{name}.js", PACKAGE) for name in SCRIPTS]
    return recorded.panel(page.title, content, [run.name for run, _ in page.runs], code)


def _inferred(run: PlayedRun) -> list[Any]:
    """Return the systems that the page infers: none such as weighted averages, which scripts do not."""
    systems = list(run.controller.systems)
    return [] if any(system.weighed for system in systems) else systems


def _run(run: PlayedRun, of_run: Carried) -> dict[str, Any]:
    systems = _inferred(run)
    data = [carried.system_data(system) | {"axis": _axis_of(system.outputs[0].name)} for system in systems]
    flown = of_run.flown or {"module": "", "snapshot": None, "own": None}
    return {
        "name": run.name,
        "fileName": run.file_name,
        "command": run.command,
        "why": of_run.why,
        "flight": _flight(run, is_plain=flown["module"] not in ("", LIT)),
        "systems": data,
        "recorded": dict(of_run.recorded),
        "ends": recorded.planes(of_run.ends, "<i4") if of_run.ends else "",
        "reasons": dict(of_run.reasons),
        **flown,
    }


def _axis_of(name: str) -> int:
    return COMPONENTS.index(name) if name in COMPONENTS else -1


def _flight(run: PlayedRun, *, is_plain: bool) -> dict[str, Any]:
    """Return what all flights of a run share."""
    mission, controller = run.mission, run.controller
    inspects = mission.problem.kind == "inspection"
    points = inspection_points(mission) if inspects else np.zeros((0, 3))
    attributes = dict(getattr(controller.fuzzy, "attributes", ()))
    period = attributes.get("decision_period_s")
    stride = max(1, round(float(period) / mission.control_period_s)) if period else 1
    turns = inspects and mission.chief.initial_angular_velocity_rad_s is not None
    deputy = mission.deputy
    return {
        "numSamples": mission.num_controls + 1,
        "periodS": mission.control_period_s,
        **motion_data(mission),
        "radius": float(np.linalg.norm(points, axis=1).max()) if inspects else mission.problem.goal_radius_m,
        "isSphere": mission.chief.shape == "sphere",
        "limits": [deputy.min_distance_m, deputy.max_distance_m] if inspects else [],
        "numPoints": len(points),
        "numCounted": len(points),
        "points": as_text(points, "<f4"),
        "attitude": as_text(chief_attitudes(mission), "<f4") if turns else "",
        "maxForce": deputy.max_force_n,
        "coastsWhenComplete": mission.coast_when_complete,
        "stride": stride,
        "numSystems": len(controller.systems),
        "isPlain": is_plain,
        "tellsReasons": tells_reasons(mission, controller),
    }


def _cases(cases: PlayedCases) -> dict[str, Any]:
    columns = [
        {
            "name": each.name,
            "label": each.label,
            "decimals": each.decimals,
            "isTold": each.is_told,
            "values": recorded.planes(np.round(each.values * 10.0 ** (each.decimals + MORE)), "<i8"),
            "parts": 10 ** (each.decimals + MORE),
        }
        for each in cases.columns
    ]
    plots = [
        {"name": plot.name, "title": plot.title, "columns": plot.columns, "isPaired": plot.is_paired}
        for plot in cases.plots
    ]
    succeeds = [as_text(np.packbits(marks, bitorder="little"), "u1") for marks in cases.succeeds]
    return {
        "steps": as_text(np.diff(cases.numbers, prepend=0), "<i4"),
        "succeeds": succeeds,
        "columns": columns,
        "plots": plots,
        "words": list(cases.words),
        "outcome": cases.outcome,
    }
