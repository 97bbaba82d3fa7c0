"""Flights stepped one control period at a time under external forces, compiled.

Every flight has the vectors to itself, in lane 0, since each is at its own sample.
"""

from typing import Any

from fis_tools.compiled.decorator import compiled
from fis_tools.compiled.three import Three, lane_of
from fis_tools.compiled.vectors import borrowed, splat, width_of
from pipeline.array_types import Bytes, Floats, Integers
from pipeline.flight.fly.many import start_lanes
from pipeline.flight.period.decide.thrust import command_given
from pipeline.flight.period.steps import act, look
from pipeline.flight.state.arrays import Beyond, Guard, Moment, Plans, State, Workspace, World
from pipeline.flight.state.errors import ModelErrors

#: columns of an observation: vectors in Hill axes
POSITION, VELOCITY, TARGET, SUN, BORESIGHT = 0, 3, 6, 9, 12
NUM_INSPECTED, NUM_CANDIDATES, SPENT, LEFT = 15, 16, 17, 18
#: known to the truth only: points that count and are not inspected, how far outside, and the safety layer's
NUM_UNSEEN, OUTSIDE, NUM_ACTED, CORRECTED, NUM_OBSERVED = 19, 20, 21, 22, 23
#: the sample of a flight that is about to start
NOT_STARTED = -1


# This is inlined: a compiled function cannot return a tuple with a record in it.
@compiled(error_model="numpy", inline="always")
def state_of(states: State, flight: int) -> State:
    """Return the state of one flight, from arrays with a row each."""
    return State(
        states.truth[flight],
        states.belief[flight],
        states.lanes[flight],
        states.unseen[flight],
        states.centres[flight],
        states.num_centres[flight],
        states.clustered[flight],
        states.estimate[flight],
        states.thrusters[flight],
        states.fixes[flight],
        states.commands[flight],
        states.acting[flight],
        states.thrust[flight],
    )


@compiled(error_model="numpy", forceinline=True)
def write_three_at(row: Floats, first: int, a: Three) -> None:
    """Write a vector of floats into a row, from an index on."""
    row[first], row[first + 1], row[first + 2] = a.x, a.y, a.z


@compiled(error_model="numpy", forceinline=True)
def write_observed(now: Moment, row: Floats) -> None:
    """Write the observation of a flight."""
    lanes, belief = now.state.lanes, now.state.belief
    flat = lanes.sun_height[0, 0]
    write_three_at(row, POSITION, lane_of(belief.position, 0, 0))
    write_three_at(row, VELOCITY, lane_of(belief.velocity, 0, 0))
    write_three_at(row, TARGET, lane_of(lanes.target, 0, 0))
    write_three_at(row, BORESIGHT, lane_of(belief.boresight, 0, 0))
    write_three_at(row, SUN, Three(flat * lanes.sun[0, 0], flat * lanes.sun[1, 0], lanes.sun_height[1, 0]))
    row[NUM_INSPECTED] = lanes.num_counted[0] - lanes.num_unseen[0]
    row[NUM_CANDIDATES] = lanes.num_candidates[0]
    row[SPENT] = lanes.spent[0]
    row[LEFT] = (now.world.num_controls - now.k) * now.world.control_period
    row[NUM_UNSEEN] = lanes.num_unseen[0]
    row[OUTSIDE] = lanes.beyond[0]
    row[NUM_ACTED] = lanes.num_acted[0]
    row[CORRECTED] = lanes.corrected[0]


@compiled(nogil=True, error_model="numpy")
def step_many(
    world: World,
    optics: Beyond | None,
    guard: Guard | None,
    clusters: bool | None,
    errors: ModelErrors | None,
    plans: Plans,
    cases: Any,
    counted: Bytes,
    states: State,
    work: Workspace,
    samples: Integers,
    forces: Floats,
    observed: Floats,
) -> None:
    """Fly every flight by a control period, or start it; see `pipeline.flight.period.steps`.

    Each of n flights has a start, of `CASE`, a row of `counted`, 1 for the points that it is about, of
    `states`, and of `forces`, N, Hill axes. Its sample, `NOT_STARTED` for a flight to be started, is
    incremented, and its row of `observed`, (n, NUM_OBSERVED), filled. There are no plans.
    """
    world, plans, cases, counted, states, work = borrowed((world, plans, cases, counted, states, work))
    for flight in range(len(samples)):
        own, k = state_of(states, flight), samples[flight]
        now = Moment(world, own, work, flight, 1, k)
        if k == NOT_STARTED:
            start_lanes(now, cases, counted)
        else:
            width, force = width_of(own.lanes), forces[flight]
            command_given(now, Three(splat(force[0], width), splat(force[1], width), splat(force[2], width)))
            act(now, guard, errors, plans)
        after = Moment(world, own, work, flight, 1, k + 1)
        look(after, optics, clusters, errors, plans)
        write_observed(after, observed[flight])
        samples[flight] = k + 1
