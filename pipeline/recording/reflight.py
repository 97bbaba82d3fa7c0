"""Flies a recorded flight again from nothing but its recording, and compares the two."""

import base64
import tempfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import numpy as np

import telemetry
from fis_tools.analysis.flights import CONTROLLER_ATTACHMENT
from fis_tools.formats import serialize
from pipeline.controllers import source
from pipeline.controllers.played import from_mapping
from pipeline.controllers.policies import policy_of
from pipeline.flight.control.controller import Controller, from_fuzzy, open_loop
from pipeline.flight.goals.flights import fly_logged
from pipeline.flight.state.log import Scenario
from pipeline.recording.recorder import CONFIG_ATTACHMENT, FlightRecorder
from pipeline.run import configuration
from pipeline.settings.experiment import Experiment
from pipeline.settings.schema import experiment_from
from plain_files.plain_text import parse_json
from telemetry import RecordingError
from telemetry.file.compare import Comparison, compare
from telemetry.file.recording import Recording
from telemetry.file.topics import DEPUTY_CONTROL

#: of attitude, which a recording may ask for however little it holds
MOST_PERIODS: Final = 200_000
#: by which fields may differ, in their own units, where another processor rounds the last digits otherwise
LAST_DIGITS: Final = 1e-6
#: what follows where a recording does not tell what was flown
CURE: Final = "it cannot be flown again: record the flight anew"


@dataclass(frozen=True)
class Reflight:
    """A recording beside the same flight, flown now.

    Parameters
    ----------
    path : Path
    is_equal : bool
        To the last bit.
    is_close : bool
        Within `LAST_DIGITS`, with the same counts, states and texts.
    greatest : float
        The largest difference of a field.
    where : str
        That field; empty where nothing differs.
    """

    path: Path
    is_equal: bool
    is_close: bool
    greatest: float
    where: str


def fly_again(path: Path) -> Reflight:
    """Fly what a recording says was flown, record it, and compare.

    Configuration and controller come from its attachments, the start from its metadata.

    Raises
    ------
    telemetry.RecordingError
        If it cannot be read, lacks what a flight needs, or is of a fleet.
    pipeline.settings.experiment.SettingError
        If its configuration is none of this program's.
    """
    recording = telemetry.read(path)
    config = _attached(recording, CONFIG_ATTACHMENT, "configuration", configuration.parse)
    experiment = experiment_from(config)
    if experiment.mission.has_fleet:
        raise RecordingError(
            f"{recording.path} is of one deputy of a fleet, which the others' messages belong to; repeat the "
            "run that recorded it: python -m pipeline again RUN"
        )
    _check_length(recording, experiment)
    scenario = start_of(recording)
    controller = _controller_of(recording, experiment)
    log = fly_logged(experiment.mission, controller, scenario)
    episode = recording.episode
    # a learner's episodes have a seed each
    seed = experiment.seed if episode.seed is None else episode.seed
    recorder = FlightRecorder(replace(experiment, seed=seed), controller, config)
    with tempfile.TemporaryDirectory() as folder:
        again = Path(folder, path.name)
        recorder.record(again, scenario, log, episode.scenario_id or "")
        flown = telemetry.read(again)
    # what recordings of earlier versions do not hold
    known = {name: topic for name, topic in flown.topics.items() if name in recording.topics}
    flown = replace(flown, topics=known)
    return _judged(path, compare(recording, flown), compare(recording, flown, LAST_DIGITS))


def _check_length(recording: Recording, experiment: Experiment) -> None:
    """Raise RecordingError for a configuration that asks for far more than is recorded."""
    num_periods = experiment.mission.num_controls * experiment.mission.num_attitude_steps
    most = max(MOST_PERIODS, 2 * max(map(len, recording.topics.values()), default=0))
    if num_periods > most:
        raise RecordingError(
            f"{recording.path}: its {CONFIG_ATTACHMENT} asks for {num_periods:,} periods of attitude, and of "
            f"what it holds at most {most:,} are flown again"
        )


def _judged(path: Path, exact: Comparison, close: Comparison) -> Reflight:
    """Return how closely a flight was repeated, with the field that differs most."""
    fields = [field for field in exact.fields if field.greatest > 0.0]
    worst = max(fields, key=lambda field: field.greatest, default=None)
    where = f"{worst.topic} {worst.field}" if worst else (exact.lone[0].topic if exact.lone else "")
    return Reflight(path, exact.is_equal, close.is_equal, worst.greatest if worst else 0.0, where)


def _attached(recording: Recording, name: str, what: str, parse: Callable[[bytes], Any]) -> dict[str, Any]:
    """Return the content of an attachment as plain data."""
    if name not in recording.attachments:
        raise RecordingError(f"{recording.path} has no attachment {name}; {CURE}")
    try:
        content = parse(recording.attachments[name])
    except (ValueError, RecursionError) as error:
        raise RecordingError(f"{recording.path}: its {name} cannot be read ({error}); {CURE}") from error
    if not isinstance(content, dict):
        raise RecordingError(f"{recording.path}: its {name} holds no {what}; {CURE}")
    return content


def start_of(recording: Recording) -> Scenario:
    """Return the start of a recorded flight."""
    episode = recording.episode
    if episode.position_m is None or episode.velocity_m_s is None or episode.sun_angle_rad is None:
        raise RecordingError(f"{recording.path} does not tell from where it was flown; {CURE}")
    # of flights without any errors recordings do not tell what they were drawn from
    seed, stage, case = episode.noise or (0, 0, 0)
    return Scenario(
        np.array(episode.position_m),
        np.array(episode.velocity_m_s),
        episode.sun_angle_rad,
        episode.sun_elevation_rad or 0.0,
        (int(seed), int(stage), int(case)),
        episode.settings,
    )


def _controller_of(recording: Recording, experiment: Experiment) -> Controller:
    """Return the controller that is attached; the forces of one that plays them are those recorded."""
    content = _attached(recording, CONTROLLER_ATTACHMENT, "controller", parse_json)
    if "systems" in content:
        return from_fuzzy(serialize.from_mapping(content))
    if content.get("kind") == "open_loop" and "forces_n" in content:
        return from_mapping(content)
    if content.get("kind") == "open_loop":  # recordings of such flights hold the name alone
        forces = recording[DEPUTY_CONTROL]["force_hill_n"].astype(np.float64)
        return open_loop(str(content.get("name")), forces)
    if content.get("kind") == "policy":
        return _policy_of(recording, content)
    return source.load({**experiment.controller, "kind": content.get("kind")}, experiment.mission)


def _policy_of(recording: Recording, entry: Mapping[str, Any]) -> Controller:
    """Return the policy whose ONNX content a recording carries."""
    try:
        content = base64.b64decode(str(entry.get("onnx")), validate=True)
        return policy_of(str(entry.get("name")), content, f"the policy of {recording.path}")
    except ValueError as error:  # raised for what is no controller, too
        raise RecordingError(f"{recording.path}: its policy cannot be read ({error}); {CURE}") from error
