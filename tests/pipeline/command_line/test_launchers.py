"""The runs of a sweep under Hydra's launchers: equal files, whatever runs them, and where jobs are killed."""

import re
import shlex
import subprocess
import sys
import time
from pathlib import Path

import pytest
import submitit
from joblib.externals.loky import get_reusable_executor

from pipeline.command_line.cli import main
from pipeline.command_line.config import LAUNCHERS
from pipeline.command_line.endings import OK, UNIMPROVED
from pipeline.run import artifacts, manifests, sweep, tables
from tests import slurm
from tests.hostile import faults, kills
from tests.places import PROJECT

pytestmark = [
    pytest.mark.slow,
    # submitit_local does not wait for a job whose result is there
    pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning", "ignore::ResourceWarning"),
]

#: so short a training may not improve on what it was given
DONE = (OK, UNIMPROVED)
SMALL = [
    "stages=[scenario,train,evaluate]",
    "optimizer.population_size=8",
    "optimizer.generations=6",
    "optimizer.rounds=1",
    "monte_carlo.num_cases=8",
    "duration_s=600",
]
TRAIN = ["-m", "+experiment=train", *SMALL, "seed=1,2"]
#: until the jobs of SLURM's stand-in must have ended
PATIENCE_S = 600.0
MACHINES = (PROJECT / "docs/how-to/run-on-many-machines.md").read_text(encoding="utf-8")
PAGE = MACHINES.partition("## Sweeps as jobs\n")[2].partition("\n## ")[0]


@pytest.fixture(scope="module")
def basic(tmp_path_factory) -> Path:
    """A sweep that Hydra's own launcher ran, one run after the other."""
    folder = tmp_path_factory.mktemp("basic") / "sweep"
    assert main([*TRAIN, f"hydra.sweep.dir={folder}"]) in DONE
    return folder


@pytest.fixture
def cluster(tmp_path, monkeypatch):
    """Work in a folder with stand-ins for SLURM's commands; return what has a run killed, once."""
    for name, value in kills.environment(**slurm.installed(tmp_path / "slurm")).items():
        monkeypatch.setenv(name, value)
    monkeypatch.chdir(tmp_path)
    # no slow file system, on which the result of a lost job may yet appear
    monkeypatch.setattr(submitit.Job, "_results_timeout_s", 0.0)

    def kill_in(run: str) -> None:
        path = f"{run}/{artifacts.CHECKPOINT}"
        for name, value in faults.killed_at(path, 3, tmp_path / "killer").items():
            monkeypatch.setenv(name, value)

    yield kill_in
    get_reusable_executor().shutdown(kill_workers=True)  # joblib's know this environment alone


def ended(words: list[str], capsys) -> tuple[int, str]:
    """Run a command in this process; return its exit code and what it tells."""
    capsys.readouterr()
    return main(words), capsys.readouterr().err


def miniature(words: list[str]) -> list[str]:
    """Return a command of the page with fewer runs, of sizes at which a training ends within seconds."""
    if "+experiment=train" not in words:
        return words
    return [*("seed=1,2" if word == "seed=1,2,3,4" else word for word in words), *SMALL]


def commands_of_page() -> list[list[str]]:
    """Return those of sweeps."""
    blocks = re.findall(r"```sh\n(.*?)```", PAGE, re.DOTALL)
    lines = [line for block in blocks for line in block.replace("\\\n", " ").splitlines()]
    results = [shlex.split(line, comments=True) for line in lines]
    return [words[3:] for words in results if words[:3] == ["python", "-m", "pipeline"]]


def check_lost(code: int, errors: str, folder: str) -> None:
    """Check what a command says whose launcher has lost a run."""
    assert code == 1, errors
    assert "the launcher lost a run" in errors
    assert f"python -m pipeline resume={folder}" in errors


