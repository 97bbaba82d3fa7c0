"""Durations of the tools, imports included: flights into scenes, controllers into findings and pages."""

import subprocess
import sys
import tempfile
from pathlib import Path

from benchmarks.recording import with_third_inputs
from benchmarks.timing import best_wall_seconds, line
from fis_tools.formats.serialize import dump_json, load
from pipeline.command_line.config import conf_folder


def run(controller: str) -> None:
    """Print the durations of scenes, and of an audit and a review page for systems of 125 rules."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        _call("pipeline", "+experiment=fly", f"controller={controller}", f"hydra.run.dir={folder}/flown")
        _call("pipeline", "+experiment=evaluate", f"controller={controller}", f"hydra.run.dir={folder}/cases")
        large = folder / "large.json"
        large.write_text(
            dump_json(with_third_inputs(load(conf_folder() / "controller" / f"{controller}.yaml"))),
            encoding="utf-8",
        )
        _call("pipeline", "+experiment=fly", f"controller={large}", f"hydra.run.dir={folder}/large")
        flight, large_flight = (folder / run / "episodes" / "start.mcap" for run in ("flown", "large"))
        page = folder / "review.html"
        print(f"Tools: whole commands, compiled before; a flight and 1,000 cases of {controller}")
        _time("telemetry replay --save", "telemetry", "replay", flight, "--save", folder / "flight.rrd")
        _time(
            "telemetry campaign --save",
            "telemetry",
            "campaign",
            folder / "cases",
            "--save",
            folder / "cases.rrd",
        )
        _time("fis_tools audit, systems of 125 rules and their flight", "fis_tools", "audit", large_flight)
        _time("fis_tools review, the same", "fis_tools", "review", large_flight, "-o", page)
        line("its page, MB", f"{page.stat().st_size / 1e6:.2f}")


def _time(what: str, *words: object) -> None:
    line(f"{what}, seconds", f"{best_wall_seconds(lambda: _call(*words), repeats=3):.2f}")


def _call(module: object, *words: object) -> None:
    command = [sys.executable, "-m", str(module), *map(str, words)]
    subprocess.run(command, check=True, capture_output=True)  # noqa: S603
