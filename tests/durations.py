"""How long each test takes, in seconds of processors: what `durations.json` tells, and how it is measured.

``python -m pytest --all --record`` measures. A test's own process and those that it starts count; what numba
compiles does not, for the next run finds it in the cache. A run of some tests replaces their durations alone.
"""

import json
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import psutil
import pytest
from numba.core import event

from tests.places import PROJECT

FILE = Path(__file__).with_suffix(".json")

#: of slow tests and of fast ones: by their files and functions, seconds for all cases, and their number
Durations = dict[str, dict[str, dict[str, tuple[float, int]]]]
SPEEDS = ("fast", "slow")
#: seconds of a case beyond which a test is slow, marked or not, and the keyword of those that are not
SLOW_S, FOUND_SLOW = 0.5, "found slow"


def read() -> Durations:
    """Return what was measured, by how tests are marked."""
    known = json.loads(FILE.read_text(encoding="utf-8")) if FILE.exists() else {}
    return {speed: known.get(speed, {}) for speed in SPEEDS}


def found_slow(known: Durations) -> set[tuple[str, str]]:
    """Return functions with cases that are not marked as slow and take longer than `SLOW_S`."""
    return {
        (file, name)
        for file, functions in known["fast"].items()
        for name, (seconds, cases) in functions.items()
        if seconds > SLOW_S * cases
    }


def function_of(nodeid: str) -> tuple[str, str]:
    """Return the file and the function of a test, without its parameters."""
    file, _, rest = nodeid.partition("::")
    return file, rest.partition("[")[0]


def is_there(file: str, function: str) -> bool:
    """Return whether a file of tests still has a function."""
    path = PROJECT / file
    return path.is_file() and f"def {function.rpartition('::')[2]}(" in path.read_text(encoding="utf-8")


def write(measured: dict[str, dict[str, float]]) -> None:
    """Put the seconds of slow and fast tests, by their nodeids, into the file; what is gone leaves it."""
    kept = read()
    for speed, of_tests in measured.items():
        cases: dict[tuple[str, str], list[float]] = {}
        for nodeid, seconds in of_tests.items():
            cases.setdefault(function_of(nodeid), []).append(seconds)
        for (file, function), each in cases.items():
            kept[speed].setdefault(file, {})[function] = (round(sum(each), 2), len(each))
    sections = []
    for speed in SPEEDS:
        files = []
        for file, functions in sorted(kept[speed].items()):
            rows = [
                f"   {json.dumps(name)}: {json.dumps(row)}"
                for name, row in sorted(functions.items())
                if is_there(file, name)
            ]
            if rows:
                files.append(f"  {json.dumps(file)}: {{\n" + ",\n".join(rows) + "\n  }")
        sections.append(f' "{speed}": {{\n' + ",\n".join(files) + "\n }")
    FILE.write_text("{\n" + ",\n".join(sections) + "\n}\n", encoding="utf-8")


class Recorder:
    """A plugin that measures tests in the process that runs them, and collects what others measured."""

    def __init__(self) -> None:
        self._measured: dict[str, dict[str, float]] = {speed: {} for speed in SPEEDS}
        self._compiling_s = self._started_s = 0.0
        self._depth = 0
        self._last_s = self._spent()
        event.register("numba:compile", _Listener(self))

    def compiling(self, is_begin: bool) -> None:
        """Count processor time between the outermost begin and end of compiling."""
        self._depth += 1 if is_begin else -1
        now = sum(os.times()[:2])
        if is_begin and self._depth == 1:
            self._started_s = now
        if not is_begin and self._depth == 0:
            self._compiling_s += now - self._started_s

    def _spent(self) -> float:
        """Return the seconds of this process, its children that ended, and those that live."""
        living = 0.0
        for child in psutil.Process().children(recursive=True):
            try:
                living += sum(child.cpu_times()[:4])
            except psutil.NoSuchProcess:
                continue
        return sum(os.times()[:4]) + living - self._compiling_s

    def pytest_collection_finish(self) -> None:
        """Count from here: what importing all tests takes is not the first one's."""
        self._last_s = self._spent()

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_makereport(self, item: pytest.Item) -> Iterator[None]:
        """Note what a phase took where every process can read it."""
        report = yield
        now = self._spent()
        report.processor_s, self._last_s = now - self._last_s, now
        return report

    def pytest_runtest_logreport(self, report: Any) -> None:
        """Add it up."""
        is_marked = "slow" in report.keywords and FOUND_SLOW not in report.keywords
        of_speed = self._measured["slow" if is_marked else "fast"]
        of_speed[report.nodeid] = of_speed.get(report.nodeid, 0.0) + max(0.0, report.processor_s)

    def pytest_sessionfinish(self, session: pytest.Session) -> None:
        """Write them, once for all processes."""
        if not hasattr(session.config, "workerinput"):
            write(self._measured)


class _Listener(event.Listener):  # type: ignore[misc]
    """Of numba's compiling."""

    def __init__(self, recorder: Recorder) -> None:
        self._recorder = recorder

    def on_start(self, event: object) -> None:
        self._recorder.compiling(is_begin=True)

    def on_end(self, event: object) -> None:
        self._recorder.compiling(is_begin=False)
