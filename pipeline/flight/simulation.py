"""Flights as a friend would ask for them: missions, starts and controllers in; outcomes and logs out."""

import os
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fis_tools.engines.kernel import LANES, Packed, evaluate, padded, scratch_for
from pipeline.flight.controller import Controller, constants_of, law_of, packed, planned_for
from pipeline.flight.guidance import num_clusters, preview_stride
from pipeline.flight.kernel import arrays
from pipeline.flight.kernel.arrays import NUM_OUTCOMES, NUM_ROWS, Law, Log, Workspace, World
from pipeline.flight.kernel.loop import fly_many
from pipeline.flight.kernel.safety import MOST_CUTS, guard_of
from pipeline.flight.log import FlightLog, Scenario
from pipeline.flight.signals import SIGNALS
from pipeline.physics.clohessy_wiltshire import input_matrix, state_transition
from pipeline.physics.illumination import ASTRONOMICAL_UNIT_M
from pipeline.physics.inspection_points import fibonacci_placement, regular_placement
from pipeline.physics.quaternion import dcm_b_from_h
from pipeline.physics.rigid_body import tumbling_step
from pipeline.settings.experiment import Mission

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Outcomes:
    """How flights ended, one entry a flight; controllers by scenarios where there are several controllers.

    Parameters
    ----------
    delta_v_m_s : array of float
    inspected_count : array of int
    mean_distance_m, min_distance_m, max_distance_m : array of float
        Over samples 0 … K.
    outside_m : array of float
        How far samples 1 … K were outside the distance limits at worst; zero inside.
    safety_periods : array of int
        In how many control periods the safety layer changed the force; zero where it is off.
    safety_delta_v_m_s : array of float
        Delta-v of its changes, ``sum |applied - asked| T/m`` over Hill components; what they add to
        `delta_v_m_s` may be less, or below zero.
    """

    delta_v_m_s: Floats
    inspected_count: NDArray[np.int64]
    mean_distance_m: Floats
    min_distance_m: Floats
    max_distance_m: Floats
    outside_m: Floats
    safety_periods: NDArray[np.int64]
    safety_delta_v_m_s: Floats

    @property
    def is_violated(self) -> NDArray[np.bool_]:
        """Whether a sample 1 … K was outside the distance limits."""
        return self.outside_m > 0.0


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
    steps = max(1, int(np.ceil(mission.control_period_s)))
    for k in range(1, len(attitudes)):
        for _ in range(steps):
            quaternion, rate_c = tumbling_step(
                quaternion,
                rate_c,
                inertia,
                inverse,
                mission.orbit.mean_motion_rad_s,
                mission.control_period_s / steps,
            )
        attitudes[k] = quaternion
    return attitudes


def pack_world(mission: Mission) -> World:
    """Turn a mission into the numbers that the compiled episode reads."""
    n, mass = mission.orbit.mean_motion_rad_s, mission.deputy.mass_kg
    instants = np.arange(mission.num_attitude_steps) * mission.attitude_period_s
    points = inspection_points(mission)
    placed = np.zeros((1, 3, padded(len(points))))
    if mission.chief.initial_angular_velocity_rad_s is None:
        placed[0, :, : len(points)] = points.T
    else:
        attitudes = chief_attitudes(mission)
        placed = np.zeros((len(attitudes), 3, padded(len(points))))
        for k, quaternion in enumerate(attitudes):
            placed[k, :, : len(points)] = dcm_b_from_h(quaternion).T @ points.T
    inertia = np.array(mission.deputy.inertia_kg_m2, dtype=np.float64)
    radius = mission.chief.inspection_radius_m
    stride = preview_stride(mission)
    return World(
        num_controls=mission.num_controls,
        num_attitude_steps=mission.num_attitude_steps,
        mean_motion=n,
        control_period=mission.control_period_s,
        attitude_period=mission.attitude_period_s,
        acceleration_per_force=1.0 / mass,
        transition=state_transition(n, mission.control_period_s),
        control=input_matrix(n, mission.control_period_s, mass),
        preview_stride=stride,
        preview_transition=np.stack(
            [state_transition(n, count * mission.control_period_s) for count in range(stride + 1)]
        ),
        instant_transition=np.ascontiguousarray(
            np.stack([state_transition(n, t) for t in instants], axis=-1)
        ),
        instant_control=np.ascontiguousarray(np.stack([input_matrix(n, t, mass) for t in instants], axis=-1)),
        points=placed,
        num_points=len(points),
        sun_threshold=radius * radius / ASTRONOMICAL_UNIT_M,
        horizon=radius * radius,
        cos_half_angle_squared=float(np.cos(np.radians(mission.sensor.half_angle_deg)) ** 2),
        boresight=np.array(mission.sensor.boresight, dtype=np.float64),
        is_spherical=bool(np.array_equal(inertia, inertia[0, 0] * np.eye(3))),
        inertia=inertia,
        inverse_inertia=np.linalg.inv(inertia).astype(np.float64),
        proportional_gain=mission.attitude.proportional_gain * inertia,
        derivative_gain=mission.attitude.derivative_gain * inertia,
        max_torque=mission.deputy.max_torque_n_m,
        max_force=mission.deputy.max_force_n,
        min_distance=mission.deputy.min_distance_m,
        max_distance=mission.deputy.max_distance_m,
        is_attitude_ideal=mission.attitude.mode == "ideal",
        has_pole_blending=mission.attitude.pole_blending,
        has_clusters=mission.guidance.kind == "clusters",
        coasts_when_complete=mission.coast_when_complete,
        guard=guard_of(mission),
    )


