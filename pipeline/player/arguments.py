"""What the compiled flight takes, as the modules of pages are built for: the parts that are always there."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from pipeline.array_types import Floats
from pipeline.flight.cases.starts import cases_of
from pipeline.flight.control.controller import Controller
from pipeline.flight.fly.many import NO_TRACKS, Results
from pipeline.flight.fly.population import flights_of
from pipeline.flight.fly.simulation import law_for
from pipeline.flight.fly.workspace import make_state, make_workspace
from pipeline.flight.state.arrays import NUM_OUTCOMES, NUM_TRACKED, FullOptics
from pipeline.flight.state.errors import ModelErrors
from pipeline.flight.state.log import Scenario, empty_log
from pipeline.flight.world.pack import pack_world
from pipeline.player.memory import Leaf, Memory, leaves_of
from pipeline.settings.experiment import Mission

#: flights side by side: WebAssembly's vectors hold two numbers
LANES = 2
#: arguments of `fly_many`
NAMES = ("optics", "clusters", "errors", "flights", "state", "work", "results", "first", "last")

#: the modules: of the paper's light and camera, without errors and clusters or with them, and of any other
PLAIN, ERRING, LIT = MODULES = "plain", "erring", "lit"


class Parts(NamedTuple):
    """What `fly_many` is compiled with, or without."""

    optics: FullOptics | None
    clusters: bool | None
    errors: ModelErrors | None


class Arguments(NamedTuple):
    """Arguments of a compiled function, each with its name."""

    names: tuple[str, ...]
    values: tuple[Any, ...]

    def named(self, name: str) -> Any:
        """Return the argument of a name."""
        return self.values[self.names.index(name)]

    @property
    def kinds(self) -> tuple[Any, ...]:
        """Their types for numba."""
        from numba import typeof  # noqa: PLC0415 - slow to import, and only who compiles needs it

        return tuple(map(typeof, self.values))

    def leaves(self, memory: Memory) -> list[Leaf]:
        """Return their leaves, with their arrays stored in a memory."""
        each = zip(self.values, self.names, strict=True)
        return [leaf for value, name in each for leaf in leaves_of(memory, value, name)]


class ModuleArguments(NamedTuple):
    """Which module flies some starts, and what `fly_many` takes for it."""

    module: str
    arguments: Arguments


def arguments_of(
    mission: Mission,
    controller: Controller,
    starts: Sequence[Scenario],
    openings: Floats | None = None,
    *,
    num_tracked: int = 0,
) -> ModuleArguments:
    """Return what flies some starts in a page.

    Modules other than the plain one always have clusters and errors, which may be none. In the paper's light
    the one of any other would decide otherwise in the last digits, so that it does not fly there.

    Parameters
    ----------
    mission : Mission
    controller : Controller
    starts : sequence of Scenario
    openings : (m, n, 4) array, optional
        Forces of the first control periods, see `fly_population`.
    num_tracked : int
        Flights of which a track is kept.
    """
    world, cases = pack_world(mission), cases_of(mission, list(starts))
    law = law_for(controller, mission, list(starts), 1)
    (optics, clusters, errors), flights, _ = flights_of(
        world, law, controller.numbers, cases, openings, controller.changes
    )
    module, parts = PLAIN, Parts(None, None, None)
    if optics is not None or clusters or errors is not None:
        module = ERRING if optics is None else LIT
        errors = ModelErrors(cases.fixes, cases.firing, world.course._replace(varying=cases.drag))
        parts = Parts(None if optics is None else FullOptics(by_point=True), True, errors)
    log = empty_log(mission.num_controls, mission.num_attitude_steps, world.num_points, len(law.axes))
    tracks = np.zeros((num_tracked, mission.num_controls + 1, NUM_TRACKED), np.float32)
    results = Results(np.zeros((len(starts), NUM_OUTCOMES)), log, tracks=tracks if num_tracked else NO_TRACKS)
    state, work = make_state(world, parts[-1], LANES), make_workspace(world, LANES)
    arguments = Arguments(NAMES, (*parts, flights, state, work, results, 0, 1))
    return ModuleArguments(module, arguments)
