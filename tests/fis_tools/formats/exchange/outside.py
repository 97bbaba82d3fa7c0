"""Programs that the project did not write, evaluating the files that it wrote."""

import re
import subprocess
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from fis_tools.array_types import Floats
from tests.programs import program

#: Points of every universe, and of the programs' own sampling.
NUM_POINTS = 1001

#: MATLAB's name of a disjunction that Octave's toolkit knows under another one.
_PROBOR = "function y = probor (x)\n  y = algebraic_sum (x);\nendfunction\n"


def octave_outputs(
    files: Mapping[str, Path], inputs: Mapping[str, Floats], folder: Path
) -> dict[str, Floats]:
    """Evaluate `.fis` files with Octave's `readfis` and `evalfis`, all in one start of Octave.

    By name: a file, its samples (n, num_inputs), and the outputs (n, num_outputs).
    """
    script = ["pkg load fuzzy-logic-toolkit", _PROBOR]
    for name, path in files.items():
        np.savetxt(folder / f"{name}.in", inputs[name], fmt="%.17g")
        script += [
            f"y = evalfis (load ('{folder / name}.in'), readfis ('{path}'), {NUM_POINTS});",
            f"dlmwrite ('{folder / name}.out', y, 'delimiter', ' ', 'precision', '%.17g');",
        ]
    (folder / "run.m").write_text("\n".join(script) + "\n", encoding="utf-8")
    command = [program("octave", "octave"), "--no-gui", "--quiet", "--no-init-file", str(folder / "run.m")]
    subprocess.run(command, check=True, capture_output=True, text=True)  # noqa: S603
    return {name: np.loadtxt(folder / f"{name}.out", ndmin=2) for name in files}


def fuzzylite_outputs(path: Path, inputs: Floats, folder: Path) -> Floats:
    """Evaluate an `.fis` or `.fll` file with fuzzylite's own program.

    The program has no option for the resolution: it writes the engine that it understood as FLL, in which the
    resolution is raised, and evaluates that.

    Returns
    -------
    (n, num_outputs)
    """
    fuzzylite = program("fuzzylite", "fuzzylite")
    understood, samples, results = folder / "understood.fll", folder / "samples.fld", folder / "results.fld"
    many = ["-decimals", "15"]
    _run([fuzzylite, "-i", str(path), "-o", str(understood), *many])
    text = understood.read_text(encoding="utf-8")
    engine, count = re.subn(r"(defuzzifier: \w+) \d+", rf"\1 {NUM_POINTS - 1}", text)
    assert count or "defuzzifier: Weighted" in engine
    understood.write_text(engine, encoding="utf-8")
    np.savetxt(samples, inputs, fmt="%.17g")
    files = ["-i", str(understood), "-o", str(results), "-d", str(samples)]
    _run([fuzzylite, *files, *["-dinputs", "false", "-dheader", "false"], *many])
    return np.loadtxt(results, ndmin=2)


def _run(command: list[str]) -> None:
    subprocess.run(command, check=True, capture_output=True, text=True)  # noqa: S603
