"""One flight of a fleet, logged: each deputy flies again alone, with what the others told it."""

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from fis_tools.compiled.decorator import compiled
from fis_tools.compiled.vectors import borrowed
from pipeline.array_types import Bytes, Floats
from pipeline.flight.cases.starts import cases_of
from pipeline.flight.control.controller import Controller, PilotController, open_loop
from pipeline.flight.control.law import law_of
from pipeline.flight.fly.fleet_controllers import check_controller
from pipeline.flight.fly.fleets import Chosen, Messages, fly_chosen, room_for_messages
from pipeline.flight.fly.fleets_ahead import looked_ahead
from pipeline.flight.fly.logged import write_period, write_sample
from pipeline.flight.fly.many import FlightBatch, is_given, open_with, start_lanes
from pipeline.flight.fly.population import flights_of
from pipeline.flight.fly.replanning import foresight_fields
from pipeline.flight.fly.simulation import completed_log, room_for_log
from pipeline.flight.fly.workspace import make_state, make_workspace
from pipeline.flight.period.decide.exchange import choose_lane_target
from pipeline.flight.period.decide.urgency import note_deadlines
from pipeline.flight.period.steps import act, decide, look, move_on
from pipeline.flight.state.arrays import Control, FlightState, FullOptics, Moment, Workspace
from pipeline.flight.state.errors import ModelErrors
from pipeline.flight.state.log import FlightLog, Scenario
from pipeline.flight.state.signals import SETTING, URGENCY
from pipeline.flight.world.pack import pack_world
from pipeline.settings.experiment import Mission


@dataclass(frozen=True, eq=False)
class DeputyLog:
    """The log of one deputy of a fleet; numbers of deputies count from 1, and 0 is none.

    Parameters
    ----------
    deputy : int
    flight : FlightLog
        Its points are inspected once any deputy that it heeds has seen them.
    seen_by : (K+1, P)
        The deputy that saw a point first, so far.
    left_to : (K, P)
        The deputy that this one leaves a point to.
    shown : (K, D, P)
        By what it heard last of each, the points that are seen, or that its coasting will show.
    positions : (K, D, 3)
        And where each believed to be, m, Hill axes.
    stops : (K, D, 3)
        Where deputies are kept apart: where each would stop, as it told when that was due to be heard, or
        where it would have at the start, m, Hill axes.
    arrived : (K, D)
        1 where that was heard.
    """

    deputy: int
    flight: FlightLog
    seen_by: Bytes
    left_to: Bytes
    shown: Bytes
    positions: Floats
    stops: Floats
    arrived: Bytes


class Heard(NamedTuple):
    """What one deputy knows by what others tell it: 1 for each point that counts, P padded.

    No rows where it heeds nothing.
    """

    unseen: Floats  # (K+1, P) that none has seen by a sample
    wanted: Floats  # (K, P) and that is left to no other


@compiled(error_model="numpy")
def look_for(now: Moment, wanted: Floats) -> None:
    """Make these points the ones that the only deputy looks for."""
    num_unseen = 0.0
    for j in range(now.world.num_points):
        now.state.unseen[0, j] = wanted[j]
        num_unseen += wanted[j]
    now.state.lanes.num_unseen[0] = num_unseen


@compiled(error_model="numpy")
def command_kept(now: Moment, kept: Floats) -> None:
    """Command the force, N, that keeps the only deputy apart from others, and note for which limit."""
    lanes = now.state.lanes
    lanes.limit[0] = kept[3]
    for axis in range(3):
        change = kept[axis] - lanes.commanded[axis, 0]
        lanes.change[axis, 0], lanes.commanded[axis, 0] = change, kept[axis]


