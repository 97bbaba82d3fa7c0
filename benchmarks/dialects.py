"""Compare the answers of files with those of their own programs: ``python -m benchmarks dialects FOLDER``.

Octave evaluates `.fis`, fuzzylite and pyfuzzylite `.fll`, jFuzzyLogic `.fcl`, as each samples by itself, a
third of the samples outside of the inputs' ranges (Octave takes none). Octave halves the weight of an
output's ends, MATLAB does not; fuzzylite 6 takes what is less than 1e-6 as nothing, later versions do not:
they are compared with our heights weighed so, and with what is less left out. ``--attack N`` draws N inputs
in boxes of random systems that are sampled, alone and wired, and compares them with their bounds.

Programs are left out where they are missing; jFuzzyLogic is compiled Java, ``--jfuzzylogic CLASSPATH``. Its
answers to public files are stored by their SHA-256 (``--store``), and compared without it (``--stored``).
"""

import argparse
import hashlib
import json
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import chain
from pathlib import Path

import numpy as np

from benchmarks.rivals import Missing
from benchmarks.rivals.programs import (
    Program,
    as_fuzzylite,
    as_octave,
    fuzzylite,
    jfuzzylogic,
    octave,
    ours,
    pyfuzzylite,
)
from fis_tools.analysis.bounds import output_ranges
from fis_tools.array_types import Floats
from fis_tools.engines import bounded_trees, interval
from fis_tools.engines.compiler import compile
from fis_tools.formats import serialize
from fis_tools.model import FuzzyController, FuzzySystem, Wire, tree
from fis_tools.model.validate import controller_problems
from tests.fis_tools.engines.random_systems import inputs_beyond, sampled_systems, uncertain

#: Samples of each file.
SAMPLES = 40
#: Attacks in a box.
ROWS = 1000
#: Boxes that prove a bound; with few of them it is looser, and as true.
BOXES = 200
#: What jFuzzyLogic answered.
STORED = Path(__file__).with_name("jfuzzylogic.json")
#: What counts as equal, and as near, of an output's range.
EQUAL, NEAR = 1e-12, 1e-9
#: What fuzzylite writes into its files, whose hedges then mean what it does.
SIGNED = "generated with fuzzylite"


def _as_octave_reads(path: Path) -> FuzzySystem:
    """Return the system of a file whose hedges are Octave's, though fuzzylite may have written it."""
    lines = path.read_text(encoding="utf-8").splitlines()
    text = "\n".join(line for line in lines if SIGNED not in line)
    return serialize.loads(text, path.suffix[1:]).systems[0]


def difference(system: FuzzySystem, answers: Floats, others: Floats) -> float:
    """Return the largest difference, of the outputs' ranges; where another has no number we fire no rule."""
    spans = np.array([output.maximum - output.minimum for output in system.outputs])
    known = np.isfinite(others) & np.isfinite(answers)
    return float(np.max(np.abs(answers - others) / spans, initial=0.0, where=known))


def samples(system: FuzzySystem, count: int, *, is_inside: bool) -> Floats:
    """Return inputs, (n, num_inputs), a third outside of the ranges unless they must be inside."""
    rows = inputs_beyond(system, np.random.default_rng(7), count)
    low, high = ([getattr(v, end) for v in system.inputs] for end in ("minimum", "maximum"))
    return np.clip(rows, low, high) if is_inside else rows


def _imported(folder: Path) -> Iterator[tuple[Path, tuple[FuzzySystem, ...]]]:
    """Yield the files of a folder that are read, and their systems; print why others are not, and counts."""
    refused = imported = 0
    for path in sorted(path for path in folder.rglob("*") if path.suffix in serialize.ENDINGS):
        try:
            systems = serialize.load(path).systems
        except serialize.ControllerFileError as error:
            refused += 1
            print(f"refused {path.relative_to(folder)}: {str(error).removeprefix(f'{path}: ')}")
            continue
        imported += 1
        yield path, systems
    print(f"{imported} of {imported + refused} files are imported")


