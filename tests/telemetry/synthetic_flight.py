"""A flight in closed form, to have something true to record.

The deputy circles the chief on a tilted circle of constant radius, its camera at the chief. The forces keep
it there as if nothing else pulled; what guidance and the fuzzy systems are told follows from the place alone.
Points are inspected one after the other, but for the last two; until then each goes through the other states.
"""

from collections.abc import Iterable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from telemetry import EpisodeWriter
from telemetry.file import topics
from telemetry.file.metadata import EpisodeDescription, FisDescription
from telemetry.file.topics import PointState

Floats = NDArray[np.float64]

MEAN_MOTION = 0.0011068
CONTROL_PERIOD = 10.0
MASS = 12.0
NUM_POINTS = 99
POINT_RADIUS = 10.0
HALF_ANGLE = np.deg2rad(15.0)
FIS_NAMES = ("force_x", "force_y", "force_z")
WORDS = ("NL", "NS", "ZE", "PS", "PL")
ATTITUDE_OFFSETS = np.arange(10.0)
#: fields that are called as the flight's arrays, by topic
PLAIN_FIELDS = {
    topics.DEPUTY_STATE: ("position_m", "velocity_m_s", "quaternion", "angular_velocity_rad_s"),
    topics.GUIDANCE: ("num_candidates", "target_direction", "lambda_u_rad", "eta_u_rad"),
}


class SyntheticFlight(SimpleNamespace):
    """What `fly` puts into it: arrays over samples, over controls, and over instants of the attitude."""

    def but(self, **changes: Any) -> "SyntheticFlight":
        """The same flight with other arrays."""
        return SyntheticFlight(**{**vars(self), **changes})


def fibonacci_sphere() -> Floats:
    index = np.arange(NUM_POINTS) + 0.5
    height = 1.0 - 2.0 * index / NUM_POINTS
    angle = np.pi * (1.0 + np.sqrt(5.0)) * index
    ring = np.sqrt(1.0 - height**2)
    return POINT_RADIUS * np.column_stack((ring * np.cos(angle), ring * np.sin(angle), height))


def circle(time_s: Floats, radius: float, rate: float) -> tuple[Floats, Floats, Floats]:
    """Position, velocity and acceleration on a circle tilted by 60 degrees, each of shape (N, 3)."""
    first = np.array([0.5, 0.0, np.sqrt(3.0) / 2.0])
    second = np.array([0.0, -1.0, 0.0])
    cosine, sine = np.cos(rate * time_s)[:, None], np.sin(rate * time_s)[:, None]
    position = radius * (cosine * first + sine * second)
    velocity = radius * rate * (-sine * first + cosine * second)
    return position, velocity, -(rate**2) * position


def pointing_quaternions(position: Floats) -> Floats:
    """Hill to body, scalar last, with the body's x axis along the position."""
    x_axis = position / np.linalg.norm(position, axis=1, keepdims=True)
    y_axis = np.cross([0.0, 0.0, 1.0], x_axis)
    y_axis /= np.linalg.norm(y_axis, axis=1, keepdims=True)
    axes = (x_axis, y_axis, np.cross(x_axis, y_axis))
    return Rotation.from_matrix(np.stack(axes, axis=2)).as_quat()


def rotate_to_body(quaternion: Floats, vector: Floats) -> Floats:
    """Turn Hill vectors into body axes."""
    return Rotation.from_quat(quaternion).inv().apply(vector)


def fly(num_controls: int = 360) -> SyntheticFlight:
    time_s = CONTROL_PERIOD * np.arange(num_controls + 1.0)
    radius, rate = 75.0, 2.0 * MEAN_MOTION
    position, velocity, acceleration = circle(time_s, radius, rate)
    quaternion = pointing_quaternions(position)
    fine_time = (time_s[:-1, None] + ATTITUDE_OFFSETS).ravel()
    force = MASS * acceleration[:-1]
    sample, point = np.arange(num_controls + 1)[:, None], np.arange(NUM_POINTS)
    inspected = (sample >= 2.4 * point) & (point < NUM_POINTS - 2)
    states = np.where(inspected, PointState.INSPECTED, (sample + point) % PointState.INSPECTED)
    target = np.roll(position, 1, axis=1) / radius
    angles = np.arctan2(target, position)
    force_body = rotate_to_body(quaternion[:-1], force)
    fis_inputs = np.stack((angles.T / np.pi, rotate_to_body(quaternion, velocity).T), axis=2)[:, :-1]
    means = np.linspace(-1.0, 1.0, len(WORDS))
    first = np.exp(-((fis_inputs[:, :, 0, None] - means) ** 2) / 0.1)
    second = np.exp(-((fis_inputs[:, :, 1, None] * 5.0 - means) ** 2) / 0.1)
    wave = 2.0 * np.pi * fine_time / 700.0
    torque = 4e-3 * np.column_stack((np.sin(wave), np.cos(1.3 * wave), np.sin(0.7 * wave)))
    fine = (num_controls, len(ATTITUDE_OFFSETS))
    return SyntheticFlight(
        num_controls=num_controls,
        time_s=time_s,
        position_m=position,
        velocity_m_s=velocity,
        quaternion=quaternion,
        chief_quaternion=np.tile([0.0, 0.0, 0.0, 1.0], (num_controls + 1, 1)),
        angular_velocity_rad_s=rotate_to_body(quaternion, np.cross(position, velocity) / radius**2),
        attitude_quaternion=pointing_quaternions(circle(fine_time, radius, rate)[0]).reshape(*fine, 4),
        attitude_rate_rad_s=np.full((*fine, 3), rate / np.sqrt(3.0)),
        torque_n_m=torque.reshape(*fine, 3),
        force_body_n=force_body,
        force_hill_n=force,
        points_m=fibonacci_sphere(),
        states=states,
        inspected=inspected,
        num_candidates=np.sum(states == PointState.LIT, axis=1),
        target_direction=target,
        lambda_u_rad=angles[:, 1],
        eta_u_rad=angles[:, 2],
        fis_inputs=fis_inputs,
        firing_strengths=np.minimum(first[..., :, None], second[..., None, :]).reshape(3, num_controls, -1),
        fis_output_n=force_body.T,
        sun_angle_rad=4.0 - MEAN_MOTION * time_s,
        delta_v_m_s=np.concatenate(([0.0], np.cumsum(np.abs(force).sum(axis=1)) * CONTROL_PERIOD / MASS)),
    )


