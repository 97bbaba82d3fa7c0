"""The thrust logic in lanes: from signals to the force before the safety layer; `fis_tools.model.thrust`."""

import numpy as np

from fis_tools.compiled.decorator import compiled
from fis_tools.compiled.three import Three, load_three, same, store_three
from fis_tools.compiled.vectors import load, select, some, store, width_of
from fis_tools.engines.kernel import infer
from pipeline.array_types import Floats, Integers
from pipeline.flight.state.arrays import Law, Plans, State, Workspace, World
from pipeline.flight.state.lanes import clip_three, four, one, to_hill
from pipeline.flight.state.signals import BODY, FIRST_DEAD_BAND, constant, slot

MISSED, NEAREST, FARTHEST = slot("missed"), slot("coasting_nearest"), slot("coasting_farthest")
COAST_BELOW, COAST_MARGIN = constant("coast_below_points"), constant("coast_margin_m")


@compiled(error_model="numpy")
def is_decision(law: Law, k: int) -> bool:
    """Return whether a force is decided on at a sample; between two such samples nothing is fired."""
    return k % law.decision_stride == 0


@compiled(error_model="numpy")
def may_coast(law: Law, values: Floats) -> bool:
    """Return whether a controller coasts when coasting shows enough."""
    return law.constants >= 0 and values[law.constants + COAST_BELOW] > 0.0


@compiled(error_model="numpy", forceinline=True)
def decide_to_coast(world: World, law: Law, values: Floats, state: State, work: Workspace) -> None:
    """Mark the lanes that fire nothing: all is seen, or coasting will show enough inside the limits."""
    lanes, signals = state.lanes, work.signals
    width = width_of(lanes)
    coasts = one(lanes.num_unseen) < (1.0 if world.coasts_when_complete else 0.0)
    if may_coast(law, values):
        margin = values[law.constants + COAST_MARGIN]
        is_enough = load(signals, MISSED, width) < values[law.constants + COAST_BELOW]
        is_enough &= load(signals, NEAREST, width) >= world.min_distance + margin
        is_enough &= load(signals, FARTHEST, width) <= world.max_distance - margin
        coasts |= is_enough
    store(lanes.coasts, 0, select(coasts, 1.0, 0.0))


@compiled(error_model="numpy")
def follow_plans(plans: Plans, state: State, first: int, num_lanes: int, k: int) -> None:
    """Command the planned forces, plus the feedback on the known deviation from the path."""
    belief, known = state.belief, np.empty(6)
    for lane in range(width_of(state.lanes)):
        flight = first + min(lane, num_lanes - 1)
        for axis in range(3):
            known[axis], known[3 + axis] = belief.position[axis, lane], belief.velocity[axis, lane]
        # element by element: whole arrays take a second and a half longer to compile
        for place in range(6 if len(plans.known) > 0 else 0):
            plans.known[flight, k, place] = known[place]
        for axis in range(3):
            answer = 0.0
            if len(plans.paths) > 0:
                for place in range(6):
                    answer -= plans.gain[axis, place] * (known[place] - plans.paths[flight, k, place])
            planned = plans.forces[flight if len(plans.forces) > 1 else 0, k, axis]
            state.lanes.asked[axis, lane] = planned + (answer if abs(answer) >= plans.least_answer else 0.0)


@compiled(error_model="numpy", forceinline=True)
def infer_forces(law: Law, values: Floats, rules: Integers, state: State, work: Workspace) -> None:
    """Infer what each system asks for, and command what is beyond its dead band and does not coast."""
    lanes, room, width = state.lanes, work.scratch[0], width_of(state.lanes)
    fires = one(lanes.coasts) == 0.0
    if not some(fires):
        return
    for system in range(len(law.axes)):
        for place in range(3):
            store(room.inputs, place, load(work.signals, law.signals[system, place], width))
        infer(values, rules, law.layout, system, work.scratch)
        axis = law.axes[system]
        dead_band = values[law.constants + FIRST_DEAD_BAND + axis] if law.constants >= 0 else 0.0
        output = one(room.output)
        store(work.outputs, system, output)
        fired = select(fires & (abs(output) >= dead_band), output, 0.0)
        store(lanes.asked, axis, load(lanes.asked, axis, width) + fired)


@compiled(error_model="numpy", forceinline=True)
def command(
    world: World,
    law: Law,
    values: Floats,
    rules: Integers,
    state: State,
    work: Workspace,
    first: int,
    num_lanes: int,
    k: int,
) -> None:
    """Write the forces of all lanes as asked for, and as commanded: in Hill axes, clipped."""
    lanes = state.lanes
    store_three(lanes.asked, 0, same(0.0, width_of(lanes)))
    if law.has_plan:
        follow_plans(law.plans, state, first, num_lanes, k)
    elif is_decision(law, k):
        infer_forces(law, values, rules, state, work)
    force = load_three(lanes.asked, 0)
    if law.force_axes == BODY:
        force = to_hill(four(state.belief.attitude), force)
    store_three(lanes.commanded, 0, clip_three(force, world.max_force))


@compiled(error_model="numpy", forceinline=True)
def command_given(world: World, state: State, force: Three) -> None:
    """Command forces given from outside, N, Hill axes, clipped."""
    store_three(state.lanes.asked, 0, force)
    store_three(state.lanes.commanded, 0, clip_three(force, world.max_force))