def test_the_commands_of_the_cluster_page_work_where_jobs_are_killed(basic, cluster, tmp_path, capsys):
    """In turn, in one folder, as its reader gives them; what was lost goes on under any launcher."""
    last = LAUNCHERS[-1]
    (start, *others), (beside,) = (
        [words for words in commands_of_page() if ("hydra/launcher=joblib" in words) == is_beside]
        for is_beside in (False, True)
    )
    cluster("trained/seed=1")
    check_lost(*ended(miniature(start), capsys), "trained")
    for words in others:
        code, errors = ended(words, capsys)
        assert code in DONE, (words, errors)
    assert "resume=trained" in others[-1]
    assert "2 of 2 runs are done" in errors
    assert kills.differences(tmp_path / "trained", basic) == []

    cluster("beside/seed=1")
    check_lost(*ended(miniature(beside), capsys), "beside")
    for launcher in (name for name in LAUNCHERS if name not in ("joblib", last)):
        cluster("beside/seed=1")
        check_lost(*ended(["resume=beside", f"hydra/launcher={launcher}"], capsys), "beside")
    code, errors = ended(["resume=beside", f"hydra/launcher={last}"], capsys)
    assert code in DONE, errors
    # workers are set beside the other
    assert kills.differences(tmp_path / "beside", basic) == [f"seed={seed}/config.yaml" for seed in (1, 2)]
    for folder in ("trained", "beside"):
        first, second = (manifests.read(path / "seed=1")["makers"] for path in (tmp_path / folder, basic))
        for maker in (*first, *second):  # tests beside one another have fewer threads than a job of their own
            maker["processor"].pop("blas")
        assert all(maker == second[0] for maker in first)


def test_the_job_array_of_the_page_goes_on_where_a_job_was_killed_and_is_summarised(
    basic, cluster, tmp_path, capsys
):
    (script,) = re.findall(r"```bash\n(.*?)```", PAGE, re.DOTALL)
    for written, flown in [
        ("+experiment=train", f"+experiment=train {' '.join(SMALL)}"),
        ("--array=1-4", "--array=1-2"),
        ("exec python", f"exec {sys.executable}"),
    ]:
        assert written in script
        script = script.replace(written, flown)
    Path("seeds.sh").write_text(script)
    cluster("seeds/1")
    subprocess.run(["sbatch", "seeds.sh"], check=True)  # noqa: S607
    limit = time.monotonic() + PATIENCE_S
    ended_states = {"COMPLETED", "FAILED"}  # failed: did not improve
    while not set(slurm.states(tmp_path / "slurm").values()) <= ended_states:
        assert time.monotonic() < limit
        time.sleep(0.05)
    assert slurm.requeued(tmp_path / "slurm") == ["100_1"]
    code, errors = ended(["summary", "seeds"], capsys)
    assert code in DONE, errors
    assert tables.read_parquet(tmp_path / "seeds", "summary.parquet")["seed"].tolist() == ["1", "2"]
    for seed in ("1", "2"):
        assert kills.differences(tmp_path / "seeds" / seed, basic / f"seed={seed}") == []


def test_a_launcher_that_is_not_installed_is_named_with_its_cure(monkeypatch, ran, tmp_path):
    from hydra.core.config_store import ConfigStore  # noqa: PLC0415
    from hydra.core.plugins import Plugins  # noqa: PLC0415

    Plugins.instance()  # by which launchers come into the store
    launchers = ConfigStore.instance().repo["hydra"]["launcher"]
    for name in [name for name in launchers if name != "basic.yaml"]:
        monkeypatch.delitem(launchers, name)
    monkeypatch.chdir(tmp_path)
    for name in LAUNCHERS:
        words = ["-m", "+experiment=fly", "controller=coast", "seed=1,2", f"hydra/launcher={name}"]
        package = {"joblib": "joblib"}.get(name, "submitit")
        assert f"install it: python -m pip install hydra-{package}-launcher" in ran(*words, code=2).err
    assert list(tmp_path.iterdir()) == []


def test_what_became_of_a_run_is_in_its_folder(tmp_path):
    sweep.write_ending(tmp_path, sweep.Ending(2, "disk full"))
    assert sweep.read_ending(tmp_path) == (2, "disk full")
    (tmp_path / sweep.ENDING).write_text("[")
    assert sweep.read_ending(tmp_path) == (0, "")
    sweep.write_ending(tmp_path, sweep.Ending())
    assert list(tmp_path.iterdir()) == []
