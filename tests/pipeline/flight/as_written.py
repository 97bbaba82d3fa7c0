"""Flights of the product beside the reference, period by period.

The reference begins each control period where the product's log is, so that a difference shows in the
period that it arises in, and none grows. A result that differs by more than rounding must be one that the
reference gives from inputs changed in their twelfth digit: such is a choice on a knife's edge, or a
formula that magnifies rounding. Where formulas are smooth that allows nothing.
"""

from collections import defaultdict
from copy import deepcopy
from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from fis_tools.model.thrust import REASONS, SILENT_N
from pipeline.flight.control.controller import Controller
from pipeline.flight.fly.reference import period_fields, reference_of, sample_fields, stretches
from pipeline.flight.fly.simulation import fly_logged
from pipeline.flight.reference.light import share_of_sun, sun_direction
from pipeline.flight.reference.period import period, remember_command, remember_fired, start
from pipeline.flight.state.log import FlightLog, Scenario
from pipeline.settings.experiment import Mission

#: largest difference that counts as rounding, as a share of the largest component
ROUNDING = 1e-9
#: the same of what the filter knows: with late fixes it goes on from its own rounding
FILTERED = 1e-7
#: change of the inputs by which a choice on a knife's edge is told, how often it is tried, and at a time
NUDGE, NUDGES, FEW_NUDGES = 1e-12, 100, 10
#: accuracy of a tumbling chief's attitude, rad, see docs/reference/keys.md
CHIEF_RAD = 2e-4
#: the same of the axes about the Earth, in which the Sun stands, whose disc is 5e-3 rad across
SUN_RAD = 1e-6
#: fields that an integrator of the attitude makes
TURNED = (
    *("quaternion_b_from_h-", "angular_velocity_b_rad_s-"),
    *("attitude_quaternion", "attitude_rate_b_rad_s", "torque_b_n_m"),
    "wheel_momentum_b_n_m_s",
)
#: fields that inference makes
FORCES = (
    *("fis_output_n", "force_asked_n", "force_body_n"),
    *("force_hill_n", "force_commanded_n", "safety_force_hill_n"),
)
#: what a flight of the reference computes of its mission and its Sun at the start
UNMOVED = {"chief", "mesh", "earth", "orbit", "hill_axes", "hill_rates", "circular_rates"}
UNMOVED |= {"predicted", "predicted_suns"}
#: constants that are counts, which rounding does not touch
WHOLE = (
    *("coast_below_points", "decision_period_s", "rehearsal_tours", "park_below_points"),
    *("rehearsal_draws", "rehearsal_shapes", "rehearsal_period_s"),
)


def assert_as_written(mission: Mission, controller: Controller, scenario: Scenario) -> FlightLog:
    """Fly with the product; compare every period with the reference; return the product's log."""
    log = fly_logged(mission, controller, scenario)
    flight = reference_of(mission, controller, scenario)
    assert_throughout(flight, log)
    is_rehearsed = (log.command_reason == list(REASONS).index("rehearsed")).any(axis=1)
    flight = replace(flight, given=np.insert(log.force_asked_n, 3, is_rehearsed, axis=1))
    flight.__dict__["chief"] = [Rotation.from_quat(q) for q in log.quaternion_c_from_h]
    flight.__dict__["suns"] = list(zip(log.sun_angle_rad, log.sun_elevation_rad, strict=True))
    state = start(flight)
    for k, flight in stretches(flight):  # noqa: B020 - as its controller is by then
        result = period(flight, k, state)
        if differences(flight, k, result, log):
            result = on_a_knifes_edge(flight, k, state, log)
        if result[2] is not None:
            command = None if state.belief is None else state.belief.acting[k].copy()
            state = followed(flight, k, result, log, command)
    return log


def assert_throughout(flight, log):
    """Compare what needs no period: the chief's turning, the Sun, and what it ever lights."""
    for k, chief in enumerate(flight.chief):
        assert (chief.inv() * Rotation.from_quat(log.quaternion_c_from_h[k])).magnitude() < CHIEF_RAD
    logged = zip(log.sun_angle_rad, log.sun_elevation_rad, strict=True)
    suns = zip(logged, flight.suns, log.visible_sun_share, flight.distances, strict=True)
    for sun, expected, share, distance in suns:
        np.testing.assert_allclose(sun_direction(*sun), sun_direction(*expected), rtol=0, atol=SUN_RAD)
        assert abs(share - share_of_sun(flight.mission, sun_direction(*expected), distance)) < 1e3 * SUN_RAD


