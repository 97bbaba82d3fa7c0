"""What is installed: three packages with their configuration, working from any folder."""

import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

from pipeline.run import artifacts
from tests.smoke.command_line import PROJECT, run_module

PACKAGES = ("pipeline", "fis_tools", "telemetry")


@pytest.fixture(scope="module")
def wheel(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("wheel")
    command = [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", str(folder)]
    subprocess.run(command, cwd=PROJECT, check=True, capture_output=True)  # noqa: S603
    (path,) = folder.glob("*.whl")
    return path


@pytest.fixture(scope="module")
def installed(wheel, tmp_path_factory) -> Path:
    """A folder with the wheel's packages and nothing else of ours."""
    site = tmp_path_factory.mktemp("site")
    run_module(
        "pip", "install", "--quiet", "--no-index", "--no-deps", "--no-compile", "--target", site, wheel,
        folder=site,
    )  # fmt: skip
    return site


def test_it_holds_the_packages_and_the_configuration_inside_pipeline_and_nothing_else(wheel):
    names = {name for name in zipfile.ZipFile(wheel).namelist() if ".dist-info/" not in name}
    expected = {
        path.relative_to(PROJECT).as_posix()
        for package in PACKAGES
        for path in (PROJECT / package).rglob("*")
        if path.is_file() and path.parent.name != "__pycache__"
    }
    expected |= {
        f"pipeline/{path.relative_to(PROJECT).as_posix()}"
        for path in (PROJECT / "conf").rglob("*")
        if path.is_file()
    }
    assert names == expected
    assert "telemetry/file/schema/inspection.proto" in names
    assert "pipeline/conf/experiment/train.yaml" in names


def test_it_flies_from_any_folder_with_experiments_of_ones_own(installed, tmp_path):
    own = tmp_path / "mine" / "experiment"
    own.mkdir(parents=True)
    (own / "drift.yaml").write_text(
        "# @package _global_\n# Drift for ten minutes.\n"
        "defaults:\n  - override /controller: coast\n"
        "name: drift\nstages: [record]\nduration_s: 600.0\n"
        "telemetry: {record_training: false, record_ranked: false, record_start: true}\n"
    )
    # compiled code of another folder would have to be compiled anew, which takes longer than to fly without
    environment = {"PYTHONPATH": str(installed), "NUMBA_DISABLE_JIT": "1"}
    done = run_module(
        "pipeline", "--config-dir", "mine", "+experiment=drift", folder=tmp_path, environment=environment
    )
    folder = tmp_path / done.stdout.strip()
    assert (folder / "episodes" / "start.mcap").is_file()
    versions = artifacts.read_manifest(folder)["versions"]
    assert versions["product"] == artifacts.product_version()
    listed = run_module(
        "pipeline", "--help", "--config-dir", "mine", folder=tmp_path, environment=environment
    )
    assert "Drift for ten minutes." in listed.stdout
    where = run_module("pipeline", "--version", folder=tmp_path, environment=environment).stdout
    assert where == f"{artifacts.DISTRIBUTION} {artifacts.product_version()}\n"
