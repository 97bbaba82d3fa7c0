"""The thrust logic in lanes: from signals to the force before the safety layer, and the reasons.

`fis_tools.model.thrust` describes it; `pipeline.flight.reference.thrust` is the readable twin.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from fis_tools.compiled.decorator import compiled
from fis_tools.compiled.vectors import load, select, some, splat, store, width_of
from fis_tools.engines.kernel import infer
from fis_tools.model.thrust import SILENT_N
from pipeline.flight.state.arrays import Law, Plans, Workspace, World
from pipeline.flight.state.lanes import clip, four, one, three, write_three
from pipeline.flight.state.log import (
    CLIPPED,
    COASTING,
    COMPLETE,
    DEAD_BAND,
    FIRED,
    LEAST_CHANGE_N,
    REHEARSED,
    SAFETY,
    SILENT,
    WAITING,
    FlightLog,
)
from pipeline.flight.state.signals import BODY, FIRST_DEAD_BAND, HILL, constant, slot

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

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
def decide_to_coast(world: World, law: Law, values: Floats, work: Workspace) -> None:
    """Mark the lanes that fire nothing: all is seen, or coasting will show enough inside the limits."""
    width = width_of(work.lanes)
    lanes, signals = work.lanes, work.signals
    coasts = one(lanes.num_unseen) < (1.0 if world.coasts_when_complete else 0.0)
    if may_coast(law, values):
        margin = values[law.constants + COAST_MARGIN]
        is_enough = load(signals, MISSED, width) < values[law.constants + COAST_BELOW]
        is_enough &= load(signals, NEAREST, width) >= world.min_distance + margin
        is_enough &= load(signals, FARTHEST, width) <= world.max_distance - margin
        coasts |= is_enough
    store(lanes.coasts, 0, select(coasts, 1.0, 0.0))


@compiled(error_model="numpy")
def follow_plans(plans: Plans, work: Workspace, first: int, num_lanes: int, k: int) -> None:
    """Command the planned forces, plus the feedback on the known deviation from the path."""
    width = width_of(work.lanes)
    lanes, state = work.lanes, np.empty(6)
    for lane in range(width):
        flight = first + min(lane, num_lanes - 1)
        for axis in range(3):
            state[axis], state[3 + axis] = lanes.position[axis, lane], lanes.velocity[axis, lane]
        # element by element: whole arrays take a second and a half longer to compile
        for place in range(6 if len(plans.known) > 0 else 0):
            plans.known[flight, k, place] = state[place]
        for axis in range(3):
            answer = 0.0
            if len(plans.paths) > 0:
                for place in range(6):
                    answer -= plans.gain[axis, place] * (state[place] - plans.paths[flight, k, place])
            planned = plans.forces[flight if len(plans.forces) > 1 else 0, k, axis]
            lanes.asked[axis, lane] = planned + (answer if abs(answer) >= plans.least_answer else 0.0)


@compiled(error_model="numpy", forceinline=True)
def command(
    world: World,
    law: Law,
    values: Floats,
    rules: Integers,
    work: Workspace,
    first: int,
    num_lanes: int,
    log: FlightLog,
    k: int,
) -> None:
    """Infer the forces of all lanes, where one is decided on, and turn them to Hill axes, clipped."""
    width = width_of(work.lanes)
    lanes, room = work.lanes, work.scratch[0]
    is_logged = len(log.position_m) > 0
    for axis in range(3):
        store(lanes.asked, axis, splat(0.0, width))
    if law.has_plan:
        follow_plans(law.plans, work, first, num_lanes, k)
    fires = one(lanes.coasts) == 0.0
    if not law.has_plan and is_decision(law, k) and some(fires):
        for system in range(len(law.axes)):
            for place in range(3):
                store(room.inputs, place, load(work.signals, law.signals[system, place], width))
            infer(values, rules, law.layout, system, work.scratch)
            axis = law.axes[system]
            dead_band = values[law.constants + FIRST_DEAD_BAND + axis] if law.constants >= 0 else 0.0
            output = one(room.output)
            fired = select(fires & (abs(output) >= dead_band), output, 0.0)
            store(lanes.asked, axis, load(lanes.asked, axis, width) + fired)
            if is_logged and lanes.coasts[0] == 0.0:
                log.is_decided[k] = True
                log.force_asked_n[k, axis] = room.output[0]
                log.fis_output_n[k, system] = room.output[0]
                for place in range(law.num_inputs[system]):
                    log.fis_input[k, system, place] = room.inputs[place, 0]
    fx, fy, fz = three(lanes.asked)
    if law.force_axes == BODY:
        gx, gy, gz = fx, fy, fz
        q1, q2, q3, q4 = four(lanes.attitude)
        fx = (q1 * q1 - q2 * q2 - q3 * q3 + q4 * q4) * gx
        fx += 2 * (q1 * q2 - q3 * q4) * gy + 2 * (q1 * q3 + q2 * q4) * gz
        fy = 2 * (q1 * q2 + q3 * q4) * gx + (-q1 * q1 + q2 * q2 - q3 * q3 + q4 * q4) * gy
        fy += 2 * (q2 * q3 - q1 * q4) * gz
        fz = 2 * (q1 * q3 - q2 * q4) * gx + 2 * (q2 * q3 + q1 * q4) * gy
        fz += (-q1 * q1 - q2 * q2 + q3 * q3 + q4 * q4) * gz
    limit = world.max_force
    write_three(lanes.force, 0, clip(fx, limit), clip(fy, limit), clip(fz, limit))


@compiled(error_model="numpy")
def write_thrust(
    world: World, law: Law, values: Floats, work: Workspace, log: FlightLog, k: int, dcm: Floats
) -> None:
    """Log the force of lane 0: as asked for, as applied, and why the two differ; `dcm` turns Hill to body."""
    lanes, signals = work.lanes, work.signals
    for row in range(3):
        log.force_hill_n[k, row] = lanes.force[row, 0]
        if law.has_plan:
            log.force_asked_n[k, row] = lanes.asked[row, 0]
        asked = lanes.asked[row, 0]
        if law.force_axes == HILL:
            asked = 0.0
            for column in range(3):
                asked += dcm[row, column] * lanes.asked[column, 0]
        log.force_body_n[k, row] = asked
    is_complete = world.coasts_when_complete and lanes.num_unseen[0] == 0.0
    if not law.has_plan and is_decision(law, k) and not is_complete and may_coast(law, values):
        log.foreseen[k, 0] = signals[MISSED, 0]
        log.foreseen[k, 1] = signals[NEAREST, 0]
        log.foreseen[k, 2] = signals[FARTHEST, 0]
    write_reasons(world, law, lanes, is_complete, log, k, dcm)


@compiled(error_model="numpy")
def write_reasons(
    world: World, law: Law, lanes: Any, is_complete: bool, log: FlightLog, k: int, dcm: Floats
) -> None:
    """Log for each component of lane 0 why the force asked for was, or was not, fired."""
    is_clipped, is_changed = np.empty(3, dtype=np.bool_), np.empty(3, dtype=np.bool_)
    for row in range(3):
        wanted = lanes.asked[row, 0]
        if law.force_axes == BODY:
            wanted = 0.0
            for column in range(3):
                wanted += dcm[column, row] * lanes.asked[column, 0]
        is_clipped[row] = abs(wanted) > world.max_force
        is_changed[row] = abs(log.safety_force_hill_n[k, row]) > LEAST_CHANGE_N
    for row in range(3):
        reason = FIRED
        if log.reason[k, row] == REHEARSED:
            reason = REHEARSED
        elif is_complete and not law.has_plan:
            reason = COMPLETE
        elif not law.has_plan and not is_decision(law, k):
            reason = WAITING
        elif not law.has_plan and lanes.coasts[0] > 0.0:
            reason = COASTING
        elif abs(log.force_asked_n[k, row]) < SILENT_N:
            reason = SILENT
        elif lanes.asked[row, 0] == 0.0:
            reason = DEAD_BAND
        if is_clipped[row] or (law.force_axes == BODY and is_clipped.any()):
            reason = CLIPPED
        if is_changed[row] or (law.force_axes == BODY and is_changed.any()):
            reason = SAFETY
        log.reason[k, row] = reason
