"""What the deputy knows of its state: a Kalman filter on fixes (docs/explanation/navigation.md)."""

from dataclasses import dataclass, field

import numpy as np
from scipy.spatial.transform import Rotation

from pipeline.array_types import Booleans, Floats
from pipeline.flight.reference.actuators import delay_periods
from pipeline.flight.reference.flight import ReferenceFlight
from pipeline.settings.equipment import FilteredNavigation, PositionFixes, RangeBearingFixes, RealActuators
from pipeline.settings.experiment import Mission

#: factor by which a rejected fix widens the covariance
WIDER = 4.0
#: up to this bias of the attitude, forces are turned to first order
FIRST_ORDER_DEG = 5.0


@dataclass
class Innovation:
    """A fix that comes into use and by how much it is off the expected one, m; `square` in deviations."""

    fix: Floats
    off: Floats
    square: float


@dataclass
class Belief:
    """The filter's state, which lags by the delay of fixes, and what it needs to catch up with now.

    Attributes
    ----------
    state, covariance : (6,), (24, 24)
        The covariance is of the state and, after it, of eighteen constant errors: scales and rotations of the
        thrusters, rotations of the sensed attitude, biases of fixes, and shares of the distance, along the
        body axes, by which rotated bearings shift a fix to second order, and rotated thrusters a force.
    acting : (K, 3)
        Commands in the control periods in which they act, in impulses, fired or not, N.
    has_fired : (K, 3)
        Along which axes anything was fired in a period.
    fixes : list of (3,)
        Measured so far, m.
    sensed : list of (3, 3)
        Body axes as sensed so far, Hill axes, in rows.
    innovation : Innovation or None
        Of the fix that came into use at this sample.
    """

    state: Floats
    covariance: Floats
    acting: Floats
    has_fired: Booleans
    fixes: list[Floats] = field(default_factory=list)
    sensed: list[Floats] = field(default_factory=list)
    innovation: Innovation | None = None


def first_belief(flight: ReferenceFlight, state: Floats) -> Belief:
    """Return the first estimate and its covariance, from the true state."""
    law = flight.mission.filtered
    spread = [law.initial_position_m] * 3 + [law.initial_velocity_m_s] * 3
    shape = flight.mission.num_controls, 3
    covariance = np.diag(np.concatenate((np.square(spread), considered(flight.mission))))
    return Belief(state + flight.errors.at_start, covariance, np.zeros(shape), np.ones(shape, dtype=np.bool_))


def considered(mission: Mission) -> Floats:
    """Return the variances of the constant errors, (18,)."""
    law, real = mission.filtered, mission.actuators if isinstance(mission.actuators, RealActuators) else None
    second = np.sqrt(2.0) * np.radians(law.attitude_bias_deg) ** 2
    deviations = (
        real.scale_error if real else 0.0,
        np.radians(real.misalignment_deg) if real else 0.0,
        np.radians(law.attitude_bias_deg),
        law.bias_m,
        second * isinstance(law, RangeBearingFixes),
        second * (law.attitude_bias_deg > FIRST_ORDER_DEG),
    )
    return np.square(np.repeat(deviations, 3))


