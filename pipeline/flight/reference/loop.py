"""One flight in plain order: the readable reference that the fast kernel is tested against.

At each sample k the deputy inspects, chooses a target among the candidates and infers a force, which is held
for a control period while the attitude clock ticks. The sequence is plain Python; the equations are
those of `pipeline.physics`, called one by one on small arrays.
"""

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from fis_tools.compiled.decorator import compiled
from fis_tools.engines import interpreter
from fis_tools.engines.program import assemble
from fis_tools.model import FuzzySystem
from pipeline.flight.cases.drag import drag_in_time
from pipeline.flight.reference import thrust
from pipeline.flight.reference.actuators import PlainThrusters
from pipeline.flight.reference.channels import MAX_INPUTS, Channels, measure
from pipeline.flight.reference.guidance import (
    ChooseTarget,
    choose_centroid,
    choose_cluster,
    choose_cluster_sklearn,
    cluster_memory,
    relative_angle,
)
from pipeline.flight.reference.navigation import Navigator
from pipeline.flight.reference.preview import preview
from pipeline.flight.reference.safety import assured, safety_world_of
from pipeline.flight.reference.see_push import cheapest_looks, push_of
from pipeline.flight.reference.sight import lit_points, seen_points, times_lit
from pipeline.flight.reference.tour import push_onto_tour
from pipeline.flight.reference.urgency import around_the_chief, urgent_direction
from pipeline.flight.reference.world import PlainWorld, turn_chief, world_of
from pipeline.flight.state.log import REHEARSED, FlightLog, Scenario, empty_log
from pipeline.flight.state.signals import PREVIEW, SETTING, TOUR, URGENCY, constant
from pipeline.flight.state.turns import AIMED, Turns
from pipeline.physics.attitude_control import FIRST_Y, blended_y, control_torque, desired_dcm, desired_y
from pipeline.physics.illumination import sun_angle, sun_direction_h, visible_share
from pipeline.physics.motion import propagate
from pipeline.physics.quaternion import conjugate, dcm_b_from_h, from_dcm, product
from pipeline.physics.rigid_body import relative_attitude_step
from pipeline.physics.two_body import move_beside
from pipeline.physics.vectors import cross, times, transposed_times
from pipeline.settings.experiment import Mission

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
Booleans = NDArray[np.bool_]

URGENCY_TIME, SKIRT_DISTANCE = constant("urgency_time_s"), constant("skirt_distance_m")
SEE_HORIZON, SEE_DAMPING = constant("see_horizon_s"), constant("see_damping_ks2")
NOTHING = np.zeros(3)
NO_TURN = np.array([0.0, 0.0, 0.0, 1.0])

#: index of a system in the channels, inputs of shape (3,) -> output, N
Infer = Callable[[int, Floats], float]


@compiled
def turned_points(points_c: Floats, quaternion_c_from_h: Floats) -> Floats:
    """Return points given in chief axes in Hill axes, shape (P, 3)."""
    return points_c @ dcm_b_from_h(quaternion_c_from_h)


@compiled
def gather_candidates(points_h: Floats, is_lit: Booleans, is_inspected: Booleans, candidates: Floats) -> int:
    """Write the points lit and not yet inspected into the columns of `candidates`; return how many."""
    num_candidates = 0
    for i in range(len(points_h)):
        if is_lit[i] and not is_inspected[i]:
            for axis in range(3):
                candidates[axis, num_candidates] = points_h[i, axis]
            num_candidates += 1
    return num_candidates


@compiled
def next_y(world: PlainWorld, position_h: Floats, y_h: Floats) -> Floats:
    """Return the desired second body axis at an attitude instant from the previous one, shape (3,)."""
    if world.has_pole_blending:
        return blended_y(position_h, y_h, world.attitude_period)
    return desired_y(position_h, y_h)


@compiled
def turn_for_a_tick(
    world: PlainWorld, quaternion_b_from_h: Floats, angular_velocity_b: Floats, torque_b: Floats
) -> tuple[Floats, Floats]:
    """Turn the deputy for an attitude period under a held torque."""
    hill_rate = np.array([0.0, 0.0, world.mean_motion])
    for _ in range(world.num_substeps):
        quaternion_b_from_h, angular_velocity_b = relative_attitude_step(
            quaternion_b_from_h,
            angular_velocity_b,
            world.inertia,
            world.inverse_inertia,
            torque_b,
            hill_rate,
            world.attitude_period / world.num_substeps,
        )
    return quaternion_b_from_h, angular_velocity_b


