"""A learned policy that turns the deputy itself: it gives forces along body axes, and torques about them.

What it observes is that of `pipeline.gym.six_dof.SixDofInspectionEnv`, or of AFRL's agents there. Each flight
is stepped alone, one period at a time; its forces and torques are then flown like any plan.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.array_types import Floats
from pipeline.controllers.layers import NUM_TURNING
from pipeline.controllers.learned import NEWTONS, Network, Units, answer
from pipeline.flight.control.controller import ControllerError
from pipeline.flight.control.law import played
from pipeline.flight.fly.published import NUM_OF_TURNING, PublishedView, num_published
from pipeline.flight.fly.six_dof import MOST_RATE, SixDofView, TurnedFlight
from pipeline.flight.fly.stepping import NUM_UNSEEN, periods_between
from pipeline.flight.state.arrays import AIMED, Plans
from pipeline.flight.state.log import Scenario
from pipeline.scenarios import CLUSTERS, PRIORITY, direction_of
from pipeline.settings.experiment import Mission


@dataclass(frozen=True)
class TurningPolicy:
    """A network from observations to forces and torques, see `pipeline.flight.control.controller.Pilot`."""

    network: Network
    source: bytes  # the file it was read from
    units: Units = NEWTONS
    turns: bool = True
    #: the direction of the priority
    draws: bool = True

    def __call__(self, mission: Mission, scenarios: list[Scenario], workers: int | None) -> Plans:
        """Return the plans of the flight from one start.

        Raises
        ------
        ControllerError
            If the mission's deputy is not one that such a policy turns.
        """
        (scenario,) = scenarios
        self._check(mission, scenario)
        flight, observe = TurnedFlight(mission, scenario), self._observer(mission, scenario)
        try:
            num_periods = periods_between(mission, self.units.decision_period_s)
        except ValueError as error:
            raise ControllerError(f"the policy's {error}") from error
        work, outputs = np.zeros((2, self.network.widths.max())), np.zeros((1, NUM_TURNING))
        forces = np.zeros((1, mission.num_controls, 3))
        for k in range(mission.num_controls):
            force, torque = np.zeros((2, 3))
            if k % num_periods == 0:
                answer(self.network, observe(flight)[np.newaxis].astype(np.float64), work, outputs)
                force, torque = self._commands(mission, outputs[0])
            if mission.coast_when_complete and flight.observed[0, NUM_UNSEEN] == 0.0:
                force = np.zeros(3)
            forces[0, k] = flight.turn(force, torque)
        return played(forces, AIMED._replace(torques=flight.torques))

    def together(self, mission: Mission, fleets: Sequence[Sequence[Scenario]], workers: int | None) -> Floats:
        """Refuse it: a fleet's deputies are turned by a law.

        Raises
        ------
        ControllerError
        """
        raise ControllerError("the policy turns one deputy, itself; leave fleet.deputies out")

    def _check(self, mission: Mission, scenario: Scenario) -> None:
        """Raise ControllerError unless a mission's deputy can be turned as in the environment."""
        if mission.attitude.mode != "flown":
            raise ControllerError(
                f"the policy turns the deputy, and attitude.mode is {mission.attitude.mode}, in which "
                "nothing does; choose world=afrl_six_dof or attitude=flown"
            )
        if mission.navigation.mode != "perfect":
            raise ControllerError(
                "the policy observes attitude and rate as they are; choose navigation=perfect"
            )
        if scenario.sun_elevation_rad != 0.0:
            raise ControllerError(
                "the policy observes no Sun out of the orbit plane; leave its elevation out"
            )
        if mission.deputy.max_momentum_n_m_s is None:
            most = MOST_RATE * float(np.abs(np.diag(mission.deputy.inertia_kg_m2)).max())
            raise ControllerError(
                "the policy learned where the deputy turns by at most 2 degrees a second, about each axis, "
                f"which here wheels limit; give deputy.max_momentum_n_m_s={most:.4g}"
            )
        given = num_published(mission) + NUM_OF_TURNING
        if self.units.observations_are_published and given != self.network.widths[0]:
            raise ControllerError(
                f"the policy takes {self.network.widths[0]} of AFRL's numbers; in this world, by "
                f"chief.weights={mission.chief.weights}, there are {given}"
            )

    def _observer(self, mission: Mission, scenario: Scenario) -> Callable[[TurnedFlight], Floats]:
        """Return a function that returns what the network is given now, (widths[0],)."""
        view: SixDofView | PublishedView = SixDofView(mission)
        if self.units.observations_are_published:
            view = PublishedView(mission, scenario.generator(CLUSTERS))
        priority, sun = direction_of(scenario.generator(PRIORITY)), scenario.sun_angle_rad

        def observe(flight: TurnedFlight) -> Floats:
            return view.seen(int(flight.samples[0]), flight.state, sun, flight.is_inspected[0], priority)

        return observe

    def _commands(self, mission: Mission, outputs: Floats) -> tuple[Floats, Floats]:
        """Return the force, N, and the torque, N m, of a network's outputs, (6,); body axes."""
        most = np.repeat((mission.deputy.max_force_n, mission.deputy.max_torque_n_m), 3)
        if self.units.forces_are_shares:
            outputs = outputs * most
        given = np.clip(outputs, -most, most)
        return given[:3], given[3:]
