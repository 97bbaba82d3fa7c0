"""What a terminal shows while somebody waits, and that nothing of it stays or reaches what is printed."""

import os
import subprocess
import sys

import pytest

from tests.places import PROJECT
from tests.programs import run_python

PROGRAM = """
import time
from fis_tools.waiting import waiting
with waiting("first") as tell:
    tell("so far")
    with waiting("inner"):
        time.sleep(0.3)
print("result")
"""


TERMINAL = {"TERM": "xterm", "COLUMNS": "80"}


def test_a_terminal_shows_what_goes_on_and_nothing_of_it_stays() -> None:
    pty = pytest.importorskip("pty")
    ours, theirs = pty.openpty()
    command = [sys.executable, "-c", PROGRAM]
    printed = subprocess.check_output(command, stderr=theirs, cwd=PROJECT, env=os.environ | TERMINAL)  # noqa: S603
    assert printed == b"result\n"
    os.close(theirs)
    shown = os.read(ours, 100_000).decode()
    os.close(ours)
    assert "so far" in shown
    assert "inner" in shown
    assert shown.rstrip().endswith("\x1b[2K")


def test_elsewhere_nothing_is_shown() -> None:
    done = run_python("-c", PROGRAM, **TERMINAL)
    assert (done.stdout, done.stderr) == ("result\n", "")
