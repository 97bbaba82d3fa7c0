"""Every file that a run or a sweep leaves, with hostile texts for its texts: nothing obeys them.

Watched are files, processes and the network by Python's audit events, the environment by a secret in it, and
what is printed or written by its characters.
"""

import csv
import os
import random
import shutil
import sys
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import matplotlib as mpl
import pytest

from fis_tools.__main__ import main as fis_tools
from pipeline.command_line.arguments import parse_arguments
from pipeline.command_line.cli import main
from pipeline.command_line.config import compose_experiment
from pipeline.run import artifacts, sweep
from pipeline.settings.stages import STAGES
from telemetry.commands import main as telemetry
from tests import night
from tests.hostile import kills
from tests.hostile.replaced import UNREAD, count_of, kind_of, replaced
from tests.pipeline.command_line.cases import use_stages
from tests.smoke import miniature

pytestmark = pytest.mark.slow

#: in the environment
WATCHED = "a-word-of-the-environment"
MARKUP, FORMULA = "<script>alert(1)</script>", '=HYPERLINK("http://127.0.0.1:9/")'
#: an option, interpolations, paths, an escape and a mark of direction, markup, a formula, a command
HOSTILE = (
    "hydra.searchpath=[pkg://evil]",
    "${oc.env:WATCHED}",
    "${oc.env:ELSEWHERE}/x",
    "../outside",
    "/outside/of/all",
    "\x1b[31m\u202e",
    MARKUP,
    FORMULA,
    "--config-dir=evil",
    "$(touch outside)",
)
#: what a page could show otherwise than it reads
SHOWN = (MARKUP, "\x1b[31m\u202e")
#: of `kills.KINDS`: those that together have every stage, and a sweep
KINDS = ("planned", "search", "fit", "optimum", "cma_es", "compare", "prove", "assure", "report", "sweep")
#: of a sweep, one of its runs is walked
WALKED_RUN = "seed=1"
#: of each experiment's, whose texts are changed before its page is written
NUM_FILES = night.count(2, 4)
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
    # of modules that are imported for the first time since they were edited, too
    caches = (os.environ.get("NUMBA_CACHE_DIR", ""), sys.pycache_prefix or "__pycache__")
    caches += ("/dev/null", "/dev/pts", "/proc")
    assert [each for each in seen if not any(cache and cache in each for cache in caches)] == []


def attacks(path: Path, rng: random.Random, texts: Sequence[str] = HOSTILE) -> Iterator[bytes]:
    """The contents of a file with each hostile text for one of its texts, and with some for all."""
    content = path.read_bytes()
    if not (count := count_of(path, content)):
        return
    # by day one of the texts, drawn for each file
    for text in rng.sample(texts, night.count(1, len(texts))):
        yield replaced(path, content, text, rng.randrange(count))
    for text in rng.sample(texts, night.count(1, 2)):
        yield replaced(path, content, text)


def files_of(made: Path) -> list[Path]:
    """The files of a run that somebody reads; of a sweep those of one run and its own."""
    paths = [path for path in sorted(made.rglob("*")) if path.is_file() and kind_of(path) not in UNREAD]
    others = [run.folder for run in sweep.read(made) if run.folder != WALKED_RUN] if is_sweep(made) else []
    # of many recordings, and tables of plans, one is as good as another
    seen: set[tuple[Path, str]] = set()
    kept = []
    for path in paths:
        sort = (path.parent, path.suffix)
        is_one_of_many = path.suffix == ".mcap" or path.parent.name in ("plans", "flights")
        if path.relative_to(made).parts[0] in others or (is_one_of_many and sort in seen):
            continue
        seen.add(sort)
        kept.append(path)
    return kept


def is_sweep(folder: Path) -> bool:
    return (folder / sweep.SWEEP).exists()


def commands_on(path: Path, made: Path) -> Iterator[tuple[object, list[str]]]:
    """What is done with a folder ``run`` in which a file is attacked: programs and their words."""
    run = f"run/{WALKED_RUN}" if is_sweep(made) else "run"
    if path.suffix == ".mcap":
        yield main, ["verify", run]
        yield telemetry, ["info", f"{run}/{path.relative_to(made).as_posix()}"]
        return
    yield main, ["resume=run"]
    if is_sweep(made):
        yield main, ["summary", "run"]
    yield main, ["fly", run]
    yield main, [f"hydra.run.dir={run}", "stages=[report]"]
    yield main, ["verify", run]
    if path.name == artifacts.MANIFEST or path.suffix in (".yaml", ".parquet"):
        yield telemetry, ["campaign", run, "--save", "scene.rrd"]
    if path.suffix in (".json", ".yaml"):
        yield fis_tools, ["show", run]


