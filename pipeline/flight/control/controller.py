"""Controllers: which fuzzy system senses which signal and drives which axis, or which forces are planned.

A planner is plain Python, and the state at a decision is known only after flying up to there. So flights are
flown up to a decision, their forces are planned, and they are flown again up to the next one. Flights are
reproducible to the last digit, so the final flight is a closed loop.

The names of signals, components and constants are those of `pipeline.flight.state.signals`.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Protocol

import numpy as np

from fis_tools.engines.packing import NotCompilable, Packed, layout_of, pack
from fis_tools.model import FuzzyController, FuzzySystem
from pipeline.array_types import Floats
from pipeline.flight.state.arrays import AIMED, Plans, Turns
from pipeline.flight.state.log import Scenario
from pipeline.flight.state.signals import (
    AXES,
    CONSTANTS,
    FORCE_AXES,
    SETTING,
    SIGNALS,
    TOUR,
    URGENCY,
    constant,
)
from pipeline.settings.experiment import Mission


class ControllerError(ValueError):
    """A controller that cannot fly; the text says why and what to do."""


class Planner(Protocol):
    """Plans the forces of a flight, at each decision from the state as the deputy knows it."""

    @property
    def decisions(self) -> Sequence[int]:
        """Samples at which forces are planned, ascending from 0."""

    def __call__(self, scenario: Scenario, decision: int, state: Floats) -> Floats:
        """Return the forces from a decision on, shape (rows, 3), N, Hill axes; zero after the last row.

        The state, shape (6,), is what the deputy knows then, m and m/s, Hill axes. Rows beyond the next
        decision are not flown.
        """


class Regulator(Protocol):
    """Holds the deputy on a path by a force that is linear in the deviation."""

    def __call__(self, scenarios: list[Scenario]) -> Plans:
        """Return the plans of flights from some starts: `Plans` with forces, paths and gain."""


class Pilot(Protocol):
    """Decides at every control period from the observations at that time."""

    @property
    def source(self) -> bytes:
        """The file it was read from, for recordings."""

    @property
    def turns(self) -> bool:
        """Whether it turns the deputy itself, by torques; it then gives the plans of one flight at a time."""

    @property
    def draws(self) -> bool:
        """Whether what it observes depends on a case's random numbers."""

    def __call__(self, mission: Mission, scenarios: list[Scenario], workers: int | None) -> Plans:
        """Return the forces of flights from some starts as plans, shape (m, K, 3), N, Hill axes."""

    def together(self, mission: Mission, fleets: Sequence[Sequence[Scenario]], workers: int | None) -> Floats:
        """Return the forces of the deputies of fleets, shape (m, D, K, 3), N, Hill axes."""


@dataclass(frozen=True, eq=False)
class _WithoutRules:
    """Base of controllers without fuzzy systems: everything about rules is empty."""

    name: str

    @property
    def systems(self) -> tuple[FuzzySystem, ...]:
        """No fuzzy systems."""
        return ()

    @property
    def fuzzy(self) -> None:
        """No fuzzy controller."""
        return

    @property
    def constants(self) -> Floats:
        """Its constants, in the order of `CONSTANTS`: all zero."""
        return np.zeros(len(CONSTANTS))

    @property
    def numbers(self) -> Packed:
        """No fuzzy systems, as compiled flights read them."""
        return Packed(layout_of(())[0], np.zeros((1, 0)), np.zeros((1, 0), dtype=np.int64))

    @property
    def changes(self) -> tuple[int, ...]:
        """Samples at which the controller changes: none."""
        return ()


