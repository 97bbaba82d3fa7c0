"""One entry in the registry is all that a shape needs: it is checked, worded, written, read and inferred with."""

import subprocess
import sys


def test_an_entry_in_the_registry_is_enough() -> None:
    # a process of its own: formats read the registry when they are imported, and no other test shall see this
    program = [sys.executable, "-m", "tests.fis_tools.model.cosine_bump"]
    run = subprocess.run(program, capture_output=True, text=True, check=False)
    assert (run.returncode, run.stdout) == (0, "all of it\n"), run.stderr
