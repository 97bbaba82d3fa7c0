"""The proof in the run of some evidence, checked here by the checker that stands beside this package."""

import os
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path
from typing import Final

from plain_files.file_access import read_text
from plain_files.plain_text import parse_json, plain

#: of a run: what its proof is about
THEOREM: Final = "prove/theorem.json"
#: where the checker is, beside this package, and what it needs
CHECKER: Final = ("pipeline", "proof", "check.py")
NEEDS: Final = "flint"
#: letters of the checker's reason that are repeated
MOST_LETTERS: Final = 300
RIGHT, REFUSED = "right", "REFUSED"


def proof_in_words(folder: Path, fingerprint: str) -> tuple[str, str]:
    """Check the proof in a run's folder, if there is one.

    Parameters
    ----------
    folder : Path
    fingerprint : str
        Of the controller under review.

    Returns
    -------
    outcome, words : str
        `RIGHT`, `REFUSED`, or empty if it could not be checked; and what to say of it, empty without a proof.
    """
    if not (folder / THEOREM).is_file():
        return "", ""
    try:
        theorem = parse_json(read_text(folder / THEOREM))
        sha256 = theorem["controller_sha256"]
    except (OSError, ValueError, KeyError, TypeError, RecursionError):
        return REFUSED, "the proof in its run cannot be read"
    if sha256 != fingerprint:
        return REFUSED, "the proof in its run is of another controller"
    root = Path(__file__).resolve().parents[2]
    if not root.joinpath(*CHECKER).is_file() or find_spec(NEEDS) is None:
        return "", "the proof in its run was not checked, for the checker is not installed here"
    sys.stderr.write("checking the proof\n")
    # -P: nothing in the working directory is imported
    command = [sys.executable, "-P", "-m", "pipeline.proof.check", str(folder)]
    done = subprocess.run(  # noqa: S603 - our own checker, with a folder
        command,
        env=os.environ | {"PYTHONPATH": str(root)},
        capture_output=True,
        text=True,
        errors="replace",
        check=False,
    )
    if done.returncode == 0:
        return RIGHT, "the checker finds the proof in its run right"
    last = plain((done.stderr or done.stdout).strip().splitlines() or [""])[-1][:MOST_LETTERS]
    return REFUSED, f"the checker REFUSES the proof in its run ({last})"
