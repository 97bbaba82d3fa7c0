"""Whole flights against a second implementation of the sampled-data loop that shares no physics.

Everything moves by DOP853 in inertial space (rotations) and by the Clohessy-Wiltshire differential equations;
attitudes are scipy's, clusters scikit-learn's, inference is plain numpy.
"""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation
from sklearn.cluster import KMeans
from threadpoolctl import ThreadpoolController

from fis_tools.engines import inference
from pipeline.flight.reference.channels import channels_of
from pipeline.flight.reference.loop import fly, inference_of
from pipeline.flight.state.log import Scenario
from pipeline.physics.inspection_points import regular_placement
from tests.pipeline.flight.missions import (
    BEHIND,
    FULL_INERTIA,
    MEAN_MOTION,
    PAPER,
    TOWARDS_THE_POLE,
    restoring_systems,
    steering_systems,
)

ASTRONOMICAL_UNIT = 149597870700.0
POINTS = regular_placement(100, 10.0)
THREADS = ThreadpoolController()
TUMBLING_INERTIA = ((900.0, 30.0, -50.0), (30.0, 1200.0, 20.0), (-50.0, 20.0, 700.0))


def move(state, force, torque, inertia, duration):
    """Integrate position and velocity in Hill, attitude (body to inertial) and inertial rate in body axes."""
    n = MEAN_MOTION
    fx, fy, fz = force / PAPER.deputy.mass_kg
    (jxx, jxy, jxz), (_, jyy, jyz), (_, _, jzz) = inertia.tolist()
    (kxx, kxy, kxz), (_, kyy, kyz), (_, _, kzz) = np.linalg.inv(inertia).tolist()
    tx, ty, tz = torque

    def rates(_time, s):
        x, _, z, u, v, w, a, b, c, d, p, q, r = s.tolist()
        hx, hy, hz = jxx * p + jxy * q + jxz * r, jxy * p + jyy * q + jyz * r, jxz * p + jyz * q + jzz * r
        mx, my, mz = tx - (q * hz - r * hy), ty - (r * hx - p * hz), tz - (p * hy - q * hx)
        return [
            u,
            v,
            w,
            3 * n * n * x + 2 * n * v + fx,
            -2 * n * u + fy,
            -n * n * z + fz,
            (d * p + b * r - c * q) / 2,
            (d * q + c * p - a * r) / 2,
            (d * r + a * q - b * p) / 2,
            -(a * p + b * q + c * r) / 2,
            kxx * mx + kxy * my + kxz * mz,
            kxy * mx + kyy * my + kyz * mz,
            kxz * mx + kyz * my + kzz * mz,
        ]

    solution = solve_ivp(
        rates, (0.0, duration), state, method="DOP853", rtol=1e-11, atol=1e-13, first_step=duration
    )
    end = solution.y[:, -1]
    end[6:10] /= np.linalg.norm(end[6:10])
    return end


def relative_angle(target, position):
    """From the position's to the target's projection on a plane; 0 where one of them is a point."""
    if min(np.hypot(*target), np.hypot(*position)) < 1e-9:
        return 0.0
    turn = np.arctan2(*target[::-1]) - np.arctan2(*position[::-1])
    return np.arctan2(np.sin(turn), np.cos(turn))


