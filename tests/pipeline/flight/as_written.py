"""Flights of the product beside the readable flight, period by period.

The readable flight begins each control period where the product's log is, so that a difference shows in the
period that it arises in, and none grows. A result that differs by more than rounding must be one that the
readable flight gives from inputs changed in their twelfth digit: such is a choice on a knife's edge, or a
formula that magnifies rounding. Where formulas are smooth that allows nothing.
"""

from collections import defaultdict
from copy import deepcopy
from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from fis_tools.model.thrust import REASONS
from pipeline.flight.cases.actuators import thrust_errors, thrusters_of
from pipeline.flight.cases.dispersions import mission_of_case
from pipeline.flight.cases.navigation import errors_of
from pipeline.flight.cases.processes import in_time
from pipeline.flight.control.controller import Controller
from pipeline.flight.fly.simulation import fly_logged
from pipeline.flight.state.log import FlightLog, Scenario
from pipeline.flight.world.bounds import bounds_of, process_noise, spheres_of
from pipeline.flight.world.surface import surface_of
from pipeline.settings.experiment import Mission
from tests.readable_flight.errors import Errors
from tests.readable_flight.flight import Flight
from tests.readable_flight.guidance import relative_angle
from tests.readable_flight.light import share_of_sun, sun_direction
from tests.readable_flight.period import hear, period, remember, start
from tests.readable_flight.thrust import SILENT_N

#: largest difference that counts as rounding, as a share of the largest component
ROUNDING = 1e-9
#: the same of what the filter knows: with late fixes it goes on from its own rounding
FILTERED = 1e-7
#: change of the inputs by which a choice on a knife's edge is told, and how often it is tried
NUDGE, NUDGES = 1e-12, 24
#: accuracy of a tumbling chief's attitude, rad, see docs/reference/limits.md
CHIEF_RAD = 2e-4
#: the same of the axes about the Earth, in which the Sun stands, whose disc is 5e-3 rad across
SUN_RAD = 1e-6
#: fields that an integrator of the attitude makes
TURNED = (
    *("quaternion_b_from_h-", "angular_velocity_b_rad_s-"),
    *("attitude_quaternion", "attitude_rate_b_rad_s", "torque_b_n_m"),
)
#: fields that inference makes
FORCES = (
    *("fis_output_n", "force_asked_n", "force_body_n"),
    *("force_hill_n", "force_commanded_n", "safety_force_hill_n"),
)
#: constants that are counts, which rounding does not touch
WHOLE = (
    *("coast_below_points", "decision_period_s", "rehearsal_tours"),
    *("rehearsal_draws", "rehearsal_shapes", "rehearsal_period_s"),
)
LIMITS = (None, "keep_out", "keep_in", "speed", "passive_safety")


def written(mission: Mission, controller: Controller, scenario: Scenario) -> Flight:
    """The readable flight of what the product is given."""
    mission, surface = mission_of_case(mission, scenario), surface_of(mission)
    errors = {}
    if mission.navigation.mode == "fixes":
        drawn = errors_of(mission, [scenario])
        errors |= {name: values[0] for name, values in drawn._asdict().items()}
        filtered = replace(mission.navigation, process_noise_m_s2=process_noise(mission))
        mission = replace(mission, navigation=filtered)
    if mission.actuators.kind == "real":
        table, thrust = thrusters_of(mission).table, thrust_errors(mission, [scenario])
        errors |= {"table": table, "matrices": thrust.matrices[0], "arm": thrust.arms[0]}
    if mission.safety.probability is not None:
        bounds = bounds_of(mission)
        planned = min(bounds.planned_force_n, mission.deputy.max_force_n)
        braking = min(bounds.braking_force_n, mission.braking_force_n)
        errors["margins"] = (*spheres_of(mission, bounds), planned, braking, bounds.step_back_n)
    if "dynamics.drag_m_s2" in mission.varying:
        drag = mission.dynamics.drag_m_s2
        errors["more_drag"] = in_time(mission, "dynamics.drag_m_s2", scenario, drag)[:, 0] - drag
    return Flight(
        mission, controller, scenario, surface.points, surface.normals, surface.corners, Errors(**errors)
    )


