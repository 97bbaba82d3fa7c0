"""Run tests on a copy of the project with the patches of all guides on adding applied to it.

``python -m benchmarks additions`` runs those that are not slow, with numba switched off.
"""

import argparse
import os
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

from tests.smoke.additions import copy_with_additions


def main(arguments: Sequence[str] | None = None) -> int:
    """Return pytest's exit status."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks additions", description=__doc__)
    parser.add_argument("tests", nargs="*", metavar="PATH", help="of tests; all unless given")
    options = parser.parse_args(arguments)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name) / "copy"
        copy_with_additions(folder)
        command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "-m", "not slow"]
        command += [
            "-W",
            "ignore::RuntimeWarning",
        ]  # of NumPy, where compiled code divides by zero in silence
        environment = os.environ | {"PYTHONPATH": os.fspath(folder)}
        done = subprocess.run([*command, *options.tests], cwd=folder, env=environment, check=False)  # noqa: S603
        return done.returncode
