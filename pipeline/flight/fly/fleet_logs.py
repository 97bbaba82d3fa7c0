"""One flight of a fleet, logged: each deputy flies again alone, with what the others told it."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from fis_tools.compiled.decorator import compiled
from fis_tools.compiled.vectors import borrowed
from pipeline.array_types import Bytes, Floats
from pipeline.flight.cases.starts import cases_of
from pipeline.flight.control.controller import Controller
from pipeline.flight.control.law import law_of
from pipeline.flight.fly.fleets import fly_all_fleets, room_for_messages
from pipeline.flight.fly.logged import write_period, write_sample
from pipeline.flight.fly.many import FlightBatch, start_lanes
from pipeline.flight.fly.population import flights_of
from pipeline.flight.fly.simulation import completed_log, fly_logged, room_for_log
from pipeline.flight.fly.workspace import make_state, make_workspace
from pipeline.flight.period.decide.exchange import choose_lane_target
from pipeline.flight.period.decide.urgency import note_deadlines
from pipeline.flight.period.steps import act, decide, look
from pipeline.flight.state.arrays import Control, FlightState, FullOptics, Guard, Moment, Workspace
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
    """

    deputy: int
    flight: FlightLog
    seen_by: Bytes
    left_to: Bytes


class Heard(NamedTuple):
    """What one deputy knows by what others tell it: 1 for each point that counts, P padded."""

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


@compiled(nogil=True, error_model="numpy")
def fly_heeding(
    optics: FullOptics | None,
    guard: Guard | None,
    clusters: bool | None,
    pushes: bool | None,
    errors: ModelErrors | None,
    flights: FlightBatch,
    heard: Heard,
    state: FlightState,
    work: Workspace,
    log: FlightLog,
) -> None:
    """Fly the only flight, by what is heard, and log it.

    See `pipeline.flight.period.steps` for the first five.
    """
    flights, heard, state, work, log = borrowed((flights, heard, state, work, log))
    world, law = flights.world, flights.law
    control = Control(law, flights.values[0, 0], flights.rules[0])
    start_lanes(Moment(world, state, 0, 1, 0), flights.cases, flights.counted)
    if law.needs & (URGENCY | SETTING):
        note_deadlines(Moment(world, state, 0, 1, 0), optics, work.deadlines, work.lit)
    for k in range(world.first, world.last + 1):
        now = Moment(world, state, 0, 1, k)
        if k > 0:
            look_for(now, heard.unseen[k - 1])
        look(now, work, optics, None, errors, law.plans)
        look_for(now, heard.wanted[k] if k < world.last else heard.unseen[k])
        choose_lane_target(now, work, optics, clusters, 0)
        look_for(now, heard.unseen[k])
        write_sample(now, work.signals, errors, flights.counted[0], log, flights.cases[0])
        if k == world.last:
            break
        look_for(now, heard.wanted[k])
        decide(now, work, optics, pushes, control)
        act(now, work, guard, errors, law.plans)
        write_period(now, work, optics, control, errors, log, False)


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
    fly_all_fleets(mission, controller, [scenario], 1, messages=messages)
    seen_by, logs = messages.seen_by[0], []
    for row, start in enumerate(scenario.fleet):
        left_to = messages.left_to[0, row]
        if mission.fleet.sharing == "nothing":
            flight = fly_logged(mission.of_each, controller, start)
        else:
            flight = _fly_heeding(mission.of_each, controller, start, seen_by, left_to)
        logs.append(DeputyLog(row + 1, flight, seen_by, left_to))
    return logs


def _fly_heeding(
    mission: Mission, controller: Controller, start: Scenario, seen_by: Bytes, left_to: Bytes
) -> FlightLog:
    """Fly one deputy by what it is told, and log it."""
    world, law, cases = pack_world(mission), law_of(controller, mission), cases_of(mission, [start])
    parts, flights, inspectable = flights_of(world, law, controller.numbers, cases)
    unseen = np.tile(flights.counted[0].astype(np.float64), (len(seen_by), 1))
    unseen[:, : world.num_points] *= seen_by == 0
    wanted = unseen[:-1].copy()
    wanted[:, : world.num_points] *= left_to == 0
    log = room_for_log(mission, world, law)
    state, work = make_state(world, parts[-1]), make_workspace(world)
    fly_heeding(*parts, flights, Heard(unseen, wanted), state, work, log)
    return completed_log(mission, world, parts[-1], flights, inspectable, log)
