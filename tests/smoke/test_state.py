"""No function of ours leaves signals, warnings, the environment or other state of its caller changed.

Every command and every stage that tests run is watched, see `tests.state.unchanged`. Here each program is, by
the list of those that are installed.
"""

import os
import signal
import sys
import tomllib
import warnings
from importlib import import_module

import numpy as np
import pytest
import yaml

from pipeline.settings.stages import STAGES
from telemetry.commands import TERMINATED
from telemetry.commands import main as telemetry_main
from tests.places import PROJECT
from tests.smoke.miniature import EXPERIMENTS
from tests.state import unchanged

PROGRAMS = sorted(
    entry.partition(":")[0]
    for path in (PROJECT, PROJECT / "fis_tools")
    for entry in tomllib.loads((path / "pyproject.toml").read_text())["project"]["scripts"].values()
)


@pytest.mark.parametrize("program", PROGRAMS)
@pytest.mark.parametrize("words", [["--help"], [], ["no_such_command"]])
def test_a_call_returns_and_changes_nothing(program, words, capsys):
    with unchanged():
        assert isinstance(import_module(program).main(words), int)


def test_every_stage_is_watched():
    """By the experiments that ship, or by a test of its own."""
    shipped = {stage for path in EXPERIMENTS for stage in yaml.safe_load(path.read_text())["stages"]}
    tests = [path.read_text() for path in (PROJECT / "tests" / "pipeline" / "stages").glob("test_*.py")]
    tests = [text for text in tests if "carried_out(" in text]
    watched = {stage for stage in STAGES if any(f"stages=[{stage}]" in text for text in tests)}
    assert shipped | watched == set(STAGES)


def test_sigterm_ends_a_command_and_the_call_returns(monkeypatch, capfd):
    monkeypatch.setattr("telemetry.commands.read", lambda _path: os.kill(os.getpid(), signal.SIGTERM))
    with unchanged():
        assert telemetry_main(["info", "flight.mcap"]) == TERMINATED
    assert capfd.readouterr().err == "telemetry: ended by SIGTERM\n"


@pytest.mark.parametrize(
    "change",
    [
        lambda: signal.signal(signal.SIGTERM, signal.SIG_IGN),
        lambda: warnings.simplefilter("ignore"),
        lambda: os.environ.update(STATE="changed"),
        lambda: np.seterr(all="raise"),
        lambda: sys.setrecursionlimit(sys.getrecursionlimit() + 1),
        lambda: sys.path.append("x"),
    ],
)
def test_a_change_is_seen(change, monkeypatch):
    monkeypatch.delenv("STATE", raising=False)
    before = signal.getsignal(signal.SIGTERM), list(sys.path), np.geterr(), sys.getrecursionlimit()
    with warnings.catch_warnings(), pytest.raises(pytest.fail.Exception), unchanged():
        change()
    signal.signal(signal.SIGTERM, before[0])
    sys.path[:] = before[1]
    np.seterr(**before[2])
    sys.setrecursionlimit(before[3])
    os.environ.pop("STATE", None)