def some_of(commands: list[tuple[object, list[str]]], rng: random.Random) -> list[tuple[object, list[str]]]:
    """By day half of the commands, drawn for each attack, in their order; all of them by night."""
    kept = rng.sample(range(len(commands)), night.count(-(-len(commands) // 2), len(commands)))
    return [commands[number] for number in sorted(kept)]


def test_the_kinds_have_every_stage_and_a_sweep(tmp_path):
    stages: set[str] = set()
    for kind in KINDS:
        words = [
            word for word in kills.words_of(kind, tmp_path) if word != "-m" and not word.startswith("seed=")
        ]
        stages.update(compose_experiment(parse_arguments(words).overrides).experiment.stages)
    assert stages == set(STAGES)
    assert any(kills.KINDS[kind][0] == "-m" for kind in KINDS)


@pytest.fixture(scope="module", params=KINDS)
def made(request, tmp_path_factory):
    folder = tmp_path_factory.mktemp(request.param) / "made"
    assert main(kills.words_of(request.param, folder)) in range(6)
    return folder


def written(folder: Path) -> str:
    """All that stands in the files of a folder."""
    paths = [path for path in folder.rglob("*") if path.is_file() and path.suffix != ".mcap"]
    return "".join(path.read_text(encoding="utf-8", errors="replace") for path in paths)


def assert_harmless(folder: Path) -> None:
    """Check pages for markup and characters, and tables for what a spreadsheet would run."""
    for path in folder.rglob("*.html"):
        page = path.read_text(encoding="utf-8")
        assert MARKUP not in page, path
        assert not set(page) & {"\x1b", "\u202e"}, path
    for path in folder.rglob("*.csv"):
        with path.open(encoding="utf-8", newline="") as stream:
            assert not any(cell.startswith("=") for row in csv.reader(stream) for cell in row), path


#: a run of each takes three minutes in all
EXPERIMENTS = night.by_day(miniature.EXPERIMENTS, 8)


@pytest.fixture(scope="module", params=EXPERIMENTS, ids=lambda path: path.stem)
def experiment(request, tmp_path_factory):
    """The run of each experiment that ships, in miniature."""
    folder = tmp_path_factory.mktemp(request.param.stem) / "made"
    assert main([*miniature.words(request.param.stem), f"hydra.run.dir={folder}"]) in range(6)
    return folder


@pytest.fixture(autouse=True)
def _elsewhere(tmp_path, monkeypatch):
    """A folder to work in, and words of the environment that nothing may tell."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "temporary").mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "temporary"))  # of libraries
    monkeypatch.setenv("WATCHED", WATCHED)
    monkeypatch.setenv("ELSEWHERE", str(tmp_path.parent / "elsewhere"))


def carried_out(made, path, content, programs, capfd):
    """Do things with a copy of a run in which a file has another content; check that nothing obeys it."""
    run, folder = Path("run"), Path.cwd()
    left = ["*.html", "figures", *(["*.mcap"] if path.suffix != ".mcap" else [])]
    shutil.rmtree(run, ignore_errors=True)
    shutil.copytree(made, run, ignore=shutil.ignore_patterns(*left))
    (run / path.relative_to(made)).write_bytes(content)
    with nothing_outside(folder):
        for program, words in programs:
            assert program(words) in range(6), (path.name, words)
    printed = "".join(capfd.readouterr())
    assert "Traceback" not in printed, (path.name, content[:200], printed)
    assert not set(printed) & {"\x1b", "\u202e"}, (path.name, content[:200], printed)
    assert WATCHED not in printed + written(folder), (path.name, content[:200])
    (run / path.relative_to(made)).unlink()  # the attack itself
    assert_harmless(folder)


def test_nothing_obeys_what_a_file_says(made, monkeypatch, capfd):
    """Stages are stand-ins."""
    use_stages(monkeypatch)
    rng = random.Random(1)  # noqa: S311
    files = files_of(made)
    # by day half of the files
    for path in rng.sample(files, night.count(-(-len(files) // 2), len(files))):
        for content in attacks(path, rng):
            carried_out(made, path, content, some_of([*commands_on(path, made)], rng), capfd)


def test_no_page_of_any_experiment_shows_what_a_file_says_otherwise_than_it_reads(experiment, capfd):
    """The stage itself writes the page, after a text of a file became markup, or no character at all.

    Other files of each experiment: a page takes a second, and together they have hundreds.
    """
    rng, num_pages = random.Random(experiment.parent.name), 0  # noqa: S311
    files = list(files_of(experiment))
    for path in rng.sample(files, min(NUM_FILES, len(files))):
        for content in attacks(path, rng, SHOWN):
            carried_out(experiment, path, content, [(main, ["hydra.run.dir=run", "stages=[report]"])], capfd)
            num_pages += len(list(Path("run").glob("*.html")))
    assert num_pages
