"""What can be shown on Linux of systems that have less: no module needs at its import what only POSIX has."""

import pytest

from tests.places import PROJECT
from tests.programs import run_python

PACKAGES = ("pipeline", "fis_tools", "telemetry")
LACKING = ("fcntl", "grp", "pty", "pwd", "resource", "termios", "tty")
#: psutil takes others where it lacks these, which Linux does not have; so it comes first
IMPORTS = f"""
import importlib, pkgutil, psutil, sys
sys.modules.update(dict.fromkeys({LACKING}))
for name in {PACKAGES}:
    for module in pkgutil.walk_packages(importlib.import_module(name).__path__, name + "."):
        if not module.name.endswith("__main__"):
            importlib.import_module(module.name)
            print(module.name)
"""


@pytest.mark.slow
def test_every_module_is_imported_without_what_only_posix_has():
    done = run_python("-c", IMPORTS, folder=PROJECT)
    files = [path for name in PACKAGES for path in (PROJECT / name).rglob("*.py")]
    assert len(done.stdout.split()) >= sum(path.stem not in {"__init__", "__main__"} for path in files)
