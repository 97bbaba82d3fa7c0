"""The simulation interface: from missions, starts and controllers to outcomes and logs."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fis_tools.engines.kernel import LANES
from pipeline.array_types import Bytes, Floats
from pipeline.flight.cases.dispersions import groups_of, mission_of_case
from pipeline.flight.cases.starts import cases_of
from pipeline.flight.control.controller import (
    Controller,
    ControllerError,
    PilotController,
    PlanningController,
    RegulatorController,
    RuleController,
    open_loop,
)
from pipeline.flight.control.law import law_of, planned, rehearsed_pushes
from pipeline.flight.fly.lesser_controllers import finishing, rehearsing
from pipeline.flight.fly.logged import write_reasons
from pipeline.flight.fly.many import FlightBatch, Results, fly_many
from pipeline.flight.fly.plain import is_interpreted, plain_if_interpreted
from pipeline.flight.fly.population import check_finite, flights_of, fly_population, lanes_of_group
from pipeline.flight.fly.rehearsals import by_tours, rehearse_tours, rehearsed_openings
from pipeline.flight.fly.replanning import Foreseen, PlannedDecision, foresee, foresees, foresight_fields
from pipeline.flight.fly.tours import following, tour_images
from pipeline.flight.fly.workspace import make_state, make_workspace
from pipeline.flight.state.arrays import NUM_OUTCOMES, Law, Plans, World
from pipeline.flight.state.errors import ModelErrors
from pipeline.flight.state.log import FlightLog, Outcomes, Scenario, combined, empty_log
from pipeline.flight.world.chief import chief_attitudes
from pipeline.flight.world.pack import pack_world, sun_shares
from pipeline.settings.dispersions import distributions
from pipeline.settings.experiment import Mission
from pipeline.threads import in_threads

#: flights with foresight that are planned side by side, as a task of one thread
NUM_PLANNED = 4 * LANES


def fly_all(
    mission: Mission,
    controller: Controller,
    scenarios: list[Scenario],
    workers: int | None = None,
    tracks: NDArray[np.float32] | None = None,
    lanes: int = LANES,
) -> Outcomes:
    """Fly one controller from many starts; arrays of shape (m,). See `fly_population` for the rest.

    With dispersions, cases with the same settings fly side by side; so do those that follow the
    same image of a tour.
    """
    if mission.flight == "reference":
        return _fly_all_by_reference(mission, controller, scenarios, workers, tracks)
    if groups := _groups_apart(mission, controller, scenarios):
        return _fly_groups(groups, scenarios, workers, tracks)
    check_flown_ahead(mission, controller)
    if isinstance(controller, RuleController) and foresees(controller):
        if len(scenarios) > NUM_PLANNED:
            parts = range(0, len(scenarios), NUM_PLANNED)
            each = [list(range(first, min(first + NUM_PLANNED, len(scenarios)))) for first in parts]
            groups = [(mission, controller, flights) for flights in each]
            return _fly_groups(groups, scenarios, workers, tracks, lanes)
        return _fly_foreseen(mission, controller, scenarios, tracks, lanes)
    if tour_images(controller):
        followed = rehearse_tours(mission, controller, scenarios, workers, lanes).followed
        groups = [
            (mission, following(controller, mission, tours), flights.tolist())
            for tours, flights in by_tours(followed).items()
        ]
        return _fly_groups(groups, scenarios, workers, tracks, lanes)
    world, cases = pack_world(mission), cases_of(mission, scenarios)
    law, numbers = law_for(controller, mission, scenarios, workers), controller.numbers
    openings, _ = rehearsed_openings(mission, controller, scenarios, workers)
    workers = 1 if is_interpreted(mission) else workers
    with plain_if_interpreted(mission):
        many = fly_population(
            world, law, numbers, cases, workers, tracks, openings, lanes, changes=controller.changes
        )
    return many.each(lambda values: values[0])


def _groups_apart(
    mission: Mission, controller: Controller, scenarios: list[Scenario]
) -> list[tuple[Mission, Controller, list[int]]]:
    """Return groups of cases that cannot fly side by side; none where all can."""
    if distributions(mission.dispersions):
        return [(settings, controller, flights) for settings, flights in groups_of(mission, scenarios)]
    if isinstance(controller, PilotController) and controller.pilot.turns and len(scenarios) > 1:
        # all that fly side by side play the same torques
        return [(mission, controller, [flight]) for flight in range(len(scenarios))]
    return []


def _fly_foreseen(
    mission: Mission,
    controller: RuleController,
    scenarios: list[Scenario],
    tracks: NDArray[np.float32] | None,
    lanes: int,
) -> Outcomes:
    """Fly a few starts by a controller with foresight, on this thread."""
    foreseen = foresee(mission, controller, scenarios, lanes)
    parts, flown = [], finishing(controller)
    by_rehearsal = np.flatnonzero(foreseen.is_rehearsed)
    if len(by_rehearsal):
        group = mission, rehearsing(controller), by_rehearsal.tolist()
        parts.append(_fly_groups([group], scenarios, 1, tracks, lanes))
    by_plan = np.flatnonzero(~foreseen.is_rehearsed)
    if len(by_plan):
        cases = cases_of(mission, [scenarios[flight] for flight in by_plan])
        group_tracks = None if tracks is None else tracks[by_plan]
        many = fly_population(
            *(pack_world(mission), law_of(flown, mission), flown.numbers, cases, 1, group_tracks),
            *(foreseen.openings[by_plan], lanes),
        )
        if tracks is not None and group_tracks is not None:
            tracks[by_plan] = group_tracks
        parts.append(many.each(lambda values: values[0]))
    order = np.argsort(np.concatenate([by_rehearsal, by_plan]))
    return combined(parts).each(lambda values: values[order])


def _fly_all_by_reference(
    mission: Mission,
    controller: Controller,
    scenarios: list[Scenario],
    workers: int | None,
    tracks: NDArray[np.float32] | None,
) -> Outcomes:
    """Fly from many starts by the reference, one flight after the other on each thread."""
    from pipeline.flight.fly import reference  # noqa: PLC0415 - SciPy's integrators are slow to import

    logs = in_threads(lambda scenario: fly_logged(mission, controller, scenario), scenarios, workers=workers)
    if tracks is not None:
        for log, rows in zip(logs, tracks, strict=True):
            reference.write_tracks(mission, log, rows)
    return reference.outcomes_of_logs(mission, logs)


def _fly_groups(
    groups: list[tuple[Mission, Controller, list[int]]],
    scenarios: list[Scenario],
    workers: int | None,
    tracks: NDArray[np.float32] | None,
    lanes: int = LANES,
) -> Outcomes:
    """Fly groups of cases, each with its own mission and controller, given with the indices of the cases."""

    def fly_group(group: tuple[Mission, Controller, list[int]]) -> tuple[list[int], Outcomes]:
        """Fly the cases of one group, and copy their tracks to their rows."""
        case_mission, controller, flights = group
        group_tracks = None if tracks is None else tracks[flights]
        group_lanes = lanes_of_group(len(groups), len(flights), lanes)
        outcomes = fly_all(
            case_mission, controller, [scenarios[flight] for flight in flights], 1, group_tracks, group_lanes
        )
        if tracks is not None and group_tracks is not None:
            tracks[flights] = group_tracks
        return flights, outcomes

    flown = in_threads(fly_group, groups, workers=workers)
    order = np.argsort([flight for flights, _ in flown for flight in flights])
    return combined([outcomes for _, outcomes in flown]).each(lambda values: values[order])


def law_for(
    controller: Controller, mission: Mission, scenarios: list[Scenario], workers: int | None = None
) -> Law:
    """Return a controller's law for compiled flights from some starts, with its plans for them."""
    law, num_controls = law_of(controller, mission), mission.num_controls
    if isinstance(controller, RegulatorController):
        return law._replace(plans=controller.regulator(scenarios))
    if isinstance(controller, PilotController):
        return law._replace(plans=controller.pilot(mission, scenarios, workers))
    if not isinstance(controller, PlanningController):
        return law
    planner, numbers = controller.planner, controller.numbers
    world, cases = pack_world(mission), cases_of(mission, scenarios)

    def fly(last: int, plans: Plans) -> Floats:
        known = np.empty((len(cases), 6 + world.num_points))
        flown = law._replace(plans=plans)
        fly_population(world._replace(last=last), flown, numbers, cases, workers, known=known)
        return known[:, :6]

    return law._replace(plans=planned(planner, num_controls, scenarios, fly, workers))


