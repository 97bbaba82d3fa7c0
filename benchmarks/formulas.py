"""Change the formulas that fly, one at a time: the C that is translated from them must change alike.

``NUMBA_DISABLE_JIT=1 python -m benchmarks formulas --mutants 50`` changes an operator or number of a line
that the C of a controller comes from, or drops a branch, until that many changes showed in a flight. For
each, the changed Python flies, and the C that is translated from it must command the same, bit for bit.

Some changes have no flight to compare with, and are counted apart. A formula that leaves its table
reads what stands beside it, in compiled flights too; in the C tables stand in another order, and here it
traps. Where a signal or an output is NaN, the C takes zero, and from where the state leaves the range of its
inputs on, it fires nothing, by design. And a change may undo that a point's numbers do not depend on the
points beside it in a vector, which the C works on one by one. It is told by flying it without skipping any
vector of points, in Python and in C: then both command the same, but something else than before.

``--without-a-branch`` leaves a branch out of the C instead, one at a time: the comparison must see each, in
flights from some starts or by inputs drawn at random, but for exits from loops that only save time. What is
left out without any effect is listed, and ends in an exit status of 1, as does a difference.
"""

import argparse
import ast
import contextlib
import importlib
import os
import random
import re
import resource
import shutil
import signal
import sys
import tempfile
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from importlib.util import cache_from_source
from pathlib import Path
from typing import Any

from benchmarks.mutants import FORK, mutants_of

#: imported once, before the process divides for each mutant
LIBRARIES = ("numpy", "scipy.integrate", "numba", "pyarrow", "pydantic", "hydra", "jinja2")
#: processor seconds for a mutant, and for each start from which branches are left out
LIMIT_S = 60
SHOWN, SILENT, REFUSED, ENDED, NOT_A_NUMBER, OUTSIDE, GUARDED, BESIDE, DIFFERENT = (
    *("changed alike", "no change in this flight", "refused by the translator", "ended before"),
    *("a signal or an output is NaN", "reads beyond its table", "alike until an input is out of range"),
    *("depends on the points beside it in a vector", "C and flight DIFFER"),
)


#: what ends the C where an index leaves its table
TRAP = ("-fsanitize=bounds", "-fsanitize-undefined-trap-on-error")
INSIDE = """
static int checked_index(int index, int first, int end)
{
    if ((index < first) || (index >= end)) {
        __builtin_trap();
    }
    return index;
}
"""


SEEN, DRAWN, NOT_TAKEN, EARLY, UNSEEN = (
    *("left out, C and flight differ", "left out, answers to inputs drawn at random differ"),
    *("never taken", "an early exit left out, without effect", "left out without effect"),
)
#: starts from which a branch that is left out is flown, and inputs that are drawn
NUM_STARTS, NUM_DRAWN = 10, 10_000


@dataclass(frozen=True)
class Flown:
    """A flight, the C's answers to it, and the lines of Python that the C comes from.

    `is_guarded` where the C refused an input: what comes then is not compared. `branches` are lines of the C
    at which one is taken, and what follows it without that.
    """

    forces: bytes = b""
    num_different: int = 0
    lines: frozenset[tuple[str, int]] = frozenset()
    ended: str = ""
    is_guarded: bool = False
    branches: Sequence[tuple[str, str]] = ()


def fly(top: Path, words: Sequence[str], num_left_out: int, is_each: bool, queue: Any) -> None:
    """Fly the code of a folder, and tell what its C commands."""
    limit_s = LIMIT_S * (NUM_STARTS if num_left_out else 1)
    resource.setrlimit(resource.RLIMIT_CPU, (limit_s, limit_s))
    os.chdir(top)
    sys.path.insert(0, str(top))
    with open(os.devnull, "w") as out, contextlib.redirect_stderr(out):
        queue.put(flown(words, num_left_out, is_each))


