"""What thrusters make of a command (docs/explanation/navigation.md, thrusters)."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.spatial.transform import Rotation

from pipeline.array_types import Booleans, Floats
from pipeline.constants import STANDARD_GRAVITY_M_S2
from pipeline.flight.reference.flight import ReferenceFlight
from pipeline.settings.equipment import RealActuators

#: propellant that rounding leaves, as a share of the mass at the start
EMPTY = 1e-12


@dataclass
class Thrust:
    """A control period's thrust: N along Hill's axes, where it acts, m, and its torque, N m, body axes.

    `total` is the sum of all thrusters' forces, N, `reported` what those of a layout report, before errors
    that nobody knows, and `share` what the tank held of the burn.
    """

    commanded: Floats
    fired: Floats
    total: float
    arm: Floats = field(default_factory=lambda: np.zeros(3))
    twist: Floats = field(default_factory=lambda: np.zeros(3))
    reported: Floats = field(default_factory=lambda: np.zeros(3))
    share: float = 1.0


def in_impulses(law: RealActuators, period: float, force: Floats) -> Floats:
    """Return forces, held over a period, in whole impulses, zero below the least."""
    if law.impulse_step_n_s > 0.0:
        step = law.impulse_step_n_s / period
        force = np.rint(force / step) * step
    return np.where(np.abs(force) >= law.least_impulse_n_s / period, force, 0.0)


def delay_periods(flight: ReferenceFlight) -> int:
    """Return the control periods from a command to its force."""
    law = flight.mission.actuators
    return flight.periods(law.delay_s) if isinstance(law, RealActuators) else 0


def fired(
    flight: ReferenceFlight,
    k: int,
    commanded: Floats,
    commands: Sequence[Floats],
    attitude: Rotation,
    mass: float,
) -> Thrust:
    """Return the thrust of a control period; `commands` are those of all so far, this one last.

    The last burn is weakened to what the tank still holds.
    """
    law, limit = flight.mission.actuators, flight.mission.deputy.max_force_n
    if not isinstance(law, RealActuators):
        return Thrust(commanded, commands[-1], float(np.abs(commands[-1]).sum()))
    arm, delay, period = flight.errors.arm, flight.periods(law.delay_s), flight.mission.control_period_s
    full = flight.mission.deputy.mass_kg
    left = np.inf if law.specific_impulse_s is None else mass - (full - law.propellant_kg)
    if k < delay or left <= EMPTY * full:
        return Thrust(commanded, np.zeros(3), 0.0, arm)
    errors, command = flight.errors.thrust(k), commands[k - delay]
    if law.thrusters is None:
        force = np.clip(in_impulses(law, period, errors @ command), -limit, limit)
        thrust = Thrust(commanded, force, float(np.abs(force).sum()), arm)
    else:
        thrust = divided(flight, law, commanded, attitude, command, k)
    used = mass - mass_after(flight, thrust, mass)
    share = left / used if used > left else 1.0
    force = share * thrust.fired
    fired = force if law.thrusters is None else errors @ force
    return Thrust(commanded, fired, share * thrust.total, arm, share * thrust.twist, force, share)


def divided(
    flight: ReferenceFlight, law: RealActuators, commanded: Floats, attitude: Rotation, wanted: Floats, k: int
) -> Thrust:
    """Return the thrust of a layout: shares by a table, all reduced where one thruster is not enough.

    One that has failed fires nothing.
    """
    rows = np.array(law.thrusters)
    directions, most = rows[:, 3:6], rows[:, 6]
    body = attitude.inv().apply(wanted)
    needed = flight.errors.table @ np.concatenate((np.maximum(body, 0.0), np.maximum(-body, 0.0)))
    share = min(1.0, float(np.min(most / np.maximum(needed, most))))
    forces = in_impulses(law, flight.mission.control_period_s, needed * share)
    if law.failed_thruster is not None and flight.time(k) >= law.failure_s:
        forces[law.failed_thruster] = 0.0
    twist = forces @ np.cross(rows[:, :3], directions)
    return Thrust(
        commanded, attitude.apply(forces @ directions), float(forces.sum()), flight.errors.arm, twist
    )


def believed(
    flight: ReferenceFlight, command: Floats, thrust: Thrust, sensed_from_true: Rotation, mass: float
) -> tuple[Floats, Booleans]:
    """Return the force that thrusters report for a command, and along which axes they fired.

    Those of a layout report each force, which is turned with the attitude as it is sensed. A force is that on
    the mass at the start.
    """
    law, full = flight.mission.actuators, flight.mission.deputy.mass_kg
    if not isinstance(law, RealActuators):
        return command, np.ones(3, dtype=np.bool_)
    per_mass = 1.0 if law.specific_impulse_s is None else full / mass
    if law.thrusters is not None:
        return sensed_from_true.apply(thrust.reported) * per_mass, np.ones(3, dtype=np.bool_)
    period = flight.mission.control_period_s
    least = max(law.impulse_step_n_s, law.least_impulse_n_s) / period
    known = in_impulses(law, period, command)
    force = np.where((known == 0.0) & (thrust.fired != 0.0), least * np.sign(command), known)
    return force * thrust.share * per_mass, np.asarray(thrust.fired != 0.0)


def mass_after(flight: ReferenceFlight, thrust: Thrust, mass: float) -> float:
    """Return the mass after a control period: propellant leaves at the specific impulse (Tsiolkovsky)."""
    law = flight.mission.actuators
    if not isinstance(law, RealActuators) or law.specific_impulse_s is None:
        return mass
    speed = STANDARD_GRAVITY_M_S2 * law.specific_impulse_s
    return mass - thrust.total * flight.mission.control_period_s / speed
