"""The thrust logic in lanes: from signals to the force before the safety layer; `fis_tools.model.thrust`."""

from typing import Any

import numpy as np

from fis_tools.compiled.decorator import compiled
from fis_tools.compiled.three import Three, load_three, same, store_three
from fis_tools.compiled.vectors import load, select, some, store, width_of
from fis_tools.engines.kernel import infer
from pipeline.array_types import Floats
from pipeline.flight.period.decide.parking import PARK_PUSH, may_park
from pipeline.flight.period.decide.preview import FARTHEST, MISSED, NEAREST
from pipeline.flight.state.arrays import Control, Law, Moment, Plans, constant_of
from pipeline.flight.state.lanes import clip_three, flight_of, load_quaternion, load_row
from pipeline.flight.state.signals import BODY, FIRST_DEAD_BAND, constant
from pipeline.physics.quaternion import to_hill

COAST_BELOW, COAST_MARGIN = constant("coast_below_points"), constant("coast_margin_m")


@compiled(error_model="numpy")
def is_decision(law: Law, k: int) -> bool:
    """Return whether a force is decided on at a sample; between two such samples nothing is fired."""
    return k % law.decision_stride == 0


@compiled(error_model="numpy")
def may_coast(control: Control) -> bool:
    """Return whether a controller coasts when coasting shows enough."""
    return constant_of(control, COAST_BELOW) > 0.0


@compiled(error_model="numpy", forceinline=True)
def decide_to_coast(now: Moment, control: Control, signals: Floats) -> None:
    """Mark lanes that infer nothing: all is seen, coasting will show enough, or one parks."""
    world, lanes = now.world, now.state.lanes
    width = width_of(lanes)
    coasts = load_row(lanes.num_unseen) < (1.0 if world.coasts_when_complete else 0.0)
    if may_coast(control):
        margin = constant_of(control, COAST_MARGIN)
        is_enough = load(signals, MISSED, width) < constant_of(control, COAST_BELOW)
        is_enough &= load(signals, NEAREST, width) >= world.min_distance + margin
        is_enough &= load(signals, FARTHEST, width) <= world.max_distance - margin
        coasts |= is_enough
    if may_park(control):
        coasts |= load_row(lanes.parks) > 0.0
    store(lanes.coasts, 0, select(coasts, 1.0, 0.0))


@compiled(error_model="numpy")
def follow_plans(now: Moment, plans: Plans) -> None:
    """Request the planned forces, plus the feedback on the known deviation from the path."""
    state, belief, known, k = now.state, now.state.belief, np.empty(6), now.k
    for lane in range(width_of(state.lanes)):
        flight = flight_of(now, lane)
        for axis in range(3):
            known[axis], known[3 + axis] = belief.position[axis, lane], belief.velocity[axis, lane]
        for axis in range(3):
            answer = 0.0
            if len(plans.paths) > 0:
                for component in range(6):
                    answer -= plans.gain[axis, component] * (
                        known[component] - plans.paths[flight, k, component]
                    )
            planned = plans.forces[flight if len(plans.forces) > 1 else 0, k, axis]
            state.lanes.requested[axis, lane] = planned + (
                answer if abs(answer) >= plans.least_answer else 0.0
            )


@compiled(error_model="numpy", forceinline=True)
def infer_forces(now: Moment, control: Control, signals: Floats, outputs: Floats, scratch: Any) -> None:
    """Infer each system's output from `signals`; request what is beyond its dead band and does not coast."""
    law, lanes = control.law, now.state.lanes
    inference, width = scratch[0], width_of(lanes)
    fires = load_row(lanes.coasts) == 0.0
    if not some(fires):
        return
    for system in range(len(law.axes)):
        for column in range(3):
            store(inference.inputs, column, load(signals, law.signals[system, column], width))
        infer(control.values, control.rules, law.layout, system, scratch)
        axis = law.axes[system]
        dead_band = constant_of(control, FIRST_DEAD_BAND + axis)
        output = load_row(inference.output)
        store(outputs, system, output)
        fired = select(fires & (abs(output) >= dead_band), output, 0.0)
        store(lanes.requested, axis, load(lanes.requested, axis, width) + fired)


@compiled(error_model="numpy", forceinline=True)
def park(now: Moment, signals: Floats) -> None:
    """Request the push that parks, in the lanes that do."""
    lanes = now.state.lanes
    width, parks = width_of(lanes), load_row(lanes.parks) > 0.0
    for axis in range(3):
        force = load(signals, PARK_PUSH + axis, width) / now.world.delta_v_per_force
        store(lanes.requested, axis, select(parks, force, load(lanes.requested, axis, width)))


@compiled(error_model="numpy", forceinline=True)
def command(now: Moment, control: Control, signals: Floats, outputs: Floats, scratch: Any) -> None:
    """Write the forces of all lanes as requested, and as commanded: in Hill axes, clipped."""
    law, lanes = control.law, now.state.lanes
    store_three(lanes.requested, 0, same(0.0, width_of(lanes)))
    if law.has_plan:
        follow_plans(now, law.plans)
    elif is_decision(law, now.k):
        infer_forces(now, control, signals, outputs, scratch)
        if may_park(control):
            park(now, signals)
    force = load_three(lanes.requested, 0)
    if law.force_axes == BODY:
        force = to_hill(load_quaternion(now.state.belief.attitude), force)
    store_three(lanes.commanded, 0, clip_three(force, now.world.max_force))


@compiled(error_model="numpy", forceinline=True)
def command_given(now: Moment, force: Three) -> None:
    """Command forces given from outside, N, Hill axes, clipped."""
    store_three(now.state.lanes.requested, 0, force)
    store_three(now.state.lanes.commanded, 0, clip_three(force, now.world.max_force))
