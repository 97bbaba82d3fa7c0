"""Signals that end a process: a run tells what it kept, and how to go on."""

import signal
import subprocess
import sys

import pytest

from pipeline.run import artifacts, interrupts
from tests import night
from tests.places import PROJECT

#: in parts that take an hour, of which nothing is compiled
FLIGHTS = ("flight=reference", "duration_s=60", "monte_carlo.num_cases=20000", "engine.part_cases=20")
WORDS = ("+experiment=evaluate", "controller=coast", "stages=[evaluate]", *FLIGHTS)


#: and whether the process ignores the keyboard, as what a shell without job control starts by ``&`` does
SENT = [*((name, "") for name in night.by_day(interrupts.SIGNALS, 2)), ("SIGTERM", "INT")]


@pytest.fixture(params=SENT, ids=lambda sent: " ignoring ".join(filter(None, sent)))
def sent(request):
    """A signal that is not ignored, as nohup would have it: what is started inherits that."""
    name, ignored = request.param
    before = signal.signal(signal.Signals[name], signal.SIG_DFL)
    yield name, ignored
    signal.signal(signal.Signals[name], before)


def test_a_signal_ends_a_run_in_a_sentence(sent, tmp_path):
    name, ignored = sent
    folder, number = tmp_path / "run", signal.Signals[name]
    command = [sys.executable, "-m", "pipeline", *WORDS, f"hydra.run.dir={folder}"]
    if ignored:
        command = ["sh", "-c", f'trap "" {ignored}; exec "$@"', "sh", *command]
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True, cwd=PROJECT) as process:  # noqa: S603
        try:
            lines = iter(process.stderr.readline, "")
            assert any("part: " in line for line in lines)
            process.send_signal(number)
            words = process.stderr.read()
            assert process.wait() == 128 + number, words
        finally:
            process.kill()
    assert f"interrupted by {name} in the stage evaluate (no stage was finished before)" in words
    assert f"To go on: python -m pipeline resume={folder}" in words
    assert "Traceback" not in words
    *_, last = (folder / artifacts.LOG).read_text().splitlines()
    assert last.endswith(f"UTC INFO pipeline: stage evaluate interrupted by {name}")
    assert list((folder / artifacts.EPISODE_PARTS).rglob("*.parquet"))
