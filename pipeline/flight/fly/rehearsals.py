"""Rehearsals: flights that a controller simulates to the end before choosing how to begin or to go on.

It may rehearse its first push, and the tours that it may follow, also later in the flight. Flights are
reproducible to the last digit: up to a later rehearsal they are flown again.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from fis_tools.engines.kernel import LANES
from pipeline.array_types import Bytes, Floats, Integers
from pipeline.flight.cases.navigation import as_believed, as_drawn
from pipeline.flight.cases.starts import cases_of
from pipeline.flight.control.controller import Controller
from pipeline.flight.control.law import law_of, rehearsed_pushes
from pipeline.flight.fly.aboard import OUTSIDE_M_S
from pipeline.flight.fly.population import fly_population, lanes_of_group
from pipeline.flight.fly.tours import following, rehearsal_samples, tour_images
from pipeline.flight.state.arrays import Guard
from pipeline.flight.state.log import Outcomes, Scenario
from pipeline.flight.state.signals import constant
from pipeline.flight.world.bounds import guard_of
from pipeline.flight.world.pack import pack_world
from pipeline.settings.experiment import Mission
from pipeline.threads import in_threads

#: flights that are drawn together: so many fly side by side at no further cost
NUM_DRAWN = LANES


def rehearsed_openings(
    mission: Mission, controller: Controller, scenarios: list[Scenario], workers: int | None
) -> tuple[Floats | None, Floats]:
    """Return the force of the first control period from each start for a controller that rehearses it.

    All its first pushes are flown to the end from every start, as the deputy knows start and mission; the one
    with the cheapest flight is chosen: inside the limits if any is, then by delta-v and a price for each
    point missed beyond those that the controller itself accepts when it coasts.

    Returns
    -------
    openings : (m, 1, 4)
        As `fly_population` takes them; None for a controller that does not rehearse.
    costs : (m, pushes)
        Of each push, m/s.
    """
    pushes = rehearsed_pushes(controller)
    if not len(pushes):
        return None, np.empty((len(scenarios), 0))
    forces = pushes * mission.deputy.mass_kg / mission.control_period_s
    openings = np.insert(forces, 3, 1.0, axis=1)[:, np.newaxis]
    known, starts = as_believed(mission, scenarios)
    world, cases = pack_world(known)._replace(guard=guard_of(mission)), cases_of(known, starts)
    ends = fly_population(
        world,
        law_of(controller, known),
        controller.numbers,
        cases.repeated(len(forces)),
        workers,
        openings=np.tile(openings, (len(cases), 1, 1)),
    )
    costs = rehearsed_costs(controller, ends).reshape(len(cases), len(forces))
    return openings[costs.argmin(axis=1)], costs


class Rehearsals(NamedTuple):
    """The results of rehearsing tours, S times in a flight, for flights from m starts."""

    costs: Floats  # (m, S, tours) m/s
    followed: Integers  # (m, S) the cheapest tour, which is followed up to the next rehearsal


def rehearse_tours(
    mission: Mission,
    controller: Controller,
    scenarios: list[Scenario],
    workers: int | None,
    lanes: int = LANES,
) -> Rehearsals:
    """Fly the tours that a controller rehearses ahead, from some starts and from later on.

    Later rehearsals begin where the deputy believes to be by then, with errors like those at the start, the
    points that are left, and the camera aimed. `mission` has the settings drawn for these cases, if any: the
    deputy knows them.
    """
    samples, num_tours = rehearsal_samples(controller, mission), len(tour_images(controller))
    costs = np.empty((len(scenarios), len(samples), num_tours))
    followed = np.zeros((len(scenarios), len(samples)), dtype=np.int64)
    known, believed = as_believed(mission, scenarios)
    # tours are flown as `known`, without errors, and with drawn ones as `drawn`
    drawn, left = replace(mission, dispersions={}), None
    for rehearsal, sample in enumerate(samples):
        if sample > 0:
            believed, left = _at_sample(
                mission, controller, scenarios, followed[:, :rehearsal], workers, lanes
            )
            aimed = replace(mission.attitude, mode="ideal")
            known, drawn = replace(known, attitude=aimed), replace(drawn, attitude=aimed)
        ahead = _Ahead(controller, guard_of(mission), sample, rehearsal, left, workers, lanes)
        costs[:, rehearsal] = ahead.costs(known, drawn, believed)
        followed[:, rehearsal] = costs[:, rehearsal].argmin(axis=1)
    return Rehearsals(costs, followed)


def _at_sample(
    mission: Mission,
    controller: Controller,
    scenarios: list[Scenario],
    followed: Integers,
    workers: int | None,
    lanes: int,
) -> tuple[list[Scenario], Bytes]:
    """Fly up to the next rehearsal.

    Returns
    -------
    believed : list of Scenario
        The starts, with the positions and velocities that the deputies believe in by then.
    left : (m, P padded)
        1 for the points that are still to be inspected.
    """
    sample = rehearsal_samples(controller, mission)[followed.shape[1]]
    world, law = pack_world(mission)._replace(last=sample), law_of(controller, mission)
    known = np.empty((len(scenarios), 6 + world.num_points))
    groups = by_tours(followed)

    def fly(tours: Sequence[int], flights: Integers) -> None:
        follower, known_there = (
            following(controller, mission, tours),
            np.empty((len(flights), known.shape[1])),
        )
        cases = cases_of(mission, [scenarios[flight] for flight in flights])
        width = lanes_of_group(len(groups), len(flights), lanes)
        fly_population(
            world, law, follower.numbers, cases, 1, lanes=width, changes=follower.changes, known=known_there
        )
        known[flights] = known_there

    in_threads(fly, groups.keys(), groups.values(), workers=workers)
    left = np.zeros((len(scenarios), world.points.shape[2]), dtype=np.uint8)
    left[:, : world.num_points] = known[:, 6:]
    believed = [
        replace(start, position_m=row[:3], velocity_m_s=row[3:6])
        for start, row in zip(scenarios, known, strict=True)
    ]
    return believed, left


def by_tours(followed: Integers) -> dict[tuple[int, ...], Integers]:
    """Return, for each sequence of tours that is followed, the indices of the flights that follow it.

    `followed` has a row for each flight.
    """
    distinct, inverse = np.unique(followed, axis=0, return_inverse=True)
    return {
        tuple(row): np.flatnonzero(inverse.ravel() == index) for index, row in enumerate(distinct.tolist())
    }


@dataclass(frozen=True)
class _Ahead:
    """Flies tours ahead from a sample on."""

    controller: Controller
    guard: Guard  # deputies know their safety layer
    sample: int
    rehearsal: int  # of this rehearsal among those of a flight
    left: Bytes | None  # points still to be inspected; None at the start
    workers: int | None
    lanes: int

    def costs(self, known: Mission, drawn: Mission, believed: list[Scenario]) -> Floats:
        """Return the cost of each tour as the deputies estimate it, m/s, shape (m, tours).

        All are flown to the end, like first pushes, see `rehearsed_openings`. With ``rehearsal_draws`` costs
        are means: again and again, the tour that is cheapest so far is flown `NUM_DRAWN` times more, with
        errors drawn by the mission's settings, up to so many flights in all. So draws go to the tours that
        the choice is between, and none is followed because a single flight went well. A start's first draw is
        the same for all tours, as are its further ones. Tours without draws cost infinitely much.
        """
        num_draws = round(self.controller.constants[constant("rehearsal_draws")])
        num_tours, every = len(tour_images(self.controller)), np.arange(len(believed))
        fly = self._flying(known)
        costs = np.column_stack([fly(tour, believed, every) for tour in range(num_tours)])
        if not num_draws:
            return costs
        fly, num_flown = self._flying(drawn), np.ones(costs.shape, dtype=np.int64)
        for begun in range(0, num_draws, NUM_DRAWN):
            count = min(NUM_DRAWN, num_draws - begun)
            best = costs.argmin(axis=1)
            for tour in np.unique(best).tolist():
                flights = np.flatnonzero(best == tour)
                flown, each = num_flown[flights, tour], np.repeat(flights, count)
                draws = self.rehearsal * num_draws + flown[:, np.newaxis] + np.arange(count)
                starts = as_drawn(drawn, [believed[flight] for flight in each], draws.ravel().tolist())
                more = fly(tour, starts, each).reshape(-1, count).sum(axis=1)
                costs[flights, tour] = (costs[flights, tour] * flown + more) / (flown + count)
                num_flown[flights, tour] += count
        # a flight without errors is too good to be compared with those
        costs[num_flown == 1] = np.inf
        return costs

    def _flying(self, mission: Mission) -> Callable[[int, list[Scenario], Integers], Floats]:
        """Return a function that flies a tour from the starts of some flights and returns the costs, (m,)."""
        world = pack_world(mission)._replace(first=self.sample, guard=self.guard)
        law = law_of(self.controller, mission)
        images = tour_images(self.controller)

        def costs_of(tour: int, starts: list[Scenario], flights: Integers) -> Floats:
            """Return the costs of a tour in each flight, m/s, (m,)."""
            ends = fly_population(
                *(world, law, images[tour].numbers, cases_of(mission, starts), self.workers),
                lanes=self.lanes,
                wanted=None if self.left is None else self.left[flights],
            )
            return np.asarray(rehearsed_costs(self.controller, ends)[0])

        return costs_of


def rehearsed_costs(controller: Controller, ends: Outcomes) -> Floats:
    """Return the costs by which rehearsals are compared, m/s, of the shape of the outcomes."""
    constants = controller.constants
    price = constants[constant("rehearsal_point_m_s")]
    # missed points that the controller accepts cost nothing
    accepted = np.ceil(max(1.0, constants[constant("coast_below_points")])) - 1.0
    missed = np.maximum(0.0, ends.inspectable_count - ends.inspected_count - accepted)
    return np.asarray(ends.delta_v_m_s + price * missed + OUTSIDE_M_S * ends.is_violated)
