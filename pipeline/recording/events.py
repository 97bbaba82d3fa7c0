"""What happened in a flight, in words: points, limits, what the safety layer did, how it ended."""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

import numpy as np

from fis_tools.model.thrust import ThrustLogic, thrust_logic
from pipeline.array_types import Floats
from pipeline.flight.control.controller import Controller, RuleController
from pipeline.flight.fly.lesser_controllers import finishing
from pipeline.flight.fly.tours import rehearsal_samples, tour_names
from pipeline.flight.goals.reach import ended, limit_at
from pipeline.flight.state.log import LIMITS, PARKED, REHEARSED, FlightLog, inspectable_rate, points_needed
from pipeline.flight.world.limits import depths_in_spheres, metres_beyond, wheel_is_full
from pipeline.recording.foresight import along_axes, decisions_in_words, is_planned, push_of
from pipeline.settings.experiment import Mission

Level = Literal["info", "warning", "error"]

#: the safety layer has ceased to act once it has left the force alone for so many periods
REST_PERIODS = 6


@dataclass(frozen=True)
class Event:
    """A sentence about a sample, from 0 to K."""

    sample: int
    level: Level
    text: str


def events(
    mission: Mission, log: FlightLog, near_limit_m: float, controller: Controller | None = None
) -> list[Event]:
    """Return a flight's events in the order of time.

    Parameters
    ----------
    mission : Mission
    log : FlightLog
    near_limit_m : float
        A distance limit is near when it is nearer than this. The warning is given once, and again only after
        the deputy has been twice as far from the limits.
    controller : Controller, optional
        Which was flown: it tells why it coasts, and what it has flown ahead.

    Returns
    -------
    list of Event
        The last one sums the flight up.
    """
    happened: list[Event] = []
    inspects = mission.problem.kind == "inspection"
    if controller is not None:
        happened += chosen_ahead(mission, log, controller)
    happened += _progress(mission, log) if inspects else ()
    happened += [*_limits(mission, log, near_limit_m), *_spheres(mission, log), *_safety(mission, log)]
    happened += _wheels(mission, log)
    flown = controller
    if isinstance(controller, RuleController) and is_planned(log):
        flown = finishing(controller)
    logic = thrust_logic(flown.fuzzy) if flown and flown.fuzzy else None
    happened += _coasting(mission, log, logic) if logic is not None and inspects else ()
    happened += _parking(mission, log)
    if inspects:
        happened.append(_summary(mission, log))
    else:
        happened += _approach(mission, log)
    return sorted(happened, key=lambda event: event.sample)


def _approach(mission: Mission, log: FlightLog) -> Iterator[Event]:
    """Yield where a flight towards a goal was too fast, and how it ended."""
    distance, speed = np.linalg.norm(log.position_m, axis=1), np.linalg.norm(log.velocity_m_s, axis=1)
    last, fault = ended(mission, log)
    over = speed - limit_at(mission.problem, distance)
    too_fast = np.flatnonzero(over[1 : last + 1] > 0.0) + 1
    for spell in np.split(too_fast, np.flatnonzero(np.diff(too_fast) > 1) + 1) if too_fast.size else ():
        most, seconds = over[spell].max(), len(spell) * mission.control_period_s
        words = f"above the limit on the speed for {seconds:g} s, by {most:.3f} m/s at most"
        yield Event(int(spell[0]), "warning", words)
    where = f"{distance[last]:.2f} m from the chief at {speed[last]:.3f} m/s"
    spent = f"delta-v {log.delta_v_m_s[last]:.3f} m/s"
    words = f"end: {fault or 'the goal is reached'}, {where}, {spent}; the rest does not count"
    yield Event(last, "warning" if fault else "info", words)


def chosen_ahead(mission: Mission, log: FlightLog, controller: Controller) -> Iterator[Event]:
    """Yield which pushes foresight chose, and which first push and which tours rehearsals chose."""
    if num_rehearsed := len(log.push_costs_m_s):
        push = along_axes(push_of(mission, log.force_asked_n[0]))
        text = (
            f"rehearsed: of {num_rehearsed} first pushes, each flown to the end by the rules, this one ends "
            f"cheapest: {push}"
        )
        yield Event(0, "info", text)
    for sample, words in decisions_in_words(mission, log):
        yield Event(sample, "info", words)
    if not len(log.push_costs_m_s) and not len(log.tour_costs_m_s):
        return
    names, samples = tour_names(controller), rehearsal_samples(controller, mission)
    for sample, costs in zip(samples, log.tour_costs_m_s, strict=False):
        text = "rehearsed: of the tours, each flown to the end by the rules, one ends cheapest: "
        yield Event(sample, "info", text + names[costs.argmin()])


