"""Whether every start keeps the speed limit at all times and reaches the goal, as far as a tube shows it.

A theorem holds the numbers of the closed loop; systems drive each axis of it.
"""

from collections.abc import Callable, Mapping
from dataclasses import astuple, dataclass
from math import hypot

import numpy as np

from fis_tools.engines import interval
from fis_tools.model import FuzzyController, FuzzySystem
from pipeline.array_types import Floats
from pipeline.physics.motion import Motion
from pipeline.proof.tube import Axis, Enclosed, axis_of, surface_of
from pipeline.settings.experiment import Experiment

AXES = ("radial", "along_track", "cross_track")


class NotProvable(ValueError):  # noqa: N818 - the sentence is the message
    """A closed loop that the method does not cover; the text says why."""


@dataclass(frozen=True)
class Theorem:
    """Every number that a proof is about; a certificate holds them all.

    Parameters
    ----------
    start_low, start_high : tuple of float, shape (6,)
        The box of starts, m and m/s, Hill axes.
    limit : (float, float, float)
        Base (m/s), slope (1/s) and offset (m): the speed is at most base + slope (distance - offset).
    goal : (float, float)
        Greatest distance (m) and speed (m/s) there.
    mean_motion_rad_s, mass_kg, period_s, max_force_n : float
        Of the chief's orbit, the deputy, its control periods and its thrusters on each axis.
    """

    start_low: tuple[float, ...]
    start_high: tuple[float, ...]
    limit: tuple[float, float, float]
    goal: tuple[float, float]
    mean_motion_rad_s: float
    mass_kg: float
    period_s: float
    max_force_n: float

    @property
    def flown_axes(self) -> list[int]:
        """The axes along which flights move: the two in the orbit's plane act on each other."""
        is_flown = any((self.start_low[2], self.start_high[2], self.start_low[5], self.start_high[5]))
        return [0, 1, 2] if is_flown else [0, 1]


def theorem_of(experiment: Experiment) -> Theorem:
    """Return the theorem to prove for an experiment.

    Raises
    ------
    NotProvable
        If the mission is not one that proofs are for.
    """
    mission, problem, box = experiment.mission, experiment.mission.problem, experiment.monte_carlo.box
    parts = mission.dynamics.model, mission.safety.kind, mission.navigation.mode, mission.actuators.kind
    is_plain = parts == ("cw", "none", "perfect", "ideal") and not mission.dispersions
    if not is_plain or problem.kind != "reach" or box is None:
        raise NotProvable(
            "proofs are for dynamics=cw, safety=none, navigation=perfect and actuators=ideal without "
            "dispersions, for problem.kind=reach, and for the starts of monte_carlo.box"
        )
    return Theorem(
        start_low=box[0],
        start_high=box[1],
        limit=(problem.limit_base_m_s, problem.limit_slope_per_s, problem.limit_offset_m),
        goal=(problem.goal_radius_m, problem.goal_speed_m_s),
        mean_motion_rad_s=mission.orbit.mean_motion_rad_s,
        mass_kg=mission.deputy.mass_kg,
        period_s=mission.control_period_s,
        max_force_n=mission.deputy.max_force_n,
    )


def system_of(controller: FuzzyController, axis: int) -> tuple[FuzzySystem, float]:
    """Return the system that drives an axis, and its dead band, N.

    Raises
    ------
    NotProvable
        If there is none, if it senses anything but position and velocity along its axis, or if anything else
        decides on the force.
    """
    name, wanted = f"force_{'xyz'[axis]}", [f"position_{AXES[axis]}", f"velocity_{AXES[axis]}"]
    attributes = dict(controller.attributes)
    bands = {f"dead_band_force_{letter}_n" for letter in "xyz"}
    others = {key for key, value in attributes.items() if key not in bands and value not in ("0", "0.0")}
    matching = [each for each in controller.systems if each.outputs[0].name == name]
    if not matching or [v.name for v in matching[0].inputs] != wanted or others != {"force_axes"}:
        raise NotProvable(
            f"controller {controller.name!r} cannot be followed along {'xyz'[axis]}: proofs go axis by axis, "
            f"so a system must drive {name} by {wanted[0]} and {wanted[1]}, in this order, and no "
            "constant but dead bands may be set"
        )
    if attributes["force_axes"] != "hill":
        raise NotProvable(f"controller {controller.name!r} pushes along body axes; set force_axes to hill")
    return matching[0], float(attributes.get(f"dead_band_{name}_n", 0.0))


#: columns of a tube's table: a box of an axis after so many periods, and the plane of the force over it
COLUMNS = (
    *("step", "axis", "low_m", "high_m", "least_m_s", "greatest_m_s", "shear_per_s"),
    *("constant_n", "per_position_n_m", "per_velocity_n_s_m", "residual_n"),
)


@dataclass(frozen=True)
class Verdict:
    """The result of following all starts: whether limit and goal are proved, and the tube.

    Parameters
    ----------
    rows : (n, 11)
        The tube, with the columns `COLUMNS`.
    num_periods : int
        For so many periods the limit holds, at all times, from every start.
    distance_m, speed_m_s : float
        No state is farther or faster then.
    fault : str
        Why the tube ends there; empty at the goal.
    """

    rows: Floats
    num_periods: int
    distance_m: float
    speed_m_s: float
    fault: str


