"""Flights as a friend would ask for them: missions, starts and controllers in; outcomes and logs out."""

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

import numpy as np
from numpy.typing import NDArray

from fis_tools.engines.compiled import sparingly
from fis_tools.engines.kernel import FEW_LANES, LANES, evaluate, make_scratch
from fis_tools.engines.packing import Packed
from fis_tools.engines.vectors import make_rows
from pipeline.flight.cases import Cases, Starts, cases_of
from pipeline.flight.controller import (
    Controller,
    ControllerError,
    law_of,
    rehearsed_pushes,
    unanswered,
)
from pipeline.flight.dispersions import groups_of, mission_of_case
from pipeline.flight.guidance import num_clusters
from pipeline.flight.kernel import arrays
from pipeline.flight.kernel.arrays import (
    CARRIED,
    NUM_OUTCOMES,
    TURNED,
    Beyond,
    Guard,
    Law,
    Plans,
    Workspace,
    World,
)
from pipeline.flight.kernel.loop import fly_many
from pipeline.flight.kernel.navigation import Departures
from pipeline.flight.kernel.optics import note_inspectable, note_lit_at_samples
from pipeline.flight.kernel.safety import MOST_CUTS
from pipeline.flight.light import sun_shares
from pipeline.flight.log import FlightLog, Outcomes, Scenario, empty_log, no_log
from pipeline.flight.navigation import as_believed
from pipeline.flight.plans import planned, regulated
from pipeline.flight.signals import SETTING, SIGNALS, constant
from pipeline.flight.tours import IMAGES, tour_images
from pipeline.flight.world import chief_attitudes, pack_world
from pipeline.physics.quaternion import dcm_b_from_h
from pipeline.settings.dispersions import distributions
from pipeline.settings.experiment import Mission

Floats = NDArray[np.float64]

#: what a rehearsal pays for a point missed, and for leaving the limits, more than any flight can spend
REHEARSED_POINT_M_S, OUTSIDE_M_S = 0.15, 1e4

#: where the rules decide on the first control period, too
NO_OPENINGS = np.zeros((0, 3))


def make_workspace(world: World, lanes: int = LANES) -> Workspace:
    """Allocate what one thread flies in, so many flights side by side."""
    points, width, instants = world.num_points, world.points.shape[2], world.num_attitude_steps
    clusters = num_clusters(points)
    return Workspace(
        lanes=make_rows(CARRIED, lanes)[0],
        aims=make_rows(TURNED, lanes, instants),
        passed=make_rows(TURNED, lanes, instants),
        unseen=np.zeros((lanes, width)),
        candidate=np.zeros(width),
        lit=np.zeros(width),
        seen=np.zeros(width),
        ahead=np.zeros(width),
        deadlines=np.zeros((lanes, width)),
        looks=np.zeros((5, width)),
        signals=np.zeros((len(SIGNALS), lanes)),
        scratch=make_scratch(lanes),
        candidates=np.zeros((3, width)),
        centres=np.zeros((lanes, clusters, 3)),
        num_centres=np.zeros(lanes, dtype=np.int64),
        clustered=np.zeros((lanes, width)),
        labels=np.zeros((2, width)),
        distances=np.zeros(width),
        sums=np.zeros((clusters, 4)),
        cuts=np.zeros((MOST_CUTS, 4)),
    )


def inspectable_points(
    world: World, starts: Starts, note: Callable[..., None] = note_inspectable
) -> NDArray[np.uint8]:
    """Tell which points are lit at some sample of each case's flight, shape (m, P padded) of 0 or 1."""
    found = np.empty((len(starts), world.points.shape[2]), dtype=np.uint8)
    note(world, optics_in_use(world, starts), make_workspace(world), starts, found)
    return found


def lit_at_samples(world: World, starts: Starts) -> NDArray[np.bool_]:
    """Tell which points are lit at each sample of one case's flight, shape (K+1, P)."""
    found = np.empty((world.num_controls + 1, world.points.shape[2]), dtype=np.uint8)
    note_lit_at_samples(world, optics_in_use(world, starts), make_workspace(world), starts, found)
    return np.ascontiguousarray(found[:, : world.num_points] > 0)