def _progress(mission: Mission, log: FlightLog) -> Iterator[Event]:
    """Yield when enough points were inspected, and when all were."""
    count = log.is_inspected.sum(axis=1)
    inspectable = int(log.is_inspectable.sum())
    threshold = mission.inspection_threshold_percent
    enough = np.flatnonzero(count >= points_needed(inspectable, threshold))
    if enough.size:
        sample = int(enough[0])
        reached = f"{threshold:g} % reached: {points_in_words(log, sample)} inspected"
        yield Event(sample, "info", f"{reached}, delta-v {log.delta_v_m_s[sample]:.3f} m/s")
    complete = np.flatnonzero(count == inspectable)
    if complete.size:
        sample = int(complete[0])
        later = log.force_hill_n[sample:]
        then = "; no force from here on" if len(later) and not later.any() else ""
        num_points = len(log.is_inspectable)
        those = "points" if inspectable == num_points else f"points that can be inspected, of {num_points},"
        yield Event(sample, "info", f"complete: all {inspectable} {those} inspected{then}")


def _limits(mission: Mission, log: FlightLog, near_limit_m: float) -> Iterator[Event]:
    """Yield when the deputy comes near a distance limit, goes beyond it and comes back."""
    low, high = mission.deputy.min_distance_m or -math.inf, mission.deputy.max_distance_m
    least, greatest = f"the least distance allowed ({low:g} m)", f"the greatest distance allowed ({high:g} m)"
    is_warned = is_outside = False
    for sample, distance in enumerate(_distances(log).tolist()):
        margin = min(distance - low, high - distance)
        limit = least if distance - low < high - distance else greatest
        if margin < 0.0:
            if not is_outside:
                yield Event(sample, "error", f"{distance:.1f} m from the chief: beyond {limit}")
            is_outside = is_warned = True
        elif is_outside:
            yield Event(sample, "info", f"{distance:.1f} m from the chief: inside the limits again")
            is_outside = False
        elif margin >= 2.0 * near_limit_m:
            is_warned = False
        elif margin < near_limit_m and not is_warned:
            yield Event(sample, "warning", f"{distance:.1f} m from the chief: {margin:.1f} m from {limit}")
            is_warned = True


def _spheres(mission: Mission, log: FlightLog) -> Iterator[Event]:
    """Yield when the deputy enters a sphere to stay out of, and when it has left it."""
    for which, depth in enumerate(depths_in_spheres(mission, log).T):
        is_inside = depth > 0.0
        for sample in np.flatnonzero(np.diff(is_inside, prepend=False)).tolist():
            words = f"{depth[sample]:.1f} m inside" if is_inside[sample] else "outside again:"
            level: Level = "error" if is_inside[sample] else "info"
            yield Event(sample, level, f"{words} sphere {which} of those to stay out of")


def _wheels(mission: Mission, log: FlightLog) -> Iterator[Event]:
    """Yield where a wheel is full for the first time, and for how long some are in all."""
    is_full = wheel_is_full(mission, log)
    if is_full.any():
        seconds = mission.attitude_period_s * float(is_full.sum())
        most = mission.deputy.max_momentum_n_m_s
        words = f"a wheel is full, at {most:g} N m s; in all one is for {seconds:g} s"
        yield Event(int(np.argmax(is_full.any(axis=1))), "warning", words)


def _parking(mission: Mission, log: FlightLog) -> Iterator[Event]:
    """Yield each push that parks."""
    for sample in np.flatnonzero((log.command_reason == PARKED).any(axis=1)).tolist():
        push = along_axes(push_of(mission, log.force_asked_n[sample]))
        yield Event(sample, "info", f"parks on a closed ellipse inside the limits: {push}")


