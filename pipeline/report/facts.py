"""The facts listed beside a flight's pictures: of one deputy, of a fleet, and of each of its deputies."""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from pipeline.array_types import Floats
from pipeline.flight.cases.dispersions import mission_of_case
from pipeline.flight.fly.fleet_logs import DeputyLog
from pipeline.flight.state.log import FlightLog, inspectable_rate, points_needed
from pipeline.recording.events import points_in_words, seen_in_words
from pipeline.report.contents import ShownFlight
from pipeline.settings.experiment import Mission

#: names and values
Facts = list[tuple[str, str]]


def facts_of(flight: ShownFlight, mission: Mission) -> list[tuple[str, str, Facts]]:
    """Return of a flight its picture, its title and its facts; of a fleet, also those of each deputy."""
    if not flight.fleet:
        return [(f"control-{flight.name}", flight.title, _of_flight(flight, mission))]
    each = [
        (f"control-{part.name}", part.title, _of_deputy(part, log))
        for part, log in zip(flight.parts, flight.fleet, strict=True)
    ]
    return [(f"trajectories-{flight.name}", flight.title, _of_fleet(flight, mission)), *each]


def outcome_in_words(flight: ShownFlight) -> str:
    """Return what a flight inspects for how much fuel; of a fleet, all deputies together."""
    if not flight.fleet:
        return f"inspects {points_in_words(flight.log)} for {flight.log.delta_v_m_s[-1]:.3f} m/s"
    return f"inspects {_seen_by(flight.fleet)} for {_spent_by(flight.fleet):.3f} m/s in total"


def _of_flight(flight: ShownFlight, mission: Mission) -> Facts:
    log = flight.log
    counts = log.is_inspected.sum(axis=1)
    rate = inspectable_rate(counts[-1], int(log.is_inspectable.sum()))
    return [
        _start(flight),
        _sun(flight),
        ("Δv", f"{log.delta_v_m_s[-1]:.3f} m/s"),
        ("inspected", f"{points_in_words(log)}, {rate:.2f} %"),
        _reached(counts, log, mission_of_case(mission, flight.scenario)),
        _distance(log),
    ]


def _of_fleet(flight: ShownFlight, mission: Mission) -> Facts:
    """Return what the deputies do together."""
    log, counts = flight.log, np.count_nonzero(flight.fleet[0].seen_by, axis=1)
    rate = inspectable_rate(counts[-1], int(log.is_inspectable.sum()))
    return [
        _sun(flight),
        ("Δv of all", f"{_spent_by(flight.fleet):.3f} m/s"),
        ("inspected by any", f"{_seen_by(flight.fleet)}, {rate:.2f} %"),
        _reached(counts, log, mission),
        ("nearest two", f"{_nearest_pair(flight.fleet):.1f} m"),
    ]


def _spent_by(fleet: Sequence[DeputyLog]) -> float:
    return float(sum(each.flight.delta_v_m_s[-1] for each in fleet))


def _seen_by(fleet: Sequence[DeputyLog]) -> str:
    return seen_in_words(int(np.count_nonzero(fleet[0].seen_by[-1])), fleet[0].flight)


def _of_deputy(part: ShownFlight, log: DeputyLog) -> Facts:
    return [
        _start(part),
        ("Δv", f"{part.log.delta_v_m_s[-1]:.3f} m/s"),
        ("seen first", f"{np.count_nonzero(log.seen_by[-1] == log.deputy)} points"),
        _distance(part.log),
    ]


def _start(flight: ShownFlight) -> tuple[str, str]:
    components = ", ".join(signed(component, 2) for component in flight.scenario.position_m)
    return "start, Hill axes", f"({components}) m"


def _sun(flight: ShownFlight) -> tuple[str, str]:
    scenario = flight.scenario
    return "Sun at the start", sun_at_start(scenario.sun_angle_rad, scenario.sun_elevation_rad, 1)


def _reached(counts: NDArray[np.integer], log: FlightLog, mission: Mission) -> tuple[str, str]:
    needed = points_needed(int(log.is_inspectable.sum()), mission.inspection_threshold_percent)
    reached = np.flatnonzero(counts >= needed)
    after = f"after {reached[0] * mission.control_period_s:g} s" if reached.size else "not in this flight"
    return f"{mission.inspection_threshold_percent:g} % reached", after


def _distance(log: FlightLog) -> tuple[str, str]:
    distances = np.linalg.norm(log.position_m, axis=1)
    extremes = f"{distances.min():.1f} to {distances.max():.1f} m"
    return "distance", f"{extremes}, {distances.mean():.1f} m on average"


def _nearest_pair(fleet: Sequence[DeputyLog]) -> float:
    """Return the least distance between two deputies at a sample, m."""
    paths: list[Floats] = [each.flight.position_m for each in fleet]
    pairs = ((path, other) for row, path in enumerate(paths) for other in paths[:row])
    return min(float(np.linalg.norm(path - other, axis=1).min()) for path, other in pairs)


def sun_at_start(angle_rad: float, elevation_rad: float, decimals: int) -> str:
    """Return the Sun's angles at the start of a flight as text, in degrees."""
    angle, elevation = (signed(math.degrees(value), decimals) for value in (angle_rad, elevation_rad))
    return f"{angle}°" + (f", {elevation}° over the orbit plane" if elevation_rad else "")


def signed(value: float, decimals: int) -> str:
    """Format a number with a true minus sign."""
    return f"{value:.{decimals}f}".replace("-", "−")
