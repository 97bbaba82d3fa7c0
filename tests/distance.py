"""How far each file of tests is from a change: in steps of the import graph, from the changed files on."""

import re
import subprocess
import sys
from collections import Counter, deque
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import NamedTuple

import grimp

from tests.places import PACKAGES, PROJECT

FOLDERS = (*PACKAGES, "tests", "docs", "benchmarks")


def changed_files(since: str | None) -> list[str] | None:
    """Return the paths of files that differ from a commit, new ones included; None where git cannot tell.

    Without a commit: from where this branch left ``main``.
    """
    left = _git("merge-base", "HEAD", "main") or _git("merge-base", "HEAD", "origin/main") or ["HEAD"]
    base = [since] if since else left
    differing = _git("diff", "--name-only", "--no-renames", *base)
    new = _git("ls-files", "--others", "--exclude-standard")
    return None if differing is None or new is None else sorted({*differing, *new})


def _git(*words: str) -> list[str] | None:
    try:
        done = subprocess.run(["git", *words], cwd=PROJECT, capture_output=True, text=True, check=False)  # noqa: S603, S607
    except FileNotFoundError:
        return None
    return None if done.returncode else done.stdout.splitlines()


def module_of(path: str) -> str:
    return path.removesuffix(".py").removesuffix("/__init__").replace("/", ".")


class Near(NamedTuple):
    """How near a file of tests is to a change."""

    #: from the nearest of the changed files
    steps: int
    #: how many of the changed files are at most one step away
    neighbours: int


def distances(changed: Iterable[str]) -> dict[str, Near]:
    """Return how near each file of tests is that changed files can reach.

    A step leads from a module to one that imports it. Modules of tests, and what a package passes on by its
    ``__init__.py``, are no step of their own. From a file that is no module, the first step leads to the
    modules that name it, or lie beside it, and the second to those that name its folder.
    """
    graph, files = grimp.build_graph(*FOLDERS, cache_dir=None), list(changed)
    steps = _steps(graph, _first_distances(files, graph.modules))
    neighbours = Counter[str]()
    for module in graph.modules & {*map(module_of, files)}:
        neighbours.update(_steps(graph, {module: 0}, most=1).keys())
    paths = {module: f"{module.replace('.', '/')}.py" for module in steps}
    return {
        path: Near(steps[module], neighbours[module])
        for module, path in sorted(paths.items())
        if is_of_tests(path)
    }


def _steps(graph: grimp.ImportGraph, start: Mapping[str, int], most: int = sys.maxsize) -> dict[str, int]:
    """Return the steps from some modules to all that they reach within so many."""
    packages = {each for each in graph.modules if graph.find_children(each)}
    known: dict[str, int] = {}
    waiting = deque(sorted(start.items(), key=lambda item: item[1]))
    while waiting:
        module, distance = waiting.popleft()
        if distance > most or known.get(module, distance + 1) <= distance:
            continue
        known[module] = distance
        for importer in graph.find_modules_that_directly_import(module):
            is_no_step = importer in packages or (
                module.startswith("tests.") and importer.startswith("tests.")
            )
            following = (importer, distance + (not is_no_step))
            if is_no_step:
                waiting.appendleft(following)
            else:
                waiting.append(following)
    return known


def is_of_tests(path: str) -> bool:
    return path.startswith("tests/") and Path(path).name.startswith("test_")


def _first_distances(changed: list[str], modules: set[str]) -> Mapping[str, int]:
    """Return the distances of what is changed itself, or named by modules."""
    first = {module_of(path): 0 for path in changed if module_of(path) in modules}
    others = [Path(path) for path in changed if module_of(path) not in modules]
    texts = {
        path: (PROJECT / path).read_text(encoding="utf-8")
        for path in (f"{each.replace('.', '/')}.py" for each in modules)
        if others and (PROJECT / path).is_file()
    }
    for other in others:
        named = re.compile(rf"(?<![\w-]){re.escape(other.stem)}(?![\w-])")
        folder = re.compile(rf"[\"'/]{re.escape(other.parent.name or other.name)}[\"'/]")
        for path, text in texts.items():
            if named.search(text) or Path(path).parent == other.parent:
                first[module_of(path)] = min(first.get(module_of(path), 1), 1)
            elif folder.search(text):
                first.setdefault(module_of(path), 2)
    for path in map(Path, changed):
        if path.name == "conftest.py":
            of_folder = f"{module_of(path.parent.as_posix())}."
            for module in modules:
                if module.startswith(of_folder):
                    first.setdefault(module, 1)
    return first
