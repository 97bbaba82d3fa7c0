"""Import all files of a folder, compare answers with pyfuzzylite: ``python -m benchmarks examples FOLDER``.

The files are supplied by the user: fuzzylite and pyfuzzylite publish theirs under ``examples``.
pyfuzzylite reads only `.fll`; fuzzylite's own program, if installed, converts the other formats to
that. Its misreadings of MATLAB's files are corrected first: zeros that pad parameters (it takes them for
heights), terms with equal names (their rules use numbers), pi, and AggMethod and DefuzzMethod for weighted
outputs. Both sides sample outputs finely, so that their different ways of summing over points agree.
"""

import argparse
import json
import re
import shutil
import subprocess
import tempfile
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from benchmarks import rivals
from benchmarks.rivals import environment
from fis_tools.analysis.arrays import spread_inputs
from fis_tools.engines.compiler import compile
from fis_tools.formats import serialize
from fis_tools.model import FuzzySystem, Sampled, Variable
from fis_tools.model.shapes import words_of

#: Intervals of each output, samples of each system, and tolerated difference as a share of the output's
#: range.
RESOLUTION = 20_000
SAMPLES = 50
TOLERANCE = 1e-4
WORKER = rivals.FOLDER / "answers.py"


@dataclass
class Row:
    """The result for one file: a verdict, and remarks."""

    path: Path
    verdict: str
    words: str = ""
    system: FuzzySystem | None = None


def main(arguments: Sequence[str]) -> int:
    """Print a row for each file, then the numbers of each kind and verdict."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks examples", description=__doc__)
    parser.add_argument("folder", type=Path, help="looked through with all folders below it")
    folder = parser.parse_args(arguments).folder
    files = sorted(p for p in folder.rglob("*") if p.suffix in serialize.ENDINGS)
    rows = [_imported(path) for path in files]
    with tempfile.TemporaryDirectory() as name:
        _compare([row for row in rows if row.system is not None], Path(name))
    for row in rows:
        print(f"{row.verdict:12} {row.path.relative_to(folder)}  {row.words}".rstrip())
    for (suffix, verdict), count in sorted(Counter((row.path.suffix, row.verdict) for row in rows).items()):
        print(f"{suffix} {verdict}: {count}")
    agree = sum(row.verdict == "agrees" for row in rows)
    print(f"{agree} of {len(rows)} files are imported and agree to {TOLERANCE:g} of the range")
    return int(any(row.verdict == "differs" for row in rows))


def _imported(path: Path) -> Row:
    try:
        (system,) = serialize.load(path).systems
    except serialize.ControllerFileError as error:
        return Row(path, "refused", str(error).removeprefix(f"{path}: ").partition("\n")[0])
    outputs = tuple(_fine(output) for output in system.outputs)
    return Row(path, "imported", system=replace(system, outputs=outputs))


def _fine(output: Variable) -> Variable:
    """Sample an output finely; straight lines between the points of its tables are kept."""
    universe = np.linspace(output.minimum, output.maximum, RESOLUTION + 1)
    terms = (
        replace(term, membership=Sampled(tuple(np.interp(universe, output.universe, shape.values).tolist())))
        if isinstance(shape := term.membership, Sampled)
        else term
        for term in output.terms
    )
    return replace(output, terms=tuple(terms), num_points=RESOLUTION + 1, points=None)


def _compare(rows: Sequence[Row], folder: Path) -> None:
    """Set the verdicts of imported rows."""
    jobs = []
    for number, row in enumerate(rows):
        engine = _engine(row.path, folder / f"{number}.fll")
        if engine is None or row.system is None:
            row.words = "not compared: fuzzylite's program is missing, or does not read it"
            continue
        np.save(folder / f"{number}.npy", spread_inputs(row.system, SAMPLES))
        files = {"engine": str(engine), "inputs": str(folder / f"{number}.npy")}
        jobs.append({**files, "outputs": str(folder / f"{number}-out.npy"), "resolution": RESOLUTION})
    (folder / "jobs.json").write_text(json.dumps(jobs), encoding="utf-8")
    command = [str(environment()), str(WORKER), str(folder / "jobs.json")]
    output = subprocess.run(command, check=True, capture_output=True, text=True).stdout  # noqa: S603
    reasons = dict(line.split(": ", 1) for line in output.splitlines())
    for number, row in enumerate(rows):
        answers = folder / f"{number}-out.npy"
        if answers.exists():
            _judge(row, np.load(folder / f"{number}.npy"), np.load(answers))
        elif not row.words:
            row.words = (
                f"not compared: {reasons.get(str(folder / f'{number}.fll'), reasons.get(str(row.path)))}"
            )


def _engine(path: Path, target: Path) -> Path | None:
    """Return a file that pyfuzzylite reads; None if there is none."""
    if path.suffix == ".fll":
        return path
    program = shutil.which("fuzzylite")
    if program is None:
        return None
    source = target.with_suffix(path.suffix)
    text = path.read_text(encoding="latin-1")
    source.write_text(_as_matlab_means(text) if path.suffix == ".fis" else text, encoding="latin-1")
    words = [program, "-i", str(source), "-o", str(target), "-decimals", "15"]
    subprocess.run(words, check=False, capture_output=True)  # noqa: S603
    if target.exists() and path.suffix == ".fis":
        target.write_text(_weighed(target.read_text(encoding="utf-8")), encoding="utf-8")
    return target if target.exists() else None


_TERM = re.compile(r"^(\s*MF)\d+(\s*=\s*)'([^']*)'(\s*:\s*'(\w+)'\s*,\s*)\[([^\]]*)\]", re.MULTILINE)
_PI = re.compile(r"([-+]?)pi/(\d+)")


def _as_matlab_means(text: str) -> str:
    """Return a `.fis` file without what fuzzylite's program misreads."""
    counted = re.search(r"NumInputs\s*=\s*(\d+)", text)
    lengths = {word: len(order or kind.entry.kinds) for word, (kind, order) in words_of("fis").items()}
    lengths["linear"] = int(counted[1]) + 1 if counted else 0
    sections = []
    for section in re.split(r"(?=^\[)", text, flags=re.MULTILINE):
        names: Counter[str] = Counter()

        def term(match: re.Match[str], names: Counter[str] = names) -> str:
            names[match[3]] += 1
            name = match[3] + (f"_{names[match[3]]}" if names[match[3]] > 1 else "")
            numbers = match[6].split()
            length = lengths.get(match[5], len(numbers))
            if not any(float(number) for number in numbers[length:]):
                numbers = numbers[:length]
            return f"{match[1]}{names.total()}{match[2]}'{name}'{match[4]}[{' '.join(numbers)}]"

        sections.append(_TERM.sub(term, section))
    return _PI.sub(lambda match: f"{match[1]}{np.pi / int(match[2])!r}", "".join(sections))


