"""Miniature experiments for the tests of recordings, and a reader that knows nothing of ours."""

from collections import defaultdict
from dataclasses import dataclass, replace
from functools import cache
from operator import attrgetter
from pathlib import Path
from typing import Any

import numpy as np
from mcap.reader import make_reader
from mcap.records import Attachment, Chunk, Message, Metadata
from mcap.stream_reader import StreamReader
from mcap_protobuf.decoder import DecoderFactory

from fis_tools.formats import serialize
from pipeline.command_line.config import Job, compose_experiment
from pipeline.controllers.source import controller_of_run
from pipeline.flight.control.controller import Controller, from_fuzzy
from pipeline.flight.fly.simulation import fly_logged
from pipeline.flight.state.log import FlightLog, Scenario
from pipeline.recording.recorder import FlightRecorder
from pipeline.scenarios import given_start
from pipeline.settings.experiment import Mission
from tests.places import PROJECT

#: twelve points on a chief that shows all sides to the Sun: complete after 200 s, then adrift over the limit
COASTING = (
    "duration_s=900.0",
    "chief=tumbling",
    "chief.num_points=12",
    "chief.initial_angular_velocity_rad_s=[0.02,0.05,0.01]",
    "telemetry.near_limit_m=60.0",
)
POINT = np.dtype([("position", "<f4", 3), ("colour", "u1", 4)])


@dataclass(frozen=True)
class Contents:
    """What the mcap library finds in a file: decoded messages by topic, and the kinds of records in order."""

    path: Path
    messages: dict[str, list[tuple[int, Any]]]
    metadata: dict[str, dict[str, str]]
    attachments: dict[str, bytes]
    order: list[type]

    def times(self, topic: str) -> list[int]:
        return [time for time, _ in self.messages[topic]]

    def values(self, topic: str, field: str) -> np.ndarray:
        return np.array([getattr(message, field) for _, message in self.messages[topic]])

    def vectors(self, topic: str, path: str, components: str) -> np.ndarray:
        """Components of a message inside the messages, such as x, y, z of pose.position."""
        find, pick = attrgetter(path), attrgetter(*components)
        return np.array([pick(find(message)) for _, message in self.messages[topic]])

    def clouds(self) -> np.ndarray:
        return np.array([np.frombuffer(m.data, dtype=POINT) for _, m in self.messages["/chief/points"]])


def contents(path: Path) -> Contents:
    messages = defaultdict(list)
    with path.open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True, decoder_factories=[DecoderFactory()])
        for _, channel, message, decoded in reader.iter_decoded_messages():
            messages[channel.topic].append((message.log_time, decoded))
        metadata = {record.name: record.metadata for record in reader.iter_metadata()}
        attachments = {record.name: record.data for record in reader.iter_attachments()}
        stream.seek(0)
        kinds = (Attachment, Chunk, Message, Metadata)
        order = [type(r) for r in StreamReader(stream, emit_chunks=True).records if isinstance(r, kinds)]
    return Contents(path, dict(messages), metadata, attachments, order)


@cache
def composed(*overrides: str) -> Job:
    return compose_experiment(["+experiment=fly", *overrides])


def recorded(path: Path, mission: Mission, controller: Controller, start: Scenario) -> FlightLog:
    """Fly, record in a file, and return the log."""
    log = fly_logged(mission, controller, start)
    job = composed()
    recorder = FlightRecorder(replace(job.experiment, mission=mission, seed=3), controller, job.config)
    recorder.record(path, start, log, scenario_id="x")
    return log


def champion() -> Controller:
    """The champion for any Sun, which has dead bands and coasts."""
    return from_fuzzy(serialize.load(PROJECT / "conf" / "controller" / "champion_any_sun.yaml"))


@cache
def flown(*overrides: str) -> FlightLog:
    """The flight of an experiment from its start."""
    experiment = composed(*overrides).experiment
    controller = controller_of_run(experiment, Path("no-folder"))
    return fly_logged(experiment.mission, controller, given_start(experiment))
