"""Flights stepped one control period at a time by external forces, each in lane 0 of vectors of its own."""

import math
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, ClassVar, Final

import numpy as np
from numpy.typing import NDArray

from fis_tools.compiled.decorator import compiled
from fis_tools.compiled.three import Three, lane_of, write_three
from fis_tools.compiled.vectors import borrowed, splat, width_of
from fis_tools.engines.kernel import FEW_LANES
from pipeline.array_types import Booleans, Bytes, Floats, Integers
from pipeline.flight.cases.starts import cases_of
from pipeline.flight.control.law import played
from pipeline.flight.fly.many import note_after, start_lanes
from pipeline.flight.fly.plain import is_interpreted
from pipeline.flight.fly.workspace import make_states, make_workspace, optics_in_use, points_of_cases
from pipeline.flight.period.decide.thrust import command_given
from pipeline.flight.period.steps import act, look
from pipeline.flight.state.arrays import CASE, FlightState, FullOptics, Moment, Plans, Workspace, World
from pipeline.flight.state.errors import ModelErrors
from pipeline.flight.state.log import Scenario
from pipeline.flight.state.signals import HILL_AXES
from pipeline.flight.world.pack import pack_world
from pipeline.settings.experiment import Mission

#: columns of an observation: vectors in Hill axes
POSITION, VELOCITY, TARGET, SUN, BORESIGHT = 0, 3, 6, 9, 12
NUM_INSPECTED, NUM_CANDIDATES, SPENT, LEFT = 15, 16, 17, 18
#: known to the truth only: points that count and are not inspected, how far outside, and the safety layer's
NUM_UNSEEN, OUTSIDE, NUM_ACTED, CORRECTED, NUM_OBSERVED = 19, 20, 21, 22, 23
#: the sample of a flight that is about to start, and of one that rests in a step of others
NOT_STARTED, RESTING = -1, -2


# This is inlined: a compiled function cannot return a tuple with a record in it.
@compiled(error_model="numpy", inline="always")
def state_of(states: FlightState, flight: int) -> FlightState:
    """Return the state of one flight, from arrays with a row each."""
    return FlightState(
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
        states.has_fired[flight],
        states.sensed[flight],
        states.thrust[flight],
    )


@compiled(error_model="numpy", forceinline=True)
def write_observed(now: Moment, lane: int, row: Floats) -> None:
    """Write the observation of the flight in a lane."""
    lanes, belief = now.state.lanes, now.state.belief
    flat = lanes.sun_height[0, lane]
    write_three(row[POSITION:], lane_of(belief.position, 0, lane))
    write_three(row[VELOCITY:], lane_of(belief.velocity, 0, lane))
    write_three(row[TARGET:], lane_of(lanes.target, 0, lane))
    write_three(row[BORESIGHT:], lane_of(belief.boresight, 0, lane))
    sun = Three(flat * lanes.sun[0, lane], flat * lanes.sun[1, lane], lanes.sun_height[1, lane])
    write_three(row[SUN:], sun)
    row[NUM_INSPECTED] = lanes.num_counted[lane] - lanes.num_unseen[lane]
    row[NUM_CANDIDATES] = lanes.num_candidates[lane]
    row[SPENT] = lanes.spent[lane]
    row[LEFT] = (now.world.num_controls - now.k) * now.world.control_period
    row[NUM_UNSEEN] = lanes.num_unseen[lane]
    row[OUTSIDE] = lanes.beyond[lane]
    row[NUM_ACTED] = lanes.num_acted[lane]
    row[CORRECTED] = lanes.corrected[lane]


