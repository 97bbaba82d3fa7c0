"""A copy of the project with the patches of all guides on adding applied to it."""

import os
import shutil
import subprocess
from pathlib import Path

from tests.places import PROJECT
from tests.smoke.pages import DOCS, blocks_of

#: what is added, and the most files that its patch touches
MOST = {
    "signal": 4,
    "force": 5,
    "shape": 2,
    "controller": 4,
    "stage": 4,
    "format": 3,
    "problem": 1,
    "setting": 1,
    "thruster-law": 6,
    "figure": 3,
    "quantity": 1,
}
GUIDE = DOCS / "how-to" / "adding.md"
LEFT_OUT = shutil.ignore_patterns(".git", ".venv", ".*_cache", "__pycache__", "build", "outputs")


def patch_of(what: str) -> Path:
    return DOCS / "how-to" / f"add-a-{what}.diff"


def section_of(what: str) -> str:
    """The part of the guide that shows a patch."""
    parts = GUIDE.read_text(encoding="utf-8").split("\n## ")
    (section,) = [part for part in parts if f"<!-- patch {what} -->" in part]
    return section


def touched(what: str) -> list[str]:
    """The files that a patch adds or changes."""
    lines = patch_of(what).read_text(encoding="utf-8").splitlines()
    return [line.removeprefix("+++ b/") for line in lines if line.startswith("+++ ")]


def copy_with_additions(folder: Path) -> list[str]:
    """Make the copy, and in it a test of each guide's code; return the tests that the guides add."""
    shutil.copytree(PROJECT, folder, ignore=LEFT_OUT)
    outside = os.environ | {"GIT_CEILING_DIRECTORIES": os.fspath(folder.parent)}  # of any repository
    patches = [os.fspath(patch_of(what)) for what in MOST]
    subprocess.run(["git", "apply", *patches], cwd=folder, env=outside, check=True)  # noqa: S603, S607
    tests = [path for what in MOST for path in touched(what) if Path(path).name.startswith("test_")]
    for what in MOST:
        for code in blocks_of(section_of(what), "python"):
            tests.append(f"tests/test_{what.replace('-', '_')}_of_the_guide.py")
            lines = [f"    {line}".rstrip() for line in code.splitlines()]
            (folder / tests[-1]).write_text("\n".join(["def test_it():", *lines, ""]), encoding="utf-8")
    return tests