def make_workspace(world: World, numbers: Packed) -> Workspace:
    """Allocate what one thread flies in."""
    points, width = world.num_points, world.points.shape[2]
    clusters = num_clusters(points)
    has_systems = len(numbers.layout) > 0
    return Workspace(
        lanes=np.zeros(NUM_ROWS * LANES),
        aims=np.zeros(world.num_attitude_steps * 4 * LANES),
        unseen=np.zeros((LANES, width)),
        candidate=np.zeros(width),
        ahead=np.zeros(width),
        deadlines=np.zeros((LANES, width)),
        signals=np.zeros(len(SIGNALS) * LANES),
        passing=np.zeros(4 * LANES),
        inputs=np.zeros(3 * LANES),
        outputs=np.zeros(LANES),
        scratch=scratch_for(numbers) if has_systems else np.zeros(0),
        y_before=np.zeros((LANES, 3)),
        is_general=np.zeros(LANES, dtype=np.bool_),
        turned=np.zeros((LANES, 7)),
        candidates=np.zeros((3, points)),
        centres=np.zeros((LANES, clusters, 3)),
        num_centres=np.zeros(LANES, dtype=np.int64),
        clustered=np.zeros((LANES, width)),
        labels=np.zeros((2, points), dtype=np.int64),
        distances=np.zeros(points),
        sums=np.zeros((clusters, 4)),
        cuts=np.zeros((MOST_CUTS, 4)),
    )


def _make_log(num_controls: int, num_attitude_steps: int, num_points: int, num_systems: int) -> Log:
    samples = num_controls + 1 if num_points else 0
    return Log(
        position=np.zeros((samples, 3)),
        velocity=np.zeros((samples, 3)),
        quaternion=np.zeros((samples, 4)),
        angular_velocity=np.zeros((samples, 3)),
        attitude_quaternion=np.zeros((num_controls, num_attitude_steps, 4)),
        attitude_rate=np.zeros((num_controls, num_attitude_steps, 3)),
        torque=np.zeros((num_controls, num_attitude_steps, 3)),
        force_body=np.zeros((num_controls, 3)),
        force_hill=np.zeros((num_controls, 3)),
        num_candidates=np.zeros(samples, dtype=np.int64),
        target=np.zeros((samples, 3)),
        lambda_u=np.zeros(samples),
        eta_u=np.zeros(samples),
        fis_input=np.zeros((num_controls, num_systems, 3)),
        fis_output=np.zeros((num_controls, num_systems)),
        is_decided=np.zeros(num_controls, dtype=np.bool_),
        sun_angle=np.zeros(samples),
        is_inspected=np.zeros((samples, num_points), dtype=np.bool_),
        delta_v=np.zeros(samples),
        safety_limit=np.zeros(num_controls, dtype=np.int64),
        safety_force=np.zeros((num_controls, 3)),
    )


def stack_starts(scenarios: list[Scenario]) -> tuple[Floats, Floats]:
    """Return the starts of some scenarios, shape (n, 6), and their Sun angles, shape (n,)."""
    starts = np.array([[*s.position_m, *s.velocity_m_s] for s in scenarios], dtype=np.float64).reshape(-1, 6)
    return starts, np.array([s.sun_angle_rad for s in scenarios], dtype=np.float64)


