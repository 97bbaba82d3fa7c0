"""The thrust logic: what is requested, what is commanded, and why (docs/explanation/navigation.md)."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fis_tools.engines.inference import infer
from fis_tools.model.thrust import SILENT_N
from pipeline.array_types import Booleans, Floats
from pipeline.flight.control.controller import PlanningController, RegulatorController
from pipeline.flight.reference.flight import ReferenceFlight
from pipeline.flight.reference.foresight import preview
from pipeline.flight.reference.parking import park_push
from pipeline.flight.reference.signals import signals
from pipeline.flight.reference.state import Look, ReferenceState

COMPONENTS = {"force_x": 0, "force_y": 1, "force_z": 2}


@dataclass
class Decision:
    """A force decided at a sample, N.

    Attributes
    ----------
    requested, commanded : (3,)
        Before and after dead bands, in the controller's axes.
    wanted : (3,)
        The same as commanded in Hill axes, before the clip.
    resting : str or None
        Why nothing was inferred, or how else the force came about.
    inferred : sequence of (inputs, output)
        Of each system.
    foreseen, is_missed : (3,), (P,), or None
        What coasting would come to, and which points it would miss, where that was looked at.
    """

    requested: Floats
    commanded: Floats
    wanted: Floats
    resting: str | None
    inferred: Sequence[tuple[Floats, float]]
    foreseen: Floats | None
    is_missed: Booleans | None


def decide(flight: ReferenceFlight, k: int, look: Look, state: ReferenceState) -> Decision:
    """Decide on a force at a sample: planned, or inferred from signals unless the controller rests."""
    requested, ahead, is_missed = np.zeros(3), None, None
    inferred: list[tuple[Floats, float]] = []
    resting = None if flight.has_plan else rest(flight, k, look)
    if resting is None and not flight.has_plan and flight.constants["coast_below_points"] > 0.0:
        is_missed, nearest, farthest = preview(flight, k, look.known, look.is_inspected)
        ahead = np.array([is_missed.sum(), nearest, farthest])
        resting = "coasting" if is_enough(flight, ahead) else None
    parking = None
    if is_decision(flight, k) and not flight.has_plan and flight.constants["park_below_points"] > 0.0:
        parking = park_push(flight, k, look.known, look.is_inspected)
    if parking is not None:
        resting = "parked" if parking.any() else resting or "coasting"
    if flight.given is not None and k < len(flight.given) and flight.given[k, 3] > 0.0:
        requested, resting = flight.given[k, :3], "rehearsed"
    elif flight.has_plan:
        requested = planned(flight, k, look.known, state)
    elif parking is not None:
        requested = parking * flight.mission.deputy.mass_kg / flight.mission.control_period_s
    elif resting is None:
        systems = flight.controller.systems
        names = {variable.name for system in systems for variable in system.inputs}
        sensed = signals(flight, k, look, names)
        for system in systems:
            inputs = np.array([sensed[variable.name] for variable in system.inputs])
            output = float(infer(system, inputs).values[0])
            inferred.append((inputs, output))
            requested[COMPONENTS[system.outputs[0].name]] += output
    commanded = requested
    if not flight.has_plan and resting not in ("rehearsed", "parked"):
        bands = np.array([flight.constants[f"dead_band_{name}_n"] for name in COMPONENTS])
        commanded = np.where(np.abs(requested) < bands, 0.0, requested)
    wanted = commanded if flight.controller.force_axes == "hill" else look.sensed.apply(commanded)
    return Decision(requested, commanded, wanted, resting, inferred, ahead, is_missed)


def rest(flight: ReferenceFlight, k: int, look: Look) -> str | None:
    """Return why nothing is decided at a sample; None if something may be."""
    if flight.mission.coast_when_complete and not (flight.is_counted & ~look.is_inspected).any():
        return "complete"
    return None if is_decision(flight, k) else "waiting"


def is_decision(flight: ReferenceFlight, k: int) -> bool:
    """Return whether a force is decided on at a sample."""
    return k % max(1, flight.periods(flight.constants["decision_period_s"])) == 0


def is_enough(flight: ReferenceFlight, ahead: Floats) -> bool:
    """Return whether coasting shows enough, inside the limits.

    `ahead` are the number of points missed, and the least and greatest distance on the way, m.
    """
    deputy, margin = flight.mission.deputy, flight.constants["coast_margin_m"]
    missed, nearest, farthest = ahead
    is_inside = nearest >= deputy.min_distance_m + margin and farthest <= deputy.max_distance_m - margin
    return bool(missed < flight.constants["coast_below_points"] and is_inside)


def planned(flight: ReferenceFlight, k: int, known: Floats, state: ReferenceState) -> Floats:
    """Return the planned force in a control period, with a regulator's answer to deviations from its path."""
    controller = flight.controller
    if isinstance(controller, PlanningController):
        if k in controller.planner.decisions:
            state.planned, state.planned_at = controller.planner(flight.scenario, k, known), k
        row = k - state.planned_at
        return state.planned[row] if row < len(state.planned) else np.zeros(3)
    if not isinstance(controller, RegulatorController):
        return flight.plan[k]
    plans = controller.regulator([flight.scenario])
    answer = -plans.gain @ (known - plans.paths[0, k])
    return flight.plan[k] + np.where(np.abs(answer) >= plans.least_answer, answer, 0.0)


def reasons(decision: Decision, is_hill: bool, limit: float, change: Floats) -> NDArray[np.str_]:
    """Return for each component why it was, or was not, commanded as requested.

    `limit` is the largest force of a component and `change` the safety layer's, both in N; `is_hill` says
    whether the controller commands along Hill axes. If not, a change of any component concerns all.
    """
    is_clipped, is_changed = np.abs(decision.wanted) > limit, np.abs(change) > 1e-9
    if not is_hill:
        is_clipped, is_changed = (np.full(3, is_so.any()) for is_so in (is_clipped, is_changed))
    fired = np.where(decision.commanded == 0.0, "dead_band", "fired")
    inferred = np.where(np.abs(decision.requested) < SILENT_N, "silent", fired)
    resting = inferred if decision.resting is None else np.full(3, decision.resting)
    return np.where(is_changed, "safety", np.where(is_clipped, "clipped", resting))
