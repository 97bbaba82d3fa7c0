"""The paper's mission as settings, and a hand-made controller that keeps the deputy busy."""

from dataclasses import replace

import numpy as np

from fis_tools.model import FuzzySystem, Gaussian, Term, Variable, table_rules
from pipeline.flight.state.log import Scenario
from pipeline.settings.experiment import Mission, Safety
from pipeline.settings.mission import Attitude, Chief, Deputy, Guidance, Orbit, Sensor

MEAN_MOTION = 0.0011068
IDENTITY = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
FULL_INERTIA = ((1.2, 0.1, -0.05), (0.1, 0.9, 0.08), (-0.05, 0.08, 1.1))

PAPER = Mission(
    orbit=Orbit(mean_motion_rad_s=MEAN_MOTION),
    deputy=Deputy(
        mass_kg=12.0,
        inertia_kg_m2=IDENTITY,
        initial_position_m=(43.3, 43.3, 43.3),
        initial_velocity_m_s=(0.0, 0.0, 0.0),
        max_force_n=1.0,
        max_torque_n_m=0.01,
        min_distance_m=15.0,
        max_distance_m=200.0,
    ),
    chief=Chief(
        inertia_kg_m2=IDENTITY,
        initial_angular_velocity_rad_s=None,
        inspection_radius_m=10.0,
        num_points=100,
        placement="deserno",
    ),
    sensor=Sensor(half_angle_deg=15.0, boresight=(-1.0, 0.0, 0.0)),
    attitude=Attitude(mode="flown", proportional_gain=0.08, derivative_gain=0.32, pole_blending=False),
    guidance=Guidance(kind="clusters", engine="compiled"),
    safety=Safety(),
    attitude_period_s=1.0,
    control_period_s=10.0,
    duration_s=3600.0,
    coast_when_complete=True,
    inspection_threshold_percent=95.0,
)

IDEAL = replace(PAPER, attitude=replace(PAPER.attitude, mode="ideal"))
#: with `steering_systems()` this start leads over the pole, closer than 0.06 deg, after 2,800 s
TOWARDS_THE_POLE = Scenario(np.array([45.0, -40.0, 35.0]), np.zeros(3), 0.3)
BEHIND = Scenario(np.array([-50.0, 30.0, -40.0]), np.zeros(3), 2.0)


def variable(name, unit, low, high, sigma, *, default=None):
    means = np.linspace(low, high, 5)
    terms = tuple(Term(f"t{i}", Gaussian(float(mean), sigma)) for i, mean in enumerate(means))
    return Variable(name, unit, low, high, terms, default=default)


def steering_system(axis, seen, speed, sign, strength=0.03):
    """A system that answers what it sees with a force, and damps the speed along its axis."""
    inputs = seen, speed
    output = variable(f"force_{axis}", "N", -strength, strength, strength / 4.0, default=0.0)
    cells = [(a, b) for a in range(-2, 3) for b in range(-2, 3)]
    consequents = [f"t{int(np.clip(2 + sign * a - b, 0, 4))}" for a, b in cells]
    return FuzzySystem(f"steer_{axis}", inputs, (output,), table_rules(inputs, output, consequents))


def steering_systems(strength=0.03):
    """The paper's structure, untrained: it follows its target and keeps its distance."""
    pi = float(np.pi)
    return (
        steering_system(
            "x",
            variable("distance", "m", 40.0, 100.0, 7.0),
            variable("velocity_body_x", "m/s", -0.2, 0.2, 0.05),
            -1,
            strength,
        ),
        steering_system(
            "y",
            variable("lambda_u", "rad", -pi, pi, 0.8),
            variable("velocity_body_y", "m/s", -0.3, 0.3, 0.08),
            1,
            strength,
        ),
        steering_system(
            "z",
            variable("eta_u", "rad", -pi, pi, 0.8),
            variable("velocity_body_z", "m/s", -0.3, 0.3, 0.08),
            1,
            strength,
        ),
    )


def restoring_systems():
    """Springs and dampers along Hill axes: they hold the deputy near the chief."""
    names = zip("xyz", ("radial", "along_track", "cross_track"), strict=True)
    return tuple(
        steering_system(
            axis,
            variable(f"position_{name}", "m", -80.0, 80.0, 18.0),
            variable(f"velocity_{name}", "m/s", -0.3, 0.3, 0.08),
            -1,
            0.02,
        )
        for axis, name in names
    )
