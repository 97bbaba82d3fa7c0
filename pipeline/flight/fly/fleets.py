"""Fleets: several deputies from the starts of each case, to the end, with what they exchange.

The period is that of `pipeline.flight.period.steps`; the exchange stands between look and decide. One deputy
alone flies by `pipeline.flight.fly.many`, whose code knows nothing of this.
"""

from dataclasses import dataclass, replace
from math import inf, sqrt
from typing import Annotated, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fis_tools.compiled.decorator import compiled
from fis_tools.compiled.vectors import borrowed, width_of
from fis_tools.engines.kernel import LANES
from fis_tools.processors import num_processors
from pipeline.array_types import Bytes, Floats, Integers
from pipeline.flight.cases.starts import cases_of
from pipeline.flight.control.controller import Controller, PilotController
from pipeline.flight.control.law import law_of, played
from pipeline.flight.fly.many import (
    NO_TRACKS,
    FlightBatch,
    is_given,
    open_with,
    start_lanes,
    write_fired,
    write_known,
    write_outcomes,
    write_track,
)
from pipeline.flight.fly.population import flights_of, outcomes_of, shares_of
from pipeline.flight.fly.replanning import PlannedDecision
from pipeline.flight.fly.workspace import make_state, make_workspace
from pipeline.flight.period.act.apart import Apart, assure_apart, make_apart
from pipeline.flight.period.decide.exchange import LEAVE, Exchange, begin, heed, pool, share_out
from pipeline.flight.period.decide.urgency import note_deadlines
from pipeline.flight.period.steps import act, decide, look, move_on
from pipeline.flight.state.arrays import (
    NUM_OUTCOMES,
    Control,
    FlightState,
    FullOptics,
    Moment,
    Workspace,
    World,
    allocated,
)
from pipeline.flight.state.errors import ModelErrors
from pipeline.flight.state.lanes import flight_of
from pipeline.flight.state.link import Link, arrives
from pipeline.flight.state.log import Outcomes, Scenario, points_needed
from pipeline.flight.state.signals import SETTING, URGENCY
from pipeline.flight.world.bounds import guard_of, stops_apart
from pipeline.flight.world.pack import pack_world
from pipeline.flight.world.surface import surface_of
from pipeline.settings.experiment import Mission
from pipeline.settings.fleet import SHARING, Fleet
from pipeline.threads import in_threads

#: of a row of a fleet's results: points that any deputy has seen, the sample at which these are enough, or
#: -1, and the least distance between two deputies at a sample, m
SEEN, ENOUGH_AT, NEAREST_PAIR = range(3)


class Messages(NamedTuple):
    """What the deputies of m fleets tell one another: numbers of deputies from 1, 0 for none."""

    seen_by: Annotated[Bytes, "m", "K+1", "P"]  # that saw a point first, so far
    # 1 where a point counts and none has seen it that a deputy knows of
    unseen: Annotated[Bytes, "m", "D", "K+1", "P"]
    left_to: Annotated[Bytes, "m", "D", "K", "P"]  # to which a deputy leaves a point
    # the last that the first heard of the second: 1 for points seen or to be shown, and its position, m
    shown: Annotated[Bytes, "m", "D", "K", "D", "P"]
    positions: Annotated[Floats, "m", "D", "K", "D", 3]
    # where deputies are kept apart: commanded forces, N, Hill axes, and for which limit changed
    forces: Annotated[Floats, "m", "D", "K", 4]
    # and where each would stop, by what is due of it, or where it started, m; 1 where the first hears it
    stops: Annotated[Floats, "m", "D", "K", "D", 3]
    arrived: Annotated[Bytes, "m", "D", "K", "D"]


class FleetResults(NamedTuple):
    """Arrays into which m fleets of D deputies write their results."""

    outcomes: Floats  # (m D, NUM_OUTCOMES) of each deputy
    fleets: Floats  # (m, 3) of each fleet
    seen_by: Bytes  # (m, P padded) number of the deputy that saw a point first, from 1; 0: none
    tracks: NDArray[np.float32]  # (m D, K+1, NUM_PLACED or NUM_TRACKED), or empty
    messages: Messages


@compiled(error_model="numpy")
def nearest_pair(now: Moment, first: int, deputies: int) -> float:
    """Return the least distance between two deputies of the fleet whose first lane is given, m."""
    position, least = now.state.truth.position, np.inf
    for lane in range(first, first + deputies):
        for other in range(first, lane):
            square = 0.0
            for axis in range(3):
                apart = position[axis, lane] - position[axis, other]
                square += apart * apart
            least = min(least, sqrt(square))
    return least


