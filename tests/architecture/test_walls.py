"""The walls between packages hold, and they can fall."""

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests.places import PROJECT

PACKAGES = ("pipeline", "fis_tools", "telemetry")


def check_walls(folder: Path) -> tuple[int, str]:
    """Run import-linter's contracts on the packages of a folder."""
    code = "import sys; from importlinter.cli import lint_imports; sys.exit(lint_imports(no_cache=True))"
    command = [sys.executable, "-c", code]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)  # noqa: S603
    return done.returncode, " ".join(done.stdout.split())


def test_the_walls_stand():
    code, told = check_walls(PROJECT)
    assert code == 0, told


@pytest.mark.parametrize(
    ("module", "line", "told"),
    [
        ("pipeline/utils.py", "", "utils"),
        ("pipeline/physics/illumination.py", "import yaml", "pipeline.physics.illumination -> yaml"),
        ("pipeline/run/runner.py", "from omegaconf import OmegaConf", "pipeline.run.runner -> omegaconf"),
        ("pipeline/evaluation/monte_carlo.py", "import deap", "pipeline.evaluation.monte_carlo -> deap"),
        ("pipeline/stages/train.py", "import pipeline.stages.scenario", "pipeline.stages.train"),
        ("pipeline/flight/simulation.py", "import telemetry", "pipeline.flight.simulation -> telemetry"),
        (
            "pipeline/settings/checks.py",
            "import pipeline.settings.experiment",
            "pipeline.settings.checks -> pipeline.settings.experiment",
        ),
        ("pipeline/flight/kernel/preview.py", "import pyarrow", "pipeline.flight.kernel.preview -> pyarrow"),
        ("pipeline/flight/kernel/urgency.py", "import pyarrow", "pipeline.flight.kernel.urgency -> pyarrow"),
        ("pipeline/flight/controller.py", "import json", "pipeline.flight.controller -> json"),
        ("fis_tools/engines/kernel.py", "import skfuzzy", "fis_tools.engines.kernel -> skfuzzy"),
        ("fis_tools/analysis/arrays.py", "import matplotlib", "fis_tools.analysis.arrays -> matplotlib"),
        ("fis_tools/render/theme.py", "import telemetry", "fis_tools.render.theme -> telemetry"),
        ("telemetry/file/reader.py", "import rerun", "telemetry.file.reader -> rerun"),
        ("telemetry/file/reader.py", "import fis_tools.model", "telemetry.file.reader -> fis_tools.model"),
    ],
)
def test_a_breach_is_told(module, line, told, tmp_path):
    for package in PACKAGES:
        shutil.copytree(PROJECT / package, tmp_path / package, ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copy(PROJECT / "pyproject.toml", tmp_path)
    with (tmp_path / module).open("a", encoding="utf-8") as stream:
        stream.write(f"\n{line}\n")
    code, output = check_walls(tmp_path)
    assert code == 1
    assert told in output
