"""Every file that a run leaves, with hostile texts for its texts: nothing obeys them.

Watched are files, processes and the network by Python's audit events, the environment by a secret in it, and
what is printed by its characters.
"""

import json
import os
import random
import shutil
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import matplotlib as mpl
import pytest
import yaml

from pipeline.command_line.cli import main
from tests.hostile import kills
from tests.pipeline.command_line.cases import use_stages

pytestmark = pytest.mark.slow

#: in the environment
WATCHED = "a-word-of-the-environment"
#: an option, interpolations, paths, an escape and a mark of direction, markup, a formula, a command
HOSTILE = (
    "hydra.searchpath=[pkg://evil]",
    "${oc.env:WATCHED}",
    "${oc.env:ELSEWHERE}/x",
    "../outside",
    "/outside/of/all",
    "\x1b[31m\u202e",
    "<script>alert(1)</script>",
    '=HYPERLINK("http://127.0.0.1:9/")',
    "--config-dir=evil",
    "$(touch outside)",
)
KINDS = ("planned", "search", "assure")
#: of each file, so many of its texts are replaced one at a time
MOST_SINGLE = 4
WRITING = os.O_WRONLY | os.O_RDWR | os.O_CREAT | os.O_TRUNC | os.O_APPEND
#: audit events that change something at a path, which comes first
CHANGES = {"os.mkdir", "os.rename", "os.remove", "os.rmdir", "os.link", "os.symlink", "os.truncate"}
OUTSIDE = ("subprocess.Popen", "os.system", "os.exec", "os.posix_spawn", "socket.connect", "socket.bind")
watched: list[tuple[Path, list[str]]] = []


def watch(event: str, arguments: tuple[object, ...]) -> None:
    """Note what leads out of the folder that is watched."""
    if not watched:
        return
    inside, seen = watched[-1]
    if event in OUTSIDE or (event == "import" and arguments[0] == "evil"):
        seen.append(f"{event} {arguments[0]!r}")
    is_written = event == "open" and isinstance(arguments[2], int) and bool(arguments[2] & WRITING)
    if event in CHANGES or is_written:
        path = arguments[0]
        if isinstance(path, str) and not Path(os.path.abspath(path)).is_relative_to(inside):
            seen.append(f"{event} {path}")


@pytest.fixture(scope="module", autouse=True)
def _hook():
    mpl.get_configdir()
    mpl.get_cachedir()  # it makes its folders where it is first imported
    sys.addaudithook(watch)  # there is no way to take it away


@contextmanager
def nothing_outside(folder: Path) -> Iterator[None]:
    """Check that code inside touches nothing but a folder."""
    watched.append((folder, seen := []))
    try:
        yield
    finally:
        watched.pop()
    caches = (os.environ.get("NUMBA_CACHE_DIR", ""), "/dev/null", "/dev/pts", "/proc")
    assert [each for each in seen if not any(cache and cache in each for cache in caches)] == []


def replaced(node, texts: Iterator[str | None]):
    """The same plain data with the next text for each of its texts, keys aside; None leaves one."""
    if isinstance(node, dict):
        return {key: replaced(value, texts) for key, value in node.items()}
    if isinstance(node, list):
        return [replaced(value, texts) for value in node]
    if isinstance(node, str):
        text = next(texts)
        return node if text is None else text
    return node


def attacks(path: Path, rng: random.Random) -> Iterator[str]:
    """The contents of a file with all of its texts replaced by each hostile one, and some one at a time."""
    content = path.read_text(encoding="utf-8")
    if path.suffix == ".json":
        data, write = json.loads(content), json.dumps
    elif path.suffix == ".yaml":
        data, write = yaml.safe_load(content), yaml.safe_dump
    else:
        words = content.replace(",", " ").split()
        for text in HOSTILE:
            yield content.replace(rng.choice(words), text) if words else text
        return
    count = 0

    def counted() -> Iterator[None]:
        nonlocal count
        while True:
            count += 1
            yield None

    replaced(data, counted())
    for text in HOSTILE:
        yield write(replaced(data, iter([text] * count)))
    for index in rng.sample(range(count), min(count, MOST_SINGLE)):
        texts = [None] * count
        texts[index] = rng.choice(HOSTILE)
        yield write(replaced(data, iter(texts)))


@pytest.fixture(scope="module", params=KINDS)
def made(request, tmp_path_factory):
    folder = tmp_path_factory.mktemp(request.param) / "made"
    assert main(kills.words_of(request.param, folder)) in range(6)
    return folder


def test_nothing_obeys_what_a_file_says(made, tmp_path, monkeypatch, capfd):
    use_stages(monkeypatch)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("WATCHED", WATCHED)
    monkeypatch.setenv("ELSEWHERE", str(tmp_path.parent / "elsewhere"))
    rng, run = random.Random(1), tmp_path / "run"  # noqa: S311
    files = [
        path
        for path in sorted(made.rglob("*"))
        if path.suffix in (".json", ".yaml", ".csv", ".log", ".jsonl")
    ]
    assert files
    for path in files:
        for content in attacks(path, rng):
            shutil.rmtree(run, ignore_errors=True)
            shutil.copytree(made, run, ignore=shutil.ignore_patterns("*.mcap", "figures", "*.html", "*.npz"))
            (run / path.relative_to(made)).write_text(content, encoding="utf-8")
            again = [["fly", "run"], ["hydra.run.dir=run", "stages=[report]"], ["verify", "run"]]
            with nothing_outside(tmp_path):
                for words in [["resume=run"], *again]:
                    assert main(words) in range(6)
            printed = "".join(capfd.readouterr())
            assert "Traceback" not in printed, (path.name, content[:200], printed)
            assert not set(printed) & {"\x1b", "\u202e"}, (path.name, printed)
            left = "".join(
                each.read_text(encoding="utf-8", errors="replace")
                for each in tmp_path.rglob("*.*")
                if each.is_file()
            )
            assert WATCHED not in printed + left, (path.name, content[:200])
