"""Change the formulas that fly, one at a time: the C that is translated from them must change alike.

``NUMBA_DISABLE_JIT=1 python -m benchmarks.formulas --mutants 50`` changes an operator or number of a line
that the C of a controller comes from, or drops a branch, until that many changes showed in a flight. For
each, the changed Python flies, and the C that is translated from it must command the same, bit for bit.
"""

import argparse
import ast
import contextlib
import importlib
import os
import random
import resource
import shutil
import sys
import tempfile
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from importlib.util import cache_from_source
from pathlib import Path
from typing import Any

from benchmarks.mutants import FORK, mutants_of

#: imported once, before the process divides for each mutant
LIBRARIES = ("numpy", "scipy.integrate", "numba", "pyarrow", "pydantic", "hydra", "jinja2")
#: processor seconds for a mutant
LIMIT_S = 60
SHOWN, SILENT, REFUSED, ENDED, NOT_FINITE, DIFFERENT = (
    *("changed alike", "no change in this flight", "refused by the translator", "ended before"),
    *("inference gives NaN, for which plain Python has no one answer", "C and flight DIFFER"),
)


@dataclass(frozen=True)
class Flown:
    """A flight, the C's answers to it, and the lines of Python that the C comes from."""

    forces: bytes = b""
    num_different: int = 0
    lines: frozenset[tuple[str, int]] = frozenset()
    ended: str = ""


def fly(top: Path, words: Sequence[str], queue: Any) -> None:
    """Fly the code of a folder, and tell what its C commands."""
    resource.setrlimit(resource.RLIMIT_CPU, (LIMIT_S, LIMIT_S))
    os.chdir(top)
    sys.path.insert(0, str(top))
    with open(os.devnull, "w") as out, contextlib.redirect_stderr(out):
        queue.put(flown(words))


def flown(words: Sequence[str]) -> Flown:
    """Return what a flight and its C command, by the code that is first on the path."""
    import numpy as np  # noqa: PLC0415 - imported before, and of the changed code:

    from pipeline.command_line.config import compose_experiment  # noqa: PLC0415
    from pipeline.controllers.source import load  # noqa: PLC0415
    from pipeline.flight.fly.simulation import fly_logged  # noqa: PLC0415
    from pipeline.onboard.program import translate  # noqa: PLC0415
    from pipeline.onboard.recorded import Library, differing, recorded  # noqa: PLC0415
    from pipeline.onboard.source import sources  # noqa: PLC0415
    from pipeline.onboard.values import TranslationError  # noqa: PLC0415
    from pipeline.scenarios import evaluation_scenarios  # noqa: PLC0415

    try:
        job = compose_experiment(["+experiment=evaluate", *words])
        mission = job.experiment.mission
        controller = load(job.config["controller"], mission)
        start = evaluation_scenarios(job.experiment, slice(1))[0]
        log = fly_logged(mission, controller, start, is_one_of_many=True)
        program = translate(mission, controller)
    except TranslationError:
        return Flown(ended=REFUSED)
    except Exception as error:  # noqa: BLE001 - whatever a changed formula brings about
        return Flown(ended=f"{ENDED}: {type(error).__name__}")
    source = sources(program)
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        (folder / "controller.h").write_text(source.header, encoding="utf-8")
        (folder / "controller.c").write_text(source.code, encoding="utf-8")
        library = Library(folder, flags=("-std=c99", "-O0", "-ffp-contract=off"))
        answers = library.answers(recorded(program, start, log))
    lines = frozenset((file, line) for _, file, line in source.origins)
    if not (np.isfinite(log.fis_output_n[log.is_decided]).all() and np.isfinite(log.force_commanded_n).all()):
        return Flown(ended=NOT_FINITE)
    return Flown(log.force_commanded_n.tobytes(), len(differing(answers, log)), lines)


