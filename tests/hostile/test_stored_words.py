"""What a received sweep says is data: nothing in it is composed, run, resolved, or leads elsewhere."""

import json
import shutil
import sys
from pathlib import Path

import pytest

from pipeline.command_line import config as composing
from pipeline.command_line.stored_words import config_of
from pipeline.run import artifacts, configuration, sweep
from pipeline.run.sweep import SweptRun
from tests.pipeline.command_line.cases import EVALUATE, FLY, plain_config, use_stages


@pytest.fixture(autouse=True)
def _elsewhere(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def old_sweep(sent: str, **entry) -> Path:
    """A sweep of version 1 with one run, whose folder is not there."""
    run = {"folder": "a", "differs": {}, "command": EVALUATE, "failure": ""} | entry
    Path(sent).mkdir()
    Path(sent, sweep.SWEEP).write_text(json.dumps({"sweep_version": 1, "runs": [run]}))
    return Path(sent)


def test_a_package_in_a_stored_search_path_is_not_imported(tmp_path, monkeypatch, ran):
    called = use_stages(monkeypatch)
    command = ["+experiment=evaluate", "hydra.searchpath=[pkg://evil]"]
    folder = old_sweep("evil", command=command)
    (folder / "__init__.py").write_text(f"open({str(tmp_path / 'ran')!r}, 'w')")
    monkeypatch.syspath_prepend(tmp_path)
    printed = ran("resume=evil", code=2).err
    assert "no plain values of keys: hydra.searchpath=[pkg://evil]" in printed
    assert "python -m pipeline +experiment=evaluate hydra.run.dir=evil/a" in printed
    assert not (tmp_path / "ran").exists()
    assert "evil" not in sys.modules
    assert called == []


@pytest.mark.parametrize(
    "word",
    [
        *(
            "--config-dir=mine",
            "name=${oc.env:HOME}",
            "hydra.run.dir=x",
            "~sun",
            "sun=../../x",
            "+sun=nothing",
        ),
        *("name='x'", "name=\\${x}", "+hydra.callbacks.x._target_=os.system", "experiment@x=fly", "seed=1,2"),
        *("hydra/launcher=joblib", "controller.${x}=1", "+experiment=[fly]", "nothing=1", "-m", ""),
    ],
)
def test_a_stored_word_that_is_no_plain_value_is_refused_by_name(word, monkeypatch, ran):
    monkeypatch.setattr("pipeline.command_line.stored_words.compose_node", None)
    called = use_stages(monkeypatch)
    old_sweep("s", command=[*EVALUATE, word])
    assert f"no plain values of keys: {word}." in ran("resume=s", code=2).err
    assert called == []


@pytest.mark.parametrize(
    "folder",
    [
        "${oc.env:ELSEWHERE}/x",
        "..",
        "a/../b",
        "/a",
        "a b$",
        "`id`",
        "a;b",
        "'a'",
        "",
        ".",
        ".hidden",
        "-m",
        "a\\b",
        "\x1b",
    ],
)
def test_the_folder_of_a_stored_run_is_a_plain_name(folder, tmp_path, monkeypatch, ran):
    monkeypatch.setenv("ELSEWHERE", str(tmp_path / "elsewhere"))
    called = use_stages(monkeypatch)
    old_sweep("s", folder=folder)
    for words in (["resume=s"], ["summary", "s"]):
        assert "is no file of a sweep" in ran(*words, code=2).err
    assert called == []
    assert sorted(path.name for path in tmp_path.rglob("*")) == ["s", "sweep.json"]


def test_a_folder_whose_name_hydra_would_replace_is_refused(tmp_path, monkeypatch, ran):
    called = use_stages(monkeypatch)
    name = "${oc.env:HOME}"
    ran("-m", *FLY, "hydra.sweep.dir=s", "seed=1,2")
    shutil.rmtree("s/seed=2")
    called.clear()
    Path("s").rename(name)
    assert "rename the folder" in ran(f"resume={name}", code=2).err
    monkeypatch.chdir(name)
    assert "rename the folder" in ran(*FLY, code=2).err
    assert called == []


@pytest.mark.parametrize(
    "words",
    [
        ["+experiment=evaluate", "controller=champion_27", "seed=3", "deputy.mass_kg=11.5", "sun=random"],
        ["+experiment=fit_mission", "monte_carlo.min_distance_m=40", "stages=[scenario,fit]", "world=leo"],
        ["+experiment=train", "optimizer=champion", "optimizer.generations=3", "name=mine"],
    ],
)
def test_plain_values_come_to_what_was_composed(words, tmp_path):
    run = SweptRun("a", {}, tuple(words))
    assert config_of(tmp_path, run) == composing.compose_experiment(words).config


def test_a_sweep_keeps_what_its_runs_were_checked_with_and_composes_nothing(monkeypatch, ran):
    use_stages(monkeypatch)
    ran("-m", *EVALUATE, "hydra.sweep.dir=s", "controller=coast,lqr", "seed=1,2")
    runs = sweep.read(Path("s"))
    before = {run.folder: Path("s", run.folder, artifacts.CONFIG).read_bytes() for run in runs}
    for run in runs:
        assert run.config == configuration.read(Path("s", run.folder))
        shutil.rmtree(Path("s", run.folder))
    called = use_stages(monkeypatch)
    monkeypatch.setattr(composing, "compose", None)
    ran("resume=s")
    assert len({(e.seed, e.controller["kind"]) for _, e, _ in called}) == 4
    assert {name: Path("s", name, artifacts.CONFIG).read_bytes() for name in before} == before


def test_an_expression_in_a_stored_configuration_stays_text(tmp_path, monkeypatch, ran):
    called = use_stages(monkeypatch)
    config = plain_config()
    config["report"]["title"] = "${oc.env:HOME}"
    configuration.write(tmp_path / "run", config)
    ran("resume=run")
    assert called[0][1].report.title == "${oc.env:HOME}"
