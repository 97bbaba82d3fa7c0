"""How many digits of a constant matter, worked out by hand."""

import numpy as np

from fis_tools.analysis.flights import Outcome
from fis_tools.model import FuzzyController
from fis_tools.review.content import constants
from tests.fis_tools.sample_controllers import paper_like_controller


def went(**told: object) -> Outcome:
    """A flight of which nothing else is known."""
    nothing = dict.fromkeys(Outcome._fields[:6])
    return Outcome(
        **{**nothing, "num_periods": 0, "num_fired": 0, "num_asked": 0, "reasons": {}, "constants": {}}
        | {"asked": {}}
        | told
    )


def digits(flights: list[Outcome], **attributes: str) -> dict[str, str]:
    systems = paper_like_controller().systems
    controller = FuzzyController("c", systems, tuple(attributes.items()))
    return {one.name: one.digits for one in constants(controller, flights, {})}


def test_a_dead_band_needs_the_digits_that_tell_outputs_apart():
    """0.01234 lies between 0.0122 and 0.0124: 0.01 and 0.012 let the first pass, 0.0123 does not."""
    flight = went(asked={"force_x": np.array([0.0122, -0.0124, 0.5])})
    found = digits([flight], dead_band_force_x_n="0.01234")
    assert found == {"dead_band_force_x_n": "3 (0.0123) for the same 3 decisions"}


def test_constants_of_coasting_need_the_digits_that_tell_decisions_apart():
    """Limits of 15 and 200 m; 2.94 points: 3 lets a miss of 2.95 pass. 5.07 m: 5 lets 194.95 m pass."""
    foreseen = np.array([[2.95, 50.0, 100.0], [0.0, 20.02, 100.0], [0.0, 50.0, 194.95], [2.91, 50.0, 100.0]])
    flight = went(foreseen=foreseen, limits_m=(15.0, 200.0))
    found = digits([flight], coast_below_points="2.94", coast_margin_m="5.07", ring_size_m="14.2")
    assert found == {
        "coast_below_points": "3 (2.94) for the same 4 decisions",
        "coast_margin_m": "2 (5.1) for the same 4 decisions",
        "ring_size_m": "",
    }


def test_nothing_is_told_of_flights_that_do_not_say():
    flight = went(foreseen=np.array([[0.0, 50.0, 100.0]]))
    assert digits([flight], coast_below_points="2.94", coast_margin_m="5.07") == {
        "coast_below_points": "",
        "coast_margin_m": "",
    }
