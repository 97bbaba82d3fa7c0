"""A learned policy as a pilot: it has a learner's observations and decides at every control period.

Flights are stepped one period at a time (`pipeline.flight.fly.stepping`) to ask the policy for its forces.
These are then flown like any plan, which gives the same flights to the last digit; so the code that flies
other controllers does not depend on policies, nor does its compilation.
"""

import os
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np

from pipeline.array_types import Floats
from pipeline.flight.control.controller import ControllerError
from pipeline.flight.fly.simulation import is_interpreted
from pipeline.flight.fly.stepped import NUM_UNSEEN
from pipeline.flight.fly.stepping import Flights
from pipeline.flight.period.decide.network import Network, answer
from pipeline.flight.state.log import Scenario
from pipeline.settings.experiment import Mission

#: flights evaluated together
BLOCK = 128


@dataclass(frozen=True)
class Policy:
    """A network from observations to a force, see `pipeline.flight.control.controller.Pilot`."""

    # from the numbers of `pipeline.flight.fly.stepping.OBSERVED`, in their units, to a force, N, Hill axes
    network: Network
    source: bytes  # the file it was read from

    def __call__(self, mission: Mission, scenarios: list[Scenario], workers: int | None) -> Floats:
        """Return the forces of flights from some starts, shape (m, K, 3), N, Hill axes.

        Raises
        ------
        ControllerError
            If the mission cannot be stepped one period at a time.
        """
        if is_interpreted(mission):
            raise ControllerError(
                "a policy decides in flights that guidance.engine=sklearn cannot fly; choose "
                "guidance.engine=compiled"
            )
        forces = np.zeros((len(scenarios), mission.num_controls, 3))

        def decide(first: int) -> None:
            self._decide(mission, scenarios[first : first + BLOCK], forces[first : first + BLOCK])

        pool = ThreadPoolExecutor(workers or os.cpu_count() or 1)
        try:
            for _ in pool.map(decide, range(0, len(scenarios), BLOCK)):
                pass
        finally:
            pool.shutdown(cancel_futures=True)
        return forces

    def _decide(self, mission: Mission, scenarios: list[Scenario], forces: Floats) -> None:
        """Fly side by side, and fill in the forces decided on."""
        is_tilted = any(scenario.sun_elevation_rad != 0.0 for scenario in scenarios)
        flights = Flights(mission, len(scenarios), is_tilted=is_tilted)
        for flight, scenario in enumerate(scenarios):
            flights.start(flight, scenario)
        work, asked = np.zeros((2, self.network.widths.max())), np.zeros((len(scenarios), 3))
        flights.step(asked)
        for k in range(mission.num_controls):
            answer(self.network, flights.seen.astype(np.float64), work, asked)
            if mission.coast_when_complete:
                asked[flights.observed[:, NUM_UNSEEN] == 0.0] = 0.0
            forces[:, k] = asked
            flights.step(asked)
