"""What other programs answer to files of their own, and what we answer where these weigh or round otherwise.

Octave takes `.fis`, fuzzylite and pyfuzzylite `.fll`, jFuzzyLogic `.fcl`. Octave halves the weight of an
output's ends, MATLAB does not; fuzzylite 6 takes what is less than 1e-6 as nothing, later versions do not.
"""

import json
import shutil
import subprocess
import tempfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from benchmarks.rivals import FOLDER, Missing, environment
from fis_tools.array_types import Floats
from fis_tools.engines.compiler import compile
from fis_tools.engines.inference import infer
from fis_tools.model import And, FuzzySystem, Hedged, Or, Rule

#: Up to which numbers are equal to fuzzylite 6.
ROUNDED = 1e-6

#: From a file, its system and samples to outputs, (n, num_outputs).
Program = Callable[[Path, FuzzySystem, Floats], Floats]
#: Our answers, from a system and samples.
Answers = Callable[[FuzzySystem, Floats], Floats]


def octave(path: Path, system: FuzzySystem, inputs: Floats) -> Floats:
    """Evaluate a `.fis` file with Octave's toolkit."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        np.savetxt(folder / "inputs", inputs, fmt="%.17g")
        script = (
            "pkg load fuzzy-logic-toolkit\n"
            "function y = probor (x)\n  y = algebraic_sum (x);\nendfunction\n"
            f"y = evalfis (load ('{folder}/inputs'), readfis ('{path}'), 101);\n"
            f"dlmwrite ('{folder}/outputs', y, 'delimiter', ' ', 'precision', '%.17g');\n"
        )
        (folder / "run.m").write_text(script, encoding="utf-8")
        _run("octave", "--no-gui", "--quiet", "--no-init-file", folder / "run.m")
        return np.loadtxt(folder / "outputs", ndmin=2)


def fuzzylite(path: Path, system: FuzzySystem, inputs: Floats) -> Floats:
    """Evaluate a file with fuzzylite's own program."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        np.savetxt(folder / "inputs.fld", inputs, fmt="%.17g")
        files = ["-i", path, "-o", folder / "outputs.fld", "-d", folder / "inputs.fld"]
        _run("fuzzylite", *files, *["-dinputs", "false", "-dheader", "false", "-decimals", "17"])
        return np.loadtxt(folder / "outputs.fld", ndmin=2)


def pyfuzzylite(path: Path, system: FuzzySystem, inputs: Floats) -> Floats:
    """Evaluate an `.fll` file with pyfuzzylite."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        np.save(folder / "inputs.npy", inputs)
        job = {"engine": str(path), "inputs": f"{folder}/inputs.npy", "outputs": f"{folder}/outputs.npy"}
        (folder / "jobs").write_text(json.dumps([job]), encoding="utf-8")
        said = _run(str(environment()), FOLDER / "answers.py", folder / "jobs")
        if not Path(job["outputs"]).exists():
            raise Missing(said.strip()[-100:])
        answers: Floats = np.load(job["outputs"])
        return answers


def jfuzzylogic(classpath: str) -> Program:
    """Return what evaluates an `.fcl` file with jFuzzyLogic, given its classes and jars."""
    classes = tempfile.TemporaryDirectory()
    _run("javac", "-cp", classpath, "-d", classes.name, FOLDER / "jfuzzylogic.java")

    def evaluate(path: Path, system: FuzzySystem, inputs: Floats) -> Floats:
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name)
            head = "\n".join(" ".join(v.name for v in side) for side in (system.inputs, system.outputs))
            np.savetxt(folder / "inputs", inputs, fmt="%.17g", header=head, comments="")
            words = ["-Djava.awt.headless=true", "-cp", f"{classes.name}:{classpath}", "Answers"]
            _run("java", *words, path, system.name, folder / "inputs", folder / "outputs")
            return np.loadtxt(folder / "outputs", ndmin=2)

    return evaluate


def _run(*words: object) -> str:
    program = shutil.which(str(words[0]))
    if program is None:
        raise Missing(f"{words[0]} is not installed")
    done = subprocess.run([program, *map(str, words[1:])], check=False, capture_output=True, text=True)  # noqa: S603
    if done.returncode:
        lines = [line for line in (done.stderr or done.stdout).split("\n") if line.strip()]
        raise Missing(next((line for line in lines if "error" in line), "it fails")[-120:])
    return done.stdout


def ours(system: FuzzySystem, inputs: Floats) -> Floats:
    """Return our answers, (n, num_outputs)."""
    return compile(system)(inputs)


def as_octave(system: FuzzySystem, inputs: Floats) -> Floats:
    """Return our answers with half the weight for both ends of an output, and NaN where no rule fires."""
    rows = []
    for row in inputs:
        answers = []
        for output in infer(system, row).outputs:
            value, heights, x = output.value, output.aggregated, output.universe
            if len(x) and system.defuzzifier_of(output.variable) == "centroid" and heights.any():
                area, moment = np.trapezoid(heights, x), np.trapezoid(x * heights, x)
                value = float(moment / area) if area > 0.0 else np.nan
            answers.append(np.nan if output.is_default else value)
        rows.append(answers)
    return np.array(rows)


def as_fuzzylite(system: FuzzySystem, inputs: Floats, *, is_hedged: bool = False) -> Floats:
    """Return our answers as fuzzylite 6 rounds: to 1e-6 where it compares strengths and heights.

    Rules of strengths up to 1e-6 do not fire, before hedges of their conclusions (`is_hedged`); a mean of
    maximum is that of the first plateau, up to 1e-6 below the highest.
    """
    compiled = compile(system)
    firing = compiled.firing_strengths(inputs)
    weights = np.array([max(c.weight for c in rule.consequents) for rule in system.rules])
    bare = tuple(_without_hedge(rule) for rule in system.rules) if is_hedged else system.rules
    strengths = compile(replace(system, rules=bare)).firing_strengths(inputs) if is_hedged else firing
    firing[strengths * weights <= ROUNDED] = 0.0
    answers = compiled.conclude(firing, inputs)
    for column, output in enumerate(system.outputs):
        if system.defuzzifier_of(output) == "mom":
            for row, values in enumerate(inputs):
                step = infer(system, values).outputs[column]
                if not step.is_default:
                    answers[row, column] = _first_plateau(step.universe, step.aggregated)
    return answers


def _without_hedge(rule: Rule) -> Rule:
    """Return a rule without the hedges around its whole condition, by which we say those of a conclusion."""
    inside = rule.antecedent
    while isinstance(inside, Hedged):
        inside = inside.operand
    return replace(rule, antecedent=inside) if isinstance(inside, And | Or) else rule


def _first_plateau(x: Floats, y: Floats) -> float:
    highest, ends, is_flat = -1.0, (x[0], x[-1]), False
    for point, height in zip(x, y, strict=True):
        if height > highest + ROUNDED:
            highest, ends, is_flat = height, (point, point), True
        elif is_flat and abs(height - highest) < ROUNDED:
            ends = ends[0], point
        elif height < highest:
            is_flat = False
    return float(0.5 * (ends[0] + ends[1]))