def prove(
    theorem: Theorem,
    controller: FuzzyController,
    motion: Motion,
    cells: int,
    max_periods: int,
    progress: Callable[[int], object],
) -> Verdict:
    """Follow all starts until they are at the goal, the limit may break, or the time is over.

    Parameters
    ----------
    theorem : Theorem
    controller : FuzzyController
    motion : Motion
        Over one control period.
    cells : int
        Of positions, see `axis_of`.
    max_periods : int
        Control periods after which it ends.
    progress : callable
        Told how many periods are done.

    Raises
    ------
    NotProvable
        If the method does not cover the controller.
    """
    axes = _axes_of(theorem, controller, motion, cells)
    ends = np.array([theorem.start_low, theorem.start_high])
    boxes = {a: axis.start(*ends[:, [a, a + 3]]) for a, axis in axes.items()}
    rows: list[tuple[float, ...]] = []
    step, before, fault = 0, np.zeros((9, 2)), ""
    while True:
        tube = {a: {cell: (box, axes[a].surface.plane(box)) for cell, box in boxes[a].items()} for a in axes}
        now = _happens(theorem, tube)
        if step and (fault := limit_fault(theorem, before, now)):
            step, now = step - 1, before
            break
        rows += [(step, a, *astuple(box), *astuple(plane)) for a in axes for box, plane in tube[a].values()]
        reach = np.abs(now).max(axis=1)
        # at least one period is followed: a limit holds over a time
        if step and hypot(*reach[:3]) <= theorem.goal[0] and hypot(*reach[3:6]) <= theorem.goal[1]:
            break
        if step == max_periods:
            fault = f"the time is over, and some may still be {hypot(*reach[:3]):.4g} m from the chief"
            break
        boxes = {a: axis.move(tube[a], now) for a, axis in axes.items()}
        step, before = step + 1, now
        progress(step)
    reach = np.abs(now).max(axis=1)
    return Verdict(np.array(rows), step, hypot(*reach[:3]), hypot(*reach[3:6]), fault)


def _axes_of(theorem: Theorem, controller: FuzzyController, motion: Motion, cells: int) -> dict[int, Axis]:
    """Return the axes along which flights move."""
    axes, effects = {}, np.hstack([motion.transition[0], motion.control[0]])
    for axis in range(3):
        system, dead_band = system_of(controller, axis)
        if axis in theorem.flown_axes:
            surface = surface_of(system, dead_band, theorem.max_force_n)
            columns = [axis, axis + 3, axis + 6]
            axes[axis] = axis_of(system, effects[columns[:2]], columns, surface, cells)
            continue
        at_rest = np.zeros((1, 2))
        pushed = np.abs(interval.bound(interval.pack(system), at_rest, at_rest)[:2]).max()
        if not pushed < dead_band:
            raise NotProvable(
                f"all starts are at rest along {'xyz'[axis]}, where the rules push by up to {pushed:.2g} N; "
                f"make the dead band, {dead_band:g} N, greater, so that flights stay in the plane"
            )
    return axes


def _happens(theorem: Theorem, tube: Mapping[int, Enclosed]) -> Floats:
    """Return intervals, (9, 2), of the positions, velocities and forces along each axis."""
    ranges = np.zeros((9, 2))
    for a, enclosed in tube.items():
        ends = np.array([(*box.ends, *plane.ends(box)) for box, plane in enclosed.values()])
        ranges[[a, a + 3, a + 6]] = np.stack([ends[:, ::2].min(axis=0), ends[:, 1::2].max(axis=0)], axis=-1)
    ranges[6:] = np.clip(ranges[6:], -theorem.max_force_n, theorem.max_force_n)
    return ranges


def limit_fault(theorem: Theorem, now: Floats, after: Floats) -> str:
    """Return how the limit may break in a period, empty if it holds at all times of it.

    Between samples a position or a velocity leaves the line from one to the next by at most ``h^2/8`` times
    its greatest second derivative.

    Parameters
    ----------
    theorem : Theorem
    now, after : (9, 2)
        Intervals of the positions, velocities and forces along each axis, at its beginning and end.
    """
    h, n = theorem.period_s, theorem.mean_motion_rad_s
    thrust = theorem.max_force_n / theorem.mass_kg
    most = 2.0 * thrust  # of an acceleration along one axis; the sum below, which bounds it, confirms this
    far, fast = np.abs(now[:3]).max(), np.abs(now[3:6]).max() + h * most
    if thrust + 3 * n**2 * (far + h * fast) + 2 * n * fast > most:
        return "the limit cannot be shown between samples, for gravity is not small beside the thrust"
    bend = h**2 / 8 * np.repeat([most, 3 * n**2 * fast + 2 * n * most], 3)
    low = np.minimum(now, after)[:6, 0] - bend
    high = np.maximum(now, after)[:6, 1] + bend
    near = np.hypot.reduce(np.maximum(0.0, np.maximum(low, -high))[:3])
    speed = np.hypot.reduce(np.maximum(-low, high)[3:])
    base, slope, offset = theorem.limit
    allowed = base + slope * (near - offset)
    if speed < allowed - 1e-6:
        return ""
    return f"speeds may reach {speed:.4f} m/s and distances {near:.2f} m, where {allowed:.4f} m/s are allowed"
