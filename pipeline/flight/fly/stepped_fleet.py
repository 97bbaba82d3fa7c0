"""A fleet stepped by external forces, one control period at a time, whose deputies tell what they see."""

from typing import Any, ClassVar

import numpy as np

from fis_tools.compiled.decorator import compiled
from fis_tools.compiled.three import load_three, three_of, write_lane
from fis_tools.compiled.vectors import borrowed, width_of
from fis_tools.engines.kernel import FEW_LANES
from pipeline.array_types import Booleans, Bytes, Floats, Integers
from pipeline.flight.fly.fleets import make_exchange
from pipeline.flight.fly.many import note_after, start_lanes
from pipeline.flight.fly.stepping import NOT_STARTED, RESTING, SteppedFlights, state_of, write_observed
from pipeline.flight.fly.workspace import make_states
from pipeline.flight.period.decide.exchange import Exchange, begin, choose_lane_target, heed, pool
from pipeline.flight.period.decide.thrust import command_given
from pipeline.flight.period.steps import act, look
from pipeline.flight.state.arrays import FlightState, FullOptics, Moment, Plans, Workspace, World
from pipeline.flight.state.errors import ModelErrors
from pipeline.settings.fleet import Fleet


@compiled(nogil=True, error_model="numpy")
def step_fleet(
    world: World,
    optics: FullOptics | None,
    clusters: bool | None,
    errors: ModelErrors | None,
    plans: Plans,
    cases: Any,
    counted: Bytes,
    exchange: Exchange,
    states: FlightState,
    work: Workspace,
    samples: Integers,
    forces: Floats,
    observed: Floats,
) -> None:
    """Fly a fleet by a control period, or start it; see `pipeline.flight.fly.stepping.step_many`.

    The D deputies, the first lanes of the one state in `states`, are at the same sample.
    """
    world, plans, cases, counted, states, work = borrowed((world, plans, cases, counted, states, work))
    state, deputies, k = state_of(states, 0), exchange.deputies, samples[0]
    if k == RESTING:
        return
    now = Moment(world, state, 0, deputies, k)
    if k == NOT_STARTED:
        start_lanes(now, cases, counted)
        begin(now, exchange)
    else:
        for lane in range(width_of(state.lanes)):  # those without a deputy repeat the last, as at the start
            write_lane(state.lanes.requested, 0, lane, three_of(forces[min(lane, deputies - 1)]))
        command_given(now, load_three(state.lanes.requested, 0))
        act(now, work, errors, plans)
    after = Moment(world, state, 0, deputies, k + 1)
    heed(after, exchange)
    look(after, work, optics, None, errors, plans)
    pool(after, exchange)
    for lane in range(deputies):
        choose_lane_target(after, work, optics, clusters, lane)
    if k + 1 == world.num_controls:
        note_after(after)
    for lane in range(deputies):
        write_observed(after, lane, observed[lane])
    samples[:] = k + 1


class SteppedFleet(SteppedFlights):
    """The deputies of one fleet, side by side; see `SteppedFlights`.

    All are started together, at most six, and step together. In each control period they exchange which
    points they have seen, and what one has seen no other looks for.
    """

    stepper: ClassVar[Any] = step_fleet

    def _allocated(self) -> tuple[Any, ...]:
        """Return the state of the fleet, and what its deputies exchange."""
        fleet = Fleet(deputies=len(self.samples), sharing="mask")
        self._exchange = make_exchange(self._world, fleet, FEW_LANES)
        return make_states(self._world, self._errors, FEW_LANES, 1), self._exchange

    @property
    def positions(self) -> Floats:
        """The true positions now, shape (n, 3), m, Hill axes."""
        return self._states.truth["position"][0, :, : len(self.samples)].T.copy()

    @property
    def is_inspected(self) -> Booleans:
        """Which points any deputy has inspected, the same for each, shape (n, P)."""
        is_seen = self._exchange.seen_by[0, : self._world.num_points] >= 0
        return np.tile(is_seen, (len(self.samples), 1))

    @property
    def seen_first(self) -> Integers:
        """The points that each deputy saw before the others, at one sample the first of them, shape (n,)."""
        return np.array([(self._exchange.seen_by[0] == deputy).sum() for deputy in range(len(self.samples))])

    def _arrays(self) -> list[Any]:
        """Return the arrays that change as the fleet is started and stepped."""
        exchanged = (*self._exchange, *self._exchange.link)
        return [*super()._arrays(), *(part for part in exchanged if isinstance(part, np.ndarray))]
