"""A mission as plain numbers for the readable reference flight."""

from math import ceil, cos, inf, radians, sin
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fis_tools.compiled.decorator import compiled
from pipeline.flight.state.preview import look_stride, preview_stride
from pipeline.flight.world.chief import num_chief_steps
from pipeline.flight.world.course import chief_course
from pipeline.flight.world.light import RIGHT_ANGLE_DEG, reflection_of, sees_as_in_the_paper, shadowing_radius
from pipeline.flight.world.surface import surface_of
from pipeline.physics.motion import Motion, motion_over, orbit_parts
from pipeline.physics.occlusion import Occlusion
from pipeline.physics.orbit import Course
from pipeline.physics.reflection import Reflection
from pipeline.physics.rigid_body import tumble
from pipeline.settings.experiment import Mission

Floats = NDArray[np.float64]

#: longest step of the attitude integrator, s
LONGEST_STEP_S = 1.0


class PlainWorld(NamedTuple):
    """Parameters of the equations besides the start and the controller, SI and rad.

    A tick is a period of the attitude clock; a control period has `num_ticks` of them. Each is integrated in
    `num_substeps` steps.
    """

    mean_motion: float
    num_controls: int
    control_period: float
    num_ticks: int
    attitude_period: float
    num_substeps: int
    #: over a control period, over a tick, and over parts of an orbit
    motion: Motion
    tick: Motion
    orbit_parts: Motion
    #: of the chief about the Earth; off where motion is linear
    course: Course
    mass: float
    max_force: float
    max_torque: float
    #: (3, 3), body axes
    inertia: Floats
    inverse_inertia: Floats
    proportional_gain: Floats
    derivative_gain: Floats
    is_pointing_ideal: bool
    has_pole_blending: bool
    #: (3, 3) and (3,), chief axes
    chief_inertia: Floats
    chief_inverse_inertia: Floats
    chief_rate: Floats
    is_chief_tumbling: bool
    #: steps of the chief's integrator in a control period
    num_chief_steps: int
    #: (P, 3), chief axes
    points_c: Floats
    normals_c: Floats
    points_radius: float
    #: of a chief that is a mesh, in chief axes
    is_mesh: bool
    occlusion: Occlusion
    #: the Earth's shadow: radius of the chief's orbit, m, and the least share of the Sun that lights points
    has_shadow: bool
    orbit_radius: float
    min_sun_share: float
    #: sine of the angle by which the Sun may be below a point's horizon, and the chief's reflection
    past_terminator: float
    reflection: Reflection
    #: whether light and camera are the paper's, apart from the Sun's elevation
    is_papers_sight: bool
    has_camera_limits: bool
    cos_max_incidence: float
    max_range: float
    cos_min_sun_angle: float
    #: (3,), body axes
    boresight_b: Floats
    cos_half_angle: float
    coasts_when_complete: bool
    #: m
    min_distance: float
    max_distance: float
    #: control periods between previewed places
    preview_stride: int
    #: the same for the push that shows setting points, and motion over 0, 1, … of them, to the flight's end
    look_stride: int
    looks: Motion


def world_of(mission: Mission) -> PlainWorld:
    """Return a mission's settings as numbers.

    Parameters
    ----------
    mission : Mission
        Valid: the attitude period divides the control period, and this the duration; inertias are invertible.
    """
    n = mission.orbit.mean_motion_rad_s
    deputy, chief, attitude = mission.deputy, mission.chief, mission.attitude
    inertia = np.array(deputy.inertia_kg_m2, dtype=np.float64)
    chief_inertia = np.array(chief.inertia_kg_m2, dtype=np.float64)
    chief_rate = chief.initial_angular_velocity_rad_s
    surface, sensor, has_shadow = surface_of(mission), mission.sensor, mission.light.shadow != "none"
    is_any_incidence = sensor.max_incidence_deg == RIGHT_ANGLE_DEG
    return PlainWorld(
        mean_motion=n,
        num_controls=mission.num_controls,
        control_period=mission.control_period_s,
        num_ticks=mission.num_attitude_steps,
        attitude_period=mission.attitude_period_s,
        num_substeps=ceil(mission.attitude_period_s / LONGEST_STEP_S),
        motion=motion_over(mission.orbit, deputy, (mission.control_period_s,)),
        tick=motion_over(mission.orbit, deputy, (mission.attitude_period_s,)),
        orbit_parts=orbit_parts(mission.orbit, deputy),
        course=chief_course(mission),
        mass=deputy.mass_kg,
        max_force=deputy.max_force_n,
        max_torque=deputy.max_torque_n_m,
        inertia=inertia,
        inverse_inertia=np.linalg.inv(inertia).astype(np.float64),
        proportional_gain=attitude.proportional_gain * inertia,
        derivative_gain=attitude.derivative_gain * inertia,
        is_pointing_ideal=attitude.mode == "ideal",
        has_pole_blending=attitude.pole_blending,
        chief_inertia=chief_inertia,
        chief_inverse_inertia=np.linalg.inv(chief_inertia).astype(np.float64),
        chief_rate=np.array((0.0, 0.0, n) if chief_rate is None else chief_rate, dtype=np.float64),
        is_chief_tumbling=chief_rate is not None,
        num_chief_steps=num_chief_steps(mission),
        points_c=surface.points,
        normals_c=surface.normals,
        points_radius=chief.inspection_radius_m,
        is_mesh=chief.shape == "mesh",
        occlusion=surface.occlusion,
        has_shadow=has_shadow,
        orbit_radius=shadowing_radius(mission.orbit, mission.light) if has_shadow else inf,
        min_sun_share=mission.light.min_fraction,
        past_terminator=sin(radians(mission.light.past_terminator_deg)),
        reflection=reflection_of(mission.light),
        is_papers_sight=sees_as_in_the_paper(mission),
        has_camera_limits=not is_any_incidence
        or sensor.max_range_m is not None
        or sensor.min_sun_angle_deg > 0.0,
        cos_max_incidence=0.0 if is_any_incidence else cos(radians(sensor.max_incidence_deg)),
        max_range=inf if sensor.max_range_m is None else sensor.max_range_m,
        cos_min_sun_angle=cos(radians(sensor.min_sun_angle_deg)),
        boresight_b=np.array(sensor.boresight, dtype=np.float64),
        cos_half_angle=cos(radians(sensor.half_angle_deg)),
        coasts_when_complete=mission.coast_when_complete,
        min_distance=deputy.min_distance_m,
        max_distance=deputy.max_distance_m,
        preview_stride=preview_stride(mission),
        look_stride=look_stride(mission),
        looks=motion_over(
            mission.orbit,
            deputy,
            [
                count * mission.control_period_s
                for count in range(0, mission.num_controls + 1, look_stride(mission))
            ],
        ),
    )


@compiled
def turn_chief(world: PlainWorld, quaternion_c_from_h: Floats, chief_rate_c: Floats) -> tuple[Floats, Floats]:
    """Turn a tumbling chief for a control period; one that is aligned with Hill stays so."""
    if world.is_chief_tumbling:
        quaternion_c_from_h, chief_rate_c = tumble(
            quaternion_c_from_h,
            chief_rate_c,
            world.chief_inertia,
            world.chief_inverse_inertia,
            world.mean_motion,
            world.control_period,
            world.num_chief_steps,
        )
    return quaternion_c_from_h, chief_rate_c
