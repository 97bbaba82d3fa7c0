"""A fleet: deputies that look, tell one another, decide and act, each control period."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from pipeline.array_types import Booleans, Floats, Integers
from pipeline.flight.reference import period
from pipeline.flight.reference.flight import ReferenceFlight
from pipeline.flight.reference.foresight import preview
from pipeline.flight.reference.guidance import chosen_target
from pipeline.flight.reference.period import Act
from pipeline.flight.reference.state import Look, ReferenceState
from pipeline.flight.reference.thrust import decide, is_decision
from pipeline.settings.fleet import Fleet

NOBODY = -1


@dataclass
class Broadcast:
    """What D deputies tell at a sample.

    Attributes
    ----------
    is_seen : (D, P)
        The points that each knows to be seen, by whomever.
    is_shown : (D, P)
        Of each, those and the points that its coasting will show; none until it is asked.
    positions : (D, 3)
        Where each believes to be, m.
    """

    is_seen: Booleans
    is_shown: Booleans
    positions: Floats


@dataclass
class FleetState:
    """What a fleet of D deputies carries from one sample to the next.

    Attributes
    ----------
    deputies : list of ReferenceState
    seen_by : (P,)
        The first deputy that saw a point, the first of the fleet at one sample; `NOBODY`.
    broadcasts : list of Broadcast
        What they told at each sample.
    heard : (D, D)
        The sample of the last message that the first heard of the second; -1 before any.
    """

    deputies: list[ReferenceState]
    seen_by: Integers
    broadcasts: list[Broadcast]
    heard: Integers


def start(flights: Sequence[ReferenceFlight]) -> FleetState:
    """Return the state at the start of flights in one mission under one Sun."""
    nobody = np.full(len(flights[0].points), NOBODY)
    heard = np.full((len(flights), len(flights)), -1)
    return FleetState([period.start(flight) for flight in flights], nobody, [], heard)


def fleet_period(
    flights: Sequence[ReferenceFlight],
    k: int,
    fleet: FleetState,
    link: Fleet,
    is_lost: Booleans | None = None,
) -> tuple[list[Look], list[Act]]:
    """Fly a control period of a fleet, and change its state; nothing is decided at the last sample.

    Parameters
    ----------
    flights : sequence of ReferenceFlight
    k : int
    fleet : FleetState
    link : Fleet
        What they heed, and when they hear it.
    is_lost : (D, D), optional
        Where the first does not hear at this sample what is due of the second.

    Returns
    -------
    looks : list of Look
        As decided on: with what others are known to have seen, and what is left to them, as inspected.
    acts : list of Act
    """
    sharing, count = link.sharing, len(flights)
    centres = [state.centres for state in fleet.deputies]
    looks = [period.look(flight, k, state) for flight, state in zip(flights, fleet.deputies, strict=True)]
    for deputy, seen in enumerate(looks):
        fleet.seen_by[seen.is_inspected & (fleet.seen_by == NOBODY)] = deputy
    is_known = np.array([seen.is_inspected for seen in looks])
    shown = fleet.broadcasts[-1].is_shown if fleet.broadcasts else np.zeros_like(is_known)
    positions = np.array([seen.known[:3] for seen in looks])
    fleet.broadcasts.append(Broadcast(is_known.copy(), shown, positions))
    arrives = np.full((count, count), k >= link.delay_periods)
    if is_lost is not None:
        arrives &= ~is_lost
    fleet.heard[arrives] = k - link.delay_periods
    if sharing != "nothing":
        for receiver, sender in np.argwhere(arrives).tolist():
            is_known[receiver] |= fleet.broadcasts[k - link.delay_periods].is_seen[sender]
    if k == flights[0].mission.num_controls:
        return looks, []
    left = left_to(flights, k, looks, is_known, fleet, sharing)
    acts = []
    for deputy, flight in enumerate(flights):
        seen, state = looks[deputy], fleet.deputies[deputy]
        is_done = is_known[deputy] | (left[deputy] != NOBODY)
        candidates = flight.surface_at(k)[0][seen.is_lit & ~is_done]
        target, state.centres = chosen_target(flight.mission, candidates, state.truth[:3], centres[deputy])
        looks[deputy] = replace(seen, is_inspected=is_done, candidates=candidates, target=target)
        act, state = period.act(flight, k, state, looks[deputy], decide(flight, k, looks[deputy], state))
        # what is left to others may yet be seen by this deputy
        state.is_inspected = is_known[deputy].copy()
        fleet.deputies[deputy] = state
        acts.append(act)
    return looks, acts


def left_to(
    flights: Sequence[ReferenceFlight],
    k: int,
    looks: Sequence[Look],
    is_known: Booleans,
    fleet: FleetState,
    sharing: str,
) -> Integers:
    """Return to whom each deputy leaves each point, (D, P), or `NOBODY`; tell what coasting will show.

    A deputy whose coasting leads near its limits leaves nothing, and promises nothing.
    """
    left = np.full(is_known.shape, NOBODY)
    if sharing not in ("leave", "nearer") or not is_decision(flights[0], k):
        return left
    stays = [stays_inside(flight, k, look) for flight, look in zip(flights, looks, strict=True)]
    is_open = flights[0].is_counted & ~is_known
    is_shown = ~is_open
    for deputy, flight in enumerate(flights):
        if stays[deputy]:
            is_shown[deputy] |= ~preview(flight, k, looks[deputy].known, is_known[deputy])[0]
    fleet.broadcasts[k].is_shown = is_shown
    for deputy in range(len(flights)):
        heard = fleet.heard[deputy]
        # all know where all start
        origins = [fleet.broadcasts[max(at, 0)].positions[other] for other, at in enumerate(heard)]
        origins[deputy] = looks[deputy].known[:3]
        bearings = np.array([origin / np.linalg.norm(origin) for origin in origins])
        nearest = np.argmax(bearings @ flights[0].surface_at(k)[0].T, axis=0)
        for point in np.flatnonzero(is_open[deputy] & stays[deputy]).tolist():
            others = [
                other
                for other, at in enumerate(heard)
                if other != deputy and at >= 0 and fleet.broadcasts[at].is_shown[other, point]
            ]
            if others:
                left[deputy, point] = others[0]
            elif sharing == "nearer" and not is_shown[deputy, point] and nearest[point] != deputy:
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
