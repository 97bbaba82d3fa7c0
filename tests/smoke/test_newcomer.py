"""What somebody meets who types the first command of the README."""

import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

from tests.places import PROJECT
from tests.smoke.command_line import run_module

pytestmark = pytest.mark.slow


def test_a_flight_says_how_to_watch_it_and_the_command_works(tmp_path):
    done = run_module("pipeline", "+experiment=fly", "duration_s=600.0", folder=tmp_path)
    (command,) = re.findall(r"python -m (telemetry replay \S+\.mcap)", done.stderr + done.stdout)
    run_module(*shlex.split(command), "--save", "flight.rrd", folder=tmp_path)
    assert (tmp_path / "flight.rrd").stat().st_size > 0


@pytest.mark.parametrize("steps", [("flight", "start", "rule"), ("sweep", "evidence"), ("review", "learn")])
def test_the_first_hour_goes_as_its_script_plays_it(steps, tmp_path):
    environment = os.environ | {
        "FIRST_HOUR": str(tmp_path),
        "FIRST_HOUR_CASES": "20",
        "PATH": f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}",
    }
    script = [str(PROJECT / "docs" / "first_hour.sh"), *steps]
    done = subprocess.run(script, env=environment, capture_output=True, text=True, check=False)  # noqa: S603
    assert done.returncode == 0, done.stderr
    assert "Traceback" not in done.stderr
    measured = re.findall(
        r"^== .+: [\d.]+ s of processor time, \d+ MB of memory, [\d.]+ MB written$", done.stdout, re.M
    )
    assert len(measured) >= len(steps)