@dataclass(frozen=True, eq=False)
class RuleController:
    """Infers the force by fuzzy systems, at most three."""

    name: str
    systems: tuple[FuzzySystem, ...]
    force_axes: str = "body"  # or hill: the axes of the systems' outputs
    fuzzy: FuzzyController | None = None  # the source of the systems, for files and reports
    # samples, ascending, and what it becomes at each, with the same systems but constants of its own
    later: "tuple[tuple[int, RuleController], ...]" = ()

    @cached_property
    def numbers(self) -> Packed:
        """Its systems as compiled flights read them, a row for each stretch of a flight."""
        packed = pack(*self.systems)
        more = self.constants[np.newaxis] if has_constants(self) else np.zeros((1, 0))
        later = [controller.numbers.values for _, controller in self.later]
        return replace(packed, values=np.vstack([np.hstack([packed.values, more]), *later]))

    @cached_property
    def constants(self) -> Floats:
        """Its constants, in the order of `CONSTANTS`; their defaults, mostly zero, where not set.

        Raises
        ------
        ControllerError
            If one is not a finite number, or is a negative length, force or time.
        """
        return _constants_of(self)

    @property
    def changes(self) -> tuple[int, ...]:
        """Samples at which the controller is replaced by those of `later`."""
        return tuple(sample for sample, _ in self.later)


@dataclass(frozen=True, eq=False)
class OpenLoopController(_WithoutRules):
    """Plays forces, and may play a rotation."""

    plan: Floats  # (K, 3) forces, N, one row per control period; zero after the last row
    force_axes: str = "hill"  # or body
    turns: Turns = AIMED


@dataclass(frozen=True, eq=False)
class _InHillAxes(_WithoutRules):
    """Commands along Hill's axes."""

    @property
    def force_axes(self) -> str:
        """The axes of its forces."""
        return "hill"


@dataclass(frozen=True, eq=False)
class PlanningController(_InHillAxes):
    """Plans forces during the flight; its name states its kind."""

    planner: Planner


@dataclass(frozen=True, eq=False)
class RegulatorController(_InHillAxes):
    """Holds the deputy on a path by a linear law; its name states its kind."""

    regulator: Regulator


@dataclass(frozen=True, eq=False)
class PilotController(_InHillAxes):
    """Decides in every control period by a function that was learned, or by any other."""

    pilot: Pilot


#: what decides the force; each is compared by identity, so that what is computed from it can be cached
Controller = RuleController | OpenLoopController | PlanningController | RegulatorController | PilotController


def stretches_of(controller: Controller) -> tuple[tuple[int, Controller], ...]:
    """Return the samples from which a flight has a new controller, starting at 0, and the controllers."""
    return (0, controller), *(controller.later if isinstance(controller, RuleController) else ())


def from_fuzzy(fuzzy: FuzzyController) -> RuleController:
    """Make a controller from a fuzzy controller, whose variables name signals and force components.

    Raises
    ------
    ControllerError
        If a system or an attribute is not what flights need.
    """
    attributes = dict(fuzzy.attributes)
    force_axes = attributes.get("force_axes", "")
    if force_axes not in FORCE_AXES:
        raise ControllerError(
            f"controller {fuzzy.name!r} has force_axes {force_axes!r}; set the attribute to body or hill"
        )
    if not fuzzy.systems:
        raise ControllerError(f"controller {fuzzy.name!r} has no system; give one to three")
    if fuzzy.wires:
        raise ControllerError(
            f"controller {fuzzy.name!r} has wires between its systems, which flights do not have; "
            "give systems that take signals alone"
        )
    driven: dict[str, str] = {}
    for system in fuzzy.systems:
        for variable in system.inputs:
            if variable.name not in SIGNALS:
                raise ControllerError(
                    f"system {system.name!r} senses {variable.name!r}, which is no signal; "
                    f"the signals are {', '.join(SIGNALS)}"
                )
            if variable.unit != SIGNALS[variable.name].unit:
                raise ControllerError(
                    f"system {system.name!r} takes {variable.name!r} in {variable.unit!r}; "
                    f"this signal comes in {SIGNALS[variable.name].unit!r}"
                )
        names = [variable.name for variable in system.outputs]
        if len(names) != 1 or names[0] not in AXES:
            raise ControllerError(
                f"system {system.name!r} drives {', '.join(names) or 'nothing'}; "
                f"each system drives one of {', '.join(AXES)}"
            )
        if names[0] in driven:
            raise ControllerError(
                f"systems {driven[names[0]]!r} and {system.name!r} both drive {names[0]}; "
                "give each axis one system"
            )
        if system.outputs[0].unit != "N":
            raise ControllerError(
                f"output {names[0]!r} of {system.name!r} is in {system.outputs[0].unit!r}; use N"
            )
        driven[names[0]] = system.name
    try:
        pack(*fuzzy.systems)
    except NotCompilable as error:
        raise ControllerError(f"controller {fuzzy.name!r} cannot fly: {error}") from error
    controller = RuleController(fuzzy.name, fuzzy.systems, force_axes, fuzzy)
    _constants_of(controller)
    return controller