def fly_population(
    world: World,
    law: Law,
    numbers: Packed,
    starts: Floats,
    sun_angles: Floats,
    workers: int | None = None,
    tracks: NDArray[np.float32] | None = None,
) -> Outcomes:
    """Fly every controller of a population from every start.

    Parameters
    ----------
    world : World
    law : Law
        Of the structure that the population shares.
    numbers : Packed
        n controllers.
    starts : (m, 6), sun_angles : (m,)
    workers : int, optional
        Threads; one for each processor unless given. The result does not depend on it.
    tracks : (n * m, K+1, 3) float32, optional
        Filled with positions, m, Hill axes.

    Returns
    -------
    Outcomes
        Arrays of shape (n, m).
    """
    num_pairs = len(numbers.values) * len(starts)
    outcomes = np.empty((num_pairs, NUM_OUTCOMES))
    workers = workers or os.cpu_count() or 1
    # four shares a thread, so that a slow share does not hold up the end
    bounds = np.linspace(0, num_pairs, min(num_pairs, 4 * workers if workers > 1 else 1) + 1).astype(int)
    silent = _make_log(0, 0, 0, 0)
    tracks = np.empty((0, 0, 3), dtype=np.float32) if tracks is None else tracks

    def fly_share(first: int, last: int) -> None:
        work = make_workspace(world, numbers)
        fly_many(
            world,
            law,
            numbers.values,
            numbers.rules,
            starts,
            sun_angles,
            work,
            silent,
            tracks,
            first,
            last,
            outcomes,
        )

    shares = list(zip(bounds[:-1].tolist(), bounds[1:].tolist(), strict=True))
    if len(shares) == 1:
        fly_share(*shares[0])
    else:
        with ThreadPoolExecutor(workers) as pool:
            for done in [pool.submit(fly_share, first, last) for first, last in shares]:
                done.result()
    return _outcomes(outcomes.reshape(len(numbers.values), len(starts), NUM_OUTCOMES))


def _outcomes(rows: Floats) -> Outcomes:
    return Outcomes(
        delta_v_m_s=rows[..., arrays.DELTA_V],
        inspected_count=np.rint(rows[..., arrays.INSPECTED]).astype(np.int64),
        mean_distance_m=rows[..., arrays.MEAN_DISTANCE],
        min_distance_m=rows[..., arrays.MIN_DISTANCE],
        max_distance_m=rows[..., arrays.MAX_DISTANCE],
        outside_m=rows[..., arrays.OUTSIDE],
        safety_periods=np.rint(rows[..., arrays.SAFETY_PERIODS]).astype(np.int64),
        safety_delta_v_m_s=rows[..., arrays.SAFETY_DELTA_V],
    )


def fly_all(
    mission: Mission,
    controller: Controller,
    scenarios: list[Scenario],
    workers: int | None = None,
    tracks: NDArray[np.float32] | None = None,
) -> Outcomes:
    """Fly one controller from many starts; arrays of shape (m,). See `fly_population` for the rest."""
    if is_by_the_reference(mission):
        return _outcomes_of_logs(mission, controller, scenarios, tracks)
    if controller.planner is not None:
        return _fly_planned(mission, controller, scenarios, workers, tracks)
    starts, sun_angles = stack_starts(scenarios)
    world = pack_world(mission)
    law, numbers = law_of(controller, mission.num_controls), packed(controller)
    many = fly_population(world, law, numbers, starts, sun_angles, workers, tracks)
    return Outcomes(**{name: values[0] for name, values in vars(many).items()})


def _fly_planned(
    mission: Mission,
    controller: Controller,
    scenarios: list[Scenario],
    workers: int | None,
    tracks: NDArray[np.float32] | None,
) -> Outcomes:
    """Plan for every start, and fly its plan from it."""
    world, numbers = pack_world(mission), packed(controller)

    def fly_one(case: int) -> Outcomes:
        law = law_of(planned_for(controller, scenarios[case]), mission.num_controls)
        track = None if tracks is None else tracks[case : case + 1]
        return fly_population(world, law, numbers, *stack_starts([scenarios[case]]), 1, track)

    with ThreadPoolExecutor(workers or os.cpu_count() or 1) as pool:
        try:
            flown = list(pool.map(fly_one, range(len(scenarios))))
        except BaseException:
            pool.shutdown(cancel_futures=True)
            raise
    return Outcomes(**{name: np.array([vars(one)[name][0, 0] for one in flown]) for name in vars(flown[0])})


