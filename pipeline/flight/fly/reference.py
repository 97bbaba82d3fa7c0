"""Flights by `pipeline.flight.reference`, with the log and the outcomes of any other flight."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from fis_tools.model.thrust import REASONS
from pipeline.flight.cases.actuators import thrust_errors, thrusters_of
from pipeline.flight.cases.dispersions import mission_of_case
from pipeline.flight.cases.navigation import errors_of
from pipeline.flight.cases.processes import in_time
from pipeline.flight.control.controller import Controller, stretches_of
from pipeline.flight.fly.logged import firing_reasons
from pipeline.flight.reference.errors import DrawnErrors
from pipeline.flight.reference.flight import ReferenceFlight
from pipeline.flight.reference.guidance import relative_angle
from pipeline.flight.reference.light import share_of_sun, sun_direction
from pipeline.flight.reference.motion import drifted
from pipeline.flight.reference.period import Act, period, start
from pipeline.flight.reference.see_push import sought_looks
from pipeline.flight.reference.state import Look, ReferenceState
from pipeline.flight.reference.thrust import Decision
from pipeline.flight.state import arrays
from pipeline.flight.state.log import REHEARSED, FlightLog, Outcomes, Scenario, empty_log
from pipeline.flight.world.bounds import bounds_of, spheres_of
from pipeline.flight.world.estimates import process_noise
from pipeline.flight.world.limits import metres_beyond, wheel_is_full
from pipeline.flight.world.surface import surface_of
from pipeline.settings.equipment import FilteredNavigation, RealActuators
from pipeline.settings.experiment import Mission
from pipeline.settings.mission import TwoBody

#: between the instants at which what follows a flight's end is looked at, s
LOOK_AFTER_S = 20.0
#: names of limits in the order of `pipeline.flight.state.log.LIMITS`; None where none is exceeded
LIMIT_NAMES = (
    None,
    "keep_out",
    "keep_in",
    "speed",
    "passive_safety",
    "apart",
    "way_out",
    "axis_speed",
    "delta_v",
    "sun",
)


def reference_of(mission: Mission, controller: Controller, scenario: Scenario) -> ReferenceFlight:
    """Return a flight of the reference, with what chance draws for its case.

    Points, errors, margins of the safety layer and the filter's process noise are numbers of the product.
    """
    mission, surface = mission_of_case(mission, scenario), surface_of(mission)
    errors: dict[str, Any] = {}
    if isinstance(mission.navigation, FilteredNavigation):
        drawn = errors_of(mission, [scenario])
        errors |= {name: values[0] for name, values in drawn._asdict().items()}
        unknown = process_noise(mission)
        errors["process"] = (unknown.std_m_s2, unknown.nearest_m, unknown.farthest_m, unknown.growth)
    if mission.actuators.kind == "real":
        table, thrust = thrusters_of(mission).table, thrust_errors(mission, [scenario])
        errors |= {"table": table, "matrices": thrust.matrices[0], "arm": thrust.arms[0]}
    if mission.safety.probability is not None:
        bounds = bounds_of(mission)
        planned = min(bounds.planned_force_n, mission.deputy.max_force_n)
        braking = min(bounds.braking_force_n, mission.braking_force_n)
        errors["margins"] = (*spheres_of(mission, bounds), planned, braking, bounds.step_back_n)
    if "dynamics.drag_m_s2" in mission.varying and isinstance(mission.dynamics, TwoBody):
        drag = mission.dynamics.drag_m_s2
        errors["more_drag"] = in_time(mission, "dynamics.drag_m_s2", scenario, drag)[:, 0] - drag
    parts = surface.points, surface.normals, surface.corners
    return ReferenceFlight(mission, controller, scenario, *parts, DrawnErrors(**errors))


def stretches(flight: ReferenceFlight) -> Iterator[tuple[int, ReferenceFlight]]:
    """Yield each sample with the flight as its controller is by then, see `stretches_of`."""
    controllers = dict(stretches_of(flight.controller))
    for k in range(flight.mission.num_controls + 1):
        if k in controllers and controllers[k] is not flight.controller:
            flight = flight.flown_by(controllers[k])
        yield k, flight


def fly_by_reference(
    mission: Mission, controller: Controller, scenario: Scenario, given: NDArray[np.float64] | None = None
) -> FlightLog:
    """Fly one episode by the reference and log everything.

    A controller that rehearses comes with its tours chosen, and with the forces that it has chosen, see
    `ReferenceFlight.given`.
    """
    flight = replace(reference_of(mission, controller, scenario), given=given)
    mission, num_points = flight.mission, len(flight.points)
    num_systems = len(controller.systems)
    log = empty_log(mission.num_controls, mission.num_attitude_steps, num_points, num_systems)
    log.mass_kg[:] = mission.deputy.mass_kg
    log.quaternion_c_from_h[:] = [attitude.as_quat() for attitude in flight.chief]
    angles, elevations = np.transpose(flight.suns)
    # continuous from the start's angle, which may be any
    log.sun_angle_rad[:] = np.unwrap([scenario.sun_angle_rad, *angles])[1:]
    log.sun_elevation_rad[:] = elevations
    log.visible_sun_share[:] = [
        share_of_sun(mission, sun_direction(*sun), distance)
        for sun, distance in zip(flight.suns, flight.distances, strict=True)
    ]
    log.is_inspectable[:] = flight.is_inspectable
    state: ReferenceState | None = start(flight)
    for k, now in stretches(flight):
        assert state is not None  # noqa: S101 - only after the last sample
        if mission.attitude.mode == "flown":
            log.angular_velocity_b_rad_s[k] = state.rate
        log.position_m[k], log.velocity_m_s[k] = state.truth[:3], state.truth[3:]
        seen, done, state = period(now, k, state)
        fields = sample_fields(now, seen)
        if done is not None and state is not None:
            fields |= period_fields(now, seen, done)
            fields |= point_fields(now, k, seen, done.decision)
            log.delta_v_m_s[k + 1], log.mass_kg[k + 1] = state.spent, state.mass
        for name, values in fields.items():
            getattr(log, name)[k] = values
    if any(name.startswith(("urgent", "aim", "tour_push", "see_push")) for name in _senses(controller)):
        log.last_light_s[:] = np.where(flight.is_counted, flight.last_lit, 0.0)
    log.reason[:] = log.command_reason
    actuators = mission.actuators if isinstance(mission.actuators, RealActuators) else None
    if actuators or mission.navigation.mode == "fixes" or flight.orbit is not None:
        is_burnt = actuators and actuators.specific_impulse_s is not None
        dry = 1.0 - actuators.propellant_kg / mission.deputy.mass_kg if actuators and is_burnt else -1.0
        log.reason[:] = firing_reasons(log, flight.periods(actuators.delay_s) if actuators else 0, dry)
    return log


def sample_fields(flight: ReferenceFlight, seen: Look) -> dict[str, Any]:
    """Return the log's fields of a sample, by name."""
    values = {
        "quaternion_b_from_h": seen.attitude.as_quat(),
        "sensed_quaternion_b_from_h": seen.sensed.as_quat(),
        "num_candidates": len(seen.candidates),
        "target_m": seen.target,
        "lambda_u_rad": relative_angle(seen.target[[0, 1]], seen.known[[0, 1]]),
        "eta_u_rad": relative_angle(seen.target[[0, 2]], seen.known[[0, 2]]),
        "is_inspected": seen.is_inspected,
    }
    if flight.mission.navigation.mode == "fixes":
        values |= {"estimate": seen.known, "estimate_covariance": seen.covariance}
    if seen.innovation is not None:
        values |= {"fix_m": seen.innovation.fix, "innovation_m": seen.innovation.off}
        values |= {"innovation_square": seen.innovation.square}
    return values


