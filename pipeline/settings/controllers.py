"""Controllers that are not fuzzy systems: their kinds, and the settings of those that plan, checked."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any

from pipeline.settings import checks
from pipeline.settings.checks import SettingError
from pipeline.settings.nearest import did_you_mean


@dataclass(frozen=True, kw_only=True)
class NaturalMotion:
    """One burn at the start onto an ellipse of free motion around the chief."""

    #: that the ellipse is to inspect, as predicted for a camera that looks at the chief
    points: int
    #: by which it stays inside the distance limits, m
    margin_m: float
    #: greatest component of the burn along i and k, m/s
    reach_m_s: float
    #: of the grid of burns, m/s
    step_m_s: float

    def __post_init__(self) -> None:
        """Refuse searches for nothing."""
        checks.count("controller.points", self.points, 1)
        checks.within("controller.margin_m", self.margin_m, 0.0, math.inf, "m")
        checks.positive("controller.reach_m_s", self.reach_m_s, "m/s")
        checks.positive("controller.step_m_s", self.step_m_s, "m/s")
        if self.reach_m_s > 100 * self.step_m_s:
            raise SettingError(
                f"controller.reach_m_s is {self.reach_m_s:g} and controller.step_m_s {self.step_m_s:g}, a "
                "grid of more than 200 by 200 burns; the first must be at most 100 times the second (m/s)"
            )


@dataclass(frozen=True, kw_only=True)
class Ring:
    """An ellipse of free motion that follows the Sun, and how high it swings."""

    #: its height; it is twice as long along the track, m
    ring_size_m: float
    #: how far the Sun is ahead of the place on the ring, rad
    ring_lead_rad: float
    #: greatest amplitude along the orbit normal, m
    max_height_m: float
    #: how far the swing along the normal is ahead of one that starts at rest, rad
    height_lead_rad: float

    def __post_init__(self) -> None:
        """Refuse what is no ring."""
        checks.positive("controller.ring_size_m", self.ring_size_m, "m")
        checks.within("controller.ring_lead_rad", self.ring_lead_rad, -math.pi, math.pi, "rad")
        checks.within("controller.max_height_m", self.max_height_m, 0.0, math.inf, "m")
        checks.within("controller.height_lead_rad", self.height_lead_rad, -math.pi, math.pi, "rad")


@dataclass(frozen=True, kw_only=True)
class Lqr(Ring):
    """A linear-quadratic regulator that tracks a ring."""

    #: tolerated in the orbit plane, and along its normal, m
    position_tolerance_m: float
    height_tolerance_m: float
    #: tolerated, m/s
    velocity_tolerance_m_s: float
    #: force that weighs as much as an error of what is tolerated, N
    force_tolerance_n: float
    #: a component smaller than this is not fired, N
    dead_band_n: float

    def __post_init__(self) -> None:
        """Refuse tolerances of nothing."""
        super().__post_init__()
        checks.positive("controller.position_tolerance_m", self.position_tolerance_m, "m")
        checks.positive("controller.height_tolerance_m", self.height_tolerance_m, "m")
        checks.positive("controller.velocity_tolerance_m_s", self.velocity_tolerance_m_s, "m/s")
        checks.positive("controller.force_tolerance_n", self.force_tolerance_n, "N")
        checks.within("controller.dead_band_n", self.dead_band_n, 0.0, math.inf, "N")


@dataclass(frozen=True, kw_only=True)
class RecedingHorizon(Ring):
    """A controller that repeatedly solves a linear program to reach a ring with the least fuel."""

    #: looked ahead at the start, s; the horizon ends at this time until it is nearer than the next key says
    first_horizon_s: float
    #: looked ahead later, s
    horizon_s: float
    #: between two solutions, s
    solution_period_s: float
    #: between two forces of a solution, s
    force_spacing_s: float
    #: by which the ellipse's centre, its place on the ring and its height may be off, m
    centre_tolerance_m: float
    ring_tolerance_m: float
    height_tolerance_m: float
    #: by which it stays inside the distance limits, m
    margin_m: float

    def __post_init__(self) -> None:
        """Refuse horizons without an end."""
        super().__post_init__()
        for name in ("first_horizon_s", "horizon_s", "solution_period_s", "force_spacing_s"):
            checks.positive(f"controller.{name}", getattr(self, name), "s")
        for name in ("centre_tolerance_m", "ring_tolerance_m", "height_tolerance_m"):
            checks.positive(f"controller.{name}", getattr(self, name), "m")
        checks.within("controller.margin_m", self.margin_m, 0.0, math.inf, "m")
        if not self.solution_period_s <= self.horizon_s <= self.first_horizon_s:
            raise SettingError(
                f"controller.solution_period_s is {self.solution_period_s:g}, controller.horizon_s "
                f"{self.horizon_s:g} and controller.first_horizon_s {self.first_horizon_s:g}; no solution "
                "may be flown beyond its horizon, and the first is the longest: put them in ascending order "
                "(s)"
            )


Planned = NaturalMotion | Lqr | RecedingHorizon

#: settings of the kinds that plan
PLANNED: Mapping[str, type[Planned]] = {
    "natural_motion": NaturalMotion,
    "lqr": Lqr,
    "receding_horizon": RecedingHorizon,
}

#: the keys of a controller that is not written out, by its kind
CONTROLLER_KEYS: Mapping[str, set[str]] = {
    "file": {"path"},
    "open_loop": {"kind", "path"},
    "coast": {"kind"},
    **{kind: {"kind", *(field.name for field in fields(settings))} for kind, settings in PLANNED.items()},
}


def check_controller(source: Mapping[str, Any]) -> None:
    """Refuse a controller of the configuration that is of no kind, or has not its kind's keys and values.

    Raises
    ------
    SettingError
    """
    keys = set(source)
    if "systems" in keys:
        return
    if "kind" not in keys and "path" not in keys:
        raise SettingError(
            "controller is neither written out (systems) nor a file (path) nor of a kind; choose one of "
            "the group, controller=NAME, or a file, controller=PATH"
        )
    kind = source.get("kind", "file")
    if kind not in CONTROLLER_KEYS:
        known = [name for name in CONTROLLER_KEYS if name != "file"]
        guess = did_you_mean(str(kind), known)
        raise SettingError(f"controller.kind is {kind!r}; it must be one of {', '.join(known)}{guess}")
    if keys != CONTROLLER_KEYS[kind]:
        raise SettingError(
            f"controller has the keys {', '.join(sorted(keys))}; one of kind {kind} has "
            f"{', '.join(sorted(CONTROLLER_KEYS[kind]))}"
        )
    if kind in PLANNED:
        planned_settings(source)


def planned_settings(source: Mapping[str, Any]) -> Planned:
    """Return the settings of a controller that plans; whole numbers may stand for others.

    Raises
    ------
    SettingError
        If a value cannot be.
    """
    kind = PLANNED[source["kind"]]
    checked = kind(**{field.name: source[field.name] for field in fields(kind)})
    values = {field.name: field.type(getattr(checked, field.name)) for field in fields(kind)}  # type: ignore[operator]
    return kind(**values)
