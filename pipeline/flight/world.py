"""A mission as the numbers that the compiled flight reads."""

import numpy as np
from numpy.typing import NDArray

from fis_tools.engines.vectors import padded
from pipeline.flight.chief import num_chief_steps
from pipeline.flight.kernel.arrays import POINTS, World
from pipeline.flight.kernel.safety import guard_of
from pipeline.flight.preview import look_stride, preview_stride
from pipeline.physics.inspection_points import fibonacci_placement, regular_placement
from pipeline.physics.motion import motion_over, orbit_parts
from pipeline.physics.quaternion import dcm_b_from_h
from pipeline.physics.rigid_body import tumble
from pipeline.physics.sight import sight_of
from pipeline.settings.experiment import Mission

Floats = NDArray[np.float64]


def inspection_points(mission: Mission) -> Floats:
    """Return the points of a mission in chief axes, shape (P, 3), m."""
    chief = mission.chief
    place = regular_placement if chief.placement == "deserno" else fibonacci_placement
    return np.asarray(place(chief.num_points, chief.inspection_radius_m), dtype=np.float64)


def chief_attitudes(mission: Mission) -> Floats:
    """Return the chief's attitude at every sample, Hill to chief, scalar last, shape (K+1, 4)."""
    attitudes = np.zeros((mission.num_controls + 1, 4))
    attitudes[:, 3] = 1.0
    rate = mission.chief.initial_angular_velocity_rad_s
    if rate is None:
        return attitudes
    inertia = np.array(mission.chief.inertia_kg_m2, dtype=np.float64)
    inverse = np.linalg.inv(inertia).astype(np.float64)
    quaternion, rate_c = attitudes[0].copy(), np.array(rate, dtype=np.float64)
    steps = num_chief_steps(mission)
    for k in range(1, len(attitudes)):
        quaternion, rate_c = tumble(
            quaternion,
            rate_c,
            inertia,
            inverse,
            mission.orbit.mean_motion_rad_s,
            mission.control_period_s,
            steps,
        )
        attitudes[k] = quaternion
    return attitudes


def pack_world(mission: Mission) -> World:
    """Turn a mission into the numbers that the compiled episode reads."""
    orbit, deputy, period = mission.orbit, mission.deputy, mission.control_period_s
    points = inspection_points(mission)
    placed = np.zeros((1, 3, padded(len(points), POINTS)))
    if mission.chief.initial_angular_velocity_rad_s is None:
        placed[0, :, : len(points)] = points.T
    else:
        attitudes = chief_attitudes(mission)
        placed = np.zeros((len(attitudes), 3, padded(len(points), POINTS)))
        for k, quaternion in enumerate(attitudes):
            placed[k, :, : len(points)] = dcm_b_from_h(quaternion).T @ points.T
    inertia = np.array(deputy.inertia_kg_m2, dtype=np.float64)
    stride, look = preview_stride(mission), look_stride(mission)
    return World(
        num_controls=mission.num_controls,
        num_attitude_steps=mission.num_attitude_steps,
        mean_motion=orbit.mean_motion_rad_s,
        control_period=period,
        attitude_period=mission.attitude_period_s,
        acceleration_per_force=1.0 / deputy.mass_kg,
        motion=motion_over(orbit, deputy, (period,)),
        instants=motion_over(
            orbit, deputy, [step * mission.attitude_period_s for step in range(mission.num_attitude_steps)]
        ),
        orbit_parts=orbit_parts(orbit, deputy),
        preview_stride=stride,
        strides=motion_over(orbit, deputy, [count * period for count in range(stride + 1)]),
        look_stride=look,
        looks=motion_over(
            orbit, deputy, [count * period for count in range(0, mission.num_controls + 1, look)]
        ),
        points=placed,
        num_points=len(points),
        sight=sight_of(mission.chief.inspection_radius_m, float(np.radians(mission.sensor.half_angle_deg))),
        boresight=np.array(mission.sensor.boresight, dtype=np.float64),
        is_spherical=bool(np.array_equal(inertia, inertia[0, 0] * np.eye(3))),
        inertia=inertia,
        inverse_inertia=np.linalg.inv(inertia).astype(np.float64),
        proportional_gain=mission.attitude.proportional_gain * inertia,
        derivative_gain=mission.attitude.derivative_gain * inertia,
        max_torque=deputy.max_torque_n_m,
        max_force=deputy.max_force_n,
        min_distance=deputy.min_distance_m,
        max_distance=deputy.max_distance_m,
        is_attitude_ideal=mission.attitude.mode == "ideal",
        has_pole_blending=mission.attitude.pole_blending,
        has_clusters=mission.guidance.kind == "clusters",
        coasts_when_complete=mission.coast_when_complete,
        guard=guard_of(mission),
    )
