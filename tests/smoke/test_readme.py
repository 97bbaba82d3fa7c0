"""The README's commands are commands."""

import argparse
import re
import shlex
import shutil
from dataclasses import replace
from glob import glob

import pytest

import benchmarks.__main__ as benchmarks
import fis_tools.__main__ as review
from fis_tools.formats import serialize
from pipeline.command_line import cli
from pipeline.command_line.config import (
    check_overrides,
    conf_folder,
    options,
    parse,
    rewrite_controller_paths,
)
from telemetry import commands
from tests.fis_tools.review.cases import log_flight
from tests.smoke.command_line import PROJECT

README = (PROJECT / "README.md").read_text(encoding="utf-8")
BLOCKS = re.findall(r"^```sh\n(.*?)^```", README, re.MULTILINE | re.DOTALL)
LINES = [line.partition(" #")[0].strip() for block in BLOCKS for line in block.splitlines()]
COMMANDS = [
    shlex.split(command)
    for line in LINES
    for command in line.split(" && ")
    if re.match(r"(\S+/)?python3? -m ", command)
]


def calls_of(module: str) -> list[list[str]]:
    return [words[3:] for words in COMMANDS if words[2] == module]


def identify(words: list[str]) -> str:
    return " ".join(words)


@pytest.mark.parametrize("words", calls_of("pipeline"), ids=identify)
def test_experiments(words, capsys):
    needs_a_folder = any(word.startswith(("resume=", "hydra.run.dir=", "--config-dir")) for word in words)
    if not words:
        assert cli.main(words) == 2
    elif needs_a_folder or "-m" in words:
        of_ours = [
            word for word in words if "=" in word and not word.startswith(("resume=", "+experiment=my_"))
        ]
        check_overrides(parse(rewrite_controller_paths(of_ours)), options([conf_folder()]))
    else:
        assert cli.main([*words, "--cfg", "job"]) == 0, capsys.readouterr().err


@pytest.mark.parametrize("words", calls_of("telemetry"), ids=identify)
def test_telemetry(words):
    assert callable(parsed(commands._parser(), words).run)


@pytest.fixture(scope="module")
def reviewed(tmp_path_factory):
    """A folder with what the commands of the review name."""
    folder = tmp_path_factory.mktemp("reviewed")
    controller = serialize.load(PROJECT / "conf" / "controller" / "paper_champion.yaml")
    run = folder / "outputs" / "train" / "TIME"
    for flight in (folder / "best.mcap", run / "episodes" / "training-0.mcap"):
        log_flight(flight, controller, 61)
    for place in (folder, run):
        (place / "champion.json").write_text(serialize.dump_json(controller), encoding="utf-8")
    simpler = replace(controller, systems=controller.systems[:2])
    (folder / "simpler.json").write_text(serialize.dump_json(simpler), encoding="utf-8")
    shutil.copytree(PROJECT / "docs" / "examples", folder / "docs" / "examples")
    return folder


@pytest.mark.parametrize("words", calls_of("fis_tools"), ids=identify)
def test_review(words, reviewed, monkeypatch, capsys):
    monkeypatch.chdir(reviewed)
    expanded = [path for word in words for path in (sorted(glob(word)) if "*" in word else [word])]
    assert review.main(expanded) == 0, capsys.readouterr().err


@pytest.mark.parametrize("words", calls_of("benchmarks"), ids=identify)
def test_benchmarks(words):
    assert set(words) <= set(benchmarks.PARTS)


def parsed(parser: argparse.ArgumentParser, words: list[str]) -> argparse.Namespace:
    return parser.parse_args(words)


def test_every_kind_of_command_is_shown():
    modules = {words[2] for words in COMMANDS}
    assert {"venv", "pipeline", "telemetry", "fis_tools", "benchmarks", "pytest"} <= modules


def test_the_checks_run_what_the_readme_says():
    checks = (PROJECT / ".ci" / "run").read_text(encoding="utf-8")
    for command in ("pip install --quiet --require-hashes -r requirements-dev.txt", "python -m pytest"):
        assert command in checks
        assert command in README


def test_links_lead_somewhere():
    for page in [PROJECT / "README.md", PROJECT / "CONTRIBUTING.md", *(PROJECT / "docs").rglob("*.md")]:
        text = page.read_text(encoding="utf-8")
        for target in re.findall(r"\]\(([^)#\s]+)", text):
            if not target.startswith("https://"):
                assert (page.parent / target).exists(), f"{page}: {target}"
