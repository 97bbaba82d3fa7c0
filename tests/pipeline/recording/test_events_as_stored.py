"""What logs made by hand are said to tell is as it was when somebody last looked: words, samples, levels."""

from dataclasses import replace

import numpy as np

from fis_tools.model.thrust import COMPONENTS
from pipeline.controllers.source import named
from pipeline.flight.fly.fleet_logs import DeputyLog
from pipeline.flight.state.log import KEEP_IN, PARKED, PASSIVE_SAFETY, SPEED
from pipeline.recording.events import events
from pipeline.recording.firing import is_fired
from pipeline.recording.fleets import fleet_events
from pipeline.recording.foresight import recorded_decisions
from tests import stored
from tests.pipeline.recording import cases, test_decisions
from tests.pipeline.recording.test_events_by_hand import DOCKING, approach
from tests.pipeline.recording.test_flight_events import MISSION, flight

NUMBERS = (0, 12, 50, 94, 94, 95, 96, 99, 99, 99, 99)
DISTANCES = (30.0, 21.0, 19.0, 14.9, 15.5, 40.0, 75.0, 194.0, 197.0, 203.5, 201.0)


def of(happened):
    return [f"{event.sample} {event.level}: {event.text}" for event in happened]


def eventful():
    """A log in which all happens that a log can tell."""
    log = flight(list(DISTANCES), list(NUMBERS))
    limits = np.array([0, SPEED, SPEED, 0, KEEP_IN, PASSIVE_SAFETY, 0, 0, 0, 0, SPEED])[
        : len(log.safety_limit)
    ]
    changed = np.outer(limits > 0, (0.125, -0.25, 0.5)) * np.arange(1.0, 1.0 + len(limits))[:, None]
    foreseen = np.full((len(limits), 3), np.nan)
    foreseen[1:9] = [
        (2.2, 20.0, 90.0),
        (1.0, 30.0, 120.0),
        (7.0, 30.0, 120.0),
        (0.0, 60.5, 99.0),
        (1.0, 15.5, 150.0),
        (0.0, 40.0, 80.0),
        (2.0, 40.0, 199.5),
        (3.0, 25.0, 50.0),
    ]
    is_decided = np.array([1, 0, 0, 1, 0, 1, 0, 1, 0, 1], dtype=bool)
    reasons = log.command_reason.copy()
    reasons[9] = PARKED
    return log._replace(
        safety_limit=limits,
        safety_force_hill_n=changed,
        foreseen=foreseen,
        is_decided=is_decided,
        command_reason=reasons,
        force_asked_n=np.outer(np.arange(1.0, 11.0), (0.012, -0.024, 0.0048)),
    )


def test_an_inspection_is_told_as_it_was(file_regression):
    log, controller = eventful(), named("champion_27", MISSION)
    parts = {f"near {metres:g} m": of(events(MISSION, log, metres, controller)) for metres in (3.0, 12.0)}
    unlit = np.arange(99) < 97
    fewer = log._replace(
        is_inspectable=unlit, is_inspected=log.is_inspected & unlit, force_hill_n=0.0 * log.force_hill_n
    )
    parts["of fewer points"] = of(events(replace(MISSION, inspection_threshold_percent=50.0), fewer, 5.0))
    file_regression.check(stored.text_of(parts), extension=".txt")


def test_an_approach_is_told_as_it_was(file_regression):
    parts = {}
    for name, last in (("in time", 0.4), ("late", 30.0), ("crash", 0.2)):
        count = len(approach([50.0], [0.0]).position_m)
        distances = np.linspace(60.0, last, count)
        speeds = np.where(np.arange(count) % 7 < 3, 0.35, 0.02) * (1.0 + 5.0 * (name == "crash"))
        parts[name] = of(events(DOCKING, approach(distances, speeds), 5.0))
    file_regression.check(stored.text_of(parts), extension=".txt")


def test_plans_are_recorded_as_they_were(file_regression):
    log, mission = test_decisions.flight(), test_decisions.MISSION
    parts = {name: vars(each) for name, each in recorded_decisions(mission, log).items()}
    parts |= {f"of three {name}": vars(each) for name, each in recorded_decisions(mission, log, 3).items()}
    file_regression.check(stored.text_of(parts), extension=".txt")


def test_a_fleet_is_told_as_it_was(file_regression):
    log = eventful()
    count = len(log.position_m)
    seen = np.zeros((count, 99), dtype=np.int8)
    left = np.zeros((count - 1, 99), dtype=np.int8)
    seen[4:, 10:40], seen[6:, 40:45], seen[8:, 60:97] = 1, 2, 3
    left[2:5, 50:60], left[5:, 60:80] = 2, 3
    shown = np.zeros((count - 1, 3, 99), dtype=np.int8)
    shown[3:, 1, 30:50] = 1
    positions = np.tile(
        np.array([(60.0, 0.0, 5.0), (0.0, 45.5, -5.0), (-30.0, 10.0, 70.0)]), (count - 1, 1, 1)
    )
    parts = {}
    for deputy in (1, 3):
        each = DeputyLog(
            deputy, log, seen, left, shown, positions, positions, np.zeros((count - 1, 3), np.int8)
        )
        parts[f"deputy {deputy}"] = of(fleet_events(MISSION, each, 3, 2))
    file_regression.check(stored.text_of(parts), extension=".txt")


def test_what_is_fired_is_as_it_was(file_regression):
    log = cases.flown("duration_s=600.0")
    parts = {}
    for delay in (0, 1, 3):
        for axes in ("hill", "body"):
            for axis, name in enumerate(COMPONENTS[:3]):
                parts[f"{name} {axes} {delay}"] = is_fired(log, np.arange(40), axis, axes, delay)
    file_regression.check(stored.text_of(parts), extension=".txt")
