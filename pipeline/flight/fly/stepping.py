"""Flights stepped one control period at a time, under external forces."""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from fis_tools.compiled.vectors import make_rows
from fis_tools.engines.kernel import FEW_LANES
from pipeline.flight.cases.cases import cases_of
from pipeline.flight.fly.inspectable import counted_points, inspectable_points
from pipeline.flight.fly.simulation import is_by_the_reference
from pipeline.flight.fly.workspace import beyond_of, make_workspace
from pipeline.flight.period.step import LEFT, NOT_STARTED, NUM_OBSERVED, Carried, step_many
from pipeline.flight.state.arrays import CARRIED, CASE
from pipeline.flight.state.errors import ESTIMATED, THRUSTING, ModelErrors
from pipeline.flight.state.log import Scenario, no_log
from pipeline.flight.world.pack import pack_world
from pipeline.settings.experiment import Mission

Floats = NDArray[np.float64]

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

    Parameters
    ----------
    mission : Mission
    num_flights : int
    is_tilted : bool
        Whether any start has a Sun out of the orbit plane.

    Attributes
    ----------
    observed : (n, NUM_OBSERVED) array
        As `pipeline.flight.period.step` writes it.
    samples : (n,) int array
        Control periods flown so far.
    inspectable : (n,) int array
        Points that are lit at some sample of the flight.

    Raises
    ------
    ValueError
        If the mission has dispersions, or guidance that cannot be stepped.
    """

    def __init__(self, mission: Mission, num_flights: int, *, is_tilted: bool) -> None:
        if mission.dispersions:
            raise ValueError("flights that are stepped share one world; leave dispersions out")
        if is_by_the_reference(mission):
            raise ValueError("guidance.engine=sklearn cannot be stepped; choose guidance.engine=compiled")
        self._mission, self._world = mission, pack_world(mission)
        world, width = self._world, self._world.points.shape[2]
        self._optics = beyond_of(world, is_tilted=is_tilted)
        self._work = make_workspace(world, FEW_LANES)
        clusters = self._work.centres.shape[1]
        self._carried = Carried(
            lanes=make_rows(CARRIED, FEW_LANES, num_flights),
            unseen=np.zeros((num_flights, FEW_LANES, width)),
            centres=np.zeros((num_flights, FEW_LANES, clusters, 3)),
            num_centres=np.zeros((num_flights, FEW_LANES), dtype=np.int64),
            clustered=np.zeros((num_flights, FEW_LANES, width)),
        )
        self._starts = np.zeros(num_flights, CASE).view(np.recarray)
        self._counted = np.zeros((num_flights, width), dtype=np.uint8)
        anywhere = Scenario(np.array([mission.deputy.max_distance_m, 0.0, 0.0]), np.zeros(3), 0.0)
        cases = cases_of(mission, [anywhere] * num_flights)
        self._model_errors = _stacked(cases.model_errors(world.course, FEW_LANES), num_flights)
        self.observed = np.zeros((num_flights, NUM_OBSERVED))
        self.samples = np.full(num_flights, NOT_STARTED, dtype=np.int64)
        self.inspectable = np.zeros(num_flights, dtype=np.int64)
        self._forces = np.zeros((num_flights, 3))
        # they stay the same arrays, so that their types are resolved once
        self._arguments = (
            world,
            self._optics,
            world.guard if world.guard.is_on or self._model_errors is not None else None,
            world.has_clusters or None,
            self._model_errors,
            self._starts,
            self._counted,
            self._work,
            self._carried,
            self.samples,
            self._forces,
            no_log(),
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
        if self._model_errors is not None and cases.navigation is not None:
            fixes, errors = self._model_errors.fixes, cases.navigation[1]
            fixes.at_start[flight] = errors.at_start[0]
            fixes.of_fixes[flight] = errors.of_fixes[0]
            fixes.of_sight[flight] = errors.of_sight[0]
            fixes.of_attitude[flight] = errors.of_attitude[0]
        if self._model_errors is not None and cases.thrusters is not None:
            firing, of_thrust = self._model_errors.firing, cases.thrusters[1]
            firing.matrices[flight] = of_thrust.matrices[0]
            firing.arms[flight] = of_thrust.arms[0]
        self.samples[flight] = NOT_STARTED

    def step(self, forces: Floats) -> None:
        """Fly every flight by a control period under a force, shape (n, 3), N, Hill axes, or start it."""
        self._forces[:] = forces
        self._step(*self._arguments)


def _stacked(model_errors: ModelErrors | None, num_flights: int) -> ModelErrors | None:
    """Return navigation and thrusters with a row of carried data for each flight."""
    if model_errors is None:
        return None

    def stack(values: Floats) -> Floats:
        return np.zeros((num_flights, *values.shape))

    fixes, firing = model_errors.fixes, model_errors.firing
    return model_errors._replace(
        fixes=fixes._replace(
            lanes=make_rows(ESTIMATED, FEW_LANES, num_flights),
            fixes=stack(fixes.fixes),
            acting=stack(fixes.acting),
        ),
        firing=firing._replace(
            commands=stack(firing.commands),
            lanes=make_rows(THRUSTING, FEW_LANES, num_flights),
            thrust=stack(firing.thrust),
        ),
    )
