"""Measure the speeds that the pages quote: ``python -m benchmarks``; or run one of the programs below."""

import argparse
import ast
import os
import platform
import sys
from collections.abc import Callable, Sequence
from importlib import import_module
from pathlib import Path

import numba

PARTS = ("gym", "inference", "learning", "monte_carlo", "recording", "start", "steps", "tools", "training")


def processor() -> str:
    """Return the name of this machine's processor."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="ascii", errors="ignore").splitlines()
    except OSError:
        return platform.processor() or platform.machine()
    names = [line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.machine()


def programs() -> dict[str, str]:
    """Return what each program of this folder does, by its name: a program has a `main` that takes words."""
    programs = {}
    for path in sorted(Path(__file__).parent.glob("[a-z]*.py")):
        tree = ast.parse(path.read_text(encoding="utf-8"))
        if any(
            isinstance(node, ast.FunctionDef) and node.name == "main" and node.args.args for node in tree.body
        ):
            programs[path.stem] = (ast.get_docstring(tree) or "").splitlines()[0]
    return programs


def main() -> int:
    """Run a program, or the chosen parts."""
    every_program = programs()
    if sys.argv[1:2] and sys.argv[1] in every_program:
        run: Callable[[Sequence[str]], int] = import_module(f"benchmarks.{sys.argv[1]}").main
        return run(sys.argv[2:])
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks",
        description=__doc__,
        epilog="\n".join(["programs:", *(f"  {name:12} {text}" for name, text in every_program.items())]),
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("parts", nargs="*", metavar="PART", help=f"of {', '.join(PARTS)}; all unless given")
    parser.add_argument("--controller", default="paper_champion", help="an option of conf/controller")
    parser.add_argument("--generations", type=int, help="of the training; 500 unless given")
    parser.add_argument("--flights", type=int, default=256, help="flights that steps are counted over")
    parser.add_argument(
        "--store", action="store_true", help="keep the ratios of steps as those to compare with"
    )
    options = parser.parse_args()
    unknown = [part for part in options.parts if part not in PARTS]
    if unknown:
        parser.error(f"no part {unknown[0]!r}; the parts are {', '.join(PARTS)}")
    # programs that run above begin without the product: mutants of it are imported from a copy
    from benchmarks import commands, inference, learning, recording, start, steps, tools  # noqa: PLC0415

    chosen = options.parts or PARTS
    print(
        f"{processor()}, {os.cpu_count()} processors, {platform.system()}, "
        f"Python {platform.python_version()}, numba {numba.__version__}, load {os.getloadavg()[0]:.1f}"
    )
    runs = {
        "gym": lambda: import_module("benchmarks.gym").run(),
        "inference": lambda: (
            inference.run(options.controller),
            inference.run_sampled(options.controller),
            inference.run_weighed(),
        ),
        "learning": learning.run,
        "monte_carlo": lambda: commands.run_monte_carlo(options.controller),
        "recording": lambda: recording.run(options.controller),
        "start": start.run,
        "steps": lambda: steps.run(options.flights, stores=options.store),
        "tools": lambda: tools.run(options.controller),
        "training": lambda: commands.run_training(options.generations),
    }
    for part in chosen:
        runs[part]()
    return 0


if __name__ == "__main__":
    sys.exit(main())
