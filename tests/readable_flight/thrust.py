"""The thrust logic: what is asked for, what is commanded, and why (docs/explanation/thrust.md)."""

from dataclasses import dataclass

import numpy as np

from fis_tools.engines.inference import infer
from fis_tools.model.thrust import SILENT_N
from tests.readable_flight.foresight import foreseen
from tests.readable_flight.signals import signals

COMPONENTS = {"force_x": 0, "force_y": 1, "force_z": 2}


@dataclass
class Decision:
    """A force decided at a sample: N, asked for and commanded, in the controller's axes, and in Hill's.

    `resting` says why nothing was inferred, or how else the force came about; `inferred` holds each system's
    inputs and output; `foreseen` what decided on coasting.
    """

    asked: np.ndarray
    commanded: np.ndarray
    wanted: np.ndarray
    resting: str | None
    inferred: list
    foreseen: np.ndarray | None


def decide(flight, k, look):
    """Decide on a force at a sample."""
    asked, inferred, ahead = np.zeros(3), [], None
    resting = None if flight.has_plan else rest(flight, k, look)
    if resting is None and not flight.has_plan and flight.constants["coast_below_points"] > 0.0:
        ahead = foreseen(flight, k, look.known, look.is_inspected)
        resting = "coasting" if is_enough(flight, ahead) else None
    if k == 0 and flight.opening is not None:
        asked, resting = flight.opening, "rehearsed"
    elif flight.has_plan:
        asked = planned(flight, k, look.known)
    elif resting is None:
        systems = flight.controller.systems
        sensed = signals(flight, k, look, {one.name for system in systems for one in system.inputs})
        for system in systems:
            inputs = np.array([sensed[variable.name] for variable in system.inputs])
            output = infer(system, inputs).values[0]
            inferred.append((inputs, output))
            asked[COMPONENTS[system.outputs[0].name]] += output
    commanded = asked
    if not flight.has_plan and resting != "rehearsed":
        bands = np.array([flight.constants[f"dead_band_{name}_n"] for name in COMPONENTS])
        commanded = np.where(np.abs(asked) < bands, 0.0, asked)
    wanted = commanded if flight.controller.force_axes == "hill" else look.sensed.apply(commanded)
    return Decision(asked, commanded, wanted, resting, inferred, ahead)


def rest(flight, k, look):
    """Why nothing is decided at a sample; None if something may be."""
    if flight.mission.coast_when_complete and not (flight.is_counted & ~look.is_inspected).any():
        return "complete"
    return "waiting" if k % max(1, flight.periods(flight.constants["decision_period_s"])) else None


def is_enough(flight, ahead):
    """Whether coasting shows enough, inside the limits."""
    deputy, margin = flight.mission.deputy, flight.constants["coast_margin_m"]
    missed, nearest, farthest = ahead
    is_inside = nearest >= deputy.min_distance_m + margin and farthest <= deputy.max_distance_m - margin
    return missed < flight.constants["coast_below_points"] and is_inside


def planned(flight, k, known):
    """A plan's force in a control period, with a regulator's answer to the deviation from its path."""
    regulator = flight.controller.regulator
    if regulator is None:
        return flight.plan[k]
    answer = -regulator.gain @ (known - regulator.path(flight.scenario)[k])
    return flight.plan[k] + np.where(np.abs(answer) >= regulator.dead_band_n, answer, 0.0)


def reasons(decision, is_hill, limit, change):
    """For each component why it was, or was not, fired as asked for; `change` is the safety layer's, N."""
    is_clipped, is_changed = np.abs(decision.wanted) > limit, np.abs(change) > 1e-9
    if not is_hill:
        is_clipped, is_changed = (np.full(3, which.any()) for which in (is_clipped, is_changed))
    fired = np.where(decision.commanded == 0.0, "dead_band", "fired")
    found = np.where(np.abs(decision.asked) < SILENT_N, "silent", fired)
    found = found if decision.resting is None else np.full(3, decision.resting)
    return np.where(is_changed, "safety", np.where(is_clipped, "clipped", found))
