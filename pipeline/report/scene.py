"""A flight in three dimensions on the page of a report, and why each push came."""

import base64
import json
import re
from typing import Any

import numpy as np
from markupsafe import Markup

from fis_tools.analysis import shapley
from fis_tools.document.html import ScriptedPanel, read
from fis_tools.engines.compiler import compile
from fis_tools.model.thrust import COMPONENTS, REASONS
from fis_tools.words.text import sentence
from pipeline.array_types import Booleans
from pipeline.evaluation.blocks import number_of, values_at
from pipeline.flight.cases.dispersions import mission_of_case
from pipeline.flight.control.controller import Controller
from pipeline.flight.goals.flights import fly_logged
from pipeline.flight.state.log import REHEARSED, FlightLog
from pipeline.flight.world.pack import pack_world
from pipeline.player.motion import free_motion
from pipeline.player.panel import (
    CaseColumn,
    PlayedCases,
    PlayedRun,
    flown_in_page,
    panel,
    starts_of,
    why_recorded,
)
from pipeline.recording.events import chosen_ahead
from pipeline.recording.firing import delay_of, is_fired
from pipeline.recording.points import lit_and_seen
from pipeline.report.contents import Contents, ShownFlight
from pipeline.run import typed
from pipeline.scenarios import evaluation_scenarios
from pipeline.settings.experiment import Mission
from pipeline.settings.start_table import POSITION, VELOCITY

PACKAGE = "pipeline.player.flight_view"
#: what makes modules of scripts
MODULE = re.compile(r"\n(?:import .*\n|export )")
#: cases that a page has at most
MOST_CASES = 10_000
SUCCESS_COLUMN = "success"
#: columns of the cases: names, words, decimals
COLUMNS = (
    ("delta_v_m_s", "Δv, m/s", 3),
    ("inspection_rate_percent", "inspected, %", 1),
    ("min_distance_m", "nearest, m", 1),
    ("max_distance_m", "farthest, m", 1),
)
#: columns of starts, and where each belongs
STARTS = {
    **{name: f"position.{axis}" for axis, name in enumerate(POSITION)},
    **{name: f"velocity.{axis}" for axis, name in enumerate(VELOCITY)},
    "sun_angle_rad": "sun_angle",
    "sun_elevation_rad": "sun_elevation",
}
#: what was asked for along these axes is what was fired there
HILL = "hill"


def scene_of_run(contents: Contents) -> ScriptedPanel | None:
    """Return the scene of the first flight that a report shows in detail; None without one."""
    mission = contents.experiment.mission
    if not contents.shown or contents.controller is None or mission.problem.kind != "inspection":
        return None
    return scene_of(contents.shown[0], contents.controller, mission)


