"""The thrust logic on lanes: from what is sensed to the force before the safety layer, and why.

`fis_tools.model.thrust` says what it is, `pipeline.flight.reference.thrust` is the readable twin.
"""

import numpy as np
from numpy.typing import NDArray

from fis_tools.engines.compiled import compiled
from fis_tools.engines.kernel import LANES, infer
from fis_tools.model.thrust import SILENT_N
from pipeline.flight.kernel.arrays import (
    COASTS,
    FX,
    FY,
    FZ,
    GX,
    GY,
    GZ,
    LEFT,
    Q1,
    Q2,
    Q3,
    Q4,
    Law,
    Workspace,
    World,
)
from pipeline.flight.kernel.attitude import clip
from pipeline.flight.log import (
    CLIPPED,
    COASTING,
    COMPLETE,
    DEAD_BAND,
    FIRED,
    LEAST_CHANGE_N,
    SAFETY,
    SILENT,
    WAITING,
    FlightLog,
)
from pipeline.flight.signals import BODY, FIRST_DEAD_BAND, HILL, constant, slot

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

MISSED, NEAREST, FARTHEST = slot("missed"), slot("coasting_nearest"), slot("coasting_farthest")
COAST_BELOW, COAST_MARGIN = constant("coast_below_points"), constant("coast_margin_m")


@compiled(error_model="numpy")
def is_decision(law: Law, k: int) -> bool:
    """Tell whether a force is decided on at a sample; between two such samples nothing is fired."""
    return k % law.decision_stride == 0


@compiled(error_model="numpy")
def may_coast(law: Law, values: Floats) -> bool:
    """Tell whether a controller coasts where that shows enough."""
    return law.constants >= 0 and values[law.constants + COAST_BELOW] > 0.0


@compiled(error_model="numpy", forceinline=True, fastmath={"contract"})
def decide_to_coast(world: World, law: Law, values: Floats, work: Workspace) -> None:
    """Tell which lanes fire nothing: all is seen, or coasting will show enough inside the limits."""
    lanes, signals = work.lanes, work.signals
    for i in range(LANES):
        lanes[COASTS + i] = 1.0 if world.coasts_when_complete and lanes[LEFT + i] == 0.0 else 0.0
    if may_coast(law, values):
        most = values[law.constants + COAST_BELOW]
        nearest = world.min_distance + values[law.constants + COAST_MARGIN]
        farthest = world.max_distance - values[law.constants + COAST_MARGIN]
        for i in range(LANES):
            if (
                signals[LANES * MISSED + i] < most
                and signals[LANES * NEAREST + i] >= nearest
                and signals[LANES * FARTHEST + i] <= farthest
            ):
                lanes[COASTS + i] = 1.0


@compiled(error_model="numpy", forceinline=True, fastmath={"contract"})
def command(  # noqa: PLR0912 - one for each kind of law, and one for the log
    world: World,
    law: Law,
    values: Floats,
    rules: Integers,
    work: Workspace,
    num_lanes: int,
    log: FlightLog,
    k: int,
) -> None:
    """Infer the forces of all lanes, where one is decided on, and turn them to Hill axes, clipped."""
    lanes, signals, inputs, outputs = work.lanes, work.signals, work.inputs, work.outputs
    is_logged = len(log.position_m) > 0
    for i in range(3 * LANES):
        lanes[GX + i] = 0.0
    if law.has_plan:
        for axis in range(3):
            for i in range(LANES):
                lanes[GX + LANES * axis + i] = law.plan[k, axis]
    elif is_decision(law, k):
        for system in range(len(law.axes)):
            for place in range(3):
                signal = LANES * law.signals[system, place]
                for i in range(LANES):
                    inputs[LANES * place + i] = signals[signal + i]
            infer(values, rules, law.layout, system, inputs, work.scratch, outputs)
            force = GX + LANES * law.axes[system]
            band = FIRST_DEAD_BAND + law.axes[system]
            dead_band = values[law.constants + band] if law.constants >= 0 else 0.0
            for i in range(num_lanes):
                is_still = lanes[COASTS + i] > 0.0 or abs(outputs[i]) < dead_band
                lanes[force + i] += 0.0 if is_still else outputs[i]
            if is_logged and lanes[COASTS] == 0.0:
                log.is_decided[k] = True
                log.force_asked_n[k, law.axes[system]] = outputs[0]
                log.fis_output_n[k, system] = outputs[0]
                for place in range(law.num_inputs[system]):
                    log.fis_input[k, system, place] = inputs[LANES * place]
    for i in range(LANES):
        gx, gy, gz = lanes[GX + i], lanes[GY + i], lanes[GZ + i]
        q1, q2, q3, q4 = lanes[Q1 + i], lanes[Q2 + i], lanes[Q3 + i], lanes[Q4 + i]
        fx, fy, fz = gx, gy, gz
        if law.force_axes == BODY:
            fx = (q1 * q1 - q2 * q2 - q3 * q3 + q4 * q4) * gx
            fx += 2 * (q1 * q2 - q3 * q4) * gy + 2 * (q1 * q3 + q2 * q4) * gz
            fy = 2 * (q1 * q2 + q3 * q4) * gx + (-q1 * q1 + q2 * q2 - q3 * q3 + q4 * q4) * gy
            fy += 2 * (q2 * q3 - q1 * q4) * gz
            fz = 2 * (q1 * q3 - q2 * q4) * gx + 2 * (q2 * q3 + q1 * q4) * gy
            fz += (-q1 * q1 - q2 * q2 + q3 * q3 + q4 * q4) * gz
        lanes[FX + i] = clip(fx, world.max_force)
        lanes[FY + i] = clip(fy, world.max_force)
        lanes[FZ + i] = clip(fz, world.max_force)