def followed(flight, k, result, log, command):
    """The state after a period, with truth, command and estimate where the log has them.

    `command` is what the filter knows of a command from before, which acts in this period.
    """
    seen, act, state = result
    limit = flight.mission.deputy.max_force_n
    sensed = Rotation.from_quat(log.sensed_quaternion_b_from_h[k])
    wanted = np.clip(sensed.apply(log.force_body_n[k]), -limit, limit)
    if state.belief is not None and flight.mission.navigation.delay_s == 0.0:
        state.belief.state = log.estimate[k].copy()
        state.belief.covariance[:6, :6] = log.estimate_covariance[k]
    state.commands.pop()
    if state.belief is not None:
        state.belief.acting[k] = command
    remember_command(flight, k, state, seen, wanted + log.safety_force_hill_n[k])
    thrust = replace(act.thrust, fired=log.force_hill_n[k])
    remember_fired(flight, k, state, seen, thrust, log.mass_kg[k])
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
    # a correction takes great covariances off, whose rounding stays
    if name.startswith(("estimate", "innovation")):
        greatest = log.estimate[k] if name.startswith("innovation") else of_log(log, name, k)
        return (FILTERED + corrected_error(k, log)) * np.abs(greatest).max()
    if k == mission.num_controls:
        return 0.0
    moved = moving_error(flight, k, log) if flight.orbit is not None else 0.0
    if name in TURNED:  # of an ideal attitude, the direction to where the deputy moves
        distances = np.linalg.norm(log.position_m[k : k + 2], axis=1)
        moved += ROUNDING * distances.max()  # as positions are rounded
        return turning_error(flight, k, log, name) + moved / distances.min()
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
        # that of full wheels follows from what they hold
        return angle * moment * (gains + (log.wheel_momentum_b_n_m_s[k].any() and 1.0 / step**2))
    if name == "wheel_momentum_b_n_m_s":
        return angle * moment / step
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
    """Show that a period that differs is one of nearly the same inputs; return that of them most like it.

    The more are tried, the farther apart they lie: what few show, more would not undo.
    """
    generator, runs, left = np.random.default_rng(0), [], []
    while len(runs) < NUDGES:
        runs.append(nudged(flight, k, state, log, generator))
        left.append(differences(flight, k, runs[-1], log))
        if not left[-1]:
            return runs[-1]
        if len(runs) % FEW_NUDGES == 0 and not (differing := outside(flight, k, runs, left, log)):
            return runs[int(np.argmin([len(names) for names in left]))]
    raise AssertionError(f"period {k}: " + "; ".join(differing))


def outside(flight, k, runs, left, log):
    """Say of each field in which all runs differ from the log whether it is out of their reach."""
    differing = []
    for name in set.intersection(*map(set, left)):
        value = of_log(log, name, k)
        others = np.array([signed_as(value, fields(flight, *run)[name]) for run in runs])
        low, high = others.min(axis=0), others.max(axis=0)
        spread = high - low if value.dtype.kind == "f" else 0
        if not is_within(value, low - spread, high + spread, allowed(flight, k, log, name)):
            differing.append(f"{name} is {value}, as written {left[0][name][0]}, or from {low} to {high}")
    return differing


def nudged(flight, k, state, log, generator):
    """The period from inputs that differ by no more than rounding might."""

    def near(values, nudge=NUDGE):
        values = np.asarray(values, dtype=np.float64)
        return values + nudge * np.abs(values).max(initial=0.0) * generator.standard_normal(values.shape)

    other = replace(flight, points=near(flight.points), normals=near(flight.normals))
    kept = UNMOVED & flight.__dict__.keys()
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
        # with late fixes the reference has its own, see `followed`
        late = FILTERED if flight.mission.navigation.delay_s > 0.0 else 0.0
        state.belief.state = near(state.belief.state, NUDGE + corrected_error(k, log) + late)
        scale = 1.0 + NUDGE * generator.standard_normal(len(state.belief.covariance))
        state.belief.covariance = state.belief.covariance * np.outer(scale, scale)
    return period(other, k, state)


def fields(flight, seen, done, after):
    """What the reference found, by the names of the log; of the next sample with a dash."""
    values = sample_fields(flight, seen)
    values.pop("innovation_square", None)  # its rounding grows with the fix's accuracy
    if done is None:
        return values
    values |= period_fields(flight, seen, done) | {
        "position_m-": after.truth[:3],
        "velocity_m_s-": after.truth[3:],
        "delta_v_m_s-": after.spent,
        "mass_kg-": after.mass,
    }
    if flight.mission.attitude.mode == "flown":
        values |= {"quaternion_b_from_h-": after.attitude.as_quat(), "angular_velocity_b_rad_s-": after.rate}
    return values
