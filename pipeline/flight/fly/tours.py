"""The tours that a controller may follow, closed paths around the chief, and which it follows when.

Motion about a circular orbit, light and shadow are unchanged when mirrored in the orbit plane, with the Sun.
They are also unchanged when time and the along-track axis are reversed: where a tour leads from one place to
the next, its image leads back, past places mirrored along the track, while the Sun moves as always. So a tour
has four images that show as much for as little, including itself, and which is nearest depends on the start.
Each may be followed in other times, sizes and shapes too.
"""

from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache
from itertools import product
from typing import NamedTuple

import numpy as np

from fis_tools.model import FuzzyController
from pipeline.flight.control.controller import Controller, RuleController, from_fuzzy
from pipeline.flight.control.law import ahead_stride
from pipeline.flight.state.signals import TOUR_COEFFICIENTS, constant
from pipeline.settings.experiment import Mission

#: names of the images, in the order in which they are tried
IMAGES = (
    "as it is",
    "mirrored through the orbit plane",
    "the other way round",
    "the other way round and mirrored through the orbit plane",
)


def sign(name: str, image: int) -> float:
    """Return the sign, 1 or -1, that a coefficient of the tour has in a mirror image of it.

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


def rehearsed_tours(controller: Controller) -> list[Tour]:
    """Return the tours that a controller rehearses, its own first; empty by default."""
    values = controller.constants
    tour_time, slowest = values[constant("tour_time_s")], values[constant("rehearsal_slowest_s")]
    smallest, num_images = values[constant("rehearsal_smallest")], round(values[constant("rehearsal_tours")])
    shapes = range(round(values[constant("rehearsal_shapes")]) + 1)
    times = np.geomspace(tour_time, slowest, NUM_TIMES) if slowest > 0.0 else [tour_time]
    sizes = [1.0, smallest] if smallest > 0.0 else [1.0]
    combinations = product(shapes, times, sizes, range(num_images))
    return [Tour(image, float(size), float(time), shape) for shape, time, size, image in combinations]


def tour_names(controller: Controller) -> list[str]:
    """Return the name of each tour that a controller rehearses."""
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
def tour_images(controller: Controller) -> tuple[RuleController, ...]:
    """Return a controller for each tour that a controller rehearses; none by default.

    Each follows its tour without rehearsing any. The first follows the controller's own.
    """
    fuzzy = controller.fuzzy
    return tuple(_following(fuzzy, tour) for tour in rehearsed_tours(controller) if fuzzy is not None)


def _following(fuzzy: FuzzyController, tour: Tour) -> RuleController:
    """Return a controller that follows a tour: the fuzzy one with the tour's coefficients and time."""
    attributes, offsets = dict(fuzzy.attributes), np.zeros(len(TOUR_COEFFICIENTS))
    if tour.shape > 0:
        drawn = np.random.default_rng(0).standard_normal((tour.shape, len(TOUR_COEFFICIENTS)))
        offsets = float(attributes.get("rehearsal_spread_m", 0.0)) * drawn[-1]
    for name, shift in zip(TOUR_COEFFICIENTS, offsets.tolist(), strict=True):
        coefficient = float(attributes.get(name, 0.0)) + shift
        attributes[name] = repr(sign(name, tour.image) * tour.size * coefficient)
    attributes["tour_time_s"] = repr(tour.time_s)
    attributes.pop("rehearsal_tours", None)  # it rehearses none itself
    return from_fuzzy(replace(fuzzy, attributes=tuple(attributes.items())))


def following(controller: Controller, mission: Mission, tours: Sequence[int]) -> RuleController:
    """Return a controller for the tours that a controller follows, from each of its rehearsals on."""
    images, samples = tour_images(controller), rehearsal_samples(controller, mission)
    first, *others = (images[tour] for tour in tours)
    return replace(first, later=tuple(zip(samples[1:], others, strict=False))) if others else first


def rehearsal_samples(controller: Controller, mission: Mission) -> list[int]:
    """Return the samples at which a controller rehearses its tours, from 0."""
    stride = ahead_stride(controller, mission, "rehearsal_period_s")
    return list(range(0, mission.num_controls, stride)) if stride else [0]
