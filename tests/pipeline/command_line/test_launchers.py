"""The runs of a sweep under Hydra's launchers: equal files, whatever runs them, and where jobs are killed."""

import json
import os
import re
import shlex
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from pipeline.command_line.cli import main
from pipeline.command_line.hydra_errors import LAUNCHERS
from pipeline.command_line.runs import OK, UNIMPROVED
from pipeline.run import artifacts, manifests, sweep, tables
from pipeline.run.lock import LOCK
from tests import slurm
from tests.hostile import kills
from tests.places import PROJECT

pytestmark = pytest.mark.slow

#: so short a training may not improve on what it was given
DONE = (OK, UNIMPROVED)
NAMES = [name.rpartition("/")[2] for name in LAUNCHERS]
SMALL = [
    "optimizer.population_size=8",
    "optimizer.generations=6",
    "monte_carlo.num_cases=8",
    "duration_s=600",
]
TRAIN = ["-m", "+experiment=train", "stages=[scenario,train,evaluate]", *SMALL, "seed=1,2"]
#: the same for longer, so that it can be killed
LONG = [word.replace("generations=6", "generations=150") for word in TRAIN]
#: until a run must have begun, or ended
PATIENCE_S = 600.0
PAGE = (PROJECT / "docs/how-to/run-on-a-cluster.md").read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def basic(tmp_path_factory) -> Path:
    """A sweep that Hydra's own launcher ran, one run after the other."""
    folder = tmp_path_factory.mktemp("basic") / "sweep"
    assert main([*TRAIN, f"hydra.sweep.dir={folder}"]) in DONE
    return folder


@pytest.fixture
def cluster(tmp_path) -> dict[str, str]:
    """The environment of commands, with stand-ins for SLURM's."""
    return kills.environment(**slurm.installed(tmp_path / "slurm"))