def compare(folder: Path, programs: Mapping[str, tuple[str, Program]], count: int) -> int:
    """Print a row for each file and program, then how many are equal; return how many differ."""
    tally: dict[str, list[float]] = {name: [] for name in programs}
    for path, (system, *_) in _imported(folder):
        for name, (suffix, program) in programs.items():
            if suffix != path.suffix or (suffix == ".fcl") != (system.semantics == "fcl"):
                continue
            is_octave = program is octave
            answers_as = {octave: as_octave, fuzzylite: as_fuzzylite}.get(program, ours)
            rows = samples(system, 3 if is_octave else count, is_inside=is_octave)
            try:
                others = program(path, system, rows)
                answers = answers_as(_as_octave_reads(path) if is_octave else system, rows)
                worst = difference(system, answers, others)
                if program is fuzzylite:  # a hedge around a condition may have stood there
                    answers = as_fuzzylite(system, rows, is_hedged=True)
                    worst = min(worst, difference(system, answers, others))
            except (Missing, serialize.ControllerFileError, ValueError) as error:
                print(f"{name} {path.relative_to(folder)}: not compared, {error}")
                continue
            tally[name].append(worst)
            print(f"{name} {path.relative_to(folder)}: {worst:.1e}", flush=True)
    for name, worst_of in tally.items():
        counts = [sum(w <= share for w in worst_of) for share in (EQUAL, NEAR)]
        print(f"{name}: of {len(worst_of)} files {counts[0]} to {EQUAL:g}, {counts[1]} to {NEAR:g}")
    return sum(w > NEAR for worst_of in tally.values() for w in worst_of)


