"""The worst known flight of a requirement: found, flown again, recorded and drawn."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from pipeline.evaluation.assurance.campaign import FormulaResult, evaluate_each
from pipeline.evaluation.assurance.evidence import Domain, left_on
from pipeline.evaluation.assurance.formula import (
    COASTING_PAIR,
    OF_COASTING,
    kind_of,
    predicates,
    quantities_of,
)
from pipeline.evaluation.assurance.quantities import facts_of_flown, track_of, tracks_of
from pipeline.evaluation.assurance.requirements import Requirement
from pipeline.evaluation.assurance.sentences import ordinal
from pipeline.evaluation.assurance.verdicts import Evidence
from pipeline.flight.cases.dispersions import drawn, mission_with
from pipeline.flight.fly.fleet_logs import fly_logged_fleet
from pipeline.flight.goals.flights import fly_logged
from pipeline.flight.state.log import FlightLog, Scenario
from pipeline.recording.recorder import FlightRecorder
from pipeline.report.board import gravest
from pipeline.report.evidence import number as written
from pipeline.report.figures.flights import draw_flight
from pipeline.report.figures.style import Illustration
from pipeline.run import artifacts
from pipeline.settings.experiment import Experiment, Mission
from telemetry.file import reader
from telemetry.file.topics import DEPUTY_CONTROL, DEPUTY_STATE, MISSION

#: what single precision of a track amounts to after a day of free motion
MOST_COASTED_OFF_M = 0.05

#: a margin, its unit (empty: the formula's), the case that has it, and where it was found
Worst = tuple[float, str, Scenario, str]


def worst_of(evidence: Evidence, scenarios: Sequence[Scenario], outcome: FormulaResult) -> Worst:
    """Return the worst known case of a requirement, at random or by a search."""
    case = int(np.argmin(outcome.margins))
    known = [(*outcome.worst, scenarios[case], f"case {case}")]
    for number, searched in enumerate(evidence.searches):
        source = f"{ordinal(number + 1)} search, flight {searched.worst}"
        known.append((*searched.outcome.worst, searched.scenarios[searched.worst], source))
    return min(known, key=lambda worst: worst[0])


def record_worst(
    folder: Path,
    mission: Mission,
    recorder: FlightRecorder,
    domain: Domain | None,
    requirement: Requirement,
    worst: Worst,
) -> dict[str, Any]:
    """Fly the worst known case of a requirement again, logged; record it, and evaluate the recording.

    Returns
    -------
    dict
        Start (m, m/s, rad; Hill axes), settings, margin, recording and what of the domain it leaves.

    Raises
    ------
    pipeline.run.artifacts.ArtifactError
        If the recording has another margin than the flight that was found.
    """
    controller, (margin, unit, scenario, source) = recorder.controller, worst
    names, logs = _recorded(folder, mission, recorder, requirement, scenario)
    assert requirement.formula is not None  # noqa: S101 - flown ones have one
    recordings = [reader.read(folder / name, (DEPUTY_CONTROL, DEPUTY_STATE, MISSION)) for name in names]
    tracks, recorded_facts = tracks_of(recordings, mission)
    facts = facts_of_flown(mission, [scenario], recorded_facts.inspectable)
    again = evaluate_each(tracks, facts, {requirement.id: requirement.formula}, mission.control_period_s)
    margins = again[requirement.id].margins
    deputy = int(np.argmin(margins))
    recorded, path, start = float(margins[deputy]), folder / names[deputy], scenario.fleet[deputy]
    # tracks have single precision: the larger the numbers compared, the larger the error of the margin
    largest = max(abs(predicate.constant) for predicate in predicates(requirement.formula)) + abs(margin)
    looking_ahead = *OF_COASTING, COASTING_PAIR
    coasts = any(kind_of(name) in looking_ahead for name in quantities_of(requirement.formula))
    if not abs(recorded - margin) <= (MOST_COASTED_OFF_M if coasts else max(1e-5, 1e-6 * largest)):
        raise artifacts.ArtifactError(
            f"{path} has a margin of {recorded:g}, but {source} was found with {margin:g}; the flight is "
            "not the one that was found: report this"
        )
    left = left_on(domain, logs[deputy], controller, mission.control_period_s) if domain else ()
    of_fleet = {"deputy": deputy + 1, "recordings": names} if mission.has_fleet else {}
    return {
        "found_by": source,
        **of_fleet,
        "position_m": start.position_m.tolist(),
        "velocity_m_s": start.velocity_m_s.tolist(),
        "sun_angle_rad": float(scenario.sun_angle_rad),
        "sun_elevation_rad": float(scenario.sun_elevation_rad),
        "settings": dict(drawn(mission, scenario)),
        "margin": margin,
        "unit": unit or requirement.unit,
        "recorded_margin": recorded,
        "recording": names[deputy],
        "left_domain": [asdict(departure) for departure in left],
    }


def _recorded(
    folder: Path, mission: Mission, recorder: FlightRecorder, requirement: Requirement, scenario: Scenario
) -> tuple[list[str], list[FlightLog]]:
    """Fly a requirement's worst case and record it, of a fleet each deputy; return the files and logs."""
    controller, name = recorder.controller, f"{requirement.id}-worst"
    (folder / artifacts.WORST_FLIGHTS).mkdir(parents=True, exist_ok=True)
    if not mission.has_fleet:
        log, file = fly_logged(mission, controller, scenario), f"{artifacts.WORST_FLIGHTS}/{name}.mcap"
        recorder.record(folder / file, scenario, log, name)
        return [file], [log]
    fleet = fly_logged_fleet(mission, controller, scenario)
    files = [f"{artifacts.WORST_FLIGHTS}/{name}-deputy-{each.deputy}.mcap" for each in fleet]
    for file, each, start in zip(files, fleet, scenario.fleet, strict=True):
        recorder.record(folder / file, start, each.flight, name, each)
    return files, [each.flight for each in fleet]


def worst_drawn(
    experiment: Experiment, folder: Path, gathered: Mapping[str, Any]
) -> tuple[str, Illustration] | None:
    """Return the recorded flight that fails the gravest open requirement most, in words and drawn."""
    requirement = gravest(gathered["requirements"])
    if requirement is None:
        return None
    worst = requirement["worst"]
    mission = mission_with(experiment.mission, tuple(worst["settings"].items()))
    recording = reader.read(folder / worst["recording"], (DEPUTY_CONTROL, DEPUTY_STATE, MISSION))
    (track, *_), facts = track_of(recording, mission)
    name = f"{requirement['id']} {requirement['title']}"
    words = (
        f"{name}: {worst['found_by']} has the least margin that is known, "
        f"{written(worst['margin'])} {worst['unit']}".rstrip()
        + f" ({worst['recording']})."
    )
    return words, draw_flight(track, facts.number, mission, experiment.report.dots_per_inch)
