"""A logged flight as the player of a page takes it, and why each push came."""

import base64
from typing import Any

import numpy as np

from fis_tools.analysis import shapley
from fis_tools.engines.compiler import compile
from fis_tools.model.thrust import COMPONENTS, REASONS, SILENT_N
from fis_tools.words.text import sentence
from pipeline.array_types import Booleans
from pipeline.flight.control.controller import Controller
from pipeline.flight.goals.reach import until_end
from pipeline.flight.state.log import DEAD_BAND, FIRED, PARKED, REHEARSED, SAFETY, SILENT, FlightLog
from pipeline.flight.world.pack import pack_world
from pipeline.recording.events import chosen_ahead
from pipeline.recording.firing import delay_of, is_fired
from pipeline.recording.points import lit_and_seen
from pipeline.settings.experiment import Mission
from telemetry.page import recorded

#: what was asked for along these axes is what was fired there
HILL = "hill"
#: reasons of what was fired, but not as inference asked for
NOT_AS_ASKED = SAFETY, REHEARSED, PARKED
#: where nothing was fired, these say less than others
TOLD_LAST = REHEARSED, PARKED, SILENT


def recorded_table(log: FlightLog, controller: Controller, mission: Mission) -> dict[str, Any]:
    """Return a flight, up to where it ends, as the player takes it where it is not flown in the page."""
    log = until_end(mission, log)
    return flight_table(log, mission) | {
        **told_reasons(log, controller, mission),
        "isDecided": _bits(log.is_decided),
        "inputs": _floats(log.fis_input),
    }


def told_reasons(log: FlightLog, controller: Controller, mission: Mission) -> dict[str, Any]:
    """Return why a flight fired what it fired: texts, and for each control period those of each axis."""
    log = until_end(mission, log)
    texts, of_sample = _reasons(mission, log, controller)
    return {"texts": texts, "reasons": of_sample}


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
    indices = np.array(log.reason)
    are_pushes: Booleans = np.abs(log.force_hill_n) >= SILENT_N
    # of ideal thrusters, reasons of forces along the controller's axes, of which others were fired
    indices[are_pushes & np.isin(log.reason, (SILENT, DEAD_BAND))] = FIRED
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
    is_idle: Booleans = ~np.any(are_pushes, axis=1, keepdims=True)
    return texts, recorded.with_a_single_reason(indices, is_idle, TOLD_LAST).tolist()


def _pushing_rules(log: FlightLog, controller: Controller, delay: int) -> dict[tuple[int, int], str]:
    """Return the rule with the largest share in each push that was fired as inferred, by period and axis."""
    is_body = controller.force_axes != HILL
    rules, sizes = np.full(log.reason.shape, -1), np.zeros(log.reason.shape)
    texts: list[str] = []
    for index, system in enumerate(controller.systems):
        axis = COMPONENTS.index(system.outputs[0].name)
        samples = np.flatnonzero(log.is_decided)
        samples = samples[is_fired(log, samples, axis, controller.force_axes, delay)]
        # along Hill's axes what was fired, which real thrusters may turn
        forces = log.force_asked_n[:, axis] if is_body else np.roll(log.force_hill_n[:, axis], -delay)
        samples = samples[forces[samples] != 0.0]
        if not samples.size:
            continue
        inputs = log.fis_input[samples, index, : len(system.inputs)]
        shares = shapley.shares(compile(system), inputs).values[:, :, 0]
        signs = np.sign(forces[samples])[:, np.newaxis]
        rules[samples + delay, axis] = len(texts) + np.argmax(shares * signs, axis=1)
        sizes[samples + delay, axis] = forces[samples]
        texts += [f"{recorded.ALONG_DEPUTY if is_body else ''}{sentence(rule)}." for rule in system.rules]
    if is_body:
        are_pushes = (np.abs(log.force_hill_n) >= SILENT_N) & ~np.isin(log.reason, NOT_AS_ASKED)
        rules = recorded.along_hill(rules, sizes, are_pushes)
    return {(k, axis): texts[rules[k, axis]] for k, axis in np.argwhere(rules >= 0).tolist()}


def _floats(array: Any) -> str:
    return base64.b64encode(np.ascontiguousarray(array, dtype="<f4").tobytes()).decode("ascii")


def _bits(array: Booleans) -> str:
    return base64.b64encode(np.packbits(array, axis=None, bitorder="little").tobytes()).decode("ascii")
