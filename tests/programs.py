"""Programs that tests run: Python, and those that our files and pages are checked with."""

import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import NoReturn

import pytest

from tests.places import PROJECT

#: Set where a missing program is a fault and no reason to leave a test out, as in `.ci/run`.
REQUIRED = "EVERY_PROGRAM_REQUIRED"


def run_python(
    *words: object, folder: Path = PROJECT, path: object = PROJECT, code: int = 0, **more: str
) -> subprocess.CompletedProcess[str]:
    """Run Python in a folder, with packages from a path; it ends with a code and without a traceback."""
    command = [sys.executable, *map(str, words)]
    environment = os.environ | {"PYTHONPATH": str(path)} | more
    captured = {"stdin": subprocess.DEVNULL, "capture_output": True, "text": True}
    done = subprocess.run(command, cwd=folder, env=environment, check=False, **captured)  # noqa: S603
    assert done.returncode == code, done.stdout + done.stderr
    assert "Traceback" not in done.stderr
    return done


def program(name: str, package: str) -> str:
    """Return the path of a program."""
    return shutil.which(name) or missing(f"{name} is not installed; apt-get install {package}")


def library(path: str, package: str) -> Path:
    """Return the path of a file that a package installs."""
    if not Path(path).exists():
        missing(f"{path} is not installed; apt-get install {package}")
    return Path(path)


def installed(source: Path, folder: Path) -> Path:
    """Copy a folder, and install there what its lock names for node."""
    shutil.copytree(source, folder, ignore=shutil.ignore_patterns("node_modules"))
    command = [program("npm", "npm"), "ci", "--ignore-scripts", "--no-audit", "--no-fund"]
    done = subprocess.run(command, check=False, cwd=folder, capture_output=True, text=True)  # noqa: S603
    if done.returncode:
        missing(f"npm cannot install what {source.name} needs: {done.stderr.strip()[-500:]}")
    return folder


def missing(message: str) -> NoReturn:
    """Fail where all programs are required; else leave the test out, for nobody need install them to test."""
    if os.environ.get(REQUIRED):
        pytest.fail(message)
    pytest.skip(message)
