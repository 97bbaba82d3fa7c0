"""Miniature experiments for the tests of recordings."""

from dataclasses import replace
from functools import cache
from pathlib import Path

import telemetry
from pipeline.command_line.config import Job, compose_experiment
from pipeline.controllers.source import controller_of_run
from pipeline.flight.control.controller import Controller
from pipeline.flight.fly.simulation import fly_logged
from pipeline.flight.state.log import FlightLog, Scenario
from pipeline.recording.recorder import FlightRecorder
from pipeline.scenarios import given_start
from pipeline.settings.experiment import Mission
from telemetry.file.recording import Recording
from tests.pipeline.stages.cases import carried_out

#: twelve points on a chief that shows all sides to the Sun: complete after 200 s, then adrift over the limit
COASTING = (
    *("duration_s=900.0", "telemetry.near_limit_m=60.0", "chief=tumbling", "chief.num_points=12"),
    "chief.initial_angular_velocity_rad_s=[0.02,0.05,0.01]",
)


@cache
def composed(*overrides: str) -> Job:
    return compose_experiment(["+experiment=fly", *overrides])


def recorded(
    path: Path, mission: Mission, flying: Controller, start: Scenario
) -> tuple[FlightLog, Recording]:
    """Fly, record in a file, and return the log and what is read of the file."""
    log = fly_logged(mission, flying, start)
    job = composed()
    recorder = FlightRecorder(replace(job.experiment, mission=mission, seed=3), flying, job.config)
    recorder.record(path, start, log, scenario_id="x")
    return log, telemetry.read(path)


def staged(folder: Path, *overrides: str) -> Recording:
    """The flight of an experiment from its start, as the stages record it."""
    carried_out(composed(*overrides), folder)
    return telemetry.read(folder / "episodes" / "start.mcap")


@cache
def flown(*overrides: str) -> FlightLog:
    """The flight of an experiment from its start."""
    experiment = composed(*overrides).experiment
    controller = controller_of_run(experiment, Path("no-folder"))
    return fly_logged(experiment.mission, controller, given_start(experiment))
