"""Free and forced motion beside the chief's true course, tabulated sample by sample.

With X_k the solution of the variational equation ``d'' = G(R) d`` (O. Montenbruck and E. Gill, Satellite
Orbits, chapter 7; G is the gradient of the attraction of an oblate Earth at the chief) and T_k from relative
states in axes that do not turn to Hill states, ``Psi_k = T_k X_k`` leads from six constants of free motion to
the state at sample k. A newton held over control period i along Hill axes adds ``Gamma_i`` to the state at
its end, so that ::

    s_j = Psi_j (Psi_k^-1 s_k + sum over k <= i < j of Psi_(i+1)^-1 Gamma_i f_i)

Only the second order of the distance is missing, and what drag and sunlight do.
"""

from typing import NamedTuple

import numpy as np

from fis_tools.compiled.decorator import compiled
from fis_tools.compiled.three import Three, cofactors, dot
from pipeline.array_types import Floats
from pipeline.physics.orbit import Course


class Transitions(NamedTuple):
    """Motion at N samples, those beyond a flight's end among them; none where Hill axes turn uniformly."""

    onward: (
        Floats  # (N, 6, 6) Psi: from constants of free motion to position, m, and velocity, m/s, Hill axes
    )
    back: Floats  # (N, 6, 6) its inverse
    steps: Floats  # (N-1, 6, 6) Phi: from state to state over the control period that begins
    pushes: Floats  # (N-1, 6, 3) Gamma: effect of 1 N held over the control period that begins, at its end
    suns: Floats  # (N, 3, 3) from the Sun's direction at the start, Hill axes, to that in Hill axes


#: where Hill axes turn uniformly
NO_TRANSITIONS = Transitions(
    *(np.zeros((0, 6, 6)), np.zeros((0, 6, 6)), np.zeros((0, 6, 6))),
    *(np.zeros((0, 6, 3)), np.zeros((0, 3, 3))),
)


@compiled(error_model="numpy")
def gradient(course: Course, row: int) -> Floats:
    """Return the gradient of the attraction at the chief, (3, 3), 1/s^2, axes of the course."""
    chief, pole = course.positions[row], course.pole
    square = chief[0] * chief[0] + chief[1] * chief[1] + chief[2] * chief[2]
    height = pole[0] * chief[0] + pole[1] * chief[1] + pole[2] * chief[2]
    distance = np.sqrt(square)
    point = course.gravity / (distance * square)
    oblate = -course.oblateness / (square * square * distance)
    level = 1.0 - 5.0 * height * height / square
    gradients = np.empty((3, 3))
    for i in range(3):
        # the attraction of oblateness is `oblate` times this, along axis i
        along = level * chief[i] + 2.0 * height * pole[i]
        for j in range(3):
            same = 1.0 if i == j else 0.0
            tilted = 10.0 * height * (height * chief[j] / square - pole[j]) / square
            changed = level * same + tilted * chief[i] + 2.0 * pole[i] * pole[j]
            of_point = point * (3.0 * chief[i] * chief[j] / square - same)
            gradients[i, j] = of_point + oblate * (changed - 5.0 * along * chief[j] / square)
    return gradients


@compiled(error_model="numpy")
def to_hill_states(course: Course, row: int) -> Floats:
    """Return T, (6, 6), from relative states in axes of the course to Hill states."""
    states, axes, turning = np.zeros((6, 6)), course.axes[row], course.turning[row]
    for j in range(3):
        for i in range(3):
            states[i, j] = states[3 + i, 3 + j] = axes[i, j]
        states[3, j] = turning[2] * axes[1, j] - turning[1] * axes[2, j]
        states[4, j] = turning[0] * axes[2, j] - turning[2] * axes[0, j]
        states[5, j] = turning[1] * axes[0, j] - turning[0] * axes[1, j]
    return states


@compiled(error_model="numpy")
def accelerations(course: Course, row: int, mass: float, positions: Floats) -> Floats:
    """Return the second derivatives, (3, 9), of six states' positions and of those under three forces."""
    pulls = np.dot(gradient(course, row), positions)
    for i in range(3):
        for j in range(3):
            pulls[i, 6 + j] += course.axes[row, j, i] / mass
    return pulls


