"""What became of each component of the force in a logged flight: on the way to a command, and when fired."""

import numpy as np
from numpy.typing import NDArray

from fis_tools.model.thrust import SILENT_N
from pipeline.flight.period.act.actuators import EMPTY
from pipeline.flight.state import log as logs
from pipeline.flight.state.arrays import Law, World
from pipeline.flight.state.errors import ModelErrors
from pipeline.flight.state.log import LEAST_CHANGE_N, FlightLog
from pipeline.flight.state.signals import BODY
from pipeline.physics.quaternion import dcm_b_from_h

Codes = NDArray[np.int64]


def write_reasons(
    world: World, law: Law, errors: ModelErrors | None, log: FlightLog, num_counted: int, is_opened: bool
) -> None:
    """Fill in `FlightLog.command_reason` and `FlightLog.reason` from what else was logged.

    The flight counts so many points; it is opened where the first force was given instead of inferred.
    """
    if not len(log.reason):
        return
    log.command_reason[:] = _of_commands(world, law, log, num_counted, is_opened)
    log.reason[:] = log.command_reason if errors is None else _of_firing(errors, log)


def _of_commands(world: World, law: Law, log: FlightLog, num_counted: int, is_opened: bool) -> Codes:
    """Return why each component was, or was not, commanded; later steps override earlier ones."""
    sensed = log.sensed_quaternion_b_from_h[:-1]
    wanted_h = np.array([dcm_b_from_h(q).T @ body for q, body in zip(sensed, log.force_body_n, strict=True)])
    wanted = log.force_body_n if law.force_axes == BODY else wanted_h
    found = np.where(np.abs(wanted) < SILENT_N, logs.DEAD_BAND, logs.FIRED)
    found[np.abs(log.force_asked_n) < SILENT_N] = logs.SILENT
    if not law.has_plan:
        k = np.arange(len(found))
        is_decision = k % law.decision_stride == 0
        found[is_decision & ~log.is_decided] = logs.COASTING
        found[~is_decision] = logs.WAITING
        if world.coasts_when_complete:
            found[log.is_inspected[:-1].sum(axis=1) == num_counted] = logs.COMPLETE
    if is_opened:
        found[0] = logs.REHEARSED
    for is_changed, reason in (
        (np.abs(wanted_h) > world.max_force + LEAST_CHANGE_N, logs.CLIPPED),
        (np.abs(log.safety_force_hill_n) > LEAST_CHANGE_N, logs.SAFETY),
    ):
        # the turn from body axes mixes the components
        own = is_changed.any(axis=1, keepdims=True) if law.force_axes == BODY else is_changed
        found = np.where(own, reason, found)
    return found


def _of_firing(errors: ModelErrors, log: FlightLog) -> Codes:
    """Return why something was, or was not, fired along each of Hill's axes."""
    is_commanded, is_fired = (np.abs(f) >= SILENT_N for f in (log.force_commanded_n, log.force_hill_n))
    told, count = log.command_reason, len(log.reason)
    # from body axes, three components may add up to nothing along one of Hill's
    found = np.where(np.isin(told, (logs.FIRED, logs.CLIPPED)) & ~is_commanded, logs.SILENT, told)
    delay = min(errors.firing.thrusters.delay, count)
    is_due, due = np.zeros_like(is_commanded), np.full_like(told, logs.FIRED)
    is_due[delay:], due[delay:] = is_commanded[: count - delay], told[: count - delay]
    share_left = log.mass_kg[:-1, np.newaxis] / log.mass_kg[0] - errors.firing.thrusters.dry
    found = np.where(is_commanded, logs.DELAYED, found)
    found = np.where(is_due, np.where(share_left > EMPTY, logs.BELOW_LEAST_IMPULSE, logs.EMPTY_TANK), found)
    as_commanded = np.isin(due, (logs.CLIPPED, logs.SAFETY, logs.REHEARSED)) & is_due
    return np.where(is_fired, np.where(as_commanded, due, logs.FIRED), found)