@compiled(nogil=True, error_model="numpy")
def step_many(
    world: World,
    optics: FullOptics | None,
    clusters: bool | None,
    errors: ModelErrors | None,
    plans: Plans,
    cases: Any,
    counted: Bytes,
    states: FlightState,
    work: Workspace,
    samples: Integers,
    forces: Floats,
    observed: Floats,
) -> None:
    """Fly every flight by a control period, or start it; see `pipeline.flight.period.steps`.

    Each of n flights has a start, of `CASE`, a row of `counted`, 1 for the points that it is about, of
    `states`, and of `forces`, N, Hill axes. Its sample, `NOT_STARTED` for a flight to be started, is
    incremented, and its row of `observed`, (n, NUM_OBSERVED), filled; a flight that is `RESTING` is passed
    over. There are no plans.
    """
    world, plans, cases, counted, states, work = borrowed((world, plans, cases, counted, states, work))
    for flight in range(len(samples)):
        state, k = state_of(states, flight), samples[flight]
        if k == RESTING:
            continue
        now = Moment(world, state, flight, 1, k)
        if k == NOT_STARTED:
            start_lanes(now, cases, counted)
        else:
            width, force = width_of(state.lanes), forces[flight]
            command_given(now, Three(splat(force[0], width), splat(force[1], width), splat(force[2], width)))
            act(now, work, errors, plans)
        after = Moment(world, state, flight, 1, k + 1)
        look(after, work, optics, clusters, errors, plans)
        if k + 1 == world.num_controls:
            note_after(after)
        write_observed(after, 0, observed[flight])
        samples[flight] = k + 1


#: observations of learners and policies, in this order, with units; vectors in Hill axes. Position and
#: velocity are as the deputy knows them: its estimate, if it navigates by fixes.
VECTORS = {"position": "m", "velocity": "m/s", "target": "m", "sun": "", "boresight": ""}
OBSERVED: Final = (
    *((f"{vector}_{axis}", unit) for vector, unit in VECTORS.items() for axis in HILL_AXES),
    *(("num_inspected", ""), ("num_candidates", ""), ("delta_v", "m/s"), ("time_left", "s")),
)
NUM_SEEN: Final = LEFT + 1


def observation_scales(mission: Mission) -> Floats:
    """Return amounts, shape (NUM_SEEN,), by which observations are divided to be about one."""
    speed, points = 1.0, float(mission.chief.num_points)
    distance, size = mission.deputy.max_distance_m, mission.chief.inspection_radius_m
    amounts = (distance, speed, size, 1.0, points, speed, mission.duration_s)
    return np.repeat(amounts, (3, 3, 3, 6, 2, 1, 1))


def periods_between(mission: Mission, decision_period_s: float | None) -> int:
    """Return the control periods from one decision to the next; one unless the time between them is given.

    Raises
    ------
    ValueError
        If that is no multiple of the control period.
    """
    period = mission.control_period_s
    given = period if decision_period_s is None else decision_period_s
    count = round(given / period) if math.isfinite(given) else 0
    if not (count >= 1 and abs(count * period - given) <= 1e-9 * given):
        raise ValueError(
            f"decision_period_s is {given:g}; it must be a multiple of control_period_s, {period:g}"
        )
    return count


def check_given(numbers: Floats) -> None:
    """Raise ValueError unless what a learner or a policy gives is finite."""
    if not math.isfinite(numbers.sum()):
        raise ValueError("an action or a policy's force is infinite or not a number; give finite ones")


