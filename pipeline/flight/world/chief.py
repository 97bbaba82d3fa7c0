"""The chief's orbit, where the deputy moves about the Earth or its shadow matters, and its attitude."""

import math
from functools import lru_cache

import numpy as np

from pipeline.array_types import Floats
from pipeline.constants import EARTH_RADIUS_M
from pipeline.physics.attitude import longest_tumbling_step, tumble
from pipeline.physics.course import TrueCourse, seen_from_course, true_course, turned_about
from pipeline.physics.orbit import NO_COURSE, Course, Elements, course_of
from pipeline.physics.transitions import NO_TRANSITIONS, Transitions, transitions_of
from pipeline.settings.experiment import Mission, SettingError
from pipeline.settings.mission import TwoBody
from pipeline.settings.orbit import LOWEST_M

#: how far beyond a flight's end deputies predict on a true course: as long as tours lead ahead, s
BEYOND_S = 3600.0


def chief_course(mission: Mission, beyond_s: float = 0.0, **changes: float) -> Course:
    """Return the course of a mission's chief, over the whole flight, with some of its `Elements` changed.

    It reaches some seconds beyond the flight's end.

    Raises
    ------
    SettingError
        If the orbit dips into the air.
    """
    orbit = mission.orbit
    if not isinstance(mission.dynamics, TwoBody):
        return NO_COURSE
    check_perigee(mission)
    elements = elements_of(mission)._replace(**changes)
    chief = orbit.mean_motion_rad_s, orbit.elements.semi_major_axis_m, elements
    num_periods = mission.num_controls + math.ceil(beyond_s / mission.control_period_s)
    course = course_of(*chief, mission.light.shadow != "none", mission.control_period_s, num_periods)
    course = course._replace(earths=1.0 / orbit.earth_radii)
    if orbit.days_at_start is None or not mission.has_true_course:
        return course
    pole, turns = orbit.sun_moved(mission.control_period_s * np.arange(num_periods + 1))
    return course._replace(sun_turns=turned_about(np.array(pole), np.array(turns)))


def elements_of(mission: Mission) -> Elements:
    """Return the orbit of a mission's chief about the Earth, and what accelerates the deputy more."""
    given = vars(mission.dynamics) | mission.orbit.elements._asdict()
    elements = Elements(**{name: given[name] for name in Elements._fields})
    return elements._replace(j2=elements.j2 * mission.orbit.earth_radii**2)


def greatest_drag(mission: Mission, dynamics: TwoBody) -> float:
    """Return the greatest acceleration by drag of a flight, m/s^2."""
    drag = abs(dynamics.drag_m_s2)
    if drag == 0.0 or (mission.orbit.elements.eccentricity == 0.0 and dynamics.scale_height_m is None):
        return drag
    slowed, free = (chief_course(mission, drag_m_s2=unit).common for unit in (1.0, 0.0))
    return float(drag * np.linalg.norm(slowed - free, axis=1).max())


@lru_cache(maxsize=4)  # what is made of a mission asks for it several times
def true_course_of(mission: Mission) -> TrueCourse | None:
    """Return the true course of a mission's chief; None where Hill axes turn uniformly.

    They do on a circle about a sphere, where the mean motion tells all. On an ellipse, or about an oblate
    Earth, whatever turns relative to Hill axes follows the true course.
    """
    return true_course(chief_course(mission)) if mission.has_true_course else None


@lru_cache(maxsize=8)  # tables of a megabyte, which rehearsals ask for again and again
def predicted_motion(mission: Mission, beyond_s: float = 0.0) -> tuple[Course, Transitions]:
    """Return the course that deputies predict by, and motion along it.

    They reach so many seconds beyond the end or, if that is longer, as far as tours and the safety layer look
    ahead. Neither is of use where Hill axes turn uniformly, as predictions have it there.
    """
    if not mission.has_true_course:
        return NO_COURSE, NO_TRANSITIONS
    safety = mission.safety
    drift_s = max(safety.passive_horizon_s, safety.keep_in_horizon_s) if safety.kind == "filter" else 0.0
    course = chief_course(mission, max(BEYOND_S, beyond_s, drift_s))
    return course, transitions_of(course, mission.deputy.mass_kg)


def turn_of(mission: Mission) -> float:
    """Return by what angle Hill axes turn in a flight, rad, and free motion and the Sun about the chief."""
    course = true_course_of(mission)
    if course is None:
        return mission.orbit.mean_motion_rad_s * mission.duration_s
    return float(mission.control_period_s * np.linalg.norm(course.rates[:-1], axis=1).sum())


def tide_of(mission: Mission) -> float:
    """Return the acceleration that holds a deputy at rest above the chief, over its height, 1/s^2.

    On a true course it is the greatest of a flight, of ``2 mu/R^3 + w^2``, on a circle ``3 n^2``.
    """
    course, n = true_course_of(mission), mission.orbit.mean_motion_rad_s
    if course is None:
        return 3.0 * n**2
    gravity = n**2 * mission.orbit.elements.semi_major_axis_m**3
    return float((2.0 * gravity / course.radius**3 + course.rates[:, 2] ** 2).max())


