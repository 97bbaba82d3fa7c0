"""What the deputy knows of its state: Kalman's filter on fixes (docs/explanation/navigation.md)."""

from dataclasses import dataclass

import numpy as np

from tests.readable_flight.motion import transition

#: factor by which a rejected fix widens the covariance
WIDER = 4.0


@dataclass
class Belief:
    """The filter's state, which lags by the delay of fixes, and what it needs to catch up with now.

    Attributes
    ----------
    state, covariance : (6,), (6, 6)
    fixes : list of (3,)
        Measured so far, m.
    acting : (K, 3)
        Commands in the control periods in which they act, N.
    """

    state: np.ndarray
    covariance: np.ndarray
    fixes: list
    acting: np.ndarray


def first_belief(flight, state):
    """The first estimate and its covariance."""
    law = flight.mission.navigation
    spread = [law.initial_position_m] * 3 + [law.initial_velocity_m_s] * 3
    start = state + flight.errors.at_start
    return Belief(start, np.diag(np.square(spread)), [], np.zeros((flight.mission.num_controls, 3)))


def fix(flight, k, position, attitude):
    """A fix at a sample, m, or None between two: the place, or range and bearing by the sensed attitude."""
    stride = flight.periods(flight.mission.navigation.fix_period_s)
    if k % stride:
        return None
    errors = flight.errors
    if flight.mission.navigation.measures == "position":
        return position + errors.of_fixes[k // stride]
    error = errors.of_sight[k // stride]
    seen = position + np.cross(error[1:] + attitude.apply(flight.tilt_angles(k)), position)
    seen *= (np.linalg.norm(position) + error[0]) / np.linalg.norm(seen)
    return seen + errors.of_fixes[k // stride]


def estimate(flight, k, belief, measured):
    """Take a fix in, once its delay has passed; return the estimate of the state now, and its covariance."""
    law = flight.mission.navigation
    stride, delay = flight.periods(law.fix_period_s), flight.periods(law.delay_s)
    if measured is not None:
        belief.fixes.append(measured)
    at = k - delay
    if at > 0:
        belief.state, belief.covariance = predicted(flight, belief, belief.state, belief.covariance, at - 1)
    if at >= 0 and at % stride == 0:
        correct(flight, belief, belief.fixes[at // stride])
    known = belief.state, belief.covariance
    for period in range(max(at, 0), k):
        known = predicted(flight, belief, *known, period)
    return known


def predicted(flight, belief, state, covariance, period):
    """``x <- Phi x + Gamma f``, ``P <- Phi P Phi' + Q``."""
    mission, law, force = flight.mission, flight.mission.navigation, belief.acting[period]
    phi, gamma = transition(mission.orbit.mean_motion_rad_s, mission.control_period_s, mission.deputy.mass_kg)
    tilt = np.radians([law.attitude_bias_deg, law.attitude_noise_deg])
    unknown = (mission.deputy.mass_kg * law.process_noise_m_s2) ** 2
    unknown += (law.execution_error**2 + tilt @ tilt) * (force @ force)
    return phi @ state + gamma @ force, phi @ covariance @ phi.T + unknown * gamma @ gamma.T


def correct(flight, belief, fixed):
    """``K = P H' S^-1``, ``x <- x + K (z - H x)``, P in Joseph's form; beyond the gate P widens instead."""
    law, place, spread = flight.mission.navigation, belief.state[:3], belief.covariance[:3, :3]
    innovation = spread + fix_covariance(law, place)
    off = fixed - place
    if law.gate_sigma is not None and off @ np.linalg.solve(innovation, off) > law.gate_sigma**2:
        belief.covariance = WIDER * belief.covariance
        return
    gain = np.linalg.solve(innovation, belief.covariance[:3]).T
    belief.state = belief.state + gain @ off
    kept, noise = np.eye(6) - gain @ np.eye(3, 6), fix_covariance(law, place)
    belief.covariance = kept @ belief.covariance @ kept.T + gain @ noise @ gain.T


def fix_covariance(law, place):
    """R: of a place, or of a range and a bearing along and across the predicted line of sight.

    Bordonaro, Willett and Bar-Shalom, IEEE Transactions on Aerospace and Electronic Systems 50, 2014.
    """
    if law.measures == "position":
        return (law.noise_m**2 + law.bias_m**2) * np.eye(3)
    turns = np.radians([law.bearing_noise_deg, law.attitude_bias_deg, law.attitude_noise_deg])
    square = place @ place
    along = np.outer(place, place) / square
    across = (turns @ turns) * square * (np.eye(3) - along)
    return law.bias_m**2 * np.eye(3) + law.range_noise_m**2 * along + across