def run(words: list[str], env: dict[str, str], cwd: Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run(kills.command(words), env=env, cwd=cwd, capture_output=True, text=True, check=False)  # noqa: S603


def until(is_so) -> None:
    """Wait for something to become true."""
    limit = time.monotonic() + PATIENCE_S
    while not is_so():
        assert time.monotonic() < limit
        time.sleep(0.05)


def kill_worker(folder: Path) -> None:
    """Kill the process that is at work in a run's folder, once it has kept some of its work."""
    until(lambda: (folder / artifacts.CHECKPOINT).exists() and (folder / LOCK).exists())
    os.kill(json.loads((folder / LOCK).read_text())["process"], signal.SIGKILL)


@pytest.mark.parametrize("launcher", NAMES)
def test_files_are_equal_under_every_launcher(launcher, basic, cluster, tmp_path):
    done = run([*TRAIN, f"hydra/launcher={launcher}", "hydra.sweep.dir=sweep"], cluster, tmp_path)
    assert done.returncode in DONE, done.stderr
    assert "2 of 2 runs are done" in done.stderr
    assert kills.differences(tmp_path / "sweep", basic) == []
    first, second = (manifests.read(folder / "seed=1")["makers"] for folder in (tmp_path / "sweep", basic))
    for maker in (*first, *second):  # tests beside one another have fewer threads than a job of their own
        maker["processor"].pop("blas")
    assert first == second


@pytest.fixture(scope="module")
def long(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("long") / "sweep"
    assert main([*LONG, f"hydra.sweep.dir={folder}"]) in DONE
    return folder


@pytest.mark.parametrize(("launcher", "then"), [("joblib", "submitit_slurm"), ("submitit_local", "joblib")])
def test_a_sweep_whose_worker_is_killed_goes_on_under_another_launcher(
    launcher, then, long, cluster, tmp_path
):
    words = [*LONG, f"hydra/launcher={launcher}", "hydra.sweep.dir=sweep"]
    with subprocess.Popen(  # noqa: S603
        kills.command(words), env=cluster, cwd=tmp_path, stderr=subprocess.PIPE, text=True
    ) as process:
        kill_worker(tmp_path / "sweep" / "seed=1")
        stderr = process.communicate()[1]
    assert process.returncode == 1, stderr
    assert "the launcher lost a run" in stderr
    assert "python -m pipeline resume=sweep" in stderr
    done = run(["resume=sweep", f"hydra/launcher={then}"], cluster, tmp_path)
    assert done.returncode in DONE, done.stderr
    assert kills.differences(tmp_path / "sweep", long) == []


def miniature(words: list[str]) -> list[str]:
    """Return a command of the page with sizes at which a training ends within seconds."""
    return [*words, *SMALL, "stages=[scenario,train,evaluate]"] if "+experiment=train" in words else words


def commands_of_page() -> list[list[str]]:
    blocks = re.findall(r"```sh\n(.*?)```", PAGE, re.DOTALL)
    lines = [line for block in blocks for line in block.replace("\\\n", " ").splitlines()]
    results = [shlex.split(line, comments=True) for line in lines]
    return [words[3:] for words in results if words[:3] == ["python", "-m", "pipeline"]]


def test_the_commands_of_the_cluster_page_work(cluster, tmp_path):
    """In turn, in one folder, as its reader gives them."""
    commands = commands_of_page()
    assert any("hydra/launcher=submitit_slurm" in words for words in commands)
    for words in commands:
        done = run(miniature(words), cluster, tmp_path)
        assert done.returncode in DONE, (words, done.stderr)


def test_the_job_array_of_the_page_goes_on_where_a_job_was_killed_and_is_summarised(cluster, tmp_path):
    (script,) = re.findall(r"```bash\n(.*?)```", PAGE, re.DOTALL)
    small = " ".join(
        [*SMALL[:1], "optimizer.generations=150", *SMALL[2:], "stages=[scenario,train,evaluate]"]
    )
    script = script.replace("+experiment=train", f"+experiment=train {small}").replace(
        "--array=1-4", "--array=1-2"
    )
    (tmp_path / "seeds.sh").write_text(script.replace("exec python", f"exec {sys.executable}"))
    subprocess.run(["sbatch", "seeds.sh"], env=cluster, cwd=tmp_path, check=True)  # noqa: S607
    kill_worker(tmp_path / "seeds" / "1")
    ended = {"COMPLETED", "FAILED"}
    until(lambda: len(states := slurm.states(tmp_path / "slurm")) == 2 and set(states.values()) <= ended)
    assert set(slurm.states(tmp_path / "slurm").values()) == {"COMPLETED"}
    assert slurm.requeued(tmp_path / "slurm") == ["100_1"]
    done = run(["summary", "seeds"], cluster, tmp_path)
    assert done.returncode in DONE, done.stderr
    assert tables.read_parquet(tmp_path / "seeds", "summary.parquet")["seed"].tolist() == ["1", "2"]


def test_a_launcher_that_is_not_installed_is_named_with_its_cure(monkeypatch, ran, tmp_path):
    from hydra.core.config_store import ConfigStore  # noqa: PLC0415

    launchers = ConfigStore.instance().repo["hydra"]["launcher"]
    for name in [name for name in launchers if name != "basic.yaml"]:
        monkeypatch.delitem(launchers, name)
    monkeypatch.chdir(tmp_path)
    for name, package in LAUNCHERS.items():
        words = [
            "-m",
            "+experiment=fly",
            "controller=coast",
            "seed=1,2",
            name.replace("launcher/", "launcher="),
        ]
        assert f"install it: python -m pip install {package}" in ran(*words, code=2).err
    assert list(tmp_path.iterdir()) == []


def test_what_became_of_a_run_is_in_its_folder(tmp_path):
    sweep.write_ending(tmp_path, sweep.Ending(2, "disk full"))
    assert sweep.read_ending(tmp_path) == (2, "disk full")
    (tmp_path / sweep.ENDING).write_text("[")
    assert sweep.read_ending(tmp_path) == (0, "")
    sweep.write_ending(tmp_path, sweep.Ending())
    assert list(tmp_path.iterdir()) == []
