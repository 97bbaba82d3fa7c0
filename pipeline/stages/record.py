"""Fly notable flights again, logged, and record each as a file, of fleets each deputy: episodes/*.mcap."""

import math
import re
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Final

import numpy as np

from pipeline.controllers.source import controller_of_run
from pipeline.flight.cases.dispersions import mission_of_case
from pipeline.flight.control.controller import Controller
from pipeline.flight.fly.fleet_logs import fly_logged_fleet
from pipeline.flight.goals.flights import achieved, fly_logged
from pipeline.flight.state.log import FlightLog, Scenario
from pipeline.flight.world.limits import metres_beyond
from pipeline.recording.events import points_in_words
from pipeline.recording.recorder import FlightRecorder
from pipeline.run import artifacts, configuration, typed
from pipeline.scenarios import evaluation_scenarios, start_shown, training_scenarios
from pipeline.settings.experiment import Experiment, Mission

if TYPE_CHECKING:
    from pipeline.run.tables import Columns

#: only the first of many random training scenarios are recorded
MOST_TRAINING_FLIGHTS: Final = 8
#: the files that this stage writes
RECORDED_FILES: Final = re.compile(
    r"(training-\d+|((worst|median|best)-)?case-\d+(-deputy-\d+)?|start)\.mcap(\.partial)?"
)


@dataclass(frozen=True)
class FlightToRecord:
    """A flight to record.

    Parameters
    ----------
    name : str
        Of its file, without the ending.
    scenario_id : str
    scenario : Scenario
    expected : tuple of (int, float), optional
        Inspected points and delta-v (m/s) of its evaluation.
    """

    name: str
    scenario_id: str
    scenario: Scenario
    expected: tuple[int, float] | None = None


def run(experiment: Experiment, folder: Path) -> None:
    """Record what `telemetry.record_*` asks for; an earlier run's recordings are removed.

    Raises
    ------
    pipeline.run.artifacts.ArtifactError
        If the evaluation is missing or has other flights, or a file cannot be written.
    """
    flights = flights_of(experiment, folder)
    recordings = folder / artifacts.RECORDINGS
    recordings.mkdir(parents=True, exist_ok=True)
    if flights:
        _record(experiment, folder, flights)
    else:
        sys.stderr.write("  nothing to record: telemetry.record_training, _ranked and _start are all false\n")
    written = {f"{name}.mcap" for flight in flights for name in _names_of(experiment, flight)}
    for path in recordings.iterdir():
        if RECORDED_FILES.fullmatch(path.name) and path.name not in written:
            path.unlink()


def _names_of(experiment: Experiment, flight: FlightToRecord) -> list[str]:
    """Return the names of the files of a flight, without the ending: of a fleet one each deputy."""
    if not experiment.mission.has_fleet:
        return [flight.name]
    return [deputy_file(flight.name, deputy) for deputy in range(1, experiment.mission.fleet.deputies + 1)]


def flights_of(experiment: Experiment, folder: Path) -> list[FlightToRecord]:
    """Return the flights to record: of the training, of the evaluation, from the given start or case."""
    flights: list[FlightToRecord] = []
    if experiment.telemetry.record_training:
        scenarios = training_scenarios(experiment, _last_round(folder))
        for case, scenario in enumerate(scenarios[:MOST_TRAINING_FLIGHTS]):
            flights.append(FlightToRecord(f"training-{case}", f"training-{case}", scenario))
    if experiment.telemetry.record_ranked:
        flights += _ranked_flights(experiment, _columns(folder, artifacts.EPISODES))
    if experiment.telemetry.record_start:
        name, start = start_shown(experiment)
        flights.append(FlightToRecord(name, name, start))
    return flights


def _columns(folder: Path, name: str) -> "Columns":
    # a flight from a given start needs no tables
    from pipeline.run import tables  # noqa: PLC0415

    return tables.Columns(folder, name)


def _last_round(folder: Path) -> int:
    """Return the last round of training, finished or not; 0 without training."""
    is_there = (folder / artifacts.HISTORY).exists()
    return int(_columns(folder, artifacts.HISTORY)["round"][-1]) if is_there else 0


