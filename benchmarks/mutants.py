"""Change one operator or number of the code at a time, and count the changes that the tests beside it notice.

``NUMBA_DISABLE_JIT=1 python -m benchmarks mutants pipeline/physics --write x.json`` prints a row for this
folder, whose tests are in ``tests/pipeline/physics``. With ``--against mutants.json`` it makes the same
changes again, each first against the test that noticed it before. With ``--slow`` a change that the fast
tests do not notice meets the slow ones beside it, too.
"""

import argparse
import ast
import contextlib
import importlib
import json
import multiprocessing
import os
import random
import resource
import shutil
import sys
import tempfile
from collections.abc import Iterator, Sequence
from importlib.util import cache_from_source
from pathlib import Path
from typing import Any

#: processor seconds for each file of tests; a mutant that takes more is noticed
LIMIT_S = 20
#: which tests are run, and how much longer the slow ones may take
FAST, SLOW, SLOWER = "-mnot slow", "-mslow", 6
TOO_MUCH = "time or memory"
FORK = multiprocessing.get_context("fork")
#: imported once, before the process divides for each mutant
LIBRARIES = ("numpy", "scipy.integrate", "scipy.stats", "numba", "hypothesis", "pyarrow", "pydantic", "mcap")
#: imported from the copy alone
PRODUCT = ("fis_tools", "pipeline", "plain_files", "telemetry")
#: what may stand in the place of an operator
OTHERS = {
    **{"Lt": "LtE GtE", "LtE": "Lt Gt", "Gt": "GtE LtE", "GtE": "Gt Lt", "Eq": "NotEq", "NotEq": "Eq"},
    **{"Is": "IsNot", "IsNot": "Is", "In": "NotIn", "NotIn": "In", "And": "Or", "Or": "And"},
    **{"Add": "Sub", "Sub": "Add", "Mult": "Div", "Div": "Mult", "FloorDiv": "Mult", "Mod": "Mult"},
}


def changed(node: Any, draw: random.Random) -> str | None:
    """Return the source of a node with something else in the place of its operator or number."""
    value: Any = getattr(node, "value", None)
    if isinstance(node, ast.Constant) and type(value) in (int, float):
        return repr(value + 1)
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub | ast.Not):
        return f"({ast.unparse(node.operand)})"
    is_comparison = isinstance(node, ast.Compare)
    operator = node.ops[0] if is_comparison else getattr(node, "op", None)
    is_text = any(isinstance(getattr(part, "value", 0), str) for part in ast.walk(node))
    if type(operator).__name__ not in OTHERS or (is_text and not is_comparison):
        return None
    new = getattr(ast, draw.choice(OTHERS[type(operator).__name__].split()))()
    if is_comparison:
        node.ops[0] = new
    else:
        node.op = new
    return ast.unparse(node) if isinstance(node, ast.stmt) else f"({ast.unparse(node)})"


def mutants_of(top: Path, path: Path, draw: random.Random) -> list[dict[str, Any]]:
    """Return all changes of a file: the line by its text, and by its number among equal ones."""
    text = path.read_text(encoding="utf-8")
    lines, nodes, mutants = text.split("\n"), list[Any](ast.walk(ast.parse(text))), list[dict[str, Any]]()
    in_texts = {id(part) for node in nodes if isinstance(node, ast.JoinedStr) for part in ast.walk(node)}
    for node in nodes:
        number = getattr(node, "lineno", 0) - 1
        if id(node) in in_texts or number != getattr(node, "end_lineno", -1) - 1:
            continue
        new = changed(node, draw) if lines[number].isascii() else None
        if new is not None:
            line, ends = lines[number], {"start": node.col_offset, "end": node.end_col_offset}
            location = {"path": str(path.relative_to(top)), "line": line, "nth": lines[:number].count(line)}
            mutants.append(location | ends | {"new": new})
    return mutants


class Noticed:
    """A plugin of pytest that keeps the name of the first test that fails."""

    name = ""

    def pytest_runtest_logreport(self, report: Any) -> None:
        """Keep it."""
        self.name = self.name or (report.nodeid if report.failed else "")

    pytest_collectreport = pytest_runtest_logreport


def run_tests(top: Path, tests: list[str], words: list[str], queue: Any) -> None:
    """Tell which test fails first; "" if none does."""
    limit_s = LIMIT_S * len(tests) * (SLOWER if SLOW in words else 1)
    resource.setrlimit(resource.RLIMIT_CPU, (limit_s, limit_s))
    os.chdir(top)
    sys.path.insert(0, str(top))
    noticed, words = Noticed(), ["-x", "-q", "-n0", "--assert=plain", "-pno:cacheprovider", *words]
    with open(os.devnull, "w") as out, contextlib.redirect_stdout(out), contextlib.redirect_stderr(out):
        code = importlib.import_module("pytest").main([*words, *tests], plugins=[noticed])
    queue.put(noticed.name or ("" if code in (0, 4, 5) else f"pytest ended with {code}"))


