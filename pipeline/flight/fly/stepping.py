"""Flights stepped one control period at a time, under external forces."""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from fis_tools.engines.kernel import FEW_LANES
from pipeline.array_types import Floats
from pipeline.flight.cases.cases import cases_of
from pipeline.flight.control.controller import played
from pipeline.flight.fly.inspectable import counted_points, inspectable_points
from pipeline.flight.fly.simulation import is_interpreted
from pipeline.flight.fly.stepped import LEFT, NOT_STARTED, NUM_OBSERVED, step_many
from pipeline.flight.fly.workspace import beyond_of, make_states, make_workspace
from pipeline.flight.state.arrays import CASE
from pipeline.flight.state.log import Scenario
from pipeline.flight.world.pack import pack_world
from pipeline.settings.experiment import Mission

#: observations of learners and policies, in this order, with units; vectors in Hill axes. Position and
#: velocity are as the deputy knows them: its estimate, if it navigates by fixes.
OBSERVED: Final = (
    *(("position_radial", "m"), ("position_along_track", "m"), ("position_cross_track", "m")),
    *(("velocity_radial", "m/s"), ("velocity_along_track", "m/s"), ("velocity_cross_track", "m/s")),
    *(("target_radial", "m"), ("target_along_track", "m"), ("target_cross_track", "m")),
    *(("sun_radial", ""), ("sun_along_track", ""), ("sun_cross_track", "")),
    *(("boresight_radial", ""), ("boresight_along_track", ""), ("boresight_cross_track", "")),
    *(("num_inspected", ""), ("num_candidates", ""), ("delta_v", "m/s"), ("time_left", "s")),
)
NUM_SEEN: Final = LEFT + 1


class Flights:
    """Some flights in one mission, each at its own sample.

    `observed` is as `pipeline.flight.fly.stepped` writes it, `samples` the control periods flown so far, and
    `inspectable` the points that are lit at some sample of a flight, each for n flights. Where any start has
    a Sun out of the orbit plane, `is_tilted` must be true.

    Raises
    ------
    ValueError
        If the mission has dispersions, or guidance that cannot be stepped.
    """

    def __init__(self, mission: Mission, num_flights: int, *, is_tilted: bool) -> None:
        if mission.dispersions:
            raise ValueError("flights that are stepped share one world; leave dispersions out")
        if is_interpreted(mission):
            raise ValueError("guidance.engine=sklearn cannot be stepped; choose guidance.engine=compiled")
        self._mission, self._world = mission, pack_world(mission)
        world, width = self._world, self._world.points.shape[2]
        self._optics = beyond_of(world, is_tilted=is_tilted)
        self._starts = np.zeros(num_flights, CASE).view(np.recarray)
        self._counted = np.zeros((num_flights, width), dtype=np.uint8)
        anywhere = Scenario(np.array([mission.deputy.max_distance_m, 0.0, 0.0]), np.zeros(3), 0.0)
        self._errors = cases_of(mission, [anywhere] * num_flights).model_errors(world.course)
        self.observed = np.zeros((num_flights, NUM_OBSERVED))
        self.samples = np.full(num_flights, NOT_STARTED, dtype=np.int64)
        self.inspectable = np.zeros(num_flights, dtype=np.int64)
        self._forces = np.zeros((num_flights, 3))
        # they stay the same arrays, so that their types are resolved once
        self._arguments = (
            world,
            self._optics,
            world.guard if world.guard.is_on or self._errors is not None else None,
            world.has_clusters or None,
            self._errors,
            played(np.zeros((0, mission.num_controls, 3))),
            self._starts,
            self._counted,
            make_states(world, self._errors, FEW_LANES, num_flights),
            make_workspace(world, FEW_LANES),
            self.samples,
            self._forces,
            self.observed,
        )
        self._step = step_many.prepared(*self._arguments)  # type: ignore[attr-defined]

    @property
    def seen(self) -> NDArray[np.float32]:
        """The observations now, shape (n, NUM_SEEN), in the order of `OBSERVED`."""
        return self.observed[:, :NUM_SEEN].astype(np.float32)

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
        found = inspectable_points(world, cases.starts)
        self._starts[flight] = cases.starts[0]
        counted = counted_points(world, cases.starts, found)
        self._counted[flight] = counted[0] if self._optics is not None else 1
        self.inspectable[flight] = found[0, : world.num_points].sum()
        if self._errors is not None:
            every = (*self._errors.fixes.errors, *self._errors.firing.errors)
            for drawn, own in zip((*cases.fixes.errors, *cases.firing.errors), every, strict=True):
                own[flight : flight + 1] = drawn
        self.samples[flight] = NOT_STARTED

    def step(self, forces: Floats) -> None:
        """Fly every flight by a control period under a force, shape (n, 3), N, Hill axes, or start it."""
        self._forces[:] = forces
        self._step(*self._arguments)