@compiled(error_model="numpy")
def tabulate(
    course: Course, mass: float, onward: Floats, back: Floats, steps: Floats, pushes: Floats
) -> None:
    """Fill `onward`, `back`, `steps` and `pushes` of `Transitions` by the steps that true motion takes."""
    half, state = 0.5 * course.step, np.eye(6)
    onward[0] = to_hill_states(course, 0)
    from_hill = np.linalg.inv(onward[0])
    back[0] = from_hill
    for k in range(len(pushes)):
        # columns: those of the state's identity, then one for each axis of the force
        positions, speeds = np.zeros((3, 9)), np.zeros((3, 9))
        for axis in range(3):
            positions[axis, axis] = speeds[axis, 3 + axis] = 1.0
        row = 2 * course.num_steps * k
        for _ in range(course.num_steps):
            first = accelerations(course, row, mass, positions)
            middle = accelerations(
                course, row + 1, mass, positions + half * speeds + 0.5 * half * half * first
            )
            last = accelerations(
                course, row + 2, mass, positions + 2.0 * half * speeds + 2.0 * half * half * middle
            )
            positions = positions + 2.0 * half * speeds + (2.0 / 3.0) * half * half * (first + 2.0 * middle)
            speeds = speeds + half / 3.0 * (first + 4.0 * middle + last)
            row += 2
        period = np.empty((6, 9))
        period[:3], period[3:] = positions, speeds
        free, hill = np.ascontiguousarray(period[:, :6]), to_hill_states(course, row)
        state = np.dot(free, state)
        onward[k + 1] = np.dot(hill, state)
        back[k + 1] = np.linalg.inv(onward[k + 1])
        steps[k] = np.dot(np.dot(hill, free), from_hill)
        from_hill = np.linalg.inv(hill)
        pushes[k] = np.dot(hill, np.ascontiguousarray(period[:, 6:]))


def transitions_of(course: Course, mass: float) -> Transitions:
    """Return the transitions along a course, at the ends of its control periods, of a deputy's mass, kg."""
    num_samples = (len(course.positions) - 1) // (2 * course.num_steps) + 1
    onward, back = np.empty((num_samples, 6, 6)), np.empty((num_samples, 6, 6))
    steps, pushes = np.empty((num_samples - 1, 6, 6)), np.empty((num_samples - 1, 6, 3))
    tabulate(course, mass, onward, back, steps, pushes)
    suns = course.axes[:: 2 * course.num_steps].copy()
    if len(course.sun_turns) > 0:
        suns = suns @ course.sun_turns
    return Transitions(onward, back, steps, pushes, suns)


@compiled(error_model="numpy", forceinline=True)
def follows_course(motion: Transitions) -> bool:
    """Return whether motion follows the chief's true course, and Hill axes do not turn uniformly."""
    return len(motion.onward) > 0


@compiled(error_model="numpy", forceinline=True)
def along_six(rows: Floats, row: int, a: Three, b: Three) -> float:
    """Return a row of a matrix times two vectors, one above the other."""
    upper: float = rows[row, 0] * a.x + rows[row, 1] * a.y + rows[row, 2] * a.z
    return upper + (rows[row, 3] * b.x + rows[row, 4] * b.y + rows[row, 5] * b.z)


@compiled(error_model="numpy", forceinline=True)
def times_six(rows: Floats, first: int, a: Three, b: Three) -> Three:
    """Return three rows of a matrix, of six columns or more, times two vectors, one above the other."""
    return Three(
        along_six(rows, first, a, b), along_six(rows, first + 1, a, b), along_six(rows, first + 2, a, b)
    )


@compiled(error_model="numpy", forceinline=True)
def constants_at(motion: Transitions, k: int, position: Three, velocity: Three) -> tuple[Three, Three]:
    """Return the six constants of free motion from a state at a sample."""
    back = motion.back[k]
    return times_six(back, 0, position, velocity), times_six(back, 3, position, velocity)


@compiled(error_model="numpy", forceinline=True)
def position_at(motion: Transitions, k: int, constants: tuple[Three, Three]) -> Three:
    """Return the position at a sample, m, from the constants of free motion."""
    return times_six(motion.onward[k], 0, constants[0], constants[1])