@compiled(error_model="numpy", fastmath={"contract"})
def write_thrust(
    world: World, law: Law, values: Floats, work: Workspace, log: FlightLog, k: int, dcm: Floats
) -> None:
    """Log the force of lane 0: as asked for, as applied, and why the two differ; `dcm` turns Hill to body."""
    lanes, signals = work.lanes, work.signals
    for row in range(3):
        log.force_hill_n[k, row] = lanes[FX + LANES * row]
        if law.has_plan:
            log.force_asked_n[k, row] = lanes[GX + LANES * row]
        asked = lanes[GX + LANES * row]
        if law.force_axes == HILL:
            asked = 0.0
            for column in range(3):
                asked += dcm[row, column] * lanes[GX + LANES * column]
        log.force_body_n[k, row] = asked
    is_complete = world.coasts_when_complete and lanes[LEFT] == 0.0
    if not law.has_plan and is_decision(law, k) and not is_complete and may_coast(law, values):
        log.foreseen[k, 0] = signals[LANES * MISSED]
        log.foreseen[k, 1] = signals[LANES * NEAREST]
        log.foreseen[k, 2] = signals[LANES * FARTHEST]
    write_reasons(world, law, lanes, is_complete, log, k, dcm)


@compiled(error_model="numpy", fastmath={"contract"})
def write_reasons(
    world: World, law: Law, lanes: Floats, is_complete: bool, log: FlightLog, k: int, dcm: Floats
) -> None:
    """Log for each component why what lane 0 fires is, or is not, what was asked for."""
    is_clipped, is_changed = np.empty(3, dtype=np.bool_), np.empty(3, dtype=np.bool_)
    for row in range(3):
        wanted = lanes[GX + LANES * row]
        if law.force_axes == BODY:
            wanted = 0.0
            for column in range(3):
                wanted += dcm[column, row] * lanes[GX + LANES * column]
        is_clipped[row] = abs(wanted) > world.max_force
        is_changed[row] = abs(log.safety_force_hill_n[k, row]) > LEAST_CHANGE_N
    for row in range(3):
        reason = FIRED
        if is_complete and not law.has_plan:
            reason = COMPLETE
        elif not law.has_plan and not is_decision(law, k):
            reason = WAITING
        elif not law.has_plan and lanes[COASTS] > 0.0:
            reason = COASTING
        elif abs(log.force_asked_n[k, row]) < SILENT_N:
            reason = SILENT
        elif lanes[GX + LANES * row] == 0.0:
            reason = DEAD_BAND
        if is_clipped[row] or (law.force_axes == BODY and is_clipped.any()):
            reason = CLIPPED
        if is_changed[row] or (law.force_axes == BODY and is_changed.any()):
            reason = SAFETY
        log.reason[k, row] = reason
