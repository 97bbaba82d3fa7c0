"""The walls between packages hold, and they can fall; no module needs what only some systems have."""

import shutil

import pytest

from tests.places import PACKAGES, PROJECT
from tests.programs import run_python

#: lines that no wall allows, by the module that they are put into, and what import-linter says of each
BREACHES = {
    "pipeline/utils.py": ("", "utils"),
    "pipeline/settings/checks.py": ("import pipeline.settings.experiment", ".checks -> .experiment"),
    "pipeline/physics/illumination.py": ("import yaml", "pipeline.physics.illumination -> yaml"),
    "pipeline/run/runner.py": ("from omegaconf import OmegaConf", "pipeline.run.runner -> omegaconf"),
    "pipeline/evaluation/monte_carlo.py": ("import deap", "pipeline.evaluation.monte_carlo -> deap"),
    "pipeline/stages/train.py": ("import pipeline.stages.scenario", "pipeline.stages.train"),
    "pipeline/training/fitness.py": ("import json", "pipeline.training.fitness -> json"),
    "fis_tools/engines/kernel.py": ("import skfuzzy", "fis_tools.engines.kernel -> skfuzzy"),
    "fis_tools/analysis/arrays.py": ("import matplotlib", "fis_tools.analysis.arrays -> matplotlib"),
    "fis_tools/render/theme.py": ("import telemetry", "fis_tools.render.theme -> telemetry"),
    "fis_tools/formats/serialize.py": ("import fis_tools.analysis", "fis_tools.formats is not allowed to"),
    "telemetry/file/reader.py": ("import rerun, fis_tools.model", "telemetry.file.reader -> fis_tools.model"),
    "plain_files/streams.py": ("import fis_tools.errors", "plain_files.streams -> fis_tools.errors"),
}


#: runs import-linter's contracts on the packages of a folder
CHECK = "import sys; from importlinter.cli import lint_imports; sys.exit(lint_imports(no_cache=True))"


def test_the_walls_stand():
    run_python("-c", CHECK)


def test_each_breach_is_told(tmp_path):
    for package in PACKAGES:
        shutil.copytree(PROJECT / package, tmp_path / package, ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copy(PROJECT / "pyproject.toml", tmp_path)
    for module, (lines, _) in BREACHES.items():
        with (tmp_path / module).open("a", encoding="utf-8") as stream:
            stream.write(f"\n{lines}\n")
    output = " ".join(run_python("-c", CHECK, folder=tmp_path, path=tmp_path, code=1).stdout.split())
    assert [breach for _, breach in BREACHES.values() if breach not in output] == []


LACKING = ("fcntl", "grp", "pty", "pwd", "resource", "termios", "tty")
#: psutil takes others where it lacks these, which Linux does not have; so it comes first
IMPORTS = f"""
import importlib, pkgutil, psutil, sys
sys.modules.update(dict.fromkeys({LACKING}))
for name in {PACKAGES}:
    for module in pkgutil.walk_packages(importlib.import_module(name).__path__, name + "."):
        if not module.name.endswith("__main__"):
            importlib.import_module(module.name)
            print(module.name)
"""


@pytest.mark.slow
def test_every_module_is_imported_without_what_only_posix_has():
    """What can be shown on Linux of systems that have less."""
    done = run_python("-c", IMPORTS)
    files = [path for name in PACKAGES for path in (PROJECT / name).rglob("*.py")]
    assert len(done.stdout.split()) >= sum(path.stem not in {"__init__", "__main__"} for path in files)