def _weighed(engine: str) -> str:
    """Weight outputs whose terms are numbers, each rule separately, whatever else a MATLAB file says."""
    blocks = re.split(r"(?=^OutputVariable|^RuleBlock)", engine, flags=re.MULTILINE)
    for index, block in enumerate(blocks):
        if block.startswith("OutputVariable") and not re.search(r"term: \S+ (?!Constant|Linear)", block):
            alone = re.sub(r"aggregation: \w+", "aggregation: none", block)
            blocks[index] = re.sub(r"defuzzifier: (?!Weighted).*", "defuzzifier: WeightedAverage", alone)
    return "".join(blocks)


def _judge(row: Row, inputs: np.ndarray, theirs: np.ndarray) -> None:
    """Compare answers; if fuzzylite has none, no rule may fire here either."""
    assert row.system is not None
    answers = compile(row.system).infer(inputs)
    widths = np.array([output.maximum - output.minimum for output in row.system.outputs])
    difference = np.where(answers.no_rule_fired, 0.0, np.abs(answers.outputs - theirs) / widths)
    endless = np.isinf(theirs)  # a Tsukamoto sigmoid at full strength; here it ends with the range
    difference = np.where(endless, 0.0, np.where(np.isnan(difference), np.inf, difference))
    worst = float(difference.max())
    row.verdict = "agrees" if worst <= TOLERANCE else "differs"
    silent = int(answers.no_rule_fired.sum())
    row.words = f"{worst:.1e}"
    row.words += f", no rule fires at {silent} of {answers.no_rule_fired.size}" if silent else ""
    row.words += f", theirs is infinite at {endless.sum()} of {endless.size}" if endless.any() else ""
