"""Programs that the project did not write, and that its files and pages are checked with."""

import os
import shutil
import subprocess
from pathlib import Path
from typing import NoReturn

import pytest

#: Set where a missing program is a fault and no reason to leave a test out, as in `.ci/run`.
REQUIRED = "EVERY_PROGRAM_REQUIRED"


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