def player_of_run(contents: Contents) -> ScriptedPanel | None:
    """Return the player of a run's flights; None without one.

    It has the cases of the evaluation, which open where the module flies them, and besides them as recorded
    the flights that stand out; without an evaluation it has the first flight that is shown.
    """
    mission, controller = contents.experiment.mission, contents.controller
    if controller is None or mission.problem.kind != "inspection":
        return None
    name, cases = contents.experiment.name, _played_cases(contents)
    if cases is None:
        if not contents.shown:
            return None
        shown = contents.shown[0]
        recorded = {0: recorded_table(shown.log, controller, mission)}
        return panel(PlayedRun(shown.title, name, mission, controller, recorded=recorded))
    fuel = next(column.values for column in cases.columns if column.name == "delta_v_m_s")
    rate = next(column.values for column in cases.columns if column.name == "inspection_rate_percent")
    order = np.argsort(fuel, kind="stable")
    median, recorded = int(order[len(order) // 2]), {}
    if why_recorded(mission, controller) or not _is_flown(mission, controller, cases):
        rows = dict.fromkeys([median, int(order[-1]), int(np.argmin(rate))])
        starts = evaluation_scenarios(contents.experiment, [int(cases.numbers[row]) for row in rows])
        for row, start in zip(rows, starts, strict=True):
            log = fly_logged(mission, controller, start)
            recorded[row] = recorded_table(log, controller, mission_of_case(mission, start))
    command = typed.fly(typed.RUN, "case=CASE")
    return panel(PlayedRun("", name, mission, controller, command, cases, median, recorded))


def _is_flown(mission: Mission, controller: Controller, cases: PlayedCases) -> bool:
    return isinstance(flown_in_page(PlayedRun("", "", mission, controller, cases=cases)), dict)


def _played_cases(contents: Contents) -> PlayedCases | None:
    """Return the first cases of the evaluation; None without one, or without what is plotted."""
    evaluation = contents.evaluation
    if evaluation is None or evaluation.episodes is None:
        return None
    episodes = evaluation.episodes
    count = min(MOST_CASES, number_of(episodes))
    if not {"case", SUCCESS_COLUMN, *POSITION, *(name for name, *_ in COLUMNS)} <= set(episodes) or not count:
        return None
    rows = range(count)

    def column(name: str) -> Any:
        return np.array(values_at(episodes, name, rows))

    starts = starts_of({name: column(name) for name in STARTS if name in episodes}, STARTS)
    columns = [CaseColumn(name, label, decimals, column(name)) for name, label, decimals in COLUMNS]
    is_good = column(SUCCESS_COLUMN).astype(bool) & ~column("violated").astype(bool)
    return PlayedCases(column("case"), is_good, starts, columns)


def recorded_table(log: FlightLog, controller: Controller, mission: Mission) -> dict[str, Any]:
    """Return a flight as the player takes it where it is not flown in the page."""
    texts, of_sample = _reasons(mission, log, controller)
    return flight_table(log, mission) | {
        "texts": texts,
        "reasons": of_sample,
        "isDecided": _bits(log.is_decided),
        "inputs": base64.b64encode(np.ascontiguousarray(log.fis_input, "<f8").tobytes()).decode("ascii"),
    }


def scene_of(flight: ShownFlight, controller: Controller, mission: Mission) -> ScriptedPanel:
    """Return the scene of a flight that inspects.

    Parameters
    ----------
    flight : ShownFlight
    controller : Controller
        That was flown.
    mission : Mission
    """
    texts, of_sample = _reasons(mission, flight.log, controller)
    is_linear = mission.dynamics.model == "cw"
    coast = _floats(free_motion(mission.orbit.mean_motion_rad_s)) if is_linear else ""
    numbers = flight_table(flight.log, mission) | {"coast": coast, "texts": texts, "reasons": of_sample}
    table = json.dumps(numbers, separators=(",", ":")).replace("<", "\\u003c")
    code = MODULE.sub("\n", read("view.js", PACKAGE) + read("recorded.js", PACKAGE))
    # files of this package, and JSON that cannot end a script
    script = Markup(f"{{\n{code}\nshowRecorded({table});\n}}")  # noqa: S704
    style, frame = (Markup(read(name, PACKAGE)) for name in ("view.css", "frame.html"))  # noqa: S704 - likewise
    return ScriptedPanel(flight.title, style, frame, script)


def flight_table(log: FlightLog, mission: Mission) -> dict[str, Any]:
    """Return the numbers of a flight; arrays as base64 of float32, of bits, or of bytes."""
    world = pack_world(mission)
    inspects = mission.problem.kind == "inspection"
    num_points = world.num_points if inspects else 0
    points = world.points[0, :, :num_points].T
    is_lit, _ = lit_and_seen(world, log)
    angle, elevation = log.sun_angle_rad, log.sun_elevation_rad
    level = np.cos(elevation)
    sun = np.stack([level * np.cos(angle), level * np.sin(angle), np.sin(elevation)], axis=1)
    deputy = mission.deputy
    return {
        "periodS": mission.control_period_s,
        "radius": float(np.linalg.norm(points, axis=1).max()) if inspects else mission.problem.goal_radius_m,
        "isSphere": mission.chief.shape == "sphere",
        "limits": [deputy.min_distance_m, deputy.max_distance_m] if inspects else [],
        "numPoints": num_points,
        "points": _floats(points),
        "attitude": _floats(log.quaternion_c_from_h) if len(world.points) > 1 else "",
        "position": _floats(log.position_m),
        "velocity": _floats(log.velocity_m_s),
        "force": _floats(log.force_hill_n),
        "sun": _floats(sun),
        "spent": _floats(log.delta_v_m_s),
        "isSeen": _bits(log.is_inspected[:, :num_points]),
        "isLit": _bits(is_lit[:, :num_points]),
    }


def _reasons(mission: Mission, log: FlightLog, controller: Controller) -> tuple[list[str], list[list[int]]]:
    """Return texts, and for each control period the index of that of each axis.

    Where a rule made a push it is the one with the largest share in it, as in recordings; where flights ahead
    did, what they were chosen among; elsewhere what the log calls the reason.
    """
    delay = delay_of(mission)
    words = list(REASONS.values())
    texts = [text[:1].upper() + text[1:] + "." for text in words]
    if controller.systems and controller.force_axes != HILL:
        texts[words.index(REASONS["fired"])] = "Rules ask along the deputy's axes."
    indices = np.array(log.reason)
    made = _pushing_rules(log, controller, delay)
    for event in chosen_ahead(mission, log, controller):
        later = indices[event.sample + delay :] == REHEARSED
        pushes = np.argwhere(later & (log.force_hill_n[event.sample + delay :] != 0.0))
        text = f"{event.text[:1].upper()}{event.text[1:]}."
        made |= {(event.sample + delay + k, axis): text for k, axis in pushes.tolist()}
    for (k, axis), text in made.items():
        if text not in texts:
            texts.append(text)
        indices[k, axis] = texts.index(text)
    return texts, indices.tolist()


def _pushing_rules(log: FlightLog, controller: Controller, delay: int) -> dict[tuple[int, int], str]:
    """Return the rule with the largest share in each push that was fired as inferred, by period and axis."""
    if controller.force_axes != HILL:
        return {}
    rules: dict[tuple[int, int], str] = {}
    for index, system in enumerate(controller.systems):
        axis = COMPONENTS.index(system.outputs[0].name)
        samples = np.flatnonzero(log.is_decided)
        samples = samples[is_fired(log, samples, axis, HILL, delay)]
        samples = samples[log.force_hill_n[samples + delay, axis] != 0.0]
        if not samples.size:
            continue
        inputs = log.fis_input[samples, index, : len(system.inputs)]
        shares = shapley.shares(compile(system), inputs).values[:, :, 0]
        signs = np.sign(log.force_hill_n[samples + delay, axis])[:, np.newaxis]
        for k, rule in zip(samples, np.argmax(shares * signs, axis=1), strict=True):
            rules[int(k) + delay, axis] = f"{sentence(system.rules[rule])}."
    return rules


def _floats(array: Any) -> str:
    return base64.b64encode(np.ascontiguousarray(array, dtype="<f4").tobytes()).decode("ascii")


def _bits(array: Booleans) -> str:
    return base64.b64encode(np.packbits(array, axis=None, bitorder="little").tobytes()).decode("ascii")
