"""A mission as the numbers that the compiled flight reads."""

import numpy as np
from numpy.typing import NDArray

from fis_tools.compiled.vectors import aligned, padded
from pipeline.array_types import Floats
from pipeline.flight.period.look.guidance import POINTS
from pipeline.flight.state.arrays import World
from pipeline.flight.world.bounds import guard_of
from pipeline.flight.world.chief import (
    chief_attitudes,
    chief_course,
    chief_distances,
    gravity_gradients,
    hill_rates,
    predicted_motion,
    shadowing_radius,
)
from pipeline.flight.world.coasting import rows_after
from pipeline.flight.world.surface import ChiefSurface, surface_of
from pipeline.physics.illumination import Reflection, least_sun_height, sun_direction_h, visible_share
from pipeline.physics.motion import motion_over, orbit_parts
from pipeline.physics.orbit import Course
from pipeline.physics.quaternion import dcms_b_from_h
from pipeline.physics.sight import HEIGHT, NORMAL, NUM_SURFACE, SQUARE, Optics, sight_of
from pipeline.settings.equipment import RealActuators, Sensor
from pipeline.settings.experiment import Mission
from pipeline.settings.mission import Light

RIGHT_ANGLE_DEG, STRAIGHT_ANGLE_DEG = 90.0, 180.0


def sees_as_in_the_paper(mission: Mission) -> bool:
    """Return whether light and camera are the paper's, given a Sun in the orbit plane."""
    sensor = mission.sensor
    return (
        mission.light.shadow == "none"
        and mission.chief.shape == "sphere"
        and sensor.half_angle_deg < RIGHT_ANGLE_DEG
        and sensor.rectangle_deg is None
        and sensor.max_incidence_deg == RIGHT_ANGLE_DEG
        and sensor.max_range_m is None
        and sensor.min_range_m == 0.0
        and sensor.min_sun_angle_deg == 0.0
        and mission.light.past_terminator_deg == 0.0
        and mission.light.reflection == "none"
    )


def reflection_of(light: Light) -> Reflection:
    """Return the chief's reflection model."""
    colours = light.ambient, light.diffuse, light.specular, light.least_intensity, light.greatest_intensity
    ambient, diffuse, specular, least, greatest = (np.array(colour, dtype=np.float64) for colour in colours)
    is_on, exponent = light.reflection != "none", light.specular_exponent
    return Reflection(is_on, ambient, diffuse, specular, exponent, least, greatest)


def sun_shares(mission: Mission, angles: Floats, elevations: Floats) -> Floats:
    """Return the visible share of the Sun's disc at the K+1 samples, by the Sun's angles (rad), (K+1,)."""
    if mission.light.shadow == "none":
        return np.ones(len(angles))
    circle = np.full(len(angles), shadowing_radius(mission))
    distances = chief_distances(mission, chief_course(mission))
    seen = zip(angles.tolist(), elevations.tolist(), distances if len(distances) else circle, strict=True)
    return np.array([visible_share(sun_direction_h(*sun)[0], distance) for *sun, distance in seen])


#: between the positions at which a preview looks what coasting would show; the Sun turns by 8 deg meanwhile
PREVIEW_PERIOD_S = 120.0
#: the same for the push that shows setting points; the Sun turns by 4 deg
LOOK_PERIOD_S = 60.0


def inspection_points(mission: Mission) -> Floats:
    """Return the points of a mission in chief axes, shape (P, 3), m."""
    return surface_of(mission).points