@compiled(error_model="numpy", forceinline=True)
def gradients_of(motion: Transitions, k: int, sample: int, along: Three) -> tuple[Three, Three]:
    """Return the gradients of the position along a vector at a later sample of free motion.

    The first is with respect to the position at sample k, the second (s) with respect to the velocity.
    """
    onward, back = motion.onward[sample], motion.back[k]
    upper, lower = across_three(onward, 0, along), across_three(onward, 3, along)
    return (
        across_three(back, 0, upper) + across_three(back[3:], 0, lower),
        across_three(back, 3, upper) + across_three(back[3:], 3, lower),
    )


@compiled(error_model="numpy", forceinline=True)
def across_three(matrix: Floats, first: int, along: Three) -> Three:
    """Return a vector times the upper three rows of a matrix, at three columns from `first` on."""
    return Three(
        dot(along, column(matrix, 0, first)),
        dot(along, column(matrix, 0, first + 1)),
        dot(along, column(matrix, 0, first + 2)),
    )


@compiled(error_model="numpy", forceinline=True)
def effect_of_push(motion: Transitions, k: int, sample: int) -> tuple[Three, Three, Three]:
    """Return by what a push at sample k along each axis moves the position at a later sample, s."""
    onward, back = motion.onward[sample], motion.back[k]
    return (
        times_six(onward, 0, column(back, 0, 3), column(back, 3, 3)),
        times_six(onward, 0, column(back, 0, 4), column(back, 3, 4)),
        times_six(onward, 0, column(back, 0, 5), column(back, 3, 5)),
    )


@compiled(error_model="numpy", forceinline=True)
def column(matrix: Floats, first: int, index: int) -> Three:
    """Return three entries of a column of a matrix, from row `first` on."""
    return Three(matrix[first, index], matrix[first + 1, index], matrix[first + 2, index])


@compiled(error_model="numpy", forceinline=True)
def push_that_shifts(motion: Transitions, k: int, sample: int, shift: Three) -> Three:
    """Return the push at sample k, m/s, that moves the position at a later sample by a shift, m."""
    along = effect_of_push(motion, k, sample)
    x, y, z = cofactors(along[0], along[1], along[2])
    return (1.0 / dot(along[0], x)) * Three(dot(x, shift), dot(y, shift), dot(z, shift))


@compiled(error_model="numpy", forceinline=True)
def times_three(matrix: Floats, first: int, a: Three) -> Three:
    """Return three rows of a matrix, (n, 3), from `first` on, times a vector."""
    return Three(
        matrix[first, 0] * a.x + matrix[first, 1] * a.y + matrix[first, 2] * a.z,
        matrix[first + 1, 0] * a.x + matrix[first + 1, 1] * a.y + matrix[first + 1, 2] * a.z,
        matrix[first + 2, 0] * a.x + matrix[first + 2, 1] * a.y + matrix[first + 2, 2] * a.z,
    )


@compiled(error_model="numpy", forceinline=True)
def state_after(
    motion: Transitions, period: int, position: Three, velocity: Three, force: Three
) -> tuple[Three, Three]:
    """Return the state at the end of a control period under a held force, N."""
    free = motion.steps[period]
    moved = times_six(free, 0, position, velocity), times_six(free, 3, position, velocity)
    return pushed_in_period(motion, period, moved, force)


@compiled(error_model="numpy", forceinline=True)
def pushed_in_period(
    motion: Transitions, period: int, free: tuple[Three, Three], force: Three
) -> tuple[Three, Three]:
    """Return the state at the end of a control period under a held force, N, from that without it."""
    pushes = motion.pushes[period]
    return free[0] + times_three(pushes, 0, force), free[1] + times_three(pushes, 3, force)


@compiled(error_model="numpy", forceinline=True)
def effect_in_period(motion: Transitions, period: int, p: Three, q: Three) -> Three:
    """Return what each component of a held force adds to ``p . r + q . v`` in a period, per newton."""
    pushes = motion.pushes[period]
    return across_three(pushes, 0, p) + across_three(pushes[3:], 0, q)
