"""What a deputy of a fleet left to others, and who saw what, as events in words."""

from collections.abc import Iterator

import numpy as np

from pipeline.array_types import Integers
from pipeline.flight.fly.fleet_logs import DeputyLog
from pipeline.recording.events import Event
from pipeline.settings.experiment import Mission


def fleet_events(mission: Mission, log: DeputyLog, num_deputies: int, stride: int = 1) -> list[Event]:
    """Return what a deputy left to others, when it had nothing else to do, and who saw what, by time.

    It decides, and leaves points, every `stride` control periods.
    If it rehearsed tours, or planned, also that the fleet chose together.
    """
    happened = [
        *_touring(log, num_deputies),
        *_planning(log, num_deputies),
        *_leaving(mission, log),
        *_idling(log, stride),
    ]
    happened.append(_shares(log, num_deputies))
    return sorted(happened, key=lambda event: event.sample)


def _touring(log: DeputyLog, num_deputies: int) -> Iterator[Event]:
    """Yield for whom the deputy's tour is the cheapest, if it rehearsed some."""
    if len(log.flight.tour_costs_m_s):
        words = f"the cheapest for all {num_deputies} deputies together, beside the tours of the others"
        yield Event(0, "info", f"this tour is {words}")


def _planning(log: DeputyLog, num_deputies: int) -> Iterator[Event]:
    """Yield what the decisions of foresight are about, if there are any."""
    if len(log.flight.foresight_at):
        words = f"plans are made for all {num_deputies} deputies together: this deputy's part is told, and"
        yield Event(0, "info", f"{words} what all cost, and leave unseen")


def _leaving(mission: Mission, log: DeputyLog) -> Iterator[Event]:
    """Yield when points are left to another for the first time, and when it saw them."""
    has_left = np.zeros(log.left_to.shape[1], dtype=np.bool_)
    for sample, left_to in enumerate(log.left_to):
        is_new = (left_to > 0) & ~has_left
        has_left |= is_new
        for other in np.unique(left_to[is_new]).tolist():
            points = np.flatnonzero(is_new & (left_to == other))
            yield Event(sample, "info", f"left to deputy {other}: {_outlook(mission, log, sample, points)}")


def _outlook(mission: Mission, log: DeputyLog, sample: int, points: Integers) -> str:
    """Return how many points are left at a sample, and when the first of them were seen."""
    seen = log.seen_by[:, points] > 0
    which = f"{len(points)} point{'s' * (len(points) > 1)}"
    if not seen[-1].any():
        return f"{which}, which nobody saw"
    minutes = (int(seen.any(axis=1).argmax()) - sample) * mission.control_period_s / 60.0
    count = int(seen[-1].sum())
    return (
        f"{which}, {'' if count == len(points) else f'{count} of them '}seen from {minutes:.0f} min later on"
    )


def _idling(log: DeputyLog, stride: int) -> Iterator[Event]:
    """Yield when a deputy begins to coast because all that is unseen is left to others."""
    left_to, is_counted = log.left_to[::stride], log.flight.is_inspectable
    is_open = (log.seen_by[:-1:stride] == 0) & is_counted
    is_idle = is_open.any(axis=1) & ~np.any(is_open & (left_to == 0), axis=1)
    for row in np.flatnonzero(np.diff(is_idle, prepend=False) & is_idle).tolist():
        others = np.unique(left_to[row][is_open[row]]).tolist()
        names = " and ".join(f"deputy {other}" for other in others)
        count = int(is_open[row].sum())
        noun = f"all {count} unseen points are" if count > 1 else "the only unseen point is"
        words = f"coasts: {noun} left to {names}, and coasting keeps the limits"
        yield Event(row * stride, "info", words)


def _shares(log: DeputyLog, num_deputies: int) -> Event:
    """Return how many points each deputy of the fleet saw first."""
    counts = np.bincount(log.seen_by[-1], minlength=num_deputies + 1)[1:].tolist()
    words = ", ".join(f"deputy {deputy} {count}" for deputy, count in enumerate(counts, 1))
    return Event(len(log.seen_by) - 1, "info", f"deputy {log.deputy} ends; seen first by {words}")
