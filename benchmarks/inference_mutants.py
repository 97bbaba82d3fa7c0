"""Change each form of inference, and count what ``agree`` finds: ``python -m benchmarks inference_mutants``.

One operator or number of an engine's code is changed at a time, in a copy of the product; then random systems
are compared for a minute of processor time, in that form alone. What is compiled runs as plain Python, a
hundred times as slow. Of C and pages what is written is changed (`benchmarks.written_mutants`), since their
writers hold no inference. A change that says the same as before is not found.
"""

import argparse
import os
import random
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from benchmarks.mutants import mutants_of
from benchmarks.written_mutants import WRITTEN, num_found

#: the code that only this form has, so that the others are right while it is changed
ENGINES: Mapping[str, Sequence[str]] = {
    "definition": ("fis_tools/engines/inference.py", "fis_tools/engines/defuzzification.py"),
    "compiled": tuple(
        f"fis_tools/engines/{name}.py"
        for name in (
            "interpreter",
            "defuzzifier",
            "sampling",
            "degrees",
            "lanes",
            "sampled_lanes",
            "intervals",
        )
    ),
    "kernel": ("fis_tools/engines/kernel.py",),
    "bounds": tuple(
        f"fis_tools/engines/{name}.py"
        for name in ("interval", "outward", "bounded_average", "bounded_centroid", "sampled_bounds")
    ),
    "shares": tuple(
        f"fis_tools/analysis/{name}.py" for name in ("shapley", "weighted_shares", "contribution")
    ),
}
#: what is compared, as the change can show there alone
COMPARED: Mapping[str, Sequence[str]] = {
    "definition": ("arrays", "one by one"),
    "compiled": ("one by one", "arrays", "bounds"),
    "kernel": ("arrays",),
    "bounds": ("bounds", "no"),
    "shares": ("explain", "shares", "contributions"),
}
#: by the clock, even of a busy machine
MOST_S = 1800
#: those whose code numba would compile anew for each change
COMPILED = ("compiled", "kernel", "bounds")


def main(arguments: Sequence[str]) -> int:
    """Print a row for each engine, and each change that is not found."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks inference_mutants", description=__doc__)
    parser.add_argument("--number", type=int, default=50, help="of each engine")
    engines = (*ENGINES, *WRITTEN)
    parser.add_argument("--only", choices=engines, action="append", help="an engine, or several")
    parser.add_argument("--seed", type=int, default=1, help="of the changes and the systems")
    options = parser.parse_args(arguments)
    with tempfile.TemporaryDirectory(prefix="mutants-") as scratch:
        top = Path(scratch) / "copy"
        shutil.copytree(Path.cwd(), top, ignore=shutil.ignore_patterns(".git", "build", "__pycache__"))
        print("| engine | changes | found |\n|---|---|---|", flush=True)
        for engine in options.only or engines:
            if engine in WRITTEN:
                print(
                    f"| {engine} | {options.number} | {num_found(engine, options.number, options.seed)} |",
                    flush=True,
                )
                continue
            draw = random.Random(options.seed)  # noqa: S311 - the same each time
            paths = [path for name in ENGINES[engine] for path in files(top / name)]
            every = [mutant for path in paths for mutant in mutants_of(top, path, draw)]
            chosen = draw.sample(every, min(options.number, len(every)))
            if difference := first_difference(top, options.seed, engine):
                parser.error(f"without a change something differs: {difference}")
            count = sum(is_noticed(top, mutant, options.seed, engine) for mutant in chosen)
            print(f"| {engine} | {len(chosen)} | {count} |", flush=True)
    return 0


def files(path: Path) -> list[Path]:
    """Return a file, or those of a folder."""
    return sorted(path.rglob("*.py")) if path.is_dir() else [path]


def is_noticed(top: Path, mutant: Mapping[str, Any], seed: int, engine: str) -> bool:
    """Return whether a change is found, and print it if not."""
    path = top / mutant["path"]
    intact = path.read_text(encoding="utf-8")
    lines = intact.split("\n")
    number = [index for index, line in enumerate(lines) if line == mutant["line"]][mutant["nth"]]
    lines[number] = mutant["line"][: mutant["start"]] + mutant["new"] + mutant["line"][mutant["end"] :]
    path.write_text("\n".join(lines), encoding="utf-8")
    try:
        difference = first_difference(top, seed, engine)
    finally:
        path.write_text(intact, encoding="utf-8")
    words = f"{mutant['path']}:{number + 1} {mutant['line'].strip()} -> {mutant['new']}"
    print(f"{words}: {difference or 'not found'}", file=sys.stderr, flush=True)
    return bool(difference)


def first_difference(top: Path, seed: int, engine: str) -> str:
    """Return what the comparison finds first in a copy, or the end of an error; "" if nothing."""
    command = [sys.executable, "-m", "benchmarks", "agree", "--first", "--minutes=1", f"--seed={seed}"]
    # in plain Python many systems take far longer than a minute
    command += ["--batch=1"]
    command += [f"--only={name}" for name in COMPARED[engine]]
    environment = os.environ | {"PYTHONPATH": str(top), "PYTHONDONTWRITEBYTECODE": "1"}
    environment["NUMBA_DISABLE_JIT"] = str(int(engine in COMPILED))
    try:
        done = subprocess.run(  # noqa: S603
            command, cwd=top, env=environment, check=False, capture_output=True, text=True, timeout=MOST_S
        )
    except subprocess.TimeoutExpired:
        return "it does not end"
    return "" if not done.returncode else (done.stdout + done.stderr).strip().split("\n")[-1][:100]