def flown(words: Sequence[str], num_left_out: int, is_each: bool) -> Flown:
    """Return what a flight and its C command, by the code that is first on the path.

    With `is_each`, no vector of points is skipped.
    """
    import numpy as np  # noqa: PLC0415 - imported before, and of the changed code:

    from fis_tools.compiled.vectors import ROW  # noqa: PLC0415
    from pipeline.command_line.config import compose_experiment  # noqa: PLC0415
    from pipeline.controllers.source import load  # noqa: PLC0415
    from pipeline.flight.fly import simulation  # noqa: PLC0415
    from pipeline.onboard import program as programs  # noqa: PLC0415
    from pipeline.onboard.recorded import Library, differing, recorded  # noqa: PLC0415
    from pipeline.onboard.source import sources  # noqa: PLC0415
    from pipeline.onboard.values import Expression, TranslationError  # noqa: PLC0415
    from pipeline.scenarios import evaluation_scenarios  # noqa: PLC0415

    class CheckedValues(programs.Values):
        """A controller's values, of which the C reads none beyond the table that it reads from."""

        def at(self, translator: Any, index: Any) -> Any:
            for row in self._rows if isinstance(index, Expression) else ():
                if row.first <= index.offset < row.end:
                    # of a term, a whole row of points is read, and those beyond its peak are not used
                    more = ROW if row.step > 1 else 0
                    text = f"checked_index({index.text}, {row.first - more}, {row.end + more})"
                    return super().at(translator, Expression(text, "int", offset=index.offset))
            return super().at(translator, index)

    programs.Values = CheckedValues  # type: ignore[misc]
    if is_each:
        skip_none()
    # as on board; beside a flight, a changed formula would see lanes that are empty
    for name in ("make_state", "make_workspace"):
        setattr(simulation, name, partial(getattr(simulation, name), lanes=1))
    try:
        job = compose_experiment(["+experiment=evaluate", *words])
        mission = job.experiment.mission
        controller = load(job.config["controller"], mission)
        starts = evaluation_scenarios(job.experiment, slice(NUM_STARTS if num_left_out else 1))
        logs = [simulation.fly_logged(mission, controller, start) for start in starts]
        program = programs.translate(mission, controller)
    except TranslationError:
        return Flown(ended=REFUSED)
    except Exception as error:  # noqa: BLE001 - whatever a changed formula brings about
        return Flown(ended=f"{ENDED}: {type(error).__name__}")
    log = logs[0]
    for numbers in (log.fis_input, log.fis_output_n, log.force_commanded_n):
        if np.isnan(numbers).any():
            return Flown(ended=NOT_A_NUMBER)
    source = sources(program)
    flights = [recorded(program, *pair) for pair in zip(starts, logs, strict=True)]
    code = source.code.replace("#include <stdbool.h>\n", "#include <stdbool.h>\n" + INSIDE, 1)

    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        (folder / "controller.h").write_text(source.header, encoding="utf-8")

        def answers(text: str) -> list[Any]:
            (folder / "controller.c").write_text(text, encoding="utf-8")
            library = Library(folder, flags=("-std=c99", "-O0", "-ffp-contract=off", *TRAP))
            return [library.answers(flight) for flight in flights]

        lines = frozenset((file, line) for _, file, line in source.origins)
        intact = answers(code)
        guarded = [np.append(np.flatnonzero(each["status"]), len(each))[0] for each in intact]
        result = sum(
            int((differing(*pair) < end).sum()) for *pair, end in zip(intact, logs, guarded, strict=True)
        )
        branches = []
        num_flown = len(flights)
        if num_left_out:
            flights += drawn_flights(program)
            intact = answers(code)
        for branch, taken, without in left_out(code, source.origins, num_left_out):
            branches.append((branch, _seen(answers, taken, without, intact, num_flown)))
    is_guarded = any(end < len(each) for end, each in zip(guarded, intact, strict=False))
    return Flown(log.force_commanded_n.tobytes(), result, lines, "", is_guarded, branches)


def skip_none() -> None:
    """Let no vector of points be skipped from here on, in Python and in C."""
    from fis_tools.compiled.vectors import some  # noqa: PLC0415 - of the changed code, as above
    from pipeline.onboard.operations import OPERATIONS  # noqa: PLC0415

    for module in list(sys.modules.values()):
        if getattr(module, "some", None) is some:
            module.some = every  # type: ignore[attr-defined]
    OPERATIONS[every] = lambda translator, mask: True if translator.function.lane else mask  # type: ignore[index]


def every(mask: Any) -> bool:
    """Stand for `some` where no vector of points is to be skipped."""
    return mask.size > 1 or bool(mask.any())


def drawn_flights(program: Any) -> list[Any]:
    """Return inputs of the on-board function that are drawn at random, as flights."""
    import numpy as np  # noqa: PLC0415 - imported before, and of the changed code:

    from pipeline.onboard.recorded import Recorded, start_type, step_type  # noqa: PLC0415

    world, draw = program.world, np.random.default_rng(1)
    count, num_points = world.num_controls, world.num_points

    def unit(length: int) -> Any:
        numbers = draw.normal(size=(count, length))
        return numbers / np.linalg.norm(numbers, axis=1, keepdims=True)

    flights = []
    for _ in range(0, NUM_DRAWN, count):
        start, steps = np.zeros((), start_type(num_points)), np.zeros(count, step_type(num_points))
        elevations = np.tile((1.0, 0.0), (count, 1)) if program.is_sun_in_plane else unit(2)
        start["sun_angle"], start["sun_elevation"], start["counts"] = unit(2)[0], elevations[0], 1
        steps["period"], steps["attitude"] = np.arange(count), unit(4)
        steps["sun_angle"], steps["sun_elevation"] = unit(2), elevations
        steps["position_m"] = unit(3) * draw.uniform(world.min_distance, world.max_distance, (count, 1))
        steps["velocity_m_s"] = unit(3) * draw.uniform(0.0, 1.0, (count, 1))
        steps["unseen"] = draw.random((count, num_points)) < draw.random((count, 1))
        flights.append(Recorded(start, steps, {}, []))
    return flights


