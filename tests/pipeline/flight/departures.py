"""Errors of fixes and thrusters, a tumbling chief, motion about the Earth: settings that tests share."""

import numpy as np

FIXES = {
    "mode": "fixes",
    "bias_m": 0.5,
    "outlier_m": 20.0,
    "process_noise_m_s2": 1e-5,
    "execution_error": 0.05,
    "initial_velocity_m_s": 0.001,
}
SIGHTED = {
    "measures": "range_bearing",
    "range_noise_m": 0.3,
    "bearing_noise_deg": 0.2,
    "attitude_bias_deg": 1.0,
    "attitude_noise_deg": 0.3,
}
TUMBLING = {"initial_angular_velocity_rad_s": (0.01, -0.02, 0.005)}
REAL = {"kind": "real", "scale_error": 0.05, "misalignment_deg": 2.0, "least_impulse_n_s": 0.02}

#: a thruster a direction beside the centre of mass, askew and weak
ASKEW = tuple(
    (*np.roll((0.15, 0.02 * sign, -0.03), axis), *np.roll((sign * 0.8, 0.6, 0.0), axis), 0.03)
    for axis in range(3)
    for sign in (1.0, -1.0)
)

LAYOUT = {
    "thrusters": ASKEW,
    "specific_impulse_s": 60.0,
    "least_impulse_n_s": 0.01,
    "impulse_step_n_s": 0.005,
}

LOW_ORBIT = {"model": "two_body", "j2": 1.08262668e-3, "drag_m_s2": 3e-7, "radiation_m_s2": 1e-7}

ELLIPSE = {"eccentricity": 0.02, "inclination_deg": 51.6, "latitude_argument_deg": 30.0}

#: what may vary within a flight: none stays constant or normal alone
VARYING = {
    "navigation": {
        "bias_m": {"kind": "normal", "mean": 0.3, "std": 0.5, "correlation_s": 400.0},
        "range_noise_m": {"kind": "uniform", "low": 0.1, "high": 0.6, "correlation_s": 1000.0},
        "bearing_noise_deg": {"kind": "normal", "mean": 0.2, "std": 0.1, "low": 0.0, "correlation_s": 100.0},
        "attitude_bias_deg": {"kind": "normal", "mean": 0.0, "std": 1.0, "correlation_s": 300.0},
        "attitude_noise_deg": {"kind": "uniform", "low": 0.0, "high": 0.4, "correlation_s": 50.0},
    },
    "actuators": {
        "scale_error": {"kind": "normal", "mean": 0.0, "std": 0.1, "correlation_s": 600.0},
        "misalignment_deg": {"kind": "uniform", "low": -5.0, "high": 5.0, "correlation_s": 200.0},
    },
}
DRAGGED = {"dynamics.drag_m_s2": {"kind": "normal", "mean": 1e-5, "std": 3e-6, "correlation_s": 300.0}}
