"""The commands on the pages are commands: those of the README, of the documentation, and of the packages."""

import argparse
import importlib
import json
import re
import shutil
from dataclasses import replace
from glob import glob
from importlib.util import find_spec
from itertools import pairwise
from pathlib import Path

import pytest

import benchmarks.__main__ as benchmarks
import fis_tools.__main__ as review
from docs.scripts import pictures
from docs.scripts.shown import PAGES as SHOWN_PAGES
from fis_tools.formats import serialize
from pipeline.command_line import cli
from pipeline.command_line.choices import options
from pipeline.command_line.config import conf_folder
from pipeline.command_line.overrides import check_overrides, parse, rewrite_paths
from telemetry import commands as telemetry_commands
from tests import night
from tests.fis_tools.review.cases import log_flight
from tests.places import PROJECT
from tests.smoke.pages import DOCS, FOLLOWED, PAGES, calls_of, commands, name_of, sentences

#: what the site makes when it is built: no page of the repository
GENERATED = ("live", "classics.md", "reference/commands.md", "reference/api")
#: words of commands that work on what an earlier one made, or the reader has, and one that takes long
NEED_A_FOLDER = (
    *("resume=", "compare=", "hydra.run.dir=", "--config-dir"),
    *("verify", "summary", "fly", "again", "repeat", "merge", "edit", "warm", "export_c"),
)


#: those of the README; a developer does not wait for all others
QUICK = [words[3:] for words in commands(PROJECT / "README.md")]
#: those whose experiment is composed; of the others by day each word is checked
COMPOSED = [*QUICK, *night.by_day([each for each in calls_of("pipeline") if each not in QUICK], 2)]


@pytest.mark.parametrize(
    "words",
    [each if each in QUICK else pytest.param(each, marks=pytest.mark.slow) for each in calls_of("pipeline")],
    ids=" ".join,
)
def test_experiments(words, capsys):
    is_composed = words in COMPOSED and not any(word.startswith(NEED_A_FOLDER) for word in words)
    if not words:
        assert cli.main(words) == 2
    elif not is_composed or "-m" in words:
        others = ("resume=", "compare=", "page=", "+experiment=my_")
        of_ours = [word for word in words if "=" in word and not word.startswith(others)]
        check_overrides(parse(rewrite_paths(of_ours)), options([conf_folder()]))
    else:
        printing = words if "--cfg" in words else [*words, "--cfg", "job"]
        assert cli.main(printing) == 0, capsys.readouterr().err


@pytest.mark.parametrize("words", calls_of("telemetry"), ids=" ".join)
def test_telemetry(words):
    assert callable(telemetry_commands.command_line().parse_args(words, exit_on_error=False)[0])


REVIEWED = [
    page
    for page in PAGES
    if any(words[2] == "fis_tools" for words in commands(page))
    # these are run whole, with what they print, by test_notebook.py and test_tutorial.py
    and page not in [*(DOCS / name for name in SHOWN_PAGES), FOLLOWED]
]


@pytest.mark.slow
@pytest.mark.parametrize("page", REVIEWED, ids=name_of)
def test_review(page, tmp_path, monkeypatch, capsys):
    """Each page's commands run one after the other, on files of the names that they ask for."""
    shutil.copytree(DOCS / "examples", tmp_path / "docs" / "examples")
    shutil.copytree(PROJECT / "conf" / "controller", tmp_path / "conf" / "controller")
    shutil.copy(PROJECT / "pyproject.toml", tmp_path)  # which says where controllers are
    monkeypatch.chdir(tmp_path)
    # an editor does not end by itself
    given = [words[3:] for words in commands(page) if words[2] == "fis_tools" and words[3] != "edit"]
    for words in given:
        provide(words)
        expanded = [path for word in words for path in (sorted(glob(word)) if "*" in word else [word])]
        assert review.main(expanded) == 0, f"{words}: {capsys.readouterr().err}"


