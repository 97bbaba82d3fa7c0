"""How the command starts: quickly, from any folder, installed or not."""

import os
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from pipeline.command_line.config import conf_folder
from pipeline.run import maker

HEAVY = [
    "numpy",
    "numba",
    "sklearn",
    "matplotlib",
    "deap",
    "pyarrow",
    "rerun",
    "mcap",
    "skfuzzy",
    "pipeline.flight.fly.many",
]


def run_python(*arguments: str, folder: Path, path: Path) -> subprocess.CompletedProcess[str]:
    environment = {**os.environ, "PYTHONPATH": str(path)}
    command = [sys.executable, *arguments]
    return subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, check=False)  # noqa: S603


def test_a_mistake_is_told_before_anything_heavy_is_loaded(tmp_path):
    code = (
        "import sys; from pipeline.command_line.cli import main; code = main(['+experiment=fly', 'sede=3']); "
        f"print(code, [name for name in {HEAVY} if name in sys.modules])"
    )
    done = run_python("-c", code, folder=tmp_path, path=maker.SOURCES)
    assert done.stdout == "2 []\n"


def test_a_flight_loads_neither_scipy_nor_tables_nor_readers_of_other_programs(tmp_path):
    unused = ["scipy", "pyarrow", "fis_tools.formats.exchange.dialect"]
    code = (
        "import sys, pipeline.command_line.cli, pipeline.controllers.source, pipeline.stages.record\n"
        f"print([name for name in {unused} if name in sys.modules])"
    )
    assert run_python("-c", code, folder=tmp_path, path=maker.SOURCES).stdout == "[]\n"


def test_ctrl_c_while_the_program_is_loaded_ends_in_a_sentence(tmp_path):
    code = (
        "import sys\n"
        "from pipeline.__main__ import main\n"
        "class Stopping:\n"
        "    def find_spec(self, name, path, target=None):\n"
        "        if name == 'hydra': raise KeyboardInterrupt\n"
        "sys.meta_path.insert(0, Stopping())\n"
        "sys.exit(main())"
    )
    done = run_python("-c", code, folder=tmp_path, path=maker.SOURCES)
    assert done.returncode == 130
    assert done.stderr == "\ninterrupted before anything was done; nothing to keep\n"


@pytest.mark.slow
def test_it_runs_where_conf_lies_inside_the_package(tmp_path):
    for package in ("pipeline", "fis_tools", "telemetry"):
        ignored = shutil.ignore_patterns("__pycache__", "conf")
        shutil.copytree(maker.SOURCES / package, tmp_path / "installed" / package, ignore=ignored)
    shutil.copytree(conf_folder(), tmp_path / "installed" / "pipeline" / "conf")
    (tmp_path / "elsewhere").mkdir()
    words = ["-m", "pipeline", "+experiment=fly", "controller=coast", "--cfg", "job"]
    done = run_python(*words, folder=tmp_path / "elsewhere", path=tmp_path / "installed")
    assert (done.returncode, done.stderr) == (0, "")
    assert "name: fly" in done.stdout
    misspelt = run_python(
        "-m", "pipeline", "+experiment=fyl", folder=tmp_path / "elsewhere", path=tmp_path / "installed"
    )
    assert misspelt.returncode == 2
    assert misspelt.stderr.startswith("error: there is no experiment=fyl; did you mean fly?")


def test_the_distributions_name_is_the_projects():
    project = tomllib.loads((maker.SOURCES / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    assert project["name"] == maker.DISTRIBUTION
    assert maker.product_version() == project["version"]