@compiled(nogil=True, error_model="numpy")
def fly_heeding(
    optics: FullOptics | None,
    clusters: bool | None,
    errors: ModelErrors | None,
    flights: FlightBatch,
    heard: Heard,
    kept: Floats | None,
    state: FlightState,
    work: Workspace,
    log: FlightLog,
) -> None:
    """Fly the only flight, by what is heard, and log it.

    See `pipeline.flight.period.steps` for the first three; `kept`, (K, 4), are its commands and limits where
    it is kept apart from others.
    """
    flights, heard, state, work, log = borrowed((flights, heard, state, work, log))
    world, law, heeds = flights.world, flights.law, len(heard.unseen) > 0
    control = Control(law, flights.values[0, 0], flights.rules[0])
    start_lanes(Moment(world, state, 0, 1, 0), flights.cases, flights.counted)
    if law.needs & (URGENCY | SETTING):
        note_deadlines(Moment(world, state, 0, 1, 0), optics, work.deadlines, work.lit)
    for k in range(world.first, world.last + 1):
        now = Moment(world, state, 0, 1, k)
        if k > 0 and heeds:
            look_for(now, heard.unseen[k - 1])
        look(now, work, optics, None, errors, law.plans)
        if heeds:
            look_for(now, heard.wanted[k] if k < world.last else heard.unseen[k])
        choose_lane_target(now, work, optics, clusters, 0)
        if heeds:
            look_for(now, heard.unseen[k])
        write_sample(now, work.signals, errors, flights.counted[0], log, flights.cases[0])
        if k == world.last:
            break
        if heeds:
            look_for(now, heard.wanted[k])
        is_opened = is_given(now, flights.openings)
        decide(now, work, optics, control)
        open_with(now, flights.openings)
        if kept is not None:
            command_kept(now, kept[k])
            move_on(now, work, errors, law.plans)
        else:
            act(now, work, errors, law.plans)
        write_period(now, work, optics, control, errors, log, is_opened)


def fly_logged_fleet(mission: Mission, controller: Controller, scenario: Scenario) -> list[DeputyLog]:
    """Fly one fleet and log everything, a log each deputy.

    Raises
    ------
    ControllerError
        If the controller plans ahead.
    FlightError
        If the numbers of a flight are not finite.
    """
    messages = room_for_messages(mission, 1)
    check_controller(mission, controller)
    chosen = looked_ahead(mission, controller, [scenario], 1, records=True)
    fly_chosen(mission, chosen, [scenario], 1, messages=messages)
    each = [chosen.controllers[row] for row in chosen.followed[0]]
    if isinstance(controller, PilotController):
        (forces,) = controller.pilot.together(mission.of_each, [scenario.fleet], 1)
        each = [open_loop(controller.name, plan) for plan in forces]
    return [
        DeputyLog(
            row + 1,
            _fly_heeding(mission, each[row], start, messages, row, chosen),
            messages.seen_by[0],
            messages.left_to[0, row],
            messages.shown[0, row],
            messages.positions[0, row],
            messages.stops[0, row],
            messages.arrived[0, row],
        )
        for row, start in enumerate(scenario.fleet)
    ]


def _fly_heeding(
    mission: Mission, controller: Controller, start: Scenario, messages: Messages, row: int, chosen: Chosen
) -> FlightLog:
    """Fly one deputy by what the others tell it, and log it."""
    alone = mission.of_each
    world, law, cases = pack_world(alone), law_of(controller, alone), cases_of(alone, [start])
    openings = chosen.openings[row : row + 1]
    parts, flights, inspectable = flights_of(world, law, controller.numbers, cases, openings)
    unseen = np.zeros((mission.num_controls + 1, flights.counted.shape[1]))
    unseen[:, : world.num_points] = messages.unseen[0, row]
    wanted = unseen[:-1].copy()
    wanted[:, : world.num_points] *= messages.left_to[0, row] == 0
    heard = Heard(unseen, wanted)
    if mission.fleet.sharing == "nothing":
        heard = Heard(unseen[:0], wanted[:0])
    kept = messages.forces[0, row] if mission.fleet.keep_apart_m > 0.0 else None
    log = room_for_log(alone, world, law)
    state, work = make_state(world, parts[-1]), make_workspace(world)
    fly_heeding(*parts, flights, heard, kept, state, work, log)
    logged = completed_log(alone, world, parts[-1], flights, inspectable, log)
    if len(chosen.tour_costs):
        logged = logged._replace(tour_costs_m_s=chosen.tour_costs[0, row, np.newaxis])
    if chosen.decisions:
        decided: dict[str, Any] = {**foresight_fields([of_all[row] for of_all in chosen.decisions])}
        logged = logged._replace(**decided)
    return logged