def assert_as_written(mission: Mission, controller: Controller, scenario: Scenario) -> FlightLog:
    """Fly with the product; compare every period with the readable flight; return the product's log."""
    log = fly_logged(mission, controller, scenario)
    flight = written(mission, controller, scenario)
    assert_throughout(flight, log)
    if (log.command_reason[0] == list(REASONS).index("rehearsed")).any():
        flight = replace(flight, opening=log.force_asked_n[0])
    flight.__dict__["chief"] = [Rotation.from_quat(q) for q in log.quaternion_c_from_h]
    flight.__dict__["suns"] = list(zip(log.sun_angle_rad, log.sun_elevation_rad, strict=True))
    state, stretches = start(flight), dict(controller.stretches)
    for k in range(mission.num_controls + 1):
        if k in stretches:
            flight.__dict__["constants"] = replace(flight, controller=stretches[k]).constants
        result = period(flight, k, state)
        if differences(flight, k, result, log):
            result = on_a_knifes_edge(flight, k, state, log)
        if result[2] is not None:
            state = followed(flight, k, result, log)
    return log


def assert_throughout(flight, log):
    """Compare what needs no period: the chief's turning, the Sun, and what it ever lights."""
    for k, chief in enumerate(flight.chief):
        assert (chief.inv() * Rotation.from_quat(log.quaternion_c_from_h[k])).magnitude() < CHIEF_RAD
    logged = zip(log.sun_angle_rad, log.sun_elevation_rad, strict=True)
    for sun, expected, share in zip(logged, flight.suns, log.visible_sun_share, strict=True):
        np.testing.assert_allclose(sun_direction(*sun), sun_direction(*expected), rtol=0, atol=SUN_RAD)
        assert abs(share - share_of_sun(flight.mission, sun_direction(*expected))) < 1e3 * SUN_RAD


def followed(flight, k, result, log):
    """The state after a period, with truth, command and estimate where the log has them."""
    seen, _, state = result
    limit = flight.mission.deputy.max_force_n
    sensed = Rotation.from_quat(log.sensed_quaternion_b_from_h[k])
    wanted = np.clip(sensed.apply(log.force_body_n[k]), -limit, limit)
    if state.belief is not None and flight.mission.navigation.delay_s == 0.0:
        state.belief.state = log.estimate[k].copy()
        state.belief.covariance[:6, :6] = log.estimate_covariance[k]
    state.commands.pop()
    remember(flight, k, state, seen, wanted + log.safety_force_hill_n[k])
    hear(flight, k, state, log.force_hill_n[k])
    state.truth = np.concatenate((log.position_m[k + 1], log.velocity_m_s[k + 1]))
    state.attitude = Rotation.from_quat(log.quaternion_b_from_h[k + 1])
    state.rate = log.angular_velocity_b_rad_s[k + 1]
    state.is_inspected = log.is_inspected[k].copy()
    state.mass, state.spent = log.mass_kg[k + 1], log.delta_v_m_s[k + 1]
    return state


def differences(flight, k, result, log):
    """The fields of the log in which a period differs by more than rounding, with both values."""
    by_name = {}
    for name, expected in fields(flight, *result).items():
        value = of_log(log, name, k)
        near = signed_as(value, expected)
        if name == "command_reason":  # as silent counts less than inference may err by
            least = SILENT_N + allowed(flight, k, log, "force_asked_n")
            near = np.where(np.abs(log.force_asked_n[k]) < least, value, near)
        if not is_within(value, near, near, allowed(flight, k, log, name)):
            by_name[name] = expected, value
    return by_name


def of_log(log, name, k):
    """What the log has of a field in a period; a name that ends with a dash is of the next sample."""
    return np.asarray(getattr(log, name.rstrip("-"))[k + name.endswith("-")])


def signed_as(value, other):
    """Another value; of the two quaternions of an attitude the one that has the same sign."""
    if value.shape[-1:] != (4,):
        return np.asarray(other)
    return other * np.where(np.sum(value * other, axis=-1, keepdims=True) < 0.0, -1.0, 1.0)