def counted_points(world: World, starts: Starts, inspectable: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Return the points that flights are about, as `inspectable_points`, or in one row what all share.

    In the paper's world these are all, whether they are ever lit or not; in others those that can be
    inspected, so that a deputy waits for no other.
    """
    if optics_in_use(world, starts) is None:
        return np.ones((1, inspectable.shape[1]), dtype=np.uint8)
    is_paper = np.zeros(len(starts), dtype=np.bool_) if world.has_optics else starts.sun_elevation == 0.0
    return np.where(is_paper[:, np.newaxis], np.uint8(1), inspectable)


def lanes_for(num_starts: int) -> int:
    """Return how many should fly side by side where few starts are flown often: by many controllers, say.

    A vector half of whose lanes are empty takes as long as a full one; but each width is compiled by itself.
    """
    return FEW_LANES if num_starts <= FEW_LANES else LANES


def fly_population(
    world: World,
    law: Law,
    numbers: Packed,
    cases: Cases,
    workers: int | None = None,
    tracks: NDArray[np.float32] | None = None,
    openings: Floats | None = None,
    lanes: int = LANES,
) -> Outcomes:
    """Fly every controller of a population from every start.

    Parameters
    ----------
    world : World
    law : Law
        Of the structure that the population shares.
    numbers : Packed
        n controllers.
    cases : Cases
        m starts.
    workers : int, optional
        Threads; one for each processor unless given. The result does not depend on it.
    tracks : (n * m, K+1, 3 or 15) float32, optional
        Filled with positions, m, Hill axes; where there is room for them also with velocities, m/s, the
        delta-v spent, m/s, the number of points not yet inspected, the force fired over the control period
        that follows, N, the boresight, both in Hill axes, and how fast the deputy turns relative to Hill,
        rad/s: columns as in `pipeline.flight.kernel.arrays`.
    openings : (m, 3) array, optional
        What is fired from each start in the first control period in place of what the rules decide, N, Hill
        axes.
    lanes : int
        Flights side by side. The result does not depend on it; see `lanes_for`.

    Returns
    -------
    Outcomes
        Arrays of shape (n, m).

    Raises
    ------
    FlightError
        If a flight did not stay finite.
    """
    num_pairs = len(numbers.values) * len(cases)
    outcomes = np.empty((num_pairs, NUM_OUTCOMES))
    workers = workers or os.cpu_count() or 1
    # what flies side by side stays together
    shares = iter(_shares(num_pairs, lanes if len(numbers.values) == 1 else max(1, len(cases)), workers))
    silent = no_log()
    inspectable = inspectable_points(world, cases.starts)
    counted = counted_points(world, cases.starts, inspectable)
    tracks = np.empty((0, 0, 3), dtype=np.float32) if tracks is None else tracks

    def fly_shares() -> None:
        """Fly one share after the other, of those that no other thread has taken."""
        work, parts = make_workspace(world, lanes), _parts_in_use(world, law, cases, lanes)
        for first, last in shares:
            fly_many(
                world,
                *parts,
                law,
                numbers.values,
                numbers.rules,
                cases.starts,
                counted,
                NO_OPENINGS if openings is None else openings,
                work,
                silent,
                tracks,
                first,
                last,
                outcomes,
            )

    if workers == 1:
        fly_shares()
    else:
        with ThreadPoolExecutor(workers) as pool:
            for done in [pool.submit(fly_shares) for _ in range(workers)]:
                done.result()
    rows = outcomes.reshape(len(numbers.values), len(cases), NUM_OUTCOMES)
    return _outcomes(rows, inspectable[:, : world.num_points].sum(axis=1, dtype=np.int64))


def _shares(num_flights: int, whole: int, workers: int) -> list[tuple[int, int]]:
    """Share flights out as (first, last), in ever smaller multiples of so many: threads end together."""
    shares, first = [], 0
    while first < num_flights:
        left = -(-(num_flights - first) // whole)
        last = min(num_flights, first + whole * (left if workers == 1 else -(-left // (2 * workers))))
        shares.append((first, last))
        first = last
    return shares


def optics_in_use(world: World, starts: Starts) -> Beyond | None:
    """Return in what light or camera are not the paper's; None where they are."""
    return beyond_of(world, is_tilted=bool(np.any(starts.sun_elevation != 0.0)))


def beyond_of(world: World, *, is_tilted: bool) -> Beyond | None:
    """Return the same where the Sun of some start is out of the orbit plane, or of none."""
    if not (world.has_optics or is_tilted):
        return None
    return Beyond(closely=world.num_edge_cells > 0 or world.reflection.is_on or None)


def _parts_in_use(
    world: World, law: Law, cases: Cases, lanes: int = LANES
) -> tuple[Beyond | None, Guard | None, bool | None, bool | None, Departures | None]:
    """Return the parts of a flight that are compiled only where they are used; None for those that are not.

    Light and camera beyond the paper's, the safety layer, clusters, pushes that show what sets, and what
    departs from what the deputy takes to be. In worlds other than the paper's the safety layer and pushes are
    compiled in any case, so that few kinds of flight serve many worlds.
    """
    optics, departures = optics_in_use(world, cases.starts), cases.departures(world.course, lanes)
    is_elsewhere = optics is not None or departures is not None
    return (
        optics,
        world.guard if world.guard.is_on or is_elsewhere else None,
        world.has_clusters or None,
        bool(law.needs & SETTING) or is_elsewhere or None,
        departures,
    )


class FlightError(ValueError):
    """A flight whose state became infinite or not a number: it tells nothing."""


def _check_finite(*numbers: Floats) -> None:
    """Raise FlightError unless all numbers of a flight are finite."""
    if not all(np.isfinite(some).all() for some in numbers):
        raise FlightError(
            "a flight did not stay finite: its position, attitude or force became infinite or not a number; "
            "lower attitude.proportional_gain, deputy.max_torque_n_m or attitude_period_s, with which it "
            "cannot be flown"
        )


def _outcomes(rows: Floats, inspectable_count: NDArray[np.int64]) -> Outcomes:
    _check_finite(rows)
    return Outcomes(
        delta_v_m_s=rows[..., arrays.DELTA_V],
        inspected_count=np.rint(rows[..., arrays.INSPECTED]).astype(np.int64),
        inspectable_count=np.broadcast_to(inspectable_count, rows.shape[:-1]),
        mean_distance_m=rows[..., arrays.MEAN_DISTANCE],
        min_distance_m=rows[..., arrays.MIN_DISTANCE],
        max_distance_m=rows[..., arrays.MAX_DISTANCE],
        outside_m=rows[..., arrays.OUTSIDE],
        safety_periods=np.rint(rows[..., arrays.SAFETY_PERIODS]).astype(np.int64),
        safety_delta_v_m_s=rows[..., arrays.SAFETY_DELTA_V],
    )


def fly_all(
    mission: Mission,
    controller: Controller,
    scenarios: list[Scenario],
    workers: int | None = None,
    tracks: NDArray[np.float32] | None = None,
    lanes: int = LANES,
) -> Outcomes:
    """Fly one controller from many starts; arrays of shape (m,). See `fly_population` for the rest.

    Where settings are dispersed, cases that share all of theirs fly side by side; so do those that follow the
    same image of a tour.
    """
    if distributions(mission.dispersions):
        groups = [(own, controller, places) for own, places in groups_of(mission, scenarios)]
        return _fly_groups(groups, scenarios, workers, tracks)
    if is_by_the_reference(mission, controller):
        return _outcomes_of_logs(mission, controller, scenarios, tracks)
    images = tour_images(controller)
    if images:
        followed = rehearsed_tours(mission, controller, scenarios, workers, lanes)
        chosen = np.unique(followed).tolist()
        groups = [(mission, images[image], np.flatnonzero(followed == image).tolist()) for image in chosen]
        return _fly_groups(groups, scenarios, workers, tracks, lanes)
    world, cases = pack_world(mission), cases_of(mission, scenarios)
    law, numbers = law_for(controller, mission, scenarios, workers), controller.numbers
    openings = rehearsed_openings(mission, controller, scenarios, workers)
    many = fly_population(world, law, numbers, cases, workers, tracks, openings, lanes)
    return Outcomes(**{name: values[0] for name, values in vars(many).items()})


def _fly_groups(
    groups: list[tuple[Mission, Controller, list[int]]],
    scenarios: list[Scenario],
    workers: int | None,
    tracks: NDArray[np.float32] | None,
    lanes: int = LANES,
) -> Outcomes:
    """Fly cases in the missions and with the controllers that are their own, given with their places."""

    def fly_group(group: tuple[Mission, Controller, list[int]]) -> tuple[list[int], Outcomes]:
        own, controller, places = group
        found = None if tracks is None else tracks[places]
        own_lanes = lanes_for(len(places)) if len(groups) > FEW_LANES else lanes
        outcomes = fly_all(own, controller, [scenarios[place] for place in places], 1, found, own_lanes)
        if tracks is not None and found is not None:
            tracks[places] = found
        return places, outcomes

    pool = ThreadPoolExecutor(workers or os.cpu_count() or 1)
    try:
        flown = list(pool.map(fly_group, groups))
    finally:
        pool.shutdown(cancel_futures=True)
    order = np.argsort([place for places, _ in flown for place in places])
    return Outcomes(
        **{
            name: np.concatenate([vars(outcomes)[name] for _, outcomes in flown])[order]
            for name in vars(flown[0][1])
        }
    )


def rehearsed_openings(
    mission: Mission, controller: Controller, scenarios: list[Scenario], workers: int | None
) -> Floats | None:
    """Return the force of the first control period from each start for a controller that rehearses it.

    All its first pushes are flown to the end from every start, as the deputy takes start and mission to be;
    the one whose flight ends cheapest is chosen: inside the limits if any is, then by delta-v and a price for
    each point missed beyond those that the controller itself leaves when it coasts.

    Returns
    -------
    (m, 3) array or None
        N, Hill axes; None for a controller that does not rehearse.
    """
    pushes = rehearsed_pushes(controller)
    if not len(pushes):
        return None
    forces = pushes * mission.deputy.mass_kg / mission.control_period_s
    known, starts = as_believed(mission, scenarios)
    world, cases = pack_world(known), cases_of(known, starts)
    ends = fly_population(
        world,
        law_of(controller, known),
        controller.numbers,
        cases.repeated(len(forces)),
        workers,
        openings=np.tile(forces, (len(cases), 1)),
    )
    cost = _rehearsed_costs(controller, ends)
    return np.asarray(forces[cost.reshape(len(cases), len(forces)).argmin(axis=1)])


def rehearsed_tours(
    mission: Mission,
    controller: Controller,
    scenarios: list[Scenario],
    workers: int | None,
    lanes: int = LANES,
) -> NDArray[np.int64]:
    """Return which image of its tour a controller follows from each start: that whose flight ends cheapest.

    All are flown to the end, as first pushes are, see `rehearsed_openings`.

    Returns
    -------
    (m,) array
        Places in `pipeline.flight.tours.IMAGES`.
    """
    known, starts = as_believed(mission, scenarios)
    world, cases, law = pack_world(known), cases_of(known, starts), law_of(controller, known)
    flown = [
        fly_population(world, law, image.numbers, cases, workers, lanes=lanes)
        for image in tour_images(controller)
    ]
    costs = [_rehearsed_costs(controller, ends)[0] for ends in flown]
    return np.asarray(np.argmin(costs, axis=0))


def tour_followed(mission: Mission, controller: Controller, scenario: Scenario) -> str | None:
    """Say which image of its tour a controller follows from a start; None where it has flown none ahead."""
    if not tour_images(controller):
        return None
    return IMAGES[rehearsed_tours(mission_of_case(mission, scenario), controller, [scenario], 1)[0]]


def _rehearsed_costs(controller: Controller, ends: Outcomes) -> Floats:
    """Return by what flights ahead are compared, m/s, of the shape of the outcomes."""
    # as many as the controller puts up with cost nothing
    least = max(1.0, controller.constants[constant("coast_below_points")])
    missed = np.maximum(0.0, ends.inspectable_count - ends.inspected_count - np.ceil(least) + 1.0)
    cost = ends.delta_v_m_s + REHEARSED_POINT_M_S * missed + OUTSIDE_M_S * ends.is_violated
    return np.asarray(cost)


def law_for(
    controller: Controller, mission: Mission, scenarios: list[Scenario], workers: int | None = None
) -> Law:
    """Return what compiled flights from some starts need to know of a controller, with their plans."""
    law, num_controls = law_of(controller, mission), mission.num_controls
    if controller.regulator is not None:
        return law._replace(plans=regulated(controller.regulator, scenarios))
    if controller.pilot is not None:
        return law._replace(plans=unanswered(controller.pilot(mission, scenarios, workers)))
    if controller.planner is None:
        return law
    world, numbers, cases = pack_world(mission), controller.numbers, cases_of(mission, scenarios)

    def fly(periods: int, plans: Plans) -> None:
        fly_population(
            world._replace(num_controls=periods), law._replace(plans=plans), numbers, cases, workers
        )

    return law._replace(plans=planned(controller.planner, num_controls, scenarios, fly, workers))


def is_by_the_reference(mission: Mission, controller: Controller | None = None) -> bool:
    """Tell whether only the readable reference flies this.

    So it is for scikit-learn's clusters, and for attitudes and torques that are played.
    """
    plays_turns = controller is not None and controller.plays_turns
    return plays_turns or (mission.guidance.kind == "clusters" and mission.guidance.engine == "sklearn")


def _fly_reference(mission: Mission, controller: Controller, scenario: Scenario) -> FlightLog:
    from pipeline.flight.reference import loop  # noqa: PLC0415 - plain Python, and only here
    from pipeline.flight.reference.channels import channels_of, plan_of  # noqa: PLC0415

    numbers, plans = controller.numbers, law_for(controller, mission, [scenario], 1).plans

    def infer(system: int, inputs: Floats) -> float:
        row = inputs[np.newaxis, : len(controller.systems[system].inputs)]
        return float(evaluate(numbers, row, system)[0])

    if len(rehearsed_pushes(controller)) or tour_images(controller):
        raise ControllerError(
            f"controller {controller.name!r} flies ahead, which guidance.engine=sklearn is too slow for; "
            "choose guidance.engine=compiled, or leave rehearsal_reach_m_s and rehearsal_tours out"
        )
    channels = channels_of(controller.systems, controller.force_axes, plan_of(plans), controller.constants)
    return loop.fly(mission, scenario, channels, infer, turns=controller.turns)


def _outcomes_of_logs(
    mission: Mission,
    controller: Controller,
    scenarios: list[Scenario],
    tracks: NDArray[np.float32] | None,
) -> Outcomes:
    rows, inspectable = np.empty((len(scenarios), NUM_OUTCOMES)), np.empty(len(scenarios), dtype=np.int64)
    limits = mission.deputy
    for case, scenario in enumerate(scenarios):
        log = fly_logged(mission, controller, scenario)
        if tracks is not None:
            tracks[case] = tracked(mission, log)[:, : tracks.shape[2]]
        inspectable[case] = log.is_inspectable.sum()
        distance = np.linalg.norm(log.position_m, axis=1)
        outside = np.maximum(limits.min_distance_m - distance[1:], distance[1:] - limits.max_distance_m)
        rows[case, arrays.DELTA_V] = log.delta_v_m_s[-1]
        rows[case, arrays.INSPECTED] = log.is_inspected[-1].sum()
        rows[case, arrays.MEAN_DISTANCE] = distance.mean()
        rows[case, arrays.MIN_DISTANCE] = distance.min()
        rows[case, arrays.MAX_DISTANCE] = distance.max()
        rows[case, arrays.OUTSIDE] = max(0.0, float(outside.max()))
        rows[case, arrays.SAFETY_PERIODS] = np.count_nonzero(log.safety_limit)
        per_force = mission.control_period_s / limits.mass_kg
        rows[case, arrays.SAFETY_DELTA_V] = np.abs(log.safety_force_hill_n).sum() * per_force
    return _outcomes(rows, inspectable)


def tracked(mission: Mission, log: FlightLog) -> Floats:
    """Return the track of a logged flight, (K+1, 15), in double precision; see `fly_population`."""
    left = np.count_nonzero(~log.is_inspected, axis=1)
    fired = np.vstack([log.force_hill_n, np.zeros(3)])
    boresights = [dcm_b_from_h(turned).T @ mission.sensor.boresight for turned in log.quaternion_b_from_h]
    turn_rates = np.linalg.norm(log.angular_velocity_b_rad_s, axis=1)
    columns = [log.position_m, log.velocity_m_s, log.delta_v_m_s, left, fired, boresights, turn_rates]
    return np.column_stack(columns)


def fly_logged(mission: Mission, controller: Controller, scenario: Scenario) -> FlightLog:
    """Fly one episode and keep everything that happened."""
    mission = mission_of_case(mission, scenario)
    if is_by_the_reference(mission, controller):
        return _fly_reference(mission, controller, scenario)
    images = tour_images(controller)
    if images:
        controller = images[rehearsed_tours(mission, controller, [scenario], 1)[0]]
    world = pack_world(mission)
    law, numbers = law_for(controller, mission, [scenario], 1), controller.numbers
    log = empty_log(mission.num_controls, mission.num_attitude_steps, world.num_points, len(law.axes))
    log.mass_kg[:] = mission.deputy.mass_kg
    openings, cases = rehearsed_openings(mission, controller, [scenario], 1), cases_of(mission, [scenario])
    inspectable = inspectable_points(world, cases.starts, sparingly(note_inspectable))
    sparingly(fly_many)(
        world,
        *_parts_in_use(world, law, cases),
        law,
        numbers.values,
        numbers.rules,
        cases.starts,
        counted_points(world, cases.starts, inspectable),
        NO_OPENINGS if openings is None else openings,
        make_workspace(world),
        log,
        np.empty((0, 0, 3), dtype=np.float32),
        0,
        1,
        np.empty((1, NUM_OUTCOMES)),
    )
    log.quaternion_c_from_h[:] = chief_attitudes(mission)
    log.sun_elevation_rad[:] = scenario.sun_elevation_rad
    log.visible_sun_share[:] = sun_shares(mission, log.sun_angle_rad, scenario.sun_elevation_rad)
    log.is_inspectable[:] = inspectable[0, : world.num_points] > 0
    _check_finite(
        log.position_m, log.velocity_m_s, log.quaternion_b_from_h, log.quaternion_c_from_h, log.force_hill_n
    )
    return log