def _coasting(mission: Mission, log: FlightLog, logic: ThrustLogic) -> Iterator[Event]:
    """Yield when the controller begins and ceases to coast, and what coasting to the end would come to."""
    num_points, margin = int(log.is_inspectable.sum()), logic.coast_margin_m
    low, high = mission.deputy.min_distance_m + margin, mission.deputy.max_distance_m - margin
    was_coasting = False
    is_given = (log.command_reason == REHEARSED).all(axis=1)
    # what parks coasts for another reason
    is_parked = ~log.is_decided & (log.foreseen[:, 0] >= logic.coast_below_points)
    is_parked |= np.logical_or.accumulate((log.command_reason == PARKED).any(axis=1))
    for sample in np.flatnonzero(np.isfinite(log.foreseen[:, 0]) & ~is_given & ~is_parked).tolist():
        missed, nearest, farthest = log.foreseen[sample].tolist()
        unseen = f"{missed:.0f} of {num_points} points unseen"
        is_coasting = not log.is_decided[sample]
        if is_coasting and not was_coasting:
            few = f"{logic.coast_below_points:.3g}"
            reach = f"{nearest:.1f} to {farthest:.1f} m from the chief"
            words = f"coasting begins: to the end it leaves {unseen}, fewer than {few}, {reach}"
            yield Event(sample, "info", words)
        elif was_coasting and not is_coasting:
            why = f"it would now leave {unseen}"
            if missed < logic.coast_below_points and nearest < low:
                why = f"it would now come to {nearest:.1f} m from the chief, nearer than {low:.1f} m"
            elif missed < logic.coast_below_points and farthest > high:
                why = f"it would now lead {farthest:.1f} m from the chief, farther than {high:.1f} m"
            yield Event(sample, "info", f"coasting ends: {why}")
        was_coasting = is_coasting


def _safety(mission: Mission, log: FlightLog) -> Iterator[Event]:
    """Yield when the safety layer begins and ceases to change the force, for which limits and by how much."""
    acted = np.flatnonzero(log.safety_limit)
    for spell in np.split(acted, np.flatnonzero(np.diff(acted) > REST_PERIODS) + 1) if acted.size else ():
        first, last = int(spell[0]), int(spell[-1])
        limits = [LIMITS[limit] for limit in dict.fromkeys(log.safety_limit[spell].tolist())]
        yield Event(first, "warning", f"safety layer acts: {limits[0]}")
        changed = f"{_delta_v(mission, log.safety_force_hill_n[spell]):.4f} m/s"
        share = f"it changed the force in {len(spell)} of {last + 1 - first} periods, by {changed}"
        yield Event(last + 1, "info", f"safety layer ceases to act: {', '.join(limits)}; {share}")


def _delta_v(mission: Mission, force_h: Floats) -> float:
    """Return the delta-v of a force held for a control period, m/s."""
    return float(np.abs(force_h).sum()) * mission.control_period_s / mission.deputy.mass_kg


def _summary(mission: Mission, log: FlightLog) -> Event:
    """Sum the flight up."""
    distance = _distances(log)
    # the start is given, not flown
    num_outside = int(np.sum(metres_beyond(mission, log)[1:] > 0.0))
    inside = "always inside the limits"
    if num_outside:
        inside = f"outside the limits at {num_outside} of {len(distance) - 1} samples"
    reach = f"{distance.min():.1f} to {distance.max():.1f} m from the chief"
    count, inspectable = int(log.is_inspected[-1].sum()), int(log.is_inspectable.sum())
    acted = np.count_nonzero(log.safety_limit)
    if acted:
        changed = _delta_v(mission, log.safety_force_hill_n)
        inside += f", safety layer acted in {acted} periods ({changed:.4f} m/s)"
    is_success = count >= points_needed(inspectable, mission.inspection_threshold_percent)
    seen = f"{points_in_words(log)} inspected ({inspectable_rate(count, inspectable):.2f} %)"
    words = f"end: {seen}, delta-v {log.delta_v_m_s[-1]:.3f} m/s, {reach}, {inside}"
    return Event(len(distance) - 1, "info" if is_success and not num_outside else "warning", words)


def _distances(log: FlightLog) -> Floats:
    return np.linalg.norm(log.position_m, axis=1)


def points_in_words(log: FlightLog, sample: int = -1) -> str:
    """Return the numbers of points inspected at a sample, inspectable, and in all, in words."""
    return seen_in_words(int(log.is_inspected[sample].sum()), log)


def seen_in_words(count: int, log: FlightLog) -> str:
    """Return a number of points among those that are inspectable, and all, in words."""
    inspectable, num_points = int(log.is_inspectable.sum()), len(log.is_inspectable)
    if inspectable == num_points:
        return f"{count} of {num_points} points"
    return f"{count} of the {inspectable} points that can be inspected ({num_points} in all)"
