"""What a terminal shows while somebody waits, and that nothing of it stays or reaches what is printed."""

import os
import subprocess
import sys

import pytest

from tests.places import PROJECT

PROGRAM = """
import time
from fis_tools.waiting import waiting
with waiting("first") as tell:
    tell("so far")
    with waiting("inner"):
        time.sleep(0.3)
print("result")
"""


def told_and_shown(stderr: int) -> str:
    environment = os.environ | {"PYTHONPATH": str(PROJECT), "TERM": "xterm", "COLUMNS": "80"}
    command = [sys.executable, "-c", PROGRAM]
    done = subprocess.run(command, stdout=-1, stderr=stderr, text=True, check=True, env=environment)  # noqa: S603
    return done.stdout + (done.stderr or "")


def test_a_terminal_shows_what_goes_on_and_nothing_of_it_stays() -> None:
    pty = pytest.importorskip("pty")
    ours, theirs = pty.openpty()
    assert told_and_shown(theirs) == "result\n"
    os.close(theirs)
    shown = os.read(ours, 100_000).decode()
    os.close(ours)
    assert "so far" in shown
    assert "inner" in shown
    assert shown.rstrip().endswith("\x1b[2K")


def test_elsewhere_nothing_is_shown() -> None:
    assert told_and_shown(subprocess.PIPE) == "result\n"
