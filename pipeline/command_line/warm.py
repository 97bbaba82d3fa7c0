"""The command ``warm``: compile what the shipped experiments need, so that no later run waits for it."""

import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Final

from pipeline.command_line.job import ConfigError

OK: Final = 0
FEW: Final = ("duration_s=600", "monte_carlo.num_cases=8")
#: short runs, whose kinds of flight are those of the shipped experiments
RUNS: Final[Sequence[Sequence[str]]] = (
    ("+experiment=fly", "controller=champion_27"),
    ("+experiment=evaluate", "controller=champion_27", "stages=[scenario,evaluate]", *FEW),
    (
        "+experiment=train",
        "optimizer.population_size=8",
        "optimizer.generations=2",
        "stages=[scenario,train]",
    ),
    ("+experiment=fly", "controller=lqr"),
    ("+experiment=fly", "controller=champion_leo", "world=leo"),
)


def warm(given: Sequence[str]) -> int:
    """Run each of `RUNS` twice in a folder of its own, for what is wanted once is not compiled yet.

    Return the exit code of the first that fails, else 0.

    Raises
    ------
    ConfigError
        If anything is given.
    """
    if given:
        raise ConfigError("warm takes no arguments; python -m pipeline warm & does it in the background")
    with tempfile.TemporaryDirectory() as folder:
        for number, words in enumerate(RUNS):
            sys.stderr.write(f"[{number + 1}/{len(RUNS)}] {' '.join(words)}\n")
            for turn in ("first", "second"):
                place = f"hydra.run.dir={Path(folder, f'{number}-{turn}')}"
                command = [sys.executable, "-m", "pipeline", *words, place]
                done = subprocess.run(command, check=False, stdout=subprocess.DEVNULL)  # noqa: S603
                if done.returncode:
                    return done.returncode
    return OK
