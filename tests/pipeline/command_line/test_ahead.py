"""A run that a second process composes is the one that this process would have composed."""

import os
from functools import partial

import pytest

from pipeline.command_line.ahead import planning
from pipeline.command_line.config import compose_experiment
from pipeline.command_line.runs import start_new
from pipeline.run import artifacts, maker
from tests.pipeline.command_line.cases import COAST
from tests.pipeline.command_line.test_start import run_python


@pytest.fixture(autouse=True, params=[1, 2])
def processors(request, monkeypatch):
    monkeypatch.setattr(os, "cpu_count", lambda: request.param)


def begun(*arguments):
    with planning(arguments) as planned:
        return planned()


def test_a_new_run_is_composed_as_here(tmp_path):
    words = ["+experiment=fly", COAST, "deputy.mass_kg=13", f"hydra.run.dir={tmp_path / 'run'}"]
    begin = begun(*words)
    assert isinstance(begin, partial)
    assert begin.func is start_new
    job, command = begin.args
    here = compose_experiment(words)
    assert (job.config, job.experiment, job.folder) == (here.config, here.experiment, here.folder)
    assert command[:3] == words[:3]


def test_a_mistake_comes_back_as_its_message():
    assert begun("+experiment=fly", "sede=3") == "there is no key sede; did you mean seed?"


def test_with_hydras_own_errors_a_mistake_is_left_to_this_process(monkeypatch):
    monkeypatch.setenv("HYDRA_FULL_ERROR", "1")
    assert begun("+experiment=fly", "sede=3") is None


@pytest.mark.parametrize(
    "words", [(), ("--help",), ("+experiment=fly", "-m"), ("resume=a",), ("summary", "a")]
)
def test_other_commands_are_left_to_this_process(words):
    assert begun(*words) is None


def test_so_is_a_folder_that_holds_a_run(tmp_path):
    (tmp_path / artifacts.MANIFEST).write_text("{}")
    assert begun("+experiment=fly", COAST, f"hydra.run.dir={tmp_path}") is None


def test_a_command_does_not_import_hydra_itself(tmp_path):
    code = (
        "import os, sys; from pipeline.__main__ import main; "
        f"sys.argv[1:] = ['+experiment=fly', {COAST!r}, 'hydra.run.dir=run']; "
        "print(main(), 'hydra' in sys.modules, os.cpu_count() == 1)"
    )
    done = run_python("-c", code, folder=tmp_path, path=maker.SOURCES)
    code, is_imported, is_alone = done.stdout.splitlines()[-1].split()
    assert (code, is_imported) == ("0", is_alone)