def fix(flight: ReferenceFlight, k: int, position: Floats, attitude: Rotation) -> Floats | None:
    """Return a fix at a sample, m, or None between two.

    It is the position, or found by range and bearing with the sensed attitude.
    """
    stride = flight.periods(flight.mission.filtered.fix_period_s)
    if k % stride:
        return None
    errors = flight.errors
    if isinstance(flight.mission.filtered, PositionFixes):
        return position + errors.of_fixes[k // stride]
    error = errors.of_sight[k // stride]
    seen = position + np.cross(error[1:] + attitude.apply(flight.tilt_angles(k)), position)
    seen *= (np.linalg.norm(position) + error[0]) / np.linalg.norm(seen)
    return seen + errors.of_fixes[k // stride]


def estimate(
    flight: ReferenceFlight, k: int, belief: Belief, measured: Floats | None, sensed: Rotation
) -> tuple[Floats, Floats]:
    """Take a fix in, once its delay has passed; return the estimate of the state now, and its covariance."""
    law = flight.mission.filtered
    stride, delay = flight.periods(law.fix_period_s), flight.periods(law.delay_s)
    belief.sensed.append(sensed.apply(np.eye(3)))
    belief.innovation = None
    if measured is not None:
        belief.fixes.append(measured)
    at = k - delay
    if at > 0:
        belief.state, belief.covariance = predicted(flight, belief, belief.state, belief.covariance, at - 1)
    if at >= 0 and at % stride == 0:
        correct(flight, belief, at)
    known = belief.state, belief.covariance
    for period in range(max(at, 0), k):
        known = predicted(flight, belief, *known, period)
    return known[0], known[1][:6, :6]


def predicted(
    flight: ReferenceFlight, belief: Belief, state: Floats, covariance: Floats, period: int
) -> tuple[Floats, Floats]:
    """Return state and covariance a control period later.

    ``x <- Phi x + Gamma f``, ``P <- Phi P Phi' + Q``.
    """
    mission, law = flight.mission, flight.mission.filtered
    force = belief.has_fired[period] * belief.acting[period]
    phi, gamma = flight.step(period)
    tilt = np.radians(law.attitude_noise_deg)
    std, nearest, farthest, growth = flight.errors.process
    share = max(nearest, float(np.linalg.norm(belief.state[:3]))) / farthest
    unknown = (mission.deputy.mass_kg * std * float(np.polyval(growth[::-1], share))) ** 2
    unknown += (law.execution_error**2 + tilt**2) * (force @ force)
    noise, both = np.zeros((24, 24)), np.eye(24)
    noise[:6, :6] = unknown * gamma @ gamma.T
    both[:6, :6], both[:6, 6:] = phi, gamma @ pushes(flight, belief, period)
    turns = np.radians([law.attitude_bias_deg, law.attitude_noise_deg])
    return phi @ state + gamma @ force * (1.0 - turns @ turns), both @ covariance @ both.T + noise


def pushes(flight: ReferenceFlight, belief: Belief, period: int) -> Floats:
    """Return the forces that unit constant errors add, (3, 18): thrusters turn with the body sensed askew."""
    force = belief.acting[period]
    axes = belief.sensed[max(0, period - delay_periods(flight))]
    turned = np.cross(np.eye(3), force).T, np.cross(force, axes).T
    forces = (np.diag(force), *turned, np.zeros((3, 6)), axes.T * (axes @ force))
    return belief.has_fired[period][:, np.newaxis] * np.hstack(forces)


def correct(flight: ReferenceFlight, belief: Belief, at: int) -> None:
    """Correct a belief by a fix: ``K = P H' S^-1``, nothing for constant errors, and P in Joseph's form.

    Beyond the gate the fix is left out and P widens.
    """
    law, position = flight.mission.filtered, belief.state[:3]
    shifts = np.zeros((3, 18))
    shifts[:, 9:12] = np.eye(3)
    if isinstance(law, RangeBearingFixes):
        shifts[:, 6:9] = np.cross(belief.sensed[at], position).T
        shifts[:, 12:15] = np.linalg.norm(position) * belief.sensed[at].T
    seen, noise = np.hstack((np.eye(3, 6), shifts)), fix_covariance(law, position)
    spread = seen @ belief.covariance @ seen.T + noise
    measured = belief.fixes[at // flight.periods(law.fix_period_s)]
    residual = measured - expected_fix(law, position)
    square = float(residual @ np.linalg.solve(spread, residual))
    belief.innovation = Innovation(measured, residual, square)
    if law.gate_sigma is not None and square > law.gate_sigma**2:
        belief.covariance[:6, :6] *= WIDER
        return
    gain = np.linalg.solve(spread, seen @ belief.covariance).T
    gain[6:] = 0.0
    belief.state = belief.state + gain[:6] @ residual
    kept = np.eye(24) - gain @ seen
    belief.covariance = kept @ belief.covariance @ kept.T + gain @ noise @ gain.T


def expected_fix(law: FilteredNavigation, position: Floats) -> Floats:
    """Return the mean of fixes of a position: turned about two axes it is shorter by half of each square."""
    if not isinstance(law, RangeBearingFixes):
        return position
    turns = np.radians([law.bearing_noise_deg, law.attitude_noise_deg, law.attitude_bias_deg])
    return (1.0 - turns @ turns) * position


def fix_covariance(law: FilteredNavigation, position: Floats) -> Floats:
    """Return R: of a position, or of a range and a bearing along and across the predicted line of sight.

    Bordonaro, Willett and Bar-Shalom, IEEE Transactions on Aerospace and Electronic Systems 50, 2014.
    """
    if isinstance(law, PositionFixes):
        return law.noise_m**2 * np.eye(3)
    assert isinstance(law, RangeBearingFixes)  # noqa: S101 - the only other kind
    turns = np.radians([law.bearing_noise_deg, law.attitude_noise_deg])
    square = position @ position
    along = np.outer(position, position) / square
    across = (turns @ turns) * square * (np.eye(3) - along)
    return law.range_noise_m**2 * along + across