def in_a_child(top: Path, words: Sequence[str]) -> Flown:
    """Return what is flown in a process of its own."""
    queue = FORK.SimpleQueue()
    child = FORK.Process(target=fly, args=(top, words, queue))
    child.start()
    child.join()
    return Flown(ended=f"{ENDED}: time or memory") if queue.empty() else queue.get()  # type: ignore[no-any-return]


def dropped_branches(top: Path, path: Path) -> list[dict[str, Any]]:
    """Return changes that never take a branch."""
    text = path.read_text(encoding="utf-8")
    lines, mutants = text.split("\n"), []
    for node in ast.walk(ast.parse(text)):
        test = node.test if isinstance(node, ast.If) else None
        if test is None or test.lineno != test.end_lineno or not lines[test.lineno - 1].isascii():
            continue
        line = lines[test.lineno - 1]
        location = {"path": str(path.relative_to(top)), "line": line}
        ends = {"nth": lines[: test.lineno - 1].count(line), "start": test.col_offset}
        mutants.append(location | ends | {"end": test.end_col_offset, "new": "False"})
    return mutants


def candidates(top: Path, lines: frozenset[tuple[str, int]], draw: random.Random) -> list[dict[str, Any]]:
    """Return the changes of lines that the C comes from, in an order that is drawn."""
    mutants = []
    for name in sorted({file for file, _ in lines}):
        path = top / name
        texts = path.read_text(encoding="utf-8").split("\n")
        for mutant in [*mutants_of(top, path, draw), *dropped_branches(top, path)]:
            number = [k for k, line in enumerate(texts, start=1) if line == mutant["line"]][mutant["nth"]]
            if (name, number) in lines:
                mutants.append(mutant | {"number": number})
    draw.shuffle(mutants)
    return mutants


def verdict(top: Path, mutant: dict[str, Any], words: Sequence[str], intact: Flown) -> str:
    """Return what becomes of a change."""
    path = top / mutant["path"]
    text = path.read_text(encoding="utf-8")
    lines = text.split("\n")
    line = mutant["line"]
    lines[mutant["number"] - 1] = line[: mutant["start"]] + mutant["new"] + line[mutant["end"] :]
    try:
        path.write_text("\n".join(lines), encoding="utf-8")
        Path(cache_from_source(str(path))).unlink(missing_ok=True)
        result = in_a_child(top, words)
    finally:
        path.write_text(text, encoding="utf-8")
        Path(cache_from_source(str(path))).unlink(missing_ok=True)
    if result.ended:
        return result.ended
    if result.num_different:
        return DIFFERENT
    return SILENT if result.forces == intact.forces else SHOWN


def main() -> int:
    """Print a line for each change, and how many showed in flight and C alike."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.formulas", description=__doc__)
    parser.add_argument("--mutants", type=int, default=50)
    parser.add_argument("words", nargs="*", default=["controller=champion_27", "duration_s=1200"])
    options = parser.parse_args()
    for library in LIBRARIES:
        importlib.import_module(library)
    counts: Counter[str] = Counter()
    with tempfile.TemporaryDirectory(prefix="formulas-") as scratch:
        top = Path(scratch) / "copy"
        shutil.copytree(
            Path.cwd(), top, ignore=shutil.ignore_patterns(".git", "build", "__pycache__", "tests")
        )
        intact = in_a_child(top, options.words)
        if intact.ended or intact.num_different:
            raise RuntimeError(f"without a change: {intact.ended or DIFFERENT}")
        draw = random.Random(1)  # noqa: S311 - the same each time
        for mutant in candidates(top, intact.lines, draw):
            result = verdict(top, mutant, options.words, intact)
            counts[result] += 1
            where = f"{mutant['path']}:{mutant['number']}"
            sys.stdout.write(f"{where}: {mutant['line'].strip()} -> {mutant['new']}: {result}\n")
            sys.stdout.flush()
            if counts[SHOWN] == options.mutants:
                break
    sys.stdout.write("".join(f"{count} {result}\n" for result, count in counts.most_common()))
    return 0 if counts[DIFFERENT] == 0 else 1


if __name__ == "__main__":
    sys.exit(main())
