"""A fleet: deputies that look, tell one another, decide and act, each control period."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from pipeline.array_types import Booleans, Integers
from pipeline.flight.reference import period
from pipeline.flight.reference.flight import ReferenceFlight
from pipeline.flight.reference.foresight import preview
from pipeline.flight.reference.guidance import chosen_target
from pipeline.flight.reference.period import Act
from pipeline.flight.reference.state import Look, ReferenceState
from pipeline.flight.reference.thrust import decide, is_decision

NOBODY = -1


@dataclass
class FleetState:
    """What a fleet of D deputies carries from one sample to the next.

    Attributes
    ----------
    deputies : list of ReferenceState
    seen_by : (P,)
        The first deputy that saw a point, the first of the fleet at one sample; `NOBODY`.
    """

    deputies: list[ReferenceState]
    seen_by: Integers


def start(flights: Sequence[ReferenceFlight]) -> FleetState:
    """Return the state at the start of flights in one mission under one Sun."""
    nobody = np.full(len(flights[0].points), NOBODY)
    return FleetState([period.start(flight) for flight in flights], nobody)


def fleet_period(
    flights: Sequence[ReferenceFlight], k: int, fleet: FleetState, sharing: str
) -> tuple[list[Look], list[Act]]:
    """Fly a control period of a fleet, and change its state; nothing is decided at the last sample.

    The looks are as decided on: with what others have seen and what is left to them as inspected.
    """
    centres = [state.centres for state in fleet.deputies]
    looks = [period.look(flight, k, state) for flight, state in zip(flights, fleet.deputies, strict=True)]
    for deputy, seen in enumerate(looks):
        fleet.seen_by[seen.is_inspected & (fleet.seen_by == NOBODY)] = deputy
    if k == flights[0].mission.num_controls:
        return looks, []
    is_seen = fleet.seen_by != NOBODY
    left = left_to(flights, k, looks, is_seen, sharing)
    acts = []
    for deputy, flight in enumerate(flights):
        seen, state = looks[deputy], fleet.deputies[deputy]
        is_done = seen.is_inspected if sharing == "nothing" else is_seen | (left[deputy] != NOBODY)
        candidates = flight.surface_at(k)[0][seen.is_lit & ~is_done]
        target, state.centres = chosen_target(flight.mission, candidates, state.truth[:3], centres[deputy])
        looks[deputy] = replace(seen, is_inspected=is_done, candidates=candidates, target=target)
        act, state = period.act(flight, k, state, looks[deputy], decide(flight, k, looks[deputy], state))
        # what is left to others may yet be seen by this deputy
        state.is_inspected = seen.is_inspected if sharing == "nothing" else is_seen.copy()
        fleet.deputies[deputy] = state
        acts.append(act)
    return looks, acts


def left_to(
    flights: Sequence[ReferenceFlight], k: int, looks: Sequence[Look], is_seen: Booleans, sharing: str
) -> Integers:
    """Return to whom each deputy leaves each point, (D, P), or `NOBODY`.

    A deputy whose coasting leads near its limits leaves nothing, and promises nothing.
    """
    left = np.full((len(flights), len(is_seen)), NOBODY)
    if sharing not in ("leave", "nearer") or not is_decision(flights[0], k):
        return left
    stays = [stays_inside(flight, k, look) for flight, look in zip(flights, looks, strict=True)]
    shows = np.zeros(left.shape, dtype=np.bool_)
    is_open = flights[0].is_counted & ~is_seen
    for deputy, flight in enumerate(flights):
        if stays[deputy]:
            shows[deputy] = is_open & ~preview(flight, k, looks[deputy].known, is_seen)[0]
    bearings = [look.known[:3] / np.linalg.norm(look.known[:3]) for look in looks]
    nearest = np.argmax(np.array(bearings) @ flights[0].surface_at(k)[0].T, axis=0)
    for deputy, point in np.argwhere(np.outer(stays, is_open)).tolist():
        others = [other for other in range(len(flights)) if other != deputy and shows[other, point]]
        if others:
            left[deputy, point] = others[0]
        elif sharing == "nearer" and not shows[deputy, point] and nearest[point] != deputy:
            left[deputy, point] = nearest[point]
    return left


def stays_inside(flight: ReferenceFlight, k: int, look: Look) -> bool:
    """Return whether coasting to the end stays inside the limits by the controller's margin."""
    deputy, margin = flight.mission.deputy, flight.constants["coast_margin_m"]
    samples = range(k, flight.mission.num_controls + 1)
    positions = [(flight.transition(k, sample) @ look.known)[:3] for sample in samples]
    distances = np.linalg.norm(positions, axis=1)
    is_inside = distances.min() - deputy.min_distance_m >= margin
    return bool(is_inside and deputy.max_distance_m - distances.max() >= margin)
