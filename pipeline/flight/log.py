"""What goes into a flight and what comes out of it, as arrays."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

#: what the safety layer acted for at a sample, see `FlightLog.safety_limit`
SAFE, KEEP_OUT, KEEP_IN, SPEED, PASSIVE_SAFETY = range(5)


@dataclass(frozen=True)
class Scenario:
    """A start: position (m) and velocity (m/s), shape (3,), Hill axes, and the Sun's angle at k = 0 (rad)."""

    position_m: Floats
    velocity_m_s: Floats
    sun_angle_rad: float


@dataclass(frozen=True)
class FlightLog:
    """Everything that happened in one flight of K control periods with S attitude steps each.

    Samples run over k = 0 … K, controls over k = 0 … K-1. All axes are Hill's unless a name says otherwise.
    P is the number of inspection points, F the number of fuzzy systems.

    Parameters
    ----------
    position_m, velocity_m_s : (K+1, 3)
    quaternion_b_from_h : (K+1, 4)
        Hill to deputy body, scalar last.
    angular_velocity_b_rad_s : (K+1, 3)
        Of the deputy relative to Hill, in body axes.
    quaternion_c_from_h : (K+1, 4)
        Hill to chief body, scalar last.
    attitude_quaternion : (K, S, 4), attitude_rate_b_rad_s : (K, S, 3)
        At each instant of the attitude clock inside the control period that follows sample k.
    torque_b_n_m : (K, S, 3)
        As applied from that instant on.
    force_body_n : (K, 3)
        As the controller asked for it, before the clip, body axes (Hill axes turned to body where the
        controller commands Hill axes).
    force_hill_n : (K, 3)
        As applied over the control period that follows.
    num_candidates : (K+1,) int
        Points lit and not yet inspected, after the inspection of sample k.
    target_m : (K+1, 3)
        The point p_u; zeros without candidates.
    lambda_u_rad, eta_u_rad : (K+1,)
    fis_input : (K, F, 3)
        Before clipping; unused places are zero.
    fis_output_n : (K, F)
    is_decided : (K,) bool
        Whether inference decided the force at sample k.
    sun_angle_rad : (K+1,)
    is_inspected : (K+1, P) bool
    delta_v_m_s : (K+1,)
        Spent by the forces 0 … k-1.
    safety_limit : (K,) int
        Which limit the safety layer changed the force for: `KEEP_OUT`, `KEEP_IN`, `SPEED` or
        `PASSIVE_SAFETY`; `SAFE` where it left it as it was.
    safety_force_hill_n : (K, 3)
        By which it changed the force, after the clip; part of `force_hill_n`.
    """

    position_m: Floats
    velocity_m_s: Floats
    quaternion_b_from_h: Floats
    angular_velocity_b_rad_s: Floats
    quaternion_c_from_h: Floats
    attitude_quaternion: Floats
    attitude_rate_b_rad_s: Floats
    torque_b_n_m: Floats
    force_body_n: Floats
    force_hill_n: Floats
    num_candidates: NDArray[np.int64]
    target_m: Floats
    lambda_u_rad: Floats
    eta_u_rad: Floats
    fis_input: Floats
    fis_output_n: Floats
    is_decided: NDArray[np.bool_]
    sun_angle_rad: Floats
    is_inspected: NDArray[np.bool_]
    delta_v_m_s: Floats
    safety_limit: NDArray[np.int64]
    safety_force_hill_n: Floats
