"""Other inference programs, timed in separate processes.

The other files of this folder are run by a Python that has them. All get the same system, and return their
outputs with the time.
"""

import json
import os
import shutil
import subprocess
import sys
import tempfile
from dataclasses import astuple, dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from fis_tools.compiled.cache import cache_root
from fis_tools.formats.exchange import fll
from fis_tools.formats.exchange.antecedents import operands_of
from fis_tools.model import FuzzyController, FuzzySystem, Gaussian

Floats = NDArray[np.float64]
FOLDER = Path(__file__).parent
PYFUZZYLITE = "pyfuzzylite==8.0.6"
OTHERS = ("simpful==2.12.0", "fuzzytool==0.7.0")


class Missing(RuntimeError):  # noqa: N818
    """A program that is not installed; the text says what to do."""


@dataclass(frozen=True)
class Timed:
    """An engine's outputs for some samples, shape (n,), and its processor time per sample."""

    outputs: Floats
    seconds: float


def fuzzylite(system: FuzzySystem, inputs: Floats) -> Timed:
    """Time fuzzylite's C++ library, compiled with full optimisation."""
    compiler = shutil.which("g++")
    if compiler is None or not Path("/usr/include/fl/Headers.h").exists():
        raise Missing("apt-get install g++ libfuzzylite-dev")
    with tempfile.TemporaryDirectory() as name:
        folder = _files(Path(name), system)
        driver = folder / "driver"
        source = FOLDER / "fuzzylite.cpp"
        command = [
            compiler,
            "-std=c++11",
            "-O3",
            "-march=native",
            "-w",
            str(source),
            "-o",
            str(driver),
            "-lfuzzylite",
        ]
        subprocess.run(command, check=True)  # noqa: S603
        inputs.tofile(folder / "inputs")
        words = [
            str(folder / "system.fll"),
            str(folder / "inputs"),
            str(len(inputs)),
            str(folder / "outputs"),
        ]
        seconds = _seconds([str(driver), *words])
        return Timed(np.fromfile(folder / "outputs"), seconds / len(inputs))


def pyfuzzylite(system: FuzzySystem, inputs: Floats) -> Timed:
    """Time pyfuzzylite on arrays, in a separate environment: it needs an older NumPy."""
    python = environment()
    with tempfile.TemporaryDirectory() as name:
        folder = _files(Path(name), system)
        np.save(folder / "inputs.npy", inputs)
        files = [str(folder / file) for file in ("system.fll", "inputs.npy", "outputs.npy")]
        seconds = _seconds([str(python), str(FOLDER / "pyfuzzylite.py"), *files])
        return Timed(np.load(folder / "outputs.npy"), seconds / len(inputs))


def _files(folder: Path, system: FuzzySystem) -> Path:
    text = fll.write(FuzzyController(system.name, (system,))).text
    (folder / "system.fll").write_text(text, encoding="utf-8")
    return folder


def _seconds(command: list[str]) -> float:
    alone = {**os.environ, "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    done = subprocess.run(command, check=True, capture_output=True, text=True, env=alone)  # noqa: S603
    return float(done.stdout)


def other_python(engine: str, system: FuzzySystem, inputs: Floats) -> Timed:
    """Time simpful or fuzzytool through `benchmarks.other_python`; with Gaussian terms and `and`."""
    python = environment(*OTHERS)
    variables = (*system.inputs, *system.outputs)
    if not all(isinstance(term.membership, Gaussian) for v in variables for term in v.terms):
        raise Missing("terms that are Gaussians")
    notes = {
        "points": system.outputs[0].num_points,
        "variables": [
            {
                "name": v.name,
                "low": v.minimum,
                "high": v.maximum,
                "terms": [(term.name, *astuple(term.membership)) for term in v.terms],
            }
            for v in variables
        ],
        "rules": [
            ([astuple(leaf) for leaf in operands_of(rule.antecedent)], rule.consequents[0].term)
            for rule in system.rules
        ],
    }
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "system.json").write_text(json.dumps(notes), encoding="utf-8")
        np.save(folder / "inputs.npy", inputs)
        files = [str(folder / file) for file in ("system.json", "inputs.npy", "outputs.npy")]
        seconds = _seconds([str(python), str(FOLDER / "other_python.py"), engine, *files])
        return Timed(np.load(folder / "outputs.npy"), seconds / len(inputs))


def environment(*packages: str) -> Path:
    """Return the interpreter of a virtual environment with packages, created on the first call and kept.

    The default package is pyfuzzylite.
    """
    packages = packages or (PYFUZZYLITE,)
    folder = cache_root() / "-".join(packages).replace("==", "-")
    python = folder / "bin" / "python"
    is_there = folder / "complete"
    if not is_there.exists():
        pip = [str(python), "-m", "pip", "install", "--quiet", "--disable-pip-version-check", *packages]
        for words in ([sys.executable, "-m", "venv", "--clear", str(folder)], pip):
            done = subprocess.run(words, check=False, capture_output=True, text=True)  # noqa: S603
            if done.returncode != 0:
                raise Missing(f"python -m pip install {' '.join(packages)} failed: {done.stderr[-200:]}")
        is_there.touch()
    return python
