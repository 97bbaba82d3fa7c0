"""Controllers that are not fuzzy systems: their kinds, and the settings of those that plan."""

import math
from collections.abc import Mapping
from dataclasses import field
from typing import Annotated, Any, Literal

from pydantic import Field

from pipeline.settings.checks import SettingError
from pipeline.settings.groups import Settings, tags_of
from pipeline.settings.keys import FREE
from pipeline.settings.types import Count, NotNegative, Number, Positive, Text

Angle = Annotated[Number, Field(ge=-math.pi, le=math.pi)]


class ControllerSettings(Settings, group=FREE):
    """A controller that is not written out, by its kind."""

    kind: str = "file"
    """What it is."""


class FuzzyFile(ControllerSettings, kind="file"):
    """A fuzzy controller in a file, perhaps with other constants."""

    path: Text
    """The file."""
    attributes: dict[str, Any] = field(default_factory=dict, hash=False)
    """Constants instead of the file's."""


class ForceTable(ControllerSettings, kind="open_loop"):
    """A table of forces that is played."""

    path: Text
    """The file."""


class NetworkFile(ControllerSettings, kind="policy"):
    """A trained network."""

    path: Text
    """The file."""


class Coast(ControllerSettings, kind="coast"):
    """No force."""


class Planned(ControllerSettings):
    """A controller that computes forces from the state."""


class NaturalMotion(Planned, kind="natural_motion"):
    """One burn at the start onto an ellipse of free motion around the chief."""

    points: Count
    """Points to be inspected, for a camera that looks at the chief."""
    margin_m: NotNegative
    """How far inside the distance limits its path stays."""
    reach_m_s: Positive
    """Greatest component of the burn along i and k."""
    step_m_s: Positive
    """Step of the grid of burns."""

    def __post_init__(self) -> None:
        """Check that the grid of burns is not too fine."""
        if self.reach_m_s > 100 * self.step_m_s:
            raise SettingError(
                f"controller.reach_m_s is {self.reach_m_s:g} and controller.step_m_s {self.step_m_s:g}, a "
                "grid of more than 200 by 200 burns; the first must be at most 100 times the second (m/s)"
            )


class Ring(Planned):
    """An ellipse of free motion that follows the Sun, with its cross-track amplitude; or a route instead."""

    follows: Literal["ring", "route"]
    """The ring, or a few burns planned at the start for the world's light and camera."""
    ring_size_m: Positive
    """Height of the ring; it is twice as long along the track."""
    ring_lead_rad: Angle
    """How far the Sun is ahead of the place on the ring."""
    max_height_m: NotNegative
    """Greatest amplitude along the orbit normal."""
    height_lead_rad: Angle
    """How far the swing along the normal is ahead of one that starts at rest."""


class Lqr(Ring, kind="lqr"):
    """A linear-quadratic regulator that tracks a ring; errors at their tolerance are weighted equally."""

    position_tolerance_m: Positive
    """Error of the position in the orbit plane that weighs one."""
    height_tolerance_m: Positive
    """The same along the orbit normal."""
    velocity_tolerance_m_s: Positive
    """The same of the velocity."""
    force_tolerance_n: Positive
    """A force that weighs as much as an error."""
    dead_band_n: NotNegative
    """A component smaller than this is not fired."""


class RecedingHorizon(Ring, kind="receding_horizon"):
    """Model predictive control: solves a linear program repeatedly to reach a ring with minimum fuel."""

    first_horizon_s: Positive
    """How far the first solution looks ahead; its end stays until horizon_s is farther."""
    horizon_s: Positive
    """How far later ones look ahead."""
    solution_period_s: Positive
    """Time between two solutions."""
    force_spacing_s: Positive
    """Time between two forces of a solution."""
    centre_tolerance_m: Positive
    """Error of the ellipse's centre that is allowed at the end."""
    ring_tolerance_m: Positive
    """The same of the place on the ring."""
    height_tolerance_m: Positive
    """The same of the height."""
    margin_m: NotNegative
    """How far inside the distance limits its path stays."""

    def __post_init__(self) -> None:
        """Check that every solution is replaced before its horizon."""
        if not self.solution_period_s <= self.horizon_s <= self.first_horizon_s:
            raise SettingError(
                f"controller.solution_period_s is {self.solution_period_s:g}, controller.horizon_s "
                f"{self.horizon_s:g} and controller.first_horizon_s {self.first_horizon_s:g}; no solution "
                "may be flown beyond its horizon, and the first is the longest: let them ascend (s)"
            )


#: settings of the planning kinds
PLANNED: Mapping[str, type[Any]] = {kind: variant for variant, kind in tags_of(Planned)["kind"].items()}


def check_controller(source: Mapping[str, Any]) -> None:
    """Raise SettingError if a controller has no known kind, or lacks its kind's keys or values.

    Raises
    ------
    SettingError
    """
    if "systems" in source:
        return
    if "kind" not in source and "path" not in source:
        raise SettingError(
            "controller is neither written out (systems) nor a file (path) nor of a kind; choose one of "
            "the group, controller=NAME, or a file, controller=PATH"
        )
    ControllerSettings(**source)
