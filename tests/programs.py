"""Programs that the project did not write, and that its files and pages are checked with."""

import os
import shutil
from pathlib import Path

import pytest

#: Set where a missing program is a fault and no reason to leave a test out, as in `.ci/run`.
REQUIRED = "EVERY_PROGRAM_REQUIRED"


def program(name: str, package: str) -> str:
    """Return the path of a program; without it leave the test out, or fail where all are required."""
    path = shutil.which(name)
    if path is not None:
        return path
    message = f"{name} is not installed; apt-get install {package}"
    if os.environ.get(REQUIRED):
        pytest.fail(message)
    pytest.skip(message)


def library(path: str, package: str) -> Path:
    """Return the path of a file that a package installs; without it as `program`."""
    if Path(path).exists():
        return Path(path)
    message = f"{path} is not installed; apt-get install {package}"
    if os.environ.get(REQUIRED):
        pytest.fail(message)
    pytest.skip(message)