def gravity_gradients(mission: Mission) -> Floats:
    """Return ``3 mu/R^3`` at each sample of a true course, else ``3 n^2``, (K+1 or 1,), 1/s^2."""
    course, n = true_course_of(mission), mission.orbit.mean_motion_rad_s
    if course is None:
        return np.array([3.0 * n**2])
    return np.asarray(3.0 * n**2 * (mission.orbit.elements.semi_major_axis_m / course.radius) ** 3)


def hill_rates(mission: Mission) -> Floats:
    """Return `World.hill_rates`."""
    course = true_course_of(mission)
    return np.array([[0.0, 0.0, mission.orbit.mean_motion_rad_s]]) if course is None else course.rates


def chief_distances(mission: Mission, course: Course) -> Floats:
    """Return the chief's distances from the Earth's centre at the samples of an eccentric orbit's course, m.

    None of a circle, whose radius is the semi-major axis, though oblateness moves it by some kilometres.
    About another planet they are as many of the Earth's radii as of its own.
    """
    if not course.is_on or mission.orbit.elements.eccentricity == 0.0:
        return np.zeros(0)
    return np.asarray(course.earths * np.linalg.norm(course.positions[:: 2 * course.num_steps], axis=1))


def shadowing_radius(mission: Mission) -> float:
    """Return the semi-major axis of the orbit on which the chief passes through the Earth's shadow, m.

    About another planet it is as many of the Earth's radii as of its own.

    Raises
    ------
    SettingError
        If the orbit lies inside the Earth.
    """
    radius, earths = mission.orbit.elements.semi_major_axis_m, mission.orbit.earth_radii
    if not radius > earths * EARTH_RADIUS_M:
        planet = "Earth" if earths == 1.0 else "planet"
        raise SettingError(
            f"the orbit's radius is {radius:,.0f} m, inside the {planet} whose shadow light.shadow="
            f"{mission.light.shadow} asks for; it must be greater than {earths * EARTH_RADIUS_M:,.0f} m: "
            "give a higher orbit"
        )
    return radius / earths


def check_perigee(mission: Mission) -> None:
    """Raise SettingError if an orbit dips into the Earth's air that would end it, or into another planet."""
    dynamics, elements, orbit = mission.dynamics, mission.orbit.elements, mission.orbit
    if not isinstance(dynamics, TwoBody):
        return
    perigee = elements.semi_major_axis_m * (1.0 - elements.eccentricity) - EARTH_RADIUS_M * orbit.earth_radii
    if not orbit.is_of_earth:
        if orbit.earth_radii != 1.0 and not perigee > 0.0:
            raise SettingError(
                f"the orbit's perigee is {-perigee / 1e3:,.1f} km below orbit.planet_radius_m; give a higher "
                "orbit, or a lower orbit.eccentricity"
            )
        return
    if not perigee >= LOWEST_M:
        where = "in the air" if perigee > 0.0 else "inside the Earth"
        raise SettingError(
            f"the orbit's perigee is at an altitude of {perigee / 1e3:,.1f} km, {where}; with "
            f"dynamics.model={dynamics.model} it must be at {LOWEST_M / 1e3:g} km or more, below which the "
            "air ends an orbit within a turn: give a higher orbit, or a lower orbit.eccentricity"
        )


#: longest step of the chief's integrator, s
LONGEST_STEP_S = 1.0
#: most steps in a flight; they take seconds
MOST_STEPS = 5_000_000


def num_chief_steps(mission: Mission) -> int:
    """Return the steps per control period that keep a tumbling chief accurate over a whole flight.

    Zero for a chief that is aligned with Hill axes.

    Raises
    ------
    SettingError
        If it turns so fast that a flight would need too many.
    """
    rate = mission.chief.initial_angular_velocity_rad_s
    if rate is None:
        return 0
    inertia = np.array(mission.chief.inertia_kg_m2, dtype=np.float64)
    mean_motion = mission.orbit.mean_motion_rad_s
    longest = longest_tumbling_step(inertia, np.array(rate), mean_motion, mission.duration_s)
    steps = math.ceil(mission.control_period_s / min(LONGEST_STEP_S, longest))
    in_flight = steps * mission.num_controls
    if in_flight > MOST_STEPS:
        raise SettingError(
            f"chief.initial_angular_velocity_rad_s is {list(rate)} and duration_s {mission.duration_s:g}; to "
            f"compute how the chief turns for so long takes {in_flight:.2g} steps, and there may be at most "
            f"{MOST_STEPS:,}: lower one of them"
        )
    return steps


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
    steps, course = num_chief_steps(mission), true_course_of(mission)
    # on a true course first relative to axes that do not turn
    n = mission.orbit.mean_motion_rad_s if course is None else 0.0
    for k in range(1, len(attitudes)):
        quaternion, rate_c = tumble(quaternion, rate_c, inertia, inverse, n, mission.control_period_s, steps)
        attitudes[k] = quaternion
    return attitudes if course is None else seen_from_course(course, attitudes)
