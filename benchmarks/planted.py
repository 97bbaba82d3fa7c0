"""Plant one bug after another, and see whether `pytest --changed` finds it: ``python -m benchmarks planted``.

It works on a copy of the last commit, and prints a row for each bug: how many tests passed or failed, the
seconds that went by and those of processors, and one test that failed. The last bug is a law of thrusters
that is added without its bound, so that proofs of safety rest on a bound that no longer holds.
"""

import argparse
import os
import re
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Final

#: files, what stands there once, and what is put in its place
BUGS: Final = (
    ("pipeline/physics/illumination.py", "apart >= sun + earth", "apart >= sun - earth"),
    ("pipeline/flight/fly/foresight.py", "(1.0 + ERROR_SHARE) * off", "(1.0 + ERROR_SHARE) + off"),
    (
        "pipeline/recording/foresight.py",
        "MM_PER_M * mission.control_period_s",
        "0.1 * MM_PER_M * mission.control_period_s",
    ),
    ("pipeline/evaluation/statistics.py", "share + z * z / (2 * number)", "share - z * z / (2 * number)"),
    ("pipeline/settings/orbit.py", "EARTH_RADIUS_M + self.altitude_m", "EARTH_RADIUS_M - self.altitude_m"),
    ("pipeline/training/similarity.py", "speed * mass * home.", "speed * mass * mission."),
    ("telemetry/file/reader.py", "limit + epoch_ns", "limit - epoch_ns"),
    ("fis_tools/engines/degrees.py", "abs((x - c) / a), 2.0 * b)", "abs((x - c) / a), b)"),
    ("fis_tools/findings/audit/answers.py", "if part >= thresholds.reach:", "if part < thresholds.reach:"),
    ("conf/world/afrl.yaml", "mean_motion_rad_s: 0.001027", "mean_motion_rad_s: 0.00127"),
    ("pipeline/evaluation/monte_carlo.py", "(STANDARD_GRAVITY_M_S2 * impulses)", "impulses"),
    ("pipeline/recording/foresight.py", "mission.control_period_s / 60.0", "mission.control_period_s / 6.0"),
    ("pipeline/recording/foresight.py", "MM_PER_M * (prices", "0.01 * MM_PER_M * (prices"),
)
#: a patch that adds a law of thrusters, and the file whose part of it is left out: the law's bound
LAW: Final = ("docs/how-to/add-a-thruster-law.diff", "pipeline/flight/world/thrust_bounds.py")


def plant(top: Path, bug: tuple[str, str, str]) -> None:
    """Put a bug into a file of the copy."""
    name, before, after = bug
    intact = (top / name).read_text(encoding="utf-8")
    if intact.count(before) != 1:
        raise SystemExit(f"{name} must have {before!r} once; write another bug into benchmarks/planted.py")
    (top / name).write_text(intact.replace(before, after), encoding="utf-8")


def in_copy(top: Path, *words: str) -> None:
    """Carry out a command of Git in the copy."""
    subprocess.run(["git", *words], cwd=top, check=True)  # noqa: S603, S607


def tried(top: Path, name: str, change: str) -> str:
    """Return the row of the bug that stands in the copy, and take it out."""
    words = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "--changed", "HEAD"]
    environment = {**os.environ, "PYTHONPATH": os.fspath(top)}
    started, before_s = time.monotonic(), sum(os.times()[2:4])
    done = subprocess.run(words, cwd=top, env=environment, capture_output=True, text=True, check=False)  # noqa: S603
    seconds, processor_s = time.monotonic() - started, sum(os.times()[2:4]) - before_s
    in_copy(top, "checkout", "--quiet", ".")
    failed = re.findall(r"^(?:FAILED|ERROR) (\S+)", done.stdout, re.MULTILINE)
    counts = re.findall(r"(\d+) (?:passed|failed)", (done.stdout.splitlines() or [""])[-1])
    first = f"`{failed[0].partition('[')[0]}`" if failed else "none"
    return f"| `{name}` | {change} | {sum(map(int, counts))} | {seconds:.0f} | {processor_s:.0f} | {first} |"


def main(arguments: Sequence[str]) -> int:
    """Plant them."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks planted", description=__doc__)
    parser.add_argument("files", nargs="*", help="where the bugs are planted; all files unless given")
    options = parser.parse_args(arguments)
    project = Path(__file__).resolve().parents[1]
    print(
        "| file | now says | tests that ran | s | processor s | one that fails |\n|---|---|---|---|---|---|",
        flush=True,
    )
    with tempfile.TemporaryDirectory(prefix="planted-") as folder:
        top = Path(folder) / "copy"
        clone = ["git", "clone", "--quiet", "--shared", os.fspath(project), os.fspath(top)]
        subprocess.run(clone, check=True)  # noqa: S603
        for bug in BUGS:
            if not options.files or bug[0] in options.files:
                plant(top, bug)
                print(tried(top, bug[0], f"`{bug[2]}`"), flush=True)
        patch, bound = LAW
        if not options.files or bound in options.files:
            in_copy(top, "apply", f"--exclude={bound}", patch)
            print(tried(top, bound, "nothing of the law that was added"), flush=True)
    return 0
