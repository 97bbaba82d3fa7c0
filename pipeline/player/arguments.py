"""What the compiled flight takes, as the module of pages is built for: the parts that are always there."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numba
import numpy as np

from pipeline.flight.cases.starts import cases_of
from pipeline.flight.control.controller import Controller
from pipeline.flight.control.law import law_of
from pipeline.flight.fly.many import NO_TRACKS, Results
from pipeline.flight.fly.population import flights_of
from pipeline.flight.fly.workspace import make_state, make_workspace
from pipeline.flight.state.arrays import NUM_OUTCOMES, NUM_TRACKED, Guard
from pipeline.flight.state.log import Scenario, empty_log
from pipeline.flight.world.pack import pack_world
from pipeline.player.memory import Leaf, Memory, leaves_of
from pipeline.settings.experiment import Mission

#: flights side by side: WebAssembly's vectors hold two numbers
LANES = 2
#: arguments of `fly_many`
NAMES = (
    "optics",
    "guard",
    "clusters",
    "pushes",
    "errors",
    "flights",
    "state",
    "work",
    "results",
    "first",
    "last",
)

#: light other than the paper's, the safety layer, clusters, pushes that show setting points, errors
Parts = tuple[None, Guard, None, bool, None]


class Arguments(NamedTuple):
    """Arguments of a compiled function, each with its name."""

    names: tuple[str, ...]
    values: tuple[Any, ...]

    @property
    def kinds(self) -> tuple[Any, ...]:
        """Their types for numba."""
        return tuple(map(numba.typeof, self.values))

    def leaves(self, memory: Memory) -> list[Leaf]:
        """Return their leaves, with their arrays stored in a memory."""
        each = zip(self.values, self.kinds, self.names, strict=True)
        return [leaf for value, kind, name in each for leaf in leaves_of(memory, value, kind, name)]


def arguments_of(
    mission: Mission, controller: Controller, starts: Sequence[Scenario], *, num_tracked: int = 0
) -> Arguments | None:
    """Return what `fly_many` takes for some starts in the module; None if the module does not fly them.

    The safety layer and pushes that show setting points are always there, though they may be off; light and
    cameras other than the paper's, clusters, and errors of the deputies' model never are.

    Parameters
    ----------
    mission : Mission
    controller : Controller
        Whose law does not depend on starts.
    starts : sequence of Scenario
    num_tracked : int
        Flights of which a track is kept.
    """
    world, cases = pack_world(mission), cases_of(mission, list(starts))
    law = law_of(controller, mission)
    (optics, _, clusters, _, errors), flights, _ = flights_of(
        world, law, controller.numbers, cases, changes=controller.changes
    )
    if optics is not None or clusters or errors is not None:
        return None
    parts: Parts = (None, world.guard, None, True, None)
    log = empty_log(mission.num_controls, mission.num_attitude_steps, world.num_points, len(law.axes))
    tracks = np.zeros((num_tracked, mission.num_controls + 1, NUM_TRACKED), np.float32)
    results = Results(np.zeros((len(starts), NUM_OUTCOMES)), log, tracks=tracks if num_tracked else NO_TRACKS)
    state, work = make_state(world, None, LANES), make_workspace(world, LANES)
    return Arguments(NAMES, (*parts, flights, state, work, results, 0, 1))
