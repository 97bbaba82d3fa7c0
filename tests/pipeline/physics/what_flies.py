"""What flies, for one deputy: the functions of compiled flights on arrays, run as plain Python."""

from types import SimpleNamespace

import numpy as np

from fis_tools.compiled.decorator import plainly
from fis_tools.compiled.three import Three
from pipeline.flight.period.act import attitude
from pipeline.physics import motion
from pipeline.physics.illumination import visible_share
from pipeline.physics.two_body import hill_from_inertial, inertial_from_hill, stepped


def motion_over(mean_motion, seconds, mass):
    """Return the motion beside a circular orbit over one duration, by the closed form."""
    closed = motion.state_transition(mean_motion, seconds), motion.input_matrix(mean_motion, seconds, mass)
    return motion.Motion(*(matrix[np.newaxis] for matrix in closed))


def propagate(linear, state, force_h):
    """Return a state, shape (6,), after the first duration of a motion under a held force, N, Hill axes."""
    held = motion.propagator_of(linear, 0), Three(*state[:3]), Three(*state[3:]), Three(*force_h)
    return np.array([*motion.position_after(*held), *motion.velocity_after(*held)])


def move_beside(course, period, state, force, sun):
    """Move a deputy about the Earth by a control period under a force per mass, m/s^2, Hill axes."""
    row = 2 * course.num_steps * period
    light = Three(*(-course.radiation * np.asarray(sun)))

    def shine(at):
        height, distance = course.axes[at, 0] @ sun, np.linalg.norm(course.positions[at])
        return visible_share(height, distance) if course.has_shadow else 1.0

    with plainly("pipeline"):
        position, velocity = inertial_from_hill(course, row, Three(*state[:3]), Three(*state[3:]))
        for _ in range(course.num_steps):
            shares = Three(shine(row), shine(row + 1), shine(row + 2))
            position, velocity = stepped(course, row, position, velocity, Three(*force), light, shares)
            row += 2
        position, velocity = hill_from_inertial(course, row, position, velocity)
    return np.array([*position, *velocity])


def turning_by(mean_motion):
    """Return the rates of Hill axes that turn uniformly, as a world has them."""
    return np.array([[0.0, 0.0, mean_motion]])


def hill_rate_b(quaternion, mean_motion):
    """Return the rate of Hill axes in body axes."""
    world, still = SimpleNamespace(hill_rates=turning_by(mean_motion)), Three(0.0, 0.0, 0.0)
    with plainly("pipeline"):
        return -np.array(attitude.relative_rate(world, 0, tuple(quaternion), still))


def turned(quaternion, rate, inertia, torque, seconds, mean_motion=0.0):
    """Return attitude and rate relative to Hill after a held torque."""
    world = SimpleNamespace(
        attitude_period=seconds,
        hill_rates=turning_by(mean_motion),
        inertia=inertia,
        inverse_inertia=np.linalg.inv(inertia),
    )
    inertial = Three(*(rate + hill_rate_b(quaternion, mean_motion)))
    with plainly("pipeline"):
        quaternion, inertial = attitude.turn_body(world, 0, tuple(quaternion), inertial, Three(*torque))
    quaternion = np.array(quaternion) / np.linalg.norm(quaternion)
    return quaternion, np.array(inertial) - hill_rate_b(quaternion, mean_motion)


def turned_by_gradient(quaternion, inertia, seconds, mean_motion):
    """Return attitudes after each second under gravity's gradient alone, from rest relative to Hill."""
    inverse, gradient = np.linalg.inv(inertia), 3.0 * mean_motion**2
    named = {"inertia": inertia, "inverse_inertia": inverse, "gravity_gradient": np.array([gradient])}
    world = SimpleNamespace(attitude_period=1.0, hill_rates=turning_by(mean_motion), **named)
    q, rate, attitudes = tuple(quaternion), Three(*hill_rate_b(quaternion, mean_motion)), [quaternion]
    with plainly("pipeline"):
        for _ in range(seconds):
            q, rate = attitude.turn_body(world, 0, q, rate, attitude.gradient_torque(world, 0, q))
            attitudes.append(np.array(q) / np.linalg.norm(q))
    return np.array(attitudes)


def control_torque(quaternion, desired, rate, proportional_gain, derivative_gain, max_torque):
    """Return the torque of the attitude law, N m, body axes, from the rate relative to Hill."""
    world = SimpleNamespace(
        proportional_gain=proportional_gain,
        derivative_gain=derivative_gain,
        max_torque=max_torque,
        hill_rates=turning_by(0.0),
    )
    with plainly("pipeline"):
        return np.array(attitude.control_torque(world, 0, tuple(quaternion), tuple(desired), Three(*rate)))


def error_vector(quaternion, desired):
    """Return the vector part of the rotation from the desired to the actual attitude."""
    with plainly("pipeline"):
        return np.array(attitude.error_of(tuple(quaternion), tuple(desired)))