def optics_of(mission: Mission) -> Optics:
    """Return the optics that sight depends on if light or camera are not the paper's."""
    sensor, light = mission.sensor, mission.light
    cosine, is_cone = float(np.cos(np.radians(sensor.half_angle_deg))), sensor.rectangle_deg is None
    across, up = np.tan(np.radians(sensor.rectangle_deg or (90.0, 90.0))).tolist()
    is_any = sensor.max_incidence_deg == RIGHT_ANGLE_DEG
    sunward = float(np.cos(np.radians(sensor.min_sun_angle_deg)))
    lowest = -2.0
    if light.shadow != "none":
        lowest = least_sun_height(shadowing_radius(mission), light.min_fraction)
    return Optics(
        least_height=lowest,
        # a whole sphere of view, with room for rounding
        cos_squared=cosine * abs(cosine) if is_cone and sensor.half_angle_deg < STRAIGHT_ANGLE_DEG else -2.0,
        incidence_squared=0.0 if is_any else float(np.cos(np.radians(sensor.max_incidence_deg)) ** 2),
        range_squared=np.inf if sensor.max_range_m is None else sensor.max_range_m**2,
        least_range_squared=sensor.min_range_m**2,
        most_sunward=sunward if sensor.min_sun_angle_deg else np.inf,
        past_terminator=float(np.sin(np.radians(light.past_terminator_deg))),
        tan_across=np.inf if is_cone else across,
        tan_up=np.inf if is_cone else up,
    )


def up_of(sensor: Sensor) -> Floats:
    """Return what is up in a camera's image, perpendicular to its boresight, body axes, (3,)."""
    boresight = np.array(sensor.boresight, dtype=np.float64)
    up = np.array(sensor.up) - np.dot(sensor.up, boresight) * boresight
    return np.asarray(up / (np.linalg.norm(up) or 1.0))


def keep_out_of(mission: Mission, axes: Floats) -> Floats:
    """Return `World.keep_out`; `axes`, (K+1 or 1, 3, 3), lead from Hill to chief."""
    spheres = np.array(mission.chief.keep_out_m, dtype=np.float64).reshape(-1, 4)
    placed = np.empty((len(axes), *spheres.shape))
    placed[..., :3], placed[..., 3] = spheres[:, :3] @ axes, spheres[:, 3]
    return placed


def least_heights_of(mission: Mission, course: Course) -> Floats:
    """Return `World.least_heights`."""
    if mission.light.shadow == "none":
        return np.zeros(0)
    distances, least = chief_distances(mission, course).tolist(), mission.light.min_fraction
    return np.array([least_sun_height(distance, least) for distance in distances], dtype=np.float64)


def surface_rows(surface: ChiefSurface, axes: Floats) -> Floats:
    """Return normals, heights and squared radii at the points, (K+1 or 1, NUM_SURFACE, P padded).

    In Hill axes, m; `axes`, (K+1 or 1, 3, 3), lead from Hill to chief.
    """
    num_points = len(surface.points)
    rows: Floats = aligned((len(axes), NUM_SURFACE, padded(num_points, POINTS)))
    for k, turned in enumerate(axes):
        rows[k, NORMAL : NORMAL + 3, :num_points] = turned.T @ surface.normals.T
    rows[:, HEIGHT, :num_points] = np.sum(surface.points * surface.normals, axis=1)
    rows[:, SQUARE, :num_points] = np.sum(surface.points**2, axis=1)
    return rows