def provide(words: list[str]) -> None:
    """Make the files that a command reads: flights and copies of the controller that it is about."""
    ours = [Path(word).stem for word in words if word.startswith("conf/controller/")]
    controller = serialize.load(PROJECT / "conf" / "controller" / f"{(*ours, 'paper_champion')[0]}.yaml")
    outputs = [follower for word, follower in pairwise(words) if word == "-o"]
    for word in words:
        path = Path(word.replace("*", "0"))
        if word in outputs or path.exists():
            continue
        if path.suffix == ".mcap":
            log_flight(path, controller, 61)
        elif path.name == "TIME":
            path.mkdir(parents=True)
            (path / "champion.json").write_text(serialize.dump_json(controller), encoding="utf-8")
        elif path.suffix in {".json", ".yaml"}:
            num_systems = None if path.stem == "champion" else 2
            changed = replace(controller, systems=controller.systems[:num_systems])
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(serialize.dump_json(changed), encoding="utf-8")


class ParsedError(Exception):
    """What was asked for is understood."""


@pytest.fixture
def _only_parsed(monkeypatch):
    """Let a command end once it has read its arguments."""
    parse_args = argparse.ArgumentParser.parse_args

    def parse_only(parser, *arguments):
        raise ParsedError(parse_args(parser, *arguments))

    monkeypatch.setattr(argparse.ArgumentParser, "parse_args", parse_only)


@pytest.mark.usefixtures("_only_parsed")
@pytest.mark.parametrize("words", calls_of("benchmarks"), ids=" ".join)
def test_benchmarks(words):
    if not (words and words[0] in benchmarks.programs()):
        assert {word for word in words if word != "--store"} <= set(benchmarks.PARTS)
        return
    module = importlib.import_module(f"benchmarks.{words[0]}")
    with pytest.raises(ParsedError) as parsed:
        module.main(words[1:])
    assert set(getattr(parsed.value.args[0], "names", [])) <= set(getattr(module, "VARIANTS", words))


def test_every_benchmark_is_on_a_page_or_serves_one_that_is():
    text = "".join(page.read_text(encoding="utf-8") for page in PAGES)
    folder = Path(benchmarks.__file__).parent
    files = {path.stem: path for path in folder.glob("*.py")}
    files |= {path.parent.name: path for path in folder.glob("*/__init__.py")}
    on_pages = {name for name in files if re.search(rf"benchmarks[ ./]{name}\b", text)}
    waiting = {"__init__", "__main__", *on_pages}  # without a name all parts are run
    needed: set[str] = set()
    while waiting:
        needed |= waiting
        source = "".join(files[name].read_text(encoding="utf-8") for name in waiting)
        imported = re.findall(r"^ *from benchmarks(?: import (.+)|\.(\w+) import)", source, re.MULTILINE)
        waiting = set(re.findall(r"\w+", str(imported))) & files.keys() - needed
    assert files.keys() - needed == set()


def test_every_module_of_a_command_is_there():
    modules = {words[2] for page in PAGES for words in commands(page)}
    assert {"venv", "pipeline", "telemetry", "fis_tools", "benchmarks", "pytest", "docs"} <= modules
    assert [module for module in modules if find_spec(module) is None] == []


@pytest.mark.parametrize("page", PAGES, ids=name_of)
def test_links_and_named_tests_lead_somewhere(page):
    """Links to headings, and to what is made with the site, are checked when it is built."""
    text = page.read_text(encoding="utf-8")
    for target in re.findall(r"\]\(([^)#\s]+)", text):
        path = (page.parent / target).resolve()
        is_generated = any(path.is_relative_to(DOCS / each) for each in GENERATED)
        assert target.startswith("https://") or is_generated or path.exists(), target
    named = re.findall(r"`([\w/]*test_\w+\.py)`", text)
    made_by_the_reader = page.parent.name == "how-to"
    assert made_by_the_reader or [name for name in named if not (PROJECT / name).is_file()] == []


def test_no_sentence_is_longer_than_a_breath():
    counts = {each: len(each.split()) for page in PAGES for each in sentences(page)}
    assert len(counts) > 2000
    assert {each: count for each, count in counts.items() if count > 45} == {}


def test_a_picture_is_stale_once_what_draws_it_has_changed(tmp_path, monkeypatch):
    assert pictures.SOURCES.keys() == pictures.MAKERS.keys()
    kept = {name: pictures.drawn_by(name) for name in pictures.MAKERS}
    (tmp_path / "pictures.json").write_text(json.dumps(kept))
    monkeypatch.setattr(pictures, "HASHES", tmp_path / "pictures.json")
    assert pictures.stale() == []
    (tmp_path / "film.py").write_text("FRAMES = 99")
    monkeypatch.setitem(pictures.SOURCES, "flight", (str(tmp_path / "film.py"),))
    assert pictures.stale() == ["flight"]