class SteppedFlights:
    """Some flights in one mission, each at its own sample.

    `observed` is as `pipeline.flight.fly.stepping` writes it, `samples` the control periods flown so far, and
    `inspectable` the points that are lit at some sample of a flight, each for n flights. Where any start has
    a Sun out of the orbit plane, `is_tilted` must be true.

    Raises
    ------
    ValueError
        If the mission has dispersions, or guidance that cannot be stepped.
    """

    #: the compiled function that flies all by a control period
    stepper: ClassVar[Any] = step_many

    def __init__(self, mission: Mission, num_flights: int, *, is_tilted: bool) -> None:
        if mission.dispersions:
            raise ValueError("flights that are stepped share one world; leave dispersions out")
        if is_interpreted(mission):
            raise ValueError("guidance.engine=sklearn cannot be stepped; choose guidance.engine=compiled")
        self._mission, self._world, self._is_tilted = mission, pack_world(mission), is_tilted
        world, width = self._world, self._world.points.shape[2]
        self._optics = optics_in_use(world, is_tilted)
        self._starts = np.zeros(num_flights, CASE).view(np.recarray)
        self._counted = np.zeros((num_flights, width), dtype=np.uint8)
        anywhere = Scenario(np.array([mission.deputy.max_distance_m, 0.0, 0.0]), np.zeros(3), 0.0)
        self._errors = cases_of(mission, [anywhere] * num_flights).model_errors(world.course)
        self.observed = np.zeros((num_flights, NUM_OBSERVED))
        self.samples = np.full(num_flights, NOT_STARTED, dtype=np.int64)
        self.inspectable = np.zeros(num_flights, dtype=np.int64)
        self._forces = np.zeros((num_flights, 3))
        self._lighting = make_workspace(world)
        self._states, *others = self._allocated()
        # they stay the same arrays, so that their types are resolved once
        self._arguments = (
            world,
            self._optics,
            world.has_clusters or None,
            self._errors,
            self._plans(mission.num_controls),
            self._starts,
            self._counted,
            *others,
            self._states,
            make_workspace(world, FEW_LANES),
            self.samples,
            self._forces,
            self.observed,
        )
        self._step = self.stepper.bound(*self._arguments)

    def _plans(self, num_controls: int) -> Plans:
        """Return what is played beside the forces that are given: nothing."""
        return played(np.zeros((0, num_controls, 3)))

    def _allocated(self) -> tuple[Any, ...]:
        """Return the states of all flights, and what else `stepper` takes before them."""
        return (make_states(self._world, self._errors, FEW_LANES, len(self.samples)),)

    @property
    def seen(self) -> NDArray[np.float32]:
        """The observations now, shape (n, NUM_SEEN), in the order of `OBSERVED`."""
        return self.observed[:, :NUM_SEEN].astype(np.float32)

    @property
    def positions(self) -> Floats:
        """The true positions now, shape (n, 3), m, Hill axes."""
        return self._states.truth["position"][..., 0].copy()

    @property
    def is_inspected(self) -> Booleans:
        """Which points have been inspected, shape (n, P)."""
        unseen, num_points = self._states.unseen[:, 0], self._world.num_points
        return np.asarray((unseen == 0.0) & (self._counted > 0))[:, :num_points]

    def start(self, flight: int, scenario: Scenario) -> None:
        """Put a flight at a start; the next step brings it to its first sample.

        Raises
        ------
        ValueError
            If its Sun is out of the orbit plane although `is_tilted` was false.
        """
        if self._optics is None and scenario.sun_elevation_rad != 0.0:
            raise ValueError("the Sun of this start is out of the orbit plane; pass is_tilted=True")
        world, cases = self._world, cases_of(self._mission, [scenario])
        inspectable, counted = points_of_cases(world, cases.starts, work=self._lighting)
        self._starts[flight] = cases.starts[0]
        self._counted[flight] = counted[0] if self._optics is not None else 1
        self.inspectable[flight] = inspectable[0, : world.num_points].sum()
        if self._errors is not None:
            every = (*self._errors.fixes.errors, *self._errors.firing.errors)
            for drawn, stored in zip((*cases.fixes.errors, *cases.firing.errors), every, strict=True):
                stored[flight : flight + 1] = drawn
        self.samples[flight] = NOT_STARTED

    def step(self, forces: Floats) -> None:
        """Fly every flight by a control period under a force, shape (n, 3), N, Hill axes.

        A flight that `start` put at a start is brought to its first sample instead, whatever its force.

        Raises
        ------
        ValueError
            If a force is not finite.
        """
        self._forces[:] = forces
        check_given(self._forces)
        self._step()

    def step_started(self) -> None:
        """Bring the flights that were put at a start to their first sample; the others rest."""
        with self.resting(self.samples != NOT_STARTED):
            self._step()

    @contextmanager
    def resting(self, which: Booleans) -> Iterator[None]:
        """Let some flights, (n,), rest while others are stepped inside."""
        before = self.samples.copy()
        self.samples[which] = RESTING
        try:
            yield
        finally:
            self.samples[which] = before[which]

    def __getstate__(self) -> dict[str, Any]:
        """Return the mission and the content of all arrays, for pickling."""
        return {"arguments": (self._mission, len(self.samples), self._is_tilted), "arrays": self._arrays()}

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Allocate anew, for compiled code needs arrays as they are aligned here, and copy the content."""
        mission, num_flights, is_tilted = state["arguments"]
        self.__init__(mission, num_flights, is_tilted=is_tilted)  # type: ignore[misc]
        for array, content in zip(self._arrays(), state["arrays"], strict=True):
            array[...] = content

    def _arrays(self) -> list[Any]:
        """Return the arrays that change as flights are started and stepped."""
        errors = () if self._errors is None else (*self._errors.fixes.errors, *self._errors.firing.errors)
        mine = (self._starts, self._counted, self.observed, self.samples, self.inspectable)
        return [*mine, *self._states, *errors]
