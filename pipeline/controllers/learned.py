"""A learned policy as a pilot: it has a learner's observations and decides each control period, or each few.

Flights are stepped one period at a time (`pipeline.flight.fly.stepping`) to ask the policy for its forces.
These are then flown like any plan, which gives the same flights to the last digit; so the code that flies
other controllers does not depend on policies, nor does its compilation.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import erfc, exp, expm1, log1p, pi, sqrt, tanh
from typing import NamedTuple

import numpy as np

from fis_tools.compiled.decorator import compiled
from pipeline.array_types import Floats, Integers
from pipeline.flight.control.controller import ControllerError
from pipeline.flight.control.law import played
from pipeline.flight.fly.plain import is_interpreted
from pipeline.flight.fly.published import PublishedView, num_published
from pipeline.flight.fly.stepped_fleet import SteppedFleet
from pipeline.flight.fly.stepping import (
    NUM_UNSEEN,
    VELOCITY,
    SteppedFlights,
    observation_scales,
    periods_between,
)
from pipeline.flight.state.arrays import Plans
from pipeline.flight.state.log import Scenario
from pipeline.scenarios import CLUSTERS, PRIORITY, direction_of
from pipeline.settings.experiment import Mission
from pipeline.threads import in_threads

#: activation of a layer: none, hyperbolic tangent, clipping to `low` and `high`, exponential linear unit and
#: leaky rectifier with the factor `low` below zero, logistic function, softplus up to `high`, a number times
#: its logistic function, a number times its normal probability, the same by a hyperbolic tangent near it, and
#: all numbers of a layer less their mean, over the root of their variance plus `low`
LINEAR, TANH, CLIPPED, ELU, LEAKY, SIGMOID, SOFTPLUS, SILU, GELU, GELU_TANH, NORMED = range(11)
#: of the approximation of GELU by a hyperbolic tangent (Hendrycks and Gimpel, arXiv 1606.08415)
CUBIC, SLOPE = 0.044715, sqrt(2.0 / pi)


class Network(NamedTuple):
    """Layers, one after the other."""

    widths: Integers  # (L+1,) inputs of each layer, and outputs of the last
    numbers: Floats  # (n,) for each layer the weights, a row per input, followed by the biases
    kinds: Integers  # (L,) `LINEAR`, `TANH` and so on
    low: Floats  # (L,) parameters of these, see there
    high: Floats


class Units(NamedTuple):
    """The units of a network's inputs and outputs, and when it decides."""

    #: outputs are shares of ``deputy.max_force_n``, clipped to -1 ... 1; else N
    forces_are_shares: bool = False
    #: inputs are divided by `pipeline.flight.fly.stepping.observation_scales`; else in their own units
    observations_are_normalized: bool = False
    #: inputs are those of AFRL's agents, see `pipeline.flight.fly.published`
    observations_are_published: bool = False
    #: outputs say for each axis how good -levels_n, 0 and levels_n are, N; the best is fired
    levels_n: float | None = None
    #: time between decisions, s: what is decided is fired in the first control period, nothing in the others
    decision_period_s: float | None = None


#: those of files that say nothing else
NEWTONS = Units()


@compiled(error_model="numpy", forceinline=True)
def activation(kind: int, x: float, low: float, high: float) -> float:
    """Return a number after the activation function of a kind of layer."""
    y = x
    if kind == TANH:
        y = tanh(x)
    elif kind == CLIPPED:
        y = min(max(x, low), high)
    elif kind == ELU:
        y = x if x > 0.0 else low * expm1(x)
    elif kind == LEAKY:
        y = x if x > 0.0 else low * x
    elif kind == SIGMOID:
        y = 1.0 / (1.0 + exp(-x)) if x >= 0.0 else exp(x) / (1.0 + exp(x))
    elif kind == SOFTPLUS and x <= high:
        y = max(x, 0.0) + log1p(exp(-abs(x)))
    elif kind == SILU:
        y = x / (1.0 + exp(-x)) if x >= 0.0 else x * exp(x) / (1.0 + exp(x))
    elif kind == GELU:
        y = 0.5 * x * erfc(-x * sqrt(0.5))
    elif kind == GELU_TANH:
        y = 0.5 * x * (1.0 + tanh(SLOPE * (x + CUBIC * x * x * x)))
    return y


