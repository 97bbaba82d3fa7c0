"""What a fleet does depends neither on how many workers fly nor on which fleets fly beside it."""

from collections.abc import Sequence

import numpy as np

from pipeline.flight.control.controller import Controller
from pipeline.flight.fly.fleets_ahead import fly_all_fleets
from pipeline.flight.state.log import Scenario
from pipeline.settings.experiment import Mission


def assert_fleets_are_independent(
    mission: Mission, controller: Controller, scenarios: Sequence[Scenario]
) -> None:
    """Check that outcomes are equal to the last bit with two workers, and of the second fleet alone."""
    cases = list(scenarios)
    flown = fly_all_fleets(mission, controller, cases, 1)
    again = fly_all_fleets(mission, controller, cases, 2)
    alone = fly_all_fleets(mission, controller, cases[1:2], 1)
    for name, values in vars(flown).items():
        np.testing.assert_array_equal(getattr(again, name), values, err_msg=name)
        np.testing.assert_array_equal(getattr(alone, name), values[1:2], err_msg=name)