def is_by_the_reference(mission: Mission) -> bool:
    """Tell whether a mission asks for scikit-learn's clusters, which only the readable reference flies by."""
    return mission.guidance.kind == "clusters" and mission.guidance.engine == "sklearn"


def _fly_reference(mission: Mission, controller: Controller, scenario: Scenario) -> FlightLog:
    from pipeline.flight.reference import loop  # noqa: PLC0415 - plain Python, and only here
    from pipeline.flight.reference.channels import channels_of  # noqa: PLC0415

    controller = planned_for(controller, scenario)
    numbers = packed(controller)

    def infer(system: int, inputs: Floats) -> float:
        row = inputs[np.newaxis, : len(controller.systems[system].inputs)]
        return float(evaluate(numbers, row, system)[0])

    plan = law_of(controller, mission.num_controls).plan
    channels = channels_of(
        controller.systems, controller.force_axes, plan if len(plan) else None, constants_of(controller)
    )
    return loop.fly(mission, scenario, channels, infer)


def _outcomes_of_logs(
    mission: Mission,
    controller: Controller,
    scenarios: list[Scenario],
    tracks: NDArray[np.float32] | None,
) -> Outcomes:
    rows = np.empty((len(scenarios), NUM_OUTCOMES))
    limits = mission.deputy
    for case, scenario in enumerate(scenarios):
        log = fly_logged(mission, controller, scenario)
        if tracks is not None:
            tracks[case] = log.position_m
        distance = np.linalg.norm(log.position_m, axis=1)
        outside = np.maximum(limits.min_distance_m - distance[1:], distance[1:] - limits.max_distance_m)
        rows[case, arrays.DELTA_V] = log.delta_v_m_s[-1]
        rows[case, arrays.INSPECTED] = log.is_inspected[-1].sum()
        rows[case, arrays.MEAN_DISTANCE] = distance.mean()
        rows[case, arrays.MIN_DISTANCE] = distance.min()
        rows[case, arrays.MAX_DISTANCE] = distance.max()
        rows[case, arrays.OUTSIDE] = max(0.0, float(outside.max()))
        rows[case, arrays.SAFETY_PERIODS] = np.count_nonzero(log.safety_limit)
        per_force = mission.control_period_s / limits.mass_kg
        rows[case, arrays.SAFETY_DELTA_V] = np.abs(log.safety_force_hill_n).sum() * per_force
    return _outcomes(rows)


def fly_logged(mission: Mission, controller: Controller, scenario: Scenario) -> FlightLog:
    """Fly one episode and keep everything that happened."""
    if is_by_the_reference(mission):
        return _fly_reference(mission, controller, scenario)
    world = pack_world(mission)
    law, numbers = law_of(planned_for(controller, scenario), mission.num_controls), packed(controller)
    log = _make_log(mission.num_controls, mission.num_attitude_steps, world.num_points, len(law.axes))
    starts, sun_angles = stack_starts([scenario])
    fly_many(
        world,
        law,
        numbers.values,
        numbers.rules,
        starts,
        sun_angles,
        make_workspace(world, numbers),
        log,
        np.empty((0, 0, 3), dtype=np.float32),
        0,
        1,
        np.empty((1, NUM_OUTCOMES)),
    )
    return FlightLog(
        position_m=log.position,
        velocity_m_s=log.velocity,
        quaternion_b_from_h=log.quaternion,
        angular_velocity_b_rad_s=log.angular_velocity,
        quaternion_c_from_h=chief_attitudes(mission),
        attitude_quaternion=log.attitude_quaternion,
        attitude_rate_b_rad_s=log.attitude_rate,
        torque_b_n_m=log.torque,
        force_body_n=log.force_body,
        force_hill_n=log.force_hill,
        num_candidates=log.num_candidates,
        target_m=log.target,
        lambda_u_rad=log.lambda_u,
        eta_u_rad=log.eta_u,
        fis_input=log.fis_input,
        fis_output_n=log.fis_output,
        is_decided=log.is_decided,
        sun_angle_rad=log.sun_angle,
        is_inspected=log.is_inspected,
        delta_v_m_s=log.delta_v,
        safety_limit=log.safety_limit,
        safety_force_hill_n=log.safety_force,
    )
