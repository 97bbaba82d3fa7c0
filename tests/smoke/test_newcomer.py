"""What somebody meets who types the first command of the README."""

import re
import shlex

import pytest

from telemetry import commands
from tests.smoke.command_line import run_module, run_pipeline

pytestmark = pytest.mark.slow


def test_a_flight_says_how_to_watch_it_and_the_command_works(tmp_path):
    done = run_module("pipeline", "+experiment=fly", "duration_s=600.0", folder=tmp_path)
    (command,) = re.findall(r"python -m (telemetry replay \S+\.mcap)", done.stderr + done.stdout)
    run_module(*shlex.split(command), "--save", "flight.rrd", folder=tmp_path)
    assert (tmp_path / "flight.rrd").stat().st_size > 0


def test_a_flown_controller_can_be_reviewed_from_its_recording(tmp_path):
    folder = run_pipeline("+experiment=fly", "duration_s=600.0", folder=tmp_path / "run")
    flight = folder / "episodes" / "start.mcap"
    for words in (["show", flight], ["explain", flight, "--time", "300"], ["firing", flight]):
        assert "force_x" in run_module("fis_tools", *words, folder=tmp_path).stdout
    assert "delta-v" in run_module("telemetry", "info", flight, folder=tmp_path).stdout
    assert commands.main(["info", str(flight)]) == 0
