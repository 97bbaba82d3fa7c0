"""Controllers: which fuzzy system senses which signal and drives which axis, or which forces are planned.

A planner is plain Python, and the state at a decision is known only after flying up to there. So flights are
flown up to a decision, their forces are planned, and they are flown again up to the next one. Flights are
reproducible to the last digit, so the final flight is a closed loop.

The names of signals, components and constants are those of `pipeline.flight.state.signals`.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, reduce
from itertools import product
from math import pi
from operator import or_
from typing import Protocol

import numpy as np

from fis_tools.engines.packing import NotCompilable, Packed, layout_of, pack
from fis_tools.model import FuzzyController, FuzzySystem
from pipeline.array_types import Floats
from pipeline.flight.state.arrays import AIMED, Law, Plans, Turns
from pipeline.flight.state.log import Scenario
from pipeline.flight.state.signals import (
    AXES,
    CONSTANTS,
    FORCE_AXES,
    NOTHING,
    SETTING,
    SIGNALS,
    TOUR,
    URGENCY,
    constant,
    slot,
)
from pipeline.settings.experiment import Mission
from pipeline.threads import in_threads

#: fractions of the reach that the candidate first pushes of a rehearsal have along each Hill axis; radial
#: pushes gain most, pushes across the orbit plane least
REHEARSED_PARTS = (
    (0.0, 1 / 3, -1 / 3, 2 / 3, -2 / 3, 1.0, -1.0),
    (0.0, 0.25, -0.25, 0.5, -0.5),
    (0.0, 0.25, -0.25),
)


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

    def __call__(self, mission: Mission, scenarios: list[Scenario], workers: int | None) -> Plans:
        """Return the forces of flights from some starts as plans, shape (m, K, 3), N, Hill axes."""


@dataclass(frozen=True, eq=False)
class Controller:
    """Decides the force: fuzzy systems, a fixed plan, a planner, a linear law, or a pilot.

    Compared by identity, so that what is computed from a controller can be cached.
    """

    name: str
    systems: tuple[FuzzySystem, ...]  # at most three; none for a plan
    force_axes: str = "body"  # or hill: the axes of the systems' outputs or of the plan
    plan: Floats | None = None  # (K, 3) forces, N, one row per control period; zero after the last row
    turns: Turns = AIMED  # played along with a plan
    planner: Planner | None = None
    regulator: Regulator | None = None
    pilot: Pilot | None = None
    fuzzy: FuzzyController | None = None  # the source of the systems, for files and reports
    # samples, ascending, and what it becomes at each, with the same systems but constants of its own
    later: "tuple[tuple[int, Controller], ...]" = ()

    @cached_property
    def numbers(self) -> Packed:
        """Its systems as compiled flights read them, a row for each stretch of a flight; none for a plan."""
        if self.systems:
            packed = pack(*self.systems)
            more = self.constants[np.newaxis] if has_constants(self) else np.zeros((1, 0))
            values = np.hstack([packed.values, more])
            return replace(
                packed,
                values=np.vstack([values, *(controller.numbers.values for _, controller in self.later)]),
            )
        return Packed(layout_of(())[0], np.zeros((1, 0)), np.zeros((1, 0), dtype=np.int64))

    @cached_property
    def constants(self) -> Floats:
        """Its constants, in the order of `CONSTANTS`; zero where not set.

        Raises
        ------
        ControllerError
            If one is not a finite number, or is a negative length, force or time.
        """
        return _constants_of(self)

    @property
    def stretches(self) -> "tuple[tuple[int, Controller], ...]":
        """The samples at which its stretches begin, from 0, and what it is in each."""
        return (0, self), *self.later

    @property
    def changes(self) -> tuple[int, ...]:
        """The samples at which it becomes what it is `later`."""
        return tuple(sample for sample, _ in self.later)

    @property
    def is_of_a_kind(self) -> bool:
        """Whether its name states its kind: a planner or a regulator."""
        return self.planner is not None or self.regulator is not None


def from_fuzzy(fuzzy: FuzzyController) -> Controller:
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
    controller = Controller(fuzzy.name, fuzzy.systems, force_axes, fuzzy=fuzzy)
    _constants_of(controller)
    return controller


def coast() -> Controller:
    """Return the controller that never fires."""
    return Controller("coast", (), "hill", plan=np.zeros((0, 3)))


def open_loop(name: str, plan: Floats, force_axes: str = "hill", turns: Turns = AIMED) -> Controller:
    """Return the controller that plays forces of shape (K, 3), N, and turns."""
    return Controller(name, (), force_axes, plan=np.asarray(plan, dtype=np.float64), turns=turns)


def law_of(controller: Controller, mission: Mission) -> Law:
    """Return what the compiled episode needs to know of a controller, apart from its numbers.

    It holds no plans of a planner, a regulator or a pilot yet.

    Raises
    ------
    ControllerError
        If a plan is longer than the flight, or decisions do not fall on control periods.
    """
    num_controls, numbers = mission.num_controls, controller.numbers
    if controller.plan is not None and len(controller.plan) > num_controls:
        raise ControllerError(
            f"the plan of {controller.name!r} has {len(controller.plan)} forces, the flight {num_controls} "
            "control periods; shorten the plan or lengthen duration_s"
        )
    forces = np.zeros((0 if controller.plan is None else 1, num_controls, 3))
    if controller.plan is not None:
        forces[0, : len(controller.plan)] = controller.plan
    signals = np.zeros((len(controller.systems), 3), dtype=np.int64)
    for row, system in zip(signals, controller.systems, strict=True):
        slots = [slot(variable.name) for variable in system.inputs]
        row[:] = (slots + [slots[-1]] * 3)[:3]
    check_tour(controller, mission)
    rehearsal_stride(controller, mission)  # its rehearsals must fit its decisions
    return Law(
        axes=np.array([AXES[system.outputs[0].name] for system in controller.systems], dtype=np.int64),
        signals=signals,
        needs=reduce(or_, (SIGNALS[name].needs for name in sensed_by(controller)), NOTHING),
        num_inputs=np.array([len(system.inputs) for system in controller.systems], dtype=np.int64),
        layout=numbers.layout,
        constants=numbers.values.shape[1] - len(CONSTANTS) if has_constants(controller) else -1,
        decision_stride=decision_stride(controller, mission),
        force_axes=FORCE_AXES[controller.force_axes],
        has_plan=controller.plan is not None or controller.is_of_a_kind or controller.pilot is not None,
        plans=played(forces, controller.turns),
    )


def played(forces: Floats, turns: Turns = AIMED) -> Plans:
    """Return plans of forces, shape (m or 1, K, 3), and of turns, that are played open loop."""
    return Plans(forces, np.zeros((0, forces.shape[1], 6)), np.zeros((3, 6)), 0.0, turns)


def has_constants(controller: Controller) -> bool:
    """Return whether a controller sets any of `CONSTANTS`."""
    return controller.fuzzy is not None and any(name in CONSTANTS for name, _ in controller.fuzzy.attributes)


def _constants_of(controller: Controller) -> Floats:
    attributes = dict(controller.fuzzy.attributes) if controller.fuzzy else {}
    values = np.zeros(len(CONSTANTS))
    for index, (name, kind) in enumerate(CONSTANTS.items()):
        text = attributes.get(name, "0")
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
            "for the tour and its mirror image through the orbit plane, 4 for both the other way round too"
        )
    for name in ("rehearsal_draws", "rehearsal_shapes"):
        if values[constant(name)] % 1.0 != 0.0:
            raise ControllerError(
                f"controller {controller.name!r} has {name} {attributes[name]!r}; give a whole number"
            )
    if values[constant("rehearsal_reach_m_s")] > 0.0 and controller.force_axes != "hill":
        raise ControllerError(
            f"controller {controller.name!r} rehearses its first push with force_axes "
            f"{controller.force_axes}; set the attribute force_axes to hill, which the pushes are along"
        )
    return values


def rehearsed_pushes(controller: Controller) -> Floats:
    """Return the candidate first pushes of a rehearsal, shape (n, 3), m/s, Hill axes; none by default.

    The first row is no push.
    """
    reach = float(controller.constants[constant("rehearsal_reach_m_s")])
    parts = np.array(list(product(*REHEARSED_PARTS)))
    return reach * parts if reach > 0.0 else np.zeros((0, 3))


def decision_stride(controller: Controller, mission: Mission) -> int:
    """Return the control periods from one decision to the next; 1 unless ``decision_period_s`` is set.

    Raises
    ------
    ControllerError
        If ``decision_period_s`` is not a whole number of control periods.
    """
    decision_period = float(controller.constants[constant("decision_period_s")])
    periods = decision_period / mission.control_period_s
    if abs(periods - round(periods)) > 1e-6:
        raise ControllerError(
            f"controller {controller.name!r} has decision_period_s {decision_period:g}; give a whole number "
            f"of control periods of {mission.control_period_s:g} s, or leave it out to decide in each"
        )
    return max(1, round(periods))


def rehearsal_stride(controller: Controller, mission: Mission) -> int:
    """Return the control periods from one rehearsal of tours to the next; 0 without ``rehearsal_period_s``.

    Raises
    ------
    ControllerError
        If ``rehearsal_period_s`` is not a whole number of times from one decision to the next.
    """
    period = float(controller.constants[constant("rehearsal_period_s")])
    stride = decision_stride(controller, mission)
    decision_period = stride * mission.control_period_s
    decisions = period / decision_period
    if abs(decisions - round(decisions)) > 1e-6:
        raise ControllerError(
            f"controller {controller.name!r} has rehearsal_period_s {period:g}; give a multiple of the "
            f"{decision_period:g} s from one decision to the next, or leave it out to rehearse once"
        )
    return round(decisions) * stride


def check_tour(controller: Controller, mission: Mission) -> None:
    """Raise ControllerError for times from half an orbit on: no push across the track leads onto the tour."""
    half = pi / mission.orbit.mean_motion_rad_s
    for name in ("tour_time_s", "tour_wait_s", "rehearsal_slowest_s"):
        time = float(controller.constants[constant(name)])
        if time >= half:
            raise ControllerError(
                f"controller {controller.name!r} has {name} {time:g}; give less than half an orbit, "
                f"{half:.0f} s"
            )


def sensed_by(controller: Controller) -> list[str]:
    """Return the signals that a controller's systems sense, one per input."""
    return [variable.name for system in controller.systems for variable in system.inputs]


def about_points(controller: Controller) -> list[str]:
    """Return the signals that a controller senses of points yet to be inspected."""
    about = URGENCY | SETTING | TOUR
    return [signal for signal in sensed_by(controller) if SIGNALS[signal].needs & about]


#: flies plans up to a sample; returns what the deputies know there, shape (m, 6), m and m/s, Hill axes
Fly = Callable[[int, Plans], Floats]


def planned(
    planner: Planner, num_controls: int, scenarios: list[Scenario], fly: Fly, workers: int | None
) -> Plans:
    """Return the plans of flights whose forces are planned during the flight, of so many control periods.

    `fly` flies plans from these starts; `workers` threads plan, one per processor unless given.
    """
    plans = played(np.zeros((len(scenarios), num_controls, 3)))
    decisions = list(planner.decisions)
    for decision, following in zip(decisions, [*decisions[1:], num_controls], strict=True):
        known = fly(decision, plans)

        def plan(case: int, known: Floats = known, now: int = decision, then: int = following) -> None:
            forces = planner(scenarios[case], now, known[case])[: then - now]
            plans.forces[case, now : now + len(forces)] = forces

        in_threads(plan, range(len(scenarios)), workers=workers)
    return plans