def period_fields(flight: ReferenceFlight, seen: Look, done: Act) -> dict[str, Any]:
    """Return the log's fields of a control period, by name."""
    return inference_fields(flight, done.decision) | {
        "force_body_n": seen.sensed.inv().apply(done.decision.wanted),
        "force_hill_n": done.thrust.fired,
        "force_commanded_n": done.thrust.commanded,
        "command_reason": [list(REASONS).index(why) for why in done.reasons],
        "safety_limit": LIMIT_NAMES.index(done.limit),
        "safety_force_hill_n": done.change,
        "attitude_quaternion": [attitude.as_quat() for attitude, *_ in done.instants],
        "attitude_rate_b_rad_s": [rate for _, rate, *_ in done.instants],
        "torque_b_n_m": [torque for _, _, torque, _ in done.instants],
        "wheel_momentum_b_n_m_s": [held for *_, held in done.instants],
    }


def inference_fields(flight: ReferenceFlight, decision: Decision) -> dict[str, Any]:
    """Return the log's fields of inference, by name."""
    count = len(flight.controller.systems)
    inputs, outputs = np.zeros((count, 3)), np.zeros(count)
    for system, (sensed, output) in enumerate(decision.inferred):
        inputs[system, : len(sensed)], outputs[system] = sensed, output
    return {
        "force_asked_n": decision.requested,
        "foreseen": np.full(3, np.nan) if decision.foreseen is None else decision.foreseen,
        "fis_input": inputs,
        "fis_output_n": outputs,
        "is_decided": decision.resting is None and not flight.has_plan,
    }