def first_failure(top: Path, tests: list[str], words: Sequence[str] = (FAST,)) -> str:
    """Return the first test that fails in a process of its own, "" if none does, or that it took too much."""
    queue = FORK.SimpleQueue()
    child = FORK.Process(target=run_tests, args=(top, tests, [*words], queue))
    child.start()
    child.join()
    return TOO_MUCH if queue.empty() else str(queue.get())


@contextlib.contextmanager
def written(path: Path, text: str) -> Iterator[None]:
    """Give a file of the copy another text, and no bytecode of the text before it."""
    intact = path.read_text(encoding="utf-8")
    path.write_text(text, encoding="utf-8")
    Path(cache_from_source(str(path))).unlink(missing_ok=True)
    try:
        yield
    finally:
        path.write_text(intact, encoding="utf-8")
        Path(cache_from_source(str(path))).unlink(missing_ok=True)


def noticed_by(top: Path, mutant: dict[str, Any], tests: list[str], speeds: Sequence[str]) -> str | None:
    """Return what notices a mutant, or None if its line is no longer there.

    A test notices a mutant if it fails again, and not on the intact code: one that waits for other processes
    may fail on a busy machine.
    """
    path, start, end = top / mutant["path"], mutant["start"], mutant["end"]
    lines = path.read_text(encoding="utf-8").split("\n") if path.exists() else []
    numbers = [number for number, line in enumerate(lines) if line == mutant["line"]][mutant["nth"] :]
    if not numbers:
        return None
    lines[numbers[0]] = mutant["line"][:start] + mutant["new"] + mutant["line"][end:]
    before = mutant.get("noticed", "").partition("[")[0]
    known = [before] if (top / before.partition("::")[0]).is_file() else []
    tries = [(each, speed) for speed in speeds for each in (known, tests) if each]
    passed_over: list[str] = []
    while tries:
        each, speed = tries[0]
        words = (speed, *(f"--deselect={name}" for name in passed_over))
        with written(path, "\n".join(lines)):
            name = first_failure(top, each, words)
            is_test = "::" in name
            again = first_failure(top, [name], (speed,)) if is_test else name
        if not name:
            tries.pop(0)
        elif not is_test or (again and not first_failure(top, [name], (speed,))):
            return name
        else:
            passed_over.append(name)
    return ""


def beside(top: Path, folder: str, path: str) -> list[str]:
    """Return the files of tests of a folder; those that name a module come first."""
    module = path.removesuffix(".py").replace("/", ".")
    files = (top / "tests" / folder).rglob("test_*.py")
    named = [(module not in file.read_text(encoding="utf-8"), str(file.relative_to(top))) for file in files]
    return [name for _, name in sorted(named)]


def main(arguments: Sequence[str]) -> int:
    """Make the mutants of an area, or those of a file again, and print how many are noticed."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks mutants", description=__doc__)
    parser.add_argument("sources", help="a folder, such as telemetry/file")
    parser.add_argument("--number", type=int, default=50)
    parser.add_argument("--seed", type=int, default=1, help="of the changes")
    parser.add_argument(
        "--slow", action="store_true", help="run slow tests, too, where fast ones notice nothing"
    )
    parser.add_argument("--write", type=Path, help="a file for the mutants and what noticed them")
    parser.add_argument("--against", type=Path, help="a file of mutants to make again")
    options = parser.parse_args(arguments)
    if imported := {name.partition(".")[0] for name in sys.modules} & {*PRODUCT}:
        parser.error(f"{', '.join(sorted(imported))} is imported already, and tests would run it unchanged")
    for library in LIBRARIES:
        importlib.import_module(library)
    with tempfile.TemporaryDirectory(prefix="mutants-") as scratch:
        top, draw = Path(scratch) / "copy", random.Random(options.seed)  # noqa: S311 - the same each time
        shutil.copytree(Path.cwd(), top, ignore=shutil.ignore_patterns(".git", "build", "__pycache__"))
        files = sorted((top / options.sources).rglob("*.py"))
        every = [
            mutant for path in files if "schema" not in path.parts for mutant in mutants_of(top, path, draw)
        ]
        mutants = draw.sample(every, min(options.number, len(every)))
        if options.against:
            mutants = json.loads(options.against.read_text(encoding="utf-8"))
        if failed := first_failure(top, beside(top, options.sources, "")):
            parser.error(f"{failed} fails without a mutant")
        for mutant in mutants:
            tests = beside(top, options.sources, mutant["path"])
            mutant["noticed"] = noticed_by(top, mutant, tests, (FAST, SLOW) if options.slow else (FAST,))
            line = f"{mutant['path']}: {mutant['line'].strip()} -> {mutant['new']}: {mutant['noticed']}"
            print(line, file=sys.stderr, flush=True)
    results = [bool(mutant["noticed"]) for mutant in mutants if mutant["noticed"] is not None]
    print(f"| {options.sources} | {len(results)} | {sum(results)} | {sum(results) / len(results):.0%} |")
    if options.write:
        options.write.write_text(json.dumps(mutants, indent=1), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