def check_flown_ahead(mission: Mission, controller: Controller) -> None:
    """Raise ControllerError if a controller flies ahead in a mission whose flights are plain Python."""
    if is_interpreted(mission) and (
        foresees(controller) or tour_images(controller) or len(rehearsed_pushes(controller))
    ):
        raise ControllerError(
            f"controller {controller.name!r} flies ahead, which guidance.engine=sklearn is too slow for; "
            "choose guidance.engine=compiled, or leave foresight_pushes, rehearsal_reach_m_s and "
            "rehearsal_tours out"
        )


class LookedAhead(NamedTuple):
    """What a controller flies by once it has looked ahead.

    Attributes
    ----------
    controller : Controller
        That follows what was chosen.
    openings : (1, n, 4) array, optional
        As `fly_population` takes them.
    fields : mapping of str to array
        Of the flight's log.
    """

    controller: Controller
    openings: Floats | None
    fields: dict[str, Any]


def looked_ahead(mission: Mission, controller: Controller, scenario: Scenario) -> LookedAhead:
    """Let a controller look ahead in a case's own mission.

    Raises
    ------
    ControllerError
        If it does so in a mission whose flights are plain Python.
    """
    check_flown_ahead(mission, controller)
    of_tours, decisions = np.empty((0, 0)), list[PlannedDecision]()
    foreseen: Foreseen | None = None
    if isinstance(controller, RuleController) and foresees(controller):
        foreseen = foresee(mission, controller, [scenario], records=True)
        decisions = foreseen.decisions
        controller = rehearsing(controller) if foreseen.is_rehearsed[0] else finishing(controller)
    if tour_images(controller):
        (of_tours,), (followed,) = rehearse_tours(mission, controller, [scenario], 1)
        controller = following(controller, mission, followed.tolist())
    openings, of_pushes = rehearsed_openings(mission, controller, [scenario], 1)
    if foreseen is not None and not foreseen.is_rehearsed[0]:
        openings = foreseen.openings
    ahead = {"push_costs_m_s": of_pushes[0], "tour_costs_m_s": of_tours}
    if decisions:
        ahead |= foresight_fields(decisions)
    return LookedAhead(controller, openings, ahead)


