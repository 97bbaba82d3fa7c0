"""An interrupt that Python cannot raise is remembered, and shows no traceback."""

import subprocess
import sys

from tests.places import PROJECT

PROGRAM = """
import os, signal
from pipeline.run import interrupts
class Lost:
    def __del__(self):
        os.kill(os.getpid(), signal.SIGINT)
        sum(range(1000))
signal.signal(signal.SIGINT, signal.default_int_handler)  # one that runs in the background ignores it
interrupts.remember()
said = "told"
class Faulty:
    def __del__(self):
        raise ValueError(said)
faulty = Faulty()
del faulty
try:
    with interrupts.heeded():
        lost = Lost()
        del lost
        print("went on")
except KeyboardInterrupt:
    print("interrupted")
said = "not told"
half_made = Faulty()
del half_made
"""


def test_an_interrupt_lost_in_a_finalizer_ends_the_work_without_a_traceback():
    command = [sys.executable, "-c", PROGRAM]
    done = subprocess.run(command, cwd=PROJECT, capture_output=True, text=True, check=True)  # noqa: S603
    assert done.stdout.split("\n")[-2] == "interrupted"
    assert "KeyboardInterrupt" not in done.stderr
    assert "ValueError: told" in done.stderr
    assert "not told" not in done.stderr
