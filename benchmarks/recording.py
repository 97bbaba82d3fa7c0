"""The cost of a recording: writing a flight, its size, and reading a part of a long file."""

import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np
from mcap.reader import make_reader
from mcap.writer import Writer

import telemetry
from benchmarks.timing import best_cpu_seconds, best_wall_seconds, line
from fis_tools.model import FuzzyController, FuzzySystem, rule_table, table_rules
from pipeline.command_line.config import Job, compose_experiment
from pipeline.controllers import source as controller_source
from pipeline.flight.control.controller import Controller, from_fuzzy
from pipeline.flight.fly.simulation import fly_logged
from pipeline.recording.recorder import FlightRecorder
from pipeline.scenarios import evaluation_scenarios

NUM_FLIGHTS = 100
PERIOD_NS = 3_610_000_000_000


def run(controller: str) -> None:
    """Print the cost of logging a flight with 25 and 125 rules per system, and of reading a part."""
    composed = compose_experiment(["+experiment=evaluate", f"controller={controller}"])
    flown = controller_source.load(composed.experiment.controller, composed.experiment.mission)
    with tempfile.TemporaryDirectory() as folder:
        flight = Path(folder) / "flight.mcap"
        time_recording(composed, flown, flight)
        long_file = Path(folder) / "long.mcap"
        num_messages = write_long(flight, long_file)
        if flown.fuzzy is not None:
            time_recording(composed, from_fuzzy(with_third_inputs(flown.fuzzy)), flight)
        time_reading(long_file, num_messages)


def time_recording(composed: Job, flown: Controller, path: Path) -> None:
    """Fly and record once; print milliseconds and KiB."""
    experiment = composed.experiment
    scenario = evaluation_scenarios(experiment)[0]
    log = fly_logged(experiment.mission, flown, scenario)
    recorder = FlightRecorder(experiment, flown, composed.config)

    def record() -> None:
        recorder.record(path, scenario, log, "benchmark")

    rules = ", ".join(str(len(system.rules)) for system in flown.systems)
    print(f"Recording one flight, systems of {rules} rules")
    line("milliseconds", f"{1e3 * best_wall_seconds(record):.1f}")
    line("milliseconds of the processor", f"{1e3 * best_cpu_seconds(record):.1f}")
    line("KiB", f"{path.stat().st_size / 1024:.0f}")


def with_third_inputs(controller: FuzzyController) -> FuzzyController:
    """Add the last input of the next system to each: three inputs of five terms, 125 rules."""
    systems = controller.systems
    neighbours = [*systems[1:], systems[0]]
    widened = tuple(_widened(system, other) for system, other in zip(systems, neighbours, strict=True))
    return replace(controller, name=f"{controller.name}_wide", systems=widened)


def _widened(system: FuzzySystem, other: FuzzySystem) -> FuzzySystem:
    table = rule_table(system)
    assert table is not None, "a rule for each pair of terms is expected"
    added, output = other.inputs[-1], system.outputs[0]
    inputs = (*system.inputs, added)
    words = [output.terms[index].name for index in np.repeat(table.ravel(), len(added.terms))]
    return replace(system, inputs=inputs, rules=table_rules(inputs, output, words))


def write_long(flight: Path, path: Path) -> int:
    """Write a flight's messages repeatedly, one flight after the other; return their number."""
    num_messages = 0
    with flight.open("rb") as source, path.open("wb") as target:
        rows = list(make_reader(source).iter_messages())
        writer = Writer(target)
        writer.start()
        channels: dict[str, int] = {}
        for schema, channel, _ in rows:
            if channel.topic not in channels:
                assert schema is not None
                known = writer.register_schema(schema.name, schema.encoding, schema.data)
                channels[channel.topic] = writer.register_channel(channel.topic, "protobuf", known)
        for number in range(NUM_FLIGHTS):
            for _, channel, message in rows:
                time_ns = number * PERIOD_NS + message.log_time
                writer.add_message(channels[channel.topic], time_ns, message.data, time_ns)
                num_messages += 1
        writer.finish()
    return num_messages


def time_reading(path: Path, num_messages: int) -> None:
    """Print the cost of reading all of a long file, and one topic in a hundredth of its time."""
    middle = NUM_FLIGHTS // 2 * PERIOD_NS / 1e9
    span = PERIOD_NS / 1e9
    ways = {
        "all of it, seconds": lambda: telemetry.read(path),
        "a hundredth of its time, seconds": lambda: telemetry.read(
            path, start_s=middle, end_s=middle + 0.99 * span
        ),
        "one topic of that, seconds": lambda: telemetry.read(
            path, "/deputy/state", start_s=middle, end_s=middle + 0.99 * span
        ),
    }
    print(f"Reading a recording of {num_messages} messages, {path.stat().st_size / 2**20:.0f} MiB")
    for what, read in ways.items():
        line(what, f"{best_wall_seconds(read, repeats=1):.3f}")
