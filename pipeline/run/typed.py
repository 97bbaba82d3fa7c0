"""Commands that pages, tables and messages print for a reader to type: on files and folders of runs, quoted.

A page stands in the folder of its run, which may be moved: it prints `RUN` for it, and says so.
"""

import shlex
from pathlib import Path
from typing import Final

#: on pages, in place of the folder of their run
RUN: Final = "RUN"
_PIPELINE: Final = ("python", "-m", "pipeline")
_TELEMETRY: Final = ("python", "-m", "telemetry")


def fly(folder: Path | str, *words: str) -> str:
    """Return the command that flies a case of a run again."""
    return shlex.join([*_PIPELINE, "fly", str(folder), *words])


def again(folder: Path | str) -> str:
    """Return the command that makes the same run again, in a new folder."""
    return shlex.join([*_PIPELINE, "again", str(folder)])


def repeat(folder: Path | str, *stages: str) -> str:
    """Return the command that repeats stages on the files of a run."""
    return shlex.join([*_PIPELINE, "repeat", str(folder), *stages])


def resume(folder: Path | str) -> str:
    """Return the command that goes on with a run or a sweep."""
    return shlex.join([*_PIPELINE, f"resume={folder}"])


def summary(folder: Path | str) -> str:
    """Return the command that tells what came of a sweep."""
    return shlex.join([*_PIPELINE, "summary", str(folder)])


def replay(*recordings: Path | str) -> str:
    """Return the command that shows recorded flights, the first in full."""
    return shlex.join([*_TELEMETRY, "replay", *map(str, recordings)])


def campaign(folder: Path | str) -> str:
    """Return the command that shows all flights of an evaluation."""
    return shlex.join([*_TELEMETRY, "campaign", str(folder)])


def domain(file: Path | str) -> str:
    """Return the command that tells where a recorded flight, named by the reader, leaves a domain."""
    return shlex.join(["python", "-m", "fis_tools", "domain", str(file), "FLIGHT.mcap"])