def is_within(value, low, high, more):
    """Whether a value lies between two: a choice exactly, a number but for rounding and so much more."""
    if value.dtype.kind in "bi":
        return np.all((low <= value) & (value <= high))
    slack = ROUNDING * np.nanmax(np.abs([low, high, value]), initial=1e-3) + more
    return np.all((np.isnan(low) & np.isnan(value)) | ((low - slack <= value) & (value <= high + slack)))


def allowed(flight, k, log, name):
    """How far a field may be off besides rounding: what integrators and inference may err by."""
    mission, period = flight.mission, flight.mission.control_period_s
    if name.startswith("estimate"):  # a correction takes great covariances off, whose rounding stays
        return (FILTERED + corrected_error(k, log)) * np.abs(of_log(log, name, k)).max()
    if k == mission.num_controls:
        return 0.0
    moved = moving_error(flight, k, log) if flight.orbit is not None else 0.0
    if name in TURNED:  # of an ideal attitude, the direction to where the deputy moves
        nearest = np.linalg.norm(log.position_m[k : k + 2], axis=1).min()
        return turning_error(flight, k, log, name) + moved / nearest
    # inference agrees to 1e-12 of an output's range; the layer's change is rounded as what it is a change of
    ranges = [system.outputs[0].maximum - system.outputs[0].minimum for system in flight.controller.systems]
    force = 3e-12 * sum(ranges) + ROUNDING * np.abs(log.safety_force_hill_n[k]).max()
    pulled = force / mission.deputy.mass_kg * period
    fastest = flight.earth.fastest if flight.earth else 0.0
    margins = {
        "position_m-": pulled * period + moved,
        "velocity_m_s-": pulled + moved * fastest,
        "delta_v_m_s-": 3.0 * pulled,
    }
    return (dict.fromkeys(FORCES, force) | margins).get(name, 0.0)


def corrected_error(k, log):
    """What corrections have left of rounding in an estimate, as a share of it."""
    greatest = np.abs(log.estimate_covariance[: k + 1]).max(axis=(1, 2))
    return 64.0 * np.finfo(np.float64).eps * greatest.max() / greatest[-1]


def turning_error(flight, k, log, name):
    """What an integrator of fourth order may err by in a control period, in steps of a second at most.

    Its error in a step h is of fifth order in ``w h`` and ``sqrt(w' h^2)`` (Blanes, Casas, Oteo and Ros, The
    Magnus expansion and some of its applications, Physics Reports 470, 2009).
    """
    mission = flight.mission
    period, step = mission.control_period_s, min(1.0, mission.attitude_period_s)
    rates = np.vstack((log.attitude_rate_b_rad_s[k], log.angular_velocity_b_rad_s[k + 1]))
    fastest = np.linalg.norm(rates, axis=1).max() + mission.orbit.mean_motion_rad_s
    quickening = np.linalg.norm(np.diff(rates, axis=0), axis=1).max() / mission.attitude_period_s
    angle = period / step * max(fastest, np.sqrt(quickening)) ** 5 * step**5 / 72.0
    gains = mission.attitude.proportional_gain + mission.attitude.derivative_gain / step
    moment = np.linalg.norm(mission.deputy.inertia_kg_m2)
    if name == "torque_b_n_m":
        return angle * moment * gains
    return angle if "quaternion" in name else angle / step


def moving_error(flight, k, log):
    """What the integrator of motion about the Earth may err by in a control period, m.

    Its steps are of 0.02 rad at most, at the rate of the perigee, and its error is of fifth order in them.
    """
    mission, fastest = flight.mission, flight.earth.fastest
    steps = np.ceil(mission.control_period_s * fastest / 0.02)
    speed = np.linalg.norm(log.velocity_m_s[k])
    pull = np.abs(log.force_hill_n[k]).max() / mission.deputy.mass_kg
    pull += abs(mission.dynamics.drag_m_s2) + abs(mission.dynamics.radiation_m_s2)
    reach = np.linalg.norm(log.position_m[k]) + speed / fastest + pull / fastest**2
    return reach * steps * (mission.control_period_s * fastest / steps) ** 5


