"""Plant a bug in ten files, and see whether `pytest --changed` finds it: ``python -m benchmarks planted``.

It works on a copy of the last commit, one bug at a time, and prints a row for each: how many tests passed or
failed, the seconds that went by and those of processors, and one test that failed.
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
)


def tried(top: Path, bug: tuple[str, str, str]) -> str:
    """Return the row of a bug."""
    name, before, after = bug
    path = top / name
    intact = path.read_text(encoding="utf-8")
    if intact.count(before) != 1:
        raise SystemExit(f"{name} must have {before!r} once; write another bug into benchmarks/planted.py")
    path.write_text(intact.replace(before, after), encoding="utf-8")
    words = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "--changed", "HEAD"]
    environment = {**os.environ, "PYTHONPATH": os.fspath(top)}
    started, before_s = time.monotonic(), sum(os.times()[2:4])
    done = subprocess.run(words, cwd=top, env=environment, capture_output=True, text=True, check=False)  # noqa: S603
    seconds, processor_s = time.monotonic() - started, sum(os.times()[2:4]) - before_s
    path.write_text(intact, encoding="utf-8")
    failed = re.findall(r"^(?:FAILED|ERROR) (\S+)", done.stdout, re.MULTILINE)
    counts = re.findall(r"(\d+) (?:passed|failed)", (done.stdout.splitlines() or [""])[-1])
    first = f"`{failed[0].partition('[')[0]}`" if failed else "none"
    return f"| `{name}` | `{after}` | {sum(map(int, counts))} | {seconds:.0f} | {processor_s:.0f} | {first} |"


def main(arguments: Sequence[str]) -> int:
    """Plant them."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks planted", description=__doc__)
    parser.add_argument("files", nargs="*", help="some of the ten; all unless given")
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
                print(tried(top, bug), flush=True)
    return 0
