"""The images of a tour: closed paths around the chief that show as much for as little as the tour itself.

Motion about a circular orbit, light and shadow are unchanged when mirrored in the orbit plane, with the Sun.
They are also unchanged when time and the along-track axis are reversed: where a tour leads from one place to
the next, its image leads back, past places mirrored along the track, while the Sun moves as always. So
a tour has four images, including itself, and which is nearest depends on the start.
"""

from dataclasses import replace
from functools import lru_cache

from fis_tools.model import FuzzyController
from pipeline.flight.control.controller import Controller, from_fuzzy
from pipeline.flight.state.signals import TOUR_PLACES, constant

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