def on_a_knifes_edge(flight, k, state, log):
    """Show that a period that differs is one of nearly the same inputs; return that of them most like it."""
    generator, differing = np.random.default_rng(0), []
    runs = [nudged(flight, k, state, log, generator) for _ in range(NUDGES)]
    left = [differences(flight, k, run, log) for run in runs]
    for name in set.intersection(*map(set, left)):
        value = of_log(log, name, k)
        others = np.array([signed_as(value, fields(flight, *run)[name]) for run in runs])
        low, high = others.min(axis=0), others.max(axis=0)
        spread = high - low if value.dtype.kind == "f" else 0
        if not is_within(value, low - spread, high + spread, allowed(flight, k, log, name)):
            differing.append(f"{name} is {value}, as written {left[0][name][0]}, or from {low} to {high}")
    assert not differing, f"period {k}: " + "; ".join(differing)
    return runs[int(np.argmin([len(names) for names in left]))]


def nudged(flight, k, state, log, generator):
    """The period from inputs that differ by no more than rounding might."""

    def near(values, nudge=NUDGE):
        values = np.asarray(values, dtype=np.float64)
        return values + nudge * np.abs(values).max(initial=0.0) * generator.standard_normal(values.shape)

    other = replace(flight, points=near(flight.points), normals=near(flight.normals))
    kept = {"chief", "mesh", "earth", "orbit", "hill_axes"} & flight.__dict__.keys()
    other.__dict__.update({name: flight.__dict__[name] for name in kept})
    changed = {
        name: value if name in WHOLE else float(near(value)) for name, value in flight.constants.items()
    }
    other.__dict__["constants"] = defaultdict(float, changed)
    other.__dict__["suns"] = [(angle + NUDGE * generator.standard_normal(), up) for angle, up in flight.suns]
    state = deepcopy(state)
    state.truth = np.concatenate((near(state.truth[:3]), near(state.truth[3:])))
    state.attitude = state.attitude * Rotation.from_rotvec(NUDGE * generator.standard_normal(3))
    state.centres = near(state.centres)
    if state.belief is not None:
        state.belief.state = near(state.belief.state, NUDGE + corrected_error(k, log))
        scale = 1.0 + NUDGE * generator.standard_normal(len(state.belief.covariance))
        state.belief.covariance = state.belief.covariance * np.outer(scale, scale)
    return period(other, k, state)


def fields(flight, seen, done, after):
    """What the readable flight found, by the names of the log; of the next sample with a dash."""
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
    if done is None:
        return values
    values |= decided(flight, done.decision) | {
        "force_body_n": seen.sensed.inv().apply(done.decision.wanted),
        "force_hill_n": done.thrust.fired,
        "force_commanded_n": done.thrust.commanded,
        "command_reason": [list(REASONS).index(why) for why in done.reasons],
        "safety_limit": LIMITS.index(done.limit),
        "safety_force_hill_n": done.change,
        "position_m-": after.truth[:3],
        "velocity_m_s-": after.truth[3:],
        "delta_v_m_s-": after.spent,
        "mass_kg-": after.mass,
        "attitude_quaternion": [attitude.as_quat() for attitude, _, _ in done.instants],
        "attitude_rate_b_rad_s": [rate for _, rate, _ in done.instants],
        "torque_b_n_m": [torque for _, _, torque in done.instants],
    }
    if flight.mission.attitude.mode == "flown":
        values |= {"quaternion_b_from_h-": after.attitude.as_quat(), "angular_velocity_b_rad_s-": after.rate}
    return values


def decided(flight, decision):
    """What inference came to, by the names of the log."""
    count = len(flight.controller.systems)
    inputs, outputs = np.zeros((count, 3)), np.zeros(count)
    for system, (sensed, output) in enumerate(decision.inferred):
        inputs[system, : len(sensed)], outputs[system] = sensed, output
    return {
        "force_asked_n": decision.asked,
        "foreseen": np.full(3, np.nan) if decision.foreseen is None else decision.foreseen,
        "fis_input": inputs,
        "fis_output_n": outputs,
        "is_decided": decision.resting is None and not flight.has_plan,
    }