@compiled(error_model="numpy")
def note_fleets(now: Moment, exchange: Exchange, needed: Floats, results: FleetResults) -> None:
    """Note at a sample how many points each fleet has seen, whether that is enough, and the nearest pair."""
    deputies = exchange.deputies
    for lane in range(0, now.num_lanes, deputies):
        row, unseen = results.fleets[(now.first + lane) // deputies], exchange.unseen[lane // deputies]
        row[SEEN] = now.state.lanes.num_counted[lane] - unseen.sum()
        if row[ENOUGH_AT] < 0.0 and row[SEEN] >= needed[(now.first + lane) // deputies]:
            row[ENOUGH_AT] = now.k
        row[NEAREST_PAIR] = min(row[NEAREST_PAIR], nearest_pair(now, lane, deputies))


@compiled(error_model="numpy")
def note_seen(now: Moment, exchange: Exchange, messages: Messages) -> None:
    """Note who saw which points so far, and what each deputy knows of it, where there is room."""
    deputies = exchange.deputies
    for lane in range(0, now.num_lanes if len(messages.seen_by) > 0 else 0, deputies):
        for j in range(now.world.num_points):
            messages.seen_by[(now.first + lane) // deputies, now.k, j] = (
                exchange.seen_by[lane // deputies, j] + 1
            )
    for lane in range(now.num_lanes if len(messages.unseen) > 0 else 0):
        unseen = messages.unseen[(now.first + lane) // deputies, lane % deputies, now.k]
        for j in range(now.world.num_points):
            unseen[j] = exchange.known[lane, j]


@compiled(error_model="numpy")
def note_left(now: Moment, exchange: Exchange, messages: Messages) -> None:
    """Note what is left to whom, and what was heard, where there is room."""
    deputies = exchange.deputies
    for lane in range(now.num_lanes if len(messages.left_to) > 0 else 0):
        left = messages.left_to[(now.first + lane) // deputies, lane % deputies, now.k]
        row = (now.first + lane) // deputies, lane % deputies, now.k
        for j in range(now.world.num_points):
            left[j] = exchange.left_to[lane, j] + 1
            for other in range(deputies if exchange.sharing >= LEAVE else 0):
                messages.shown[row][other, j] = exchange.link.heard_ahead[lane, other, j] == 0.0
        messages.positions[row] = exchange.link.heard_positions[lane]


@compiled(error_model="numpy")
def note_forces(now: Moment, deputies: int, messages: Messages) -> None:
    """Note the commands of deputies that are kept apart, where there is room."""
    lanes = now.state.lanes
    for lane in range(now.num_lanes if len(messages.forces) > 0 else 0):
        row = messages.forces[(now.first + lane) // deputies, lane % deputies, now.k]
        for axis in range(3):
            row[axis] = lanes.commanded[axis, lane]
        row[3] = lanes.limit[lane]


@compiled(error_model="numpy")
def note_stops(now: Moment, apart: Apart, link: Link, messages: Messages) -> None:
    """Note where the deputies that are kept apart would stop, and who hears it, where there is room."""
    deputies, size = apart.deputies, len(apart.stops)
    slot = (now.k + size - link.delay) % size if now.k >= link.delay else 0
    for lane in range(now.num_lanes if len(messages.stops) > 0 else 0):
        row = (now.first + lane) // deputies, lane % deputies, now.k
        for other in range(deputies):
            messages.arrived[row][other] = arrives(link, now, lane, other, deputies)
            messages.stops[row][other] = apart.stops[slot, lane - lane % deputies + other]


@compiled(error_model="numpy")
def is_followed(now: Moment, followed: Integers, row: int) -> bool:
    """Return whether any lane flies by a controller, given by its row."""
    is_so = False
    for lane in range(width_of(now.state.lanes)):
        is_so |= followed[flight_of(now, lane)] == row
    return is_so


@compiled(error_model="numpy")
def decide_apiece(
    now: Moment, work: Workspace, optics: FullOptics | None, flights: FlightBatch, followed: Integers
) -> None:
    """Let every lane decide by the controller that it follows."""
    lanes = now.state.lanes
    width = width_of(lanes)
    forces = np.empty((2, 3, width))  # requested and commanded
    for row in range(len(flights.values)):
        if not is_followed(now, followed, row):
            continue
        decide(now, work, optics, Control(flights.law, flights.values[row, 0], flights.rules[0]))
        for lane in range(width):
            for axis in range(3 if followed[flight_of(now, lane)] == row else 0):
                forces[0, axis, lane] = lanes.requested[axis, lane]
                forces[1, axis, lane] = lanes.commanded[axis, lane]
    for lane in range(width):
        for axis in range(3):
            lanes.requested[axis, lane] = forces[0, axis, lane]
            lanes.commanded[axis, lane] = forces[1, axis, lane]


@compiled(nogil=True, error_model="numpy")
def fly_fleets(
    optics: FullOptics | None,
    clusters: bool | None,
    errors: ModelErrors | None,
    flights: FlightBatch,
    followed: Integers,
    apart: Apart | None,
    exchange: Exchange,
    needed: Floats,
    state: FlightState,
    work: Workspace,
    results: FleetResults,
    first: int,
    last: int,
) -> None:
    """Fly deputies `first` to `last - 1`, whole fleets side by side.

    See `pipeline.flight.period.steps` for the first three; `followed`, (m D,), is the row of the controller
    that each flies by, `apart` is None where deputies are not kept apart, and `needed`, (m,), are the points
    that are enough. The content of exchange, state and workspace, those of
    this thread, does not matter.
    """
    deputies = exchange.deputies
    most = width_of(state.lanes) // deputies * deputies
    flights, followed, exchange, state = borrowed((flights, followed, exchange, state))
    work, results = borrowed((work, results))
    world, law, tracks = flights.world, flights.law, results.tracks
    control = Control(law, flights.values[0, 0], flights.rules[0])
    for start in range(first, last, most):
        num_lanes = min(most, last - start)
        now = Moment(world, state, start, num_lanes, 0)
        start_lanes(now, flights.cases, flights.counted)
        if law.needs & (URGENCY | SETTING):
            note_deadlines(now, optics, work.deadlines, work.lit)
        begin(now, exchange)
        for k in range(world.first, world.last + 1):
            now = Moment(world, state, start, num_lanes, k)
            heed(now, exchange)
            look(now, work, optics, None, errors, law.plans)
            pool(now, exchange)
            note_fleets(now, exchange, needed, results)
            note_seen(now, exchange, results.messages)
            for lane in range(num_lanes if len(tracks) > 0 else 0):
                write_track(now, lane, tracks[start + lane, k])
            if k == world.last:
                break
            share_out(now, work, exchange, optics, clusters, control)
            note_left(now, exchange, results.messages)
            if not is_given(now, flights.openings):
                decide_apiece(now, work, optics, flights, followed)
            open_with(now, flights.openings)
            if apart is not None:
                assure_apart(now, apart, exchange.link)
                note_forces(now, deputies, results.messages)
                note_stops(now, apart, exchange.link, results.messages)
                move_on(now, work, errors, law.plans)
            else:
                act(now, work, errors, law.plans)
            for lane in range(num_lanes if len(tracks) > 0 else 0):
                write_fired(state, lane, tracks[start + lane, k])
        write_outcomes(now, start, results.outcomes)
        for lane in range(0, num_lanes, deputies):
            for j in range(world.num_points):
                results.seen_by[(start + lane) // deputies, j] = exchange.seen_by[lane // deputies, j] + 1


#: part of the spawn key of the random numbers for messages that are lost
LOST = (1 << 10) + 1
NO_LOSSES: Bytes = np.zeros((0, 0, 0, 0), dtype=np.uint8)


def lost_messages(mission: Mission, scenarios: list[Scenario]) -> Bytes:
    """Draw which messages of fleets are lost, (m, K+1, D, D), see `Link.lost`; empty if none ever is."""
    share, deputies = mission.fleet.lost_percent / 100.0, mission.fleet.deputies
    if not share > 0.0:
        return NO_LOSSES
    shape = mission.num_controls + 1, deputies, deputies
    draws = (scenario.generator(LOST).random(shape, dtype=np.float32) < share for scenario in scenarios)
    return np.array([draw.view(np.uint8) for draw in draws])


def make_exchange(world: World, fleet: Fleet, lanes: int, lost: Bytes = NO_LOSSES) -> Exchange:
    """Allocate what fleets in the lanes of one thread exchange."""
    deputies, points = fleet.deputies, world.points.shape[2]
    sizes = {"L": lanes, "F": lanes // deputies, "P": points, "D": deputies, "S": fleet.delay_periods + 1}
    link = allocated(Link, sizes, delay=fleet.delay_periods, lost=lost)
    exchange: Exchange = allocated(
        Exchange, sizes, deputies=deputies, first=0, sharing=SHARING.index(fleet.sharing), link=link
    )
    return exchange


def room_for_messages(mission: Mission, count: int) -> Messages:
    """Return room for what the deputies of some fleets tell one another."""
    sizes = {"m": count, "D": mission.fleet.deputies, "P": len(surface_of(mission).points)}
    sizes |= {"K": mission.num_controls, "K+1": mission.num_controls + 1}
    messages: Messages = allocated(Messages, sizes)
    return messages


NO_MESSAGES: Messages = allocated(Messages, dict.fromkeys(("m", "D", "K", "K+1", "P"), 0))


#: columns of what each deputy of a fleet did, in the order of `FleetOutcomes.of_deputies`
OF_DEPUTIES = (
    *("delta_v_m_s", "inspected_count", "mean_distance_m", "min_distance_m", "max_distance_m", "outside_m"),
    *("safety_periods", "safety_delta_v_m_s", "full_wheel_s"),
)


@dataclass(frozen=True)
class FleetOutcomes(Outcomes):
    """Results of m fleets: what all deputies spend together, see together, and the extremes of any.

    A point counts once, for the deputy that saw it first. `mean_distance_m` is the mean over deputies.
    """

    enough_s: Floats  # (m,) when enough points are seen for a success; NaN where they never are
    nearest_pair_m: Floats  # (m,) least distance between two deputies at a sample
    # (m,) within an orbit, if all thrusters fail at one sample; NaN where that is not followed
    coasting_pair_m: Floats
    of_deputies: Floats  # (m, D, len(OF_DEPUTIES))


def apart_of(mission: Mission) -> Apart | None:
    """Return how far apart the deputies of a thread's fleets are kept; None where they are not."""
    fleet, distance = mission.fleet, stops_apart(mission)
    if not distance > 0.0:
        return None
    return make_apart(pack_world(mission.of_each), fleet.deputies, distance, fleet.delay_periods)


class Chosen(NamedTuple):
    """How m fleets fly, once they have looked ahead."""

    controllers: tuple[Controller, ...]  # of one structure
    followed: Integers  # (m, D) by which of these each deputy flies
    openings: Floats = np.zeros((0, 0, 4))  # (m D, K, 4) forces planned, as `fly_population` takes them
    tour_costs: Floats = np.zeros((0, 0, 0))  # (m, D, tours) see `FleetTours`, if tours are rehearsed
    # if plans are recorded, by sample, those of the deputies of the only fleet
    decisions: tuple[tuple[PlannedDecision, ...], ...] = ()


class FlightPart(NamedTuple):
    """The part of their flights that fleets fly."""

    first: int = 0  # sample at which flights begin
    last: int | None = None  # sample at which they end
    wanted: Bytes | None = None  # (m D, P padded) 1 for points that each deputy knows as unseen at the first


WHOLE = FlightPart()


def fly_chosen(
    mission: Mission,
    chosen: Chosen,
    scenarios: list[Scenario],
    workers: int | None = None,
    lanes: int = LANES,
    tracks: NDArray[np.float32] | None = None,
    messages: Messages = NO_MESSAGES,
    safe_in: Mission | None = None,
    part: FlightPart = WHOLE,
    known: Floats | None = None,
) -> FleetOutcomes:
    """Fly fleets by what they chose, see `pipeline.flight.fly.fleets_ahead.fly_all_fleets`.

    Parameters
    ----------
    safe_in : Mission, optional
        Whose safety layer it is, if another's. Parts that begin later leave out what keeps deputies apart.
    part : FlightPart
    known : (m D, 6+P or 42+P) array, optional
        Filled with what deputies know at the end, as by `pipeline.flight.fly.population.fly_population`.
    """
    controller, *_ = chosen.controllers
    safe_in = safe_in or mission
    deputies, alone = mission.fleet.deputies, mission.of_each
    world, law = pack_world(alone)._replace(guard=guard_of(safe_in.of_each)), law_of(controller, alone)
    world = world._replace(first=part.first, last=world.last if part.last is None else part.last)
    cases = cases_of(alone, [start for case in scenarios for start in case.fleet])
    if isinstance(controller, PilotController):
        forces = controller.pilot.together(alone, [case.fleet for case in scenarios], workers)
        law = law._replace(plans=played(forces.reshape(-1, *forces.shape[2:])))
    numbers = replace(
        controller.numbers, values=np.vstack([each.numbers.values for each in chosen.controllers])
    )
    parts, flights, inspectable = flights_of(world, law, numbers, cases, chosen.openings, wanted=part.wanted)
    count, num_points = len(scenarios), world.num_points
    num_inspectable = inspectable[::deputies, :num_points].sum(axis=1, dtype=np.int64)
    results = FleetResults(
        np.empty((count * deputies, NUM_OUTCOMES)),
        np.tile([0.0, -1.0, inf], (count, 1)),
        np.zeros((count, inspectable.shape[1]), dtype=np.uint8),
        NO_TRACKS if tracks is None else tracks.reshape(-1, *tracks.shape[2:]),
        messages,
    )
    followed, openings = np.ascontiguousarray(chosen.followed.ravel()), chosen.openings
    needed = points_needed(num_inspectable, mission.inspection_threshold_percent).astype(np.float64)
    workers = workers or num_processors()
    whole = lanes // deputies * deputies
    shares = shares_of(count * deputies, whole, workers)
    if known is not None:  # it is read from the state at the end of each
        shares = [
            (first, min(first + whole, count * deputies)) for first in range(0, count * deputies, whole)
        ]
    workers, untaken = min(workers, len(shares)), iter(shares)

    def fly_shares(exchange: Exchange, state: FlightState, work: Workspace) -> None:
        """Fly shares one after the other, each not taken by another thread."""
        for first, last in untaken:
            fly_fleets(
                *parts,
                flights,
                followed,
                apart_of(safe_in) if part.first == 0 else None,
                exchange,
                needed,
                state,
                work,
                results,
                first,
                last,
            )
            if known is not None:
                now = Moment(world, state, first, last - first, world.last)
                for lane in range(last - first):
                    write_known(now, lane, parts[-1], known[first + lane])

    lost = lost_messages(mission, scenarios)
    exchanges = [make_exchange(world, mission.fleet, lanes, lost) for _ in range(workers)]
    states = [make_state(world, parts[-1], lanes) for _ in range(workers)]
    works = [make_workspace(world, lanes) for _ in range(workers)]
    in_threads(fly_shares, exchanges, states, works, workers=workers)
    rows = results.outcomes.reshape(count, deputies, NUM_OUTCOMES)
    planned = np.minimum(np.abs(openings[..., :3]) * (openings[..., 3:] > 0.0), world.max_force)
    ahead = planned.sum(axis=(1, 2)) * world.delta_v_per_force if len(openings) else np.zeros(len(cases))
    each = outcomes_of(rows, num_inspectable[:, np.newaxis], ahead.reshape(count, deputies))
    return _together(mission, each, results)


def _together(mission: Mission, each: Outcomes, results: FleetResults) -> FleetOutcomes:
    """Return the outcomes of fleets from those of their deputies, (m, D)."""
    deputies, enough_at = mission.fleet.deputies, results.fleets[:, ENOUGH_AT]
    seen_first = [(results.seen_by == deputy).sum(axis=1) for deputy in range(1, deputies + 1)]
    of_each = vars(each) | {"inspected_count": np.stack(seen_first, axis=1)}
    return FleetOutcomes(
        delta_v_m_s=each.delta_v_m_s.sum(axis=1),
        inspected_count=np.rint(results.fleets[:, SEEN]).astype(np.int64),
        inspectable_count=each.inspectable_count[:, 0],
        mean_distance_m=each.mean_distance_m.mean(axis=1),
        min_distance_m=each.min_distance_m.min(axis=1),
        max_distance_m=each.max_distance_m.max(axis=1),
        outside_m=each.outside_m.max(axis=1),
        safety_periods=each.safety_periods.sum(axis=1),
        safety_delta_v_m_s=each.safety_delta_v_m_s.sum(axis=1),
        ahead_delta_v_m_s=each.ahead_delta_v_m_s.sum(axis=1),
        full_wheel_s=each.full_wheel_s.sum(axis=1),
        enough_s=np.where(enough_at < 0.0, np.nan, enough_at * mission.control_period_s),
        nearest_pair_m=results.fleets[:, NEAREST_PAIR],
        coasting_pair_m=np.full(len(enough_at), np.nan),
        of_deputies=np.stack([of_each[name] for name in OF_DEPUTIES], axis=2).astype(np.float64),
    )
