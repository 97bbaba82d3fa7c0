"""Whether every form of inference says the same: ``python -m benchmarks agree --minutes 30 --seed 1``.

Random systems from the registries, at inputs that look for trouble. The plain definition is compared with
compiled inference, on arrays and one by one, with C, and with a review page's scripts; each bound must hold
what is attained in its box, shares must be those of all coalitions, and what is said to flip an output must.
What differs is shrunk, and kept as a controller with the inputs in its name. The minutes are of processor
time, that of compilers and other programs included, so that a busy machine compares as much.

With ``--programs`` files of random systems are also given to Octave and pyfuzzylite, and to jFuzzyLogic with
``--jfuzzylogic CLASSPATH``; their answers must be those that we read these files to mean.
"""

import argparse
import os
import tempfile
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from benchmarks.rivals import Missing
from benchmarks.rivals.forms import rivals
from fis_tools.array_types import Floats
from fis_tools.formats import serialize
from fis_tools.model import FuzzyController, FuzzySystem
from tests.fis_tools.agreement import drawn
from tests.fis_tools.agreement.claims import CLAIMS
from tests.fis_tools.agreement.compared import DEFINITION, differences
from tests.fis_tools.agreement.forms import FORMS
from tests.fis_tools.agreement.nearness import Difference
from tests.fis_tools.agreement.shrunk import shrunk

#: systems that are compared together unless asked otherwise, and inputs of each
BATCH, NUM_ROWS = 25, 24
#: what is compared with the definition, which itself must give an answer
COMPARED = (DEFINITION, *FORMS, *CLAIMS)
#: files that each other program is given after a batch
FILES = 5


def processor_s() -> float:
    """Return the seconds of this process and of those that it started and that ended."""
    return sum(os.times()[:4])


def cases(seed: int, number: int, count: int) -> list[tuple[FuzzySystem, Floats]]:
    """Return the systems of a batch, and inputs of each."""
    made = []
    for index in range(count):
        generator = np.random.default_rng([seed, number, index])
        system = drawn.system(generator, f"drawn {number} {index}")
        made.append((system, drawn.points(system, generator, NUM_ROWS)))
    return made


def smallest(difference: Difference, folder: Path) -> Difference:
    """Return a difference of the same form at a system that is as small as possible."""

    def left(system: FuzzySystem, row: Floats) -> list[Difference]:
        return differences([(system, row[np.newaxis])], folder, (difference.form,))

    system, row = shrunk(difference.system, difference.row, lambda system, row: bool(left(system, row)))
    return next(iter(left(system, row)), difference)


def keep(difference: Difference, kept: Path) -> Path:
    """Write a difference's system as a controller; its purpose says what differs, an attribute at what."""
    kept.mkdir(parents=True, exist_ok=True)
    controller = FuzzyController(
        difference.form.replace(" ", "-"),
        (difference.system,),
        purpose=str(difference),
        attributes=(("inputs", " ".join(map(repr, difference.row.tolist()))),),
    )
    path = kept / f"{controller.name}-{serialize.fingerprint(controller)[:8]}.yaml"
    path.write_text(serialize.dump_yaml(controller), encoding="utf-8")
    return path


def main(arguments: Sequence[str]) -> int:
    """Compare until the time is up; return 1 if something differs."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks agree", description=__doc__)
    parser.add_argument("--minutes", type=float, default=1.0)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--first", action="store_true", help="end at the first difference, as it is")
    parser.add_argument("--only", choices=COMPARED, action="append", help="a comparison, or several")
    parser.add_argument("--batch", type=int, default=BATCH, help="systems between looks at the clock")
    parser.add_argument("--most", type=int, default=20, help="differences that are shrunk, of each form")
    parser.add_argument("--keep", type=Path, default=Path("build/agree"), help="where what differs goes")
    parser.add_argument("--programs", action="store_true", help="compare with other programs, too")
    parser.add_argument("--jfuzzylogic", metavar="CLASSPATH", default="", help="its classes and jars")
    options = parser.parse_args(arguments)
    known = rivals(options.jfuzzylogic) if options.programs or options.jfuzzylogic else {}
    compared, answered = tuple(options.only or COMPARED), Counter[str]()
    until, number = processor_s() + 60.0 * options.minutes, 0
    counts, num_rows, num_systems = Counter[str](), 0, 0
    with tempfile.TemporaryDirectory(prefix="agree-") as root:
        while processor_s() < until:
            batch = cases(options.seed, number, options.batch)
            number, num_systems = number + 1, num_systems + len(batch)
            num_rows += sum(len(rows) for _, rows in batch)
            if options.first:
                for form in compared:
                    if differing := differences(batch, Path(root), (form,)):
                        print(differing[0])
                        return 1
                continue
            for name, rival in known.items():
                generator = np.random.default_rng([options.seed, number, len(name)])
                for text, system, rows in rival.cases(generator, FILES, NUM_ROWS):
                    try:
                        differing = rival.differences(name, text, system, rows, Path(root))
                    except Missing:
                        continue  # it cannot run what its file says, or is not there
                    answered[name] += 1
                    counts[name] += len(differing)
                    for difference in differing[:1]:
                        print(f"{keep(difference, options.keep)}\n  {difference}", flush=True)
            told_of = set[tuple[str, str]]()
            for difference in differences(batch, Path(root), compared):
                counts[difference.form] += 1
                key = (difference.form, difference.system.name)
                if key in told_of or counts[difference.form] > options.most:
                    continue
                told_of.add(key)
                small = smallest(difference, Path(root))
                print(f"{keep(small, options.keep)}\n  {small}", flush=True)
    print(f"\n{num_systems} systems, {num_rows} inputs, seed {options.seed}\n\n| compared | differences |")
    print("|---|---|")
    for name in compared:
        print(f"| {name} | {counts[name]} |")
    for name in known:
        print(f"| {name}, {answered[name]} of its files | {counts[name]} |")
    return 1 if counts else 0
