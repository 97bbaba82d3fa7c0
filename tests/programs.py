"""Programs that the project did not write, and that its files and pages are checked with."""

import os
import shutil
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


def missing(message: str) -> NoReturn:
    """Fail where all programs are required; else leave the test out, for nobody need install them to test."""
    if os.environ.get(REQUIRED):
        pytest.fail(message)
    pytest.skip(message)