def _sha256(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


def store(folder: Path, program: Program, count: int) -> None:
    """Ask jFuzzyLogic about all function blocks of a folder's files, and store its values."""
    files = {}
    for path, systems in _imported(folder):
        blocks = {}
        for system in systems if systems[0].semantics == "fcl" else ():
            rows = samples(system, count, is_inside=False).round(3)
            try:
                blocks[system.name] = {
                    "inputs": rows.tolist(),
                    "outputs": program(path, system, rows).tolist(),
                }
            except (Missing, ValueError) as error:
                print(f"{path.relative_to(folder)}, {system.name}: no values, {error}", flush=True)
        if blocks:
            files[_sha256(path)] = {"file": path.relative_to(folder).as_posix(), "blocks": blocks}
    STORED.write_text(json.dumps(files, allow_nan=True).replace("}, ", "},\n") + "\n", encoding="utf-8")


def compare_stored(folder: Path) -> int:
    """Compare files with the values that jFuzzyLogic gave for them; return how many differ."""
    stored = json.loads(STORED.read_text(encoding="utf-8"))
    worst_of: list[float] = []
    for path, systems in _imported(folder):
        blocks = stored.get(_sha256(path), {"blocks": {}})["blocks"]
        worst = [
            difference(
                system,
                ours(system, np.array(blocks[system.name]["inputs"])),
                np.array(blocks[system.name]["outputs"], dtype=np.float64),
            )
            for system in systems
            if system.name in blocks
        ]
        worst_of += [max(worst)] if worst else []
        if worst and worst_of[-1] > EQUAL:
            print(f"{path.relative_to(folder)}: {worst_of[-1]:.1e}")
    differ = sum(worst > EQUAL for worst in worst_of)
    print(f"{len(worst_of) - differ} of {len(worst_of)} files have jFuzzyLogic's values to {EQUAL:g}")
    return differ


def attack(count: int, seed: int) -> int:
    """Compare inputs with the bounds of boxes that they lie in; return how many are outside."""
    broken = tried = boxes = 0
    started = time.monotonic()
    drawn = chain.from_iterable(sampled_systems(seed + batch, 12) for batch in range(count))
    for number, system in enumerate(drawn):
        if tried >= count:
            break
        generator = np.random.default_rng([seed, number])
        if system.semantics == "matlab" and number % 2 and not system.weighed:
            system = uncertain(system)  # noqa: PLW2901 - as interval type-2
        if any(output.minimum == output.maximum for output in system.outputs):
            continue
        ends = np.sort(inputs_beyond(system, generator, 2), axis=0)
        region = " and ".join(
            f"{v.name} in [{low!r}, {high!r}]"
            for v, low, high in zip(system.inputs, *ends.tolist(), strict=True)
        )
        bounded = output_ranges(system, region, max_boxes=BOXES)
        rows = generator.uniform(*ends, (ROWS, len(system.inputs)))
        rows[::3] = np.where(generator.random(rows[::3].shape) < 0.5, ends[0], ends[1])
        answers = compile(system)(rows)
        for column, bound in zip(answers.T, bounded, strict=True):
            inside = (column >= bound.outer.low) & (column <= bound.outer.high)
            broken += int((~inside & np.isfinite(column)).sum())
        tried, boxes = tried + answers.size, boxes + 1
    seconds = time.monotonic() - started
    print(f"{tried} attacks on bounds of {boxes} boxes of random systems: {broken} broken ({seconds:.0f} s)")
    return broken


def attack_trees(count: int, seed: int) -> int:
    """Compare inputs with the bounds of boxes of pairs of wired systems; return how many are outside."""
    generator, broken, tried, boxes = np.random.default_rng(seed), 0, 0, 0
    drawn = chain.from_iterable(sampled_systems(seed + batch, 12) for batch in range(count))
    last: dict[str, FuzzySystem] = {}
    for system in drawn:
        if tried >= count:
            break
        before, last[system.semantics] = last.get(system.semantics), replace(system, name="second")
        if before is None:
            continue
        first = replace(before, name="first")
        wire = Wire(f"first/{first.outputs[0].name}", f"second/{system.inputs[0].name}")
        pair = FuzzyController("pair", (last[system.semantics], first), wires=(wire,))
        if controller_problems(pair):  # of two units
            continue
        wired = tree(pair)
        try:
            program = bounded_trees.pack(wired)
        except interval.NotBounded:
            continue
        low, span = np.array([(v.minimum, v.span) for v in wired.inputs]).T
        corners = low + span * generator.uniform(-0.2, 1.0, (12, len(span)))
        sizes = (
            span * generator.uniform(0.0, 0.5, corners.shape) * generator.choice([1.0, 1e-2, 1e-6], (12, 1))
        )
        least, greatest, _ = bounded_trees.bound(program, corners, corners + sizes)
        for corner, size, below, above in zip(corners, sizes, least, greatest, strict=True):
            answers = compile(wired)(corner + size * generator.uniform(0.0, 1.0, (ROWS, len(span))))
            is_outside = (answers < below) | (answers > above)
            broken += int((is_outside & np.isfinite(answers)).sum())
            tried, boxes = tried + answers.size, boxes + 1
    print(f"{tried} attacks on bounds of {boxes} boxes of random wired systems: {broken} broken")
    return broken


def main(arguments: Sequence[str]) -> int:
    """Compare the files of a folder, or attack bounds."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks dialects", description=__doc__)
    parser.add_argument("folder", type=Path, nargs="?", help="looked through with all folders below it")
    parser.add_argument("--jfuzzylogic", metavar="CLASSPATH", help="its classes and jars")
    parser.add_argument("--samples", type=int, default=SAMPLES, help="of each file")
    parser.add_argument("--attack", type=int, default=0, metavar="N", help="inputs in boxes with bounds")
    parser.add_argument("--seed", type=int, default=0, help="of the attacks")
    parser.add_argument("--store", action="store_true", help="store what jFuzzyLogic answers")
    parser.add_argument("--stored", action="store_true", help="compare with what it answered")
    options = parser.parse_args(arguments)
    broken = 0
    if options.attack:
        broken = attack(options.attack, options.seed) + attack_trees(options.attack, options.seed)
    if options.folder is None:
        return int(broken > 0)
    if options.stored:
        return int(broken + compare_stored(options.folder) > 0)
    if options.store:
        store(options.folder, jfuzzylogic(options.jfuzzylogic), options.samples)
        return int(broken > 0)
    programs: dict[str, tuple[str, Program]] = {
        "octave": (".fis", octave),
        "fuzzylite": (".fll", fuzzylite),
        "pyfuzzylite": (".fll", pyfuzzylite),
    }
    if options.jfuzzylogic:
        programs["jfuzzylogic"] = ".fcl", jfuzzylogic(options.jfuzzylogic)
    return int(broken + compare(options.folder, programs, options.samples) > 0)