def by_neighbourhood(points: Floats) -> NDArray[np.int64]:
    """Order points, shape (P, 3), so that each `POINTS` in a row are neighbours.

    The points are split in half across their longest axis, in whole vectors, and each half again.
    """
    parts, index = [np.arange(len(points))], 0
    while index < len(parts):
        part = parts[index]
        if len(part) <= POINTS:
            index += 1
            continue
        along = points[part, np.ptp(points[part], axis=0).argmax()]
        sorted_part, half = part[np.argsort(along, kind="stable")], padded(len(part) // 2, POINTS)
        parts[index : index + 1] = [sorted_part[:half], sorted_part[half:]]
    return np.concatenate(parts)


def pack_world(mission: Mission) -> World:
    """Return a mission as the numbers that the compiled episode reads.

    Raises
    ------
    SettingError
        If it is a fleet's: whoever flies fleets packs the mission `of_each` deputy.
    """
    mission.require_one_deputy("this flight")
    orbit, deputy, period = mission.orbit, mission.deputy, mission.control_period_s
    surface, attitudes = surface_of(mission), chief_attitudes(mission)
    points = surface.points
    if mission.chief.initial_angular_velocity_rad_s is None:
        attitudes = attitudes[:1]
    axes = dcms_b_from_h(attitudes)
    placed = aligned((len(axes), 3, padded(len(points), POINTS)))
    for k, turned in enumerate(axes):
        placed[k, :, : len(points)] = turned.T @ points.T
    order = np.arange(placed.shape[2])
    order[: len(points)] = by_neighbourhood(points)
    patches = aligned(placed.shape)
    patches[:] = placed[:, :, order]
    inertia = np.array(deputy.inertia_kg_m2, dtype=np.float64)
    start_dcm = dcms_b_from_h(np.array([deputy.initial_quaternion], dtype=np.float64))[0]
    actuators, rates = mission.actuators, hill_rates(mission)
    course, (ahead, transitions) = chief_course(mission), predicted_motion(mission)
    instants = mission.attitude_period_s * np.arange(mission.num_attitude_steps)
    stride, look = max(1, round(PREVIEW_PERIOD_S / period)), max(1, round(LOOK_PERIOD_S / period))
    return World(
        num_controls=mission.num_controls,
        first=0,
        last=mission.num_controls,
        num_attitude_steps=mission.num_attitude_steps,
        mean_motion=orbit.mean_motion_rad_s,
        hill_rates=rates,
        control_period=period,
        attitude_period=mission.attitude_period_s,
        acceleration_per_force=1.0 / deputy.mass_kg,
        delta_v_per_force=period * (1.0 / deputy.mass_kg),
        motion=motion_over(orbit, deputy, (period,)),
        instants=motion_over(orbit, deputy, instants),
        orbit_parts=orbit_parts(orbit, deputy),
        preview_stride=stride,
        strides=motion_over(orbit, deputy, period * np.arange(stride + 1)),
        look_stride=look,
        looks=motion_over(orbit, deputy, period * np.arange(0, mission.num_controls + 1, look)),
        points=placed,
        num_points=len(points),
        order=order,
        patches=patches,
        sight=sight_of(mission.chief.inspection_radius_m, float(np.radians(mission.sensor.half_angle_deg))),
        has_optics=not sees_as_in_the_paper(mission),
        optics=optics_of(mission),
        least_heights=least_heights_of(mission, ahead if ahead.is_on else course),
        reflection=reflection_of(mission.light),
        surface=surface_rows(surface, axes),
        occlusion=surface.occlusion,
        chief_axes=axes,
        boresight=np.array(mission.sensor.boresight, dtype=np.float64),
        up=up_of(mission.sensor),
        keep_out=keep_out_of(mission, axes),
        attitude_at_start=np.array(deputy.initial_quaternion, dtype=np.float64),
        # inertial: relative to Hill, and of Hill axes
        rate_at_start=np.array(mission.rate_at_start_rad_s) + start_dcm @ rates[0],
        is_spherical=bool(np.array_equal(inertia, inertia[0, 0] * np.eye(3))),
        inertia=inertia,
        inverse_inertia=np.linalg.inv(inertia).astype(np.float64),
        proportional_gain=mission.attitude.proportional_gain * inertia,
        derivative_gain=mission.attitude.derivative_gain * inertia,
        max_torque=deputy.max_torque_n_m,
        max_momentum=np.inf if deputy.max_momentum_n_m_s is None else deputy.max_momentum_n_m_s,
        max_force=deputy.max_force_n,
        min_distance=deputy.min_distance_m,
        max_distance=deputy.max_distance_m,
        gravity_gradient=gravity_gradients(mission) if mission.attitude.gravity_gradient else np.zeros(1),
        turns_by_thrust=isinstance(actuators, RealActuators)
        and (actuators.thrust_arm_m > 0.0 or actuators.thrusters is not None),
        is_attitude_ideal=mission.attitude.mode == "ideal",
        has_pole_blending=mission.attitude.pole_blending,
        has_clusters=mission.guidance.kind == "clusters",
        coasts_when_complete=mission.coast_when_complete,
        guard=guard_of(mission),
        course=course,
        after=rows_after(mission, mission.after_s),
        transitions=transitions,
    )