def coast() -> OpenLoopController:
    """Return the controller that never fires."""
    return OpenLoopController("coast", np.zeros((0, 3)))


def open_loop(name: str, plan: Floats, force_axes: str = "hill", turns: Turns = AIMED) -> OpenLoopController:
    """Return the controller that plays forces of shape (K, 3), N, and turns."""
    return OpenLoopController(name, np.asarray(plan, dtype=np.float64), force_axes, turns)


def has_constants(controller: Controller) -> bool:
    """Return whether a controller sets any of `CONSTANTS`."""
    return controller.fuzzy is not None and any(name in CONSTANTS for name, _ in controller.fuzzy.attributes)


def _constants_of(controller: RuleController) -> Floats:
    """Return a controller's constants in the order of `CONSTANTS`; raise ControllerError for faulty ones."""
    attributes = dict(controller.fuzzy.attributes) if controller.fuzzy else {}
    values = np.zeros(len(CONSTANTS))
    for index, (name, kind) in enumerate(CONSTANTS.items()):
        text = attributes.get(name, f"{kind.default:g}")
        try:
            values[index] = float(text)
        except ValueError:
            values[index] = np.nan
        if not np.isfinite(values[index]) or (values[index] < 0 and not kind.is_signed):
            least = "a number" if kind.is_signed else "a number from 0 on"
            raise ControllerError(f"controller {controller.name!r} has {name} {text!r}; give {least}")
    sensed = sensed_by(controller)
    for value, (name, kind) in zip(values, CONSTANTS.items(), strict=True):
        needing = [signal for signal in sensed if SIGNALS[signal].needs & kind.needed_for]
        if needing and value == 0.0:
            raise ControllerError(
                f"controller {controller.name!r} senses {', '.join(needing)} but sets no {name}; give it as "
                f"an attribute, say {kind.such_as}: {kind.description}"
            )
    if values[constant("rehearsal_tours")] not in (0.0, 2.0, 4.0):
        raise ControllerError(
            f"controller {controller.name!r} has rehearsal_tours {attributes['rehearsal_tours']!r}; give 2 "
            "for the tour and its mirror image through the orbit plane, 4 for both of these reversed too"
        )
    for name in ("rehearsal_draws", "rehearsal_shapes", "foresight_searches"):
        if values[constant(name)] % 1.0 != 0.0:
            raise ControllerError(
                f"controller {controller.name!r} has {name} {attributes[name]!r}; give a whole number"
            )
    if values[constant("foresight_pushes")] not in (0.0, 2.0, 3.0):
        raise ControllerError(
            f"controller {controller.name!r} has foresight_pushes {attributes['foresight_pushes']!r}; give 2 "
            "or 3, or leave it out"
        )
    for name, what in (
        ("rehearsal_reach_m_s", "rehearses its first push"),
        ("foresight_pushes", "plans pushes"),
        ("park_below_points", "parks"),
    ):
        if values[constant(name)] > 0.0 and controller.force_axes != "hill":
            raise ControllerError(
                f"controller {controller.name!r} {what} with force_axes "
                f"{controller.force_axes}; set the attribute force_axes to hill, which the pushes are along"
            )
    return values


def sensed_by(controller: Controller) -> list[str]:
    """Return the signals that a controller's systems sense, one per input."""
    return [variable.name for system in controller.systems for variable in system.inputs]


def about_points(controller: Controller) -> list[str]:
    """Return the signals that a controller senses of points yet to be inspected."""
    about = URGENCY | SETTING | TOUR
    return [signal for signal in sensed_by(controller) if SIGNALS[signal].needs & about]