def metadata(flight: SyntheticFlight) -> dict[str, dict[str, str]]:
    episode = EpisodeDescription(
        scenario_id="circle-0",
        seed=7,
        position_m=tuple(flight.position_m[0].tolist()),
        velocity_m_s=tuple(flight.velocity_m_s[0].tolist()),
        sun_angle_rad=float(flight.sun_angle_rad[0]),
        product_version="0.1.0",
        config_hash="5d41402abc4b2a76b9719d911017c592",
        min_distance_m=15.0,
        max_distance_m=200.0,
        max_force_n=1.0,
        max_torque_n_m=0.01,
        half_angle_rad=float(HALF_ANGLE),
        boresight=(-1.0, 0.0, 0.0),
        inspection_threshold_percent=95.0,
    )
    systems = {}
    for axis, signal, unit in (("x", "distance", "m"), ("y", "lambda_u", "rad"), ("z", "eta_u", "rad")):
        name, rate = f"force_{axis}", f"velocity_body_{axis}"
        rules = tuple(
            f"if {signal} is {WORDS[i]} and {rate} is {WORDS[j]} then {name} is {WORDS[(i + j) // 2]}"
            for i in range(5)
            for j in range(5)
        )
        words = {"input_names": (signal, rate), "input_units": (unit, "m/s"), "rules": rules}
        systems[f"fis.{name}"] = FisDescription(**words, output_name=name, output_unit="N").to_metadata()
    return {"episode": episode.to_metadata(), **systems}


ATTACHMENTS = {"config.yaml": b"seed: 7\n", "controller.json": b'{"name": "circle"}\n'}


def record(flight: SyntheticFlight, path: Path, **others: Any) -> Path:
    """Record a flight topic by topic, each at once; others are arguments of the writer."""
    with EpisodeWriter(path, **{"metadata": metadata(flight), "attachments": ATTACHMENTS} | others) as writer:
        write_state(writer, flight, slice(None))
        write_control(writer, flight, slice(flight.num_controls))
        for k in range(flight.num_controls + 1):
            write_events(writer, flight, k)
    return path


def write_samples(writer: EpisodeWriter, flight: SyntheticFlight, samples: Iterable[int]) -> None:
    """Write samples one by one, as they are flown."""
    for k in samples:
        write_state(writer, flight, k)
        if k < flight.num_controls:
            write_control(writer, flight, k)
        write_events(writer, flight, k)


def write_events(writer: EpisodeWriter, flight: SyntheticFlight, k: int) -> None:
    for threshold in (50, 95):
        before = flight.inspected[k - 1].sum() if k else 0
        if before < threshold <= flight.inspected[k].sum():
            writer.log(flight.time_s[k], "info", f"{threshold} of {NUM_POINTS} points inspected")


def write_control(writer: EpisodeWriter, flight: SyntheticFlight, k: int | slice) -> None:
    """Write what is applied after a sample, or some."""
    time_s = flight.time_s[k]
    writer.record(
        topics.DEPUTY_ATTITUDE,
        time_s,
        time_offset_s=ATTITUDE_OFFSETS,
        quaternion=flight.attitude_quaternion[k],
        angular_velocity_rad_s=flight.attitude_rate_rad_s[k],
        torque_n_m=flight.torque_n_m[k],
    )
    force_asked = flight.force_body_n[k]
    writer.record(
        topics.DEPUTY_CONTROL,
        time_s,
        force_body_n=force_asked,
        force_hill_n=flight.force_hill_n[k],
        force_asked_n=force_asked,
        reason=np.full(force_asked.shape, topics.Reason.FIRED),
    )
    for index, name in enumerate(FIS_NAMES):
        writer.record(
            topics.fis_topic(name),
            time_s,
            inputs=flight.fis_inputs[index, k],
            firing_strengths=flight.firing_strengths[index, k],
            output_n=flight.fis_output_n[index, k],
        )


def write_state(writer: EpisodeWriter, flight: SyntheticFlight, k: int | slice) -> None:
    """Write what a sample has, or some have, whoever flies."""
    time_s, position = flight.time_s[k], flight.position_m[k]
    writer.poses(time_s, position, flight.quaternion[k], flight.chief_quaternion[k])
    writer.points(time_s, flight.points_m, flight.states[k])
    for topic, fields in PLAIN_FIELDS.items():
        writer.record(topic, time_s, **{field: getattr(flight, field)[k] for field in fields})
    count = flight.inspected[k].sum(axis=-1)
    writer.record(
        topics.MISSION,
        time_s,
        sun_angle_rad=flight.sun_angle_rad[k],
        distance_m=np.linalg.norm(position, axis=-1),
        inspected_count=count,
        inspection_rate_percent=100.0 * count / NUM_POINTS,
        inspected_mask=flight.inspected[k],
        delta_v_m_s=flight.delta_v_m_s[k],
    )
