"""The patches of the guides on adding apply to the tree, all of them together, and what they add works."""

import os
import shutil
import subprocess
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from docs import hooks
from pipeline.flight.state.signals import CONSTANTS, SIGNALS
from tests.places import PROJECT
from tests.programs import run_python
from tests.smoke.pages import DOCS, blocks

#: the most files that a patch touches
MOST = {"signal": 4, "force": 5, "shape": 2, "controller": 4, "stage": 4, "format": 3, "problem": 1}
#: what a patch may be applied to, without what no patch needs
TREE = ("conf", "docs", "fis_tools", "pipeline", "telemetry", "tests", "pyproject.toml")
LEFT_OUT = shutil.ignore_patterns("__pycache__", "images", "results", "hostile", "*.ipynb")
#: folders of tests that know what there is of all that a patch adds; they run on top of all patches
SUITE = ("architecture", "fis_tools/formats", "pipeline/command_line", "pipeline/run", "pipeline/settings")


def patch_of(what: str) -> Path:
    return DOCS / "how-to" / f"add-a-{what}.diff"


def touched(what: str) -> list[str]:
    """The files that a patch adds or changes."""
    lines = patch_of(what).read_text(encoding="utf-8").splitlines()
    return [line.removeprefix("+++ b/") for line in lines if line.startswith("+++ ")]


def test_every_guide_has_a_patch_that_touches_few_files() -> None:
    assert {path.stem for path in (DOCS / "how-to").glob("add-a-*.md")} == {f"add-a-{what}" for what in MOST}
    for what, most in MOST.items():
        page = patch_of(what).with_suffix(".md").read_text(encoding="utf-8")
        assert f"({patch_of(what).name})" in page
        assert "<!-- patch -->" in page
        assert len(touched(what)) <= most, f"{what}: {touched(what)}"


def on_the_site(name: str) -> str:
    page: Any = SimpleNamespace(file=SimpleNamespace(src_uri=name))
    return hooks.on_page_markdown((DOCS / name).read_text(encoding="utf-8"), page)


def test_the_site_shows_patches_keys_signals_and_constants() -> None:
    assert hooks.tables_of_keys() in on_the_site("reference/keys.md")
    for what in MOST:
        assert patch_of(what).read_text(encoding="utf-8") in on_the_site(f"how-to/add-a-{what}.md")
    rows = on_the_site("reference/signals.md").splitlines()
    for name, signal in SIGNALS.items():
        assert [row for row in rows if row.startswith(f"| `{name}` | {signal.unit} | {signal.description} |")]
    for name, constant in CONSTANTS.items():
        assert f"| `{name}` | {constant.description} |" in rows


def apply_all(folder: Path) -> None:
    """Apply all patches to a copy of the tree."""
    outside = os.environ | {"GIT_CEILING_DIRECTORIES": os.fspath(folder.parent)}  # of any repository
    patches = [os.fspath(patch_of(what)) for what in MOST]
    subprocess.run(["git", "apply", *patches], cwd=folder, env=outside, check=True)  # noqa: S603, S607


@pytest.mark.slow
@pytest.mark.parametrize("suite", SUITE)
def test_on_top_of_all_patches_the_tests_still_pass(suite: str, tmp_path: Path) -> None:
    """No test holds a second list of what can be added."""
    left_out = shutil.ignore_patterns(".git", ".venv", ".*_cache", "__pycache__", "build", "outputs")
    shutil.copytree(PROJECT, tmp_path / "copy", ignore=left_out)
    apply_all(tmp_path / "copy")
    words = (
        "-m",
        "pytest",
        "-q",
        "-p",
        "no:cacheprovider",
        "-p",
        "no:xdist",
        "-m",
        "not slow",
        f"tests/{suite}",
    )
    run_python(*words, folder=tmp_path / "copy", path=tmp_path / "copy", NUMBA_DISABLE_JIT="1")


@pytest.mark.slow
def test_what_the_patches_add_works(tmp_path: Path) -> None:
    for name in TREE:
        if (PROJECT / name).is_dir():
            shutil.copytree(PROJECT / name, tmp_path / name, ignore=LEFT_OUT)
        else:
            shutil.copy(PROJECT / name, tmp_path)
    apply_all(tmp_path)
    tests = [path for what in MOST for path in touched(what) if Path(path).name.startswith("test_")]
    for what in MOST:
        for code in blocks(patch_of(what).with_suffix(".md"), "python"):
            tests.append(f"tests/test_{what}_of_the_guide.py")
            lines = [f"    {line}".rstrip() for line in code.splitlines()]
            (tmp_path / tests[-1]).write_text("\n".join(["def test_it():", *lines, ""]), encoding="utf-8")
    assert len(tests) == len(MOST), tests
    words = ("-m", "pytest", "-q", "-p", "no:cacheprovider", "-p", "no:xdist", *tests)
    done = run_python(*words, folder=tmp_path, path=tmp_path, NUMBA_DISABLE_JIT="1")
    assert f"{len(MOST)} passed" in done.stdout