@compiled
def turn_deputy(
    world: PlainWorld,
    state: Floats,
    force_h: Floats,
    attitude: tuple[Floats, Floats, Floats],
    played: tuple[Floats, Floats],
    turn: Floats,
    thrust: tuple[Floats, Floats, Floats],
    quaternion_log: Floats,
    rate_log: Floats,
    torque_log: Floats,
) -> tuple[Floats, Floats, Floats]:
    """Turn the deputy over a control period, steered at every tick towards the chief.

    Parameters
    ----------
    world : PlainWorld
    state : array, shape (6,)
        At the sample, m and m/s, Hill axes.
    force_h : array, shape (3,)
        Held over the control period, N, Hill axes.
    attitude : tuple of arrays
        Quaternion (4,), relative rate (3,) in body axes, and y* (3,) in Hill axes, at the sample.
    played : tuple of arrays
        The desired attitude, shape (4,), and the torque, N m, shape (3,), of
        `pipeline.flight.state.turns`; each of shape (0,) if not played.
    turn : array, shape (4,)
        From the desired attitude to the one that the deputy takes for it.
    thrust : tuple of arrays
        The force, N, Hill axes, where it acts, m, body axes, and the torque of single thrusters, N m,
        body axes; each of shape (3,).
    quaternion_log, rate_log, torque_log : array, shape (S, 4), (S, 3), (S, 3)
        Written.

    Returns
    -------
    tuple of arrays
        `attitude` at the next sample, except y*, which is that of the last tick.
    """
    quaternion, rate, y = attitude
    wanted, given = played
    fired_h, arm, twist = thrust
    for tick in range(world.num_ticks):
        if tick > 0:
            state = propagate(world.tick, state, force_h)
            y = next_y(world, state[:3], y)
        desired = from_dcm(desired_dcm(state[:3], y)) if len(wanted) == 0 else wanted
        desired = product(desired, turn)
        if world.is_pointing_ideal:
            quaternion_log[tick] = desired
            continue
        torque = control_torque(
            quaternion, desired, rate, world.proportional_gain, world.derivative_gain, world.max_torque
        )
        if len(given) > 0:
            torque = given
        quaternion_log[tick] = quaternion
        rate_log[tick] = rate
        torque_log[tick] = torque
        fired_b = times(dcm_b_from_h(quaternion), fired_h)
        quaternion, rate = turn_for_a_tick(world, quaternion, rate, torque + cross(arm, fired_b) + twist)
    return quaternion, rate, y


@compiled
def clipped(force_h: Floats, max_force: float) -> Floats:
    """Return a force with each Hill axis clipped to the thrust limit, N, shape (3,)."""
    return np.minimum(np.maximum(force_h, -max_force), max_force)


def inference_of(systems: Sequence[FuzzySystem]) -> Infer:
    """Return the inference function of single-output systems, by the general interpreter."""
    programs = [assemble(system) for system in systems]

    def infer(system: int, inputs: Floats) -> float:
        row = inputs[np.newaxis, : len(systems[system].inputs)]
        return float(interpreter.evaluate(programs[system], row)[0, 0])

    return infer


def guidance_of(mission: Mission) -> ChooseTarget:
    """Return the function that chooses the targets of a mission."""
    if mission.guidance.kind == "centroid":
        return choose_centroid
    return choose_cluster_sklearn if mission.guidance.engine == "sklearn" else choose_cluster


