"""What compiled flights need to know of a controller: its law, plans, decision and rehearsal periods.

A planner is plain Python, and the state at a decision is known only after flying up to there. So flights are
flown up to a decision, their forces are planned, and they are flown again up to the next one. Flights are
reproducible to the last digit, so the final flight is a closed loop.
"""

from collections.abc import Callable
from functools import reduce
from itertools import product
from math import pi
from operator import or_

import numpy as np

from pipeline.array_types import Floats
from pipeline.flight.control.controller import (
    Controller,
    ControllerError,
    OpenLoopController,
    Planner,
    RuleController,
    has_constants,
    sensed_by,
)
from pipeline.flight.state.arrays import AIMED, Law, Plans, Turns
from pipeline.flight.state.log import Scenario
from pipeline.flight.state.signals import AXES, CONSTANTS, FORCE_AXES, NOTHING, SIGNALS, constant, slot
from pipeline.settings.experiment import Mission
from pipeline.threads import in_threads

#: fractions of the reach that the candidate first pushes of a rehearsal have along each Hill axis; radial
#: pushes gain most, pushes across the orbit plane least
REHEARSED_PARTS = (
    (0.0, 1 / 3, -1 / 3, 2 / 3, -2 / 3, 1.0, -1.0),
    (0.0, 0.25, -0.25, 0.5, -0.5),
    (0.0, 0.25, -0.25),
)


def law_of(controller: Controller, mission: Mission) -> Law:
    """Return the structure of a controller as compiled flights read it: everything but its numbers.

    It holds no plans of a planner, a regulator or a pilot yet.

    Raises
    ------
    ControllerError
        If a plan is longer than the flight, decisions do not fall on control periods, or foresight does not
        know the mission's camera or limits.
    """
    num_controls, numbers = mission.num_controls, controller.numbers
    plan, turns = None, AIMED
    if isinstance(controller, OpenLoopController):
        plan, turns = controller.plan, controller.turns
    if plan is not None and len(plan) > num_controls:
        raise ControllerError(
            f"the plan of {controller.name!r} has {len(plan)} forces, the flight {num_controls} "
            "control periods; shorten the plan or lengthen duration_s"
        )
    forces = np.zeros((0 if plan is None else 1, num_controls, 3))
    if plan is not None:
        forces[0, : len(plan)] = plan
    signals = np.zeros((len(controller.systems), 3), dtype=np.int64)
    for row, system in zip(signals, controller.systems, strict=True):
        slots = [slot(variable.name) for variable in system.inputs]
        row[:] = (slots + [slots[-1]] * 3)[:3]
    check_tour(controller, mission)
    check_course(controller, mission)
    refusal = mission.refusal_of_plans(f"the plans of {controller.name!r}, by its foresight_pushes,")
    if controller.constants[constant("foresight_pushes")] > 0.0 and refusal is not None:
        raise ControllerError(refusal)
    for period in ("rehearsal_period_s", "foresight_period_s"):
        ahead_stride(controller, mission, period)  # what it flies ahead must fit its decisions
    return Law(
        axes=np.array([AXES[system.outputs[0].name] for system in controller.systems], dtype=np.int64),
        signals=signals,
        needs=reduce(or_, (SIGNALS[name].needs for name in sensed_by(controller)), NOTHING),
        num_inputs=np.array([len(system.inputs) for system in controller.systems], dtype=np.int64),
        layout=numbers.layout,
        constants=numbers.values.shape[1] - len(CONSTANTS) if has_constants(controller) else -1,
        decision_stride=decision_stride(controller, mission),
        force_axes=FORCE_AXES[controller.force_axes],
        has_plan=not isinstance(controller, RuleController),
        plans=played(forces, turns),
    )


def played(forces: Floats, turns: Turns = AIMED) -> Plans:
    """Return plans of forces, shape (m or 1, K, 3), and of turns, that are played open loop."""
    return Plans(forces, np.zeros((0, forces.shape[1], 6)), np.zeros((3, 6)), 0.0, turns)


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


def ahead_stride(controller: Controller, mission: Mission, name: str) -> int:
    """Return the control periods from one look ahead to the next; 0 for one at the start alone.

    The constant of that name, ``rehearsal_period_s`` or ``foresight_period_s``, is the time between them.

    Raises
    ------
    ControllerError
        If it is not a whole number of times from one decision to the next.
    """
    period = float(controller.constants[constant(name)])
    stride = decision_stride(controller, mission)
    decision_period = stride * mission.control_period_s
    decisions = period / decision_period
    if abs(decisions - round(decisions)) > 1e-6:
        raise ControllerError(
            f"controller {controller.name!r} has {name} {period:g}; give a multiple of the "
            f"{decision_period:g} s from one decision to the next, or leave it out to look ahead once"
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


def check_course(controller: Controller, mission: Mission) -> None:
    """Raise ControllerError for what a controller computes by a circle's motion, where that leads astray."""
    what = ""
    if "closest_approach" in sensed_by(controller):
        what = "senses closest_approach, which is that of a circular orbit"
    elif controller.constants[constant("park_below_points")] > 0.0:
        what = "parks on an ellipse that is closed about a circular orbit alone"
    if what and mission.has_true_course:
        raise ControllerError(
            f"controller {controller.name!r} {what}, and orbit.eccentricity is "
            f"{mission.orbit.elements.eccentricity:g}; choose another controller, or set "
            "orbit.course=uniform to take the orbit as a circle"
        )


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