def point_fields(flight: ReferenceFlight, k: int, seen: Look, decision: Decision) -> dict[str, Any]:
    """Return the log's fields on the points that a decision's signals are made of, by name."""
    values: dict[str, Any] = {}
    if decision.is_missed is not None:
        values["is_missed"] = decision.is_missed
    if decision.resting is None and not flight.has_plan:
        values["is_candidate"] = seen.is_lit & ~seen.is_inspected
        if any(name.startswith(("see_push", "aim")) for name in _senses(flight.controller)):
            shortfalls, slopes = sought_looks(flight, k, seen.known, seen.is_inspected)
            values["looks"] = np.column_stack([shortfalls, slopes])
    return values


def _senses(controller: Controller) -> list[str]:
    return [variable.name for system in controller.systems for variable in system.inputs]


def beyond_after(mission: Mission, log: FlightLog) -> float:
    """Return the most metres outside the limits of coasting on from a flight's end for `after_s`."""
    if mission.after_s == 0.0:
        return -np.inf
    end, limits = np.r_[log.position_m[-1], log.velocity_m_s[-1]], mission.deputy
    times = np.linspace(0.0, mission.after_s, int(np.ceil(mission.after_s / LOOK_AFTER_S)) + 1)
    distances = np.array([np.linalg.norm(drifted(mission, end, time)[:3]) for time in times.tolist()])
    return float(max(limits.min_distance_m - distances.min(), distances.max() - limits.max_distance_m))


def outcomes_of_logs(mission: Mission, logs: Sequence[FlightLog]) -> Outcomes:
    """Return the outcomes of logged flights, (n,)."""
    distance = np.array([np.linalg.norm(log.position_m, axis=1) for log in logs])
    beyond = np.array([[*metres_beyond(mission, log)[1:], beyond_after(mission, log)] for log in logs])
    changes = np.array([np.abs(log.safety_force_hill_n).sum() for log in logs])
    limit, is_ahead = mission.deputy.max_force_n, [log.command_reason == REHEARSED for log in logs]
    requested = [np.minimum(np.abs(log.force_asked_n), limit) for log in logs]
    ahead = np.array([forces[chosen].sum() for forces, chosen in zip(requested, is_ahead, strict=True)])
    full = np.array([wheel_is_full(mission, log).sum() for log in logs], dtype=np.float64)
    return Outcomes(
        delta_v_m_s=np.array([log.delta_v_m_s[-1] for log in logs]),
        inspected_count=np.array([log.is_inspected[-1].sum() for log in logs], dtype=np.int64),
        inspectable_count=np.array([log.is_inspectable.sum() for log in logs], dtype=np.int64),
        mean_distance_m=distance.mean(axis=1),
        min_distance_m=distance.min(axis=1),
        max_distance_m=distance.max(axis=1),
        outside_m=np.maximum(beyond.max(axis=1), 0.0),
        safety_periods=np.array([np.count_nonzero(log.safety_limit) for log in logs], dtype=np.int64),
        safety_delta_v_m_s=changes * mission.control_period_s / mission.deputy.mass_kg,
        ahead_delta_v_m_s=ahead * mission.control_period_s / mission.deputy.mass_kg,
        full_wheel_s=mission.attitude_period_s * full,
    )


def write_tracks(mission: Mission, log: FlightLog, rows: NDArray[np.float32]) -> None:
    """Write the track of a logged flight, (K+1, NUM_PLACED or NUM_TRACKED), see `arrays`."""
    rows[:, :3] = log.position_m
    if rows.shape[1] < arrays.NUM_TRACKED:
        return
    rows[:, 3:6], rows[:, arrays.TRACK_SPENT] = log.velocity_m_s, log.delta_v_m_s
    rows[:, arrays.TRACK_LEFT] = len(log.is_inspectable) - log.is_inspected.sum(axis=1)
    rows[:, arrays.TRACK_FORCE : arrays.TRACK_FORCE + 3] = 0.0
    rows[:-1, arrays.TRACK_FORCE : arrays.TRACK_FORCE + 3] = log.force_hill_n
    boresights = Rotation.from_quat(log.quaternion_b_from_h).apply(mission.sensor.boresight)
    rows[:, arrays.TRACK_BORESIGHT : arrays.TRACK_BORESIGHT + 3] = boresights
    rows[:, arrays.TRACK_TURN_RATE] = np.linalg.norm(log.angular_velocity_b_rad_s, axis=1)
