"""Rehearsals: flights that a controller simulates to the end from each start before choosing how to begin.

A controller may rehearse the images of its tour, closed paths around the chief that show as much for as
little as the tour itself. Motion about a circular orbit, light and shadow are unchanged when mirrored in
the orbit plane, with the Sun. They are also unchanged when time and the along-track axis are reversed:
where a tour leads from one place to the next, its image leads back, past places mirrored along the track,
while the Sun moves as always. So a tour has four images, including itself, and which is nearest depends on
the start. Each may be rehearsed in other times, sizes and shapes too, and again later in the flight. Flights
are reproducible to the last digit: up to a later rehearsal they are flown again.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import product
from typing import NamedTuple

import numpy as np

from fis_tools.engines.kernel import LANES
from fis_tools.model import FuzzyController
from pipeline.array_types import Bytes, Floats, Integers
from pipeline.flight.cases.navigation import as_believed, as_drawn
from pipeline.flight.cases.starts import cases_of
from pipeline.flight.control.controller import (
    Controller,
    from_fuzzy,
    law_of,
    rehearsal_stride,
    rehearsed_pushes,
)
from pipeline.flight.fly.population import fly_population, lanes_of_group
from pipeline.flight.state.log import Outcomes, Scenario
from pipeline.flight.state.signals import TOUR_PLACES, constant
from pipeline.flight.world.pack import pack_world
from pipeline.settings.experiment import Mission
from pipeline.threads import in_threads

#: names of the images, in the order in which they are tried
IMAGES = (
    "as it is",
    "mirrored through the orbit plane",
    "the other way round",
    "the other way round and mirrored through the orbit plane",
)


def sign(name: str, image: int) -> float:
    """Return the factor of a tour's constant in an image.

    The lift keeps its sign in the mirror: it is multiplied by the Sun's elevation, which changes sign. With
    time reversed the tour's place at an angle is its former place at minus that angle, where sines change
    sign, mirrored along the track.
    """
    is_mirrored, is_turned_round = image % 2 == 1, image >= 2
    flips = is_mirrored and name.startswith("tour_cross_track")
    if is_turned_round:
        flips ^= ("_sin_" in name) ^ name.startswith("tour_along_track")
    return -1.0 if flips else 1.0


class Tour(NamedTuple):
    """A tour that is flown ahead."""

    image: int
    size: float  # share of the controller's own
    time_s: float  # in place of ``tour_time_s``
    shape: int  # 0 for the controller's own, then those drawn around it


#: times in which each image is flown ahead, if the controller says how slow
NUM_TIMES = 3
#: flights that are drawn together: so many fly side by side at no further cost
NUM_DRAWN = LANES


def rehearsed_tours(controller: Controller) -> list[Tour]:
    """Return the tours that a controller rehearses, first its own; none by default."""
    values = controller.constants
    own, slowest = values[constant("tour_time_s")], values[constant("rehearsal_slowest_s")]
    smallest, num_images = values[constant("rehearsal_smallest")], round(values[constant("rehearsal_tours")])
    shapes = range(round(values[constant("rehearsal_shapes")]) + 1)
    times = np.geomspace(own, slowest, NUM_TIMES) if slowest > 0.0 else [own]
    sizes = [1.0, smallest] if smallest > 0.0 else [1.0]
    found = product(shapes, times, sizes, range(num_images))
    return [Tour(image, float(size), float(time), shape) for shape, time, size, image in found]


def tour_names(controller: Controller) -> list[str]:
    """Return what each tour that a controller rehearses is called."""
    tours = rehearsed_tours(controller)
    with_time, with_size = (len({tour[part] for tour in tours}) > 1 for part in (2, 1))
    return [
        (f"shape {tour.shape}, " if tour.shape else "")
        + IMAGES[tour.image]
        + (f", {100.0 * tour.size:.0f} % of its size" if with_size else "")
        + (f", in {tour.time_s:.0f} s" if with_time else "")
        for tour in tours
    ]


@lru_cache(maxsize=8)
def tour_images(controller: Controller) -> tuple[Controller, ...]:
    """Return a controller for each tour that a controller rehearses; none by default.

    Each follows its tour without rehearsing any. The first follows the controller's own.
    """
    fuzzy = controller.fuzzy
    return tuple(_following(fuzzy, tour) for tour in rehearsed_tours(controller) if fuzzy is not None)


def _following(fuzzy: FuzzyController, tour: Tour) -> Controller:
    attributes, off = dict(fuzzy.attributes), np.zeros(len(TOUR_PLACES))
    if tour.shape > 0:
        drawn = np.random.default_rng(0).standard_normal((tour.shape, len(TOUR_PLACES)))
        off = float(attributes.get("rehearsal_spread_m", 0.0)) * drawn[-1]
    for name, shift in zip(TOUR_PLACES, off.tolist(), strict=True):
        place = float(attributes.get(name, 0.0)) + shift
        attributes[name] = repr(sign(name, tour.image) * tour.size * place)
    for name in REHEARSING_TOURS:
        attributes.pop(name, None)
    attributes["tour_time_s"] = repr(tour.time_s)
    return from_fuzzy(replace(fuzzy, attributes=tuple(attributes.items())))


def following(controller: Controller, mission: Mission, tours: Sequence[int]) -> Controller:
    """Return a controller for the tours that a controller follows, from each of its rehearsals on."""
    images, samples = tour_images(controller), rehearsal_samples(controller, mission)
    followed = [images[tour] for tour in tours]
    return replace(followed[0], later=tuple(zip(samples[1:], followed[1:], strict=False)))


def rehearsal_samples(controller: Controller, mission: Mission) -> list[int]:
    """Return the samples at which a controller rehearses its tours, from 0."""
    stride = rehearsal_stride(controller, mission)
    return list(range(0, mission.num_controls, stride)) if stride else [0]


#: rehearsal costs of a point missed, and of leaving the limits, more than any flight can spend
REHEARSED_POINT_M_S, OUTSIDE_M_S = 0.15, 1e4
#: the first where errors are drawn: high, so that the choice is by the share of flights that succeed
DRAWN_POINT_M_S = 0.7
#: constants that say which tours are flown ahead, and how often
REHEARSING_TOURS = (
    *("rehearsal_tours", "rehearsal_slowest_s", "rehearsal_smallest"),
    *("rehearsal_shapes", "rehearsal_spread_m", "rehearsal_draws", "rehearsal_period_s"),
)


def rehearsed_openings(
    mission: Mission, controller: Controller, scenarios: list[Scenario], workers: int | None
) -> tuple[Floats | None, Floats]:
    """Return the force of the first control period from each start for a controller that rehearses it.

    All its first pushes are flown to the end from every start, as the deputy knows start and mission; the one
    with the cheapest flight is chosen: inside the limits if any is, then by delta-v and a price for each
    point missed beyond those that the controller itself accepts when it coasts.

    Returns
    -------
    openings : (m, 3)
        N, Hill axes; None for a controller that does not rehearse.
    costs : (m, pushes)
        Of each push, m/s.
    """
    pushes = rehearsed_pushes(controller)
    if not len(pushes):
        return None, np.empty((len(scenarios), 0))
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
    costs = _rehearsed_costs(controller, ends).reshape(len(cases), len(forces))
    return np.asarray(forces[costs.argmin(axis=1)]), costs


class Rehearsals(NamedTuple):
    """What rehearsals of tours, S in a flight, tell about flights from m starts."""

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
    points that are left, and the camera aimed. Settings dispersed over cases are known.
    """
    samples, num_tours = rehearsal_samples(controller, mission), len(tour_images(controller))
    costs = np.empty((len(scenarios), len(samples), num_tours))
    followed = np.zeros((len(scenarios), len(samples)), dtype=np.int64)
    known, believed = as_believed(mission, scenarios)
    drawn, left = replace(mission, dispersions={}), None
    for place, sample in enumerate(samples):
        if sample > 0:
            believed, left = _at_sample(mission, controller, scenarios, followed[:, :place], workers, lanes)
            aimed = replace(mission.attitude, mode="ideal")
            known, drawn = replace(known, attitude=aimed), replace(drawn, attitude=aimed)
        ahead = _Ahead(controller, sample, place, left, workers, lanes)
        costs[:, place] = ahead.costs(known, drawn, believed)
        followed[:, place] = costs[:, place].argmin(axis=1)
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
        The starts, with the places and velocities that the deputies believe in by then.
    left : (m, P padded)
        1 for the points that are still to be inspected.
    """
    sample = rehearsal_samples(controller, mission)[followed.shape[1]]
    world, law = pack_world(mission)._replace(last=sample), law_of(controller, mission)
    known = np.empty((len(scenarios), 6 + world.num_points))
    groups = by_tours(followed)

    def fly(tours: Sequence[int], places: Integers) -> None:
        one, own = following(controller, mission, tours), np.empty((len(places), known.shape[1]))
        cases = cases_of(mission, [scenarios[place] for place in places])
        width = lanes_of_group(len(groups), len(places), lanes)
        fly_population(world, law, one.numbers, cases, 1, lanes=width, changes=one.changes, known=own)
        known[places] = own

    in_threads(fly, groups.keys(), groups.values(), workers=workers)
    left = np.zeros((len(scenarios), world.points.shape[2]), dtype=np.uint8)
    left[:, : world.num_points] = known[:, 6:]
    believed = [
        replace(start, position_m=row[:3], velocity_m_s=row[3:6])
        for start, row in zip(scenarios, known, strict=True)
    ]
    return believed, left


def by_tours(followed: Integers) -> dict[tuple[int, ...], Integers]:
    """Return the places of the flights, by the tours that they follow, given in rows."""
    found, which = np.unique(followed, axis=0, return_inverse=True)
    return {tuple(row): np.flatnonzero(which == place) for place, row in enumerate(found.tolist())}


@dataclass(frozen=True)
class _Ahead:
    """Flies tours ahead from a sample on."""

    controller: Controller
    sample: int
    place: int  # of this rehearsal among those of a flight
    left: Bytes | None  # points still to be inspected; None at the start
    workers: int | None
    lanes: int

    def costs(self, known: Mission, drawn: Mission, believed: list[Scenario]) -> Floats:
        """Return what each tour costs, m/s, shape (m, tours), as the deputies believe to begin.

        All are flown to the end, like first pushes, see `rehearsed_openings`. With ``rehearsal_draws`` costs
        are means: again and again, the tour that is cheapest so far is flown `NUM_DRAWN` times more, with
        errors drawn by the mission's settings, up to so many flights in all. So draws go to the tours that
        the choice is between, and none is followed because a single flight went well. A start's first draw is
        the same for all tours, as are its further ones.
        """
        num_draws = round(self.controller.constants[constant("rehearsal_draws")])
        price = DRAWN_POINT_M_S if num_draws else REHEARSED_POINT_M_S
        num_tours, every = len(tour_images(self.controller)), np.arange(len(believed))
        fly = self._flying(known, price)
        costs = np.column_stack([fly(tour, believed, every) for tour in range(num_tours)])
        if not num_draws:
            return costs
        fly, num_flown = self._flying(drawn, price), np.ones(costs.shape, dtype=np.int64)
        for begun in range(0, num_draws, NUM_DRAWN):
            count = min(NUM_DRAWN, num_draws - begun)
            best = costs.argmin(axis=1)
            for tour in np.unique(best).tolist():
                places = np.flatnonzero(best == tour)
                flown, each = num_flown[places, tour], np.repeat(places, count)
                draws = self.place * num_draws + flown[:, np.newaxis] + np.arange(count)
                starts = as_drawn(drawn, [believed[place] for place in each], draws.ravel().tolist())
                more = fly(tour, starts, each).reshape(-1, count).sum(axis=1)
                costs[places, tour] = (costs[places, tour] * flown + more) / (flown + count)
                num_flown[places, tour] += count
        return costs

    def _flying(self, mission: Mission, price: float) -> Callable[[int, list[Scenario], Integers], Floats]:
        """Return what flies a tour from starts at some places, and returns the costs, shape (m,)."""
        world, law = pack_world(mission)._replace(first=self.sample), law_of(self.controller, mission)
        images = tour_images(self.controller)

        def costs_of(tour: int, starts: list[Scenario], places: Integers) -> Floats:
            wanted = None if self.left is None else self.left[places]
            ends = fly_population(
                *(world, law, images[tour].numbers, cases_of(mission, starts), self.workers),
                lanes=self.lanes,
                wanted=wanted,
            )
            found: Floats = _rehearsed_costs(self.controller, ends, price)[0]
            return found

        return costs_of


def _rehearsed_costs(
    controller: Controller, ends: Outcomes, point_m_s: float = REHEARSED_POINT_M_S
) -> Floats:
    """Return the costs by which rehearsals are compared, m/s, of the shape of the outcomes."""
    # missed points that the controller accepts cost nothing
    least = max(1.0, controller.constants[constant("coast_below_points")])
    missed = np.maximum(0.0, ends.inspectable_count - ends.inspected_count - np.ceil(least) + 1.0)
    cost = ends.delta_v_m_s + point_m_s * missed + OUTSIDE_M_S * ends.is_violated
    return np.asarray(cost)