@compiled(error_model="numpy")
def normalise(values: Floats, count: int, added: float) -> None:
    """Subtract the mean of the first numbers, and divide by the root of their variance plus something."""
    mean = 0.0
    for j in range(count):
        mean += values[j]
    mean /= count
    variance = 0.0
    for j in range(count):
        variance += (values[j] - mean) * (values[j] - mean)
    deviation = sqrt(variance / count + added)
    for j in range(count):
        values[j] = (values[j] - mean) / deviation


@compiled(nogil=True, error_model="numpy")
def answer(network: Network, seen: Floats, work: Floats, outputs: Floats) -> None:
    """Write the network's outputs, (m, widths[-1]), for the observations of m flights, (m, widths[0]).

    `work`, (2, w) for the widest layer, may have any content.
    """
    widths, numbers = network.widths, network.numbers
    for row in range(len(seen)):
        now, after, first = 0, 1, 0
        for column in range(widths[0]):
            work[now, column] = seen[row, column]
        for layer in range(len(network.kinds)):
            num_in, num_out = widths[layer], widths[layer + 1]
            added = first + num_in * num_out
            for j in range(num_out):
                work[after, j] = numbers[added + j]
            for i in range(num_in):
                value, weights = work[now, i], first + i * num_out
                for j in range(num_out):
                    work[after, j] += numbers[weights + j] * value
            kind, low, high = network.kinds[layer], network.low[layer], network.high[layer]
            if kind == NORMED:
                normalise(work[after], num_out, low)
            elif kind != LINEAR:
                for j in range(num_out):
                    work[after, j] = activation(kind, work[after, j], low, high)
            now, after, first = after, now, added + num_out
        for column in range(widths[-1]):
            outputs[row, column] = work[now, column]


def _check_stepped(mission: Mission) -> None:
    """Raise ControllerError if a mission cannot be stepped one period at a time."""
    if is_interpreted(mission):
        raise ControllerError(
            "a policy decides in flights that guidance.engine=sklearn cannot fly; choose "
            "guidance.engine=compiled"
        )


#: flights evaluated together
BLOCK = 128