def fly_logged(mission: Mission, controller: Controller, scenario: Scenario) -> FlightLog:
    """Fly one episode and log everything.

    Raises
    ------
    ControllerError
        If the controller flies ahead in a mission whose flights are plain Python.
    FlightError
        If the flight's numbers are not finite.
    """
    mission = mission_of_case(mission, scenario)
    controller, openings, ahead = looked_ahead(mission, controller, scenario)
    if mission.flight == "reference":
        from pipeline.flight.fly import reference  # noqa: PLC0415 - as above

        if isinstance(controller, PilotController):
            plans = controller.pilot(mission, [scenario], 1)
            controller = open_loop(controller.name, plans.forces[0], turns=plans.turns)
        given = None if openings is None else openings[0]
        log = reference.fly_by_reference(mission, controller, scenario, given)
        check_finite(log.position_m, log.velocity_m_s, log.quaternion_b_from_h, log.force_hill_n)
        return log._replace(**ahead)
    world, cases = pack_world(mission), cases_of(mission, [scenario])
    law, numbers = law_for(controller, mission, [scenario], 1), controller.numbers
    log = room_for_log(mission, world, law)
    parts, flights, inspectable = flights_of(world, law, numbers, cases, openings, controller.changes)
    results = Results(np.empty((1, NUM_OUTCOMES)), log)
    state, work = make_state(world, parts[-1]), make_workspace(world)
    with plain_if_interpreted(mission):
        fly_many(*parts, flights, state, work, results, 0, 1)
    return completed_log(mission, world, parts[-1], flights, inspectable, log)._replace(**ahead)


def room_for_log(mission: Mission, world: World, law: Law) -> FlightLog:
    """Return an empty log of a mission's flight."""
    log = empty_log(mission.num_controls, mission.num_attitude_steps, world.num_points, len(law.axes))
    log.mass_kg[:] = mission.deputy.mass_kg
    return log


def completed_log(
    mission: Mission,
    world: World,
    errors: ModelErrors | None,
    flights: FlightBatch,
    inspectable: Bytes,
    log: FlightLog,
) -> FlightLog:
    """Return the log of the only flight with what compiled code does not write, if its numbers are finite.

    Raises
    ------
    FlightError
        If they are not.
    """
    num_counted = int(flights.counted[0, : world.num_points].sum())
    given = np.zeros(mission.num_controls, dtype=np.bool_)
    if len(flights.openings):
        given[: flights.openings.shape[1]] = flights.openings[0, :, 3] > 0.0
    write_reasons(world, flights.law, errors, log, num_counted, given)
    log.quaternion_c_from_h[:] = chief_attitudes(mission)
    log.visible_sun_share[:] = sun_shares(mission, log.sun_angle_rad, log.sun_elevation_rad)
    log.is_inspectable[:] = inspectable[0, : world.num_points] > 0
    attitudes = log.quaternion_b_from_h, log.quaternion_c_from_h
    check_finite(log.position_m, log.velocity_m_s, *attitudes, log.force_hill_n)
    return log
