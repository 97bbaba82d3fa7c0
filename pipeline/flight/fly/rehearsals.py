"""Rehearsals: flights that a controller simulates to the end from each start before choosing how to begin.

A controller may rehearse the images of its tour, closed paths around the chief that show as much for as
little as the tour itself. Motion about a circular orbit, light and shadow are unchanged when mirrored in
the orbit plane, with the Sun. They are also unchanged when time and the along-track axis are reversed:
where a tour leads from one place to the next, its image leads back, past places mirrored along the track,
while the Sun moves as always. So a tour has four images, including itself, and which is nearest depends on
the start.
"""

from dataclasses import replace
from functools import lru_cache

import numpy as np

from fis_tools.engines.kernel import LANES
from fis_tools.model import FuzzyController
from pipeline.array_types import Floats
from pipeline.flight.cases.navigation import as_believed
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


@lru_cache(maxsize=8)
def tour_images(controller: Controller) -> tuple[Controller, ...]:
    """Return a controller for each image of the tour that a controller rehearses; none by default.

    Each follows its image without rehearsing tours. The first follows the tour itself.
    """
    values = controller.constants
    images = range(round(values[constant("rehearsal_tours")]))
    return tuple(_following(controller.fuzzy, image) for image in images if controller.fuzzy is not None)


def _following(fuzzy: FuzzyController, image: int) -> Controller:
    attributes = dict(fuzzy.attributes)
    del attributes["rehearsal_tours"]
    for name in attributes.keys() & TOUR_PLACES.keys():
        attributes[name] = repr(sign(name, image) * float(attributes[name]))
    return from_fuzzy(replace(fuzzy, attributes=tuple(attributes.items())))


#: rehearsal costs of a point missed, and of leaving the limits, more than any flight can spend
REHEARSED_POINT_M_S, OUTSIDE_M_S = 0.15, 1e4


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
    """Return what each image of a controller's tour costs from each start, m/s, shape (m, images).

    All are flown to the end, like first pushes, see `rehearsed_openings`; the cheapest is followed.
    """
    known, starts = as_believed(mission, scenarios)
    world, cases, law = pack_world(known), cases_of(known, starts), law_of(controller, known)
    flown = [
        fly_population(world, law, image.numbers, cases, workers, lanes=lanes)
        for image in tour_images(controller)
    ]
    return np.column_stack([_rehearsed_costs(controller, ends)[0] for ends in flown])


def _rehearsed_costs(controller: Controller, ends: Outcomes) -> Floats:
    """Return the costs by which rehearsals are compared, m/s, of the shape of the outcomes."""
    # missed points that the controller accepts cost nothing
    least = max(1.0, controller.constants[constant("coast_below_points")])
    missed = np.maximum(0.0, ends.inspectable_count - ends.inspected_count - np.ceil(least) + 1.0)
    cost = ends.delta_v_m_s + REHEARSED_POINT_M_S * missed + OUTSIDE_M_S * ends.is_violated
    return np.asarray(cost)