def fly(  # noqa: PLR0912, PLR0915  (the plain order of a flight, in one piece)
    mission: Mission,
    scenario: Scenario,
    channels: Channels,
    infer: Infer,
    choose_target: ChooseTarget | None = None,
    opening_h: Floats | None = None,
    turns: Turns = AIMED,
) -> FlightLog:
    """Fly one flight.

    Parameters
    ----------
    mission : Mission
        Valid settings.
    scenario : Scenario
        The start.
    channels : Channels
        Mapping of the controller's variables to signals and axes.
    infer : callable
        Returns the output of a system, N, from its index in `channels` and three inputs, of which the last
        may be unused: `inference_of` its systems, or any other engine.
    choose_target : callable, optional
        By default that of the mission, `guidance_of`.
    opening_h : array, shape (3,), optional
        Fired in the first control period instead of what the rules decide, N, Hill axes.
    turns : Turns, optional
        Played instead of aiming the camera at the chief.
    """
    world, safety = world_of(mission), safety_world_of(mission)
    num_points = len(world.points_c)
    choose_target = choose_target or guidance_of(mission)
    memory = cluster_memory(num_points)
    log = empty_log(world.num_controls, world.num_ticks, num_points, len(channels.axes))
    sun_at_start = np.array([scenario.sun_angle_rad, scenario.sun_elevation_rad], dtype=np.float64)
    state = np.concatenate((scenario.position_m, scenario.velocity_m_s)).astype(np.float64)
    quaternion = np.array(mission.deputy.initial_quaternion, dtype=np.float64)
    rate = np.array(mission.rate_at_start_rad_s, dtype=np.float64)
    y = np.array(FIRST_Y)
    if world.has_pole_blending:
        y = desired_y(state[:3], y)
    quaternion_c = np.array([0.0, 0.0, 0.0, 1.0])
    rate_c = world.chief_rate
    is_inspected = np.zeros(num_points, dtype=np.bool_)
    candidates = np.zeros((3, memory.distances.size))
    delta_v = 0.0
    navigator = Navigator(mission, scenario) if mission.navigation.mode == "fixes" else None
    thrusters = PlainThrusters(mission, scenario) if mission.actuators.kind == "real" else None
    drag = drag_in_time(mission, [scenario])
    plan, constants = channels.plan, channels.constants
    has_plan = plan is not None
    last_lit, is_inspectable = times_lit(world, sun_at_start)
    is_papers = world.is_papers_sight and scenario.sun_elevation_rad == 0.0
    is_idle = np.zeros(num_points, dtype=np.bool_) if is_papers else ~is_inspectable
    log.is_inspectable[:] = is_inspectable
    log.mass_kg[0] = world.mass

    for k in range(world.num_controls + 1):
        position = state[:3].copy()
        velocity = state[3:].copy()
        y_before, y = y, next_y(world, position, y)
        turn = NO_TURN if navigator is None else navigator.turn(k)
        if world.is_pointing_ideal:
            quaternion = turns.attitude(k) if len(turns.attitudes) else from_dcm(desired_dcm(position, y))
            rate = np.zeros(3)
            quaternion = product(quaternion, conjugate(turn))
        dcm = dcm_b_from_h(quaternion)
        angle = sun_angle(sun_at_start[0], world.mean_motion, k * world.control_period)
        sun_h = sun_direction_h(angle, sun_at_start[1])
        points_h = turned_points(world.points_c, quaternion_c)
        is_lit = lit_points(world, quaternion_c, sun_h)
        boresight_h = transposed_times(dcm, world.boresight_b)
        is_inspected |= seen_points(world, quaternion_c, position, boresight_h, sun_h, is_lit & ~is_inspected)

        num_candidates = gather_candidates(points_h, is_lit, is_inspected, candidates)
        target = np.zeros(3)
        if num_candidates > 0:
            target = choose_target(candidates, num_candidates, position, memory)
        else:
            memory.num_centres[0] = 0
        log.position_m[k] = position
        log.velocity_m_s[k] = velocity
        truth = state
        if navigator is not None:  # from here to the thrusters the estimate counts
            state, log.estimate_covariance[k] = navigator.estimate(k, position, quaternion)
            log.estimate[k] = state
            position, velocity = state[:3].copy(), state[3:].copy()
            y = next_y(world, position, y_before)
        lambda_u = relative_angle(target[0], target[1], position[0], position[1])
        eta_u = relative_angle(target[0], target[2], position[0], position[2])

        sensed = product(quaternion, turn)
        dcm = dcm_b_from_h(sensed)
        log.quaternion_b_from_h[k], log.sensed_quaternion_b_from_h[k] = quaternion, sensed
        log.angular_velocity_b_rad_s[k] = rate
        log.quaternion_c_from_h[k] = quaternion_c
        log.num_candidates[k] = num_candidates
        log.target_m[k] = target
        log.lambda_u_rad[k] = lambda_u
        log.eta_u_rad[k] = eta_u
        log.sun_angle_rad[k], log.sun_elevation_rad[k] = angle, sun_at_start[1]
        log.visible_sun_share[k] = visible_share(sun_h, world.orbit_radius) if world.has_shadow else 1.0
        log.is_inspected[k] = is_inspected
        log.delta_v_m_s[k] = delta_v
        if k == world.num_controls:
            break

        is_done = is_inspected | is_idle
        is_complete = bool(is_done.all()) and world.coasts_when_complete
        decides = thrust.is_decision(channels, world, k)
        asked, foreseen, coasts = np.zeros(3), np.zeros(3), False
        if decides and not is_complete and not has_plan:
            if channels.needs & PREVIEW:
                foreseen = preview(world, state, k, sun_at_start, quaternion_c, rate_c, is_done)
            if thrust.may_coast(channels):
                log.foreseen[k] = foreseen
                coasts = thrust.is_coasting_enough(channels, world, foreseen)
        resting = None if has_plan else thrust.rest(is_complete, decides, coasts)
        if k == 0 and opening_h is not None:
            asked, resting = opening_h, REHEARSED
        elif plan is not None:
            asked = thrust.follow(plan, state, k)
        elif resting is None:
            time = k * world.control_period
            urgent, push = np.zeros(3), np.zeros(3)
            if channels.needs & URGENCY:
                is_wanted = is_lit & ~is_inspected
                urgent = urgent_direction(points_h, is_wanted, last_lit, time, constants[URGENCY_TIME])
                urgent = around_the_chief(urgent, position, constants[SKIRT_DISTANCE], world.min_distance)
            if channels.needs & SETTING:
                horizon = constants[SEE_HORIZON]
                is_setting = ~is_inspected & (last_lit > time) & (last_lit <= time + horizon)
                looks = cheapest_looks(
                    world, state, k, sun_at_start, quaternion_c, rate_c, is_setting, horizon
                )
                push = push_of(looks, last_lit, time, constants[URGENCY_TIME], constants[SEE_DAMPING])
                push = around_the_chief(push, position, constants[SKIRT_DISTANCE], world.min_distance)
            tour_push = np.zeros(3)
            if channels.needs & TOUR:
                tour_push = push_onto_tour(world, constants, state, (angle, sun_at_start[1]), urgent)
                tour_push = around_the_chief(
                    tour_push, position, constants[SKIRT_DISTANCE], world.min_distance
                )
            signals = measure(
                world,
                position,
                velocity,
                dcm,
                lambda_u,
                eta_u,
                target,
                angle,
                foreseen,
                urgent,
                push,
                tour_push,
                channels,
            )
            for f in range(len(channels.axes)):
                inputs = np.zeros(MAX_INPUTS)
                for i in range(MAX_INPUTS):
                    if channels.signals[f, i] >= 0:
                        inputs[i] = signals[channels.signals[f, i]]
                log.fis_input[k, f] = inputs
                log.fis_output_n[k, f] = infer(f, inputs)
                asked[channels.axes[f]] += log.fis_output_n[k, f]
        is_given = has_plan or resting == REHEARSED
        commanded = asked if is_given else thrust.beyond_dead_bands(channels, asked)
        wanted_h = thrust.in_hill_axes(channels, commanded, dcm)
        force_h = clipped(wanted_h, world.max_force)
        if safety.is_on:
            asked_h = force_h
            force_h, log.safety_limit[k] = assured(safety, state, asked_h)
            log.safety_force_hill_n[k] = force_h - asked_h
        log.is_decided[k] = resting is None and not has_plan
        log.force_body_n[k] = times(dcm, wanted_h)
        log.force_asked_n[k] = asked
        log.reason[k] = thrust.reasons(
            resting,
            asked,
            commanded,
            np.abs(wanted_h) > world.max_force,
            log.safety_force_hill_n[k],
            channels.is_force_hill,
        )

        if navigator is not None:
            told = (0, force_h) if thrusters is None else (thrusters.delay, thrusters.known(force_h))
            navigator.note(k, *told)
        fired_h = force_h
        if navigator is not None:  # thrusters turn with the true body
            fired_h = transposed_times(dcm_b_from_h(quaternion), times(dcm, force_h))
            fired_h = clipped(fired_h, world.max_force)
        fired_h = fired_h if thrusters is None else thrusters.fired(fired_h, dcm_b_from_h(quaternion))
        log.force_hill_n[k] = fired_h
        quaternion, rate, y = turn_deputy(
            world,
            state,
            force_h,
            (quaternion, rate, y),
            (turns.attitude(k), turns.torque(k, world.max_torque)),
            conjugate(turn),
            (fired_h, *((NOTHING, NOTHING) if thrusters is None else (thrusters.arm, thrusters.twist))),
            log.attitude_quaternion[k],
            log.attitude_rate_b_rad_s[k],
            log.torque_b_n_m[k],
        )
        quaternion_c, rate_c = turn_chief(world, quaternion_c, rate_c)
        total, mean_mass = np.abs(fired_h).sum(), world.mass
        log.mass_kg[k + 1] = world.mass
        if thrusters is not None:
            total, mean_mass, log.mass_kg[k + 1] = thrusters.burnt(fired_h)
        fired_h = fired_h * (world.mass / mean_mass)
        if world.course.is_on:
            pull = fired_h / world.mass + (drag[0, k] if len(drag) else 0.0)
            state = move_beside(world.course, k, truth, pull, sun_direction_h(*sun_at_start))
        else:
            state = propagate(world.motion, truth, fired_h)
        delta_v += total * world.control_period / mean_mass
    return log