def left_out(code: str, origins: Any, count: int) -> Iterator[tuple[str, str, str]]:
    """Return branches of the translated C: the line, and the C in which taking it traps, and without it."""
    lines, first = code.split("\n"), INSIDE.count("\n")
    translated = sorted({number + first for number, _, _ in origins})
    ifs = [n for n in translated if re.fullmatch(r" +if \(.*\) \{", lines[n - 1])]
    for number in random.Random(1).sample(ifs, min(count, len(ifs))):  # noqa: S311 - the same each time
        line = lines[number - 1]
        taken, without = f"{line} __builtin_trap();", re.sub(r"if \(.*\)", "if (false)", line)
        before, after = "\n".join(lines[: number - 1]), "\n".join(lines[number:])
        yield (
            f"controller.c:{number - first}: {line.strip()}",
            *(f"{before}\n{each}\n{after}" for each in (taken, without)),
        )


def _seen(
    answers: Callable[[str], list[Any]], taken: str, without: str, intact: Sequence[Any], num_flown: int
) -> str:
    """Return whether a branch is taken, and whether something answered shows that it is left out."""
    child = FORK.Process(target=answers, args=(taken,))
    child.start()
    child.join()
    if child.exitcode != -signal.SIGILL:
        return NOT_TAKEN
    changed = [(each != before).any() for each, before in zip(answers(without), intact, strict=True)]
    if any(changed):
        return SEEN if any(changed[:num_flown]) else DRAWN
    return EARLY if re.search(r"__builtin_trap\(\);\n +break;", taken) else UNSEEN


def in_a_child(top: Path, words: Sequence[str], num_left_out: int = 0, *, is_each: bool = False) -> Flown:
    """Return what is flown in a process of its own."""
    queue = FORK.SimpleQueue()
    child = FORK.Process(target=fly, args=(top, words, num_left_out, is_each, queue))
    child.start()
    child.join()
    if child.exitcode == -signal.SIGILL:
        return Flown(ended=OUTSIDE)
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
        each = in_a_child(top, words, is_each=True) if result.num_different else None
    finally:
        path.write_text(text, encoding="utf-8")
        Path(cache_from_source(str(path))).unlink(missing_ok=True)
    if result.ended:
        return result.ended
    if each is not None:
        is_alike = each.forces not in (b"", result.forces) and each.num_different == 0
        return BESIDE if is_alike else DIFFERENT
    if result.is_guarded:
        return GUARDED
    return SILENT if result.forces == intact.forces else SHOWN


def main(arguments: Sequence[str]) -> int:
    """Print a line for each change, and how many showed in flight and C alike."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks formulas", description=__doc__)
    parser.add_argument("--mutants", type=int, default=50)
    parser.add_argument("--without-a-branch", type=int, default=0, metavar="NUMBER")
    parser.add_argument("--at", default="", metavar="FILE:LINE", help="changes of this line alone")
    parser.add_argument("words", nargs="*", default=["controller=champion_27", "duration_s=1200"])
    options = parser.parse_args(arguments)
    for library in LIBRARIES:
        importlib.import_module(library)
    counts: Counter[str] = Counter()
    with tempfile.TemporaryDirectory(prefix="formulas-") as scratch:
        top = Path(scratch) / "copy"
        shutil.copytree(
            Path.cwd(), top, ignore=shutil.ignore_patterns(".git", "build", "__pycache__", "tests")
        )
        intact = in_a_child(top, options.words, options.without_a_branch)
        each = in_a_child(top, options.words, is_each=True)
        if intact.ended or intact.num_different or intact.is_guarded or each.num_different:
            raise RuntimeError(f"without a change: {intact.ended or DIFFERENT}")
        if each.forces != intact.forces:
            raise RuntimeError("without a change: a point depends on those beside it in a vector")
        for branch, result in intact.branches:
            counts[result] += 1
            sys.stdout.write(f"{branch}: {result}\n")
        draw = random.Random(1)  # noqa: S311 - the same each time
        for mutant in candidates(top, intact.lines, draw) if options.mutants else ():
            where = f"{mutant['path']}:{mutant['number']}"
            if not where.endswith(options.at):
                continue
            result = verdict(top, mutant, options.words, intact)
            counts[result] += 1
            sys.stdout.write(f"{where}: {mutant['line'].strip()} -> {mutant['new']}: {result}\n")
            sys.stdout.flush()
            if counts[SHOWN] == options.mutants:
                break
    sys.stdout.write("".join(f"{count} {result}\n" for result, count in counts.most_common()))
    return 1 if counts[DIFFERENT] or counts[UNSEEN] else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