def _ranked_flights(experiment: Experiment, episodes: "Columns") -> list[FlightToRecord]:
    """Return the worst, the median and the best flight of an evaluation."""
    number = episodes.num_rows
    from pipeline.evaluation.ranks import from_worst_to_best  # noqa: PLC0415 - imports Arrow

    rows = from_worst_to_best(episodes.blocks, (0, number // 2, number - 1))
    cases, counts, spent = (episodes.at(name, rows) for name in ("case", "inspected_count", "delta_v_m_s"))
    expected = zip(counts, spent, strict=True)
    ranked = zip(
        ("worst", "median", "best"), cases, evaluation_scenarios(experiment, cases), expected, strict=True
    )
    return [
        FlightToRecord(f"{name}-case-{case}", f"case-{case}", scenario, flown)
        for name, case, scenario, flown in ranked
    ]


def _record(experiment: Experiment, folder: Path, flights: list[FlightToRecord]) -> None:
    """Fly and record, with one line per flight."""
    controller = controller_of_run(experiment, folder)
    recorder = FlightRecorder(experiment, controller, configuration.read(folder))
    for flight in flights:
        if experiment.mission.has_fleet:
            paths = _record_fleet(experiment, folder, controller, recorder, flight)
            continue
        log = fly_logged(experiment.mission, controller, flight.scenario)
        mission = mission_of_case(experiment.mission, flight.scenario)
        _check_repeated(flight, achieved(mission, log))
        path = folder / artifacts.RECORDINGS / f"{flight.name}.mcap"
        recorder.record(path, flight.scenario, log, flight.scenario_id)
        sys.stderr.write(f"  {path.relative_to(folder).as_posix()}: {_in_words(mission, log)}\n")
        paths = [path]
    # the last: the best of an evaluation
    sys.stderr.write(f"  to watch one: {typed.replay(*paths)}\n")


def _record_fleet(
    experiment: Experiment,
    folder: Path,
    controller: Controller,
    recorder: FlightRecorder,
    flight: FlightToRecord,
) -> list[Path]:
    """Fly a fleet and record each deputy, with one line per deputy; return the files."""
    logs, paths = fly_logged_fleet(experiment.mission, controller, flight.scenario), list[Path]()
    spent = np.array([log.flight.delta_v_m_s[-1] for log in logs])
    _check_repeated(flight, (int(np.count_nonzero(logs[0].seen_by[-1])), float(spent.sum())))
    for log, start in zip(logs, flight.scenario.fleet, strict=True):
        path = folder / artifacts.RECORDINGS / f"{deputy_file(flight.name, log.deputy)}.mcap"
        recorder.record(path, start, log.flight, flight.scenario_id, log)
        words = _in_words(experiment.mission, log.flight)
        sys.stderr.write(f"  {path.relative_to(folder).as_posix()}: {words}\n")
        paths.append(path)
    return paths


def deputy_file(name: str, deputy: int) -> str:
    """Return the name of a deputy's recording, without the ending; deputies count from 1."""
    return f"{name}-deputy-{deputy}"


def _check_repeated(flight: FlightToRecord, flown: tuple[int, float]) -> None:
    """Raise ArtifactError unless a worst, median or best flight repeats its evaluation."""
    if flight.expected is None:
        return
    count, delta_v = flight.expected
    # another processor may round the last digits differently
    if flown[0] != count or not math.isclose(flown[1], delta_v, rel_tol=1e-9, abs_tol=1e-12):
        raise artifacts.ArtifactError(
            f"{flight.scenario_id} now achieves {flown[0]} for {flown[1]:.6f} m/s, but "
            f"{artifacts.EPISODES} says {count} for {delta_v:.6f} m/s; the controller or the program "
            "has changed since: repeat the stage evaluate"
        )


def _in_words(mission: Mission, log: FlightLog) -> str:
    """Describe the outcome of a logged flight."""
    done, delta_v = achieved(mission, log)
    if mission.problem.kind == "reach":
        return f"{'the goal is reached' if done else 'the goal is not reached'}, {delta_v:.3f} m/s"
    is_outside = np.any(metres_beyond(mission, log)[1:] > 0.0)
    return f"{points_in_words(log)}, {delta_v:.3f} m/s{', outside the limits' if is_outside else ''}"
