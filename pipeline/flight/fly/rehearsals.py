"""Rehearsals: flights that a controller simulates to the end from each start before choosing how to begin.

A controller may rehearse the images of its tour, closed paths around the chief that show as much for as
little as the tour itself. Motion about a circular orbit, light and shadow are unchanged when mirrored in
the orbit plane, with the Sun. They are also unchanged when time and the along-track axis are reversed:
where a tour leads from one place to the next, its image leads back, past places mirrored along the track,
while the Sun moves as always. So a tour has four images, including itself, and which is nearest depends on
the start.
"""

from collections.abc import Callable
from dataclasses import replace
from functools import lru_cache
from itertools import product
from typing import NamedTuple

import numpy as np

from fis_tools.engines.kernel import LANES
from fis_tools.model import FuzzyController
from pipeline.array_types import Floats
from pipeline.flight.cases.navigation import as_believed, as_drawn
from pipeline.flight.cases.starts import cases_of
from pipeline.flight.control.controller import Controller, from_fuzzy, law_of, rehearsed_pushes
from pipeline.flight.fly.population import fly_population
from pipeline.flight.state.log import Outcomes, Scenario
from pipeline.flight.state.signals import TOUR_PLACES, constant
from pipeline.flight.world.pack import pack_world
from pipeline.settings.experiment import Mission

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


#: times and sizes in which each image is flown ahead, if the controller says how slow and how small
NUM_TIMES, NUM_SIZES = 4, 3


def rehearsed_tours(controller: Controller) -> list[Tour]:
    """Return the tours that a controller rehearses, first its own; none by default."""
    values = controller.constants
    own, slowest = values[constant("tour_time_s")], values[constant("rehearsal_slowest_s")]
    smallest, num_images = values[constant("rehearsal_smallest")], round(values[constant("rehearsal_tours")])
    times = np.geomspace(own, slowest, NUM_TIMES) if slowest > 0.0 else [own]
    sizes = np.linspace(1.0, smallest, NUM_SIZES) if smallest > 0.0 else [1.0]
    found = product(times, sizes, range(num_images))
    return [Tour(image, float(size), float(time)) for time, size, image in found]


def tour_names(controller: Controller) -> list[str]:
    """Return what each tour that a controller rehearses is called."""
    tours = rehearsed_tours(controller)
    with_time, with_size = (len({tour[part] for tour in tours}) > 1 for part in (2, 1))
    return [
        IMAGES[tour.image]
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
    attributes = {name: value for name, value in fuzzy.attributes if name not in REHEARSING_TOURS}
    for name in attributes.keys() & TOUR_PLACES.keys():
        attributes[name] = repr(sign(name, tour.image) * tour.size * float(attributes[name]))
    attributes["tour_time_s"] = repr(tour.time_s)
    return from_fuzzy(replace(fuzzy, attributes=tuple(attributes.items())))


#: rehearsal costs of a point missed, and of leaving the limits, more than any flight can spend
REHEARSED_POINT_M_S, OUTSIDE_M_S = 0.15, 1e4
#: the first where errors are drawn: high, so that the choice is by the share of flights that succeed
DRAWN_POINT_M_S = 1.0
#: constants that say which tours are flown ahead, and how often
REHEARSING_TOURS = ("rehearsal_tours", "rehearsal_slowest_s", "rehearsal_smallest", "rehearsal_draws")


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


def tour_costs(
    mission: Mission,
    controller: Controller,
    scenarios: list[Scenario],
    workers: int | None,
    lanes: int = LANES,
) -> Floats:
    """Return what each tour that a controller rehearses costs from each start, m/s, shape (m, tours).

    All are flown to the end, like first pushes, see `rehearsed_openings`; the cheapest is followed. With
    ``rehearsal_draws`` costs are means: as often as it says, the tour that is cheapest so far is flown once
    more, with errors drawn by the mission's settings. So draws go to the tours that the choice is between,
    and none is followed because a single flight went well. A start's first draw is the same for all tours, as
    are its further ones. Settings dispersed over cases are known, as in rehearsals without draws.
    """
    num_draws = round(controller.constants[constant("rehearsal_draws")])
    price = DRAWN_POINT_M_S if num_draws else REHEARSED_POINT_M_S
    tours = tour_images(controller)

    def flying(own: Mission) -> Callable[[int, list[Scenario]], Floats]:
        world, law = pack_world(own), law_of(controller, own)

        def costs_of(tour: int, starts: list[Scenario]) -> Floats:
            cases = cases_of(own, starts)
            ends = fly_population(world, law, tours[tour].numbers, cases, workers, lanes=lanes)
            found: Floats = _rehearsed_costs(controller, ends, price)[0]
            return found

        return costs_of

    known, believed = as_believed(mission, scenarios)
    fly_as_known, drawn = flying(known), replace(mission, dispersions={})
    costs = np.column_stack([fly_as_known(tour, believed) for tour in range(len(tours))])
    if not num_draws:
        return costs
    fly_as_drawn, num_flown = flying(drawn), np.ones(costs.shape, dtype=np.int64)
    for _ in range(num_draws):
        best = costs.argmin(axis=1)
        for tour in np.unique(best).tolist():
            places = np.flatnonzero(best == tour)
            flown = num_flown[places, tour]
            starts = as_drawn(drawn, [believed[place] for place in places], flown.tolist())
            costs[places, tour] += (fly_as_drawn(tour, starts) - costs[places, tour]) / (flown + 1)
            num_flown[places, tour] += 1
    return costs


def _rehearsed_costs(
    controller: Controller, ends: Outcomes, point_m_s: float = REHEARSED_POINT_M_S
) -> Floats:
    """Return the costs by which rehearsals are compared, m/s, of the shape of the outcomes."""
    # missed points that the controller accepts cost nothing
    least = max(1.0, controller.constants[constant("coast_below_points")])
    missed = np.maximum(0.0, ends.inspectable_count - ends.inspected_count - np.ceil(least) + 1.0)
    cost = ends.delta_v_m_s + point_m_s * missed + OUTSIDE_M_S * ends.is_violated
    return np.asarray(cost)
