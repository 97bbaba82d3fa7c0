"""The closed loop of a proof: the numbers that a theorem is about, and the systems that drive each axis."""

from dataclasses import dataclass

import numpy as np

from fis_tools.model import FuzzyController, FuzzySystem
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
        """The axes along which not all starts are at rest at zero."""
        ends = np.array([self.start_low, self.start_high])
        return [axis for axis in range(3) if np.any(ends[:, [axis, 3 + axis]])]


def theorem_of(experiment: Experiment) -> Theorem:
    """Return what is to be proved.

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
    found = [each for each in controller.systems if each.outputs[0].name == name]
    if not found or [v.name for v in found[0].inputs] != wanted or others != {"force_axes"}:
        raise NotProvable(
            f"controller {controller.name!r} cannot be followed along {'xyz'[axis]}: proofs go axis by axis, "
            f"so a system must drive {name} by {wanted[0]} and {wanted[1]}, in this order, and no "
            "constant but dead bands may be set"
        )
    if attributes["force_axes"] != "hill":
        raise NotProvable(f"controller {controller.name!r} pushes along body axes; set force_axes to hill")
    return found[0], float(attributes.get(f"dead_band_{name}_n", 0.0))