def nearest_cluster(candidates, position, carried):
    number = -(-len(candidates) // 10)
    centres = list(carried[:number])
    while len(centres) < number:
        if centres:
            distances = np.linalg.norm(candidates[:, None] - np.array(centres)[None], axis=2).min(axis=1)
            chosen = candidates[np.flatnonzero(distances > distances.max() - 1e-9)[0]]
        else:
            chosen = candidates[np.linalg.norm(candidates - position, axis=1).argmin()]
        centres.append(chosen + 0.5 * (position - chosen) / np.linalg.norm(position - chosen))
    fitted = KMeans(number, init=np.array(centres), n_init=1, max_iter=50, tol=0, algorithm="lloyd")
    with THREADS.limit(limits=1, user_api="openmp"):
        centres = fitted.fit(candidates).cluster_centers_
    return centres[np.linalg.norm(centres - position, axis=1).argmin()], centres


class SecondFlight:
    """The loop once more; after `fly`, what it did at each sample."""

    def __init__(self, mission, scenario, systems, force_axes):
        self.mission, self.scenario, self.systems = mission, scenario, systems
        self.force_axes = force_axes
        self.inertia = np.array(mission.deputy.inertia_kg_m2)
        self.positions, self.attitudes, self.num_inspected, self.forces, self.targets = [], [], [], [], []
        self.is_inspected = np.zeros(len(POINTS), dtype=bool)
        self.centres, self.y = np.empty((0, 3)), np.array([0.0, 1.0, 0.0])

    def fly(self):
        mission = self.mission
        inertial_rate = np.array([0.0, 0.0, 2.0 * MEAN_MOTION])  # relative and Hill's own
        state = np.concatenate(
            (self.scenario.position_m, self.scenario.velocity_m_s, [0, 0, 0, 1.0], inertial_rate)
        )
        chief_rate = mission.chief.initial_angular_velocity_rad_s
        chief = np.concatenate((np.zeros(9), [1.0], np.zeros(3) if chief_rate is None else chief_rate))
        for k in range(mission.num_controls + 1):
            time = k * mission.control_period_s
            hill = Rotation.from_rotvec([0.0, 0.0, MEAN_MOTION * time])
            attitude = hill.inv() * Rotation.from_quat(state[6:10])
            points = POINTS
            if chief_rate is not None:
                points = (hill.inv() * Rotation.from_quat(chief[6:10])).apply(POINTS)
            target = self.look(time, state[:3], attitude, points)
            self.positions.append(state[:3])
            self.attitudes.append(attitude)
            self.num_inspected.append(self.is_inspected.sum())
            self.targets.append(target)
            if k == mission.num_controls:
                return self
            force = self.decide(state, attitude, target)
            self.forces.append(force)
            for tick in range(mission.num_attitude_steps):
                tick_time = time + tick * mission.attitude_period_s
                torque = self.steer(state, tick_time)
                state = move(state, force, torque, self.inertia, mission.attitude_period_s)
            if chief_rate is not None:
                chief_inertia = np.array(mission.chief.inertia_kg_m2)
                chief = move(chief, np.zeros(3), np.zeros(3), chief_inertia, mission.control_period_s)
        raise AssertionError

    def look(self, time, position, attitude, points):
        angle = self.scenario.sun_angle_rad - MEAN_MOTION * time
        sun = ASTRONOMICAL_UNIT * np.array([np.cos(angle), np.sin(angle), 0.0])
        is_lit = np.sum(points * (points - sun), axis=1) < 0.0
        distance = np.linalg.norm(position)
        from_centre = np.arccos(np.clip(points @ position / (10.0 * distance), -1.0, 1.0))
        sight = points - position
        sight /= np.linalg.norm(sight, axis=1)[:, None]
        off_boresight = np.arccos(np.clip(sight @ attitude.apply([-1.0, 0.0, 0.0]), -1.0, 1.0))
        half_angle = np.radians(self.mission.sensor.half_angle_deg)
        in_view = (from_centre <= np.arccos(10.0 / distance)) & (off_boresight <= half_angle)
        self.is_inspected |= is_lit & in_view
        candidates = points[is_lit & ~self.is_inspected]
        if len(candidates) == 0:
            self.centres = np.empty((0, 3))
            return np.zeros(3)
        if self.mission.guidance.kind == "centroid":
            return candidates.mean(axis=0)
        target, self.centres = nearest_cluster(candidates, position, self.centres)
        return target

    def decide(self, state, attitude, target):
        if self.is_inspected.all():
            return np.zeros(3)
        position, velocity = state[:3], attitude.inv().apply(state[3:6])
        sensed = {
            "distance": np.linalg.norm(position),
            "lambda_u": relative_angle(target[[0, 1]], position[[0, 1]]),
            "eta_u": relative_angle(target[[0, 2]], position[[0, 2]]),
        }
        sensed |= {f"velocity_body_{axis}": velocity[i] for i, axis in enumerate("xyz")}
        for i, axis in enumerate(("radial", "along_track", "cross_track")):
            sensed |= {f"position_{axis}": position[i], f"velocity_{axis}": state[3 + i]}
        commanded = np.array(
            [
                inference.infer(system, np.array([sensed[v.name] for v in system.inputs])).values[0]
                for system in self.systems
            ]
        )
        if self.force_axes == "body":
            commanded = attitude.apply(commanded)
        limit = self.mission.deputy.max_force_n
        return np.clip(commanded, -limit, limit)

    def desired_attitude(self, position):
        """Body to Hill; over a pole the y axis stays as it is but for what keeps it across the sight."""
        x = position / np.linalg.norm(position)
        sideways = np.cross([0.0, 0.0, 1.0], x)
        if np.linalg.norm(sideways) < 1e-3:
            sideways = self.y - x * (x @ self.y)
        self.y = sideways / np.linalg.norm(sideways)
        return Rotation.from_matrix(np.column_stack((x, self.y, np.cross(x, self.y))))

    def steer(self, state, time):
        hill = Rotation.from_rotvec([0.0, 0.0, MEAN_MOTION * time])
        attitude = hill.inv() * Rotation.from_quat(state[6:10])
        error = (self.desired_attitude(state[:3]).inv() * attitude).as_quat(canonical=True)[:3]
        rate = state[10:] - attitude.inv().apply([0.0, 0.0, MEAN_MOTION])
        gains = self.mission.attitude
        torque = -self.inertia @ (gains.proportional_gain * error + gains.derivative_gain * rate)
        limit = self.mission.deputy.max_torque_n_m
        return np.clip(torque, -limit, limit)


MISSIONS = {
    "an hour of clusters": (PAPER, BEHIND, steering_systems(0.06), "body"),
    "an hour with a pass over the pole": (PAPER, TOWARDS_THE_POLE, steering_systems(), "body"),
    "full inertia, tumbling chief, centroid, Hill axes, weak thruster, slow clocks": (
        replace(
            PAPER,
            deputy=replace(PAPER.deputy, inertia_kg_m2=FULL_INERTIA, max_force_n=0.004),
            chief=replace(
                PAPER.chief,
                inertia_kg_m2=TUMBLING_INERTIA,
                initial_angular_velocity_rad_s=(0.004, -0.003, 0.006),
            ),
            guidance=replace(PAPER.guidance, kind="centroid"),
            sensor=replace(PAPER.sensor, half_angle_deg=7.0),
            attitude_period_s=2.0,
            control_period_s=20.0,
            duration_s=1200.0,
        ),
        Scenario(np.array([-50.0, 60.0, -35.0]), np.array([0.02, 0.01, -0.03]), 2.0),
        restoring_systems(),
        "hill",
    ),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", MISSIONS)
def test_the_reference_flies_as_the_second_implementation_does(name):
    mission, scenario, systems, force_axes = MISSIONS[name]
    log = fly(mission, scenario, channels_of(systems, force_axes), inference_of(systems))
    second = SecondFlight(mission, scenario, systems, force_axes).fly()

    assert np.any(log.force_hill_n)
    assert log.is_inspected[-1].sum() > 30
    np.testing.assert_array_equal(log.is_inspected.sum(axis=1), second.num_inspected)
    np.testing.assert_array_equal(log.is_inspected[-1], second.is_inspected)
    np.testing.assert_allclose(log.position_m, second.positions, rtol=0, atol=1e-5)
    np.testing.assert_allclose(log.target_m, second.targets, rtol=0, atol=1e-6)
    np.testing.assert_allclose(log.force_hill_n, second.forces, rtol=0, atol=1e-5)
    attitudes = Rotation.from_quat(log.quaternion_b_from_h)
    between = (Rotation.concatenate(second.attitudes).inv() * attitudes).magnitude()
    assert between.max() < 1e-5
