"""Commands that pages, tables and messages print for a reader to type: on the folder of a run, quoted."""

import shlex
from pathlib import Path


def fly(folder: Path | str, *words: str) -> str:
    """Return the command that flies a case of a run again."""
    return shlex.join(["python", "-m", "pipeline", "fly", str(folder), *words])


def resume(folder: Path | str) -> str:
    """Return the command that goes on with a run or a sweep."""
    return shlex.join(["python", "-m", "pipeline", f"resume={folder}"])


def summary(folder: Path | str) -> str:
    """Return the command that tells what came of a sweep."""
    return shlex.join(["python", "-m", "pipeline", "summary", str(folder)])