@dataclass(frozen=True)
class Policy:
    """A network from observations to a force, see `pipeline.flight.control.controller.Pilot`."""

    # from the numbers of `pipeline.flight.fly.stepping.OBSERVED`, or AFRL's, to a force, Hill axes
    network: Network
    source: bytes  # the file it was read from
    units: Units = NEWTONS
    turns: bool = False

    @property
    def draws(self) -> bool:
        """Whether what it observes is drawn: AFRL's clusters, and the direction of a priority."""
        return self.units.observations_are_published

    def __call__(self, mission: Mission, scenarios: list[Scenario], workers: int | None) -> Plans:
        """Return the plans of flights from some starts.

        Raises
        ------
        ControllerError
            If the mission cannot be stepped one period at a time.
        """
        _check_stepped(mission)
        forces = np.zeros((len(scenarios), mission.num_controls, 3))

        def decide(first: int) -> None:
            self._decide(mission, scenarios[first : first + BLOCK], forces[first : first + BLOCK])

        in_threads(decide, range(0, len(scenarios), BLOCK), workers=workers)
        return played(forces)

    def together(self, mission: Mission, fleets: Sequence[Sequence[Scenario]], workers: int | None) -> Floats:
        """Return the forces of the deputies of fleets, (m, D, K, 3); each deputy asks the policy for its own.

        Raises
        ------
        ControllerError
            As for one deputy, and if the policy has AFRL's observations, which are of one.
        """
        _check_stepped(mission)
        if self.units.observations_are_published:
            raise ControllerError("the policy observes as AFRL's agents, alone; leave fleet.deputies out")
        forces = np.zeros((len(fleets), len(fleets[0]), mission.num_controls, 3))

        def decide(case: int) -> None:
            self._decide(mission, list(fleets[case]), forces[case], SteppedFleet)

        in_threads(decide, range(len(fleets)), workers=workers)
        return forces

    def _periods_between(self, mission: Mission) -> int:
        try:
            return periods_between(mission, self.units.decision_period_s)
        except ValueError as error:
            raise ControllerError(f"the policy's {error}") from error

    def _check_published(self, mission: Mission, *, is_tilted: bool) -> None:
        """Raise ControllerError unless AFRL's agents would observe as many numbers in a mission."""
        if is_tilted:
            raise ControllerError(
                "AFRL's agents observe no Sun out of the orbit plane; leave its elevation out"
            )
        if (given := num_published(mission)) != self.network.widths[0]:
            raise ControllerError(
                f"the policy takes {self.network.widths[0]} of AFRL's numbers; in this world, by "
                f"chief.weights={mission.chief.weights}, there are {given}"
            )

    def _observer(
        self, mission: Mission, scenarios: list[Scenario], flights: SteppedFlights
    ) -> Callable[[], Floats]:
        """Return a function that returns what the network is given now, (n, widths[0])."""
        if not self.units.observations_are_published:
            scales = observation_scales(mission).astype(np.float32)
            divided = scales if self.units.observations_are_normalized else np.ones_like(scales)
            return lambda: (flights.seen / divided).astype(np.float64)
        views = [PublishedView(mission, scenario.generator(CLUSTERS)) for scenario in scenarios]
        priorities = [direction_of(scenario.generator(PRIORITY)) for scenario in scenarios]

        def observe() -> Floats:
            states, is_inspected = flights.observed[:, : VELOCITY + 3], flights.is_inspected
            return np.array(
                [
                    view.seen(
                        flights.samples[flight],
                        states[flight],
                        scenarios[flight].sun_angle_rad,
                        is_inspected[flight],
                        priorities[flight],
                    )
                    for flight, view in enumerate(views)
                ]
            )

        return observe

    def _forces(self, mission: Mission, outputs: Floats) -> Floats:
        """Return the forces of a network's outputs, (n, 3), N."""
        if self.units.levels_n is not None:
            levels = outputs.reshape(len(outputs), 3, -1).argmax(axis=2) - 1.0
            return np.asarray(levels * self.units.levels_n)
        if self.units.forces_are_shares:
            return np.asarray(np.clip(outputs, -1.0, 1.0) * mission.deputy.max_force_n)
        return outputs.copy()

    def _decide(
        self,
        mission: Mission,
        scenarios: list[Scenario],
        forces: Floats,
        stepped: type[SteppedFlights] = SteppedFlights,
    ) -> None:
        """Fly all starts side by side, or as one fleet, and write the forces of each control period."""
        is_tilted = any(scenario.sun_elevation_rad != 0.0 for scenario in scenarios)
        if self.units.observations_are_published:
            self._check_published(mission, is_tilted=is_tilted)
        flights = stepped(mission, len(scenarios), is_tilted=is_tilted)
        for flight, scenario in enumerate(scenarios):
            flights.start(flight, scenario)
        observe = self._observer(mission, scenarios, flights)
        num_periods = self._periods_between(mission)
        work, commanded = np.zeros((2, self.network.widths.max())), np.zeros((len(scenarios), 3))
        outputs = np.zeros((len(scenarios), self.network.widths[-1]))
        flights.step(commanded)
        for k in range(mission.num_controls):
            commanded = np.zeros((len(scenarios), 3))
            if k % num_periods == 0:
                answer(self.network, observe(), work, outputs)
                commanded = self._forces(mission, outputs)
            if mission.coast_when_complete:
                commanded[flights.observed[:, NUM_UNSEEN] == 0.0] = 0.0
            forces[:, k] = commanded
            flights.step(commanded)
